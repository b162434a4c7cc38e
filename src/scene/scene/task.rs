//! Tasks for a learner, as a scene file sets them. `docs/teaching.md` says how they are done and scored.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};

use super::Mesh;
use crate::settings::words;

/// A task.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Its name, once in a scene.
    pub name: String,
    /// What the learner is to do.
    pub text: String,
    /// Hints, which the guide gives one after the other.
    pub hints: Vec<String>,
    /// Where the probe is put when the task begins (world from probe); none: it stays.
    pub start: Option<DAffine3>,
    /// What has to be reached.
    pub goal: Goal,
}

/// What a task asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// A view to reach.
    View(Target),
    /// Structures that the image has to show.
    Show(Cover),
    /// A measurement to take.
    Measure(Measurement),
    /// A case to recognise.
    Question(Question),
}

/// A view, and how near to it counts as there.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// World from probe.
    pub world_from_probe: DAffine3,
    /// Greatest distance between the middles of the two images, mm.
    pub distance: f64,
    /// Greatest angle between the two image planes, rad.
    pub plane_angle: f64,
    /// Greatest rotation of the image within its plane, rad.
    pub turn: f64,
    /// Time for which the view has to be held at the end, s.
    pub hold: f64,
    /// Least share of the probe's face that is coupled meanwhile, 0 to 1.
    pub contact: f64,
}

/// Structures that have to be seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Cover {
    /// Meshes: indices into [`super::Scene::instances`].
    pub instances: Vec<usize>,
    /// Least area that each has in the image, mm2.
    pub area: f64,
    /// Least share of the probe's face that is coupled, 0 to 1.
    pub contact: f64,
}

/// A quantity to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Its true value, in [`Self::unit`].
    pub value: f64,
    /// Its unit.
    pub unit: Unit,
    /// Greatest error, percent of the true value.
    pub tolerance: f64,
}

words! {
    /// Units of a measurement.
    pub enum Unit {
        /// Millimetres.
        Length = "mm",
        /// Square millimetres.
        Area = "mm2",
        /// Millilitres.
        Volume = "ml",
    }
}

/// A question with several answers, of which one is right.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// The answers to choose from.
    pub choices: Vec<String>,
    /// The right one: index into `choices`.
    pub answer: usize,
    /// Why it is right, for afterwards.
    pub explanation: String,
}

impl Question {
    /// The index of the answer that `text` is, whatever its capitals.
    pub fn choice(&self, text: &str) -> Option<usize> {
        let wanted = text.trim().to_lowercase();
        self.choices.iter().position(|choice| choice.trim().to_lowercase() == wanted)
    }
}

/// Directions in which extremes are sought first.
const DIRECTIONS: usize = 256;
/// Steps after which the longest axis is found; each makes it longer.
const STEPS: usize = 64;

/// The longest axis of a placed mesh: the largest distance between two of its vertices, mm. Extremes are sought in
/// directions all around, then along the line between the two that are farthest apart, until that grows no more; so
/// it takes a time proportional to the number of vertices.
pub fn longest_axis(mesh: &Mesh, world_from_object: &DAffine3) -> f64 {
    let corners = mesh.triangles.iter().flatten().map(|&v| mesh.positions[v as usize]);
    let points: Vec<DVec3> = corners
        .map(|p| world_from_object.transform_point3(DVec3::from(p.map(f64::from))))
        .collect();
    let ends = |direction: DVec3| {
        let along = |p: &&DVec3| p.dot(direction);
        let least = points.iter().min_by(|a, b| along(a).total_cmp(&along(b)))?;
        let most = points.iter().max_by(|a, b| along(a).total_cmp(&along(b)))?;
        Some(*most - *least)
    };
    // Spread by the golden angle.
    let directions = (0..DIRECTIONS).map(|i| {
        let z = (i as f64 + 0.5) / DIRECTIONS as f64;
        let (sin, cos) = (TAU * 0.618_033_988_749_895 * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    });
    let mut longest = directions
        .filter_map(ends)
        .max_by(|a, b| a.length().total_cmp(&b.length()))
        .unwrap_or_default();
    for _ in 0..STEPS {
        match longest.try_normalize().and_then(ends) {
            Some(next) if next.length() > longest.length() => longest = next,
            _ => break,
        }
    }
    longest.length()
}

/// Volume that a closed placed mesh encloses, ml: by the divergence theorem, a tetrahedron per triangle.
pub fn volume(mesh: &Mesh, world_from_object: &DAffine3) -> f64 {
    let corner = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
    let six: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(corner);
            a.dot(b.cross(c))
        })
        .sum();
    (six / 6.0 * world_from_object.matrix3.determinant()).abs() / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_its_diagonal_and_its_volume() {
        let mut mesh = Mesh::default();
        for i in 0..8u32 {
            mesh.positions.push([0, 1, 2].map(|k| ((i >> k) & 1) as f32));
        }
        mesh.triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        let placed = DAffine3::from_translation(DVec3::new(-7.0, 3.0, 50.0))
            * DAffine3::from_rotation_y(0.7)
            * DAffine3::from_scale(DVec3::new(10.0, 20.0, 30.0));
        assert!((longest_axis(&mesh, &placed) - 1400f64.sqrt()).abs() < 1e-9);
        assert!((volume(&mesh, &placed) - 6.0).abs() < 1e-9);
        assert_eq!(longest_axis(&Mesh::default(), &placed), 0.0);
    }
}
