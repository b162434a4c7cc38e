//! What lies where the pointer asks: the mesh and its tissue, by a right click on image or 3D view.

use std::sync::Arc;
use std::time::Instant;

use egui::{Area, Frame, Id, Order, Pos2, RichText, Ui};
use glam::DVec3;

use super::model::{Model, Ray, Show};
use super::style::{self, button};
use crate::scene::{Instance, Mesh, Scene, triangle};

/// What the pointer asks for, world, mm.
#[derive(Clone, Copy)]
pub(super) enum Question {
    /// A place of the image plane.
    Place(DVec3),
    /// What is seen along a ray.
    Sight(Ray),
}

/// An answer on the screen.
pub(super) struct Answer {
    at: Pos2,
    /// Index of the mesh; none where the background is.
    mesh: Option<usize>,
}

/// What is asked, and what was answered.
#[derive(Default)]
pub(super) struct Naming {
    /// Where the pointer asks what lies there.
    pub(super) asked: Option<(Pos2, Question)>,
    /// The answer to that.
    pub(super) answer: Option<Answer>,
}

/// A section of the console that the user wants to see.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Wanted {
    /// Of the tissue with this index.
    Tissue(usize),
    /// Of the surface of the mesh with this index.
    Surface(usize),
}

/// Finds what was asked for in the scene as it is now.
pub(super) fn answer(scene: &Scene, model: &Model, asked: (Pos2, Question)) -> Option<Answer> {
    let mut instances = scene.instances.clone();
    scene.graph.evaluate(model.clock.at(Instant::now()), &mut instances);
    // The model may have been moved since the scene was read.
    let back = scene.graph.world_from_model * model.settings.model.inverse();
    let find = |point: DVec3| {
        let probe = back.transform_point3(model.pose.translation);
        enclosing(&scene.meshes, &instances, back.transform_point3(point), probe)
    };
    let (at, question) = asked;
    let mesh = match question {
        Question::Place(point) => find(point),
        Question::Sight(ray) => {
            let on_cut = model.view3d.cut.then(|| on_plane(model, &ray)).flatten();
            let origin = on_cut.unwrap_or(ray.origin);
            let cut = on_cut.and_then(find).filter(|&mesh| is_shown(model, &instances[mesh]));
            let (origin, direction) =
                (back.transform_point3(origin), back.transform_vector3(ray.direction));
            let seen = |solid| {
                let wanted = |i: &Instance| match solid {
                    true => shows(model, i) == Some(Show::Solid),
                    false => is_shown(model, i),
                };
                nearest(&scene.meshes, &instances, (origin, direction), wanted)
            };
            // Glass is looked through, where something solid is behind it.
            Some(cut.or_else(|| seen(true)).or_else(|| seen(false))?)
        }
    };
    Some(Answer { at, mesh })
}

fn shows(model: &Model, instance: &Instance) -> Option<Show> {
    let of = model.view3d.shown.iter().find(|shown| shown.tissue == instance.tissue);
    of.map(|shown| shown.show)
}

fn is_shown(model: &Model, instance: &Instance) -> bool {
    shows(model, instance).is_some_and(|show| show != Show::Hidden)
}

/// The point where a ray meets the image plane; none behind the eye.
fn on_plane(model: &Model, ray: &Ray) -> Option<DVec3> {
    let normal = model.pose.matrix3.y_axis;
    let t = (model.pose.translation - ray.origin).dot(normal) / ray.direction.dot(normal);
    (t.is_finite() && t > 0.0).then(|| ray.origin + t * ray.direction)
}

/// Distances at which a ray crosses a placed mesh, in units of `direction`.
fn crossings<'m>(
    meshes: &'m [Arc<Mesh>],
    instance: &Instance,
    (origin, direction): (DVec3, DVec3),
) -> impl Iterator<Item = f64> + 'm {
    let mesh = &meshes[instance.mesh];
    let object = instance.world_from_object.inverse();
    let (origin, direction) =
        (object.transform_point3(origin), object.transform_vector3(direction));
    mesh.triangles.iter().filter_map(move |corners| {
        let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        let found = triangle::crossing(corners.map(corner), origin, direction)?;
        Some(found[0]).filter(|t| *t > 0.0)
    })
}

/// The mesh in whose tissue a point lies: of the highest priority, and of those the last one that a line from the
/// probe enters; none in the background.
fn enclosing(meshes: &[Arc<Mesh>], all: &[Instance], point: DVec3, probe: DVec3) -> Option<usize> {
    let mut best: Option<(i32, f64, usize)> = None;
    for (index, instance) in all.iter().enumerate().filter(|(_, i)| i.shown) {
        let line = (point, (probe - point).normalize_or(DVec3::NEG_Z));
        let (count, first) = crossings(meshes, instance, line)
            .fold((0, f64::INFINITY), |(count, first), t| (count + 1, t.min(first)));
        let better = |(priority, entry, _): (i32, f64, usize)| {
            instance.priority > priority || (instance.priority == priority && first < entry)
        };
        if count % 2 == 1 && best.is_none_or(better) {
            best = Some((instance.priority, first, index));
        }
    }
    best.map(|(.., index)| index)
}

