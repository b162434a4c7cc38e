//! The state of the 3D view: the tissues shown, and the camera.

use glam::{DAffine3, DVec2, DVec3};

use super::camera::Camera;
use super::hold::EDGE_ON;
use crate::probe::{Probe, ProbeKind};
use crate::scene::palette::{self, Show};
use crate::scene::{Orientation, Scene};
use crate::sim::view3d::CameraView;

/// Opacity of a see-through surface, looked at squarely.
const GLASS: f32 = 0.17;

/// A tissue in the list of the 3D view.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Its name.
    pub name: String,
    /// Index into the scene's tissues.
    pub tissue: usize,
    /// Its colour, sRGB.
    pub colour: [u8; 3],
    /// Present visibility.
    pub show: Show,
    /// Visibility where it is not hidden.
    pub otherwise: Show,
}

impl Shown {
    /// Hides it, or shows it as before.
    pub fn toggle(&mut self) {
        match self.show {
            Show::Hidden => self.show = self.otherwise,
            shown => (self.show, self.otherwise) = (Show::Hidden, shown),
        }
    }

    /// Switches between glass and solid.
    pub fn toggle_glass(&mut self) {
        self.show = match self.show {
            Show::SeeThrough => Show::Solid,
            Show::Hidden | Show::Solid => Show::SeeThrough,
        };
    }
}

/// The state of the 3D view.
#[derive(Clone, Debug, PartialEq)]
pub struct View3d {
    /// The camera.
    pub camera: Camera,
    /// True where the side of the image plane towards the camera is cut away.
    pub cut: bool,
    /// Tissues that enclose something, in the order of the scene's meshes.
    pub shown: Vec<Shown>,
    /// Tissue of each mesh.
    tissues: Vec<usize>,
    /// Ends of wires, world, mm.
    pub wires: Vec<[DVec3; 2]>,
    /// How the patient lies in the world, where the scene says it.
    pub orientation: Option<Orientation>,
}

impl View3d {
    /// The view of a scene that shows probe, fan and the organs around it.
    pub fn new(scene: &Scene) -> Self {
        let mut shown: Vec<Shown> = Vec::new();
        for instance in &scene.instances {
            if shown.iter().any(|s| s.tissue == instance.tissue) {
                continue;
            }
            let name = scene.tissues[instance.tissue].name.clone();
            let (colour, show) = palette::look(&name, shown.len());
            let encloses = || encloses_much(scene, instance.tissue);
            let glass = || {
                if encloses() { Show::SeeThrough } else { Show::Solid }
            };
            let show = show.unwrap_or_else(glass);
            let otherwise = match show {
                Show::Hidden => Show::SeeThrough,
                other => other,
            };
            shown.push(Shown { name, tissue: instance.tissue, colour, show, otherwise });
        }
        if shown.iter().all(|s| s.show == Show::Hidden) {
            shown.iter_mut().for_each(Shown::toggle);
        }
        // The body's surface, on which the probe is dragged, is to be seen whatever it is made of.
        let skin = scene.contact.iter().flat_map(|contact| &contact.skin);
        let skin: Vec<usize> = skin.map(|i| scene.instances[*i].tissue).collect();
        let mut surface = shown.iter_mut().filter(|s| skin.contains(&s.tissue));
        if surface.all(|s| s.show == Show::Hidden) {
            shown.iter_mut().filter(|s| skin.contains(&s.tissue)).for_each(Shown::toggle);
        }
        Self {
            camera: overview(&scene.world_from_probe, &scene.probe),
            cut: false,
            shown,
            tissues: scene.instances.iter().map(|i| i.tissue).collect(),
            wires: (scene.wires.iter()).map(|wire| wire.ends.map(DVec3::from)).collect(),
            orientation: scene.orientation,
        }
    }

    /// Takes over camera, cut and what is shown from the view of the scene before it was read again.
    pub(super) fn resume(&mut self, old: &Self) {
        (self.camera, self.cut) = (old.camera, old.cut);
        for tissue in &mut self.shown {
            if let Some(before) = old.shown.iter().find(|before| before.name == tissue.name) {
                (tissue.show, tissue.otherwise) = (before.show, before.otherwise);
            }
        }
    }

