//! The tables of a scene file that suit any anatomy: how one images, not what.

use std::path::Path;

use super::document::Source;
use super::error::SceneError;
use super::{parameters, probe};
use crate::probe::Probe;
use crate::scene::{Imaging, Simulation};

/// What a scene file says of imaging; none of what it does not mention.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preset {
    /// `[probe]`, without its pose.
    pub probe: Option<Probe>,
    /// `[simulation]`.
    pub simulation: Option<Simulation>,
    /// `[imaging]`.
    pub imaging: Option<Imaging>,
}

/// Reads the tables `[probe]`, `[simulation]` and `[imaging]` of a scene file and nothing that they do
/// not need: no mesh, no volume. Where it has no `[probe]`, defaults that follow the frequency are
/// those of a probe of `frequency` MHz.
///
/// # Errors
/// As those of [`crate::scene::Scene::load`]; a file without any of the three.
pub fn load_preset(path: &Path, frequency: f64) -> Result<Preset, SceneError> {
    let source = Source::read(path, &[])?;
    let document = source.document()?;
    let file = document.parse()?;
    let (probe, _) = probe::build(&document, &file.probe)?;
    let probe = document.says_of("probe", "pose").then_some(probe);
    let frequency = probe.as_ref().map_or(frequency, |probe| probe.frequency);
    let simulation = parameters::simulation(&document, &file.simulation, frequency)?;
    let imaging = parameters::imaging(&document, &file.imaging)?;
    let preset = Preset {
        probe,
        simulation: document.says_of("simulation", "").then_some(simulation),
        imaging: document.says_of("imaging", "").then_some(imaging),
    };
    if preset == Preset::default() {
        return Err(SceneError::file(
            path,
            "says nothing of [probe], [simulation] or [imaging]".to_owned(),
            "choose a scene file with one of these tables",
        ));
    }
    Ok(preset)
}

#[cfg(test)]
mod tests {
    use super::load_preset;
    use crate::scene::Imaging;
    use crate::scene::file::tests::Case;

    #[test]
    fn only_what_a_file_says_is_taken_and_meshes_are_not_needed() {
        let case = Case::new();
        let text =
            "[imaging]\ngain = 5\n[[mesh]]\nname = \"a\"\ntissue = \"fat\"\nfile = \"no.obj\"\n";
        std::fs::write(case.path(), text).expect("written");
        let found = load_preset(&case.path(), 5.0).expect("sound");
        assert_eq!((&found.probe, &found.simulation), (&None, &None));
        let gain = Imaging { gain: 5.0, ..Imaging::default() };
        assert_eq!(found.imaging, Some(gain));

        let text = "[probe.pose]\nposition = [1, 2, 3]\n[simulation]\npaths = 3\n";
        std::fs::write(case.path(), text).expect("written");
        let found = load_preset(&case.path(), 5.0).expect("sound");
        assert_eq!((&found.probe, &found.imaging), (&None, &None), "a pose is no probe");
        let simulation = found.simulation.expect("there");
        assert_eq!((simulation.paths, simulation.cell), (3, 1.05 / 5.0));
    }

    #[test]
    fn mistakes_have_line_and_remedy() {
        let case = Case::new();
        for (text, line, cause) in [
            ("name = \"a\"\n", 0, "says nothing of"),
            ("[imaging]\n\ngain = 999\n", 3, "gain is 999"),
            ("[imaging]\ngian = 9\n", 2, "gian"),
        ] {
            std::fs::write(case.path(), text).expect("written");
            let error = load_preset(&case.path(), 5.0).expect_err(cause);
            assert!(error.message.contains(cause), "{error}");
            assert!(error.remedy.is_some() && error.line == line, "{error}");
        }
    }
}
