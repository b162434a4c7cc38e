//! Commands of OpenIGTLink clients, carried out in the window.

use std::path::PathBuf;
use std::time::Instant;

use super::error::message_of;
use super::model::Model;
use crate::igtl::Reach;
use crate::igtl::command::Commanded;
use crate::scene::file::{facts, put_settings, value_of_settings};

/// The window's session as clients command it.
pub(super) struct Commands<'m> {
    pub(super) model: &'m mut Model,
    /// Takes the scene that is to be opened.
    pub(super) wanted: &'m mut Option<PathBuf>,
    pub(super) now: Instant,
}

/// Reason why the value of a key is not in the answer.
const NOT_TOLD: &str = "is not told by a window; `insonify serve` tells it";

impl Commanded for Commands<'_> {
    fn set(&mut self, pairs: &[(String, String)]) -> Result<(), String> {
        let before = self.model.settings.clone();
        put_settings(pairs, &mut self.model.settings).map_err(|error| message_of(&error))?;
        self.model.note(&before, self.now);
        Ok(())
    }

    fn value(&self, path: &str) -> Result<String, String> {
        let facts = facts(path)?;
        let value = value_of_settings(&self.model.settings, path);
        let value = value.ok_or_else(|| self.nothing_of(path))?;
        facts.text(&value).ok_or_else(|| format!("`{path}` is not set"))
    }

    fn nothing_of(&self, table: &str) -> String {
        format!("`{table}` {NOT_TOLD}")
    }

    fn seek(&mut self, seconds: f64) {
        self.model.clock.seek(seconds, self.now);
        self.model.touch(self.now);
    }

    fn freeze(&mut self, frozen: bool) {
        self.model.freeze(frozen, self.now);
    }

    fn open(&mut self, name: &str) -> Result<String, String> {
        let path = Reach::of(&self.model.file.path).scene(name)?;
        let answer = format!("opening {}", path.display());
        *self.wanted = Some(path);
        Ok(answer)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::igtl::Order;
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
        let mut answer = |text: &str| {
            let order = Order::of(text).expect(text);
            let mut commands = Commands { model: &mut model, wanted: &mut wanted, now };
            let outcome = order.carry_out(&mut commands);
            (outcome, model.settings.clone(), model.frozen, wanted.clone())
        };
        let (outcome, after, ..) = answer("probe.depth = 77 mm\nimaging.gain = 3");
        assert_eq!(outcome, Ok("probe.depth = 77 mm\nimaging.gain = 3".to_owned()));
        assert_eq!((after.probe.depth, after.imaging.gain), (77.0, 3.0));
        // All else stays, to the bit.
        let mut expected = before;
        (expected.probe.depth, expected.imaging.gain) = (77.0, 3.0);
        assert!(after == expected);
        assert_eq!(answer("get probe.depth").0, Ok("probe.depth = \"77 mm\"".to_owned()));
        let table = answer("get imaging").0.expect("a table");
        assert!(table.contains("imaging.gain = \"3 dB\"\n"), "{table}");
        assert!(table.contains("imaging.dynamic_range = "), "{table}");
        assert!(answer("get tissues.liver").0.is_err_and(|e| e.contains("serve")));
        for (wrong, cause) in [
            ("probe.dept = 3", "depth"),
            ("imaging.gain = 900", "between"),
            ("mesh.a.tissue = liver", "[imaging]"),
            ("scene = nowhere", "abdomen"),
        ] {
            let (outcome, settings, ..) = answer(wrong);
            assert!(outcome.as_ref().is_err_and(|e| e.contains(cause)), "{wrong}: {outcome:?}");
            assert!(settings == expected, "{wrong}");
        }
        assert!(answer("freeze").2 && !answer("unfreeze").2);
        assert!(answer("scene = heart").3.is_some_and(|path| path.ends_with("heart.toml")));
    }
}
