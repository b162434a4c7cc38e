//! The table `contact`.

use std::sync::Arc;

use super::document::Document;
use super::error::SceneError;
use super::fusion::closed_mesh;
use super::table::Table;
use super::tissues::Tissues;
use crate::scene::{Contact, Instance, Mesh};
use crate::settings::units::LENGTH;
use crate::settings::{Form, group};

/// A good layer of coupling gel, mm. Scanning guides ask for enough of it that no air is left between
/// face and skin, which a few millimetres do on a body that is not flat; stand-off pads, for what lies
/// directly below the skin, are 5 to 20 mm thick.
const GEL: f64 = 3.0;
/// Thicker than any stand-off pad, mm.
const THICKEST: f64 = 30.0;

group! {
    /// The skin, which the probe has to touch.
    pub struct ContactKeys in "contact" {
        /// Names of the meshes, of which the union is the body that the probe is held to: the skin, or where that is a
        /// thin layer also what lies below it. They must be closed; `cap_openings` closes a mesh file.
        mesh: Vec<String> = Vec::new(), Facts::of(Form::Texts).required().limits("at least one");
        /// Widest gap between face and skin, along the beam, that sound still crosses. A layer of coupling gel fills a
        /// few millimetres, a stand-off pad 5 to 20. The meshes are rigid: where real skin would yield and lie around a
        /// curved face, what it would yield belongs to the gap.
        gel: f64 = GEL, Facts::quantity(&LENGTH, 0.0, THICKEST);
        /// Tissue of the gap, from the face to the first surface: a gel, water, or a stand-off pad. Behind the body the
        /// scene's `background` goes on.
        couplant: String = "gel".to_owned(), Facts::of(Form::Text);
    }
}

pub(super) fn build(
    document: &Document<'_>,
    table: Option<&Table<ContactKeys>>,
    meshes: &[Arc<Mesh>],
    instances: &[Instance],
    tissues: &mut Tissues<'_>,
) -> Result<Option<Contact>, SceneError> {
    let Some(table) = table else {
        return Ok(None);
    };
    let ContactKeys { mesh, gel, couplant } = table.stated.get("");
    if mesh.is_empty() {
        return Err(document.fail(
            "contact.mesh",
            "no mesh is named",
            "name the closed mesh of the skin, or leave [contact] out: then sound gets in everywhere",
        ));
    }
    let skin = mesh.iter().enumerate().map(|(i, name)| {
        let path = format!("contact.mesh.{i}");
        closed_mesh(document, &path, name, "the skin", meshes, instances)
    });
    let skin = skin.collect::<Result<_, _>>()?;
    let couplant = tissues.index("contact.couplant", &couplant)?;
    Ok(Some(Contact { skin, gel, couplant }))
}
