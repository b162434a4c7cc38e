//! The tables of [`Settings`].

use std::path::Path;

use super::document::{Document, Source, segments};
use super::error::SceneError;
use super::probe;
use super::schema::File;
use super::table::{Entry, entries};
use crate::settings::{Group, Imaging, Member, Probe, Settings, Simulation, Visitor};

/// Largest width of a picture, pixels: the limit of image files and messages.
const WIDEST: f64 = 65535.0;

/// The settings stated in the tables of `file`; what it leaves out is as the
/// examination that it names has it. Defaults of `simulation` that
/// follow the frequency are those of a probe of `frequency` MHz, or without it of the file's probe.
pub(super) fn settings(
    document: &Document<'_>,
    file: &File,
    frequency: Option<f64>,
) -> Result<Settings, SceneError> {
    let Imaging { exam, .. } = file.imaging.stated.get("");
    let probe = probe::build(document, &file.probe.stated, exam)?;
    let cell = Simulation::default_cell(frequency.unwrap_or(probe.frequency));
    let simulation = Simulation { cell, ..Simulation::default() };
    let mut settings = Settings { simulation, imaging: exam.imaging(), ..Settings::of(probe) };
    Settings::each(&mut Stating { file, settings: &mut settings });
    settings.simulation.cell /= settings.simulation.crowding();
    Ok(settings)
}

/// The values that a file states of each group but the probe, which is more than its rows.
struct Stating<'s> {
    file: &'s File,
    settings: &'s mut Settings,
}

impl Visitor for Stating<'_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        if let Some(stated) = self.file.stated(T::TABLE).filter(|_| T::TABLE != Probe::TABLE) {
            stated.put("", (group.of_mut)(self.settings));
        }
    }
}

/// Takes over the groups of which a file has a table.
struct Taking<'s> {
    tables: &'s [&'static str],
    from: &'s Settings,
    to: &'s mut Settings,
}

impl Visitor for Taking<'_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        if self.tables.contains(&T::TABLE) {
            (group.of_mut)(self.to).clone_from((group.of)(self.from));
        }
    }
}

/// The tables of [`Settings`] as a sentence has them.
fn tables(last: &str) -> String {
    let names = Settings::tables();
    let (end, before) = names.split_last().expect("there are some");
    format!("{} {last} {end}", before.join(", "))
}

/// Takes those of `settings` over from a scene file of which it has a table,
/// and reads nothing that they do not need: no mesh, no volume. Where it has no `[probe]`, defaults that follow the
/// frequency are those of the present probe.
///
/// # Errors
/// Those of [`crate::scene::Scene::load`]; a file without any of the tables. `settings` are then unchanged.
pub fn load_settings(path: &Path, settings: &mut Settings) -> Result<(), SceneError> {
    let source = Source::read(path, &[])?;
    let document = source.document()?;
    let file = File::of(&document)?;
    let has_probe = document.says_of("probe", "pose");
    let frequency = settings.probe.frequency;
    let found = self::settings(&document, &file, (!has_probe).then_some(frequency))?;
    let says = |table: &&str| match *table {
        Probe::TABLE => has_probe,
        table => document.says_of(table, ""),
    };
    let stated: Vec<&str> = Settings::TABLES.iter().copied().filter(says).collect();
    if stated.is_empty() {
        return Err(SceneError::file(
            path,
            format!("says nothing of {}", tables("or")),
            "choose a scene file with one of these tables",
        ));
    }
    if has_probe {
        settings.probe = found.probe.clone();
        settings.follow_frequency(frequency);
    }
    Settings::each(&mut Taking { tables: &stated, from: &found, to: settings });
    Ok(())
}

/// All settings as entries.
struct Entries<'s> {
    of: &'s Settings,
    found: Vec<Entry>,
}

impl Visitor for Entries<'_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        self.found.extend(entries((group.of)(self.of), T::TABLE));
    }
}

