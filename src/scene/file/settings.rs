//! The tables `probe`, `simulation` and `imaging`.

use std::path::Path;

use super::document::{Document, Source};
use super::error::SceneError;
use super::probe;
use super::schema::File;
use crate::settings::{Settings, Simulation};

/// The settings stated in the tables `probe`, `simulation` and `imaging` of `file`. Defaults of `simulation` that
/// follow the frequency are those of a probe of `frequency` MHz, or without it of the file's probe.
pub(super) fn settings(
    document: &Document<'_>,
    file: &File,
    frequency: Option<f64>,
) -> Result<Settings, SceneError> {
    let probe = probe::build(document, &file.probe.stated)?;
    let cell = Simulation::default_cell(frequency.unwrap_or(probe.frequency));
    let mut simulation = Simulation { cell, ..Simulation::default() };
    file.simulation.stated.put("", &mut simulation);
    simulation.cell /= simulation.crowding();
    Ok(Settings { probe, simulation, imaging: file.imaging.stated.get("") })
}

/// Takes those of `settings` over from a scene file of which it has a table - `[probe]`, `[simulation]`, `[imaging]` -
/// and reads nothing that they do not need: no mesh, no volume. Where it has no `[probe]`, defaults that follow the
/// frequency are those of the present probe.
///
/// # Errors
/// Those of [`crate::scene::Scene::load`]; a file without any of the three tables. `settings` are then unchanged.
pub fn load_settings(path: &Path, settings: &mut Settings) -> Result<(), SceneError> {
    let source = Source::read(path, &[])?;
    let document = source.document()?;
    let file = document.parse()?;
    let has_probe = document.says_of("probe", "pose");
    let frequency = settings.probe.frequency;
    let found = self::settings(&document, &file, (!has_probe).then_some(frequency))?;
    let [has_simulation, has_imaging] =
        ["simulation", "imaging"].map(|table| document.says_of(table, ""));
    if !(has_probe || has_simulation || has_imaging) {
        return Err(SceneError::file(
            path,
            "says nothing of [probe], [simulation] or [imaging]".to_owned(),
            "choose a scene file with one of these tables",
        ));
    }
    if has_probe {
        settings.probe = found.probe;
        settings.follow_frequency(frequency);
    }
    if has_simulation {
        settings.simulation = found.simulation;
    }
    if has_imaging {
        settings.imaging = found.imaging;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::load_settings;
    use crate::scene::file::tests::Case;
    use crate::settings::{Imaging, Probe, Settings, Simulation};

    /// Unlike the defaults everywhere.
    fn own() -> Settings {
        Settings {
            probe: Probe { frequency: 5.0, ..Probe::linear() },
            simulation: Simulation { paths: 77, cell: 0.3, ..Simulation::default() },
            imaging: Imaging { gain: 3.0, noise: -90.0, ..Imaging::default() },
        }
    }

    #[test]
    fn only_what_a_file_says_is_taken_and_meshes_are_not_needed() {
        let case = Case::new();
        let taken = |text: &str| {
            std::fs::write(case.path(), text).expect("written");
            let mut settings = own();
            load_settings(&case.path(), &mut settings).expect("sound");
            settings
        };
        let mesh = "[[mesh]]\nname = \"a\"\ntissue = \"fat\"\nfile = \"no.obj\"\n";
        let imaging = Imaging { gain: 5.0, ..Imaging::default() };
        let found = taken(&format!("[imaging]\ngain = 5\n{mesh}"));
        assert_eq!(found, Settings { imaging, ..own() });

        // A pose is no probe.
        let found = taken("[probe.pose]\nposition = [1, 2, 3]\n[simulation]\npaths = 3\n");
        let simulation = Simulation { paths: 3, cell: 1.05 / 5.0, ..Simulation::default() };
        assert_eq!(found, Settings { simulation, ..own() });

        // The present lattice follows the wavelength.
        let found = taken("[probe]\npreset = \"phased\"\n");
        assert_eq!(found.probe, Probe::phased());
        assert_eq!(found.simulation.cell, 0.3 * 5.0 / 2.7);
        assert_eq!(found.imaging, own().imaging);
    }

    #[test]
    fn mistakes_have_line_and_remedy() {
        let case = Case::new();
        for (text, line, cause) in [
            ("name = \"a\"\n", 0, "says nothing of"),
            ("[probe]\ndepth = 30\n[imaging]\n\ngain = 999\n", 5, "gain is 999"),
            ("[imaging]\ngian = 9\n", 2, "gian"),
        ] {
            std::fs::write(case.path(), text).expect("written");
            let mut settings = own();
            let error = load_settings(&case.path(), &mut settings).expect_err(cause);
            assert!(error.message.contains(cause), "{error}");
            assert!(error.remedy.is_some() && error.line == line, "{error}");
            assert_eq!(settings, own());
        }
    }
}
