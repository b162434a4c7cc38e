//! Registration of the acquired volume with the model by hand.

use std::cell::OnceCell;

use glam::{DAffine3, DQuat, DVec3};

use super::Settings;
use crate::scene::fusion::open_edges;
use crate::scene::{Acquired, Instance, Scene};

/// Least and greatest extent of a plane, mm across.
const EXTENTS: [f64; 2] = [5.0, 2000.0];

/// The part that is moved; the other one stays, and so does the probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moves {
    /// The acquired volume.
    Volume,
    /// All meshes.
    Model,
}

/// A plane through the volume, along two axes of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Name of the plane.
    pub name: &'static str,
    /// Axes to the right and down on the screen.
    pub axes: [DVec3; 2],
}

impl Plane {
    /// The three planes through one point, depth downwards where they contain it.
    pub const ALL: [Self; 3] = [
        Self { name: "x z", axes: [DVec3::X, DVec3::Z] },
        Self { name: "y z", axes: [DVec3::Y, DVec3::Z] },
        Self { name: "x y", axes: [DVec3::X, DVec3::Y] },
    ];

    /// Unit normal, away from the viewer.
    pub fn normal(&self) -> DVec3 {
        self.axes[0].cross(self.axes[1])
    }
}

/// The outline of a mesh in a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// Ends of its pieces: mm to the right of the middle and below it.
    pub pieces: Vec<[[f64; 2]; 2]>,
}

/// The state of the registration by hand; the settings themselves are [`Settings::volume`], [`Settings::model`] and
/// the masks of [`Settings::fusion`].
#[derive(Clone, Debug)]
pub struct Registration {
    /// The part that is moved.
    pub moves: Moves,
    /// Point where the three planes meet, world, mm.
    pub middle: DVec3,
    /// Extent of a plane over its smaller side, mm.
    pub extent: f64,
    /// Results of [`Self::is_closed`], computed when first asked for.
    closed: OnceCell<Vec<bool>>,
    scene: Scene,
}

impl Registration {
    /// The registration for a scene with a volume, else none; the planes meet in the middle of the masks.
    pub fn of(scene: &Scene) -> Option<Self> {
        let volume = scene.volume.as_ref()?;
        let [low, high] = corners(volume);
        let mut out = Self {
            moves: Moves::Volume,
            middle: (low + high) / 2.0,
            extent: (0.7 * (high - low).max_element()).clamp(EXTENTS[0], EXTENTS[1]),
            closed: OnceCell::new(),
            scene: scene.clone(),
        };
        out.centre();
        Some(out)
    }

    /// Sets the scene to `settings` at `seconds`.
    pub fn follow(&mut self, settings: &Settings, seconds: f64) {
        settings.apply(&mut self.scene);
        self.scene.set_time(seconds);
    }

    /// Returns whether placed mesh `index` is closed in each of its shapes, so that it can be a mask.
    pub fn is_closed(&self, index: usize) -> bool {
        let closed = |i: &Instance| {
            let mut shapes = i.keyframes.meshes.iter().chain([&i.mesh]);
            shapes.all(|&m| open_edges(&self.scene.meshes[m]) == 0)
        };
        self.closed.get_or_init(|| self.scene.instances.iter().map(closed).collect())[index]
    }

