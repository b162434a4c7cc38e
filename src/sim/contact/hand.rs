//! The probe on the skin: the place that a ray meets, and the pose that slides there.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::{Skin, Skins};
use crate::probe::Probe;
use crate::scene::Scene;

/// Depth to which a probe put on the skin is pressed in, mm.
pub const PRESS: f64 = 1.5;

/// Points of the face, across and along, that are compared with the skin when the probe is put on it.
const FACE: [u32; 2] = [9, 3];
/// Rings of points around a place, by the radius of the footprint, and points in each.
const RINGS: [f64; 3] = [0.3, 0.6, 0.9];
const RING: u32 = 8;
/// Share by which the normal moves towards the fitted one in each step; on an edge of 90 degrees one half is
/// exact, and one would swing for ever.
const STEP: f64 = 0.5;
const STEPS: usize = 16;

/// The skin of a scene, at any time.
pub struct Body {
    /// The scene with the skin's meshes only.
    scene: Scene,
    skins: Skins,
}

impl Body {
    /// The skin that `scene` names for its contact; none where it names none.
    pub fn of(scene: &Scene) -> Option<Self> {
        let contact = scene.contact.as_ref()?;
        let named = contact.skin.iter().map(|&i| &scene.instances[i]);
        let used: Vec<usize> =
            named.flat_map(|i| i.keyframes.meshes.iter().chain([&i.mesh])).copied().collect();
        let meshes = scene.meshes.iter().enumerate();
        let meshes = meshes.map(|(i, mesh)| match used.contains(&i) {
            true => mesh.clone(),
            false => Arc::default(),
        });
        Some(Self {
            scene: Scene {
                meshes: meshes.collect(),
                instances: scene.instances.clone(),
                graph: scene.graph.clone(),
                contact: scene.contact.clone(),
                ..Scene::homogeneous(scene.tissues[scene.background].clone(), scene.probe.clone())
            },
            skins: Skins::default(),
        })
    }

    /// Places the model to which it belongs: world from model.
    pub fn place_model(&mut self, model: DAffine3) {
        self.scene.place_model(model);
    }

    /// The skin at `seconds` of the scene's time.
    pub fn at(&mut self, seconds: f64) -> Skin {
        self.scene.set_time(seconds);
        self.skins.of(&self.scene)
    }
}

/// A place of the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The place, world, mm.
    pub point: DVec3,
    /// The skin's outward normal, averaged over a footprint.
    pub normal: DVec3,
}

/// A probe over a skin.
pub struct Hand<'s> {
    skin: &'s Skin,
    probe: &'s Probe,
}

impl<'s> Hand<'s> {
    /// A hand that holds `probe` over `skin`.
    pub fn new(skin: &'s Skin, probe: &'s Probe) -> Self {
        Self { skin, probe }
    }

    /// The place where a ray (world, mm; `direction` a unit vector) meets the skin.
    pub fn pick(&self, origin: DVec3, direction: DVec3) -> Option<Spot> {
        let (point, normal) = self.skin.hit(origin, direction)?;
        Some(self.spot(point, normal))
    }

    /// The place that the face's centre is held to: the foot of the perpendicular from there, found first along
    /// the depth axis; without skin ahead, the place at the face itself.
    pub fn held(&self, pose: &DAffine3) -> Spot {
        let centre = pose.translation;
        let mut spot =
            Spot { point: centre, normal: -pose.transform_vector3(DVec3::Z).normalize() };
        for _ in 0..4 {
            let Some(gap) = self.skin.gap(centre, -spot.normal) else {
                break;
            };
            spot = self.spot(centre - gap * spot.normal, spot.normal);
        }
        spot
    }

    /// The place `by` mm from a `spot` (world; only the part within the tangent plane counts).
    pub fn beside(&self, spot: &Spot, by: DVec3) -> Option<Spot> {
        let along = by.reject_from(spot.normal);
        // From above the greatest height to which the skin can rise on the way.
        let above = spot.point + along + spot.normal * (by.length() + self.footprint());
        let (point, normal) = self.skin.hit(above, -spot.normal)?;
        Some(self.spot(point, normal))
    }

