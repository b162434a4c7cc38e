//! Commands of OpenIGTLink clients, carried out in the window.

use std::path::PathBuf;
use std::time::Instant;

use super::error::message_of;
use super::model::Model;
use crate::igtl::{Order, Reach, command};
use crate::scene::file::{facts, put_settings, value_of_settings};

/// Carries out the order of a client; returns the answer. A scene to be opened becomes `wanted`.
///
/// # Errors
/// The fault of the order, in words; nothing has changed then.
pub(super) fn carry_out(
    order: &Order,
    model: &mut Model,
    wanted: &mut Option<PathBuf>,
    now: Instant,
) -> Result<String, String> {
    match order {
        Order::Set(pairs) => {
            let before = model.settings.clone();
            put_settings(pairs, &mut model.settings).map_err(|error| message_of(&error))?;
            model.note(&before, now);
            let told = pairs.iter().map(|(path, value)| format!("{path} = {value}"));
            Ok(told.collect::<Vec<_>>().join("\n"))
        }
        Order::Get(path) => {
            command::values(path, |key| get(model, key), || format!("`{path}` {NOT_TOLD}"))
        }
        Order::Time(seconds) => {
            model.clock.seek(*seconds, now);
            model.touch(now);
            Ok(format!("time = {seconds} s"))
        }
        Order::Freeze(frozen) => {
            model.freeze(*frozen, now);
            Ok(if *frozen { "frozen" } else { "running" }.to_owned())
        }
        Order::Scene(name) => {
            let path = Reach::of(&model.file.path).scene(name)?;
            let told = format!("opening {}", path.display());
            *wanted = Some(path);
            Ok(told)
        }
    }
}

/// Reason why the value of a key is not in the answer.
const NOT_TOLD: &str = "is not told by a window; `insonify serve` tells it";

/// The value of a key.
fn get(model: &Model, path: &str) -> Result<String, String> {
    let facts = facts(path)?;
    let value = value_of_settings(&model.settings, path);
    let value = value.ok_or_else(|| format!("`{path}` {NOT_TOLD}"))?;
    let text = facts.text(&value).ok_or_else(|| format!("`{path}` is not set"))?;
    Ok(format!("{path} = {text}"))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::model::File;
    use crate::scene::Scene;
    use crate::sim::Tracer;

    #[test]
    fn settings_time_and_freezing_follow_orders_and_errors_change_nothing() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/phantom.toml");
        let (scene, _) = Scene::load(&path, &[]).expect("sound");
        let now = Instant::now();
        let file = File::new(path, Vec::new(), &scene);
        let mut model = Model::new(&scene, file, Tracer::Bvh, 0.0, now);
        let mut wanted = None;
        let before = model.settings.clone();
        let mut told = |text: &str| {
            let order = Order::of(text).expect(text);
            let outcome = carry_out(&order, &mut model, &mut wanted, now);
            (outcome, model.settings.clone(), model.frozen, wanted.clone())
        };
        let (outcome, after, ..) = told("probe.depth = 77 mm\nimaging.gain = 3");
        assert_eq!(outcome, Ok("probe.depth = 77 mm\nimaging.gain = 3".to_owned()));
        assert_eq!((after.probe.depth, after.imaging.gain), (77.0, 3.0));
        // All else stays, to the bit.
        let mut expected = before;
        (expected.probe.depth, expected.imaging.gain) = (77.0, 3.0);
        assert!(after == expected);
        assert_eq!(told("get probe.depth").0, Ok("probe.depth = \"77 mm\"".to_owned()));
        let table = told("get imaging").0.expect("a table");
        assert!(table.contains("imaging.gain = \"3 dB\"\n"), "{table}");
        assert!(table.contains("imaging.dynamic_range = "), "{table}");
        assert!(told("get tissues.liver").0.is_err_and(|e| e.contains("serve")));
        for (wrong, cause) in [
            ("probe.dept = 3", "depth"),
            ("imaging.gain = 900", "between"),
            ("mesh.a.tissue = liver", "[imaging]"),
            ("scene = nowhere", "abdomen"),
        ] {
            let (outcome, settings, ..) = told(wrong);
            assert!(outcome.as_ref().is_err_and(|e| e.contains(cause)), "{wrong}: {outcome:?}");
            assert!(settings == expected, "{wrong}");
        }
        assert!(told("freeze").2 && !told("unfreeze").2);
        assert!(told("scene = heart").3.is_some_and(|path| path.ends_with("heart.toml")));
    }
}