/// Gives `settings` the values of these entries, as `--set` takes them: of keys in the tables of [`Settings`].
///
/// # Errors
/// The first entry that does not fit; `settings` are then unchanged.
pub fn put_settings(pairs: &[(String, String)], settings: &mut Settings) -> Result<(), SceneError> {
    let place = Path::new("command");
    for (path, _) in pairs {
        let parts = segments(path);
        if !Settings::TABLES.contains(&parts[0].as_str())
            || parts.get(1).is_some_and(|key| key == "pose")
        {
            return Err(SceneError::file(
                place,
                format!("`{path}` is no setting of a running window"),
                &format!("set keys of {}; `insonify serve` takes any", tables("and")),
            ));
        }
    }
    // As a file says it: before its division for scatterers that do not fit into the cells.
    let cell = settings.simulation.cell * settings.simulation.crowding();
    let simulation = Simulation { cell, ..settings.simulation.clone() };
    let as_said = Settings { simulation, ..settings.clone() };
    let mut own = Entries { of: &as_said, found: Vec::new() };
    Settings::each(&mut own);
    let sets = |path: &str| pairs.iter().any(|(set, _)| set == path);
    let is_kept = |path: &str| {
        // Those of a preset are the preset's.
        !(sets(path) || sets("probe.preset") && path.starts_with("probe."))
    };
    let own = own.found.into_iter().filter(|(path, _)| is_kept(path));
    let own = own.filter_map(|(path, value)| Some((path, value?)));
    let all: Vec<_> = own.chain(pairs.iter().cloned()).collect();
    let source = Source::of(place, String::new()).with(&all);
    let document = source.document()?;
    let mut found = self::settings(&document, &File::of(&document)?, None)?;
    if !sets("simulation.cell") {
        let frequency = std::mem::replace(&mut settings.probe.frequency, found.probe.frequency);
        let mut followed = settings.clone();
        settings.probe.frequency = frequency;
        followed.follow_frequency(frequency);
        match sets("simulation.density_scale") {
            true => found.simulation.cell *= followed.simulation.cell / settings.simulation.cell,
            // To the bit.
            false => found.simulation.cell = followed.simulation.cell,
        }
    }
    presentable(&document, &found)?;
    *settings = found;
    Ok(())
}

/// Fails on a picture wider than can be written or sent.
pub(super) fn presentable(document: &Document<'_>, settings: &Settings) -> Result<(), SceneError> {
    let height = settings.imaging.image_height;
    let [left, top, right, bottom] = settings.probe.bounds();
    let width = (right - left) / (bottom - top) * f64::from(height);
    if width <= WIDEST {
        return Ok(());
    }
    let message =
        format!("a picture of this probe would be {width:.0} pixels wide and {height} high");
    let remedy = format!(
        "at most {WIDEST} fit: give a smaller image_height, a deeper image or a narrower probe"
    );
    Err(document.fail("imaging.image_height", message, remedy))
}

#[cfg(test)]
mod tests {
    use super::load_settings;
    use crate::scene::file::tests::Case;
    use crate::settings::{Exam, Imaging, Probe, Settings, Simulation};

    /// Unlike the defaults everywhere.
    fn own() -> Settings {
        Settings {
            probe: Probe { frequency: 5.0, ..Probe::linear() },
            simulation: Simulation { paths: 77, cell: 0.3, ..Simulation::default() },
            imaging: Imaging { gain: 3.0, noise: -90.0, ..Imaging::default() },
            ..Settings::of(Probe::linear())
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
    fn what_a_file_leaves_out_is_as_its_examination_has_it() {
        let case = Case::new();
        let read = |text: &str| {
            let scene = case.load(text, &[]).expect("sound").0;
            (scene.settings.probe, scene.settings.imaging)
        };
        // Everything, where the file says nothing else.
        let mut cardiac = Settings::of(Probe::paper_table1());
        Exam::Cardiac.apply(&mut cardiac);
        let (probe, imaging) = read("[imaging]\nexam = \"cardiac\"\n");
        assert_eq!((&probe, &imaging), (&cardiac.probe, &cardiac.imaging));
        // What the file says counts, though it be the default elsewhere.
        let (probe, imaging) = read(
            "[probe]\ndepth = 90\n[imaging]\nexam = \"cardiac\"\ngain = 7\ndynamic_range = 60\n",
        );
        assert_eq!(probe, Probe { depth: 90.0, ..cardiac.probe.clone() });
        let stated = Imaging { gain: 7.0, dynamic_range: 60.0, ..cardiac.imaging.clone() };
        assert_eq!(imaging, stated);
        // A named probe has its own depth and focus.
        let (probe, imaging) =
            read("[probe]\npreset = \"linear\"\n[imaging]\nexam = \"cardiac\"\n");
        assert_eq!((probe, imaging), (Probe::linear(), cardiac.imaging));
        let plain = read("[imaging]\nexam = \"general\"\n");
        assert_eq!(plain, (Probe::paper_table1(), Imaging::default()));
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
