//! The tables `simulation`, `imaging` and `live`.

use super::document::Document;
use super::error::SceneError;
use super::table::Table;
use crate::scene::{Imaging, Live, Simulation};
use crate::settings::Group;

pub(super) fn simulation(
    document: &Document<'_>,
    table: &Table<Simulation>,
    frequency: f64,
) -> Result<Simulation, SceneError> {
    let mut out = Simulation { cell: Simulation::default_cell(frequency), ..Simulation::default() };
    table.stated.put(document, Simulation::TABLE, &mut out)?;
    out.cell /= out.crowding();
    Ok(out)
}

pub(super) fn imaging(
    document: &Document<'_>,
    table: &Table<Imaging>,
) -> Result<Imaging, SceneError> {
    let mut out = Imaging::default();
    table.stated.put(document, Imaging::TABLE, &mut out)?;
    Ok(out)
}

pub(super) fn live(document: &Document<'_>, table: &Table<Live>) -> Result<Live, SceneError> {
    let mut out = Live::default();
    table.stated.put(document, Live::TABLE, &mut out)?;
    Ok(out)
}
