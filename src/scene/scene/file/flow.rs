//! The tables `flow`: blood that flows in meshes.

use std::path::Path;

use glam::DVec3;

use super::columns::{ColumnFile, Columns, text};
use super::document::Document;
use super::error::SceneError;
use super::fusion;
use super::lines::{self, EXPONENTS, Given};
use super::motion::PERIOD;
use super::placing::PLACE;
use super::table::{Stated, Table};
use crate::scene::animation::Clock;
use crate::scene::flow::{Apart, CentreLine, Course, Flow, FlowShape, Tube, Vessel, course};
use crate::scene::{Instance, Mesh, Scene, Warning};
use crate::settings::units::{LENGTH, VELOCITY};
use crate::settings::{Form, ScatterMode, TextureSpace, group, words};

/// Fastest flow, mm/s: jets of the tightest valves have 6 to 7 m/s.
const FASTEST: f64 = 20_000.0;

words! {
    /// Kind of a waveform.
    pub enum WaveformKind {
        /// That of a file.
        File = "file",
        /// That of a common carotid artery.
        Carotid = "carotid",
    }
}

words! {
    /// Shape of a flow: the way its speed is spread over a mesh.
    pub enum FlowKind {
        /// Along a tube, fastest in its middle.
        Tube = "tube",
        /// Alike everywhere.
        Uniform = "uniform",
    }
}

group! {
    /// Blood that flows in a mesh. What scatters there is carried along.
    pub struct FlowKeys in "flow" {
        /// Name, for messages and overrides.
        name: String = String::new(), Facts::of(Form::Text).required().limits("not empty, once in the file");
        /// The mesh in which it flows.
        mesh: String = String::new(), Facts::of(Form::Text).required();
        /// Shape of the flow: along a tube, fastest in its middle; or alike everywhere.
        kind: FlowKind = FlowKind::Tube, Facts::word::<FlowKind>();
        /// Speed at the height of the waveform, in the middle of the tube where it begins; of a uniform flow everywhere. Below
        /// zero: the other way.
        speed: f64 = 0.0, Facts::quantity(&VELOCITY, -FASTEST, FASTEST).required();
        /// Direction, in the mesh's space. Uniform only.
        direction: Option<[f64; 3]> = None, Facts::of(Form::Direction).by_default("required");
        /// Exponent K of the profile 1 - (r/R)^K, where no file says it: 2 is a parabola (Poiseuille), more is flatter, as
        /// at the beginning of a vessel. Tube only.
        exponent: f64 = 2.0, Facts::number(EXPONENTS.0, EXPONENTS.1);
    }
}

group! {
    /// The centre line of a tube, in the mesh's own space, before the mesh is placed.
    pub struct LineKeys in "flow.line" {
        /// Beginning of a straight one: it flows from here.
        from: Option<[f64; 3]> = None, PLACE.by_default("required without `file`");
        /// Its end.
        to: Option<[f64; 3]> = None, PLACE.by_default("required without `file`");
        /// Of one that is not straight: a CSV file, relative to the scene file, with columns `x_mm`, `y_mm`, `z_mm` and, if
        /// wanted, `radius_mm`, `exponent` and, where the tube branches, `line`: the number of the line to which the row
        /// belongs.
        file: Option<String> = None, Facts::of(Form::Text).by_default("straight");
        /// Radius of the tube, where no file says it.
        radius: Option<f64> = None, Facts::quantity(&LENGTH, 1e-2, 1e3).by_default("of the mesh's cross-sections");
    }
}

group! {
    /// The speed over time. Without it the flow is steady.
    pub struct WaveformKeys in "flow.waveform" {
        /// Speed over a heartbeat: that of a file, or that of a common carotid artery, which begins at the end of diastole.
        kind: WaveformKind = WaveformKind::File, Facts::word::<WaveformKind>();
        /// One period: a CSV file, relative to the scene file, with columns `time_s` and `speed`, in any unit: the largest one
        /// is the flow's `speed`. File only.
        file: Option<String> = None, Facts::of(Form::Text).by_default("steady");
        /// Length of the period. By default that of the file; of a carotid artery that of what beats in the scene, with which it
        /// then keeps time, or else 1.1 s.
        period: Option<f64> = None, PERIOD.by_default("see there");
        /// Place in the period at time 0, or in that of what beats.
        phase: f64 = 0.0, Facts::number(0.0, 1.0);
    }
}