    /// The scene as last set by [`Self::follow`].
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Moves the planes' meeting point to the middle of the masks.
    pub fn centre(&mut self) {
        let masks = self.scene.fusion.iter().flat_map(|f| &f.masks);
        let boxes = masks.map(|&i| {
            let instance = &self.scene.instances[i];
            let points = self.scene.meshes[instance.mesh].positions.iter();
            let points = points.map(|p| {
                let p = DVec3::from(p.map(f64::from));
                instance.world_from_object.transform_point3(p)
            });
            points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
                [low.min(p), high.max(p)]
            })
        });
        let all = boxes.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        if let Some([low, high]) = all.filter(|[low, _]| low.is_finite()) {
            self.middle = (low + high) / 2.0;
        }
    }

    /// Shows a larger or smaller part of the planes.
    pub fn zoom(&mut self, factor: f64) {
        self.extent = (self.extent * factor).clamp(EXTENTS[0], EXTENTS[1]);
    }

    /// Shifts the moved part by a vector of the world, mm.
    pub fn shift(&self, settings: &mut Settings, by: DVec3) {
        self.change(settings, DAffine3::from_translation(by));
    }

    /// Turns the moved part about an axis through the planes' meeting point, by the right-hand rule.
    pub fn turn(&self, settings: &mut Settings, axis: DVec3, radians: f64) {
        let turn = DAffine3::from_quat(DQuat::from_axis_angle(axis, radians));
        self.change(settings, self.about_middle(turn));
    }

    /// Scales the moved part about the planes' meeting point.
    pub fn scale(&self, settings: &mut Settings, factor: f64) {
        let scale = DAffine3::from_scale(DVec3::splat(factor));
        self.change(settings, self.about_middle(scale));
    }

    fn about_middle(&self, map: DAffine3) -> DAffine3 {
        let to = DAffine3::from_translation(self.middle);
        to * map * to.inverse()
    }

    fn change(&self, settings: &mut Settings, by: DAffine3) {
        match self.moves {
            Moves::Model => settings.model = by * settings.model,
            Moves::Volume => {
                if let Some(volume) = &mut settings.volume {
                    volume.world_from_lps = by * volume.world_from_lps;
                }
            }
        }
    }

    /// Placement of the moved part: world from its own frame.
    pub fn place(&self, settings: &Settings) -> DAffine3 {
        match self.moves {
            Moves::Model => settings.model,
            Moves::Volume => settings.volume.map_or(DAffine3::IDENTITY, |v| v.world_from_lps),
        }
    }

    /// Gives the moved part another placement.
    pub fn put(&self, settings: &mut Settings, place: DAffine3) {
        let change = place * self.place(settings).inverse();
        self.change(settings, change);
    }

    /// Grey levels of the volume in a plane, `size` pixels of `pitch` mm around the middle, row by row; none outside
    /// the volume.
    pub fn slice(&self, plane: &Plane, size: [usize; 2], pitch: f64) -> Vec<Option<u8>> {
        let Some(volume) = &self.scene.volume else {
            return Vec::new();
        };
        let voxel_from_world = volume.world_from_voxel.inverse();
        let [right, down] = plane.axes.map(|a| voxel_from_world.transform_vector3(a * pitch));
        let middle = voxel_from_world.transform_point3(self.middle);
        let [width, height] = size;
        let half = [width, height].map(|n| (n as f64 - 1.0) / 2.0);
        let at = |i: usize| {
            let (column, row) = ((i % width) as f64, (i / width) as f64);
            middle + right * (column - half[0]) + down * (row - half[1])
        };
        let grey = |i| volume.grey_at(at(i)).map(|g| (255.0 * g).round() as u8);
        (0..width * height).map(grey).collect()
    }

    /// Outlines of all shown meshes in a plane, within `reach` mm of the middle.
    pub fn outlines(&self, plane: &Plane, reach: f64) -> Vec<Outline> {
        let mut out = Vec::new();
        for (index, instance) in self.scene.instances.iter().enumerate() {
            if !instance.shown {
                continue;
            }
            let mesh = &self.scene.meshes[instance.mesh];
            // Coordinates to the right, down, off the plane.
            let normal = plane.normal();
            let place = |p: &[f32; 3]| {
                let p = DVec3::from(p.map(f64::from));
                let p = instance.world_from_object.transform_point3(p) - self.middle;
                DVec3::new(p.dot(plane.axes[0]), p.dot(plane.axes[1]), p.dot(normal))
            };
            let points: Vec<DVec3> = mesh.positions.iter().map(place).collect();
            let near = |p: &[f64; 2]| p[0].abs() <= reach && p[1].abs() <= reach;
            let pieces = mesh.triangles.iter().filter_map(|t| {
                let piece = across(t.map(|i| points[i as usize]))?;
                piece.iter().any(near).then_some(piece)
            });
            let pieces: Vec<_> = pieces.collect();
            if !pieces.is_empty() {
                out.push(Outline { instance: index, pieces });
            }
        }
        out
    }
}

/// The piece in which a triangle crosses z = 0; a corner on it counts as beyond it, so that neighbours agree.
fn across(corners: [DVec3; 3]) -> Option<[[f64; 2]; 2]> {
    let mut ends = (0..3).filter_map(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        ((a.z < 0.0) != (b.z < 0.0)).then(|| {
            let p = a + (b - a) * (a.z / (a.z - b.z));
            [p.x, p.y]
        })
    });
    Some([ends.next()?, ends.next()?])
}

/// Least and largest coordinates of the volume's corners in the world.
fn corners(volume: &Acquired) -> [DVec3; 2] {
    let size = volume.size.map(|n| n as f64);
    let all = (0..8_usize).map(|corner| {
        let at = |axis: usize| if corner >> axis & 1 == 1 { size[axis] } else { 0.0 } - 0.5;
        volume.world_from_voxel.transform_point3(DVec3::new(at(0), at(1), at(2)))
    });
    all.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

#[cfg(test)]
mod tests;
