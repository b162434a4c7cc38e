//! The scene that an import makes: a text with comments, for a person to read and change.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::plausible;
use super::pose::View;
use super::table::UNKNOWN;
use crate::issue::FileError;
use crate::output::lock::{Hold, LOCK};
use crate::output::{files, naming, obj};
use crate::scene::check::SENSIBLE_SIZE;
use crate::scene::mesh::Soup;
use crate::scene::topology;

/// Name of the scene file in its folder.
pub const SCENE: &str = "scene.toml";
/// Folder of the meshes beside it.
const MESHES: &str = "meshes";
/// Name of the skin's mesh.
pub const SKIN: &str = "skin";

/// One mesh of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Name in the scene.
    pub name: String,
    /// File, relative to the scene's.
    pub file: String,
    /// Tissue.
    pub tissue: String,
    /// Priority where surfaces lie on or in each other, the higher wins: before [`rank`] the table's, after it a number
    /// of its own for each part.
    pub priority: i32,
    /// Origin of the mesh, in words.
    pub origin: String,
    /// Note on the tissue.
    pub note: String,
    /// False where no table knows the name.
    pub known: bool,
    /// Triangles.
    pub triangles: usize,
    /// Enclosed volume, ml.
    pub volume: f64,
}

/// A scene in the making.
#[derive(Debug)]
pub struct Draft {
    /// Folder to be written.
    pub folder: PathBuf,
    /// File or folder that was imported.
    pub source: PathBuf,
    /// Statement of its frame, in words.
    pub frame: String,
    /// Structures, then the skin where there is one.
    pub parts: Vec<Part>,
    /// Structures that are no mesh of the scene, and why.
    pub left_out: Vec<String>,
    /// Remarks on structures: what they lose to others that they overlap, and the like.
    pub remarks: Vec<String>,
    /// Tissue and origin of the skin, in words.
    pub skin: Option<String>,
    /// Place of the probe, and the name of the organ that it looks at.
    pub view: Option<(View, String)>,
    /// No other import writes the folder meanwhile.
    _held: Hold,
}

impl Draft {
    /// Makes the folder of the scene.
    ///
    /// # Errors
    /// There is a scene in it already, unless `force`, or another import writes one; its meshes would be written over what is
    /// read; it cannot be made.
    pub fn begin(folder: &Path, source: &Path, force: bool) -> Result<Self, FileError> {
        let scene = folder.join(SCENE);
        let meshes = folder.join(MESHES);
        let real = |path: &Path| path.canonicalize().ok();
        if real(&meshes)
            .zip(real(source))
            .is_some_and(|(meshes, source)| source.starts_with(meshes))
        {
            let message =
                "is where what is read lies, and the scene's meshes would be written over it";
            return Err(FileError::file(&meshes, message, "name another folder by -o"));
        }
        std::fs::create_dir_all(folder).map_err(|e| unwritten(folder, &e))?;
        let Some(held) = Hold::take(&folder.join(LOCK)).map_err(|e| unwritten(folder, &e))? else {
            let message = "is being written by another import";
            return Err(FileError::file(
                folder,
                message,
                "wait for its end, or name another folder",
            ));
        };
        if scene.exists() && !force {
            let message = "is there already";
            let remedy = "name another folder, or give --force to replace it";
            return Err(FileError::file(&scene, message, remedy));
        }
        std::fs::create_dir_all(&meshes).map_err(|e| unwritten(folder, &e))?;
        Ok(Self {
            folder: folder.to_owned(),
            source: source.to_owned(),
            frame: String::new(),
            parts: Vec::new(),
            left_out: Vec::new(),
            remarks: Vec::new(),
            skin: None,
            view: None,
            _held: held,
        })
    }

