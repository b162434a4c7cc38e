//! The report of `insonify check`: a scene or a mesh, with all its faults.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use glam::DVec3;

use super::enclosing::encloses;
use super::mesh::{Facts, measure};
use super::{fusion, nodes};
use crate::scene::mesh::{self, Animated, AnimatedNode, Choice, Inspected, Options, Placement};
use crate::scene::{Instance, Issue, Scene, SceneError, Severity};
use crate::volume;

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
    /// The scene, where it could be loaded.
    pub scene: Option<Scene>,
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
        f.write_str(&tally(errors, self.count(Severity::Warning)))
    }
}

/// The last row of a report: `1 error, 2 warnings`.
pub fn tally(errors: usize, warnings: usize) -> String {
    format!("{}, {}", counted(errors, "error"), counted(warnings, "warning"))
}

/// A number of things in words: `1 error`, `2 errors`.
pub fn counted(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
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
            &format!(
                "give a scene (.toml), a mesh ({}) or a volume ({})",
                mesh::EXTENSIONS,
                volume::KINDS
            ),
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
    let mut report = Report { lines, issues, ..Report::default() };
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
    let facts: Vec<_> = scene.instances.iter().map(|i| world_facts(&scene, i)).collect();
    let outside = tissues_around(&scene, &facts);
    for ((instance, (facts, _)), outside) in scene.instances.iter().zip(&facts).zip(outside) {
        lines.push(format!("{}: {}", instance.name, describe(facts)));
        lines.push(format!(
            "  encloses {}, priority {}; outside it {outside}",
            scene.tissues[instance.tissue].name, instance.priority
        ));
    }
    let (fused, idle) = fusion::describe(path, &scene, |mask| facts[mask].0.clone());
    lines.extend(fused);
    issues.extend(idle);
    lines.push(format!("coincident triangles: {}", scene.coincident_triangles()));
    Report { lines, issues, error: None, scene: Some(scene) }
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
    (measure(&soup), outside)
}

/// Tissue at the point beside each instance, without that instance: of the enclosing mesh of highest priority, or the
/// background. At other places of the surface it may be another.
fn tissues_around<'s>(scene: &'s Scene, facts: &[(Facts, DVec3)]) -> Vec<&'s str> {
    // Along x, boxes begin and end, and points lie in those that have begun and not ended: each point is held
    // against few instances, however many there are.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    enum Event {
        Begin,
        Point,
        End,
    }
    let mut events = Vec::with_capacity(3 * facts.len());
    for (i, (facts, point)) in facts.iter().enumerate() {
        events.extend([
            (facts.min[0], Event::Begin, i),
            (point.x, Event::Point, i),
            (facts.max[0], Event::End, i),
        ]);
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut within = BTreeSet::new();
    let mut out = vec![scene.tissues[scene.background].name.as_str(); facts.len()];
    for (_, event, i) in events {
        match event {
            Event::Begin => {
                within.insert(i);
            }
            Event::End => {
                within.remove(&i);
            }
            Event::Point => {
                let (instance, point) = (&scene.instances[i], facts[i].1);
                let others = within.iter().map(|&other: &usize| (&scene.instances[other], other));
                let around = others
                    .filter(|(other, _)| other.shown && other.name != instance.name)
                    .filter(|(_, other)| facts[*other].0.holds(point))
                    .filter(|(other, _)| encloses(scene, other, point))
                    .max_by_key(|(other, _)| other.priority);
                if let Some((other, _)) = around {
                    out[i] = &scene.tissues[other.tissue].name;
                }
            }
        }
    }
    out
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
