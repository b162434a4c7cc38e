//! The tables `flow`: blood that flows in meshes.

use std::path::Path;

use glam::DVec3;

use super::columns::{ColumnFile, Columns, text};
use super::document::Document;
use super::error::SceneError;
use super::fusion;
use super::motion::PERIOD;
use super::placing::PLACE;
use super::table::{Stated, Table};
use crate::scene::animation::Clock;
use crate::scene::flow::{CentreLine, Course, Flow, FlowShape};
use crate::scene::{Instance, Mesh, Scene, Warning};
use crate::settings::units::{LENGTH, VELOCITY};
use crate::settings::{Form, ScatterMode, TextureSpace, group, words};

/// Fastest flow, mm/s: jets of the tightest valves have 6 to 7 m/s.
const FASTEST: f64 = 20_000.0;

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
        /// Speed where it is fastest: in the middle of the tube, at the height of the waveform. Below zero: the other way.
        speed: f64 = 0.0, Facts::quantity(&VELOCITY, -FASTEST, FASTEST).required();
        /// Direction, in the mesh's space. Uniform only.
        direction: Option<[f64; 3]> = None, Facts::of(Form::Direction).by_default("required");
        /// Exponent K of the profile 1 - (r/R)^K: 2 is a parabola (Poiseuille), more is flatter, as at the beginning of
        /// a vessel. Tube only.
        exponent: f64 = 2.0, Facts::number(1.0, 50.0);
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
        /// wanted, `radius_mm`.
        file: Option<String> = None, Facts::of(Form::Text).by_default("straight");
        /// Radius of the tube, where no file says it.
        radius: Option<f64> = None, Facts::quantity(&LENGTH, 1e-2, 1e3).by_default("of the mesh's cross-sections");
    }
}

group! {
    /// The speed over time. Without it the flow is steady.
    pub struct WaveformKeys in "flow.waveform" {
        /// One period: a CSV file, relative to the scene file, with columns `time_s` and `speed`, in any unit: the largest one
        /// is the flow's `speed`.
        file: Option<String> = None, Facts::of(Form::Text).by_default("steady");
        /// Length of the period.
        period: Option<f64> = None, PERIOD.by_default("that of the file");
        /// Place in the period at time 0.
        phase: f64 = 0.0, Facts::number(0.0, 1.0);
    }
}

/// A centre line's columns.
const LINE: ColumnFile =
    ColumnFile { name: "centre line", columns: &["x_mm", "y_mm", "z_mm", "radius_mm"] };
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
            FlowKind::Tube => FlowShape::Tube {
                line: self.line(&scene.meshes[placed.mesh], placed)?,
                exponent: self.keys.exponent,
            },
        };
        Ok(Flow::new(name.clone(), instance, shape, *speed, self.course()?))
    }

    /// The centre line, with radii.
    fn line(&self, mesh: &Mesh, placed: &Instance) -> Result<CentreLine, SceneError> {
        let LineKeys { from, to, file, radius } = &self.stated.get("line.");
        let (key, points, radii) = match (file, from, to) {
            (Some(file), None, None) => {
                let (points, radii) = self.line_file(file)?;
                ("line.file", points, radii)
            }
            (Some(_), ..) => {
                let message = "a tube has either a file with its centre line or two ends";
                return Err(self.fail("line.file", message, "remove `file`, or `from` and `to`"));
            }
            (None, Some(from), Some(to)) => ("line.from", vec![(*from).into(), (*to).into()], None),
            (None, ..) => {
                let message = "a tube needs its centre line";
                let remedy = "add line = { from = [x, y, z], to = [x, y, z] }, or line = { file = \"points.csv\" }";
                return Err(self.fail("mesh", message, remedy));
            }
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
                let remedy = "give it in the mesh's own space, before the mesh is placed";
                return Err(self.fail(key, message, remedy));
            }
        }
        if let [first, .., last] = points[..]
            && !mesh.surrounds(first.midpoint(last))
            && points.len() == 2
        {
            let message = format!("the middle of the centre line lies outside `{}`", placed.name);
            let remedy = "give its ends in the mesh's own space, before the mesh is placed";
            return Err(self.fail(key, message, remedy));
        }
        let radii = match (radii, radius) {
            (Some(radii), None) => radii,
            (Some(_), Some(_)) => {
                let message = "the file of the centre line has radii already";
                return Err(self.fail("line.radius", message, "remove it here or there"));
            }
            (None, Some(radius)) => vec![*radius; points.len()],
            (None, None) => self.measured(mesh, &points)?,
        };
        CentreLine::new(points, radii).ok_or_else(|| {
            let message = "the centre line has two points at the same place";
            self.fail(key, message, "give every point once")
        })
    }

    /// Points of a centre line's file, and radii if it has them.
    fn line_file(&self, file: &str) -> Result<(Vec<DVec3>, Option<Vec<f64>>), SceneError> {
        let path = self.beside(file);
        let content = self.text(&path, "line.file")?;
        let table = Columns::parse(&LINE, &path, &content)?;
        let Some([x, y, z]) = table.together(["x_mm", "y_mm", "z_mm"])? else {
            let message = "the centre line has no places".to_owned();
            return Err(table.fail(0..0, message, "add the columns x_mm, y_mm, z_mm"));
        };
        table.check("x_mm")?;
        let radii = table.together(["radius_mm"])?.map(|[radii]| radii);
        if x.values.len() < 2 {
            let at = x.places[0].clone();
            let message = "a centre line has at least two points".to_owned();
            return Err(table.fail(at, message, "add the next point"));
        }
        if let Some(radii) = radii
            && let Some(row) = radii.values.iter().position(|radius| *radius <= 0.0)
        {
            let message = format!("the radius is {} mm", radii.values[row]);
            return Err(table.fail(radii.places[row].clone(), message, "it must be above zero"));
        }
        let point = |i: usize| DVec3::new(x.values[i], y.values[i], z.values[i]);
        let points = (0..x.values.len()).map(point).collect();
        Ok((points, radii.map(|column| column.values.clone())))
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

    fn course(&self) -> Result<Course, SceneError> {
        let WaveformKeys { file, period, phase } = &self.stated.get("waveform.");
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
