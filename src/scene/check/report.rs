//! The report of `insonify check`: a scene or a mesh, with all its faults.

use std::fmt;
use std::path::Path;

use glam::DVec3;

use super::{Facts, fusion, nodes};
use crate::scene::mesh::{self, Animated, AnimatedNode, Choice, Inspected, Options, Placement};
use crate::scene::{Instance, Issue, Scene, SceneError, Severity};

/// Distance from a surface at which the tissue around it is looked up, mm: clear of surfaces
/// that coincide with it, inside the thinnest wall.
const OUTSIDE: f64 = 0.05;

/// Content of a file and its faults.
#[derive(Debug, Default)]
pub struct Report {
    /// Description, a row each.
    pub lines: Vec<String>,
    /// Findings.
    pub issues: Vec<Issue>,
    /// The mistake that stopped the loading of a scene.
    pub error: Option<SceneError>,
}

impl Report {
    /// Returns whether the file can be used.
    pub fn passed(&self) -> bool {
        self.error.is_none() && !self.issues.iter().any(Issue::is_error)
    }

    fn count(&self, severity: Severity) -> usize {
        self.issues.iter().filter(|i| i.severity == severity).count()
    }
}

impl fmt::Display for Report {
    /// Writes description, findings, and a last row that counts them. The scene error is left to the
    /// caller, who may want it with its source text.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for line in &self.lines {
            writeln!(f, "{line}")?;
        }
        for issue in &self.issues {
            writeln!(f, "{issue}")?;
        }
        let errors = self.count(Severity::Error) + usize::from(self.error.is_some());
        write!(f, "{errors} errors, {} warnings", self.count(Severity::Warning))
    }
}

/// Checks a scene (.toml) or a mesh file.
pub fn report(path: &Path) -> Report {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "toml" => scene(path),
        _ if mesh::is_mesh(path) => mesh_file(path),
        _ => refuse(
            path,
            "neither a scene nor a mesh nor a volume by its extension",
            "give a .toml, .obj, .gltf, .glb, .stl, .mha, .mhd, .nrrd, .nhdr, .nii or .nii.gz file",
        ),
    }
}

fn refuse(path: &Path, message: &str, remedy: &str) -> Report {
    Report { issues: vec![Issue::error(path, 1, message, remedy)], ..Report::default() }
}

fn mesh_file(path: &Path) -> Report {
    let Inspected { facts, parts, issues, .. } = mesh::inspect(path, &Options::default());
    let mut lines = Vec::new();
    if facts.triangles > 0 {
        lines.push(path.display().to_string());
        lines.push(format!("  {}", describe(&facts)));
        let named: Vec<_> = parts.iter().filter(|p| !p.is_empty()).map(String::as_str).collect();
        if named.len() > 1 {
            lines.push(format!("  parts: {}", named.join(", ")));
        }
    }
    let mut report = Report { lines, issues, error: None };
    animations(path, &mut report);
    report
}

/// Number of animations that are tried; a file may have any number.
const ANIMATIONS: usize = 16;

/// Describes the animations of a mesh file. A fault that keeps one from being played is a warning, since the
/// mesh can still be used.
fn animations(path: &Path, report: &mut Report) {
    let names = mesh::animations(path);
    for (k, name) in names.iter().take(ANIMATIONS).enumerate() {
        let choice = Choice::Number(k);
        let issues = match mesh::load_animated(path, &Options::default(), choice) {
            Ok((animated, issues)) => {
                report.lines.push(format!("  animation {}", play(&animated)));
                issues
            }
            Err(issues) => issues,
        };
        for mut issue in issues {
            // The rest pose has most findings, too.
            if !report.issues.iter().any(|known| known.is_like(&issue)) {
                issue.severity = Severity::Warning;
                issue.message = format!("animation `{name}`: {}", issue.message);
                report.issues.push(issue);
            }
        }
    }
    if names.len() > ANIMATIONS {
        let more = names.len() - ANIMATIONS;
        report.lines.push(format!("  {more} more animations were not tried"));
    }
}

fn play(animated: &Animated) -> String {
    let moving = |n: &&AnimatedNode| matches!(n.placement, Placement::Moving { .. });
    let (first, last) = animated.span;
    let shapes: usize = animated.meshes.iter().map(|m| m.times.len()).sum();
    format!(
        "`{}`: {first:.3} to {last:.3} s, {} moving nodes, {shapes} shapes of {} meshes",
        animated.animation,
        animated.nodes.iter().filter(moving).count(),
        animated.meshes.len()
    )
}

fn describe(facts: &Facts) -> String {
    let corner = |v: [f64; 3]| format!("({:.1}, {:.1}, {:.1})", v[0], v[1], v[2]);
    let volume = match facts.volume {
        Some(volume) => format!("{volume:.3} ml"),
        None => format!("open ({} edges)", facts.open_edges),
    };
    format!(
        "{} triangles, {} vertices, box {} to {} mm, {volume}",
        facts.triangles,
        facts.vertices,
        corner(facts.min),
        corner(facts.max)
    )
}

