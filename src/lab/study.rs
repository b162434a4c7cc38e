//! User studies: images rated blind by people who know ultrasound, as in section III-B of Starkov et al. 2019.
//! Cases of many images go into a form ([`form`]), their identities into a key ([`key`]) that the assessor
//! does not see; answers ([`answers`]) and key make tables ([`results`]).

pub mod answers;
pub mod form;
pub mod key;
pub mod results;