    /// Writes a surface and adds it as a mesh whose name is like this one. Returns the name; none for one of a size that no
    /// scene takes, which is left out.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, part: Part, surface: &Soup) -> Result<Option<String>, FileError> {
        let size = extent(surface);
        if !(SENSIBLE_SIZE.0..=SENSIBLE_SIZE.1).contains(&size) {
            self.left_out.push(format!("{}: {size:.3} mm large", part.name));
            return Ok(None);
        }
        let name = self.free(&part.name);
        let plain: String = name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' })
            .take(80)
            .collect();
        let taken = |file: &str| self.parts.iter().any(|part| part.file == file);
        let file = naming::free(&format!("{MESHES}/{plain}"), "obj", taken);
        let path = self.folder.join(&file);
        let text = obj::text("mm, SPACE=LPS", &surface.positions, &surface.triangles);
        files::replace(&path, text.as_bytes()).map_err(|e| unwritten(&path, &e))?;
        let volume = topology::volume(surface) / 1000.0;
        let triangles = surface.triangles.len();
        self.parts.push(Part { name: name.clone(), file, triangles, volume, ..part });
        Ok(Some(name))
    }

    /// `wanted`, or that with a number, so that no part has it.
    fn free(&self, wanted: &str) -> String {
        let taken = |name: &str| self.parts.iter().any(|part| part.name == name);
        let mut name = wanted.to_owned();
        for n in 2.. {
            if !taken(&name) {
                break;
            }
            name = format!("{wanted} {n}");
        }
        name
    }

    /// Gives every part a priority of its own: by the table's, of equals the smaller volume above the larger.
    pub fn rank(&mut self) {
        self.parts.sort_by(|a, b| a.priority.cmp(&b.priority).then(b.volume.total_cmp(&a.volume)));
        for (n, part) in self.parts.iter_mut().enumerate() {
            part.priority = n as i32;
        }
    }

    /// Remarks for a person: structures that are no mesh, what is remarkable, volumes that no organ has, and structures whose
    /// tissue is a guess.
    pub fn messages(&self) -> Vec<String> {
        let left_out = self.left_out.iter();
        let left_out = left_out.map(|part| format!("left out: {part}, which no scene takes"));
        let remarks = self.remarks.iter().map(|remark| format!("note: {remark}"));
        let doubts = self.parts.iter().filter_map(plausible::doubt);
        let doubts = doubts.map(|doubt| format!("warning: {doubt}"));
        let unknown = self.parts.iter().filter(|part| !part.known);
        let unknown: Vec<_> = unknown.map(|part| part.name.as_str()).collect();
        let guessed = (!unknown.is_empty()).then(|| {
            format!(
                "{} structures had no tissue and were given {UNKNOWN}: {}; name them in a table (--labels)",
                unknown.len(),
                unknown.join(", ")
            )
        });
        left_out.chain(remarks).chain(doubts).chain(guessed).collect()
    }

    /// Writes the scene file, and returns where it is.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finish(&self) -> Result<PathBuf, FileError> {
        self.save(&self.text())
    }

    /// Writes `text` as the scene file, and returns where it is.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn save(&self, text: &str) -> Result<PathBuf, FileError> {
        let path = self.folder.join(SCENE);
        files::replace(&path, text.as_bytes()).map_err(|e| unwritten(&path, &e))?;
        Ok(path)
    }

    /// Name of the imported file or folder.
    pub(super) fn source_name(&self) -> String {
        self.source.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The scene file.
    fn text(&self) -> String {
        let name = self.source_name();
        let mut out = format!(
            "# Made by `insonify import` from {name}.\n\
             #\n\
             # World, mm: x to the patient's left, y to the back, z to the head (LPS).\n\
             # {}\n\
             name = {}\n\
             # Around the skin.\n\
             background = \"gel\"\n\n",
            self.frame,
            quoted(&name)
        );
        if let Some((view, organ)) = &self.view {
            out += &self.probe(view, organ);
        }
        if let Some(skin) = &self.skin {
            out += &format!(
                "# The skin: {skin}\n\
                 # It is rigid: gel fills what real skin would yield to the curved face.\n\
                 [contact]\n\
                 mesh = [\"{SKIN}\"]\n\
                 gel = \"9 mm\"\n\n"
            );
        }
        let unknown = self.parts.iter().filter(|p| !p.known);
        let unknown: String =
            unknown.map(|part| format!("#   {}: {}\n", part.name, part.tissue)).collect();
        if !unknown.is_empty() {
            out += "# No table knows these names; their tissue is a guess, to be corrected here or with --labels:\n";
            out += &unknown;
            out += "\n";
        }
        out + &self.meshes()
    }

    /// The meshes of the scene file.
    pub(super) fn meshes(&self) -> String {
        let mut out = String::new();
        for structure in &self.left_out {
            out += &format!("# Left out: {structure}, which no scene takes.\n");
        }
        for remark in &self.remarks {
            out += &format!("# {remark}.\n");
        }
        out += "# In rising priority: where two lie on or in each other, the later one wins.\n";
        for part in &self.parts {
            let note =
                if part.note.is_empty() { String::new() } else { format!("  # {}", part.note) };
            out += &format!(
                "# {}: {} triangles, {:.1} ml\n\
                 [[mesh]]\n\
                 name = {}\n\
                 file = {}\n\
                 units = \"mm\"\n\
                 tissue = \"{}\"{note}\n\
                 priority = {}\n\n",
                part.origin,
                part.triangles,
                part.volume,
                quoted(&part.name),
                quoted(&part.file),
                part.tissue,
                part.priority
            );
        }
        out
    }

    fn probe(&self, view: &View, organ: &str) -> String {
        let volume = self.parts.iter().find(|p| p.name == organ).map_or(0.0, |p| p.volume);
        // The organ as a ball, and a bit of what is behind it.
        let radius = (volume.abs() * 750.0 / std::f64::consts::PI).cbrt();
        let depth = ((view.distance + 1.2 * radius + 10.0) / 10.0).round() * 10.0;
        let (preset, most) = if depth <= 45.0 { ("linear", 45.0) } else { ("abdominal", 240.0) };
        format!(
            "# It looks at `{organ}`, {:.0} mm deep; {}.\n\
             [probe]\n\
             preset = \"{preset}\"\n\
             depth = \"{} mm\"\n\
             focus = \"{:.0} mm\"\n\n{}",
            view.distance,
            way(view),
            depth.clamp(30.0, most),
            view.distance.clamp(10.0, most),
            pose(view.position, view.direction, view.lateral, [2, 5])
        )
    }
}