    /// The pose slid from one place to another: turned with the skin but not about its normal, so that tilt,
    /// rock and rotation stay; then moved along the normal until the face is pressed in by `press` mm at its
    /// deepest point.
    pub fn slid(&self, pose: &DAffine3, from: &Spot, to: &Spot, press: f64) -> DAffine3 {
        let turn = match from.normal.dot(to.normal) > -0.999 {
            true => DQuat::from_rotation_arc(from.normal, to.normal),
            // For the opposite side of a body any axis would do: keep the image's lateral one.
            false => DQuat::from_axis_angle(
                pose.transform_vector3(DVec3::X).normalize(),
                std::f64::consts::PI,
            ),
        };
        let turned = (turn * DQuat::from_mat3(&pose.matrix3)).normalize();
        let at = |point| DAffine3::from_mat3_translation(DMat3::from_quat(turned), point);
        let lift = press - self.pressed(&at(to.point), to).unwrap_or(0.0);
        at(to.point - to.normal * lift)
    }

    /// The pose slid `by` mm (world) from the place that it is held to, pressed in by `press` mm, and the place that it is
    /// held to then. None where there is no skin.
    pub fn slid_by(&self, pose: &DAffine3, by: DVec3, press: f64) -> Option<(DAffine3, Spot)> {
        let from = self.held(pose);
        let to = self.beside(&from, by)?;
        Some((self.slid(pose, &from, &to, press), to))
    }

    /// Depth to which a face at `pose`, held to `spot`, is pressed in at its deepest point, mm; below 0 it is held above
    /// the skin. None where there is no skin before it.
    pub fn pressed(&self, pose: &DAffine3, spot: &Spot) -> Option<f64> {
        let places = (0..FACE[0]).flat_map(|i| (0..FACE[1]).map(move |j| [i, j]));
        let gaps = places.filter_map(|[i, j]| {
            let share = |i: u32, count: u32| f64::from(i) / f64::from(count - 1) - 0.5;
            let (point, _) = self.probe.face(share(i, FACE[0]), share(j, FACE[1]));
            self.skin.gap(pose.transform_point3(point), -spot.normal)
        });
        gaps.map(|gap| -gap).max_by(f64::total_cmp)
    }

    /// Radius of a disc of the face's area, mm: the skin's normal is averaged over it.
    fn footprint(&self) -> f64 {
        0.5 * (self.probe.face_width() * self.probe.elevation_height).sqrt()
    }

    /// The place at a point of the skin. Its normal is that of the plane that fits the skin best (least
    /// squares of the heights over the footprint): it turns smoothly over an edge, which the triangles'
    /// own normals do not. The search begins at `normal`.
    fn spot(&self, point: DVec3, normal: DVec3) -> Spot {
        let radius = self.footprint();
        let mut normal = normal;
        for _ in 0..STEPS {
            let (u, v) = normal.any_orthonormal_pair();
            let (mut slope, mut weights) = (DVec3::ZERO, 0.0);
            for ring in RINGS {
                for i in 0..RING {
                    let angle = std::f64::consts::TAU * f64::from(i) / f64::from(RING);
                    let off = radius * ring * (angle.cos() * u + angle.sin() * v);
                    // Steeper than the footprint is wide counts as just as steep.
                    let above = point + off + normal * radius;
                    let gap = self.skin.gap(above, -normal).unwrap_or(f64::INFINITY);
                    let height = (radius - gap).clamp(-radius, radius);
                    let weight = 1.0 - ring * ring;
                    slope += weight * height * off;
                    weights += weight * off.length_squared() / 2.0;
                }
            }
            let turn = slope / weights;
            normal = (normal - STEP * turn).normalize();
            if turn.length() < 1e-4 {
                break;
            }
        }
        Spot { point, normal }
    }
}

#[cfg(test)]
mod tests;