    /// Moves the camera back to the view of probe and fan from the side.
    pub fn reset(&mut self, pose: &DAffine3, probe: &Probe) {
        self.camera = overview(pose, probe);
    }

    /// Returns whether the side towards the camera is cut away for a probe at `pose` (world from probe): where the camera
    /// looks along the image plane there is no such side, and everything is shown.
    pub fn cuts(&self, pose: &DAffine3) -> bool {
        let normal = pose.transform_vector3(DVec3::Y).normalize();
        self.cut && normal.dot(self.camera.forward()).abs() > EDGE_ON
    }

    /// The simulation's input for the picture: `size` in pixels.
    pub fn sight(&self, size: [u32; 2]) -> CameraView {
        let camera = &self.camera;
        let pitch = camera.pitch(DVec2::from(size.map(f64::from)));
        CameraView {
            size,
            eye: camera.eye(),
            forward: camera.forward(),
            right: camera.right() * pitch,
            down: -camera.above() * pitch,
            cut: self.cut,
            image: true,
            looks: self.tissues.iter().map(|t| self.look(*t)).collect(),
        }
    }

    fn look(&self, tissue: usize) -> [f32; 4] {
        let listed = self.shown.iter().find(|s| s.tissue == tissue);
        let shown = listed.expect("every mesh's tissue is listed");
        let [r, g, b] = shown.colour.map(|c| f32::from(c) / 255.0);
        let opacity = match shown.show {
            Show::Hidden => 0.0,
            Show::SeeThrough => GLASS,
            Show::Solid => 1.0,
        };
        [r, g, b, opacity]
    }
}

/// A camera somewhat above and to the side, with the probe and all of the fan in view.
fn overview(pose: &DAffine3, probe: &Probe) -> Camera {
    let half_width = match probe.kind {
        ProbeKind::Convex { radius, field_of_view } => {
            (radius + probe.depth) * (field_of_view / 2.0).sin()
        }
        ProbeKind::Phased { field_of_view } => probe.depth * (field_of_view / 2.0).sin(),
        ProbeKind::Linear { width } => width / 2.0,
    };
    // The probe's head is to be seen, too.
    let above = 0.2 * probe.depth + 20.0;
    let radius = half_width.max((probe.depth + above) / 2.0);
    let middle = DVec3::new(0.0, 0.0, (probe.depth - above) / 2.0);
    let target = pose.transform_point3(middle);
    let mut camera = Camera::front(pose, target, 1.12 * radius);
    camera.orbit(DVec2::ONE, DVec2::new(-0.17, 0.09));
    camera
}

