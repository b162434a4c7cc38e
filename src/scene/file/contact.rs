//! The table `contact`.

use super::document::Document;
use super::error::SceneError;
use super::fusion::closed_mesh;
use super::schema::ContactTable;
use super::within;
use crate::scene::{Contact, Instance, Mesh};

/// A good layer of coupling gel, mm. Scanning guides ask for enough of it that no air is left between
/// face and skin, which a few millimetres do on a body that is not flat; stand-off pads, for what lies
/// directly below the skin, are 5 to 20 mm thick.
const GEL: f64 = 3.0;
/// Thicker than any stand-off pad, mm.
const THICKEST: f64 = 30.0;

pub(super) fn build(
    document: &Document<'_>,
    table: Option<&ContactTable>,
    meshes: &[Mesh],
    instances: &[Instance],
) -> Result<Option<Contact>, SceneError> {
    let Some(table) = table else {
        return Ok(None);
    };
    if table.mesh.is_empty() {
        return Err(document.fail(
            "contact.mesh",
            "no mesh is named",
            "name the closed mesh of the skin, or leave [contact] out: then sound gets in everywhere",
        ));
    }
    let skin = table.mesh.iter().enumerate().map(|(i, name)| {
        let path = format!("contact.mesh.{i}");
        closed_mesh(document, &path, name, "the skin", meshes, instances)
    });
    let skin = skin.collect::<Result<_, _>>()?;
    let gel = table.gel.map_or(GEL, |gel| gel.0);
    within(document, "contact.gel", gel, 0.0, THICKEST, "mm")?;
    Ok(Some(Contact { skin, gel }))
}