/// A waveform's columns.
const WAVEFORM: ColumnFile = ColumnFile { name: "waveform", columns: &["time_s", "speed"] };

/// Keys of one kind of flow only.
const OWN: [(&str, FlowKind); 3] =
    [("direction", FlowKind::Uniform), ("line", FlowKind::Tube), ("exponent", FlowKind::Tube)];

/// The flows of a file, whose scene has its meshes already.
pub(super) fn build(
    document: &Document<'_>,
    tables: &[Table<FlowKeys>],
    scene: &Scene,
) -> Result<Vec<Flow>, SceneError> {
    let mut flows: Vec<Flow> = Vec::new();
    for (i, Table { stated, .. }) in tables.iter().enumerate() {
        let keys: FlowKeys = stated.get("");
        let path = format!("flow.{i}");
        let one = OneFlow { document, stated, keys, path };
        let flow = one.build(scene)?;
        if flows.iter().any(|other| other.name == flow.name) {
            let message = format!("there are two flows named `{}`", flow.name);
            return Err(one.fail("name", message, "give each its own name"));
        }
        if let Some(other) = flows.iter().find(|other| other.instance == flow.instance) {
            let message = format!("`{}` flows in `{}` already", other.name, one.keys.mesh);
            return Err(one.fail("mesh", message, "let one of them flow in another mesh"));
        }
        flows.push(flow);
    }
    Ok(flows)
}

/// The warning of settings with which nothing flows, though a flow is there.
pub(super) fn standing(document: &Document<'_>, scene: &Scene) -> Option<Warning> {
    let simulation = &scene.simulation;
    let key = match (simulation.scatter_mode, simulation.texture_space) {
        _ if scene.flows.is_empty() => return None,
        (ScatterMode::Voxel, _) => "scatter_mode",
        (ScatterMode::Lattice, TextureSpace::Tissue) => return None,
        (ScatterMode::Lattice, _) => "texture_space",
    };
    let message = "with this blood stands still, though the scene has a [[flow]]";
    let at = document.fail(&format!("simulation.{key}"), message, "remove it, or the flow");
    let warning = Warning::warning(&at.file, 1, at.message, at.remedy.unwrap_or_default());
    Some(warning.of(&format!("line {}", at.line)))
}

/// A table with its place.
struct OneFlow<'a> {
    document: &'a Document<'a>,
    stated: &'a Stated,
    keys: FlowKeys,
    path: String,
}