/// The table of a pose, with so many digits of the place and of the axes.
pub(super) fn pose(
    position: DVec3,
    direction: DVec3,
    lateral: DVec3,
    [place, axis]: [usize; 2],
) -> String {
    format!(
        "[probe.pose]\nposition = {}\ndirection = {}\nlateral = {}\n\n",
        vector(position, place),
        vector(direction, axis),
        vector(lateral, axis)
    )
}

/// Largest edge of a surface's box, mm.
fn extent(surface: &Soup) -> f64 {
    let edge = |axis: usize| {
        let values = surface.positions.iter().map(|p| f64::from(p[axis]));
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high - low
    };
    (0..3).map(edge).fold(0.0, f64::max)
}

/// The way of a view in words.
pub fn way(view: &View) -> String {
    let shaded = if view.shaded > 0.0 {
        format!(", on {:.0} % of those beside it", 100.0 * view.shaded)
    } else {
        String::new()
    };
    match view.blocked {
        0.0 => format!("no bone and no gas on the way{shaded}"),
        mm => {
            format!("{mm:.0} mm of bone or gas on the way: no place on the skin is without{shaded}")
        }
    }
}

/// A vector as TOML has it.
fn vector(v: DVec3, digits: usize) -> String {
    // Turns -0 into 0.
    let v = v.to_array().map(|x| format!("{:.digits$}", x + 0.0));
    format!("[{}]", v.join(", "))
}

/// A text as TOML has it.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn unwritten(path: &Path, error: &std::io::Error) -> FileError {
    let message = format!("cannot be written: {error}");
    FileError::file(path, message, "check the folder and the room in it")
}
