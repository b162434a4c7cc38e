//! Rays and what they meet, in double precision and on the device; for the suite of all kinds of rays and for the row of physics.

pub mod beating;
pub mod compare;
pub mod device;
pub mod rays;