impl OneFlow<'_> {
    fn fail(&self, key: &str, message: impl Into<String>, remedy: impl Into<String>) -> SceneError {
        self.document.fail(&format!("{}.{key}", self.path), message, remedy)
    }

    fn build(&self, scene: &Scene) -> Result<Flow, SceneError> {
        let FlowKeys { name, mesh, kind, speed, .. } = &self.keys;
        if name.trim().is_empty() {
            return Err(self.fail("name", "a flow needs a name", "name the vessel"));
        }
        let at = format!("{}.mesh", self.path);
        let instance = fusion::named(self.document, &at, mesh, &scene.instances)?;
        if let Some((key, of)) = OWN.iter().find(|(key, of)| self.stated.has(key) && of != kind) {
            let message = format!("`{key}` belongs to flows of the kind `{of}`");
            let remedy = format!("remove it, or write kind = \"{of}\"");
            return Err(self.fail(key, message, remedy));
        }
        let placed = &scene.instances[instance];
        let shape = match kind {
            FlowKind::Uniform => {
                let direction = self.keys.direction.ok_or_else(|| {
                    let message = "a uniform flow needs its direction";
                    self.fail("kind", message, "add direction = [x, y, z]")
                })?;
                FlowShape::Uniform(DVec3::from(direction).normalize())
            }
            FlowKind::Tube => FlowShape::Tube(self.vessel(&scene.meshes[placed.mesh], placed)?),
        };
        Ok(Flow::new(name.clone(), instance, shape, *speed, self.course(scene)?))
    }

    /// The centre lines of a tube and its branches.
    fn vessel(&self, mesh: &Mesh, placed: &Instance) -> Result<Vessel, SceneError> {
        let LineKeys { from, to, file, radius } = &self.stated.get("line.");
        let (key, lines) = match (file, from, to) {
            (Some(file), None, None) => {
                let path = self.beside(file);
                ("line.file", lines::read(&path, &self.text(&path, "line.file")?)?)
            }
            (Some(_), ..) => {
                let message = "a tube has either a file with its centre line or two ends";
                return Err(self.fail("line.file", message, "remove `file`, or `from` and `to`"));
            }
            (None, Some(from), Some(to)) => {
                let points = vec![(*from).into(), (*to).into()];
                ("line.from", vec![Given { points, radii: None, exponents: None }])
            }
            (None, ..) => {
                let message = "a tube needs its centre line";
                let remedy = "add line = { from = [x, y, z], to = [x, y, z] }, or line = { file = \"points.csv\" }";
                return Err(self.fail("mesh", message, remedy));
            }
        };
        self.check_inside(key, &lines, mesh, placed)?;
        let mut tubes = Vec::new();
        for Given { points, radii, exponents } in lines {
            let radii = match (radii, radius) {
                (Some(radii), None) => radii,
                (Some(_), Some(_)) => {
                    let message = "the file of the centre line has radii already";
                    return Err(self.fail("line.radius", message, "remove it here or there"));
                }
                (None, Some(radius)) => vec![*radius; points.len()],
                (None, None) => self.measured(mesh, &points)?,
            };
            let exponents = exponents.unwrap_or_else(|| vec![self.keys.exponent; points.len()]);
            let line = CentreLine::new(points, radii).ok_or_else(|| {
                let message = "the centre line has two points at the same place";
                self.fail(key, message, "give every point once")
            })?;
            tubes.push(Tube { line, exponents });
        }
        Vessel::new(tubes).map_err(|Apart { line, gap }| {
            let message = format!(
                "line {} begins {gap:.1} mm beside the tubes of the lines before it",
                line + 1
            );
            self.fail(key, message, "let a branch begin on its parent, and stand behind it")
        })
    }

    /// Centre lines run in the mesh in which blood flows: of each point of one line; of several, which other meshes may show
    /// as well, of one point at least.
    fn check_inside(
        &self,
        key: &str,
        lines: &[Given],
        mesh: &Mesh,
        placed: &Instance,
    ) -> Result<(), SceneError> {
        let remedy = "give it in the mesh's own space, before the mesh is placed";
        let [Given { points, .. }] = lines else {
            // Between two points, so that a short mesh is found.
            let inside = lines.iter().flat_map(|line| line.points.windows(2)).any(|ends| {
                (0..4).any(|i| mesh.surrounds(ends[0].lerp(ends[1], f64::from(i) / 4.0)))
            });
            return match inside {
                true => Ok(()),
                false => {
                    let message = format!("all of the centre lines lie outside `{}`", placed.name);
                    Err(self.fail(key, message, remedy))
                }
            };
        };
        for (i, &point) in points.iter().enumerate() {
            // The ends may lie on the mesh's openings.
            if i > 0 && i + 1 < points.len() && !mesh.surrounds(point) {
                let message = format!(
                    "point {} of the centre line, ({:.1}, {:.1}, {:.1}), lies outside `{}`",
                    i + 1,
                    point.x,
                    point.y,
                    point.z,
                    placed.name
                );
                return Err(self.fail(key, message, remedy));
            }
        }
        if let [first, last] = points[..]
            && !mesh.surrounds(first.midpoint(last))
        {
            let message = format!("the middle of the centre line lies outside `{}`", placed.name);
            let remedy = "give its ends in the mesh's own space, before the mesh is placed";
            return Err(self.fail(key, message, remedy));
        }
        Ok(())
    }

    /// Radii of circles as large as the mesh's cross-sections at the points.
    fn measured(&self, mesh: &Mesh, points: &[DVec3]) -> Result<Vec<f64>, SceneError> {
        let last = points.len() - 1;
        let sections: Vec<Option<f64>> = (0..points.len())
            .map(|i| {
                // At an end the mesh may be cut off: a little before it.
                let (at, next) = (points[i], points[if i == last { i - 1 } else { i + 1 }]);
                let inside = if i == 0 || i == last { 0.05 } else { 0.0 };
                let before = points[i.saturating_sub(1)];
                let behind = points[(i + 1).min(last)];
                mesh.cross_section(at.lerp(next, inside), behind - before)
            })
            .collect();
        sections
            .into_iter()
            .collect::<Option<Vec<f64>>>()
            .map(|areas| {
                areas.into_iter().map(|area| (area / std::f64::consts::PI).sqrt()).collect()
            })
            .ok_or_else(|| {
                let message = format!(
                    "`{}` has no cross-section at a point of the centre line",
                    self.keys.mesh
                );
                self.fail("line", message, "add `radius` to it, or mend the centre line")
            })
    }

    fn course(&self, scene: &Scene) -> Result<Course, SceneError> {
        let WaveformKeys { kind, file, period, phase } = &self.stated.get("waveform.");
        if *kind == WaveformKind::Carotid {
            if file.is_some() {
                let message = "the waveform of a carotid artery needs no file";
                return Err(self.fail("waveform.file", message, "remove `file`, or `kind`"));
            }
            let beat = scene.beat().filter(|_| period.is_none());
            let own = period.unwrap_or(course::CAROTID_PERIOD);
            let (period, start) = beat.map_or((own, 0.0), |clock| (clock.period, clock.phase));
            let clock = Clock { period, phase: (start + phase).fract(), ..Clock::default() };
            return Ok(Course::pulsatile(clock, course::carotid()));
        }
        let Some(file) = file else {
            return match self.stated.has("waveform") {
                true => {
                    let message = "the waveform has no file";
                    Err(self.fail(
                        "waveform",
                        message,
                        "add `file`, or remove it: the flow is steady",
                    ))
                }
                false => Ok(Course::Steady),
            };
        };
        let path = self.beside(file);
        let content = self.text(&path, "waveform.file")?;
        let table = Columns::parse(&WAVEFORM, &path, &content)?;
        let Some([time, speed]) = table.together(["time_s", "speed"])? else {
            let message = "the waveform has no columns".to_owned();
            return Err(table.fail(0..0, message, "add the columns time_s and speed"));
        };
        table.check("time_s")?;
        let rows = time.values.len();
        if let Some(row) = (1..rows).find(|&i| time.values[i] <= time.values[i - 1]) {
            return Err(table.out_of_order(time, row));
        }
        let largest = speed.values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        if rows < 2 || largest == 0.0 {
            let message = "the waveform needs two rows, and a speed that is not zero".to_owned();
            return Err(table.fail(
                0..0,
                message,
                "or remove the waveform: the flow is steady then",
            ));
        }
        let (start, end) = (time.values[0], time.values[rows - 1]);
        let own = super::motion::lasting(
            self.document,
            &format!("{}.waveform.file", self.path),
            (start, end),
        )?;
        let knot = |i: usize| [(time.values[i] - start) / (end - start), speed.values[i] / largest];
        let clock = Clock { period: period.unwrap_or(own), phase: *phase, ..Clock::default() };
        Ok(Course::pulsatile(clock, (0..rows).map(knot).collect()))
    }

    /// The path of a file that the table names.
    fn beside(&self, file: &str) -> std::path::PathBuf {
        let folder = self.document.source.path.parent().unwrap_or(Path::new(""));
        folder.join(file)
    }

    fn text(&self, path: &Path, key: &str) -> Result<String, SceneError> {
        text(path).map_err(|e| self.fail(key, e.to_string(), "check the path of the file"))
    }
}
