//! The table `doppler`.

use super::document::Document;
use super::error::SceneError;
use super::table::Stated;
use crate::probe::Probe;
use crate::settings::Doppler;

/// The settings of the table, which must fit the probe and each other.
pub(super) fn doppler(
    document: &Document<'_>,
    stated: &Stated,
    probe: &Probe,
) -> Result<Doppler, SceneError> {
    let made: Doppler = stated.get("");
    for (low, high, key) in [(made.left, made.right, "right"), (made.top, made.bottom, "bottom")] {
        if stated.keys().next().is_some() && low >= high {
            let message = format!("the colour box ends at {high}, where it begins at {low}");
            let remedy = "give edges in order: left before right, top before bottom";
            let at = if stated.has(key) {
                key
            } else if key == "right" {
                "left"
            } else {
                "top"
            };
            return Err(document.fail(&format!("doppler.{at}"), message, remedy));
        }
    }
    // Echoes of one pulse have to come back before the next is sent.
    let deepest = made.bottom * probe.depth;
    let most = probe.speed * 1e6 / (2.0 * deepest);
    if stated.has("prf") && made.prf > most {
        let message = format!(
            "echoes from the box's lower edge, {deepest:.0} mm deep, take longer than from one of {:.0} pulses a second to the next",
            made.prf
        );
        let remedy = format!("at most {most:.0} Hz: lower `prf`, or raise the box (`bottom`)");
        return Err(document.fail("doppler.prf", message, remedy));
    }
    Ok(made)
}