/// The first of the wanted meshes that a ray meets.
fn nearest(
    meshes: &[Arc<Mesh>],
    all: &[Instance],
    ray: (DVec3, DVec3),
    wanted: impl Fn(&Instance) -> bool,
) -> Option<usize> {
    let shown = all.iter().enumerate().filter(|(_, i)| i.shown && wanted(i));
    let first = shown.map(|(index, instance)| {
        (crossings(meshes, instance, ray).fold(f64::INFINITY, f64::min), index)
    });
    let first = first.min_by(|a, b| a.0.total_cmp(&b.0));
    first.filter(|(t, _)| t.is_finite()).map(|(_, index)| index)
}

/// Draws the answer beside the place that was asked for, until it is closed or another is asked for. Returns the
/// properties that the user wants to see.
pub(super) fn show(ui: &Ui, model: &Model, naming: &mut Naming) -> Option<Wanted> {
    let answer = naming.answer.as_ref()?;
    let (at, mesh) = (answer.at, answer.mesh);
    let tissue = mesh.map_or(model.background, |mesh| model.meshes[mesh].tissue);
    let name = mesh.map_or("background", |mesh| model.meshes[mesh].name.as_str());
    let (mut open, mut wanted) = (true, None);
    let corner = at + egui::vec2(10.0, 6.0);
    let area = Area::new(Id::new("named")).order(Order::Foreground).fixed_pos(corner);
    area.constrain_to(ui.ctx().content_rect()).show(ui.ctx(), |ui| {
        Frame::popup(ui.style()).show(ui, |ui| {
            ui.label(RichText::new(name).strong());
            ui.label(RichText::new(&model.settings.tissues[tissue].name).color(style::FAINT));
            ui.horizontal(|ui| {
                if button(ui, "Tissue", "Its acoustic properties, in the console") {
                    wanted = Some(Wanted::Tissue(tissue));
                }
                let Some(mesh) = mesh else { return };
                if button(ui, "Surface", "How its surface reflects, in the console") {
                    wanted = Some(Wanted::Surface(mesh));
                }
                open = !button(ui, "x", "Close");
            });
        });
    });
    if wanted.is_some() {
        // The console is drawn before.
        ui.ctx().request_repaint();
    }
    if !open || wanted.is_some() || ui.input(|input| input.key_pressed(egui::Key::Escape)) {
        naming.answer = None;
    }
    wanted
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "background = \"liver\"\n\
        [[mesh]]\nname = \"outer\"\ntissue = \"fat\"\nshape = { sphere = { radius = 20 } }\ntranslate = [0, 0, 50]\n\
        [[mesh]]\nname = \"inner\"\ntissue = \"bile\"\nshape = { sphere = { radius = 8 } }\ntranslate = [0, 0, 50]\n\
        [[mesh]]\nname = \"first\"\ntissue = \"cortical_bone\"\npriority = 1\nshape = { sphere = { radius = 3 } }\n\
        translate = [15, 0, 50]\n";

    #[test]
    fn a_place_belongs_to_the_last_entered_of_the_highest_priority() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, SCENE).expect("written");
        let (scene, _) = Scene::load(&path, &[]).expect("sound");
        let at = |x: f64, z: f64| {
            let found =
                enclosing(&scene.meshes, &scene.instances, DVec3::new(x, 0.1, z), DVec3::ZERO);
            found.map(|i| scene.instances[i].name.as_str())
        };
        assert_eq!(at(0.1, 10.0), None);
        assert_eq!(at(0.1, 35.0), Some("outer"));
        assert_eq!(at(0.1, 50.0), Some("inner"));
        // Behind the inner one, which is left, but not the outer one.
        assert_eq!(at(0.1, 65.0), Some("outer"));
        assert_eq!(at(15.1, 50.0), Some("first"));
        assert_eq!(at(17.5, 50.0), Some("first"));
        assert_eq!(at(19.0, 50.0), Some("outer"));
        let ray = (DVec3::new(0.1, 0.1, 0.0), DVec3::Z);
        let seen = |wanted: fn(&Instance) -> bool| {
            let found = nearest(&scene.meshes, &scene.instances, ray, wanted);
            found.map(|i| scene.instances[i].name.as_str())
        };
        assert_eq!(seen(|_| true), Some("outer"));
        assert_eq!(seen(|i| i.name == "inner"), Some("inner"));
        assert_eq!(seen(|i| i.name == "first"), None);
    }
}
