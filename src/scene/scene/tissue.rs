//! The tissues that ship.

use super::{Surface, Tissue};

pub mod table;

impl Tissue {
    /// The shipped tissue called `name`; [`table::names`] lists them.
    pub fn shipped(name: &str) -> Option<Self> {
        table::shipped().into_iter().find(|t| t.name == name)
    }
}