fn scene(path: &Path) -> Report {
    let (scene, mut issues) = match Scene::load(path, &[]) {
        Ok(loaded) => loaded,
        Err(error) => {
            return Report { error: Some(error), ..Report::default() };
        }
    };
    let background = &scene.tissues[scene.background].name;
    let mut lines = vec![
        format!("{}: scene `{}`", path.display(), scene.name),
        format!(
            "  background {background}, {} meshes, {} wires",
            scene.instances.len(),
            scene.wires.len()
        ),
    ];
    lines.extend(nodes::describe(&scene));
    for instance in &scene.instances {
        let (facts, inside_point) = world_facts(&scene, instance);
        let outside = tissue_around(&scene, instance, inside_point);
        lines.push(format!("{}: {}", instance.name, describe(&facts)));
        lines.push(format!(
            "  encloses {}, priority {}; outside it {outside}",
            scene.tissues[instance.tissue].name, instance.priority
        ));
    }
    let facts = |mask: usize| world_facts(&scene, &scene.instances[mask]).0;
    let (fused, idle) = fusion::describe(path, &scene, facts);
    lines.extend(fused);
    issues.extend(idle);
    lines.push(format!("coincident triangles: {}", scene.coincident_triangles()));
    Report { lines, issues, error: None }
}

/// Facts in world space, and a point just outside the surface.
fn world_facts(scene: &Scene, instance: &Instance) -> (Facts, DVec3) {
    let mesh = &scene.meshes[instance.mesh];
    let place = |p: &[f32; 3]| {
        let world = instance.world_from_object.transform_point3(DVec3::from(p.map(f64::from)));
        world.as_vec3().to_array()
    };
    let soup = mesh::weld(&mesh::Soup {
        name: mesh.name.clone(),
        positions: mesh.positions.iter().map(place).collect(),
        triangles: mesh.triangles.clone(),
    });
    let corner = |i: u32| DVec3::from(soup.positions[i as usize].map(f64::from));
    let outside = soup.triangles.first().map_or(DVec3::ZERO, |t| {
        let [a, b, c] = t.map(corner);
        let outward = (b - a).cross(c - a).normalize_or_zero();
        (a + b + c) / 3.0 + outward * OUTSIDE
    });
    (super::measure(&soup), outside)
}

/// Tissue at a point beside an instance, without that instance: of the enclosing mesh of highest
/// priority, or the background. At other places of the surface it may be another.
fn tissue_around<'s>(scene: &'s Scene, instance: &Instance, point: DVec3) -> &'s str {
    let around = scene
        .instances
        .iter()
        .filter(|other| other.shown && other.name != instance.name)
        .filter(|other| encloses(scene, other, point))
        .max_by_key(|other| other.priority);
    let tissue = around.map_or(scene.background, |other| other.tissue);
    &scene.tissues[tissue].name
}

/// Returns whether an instance encloses a point: winding number by the solid angles of all triangles (van Oosterom
/// and Strackee 1983), one inside a closed outward mesh and zero outside, with one half as the limit.
fn encloses(scene: &Scene, instance: &Instance, point: DVec3) -> bool {
    let local = instance.world_from_object.inverse().transform_point3(point);
    let mesh = &scene.meshes[instance.mesh];
    let half_angles: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] =
                t.map(|i| DVec3::from(mesh.positions[i as usize].map(f64::from)) - local);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            a.dot(b.cross(c)).atan2(below)
        })
        .sum();
    half_angles / std::f64::consts::TAU > 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_report_tells_what_encloses_what() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("s.toml");
        let sphere = |name: &str, radius: u32, tissue: &str, priority: u32| {
            format!(
                "[[mesh]]\nname = \"{name}\"\ntissue = \"{tissue}\"\npriority = {priority}\n\
                 shape = {{ sphere = {{ radius = {radius}, subdivisions = 3 }} }}\n"
            )
        };
        let text = sphere("liver", 50, "liver", 1) + &sphere("cyst", 10, "bile", 2);
        std::fs::write(&path, text).expect("written");
        let report = report(&path);
        let text = report.to_string();
        assert!(report.passed(), "{text}");
        assert!(text.contains("encloses bile, priority 2; outside it liver"), "{text}");
        assert!(text.contains("encloses liver, priority 1; outside it water"), "{text}");
        // 4/3 pi r^3 is 523.599 ml; the polyhedron of 1280 triangles is 0.9 % smaller.
        assert!(text.contains("519.093 ml"), "{text}");
    }

    #[test]
    fn strangers_are_refused_plainly() {
        let report = report(Path::new("a.docx"));
        assert!(!report.passed());
        assert!(report.issues[0].message.contains("neither a scene"), "{report}");
    }
}
