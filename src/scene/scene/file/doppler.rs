//! The table `doppler`.

use super::document::Document;
use super::error::SceneError;
use super::table::Stated;
use crate::probe::Probe;
use crate::settings::Doppler;

/// The settings of the table, which must fit the probe and each other where the file states some.
pub(super) fn doppler(
    document: &Document<'_>,
    stated: &Stated,
    probe: &Probe,
) -> Result<Doppler, SceneError> {
    let made: Doppler = stated.get("");
    let Some(first) = stated.keys().next() else { return Ok(made) };
    match made.fault(probe) {
        None => Ok(made),
        Some((key, message, remedy)) => {
            // The key that is written, where the other one of two is at fault.
            let at = if stated.has(key) { key } else { first };
            Err(document.fail(&format!("doppler.{at}"), message, remedy))
        }
    }
}