/// Returns whether a mesh of `tissue` has at least two others in its bounds, and half of all meshes.
fn encloses_much(scene: &Scene, tissue: usize) -> bool {
    let bounds: Vec<[DVec3; 2]> = (scene.instances.iter())
        .map(|i| {
            let [low, high] = scene.meshes[i.mesh].bounds().map(|p| glam::Vec3::from(p).as_dvec3());
            let corners = (0..8).map(|c| {
                let pick = |axis: usize| {
                    if c >> axis & 1 == 1 { high[axis] } else { low[axis] }
                };
                let corner = DVec3::new(pick(0), pick(1), pick(2));
                i.world_from_object.transform_point3(corner)
            });
            corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
                [low.min(p), high.max(p)]
            })
        })
        .collect();
    let within = |outer: &[DVec3; 2], inner: &[DVec3; 2]| {
        outer[0].cmple(inner[0]).all() && outer[1].cmpge(inner[1]).all()
    };
    scene.instances.iter().zip(&bounds).any(|(instance, outer)| {
        let inside = bounds.iter().filter(|inner| within(outer, inner)).count() - 1;
        instance.tissue == tissue && inside >= 2 && 2 * inside >= bounds.len() - 1
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Contact, Instance, Tissue, shapes};

    fn scene() -> Scene {
        let tissue =
            |name: &str| Tissue { name: name.into(), ..Tissue::shipped("liver").expect("shipped") };
        let mut scene = Scene::homogeneous(tissue("gel"), Probe::paper_table1());
        scene.tissues = ["gel", "muscle", "blood", "one", "two"].map(tissue).to_vec();
        let template = |mesh: usize, tissue: usize, at: f64| Instance {
            name: "ball".into(),
            mesh,
            keyframes: crate::scene::Keyframes::default(),
            shown: true,
            tissue,
            priority: 0,
            world_from_object: DAffine3::from_translation(DVec3::new(at, 0.0, 40.0)),
            surface: [Tissue::shipped("liver").expect("shipped").surface; 2],
        };
        scene.meshes = vec![shapes::sphere(50.0, 2).into(), shapes::sphere(5.0, 1).into()];
        scene.instances = vec![
            template(0, 3, 0.0),
            template(1, 1, -9.0),
            template(1, 2, 0.0),
            template(1, 4, 9.0),
        ];
        scene
    }

    #[test]
    fn the_surface_that_the_probe_is_dragged_on_is_seen_whatever_it_is_made_of() {
        let shows = |skin: Vec<usize>| {
            let mut scene = scene();
            scene.contact = Some(Contact { skin, gel: 1.0, couplant: 0 });
            View3d::new(&scene).shown.iter().map(|s| s.show).collect::<Vec<Show>>()
        };
        let usual = [Show::SeeThrough, Show::Hidden, Show::Solid, Show::Solid];
        // Muscle is left out elsewhere.
        assert_eq!(shows(vec![1])[1], Show::SeeThrough);
        assert_eq!(shows(vec![0, 1]), usual, "one of the two is seen");
        assert_eq!(shows(Vec::new()), usual);
    }

    #[test]
    fn enclosing_tissues_are_transparent_and_hiding_is_undone() {
        let mut view3d = View3d::new(&scene());
        let shows: Vec<Show> = view3d.shown.iter().map(|s| s.show).collect();
        assert_eq!(shows, [Show::SeeThrough, Show::Hidden, Show::Solid, Show::Solid]);
        let opacities = |view3d: &View3d| view3d.sight([4, 4]).looks.iter().map(|l| l[3]).collect();
        let before: Vec<f32> = opacities(&view3d);
        assert_eq!(before, [GLASS, 0.0, 1.0, 1.0]);
        view3d.shown[2].toggle();
        let hidden: Vec<f32> = opacities(&view3d);
        assert_eq!(hidden, [GLASS, 0.0, 0.0, 1.0]);
        view3d.shown[2].toggle();
        assert_eq!(before, opacities(&view3d) as Vec<f32>);
        view3d.shown[1].toggle();
        assert_eq!(view3d.shown[1].show, Show::SeeThrough);
    }

    #[test]
    fn probe_and_fan_are_in_view_at_the_start() {
        let scene = scene();
        let camera = View3d::new(&scene).camera;
        let panel = DVec2::new(300.0, 500.0);
        let depth = scene.probe.depth;
        for point in [[0.0, 0.0, -20.0], [0.0, 0.0, depth]] {
            let world = scene.world_from_probe.transform_point3(DVec3::from(point));
            let at = camera.project(panel, world).expect("in front");
            assert!(at.cmpge(DVec2::ZERO).all() && at.cmple(panel).all(), "{at}");
        }
    }

    #[test]
    fn a_sight_sees_what_the_camera_says() {
        let view3d = View3d::new(&scene());
        let size = [320, 200];
        let sight = view3d.sight(size);
        let place = DVec2::new(30.5, 177.5);
        let off = place - DVec2::new(160.0, 100.0);
        let along = sight.forward + off.x * sight.right + off.y * sight.down;
        let ray = view3d.camera.ray(DVec2::new(320.0, 200.0), place);
        assert!((along.normalize() - ray.direction).length() < 1e-12);
        assert_eq!(sight.eye, ray.origin);
    }
}
