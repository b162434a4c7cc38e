//! The tables of Doppler modes, which must fit the probe.

use super::document::Document;
use super::error::SceneError;
use super::table::Stated;

/// Refuses settings that do not fit the probe or each other, where the file states some of them: `fault` says the key, the
/// cause and the remedy.
pub(super) fn fits(
    document: &Document<'_>,
    table: &str,
    stated: &Stated,
    fault: Option<(&str, String, String)>,
) -> Result<(), SceneError> {
    let (Some((key, message, remedy)), Some(first)) = (fault, stated.keys().next()) else {
        return Ok(());
    };
    // The key that is written, where the other one of two is at fault.
    let at = if stated.has(key) { key } else { first };
    Err(document.fail(&format!("{table}.{at}"), message, remedy))
}
