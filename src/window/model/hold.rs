//! The probe on the skin, moved by mouse and keys.

use std::time::Instant;

use glam::{DAffine3, DVec3};

use super::{Axis, Model, Ray, Source, moved};
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::contact::{Body, Hand, PRESS, Skin, Spot};

/// Least and greatest depth to which the probe is pressed in, mm; below 0 it is held above the skin.
pub const PRESSES: [f64; 2] = [-10.0, 20.0];
/// Sine of the angle to a plane below which a ray counts as looking along it.
pub(super) const EDGE_ON: f64 = 0.1;
/// Farthest that one movement takes the probe in its image plane, mm.
const FARTHEST: f64 = 25.0;

/// The contact of the probe with the skin.
pub struct Hold {
    body: Body,
    /// True where every movement keeps the probe on the skin.
    pub stays: bool,
    /// Depth to which it is pressed in, mm.
    pub press: f64,
    /// Centre of the face, and the place that the probe was held to for it.
    spot: Option<(DVec3, Spot)>,
}

impl Hold {
    /// A probe that stays on the skin, as a hand holds it; none where the scene names no skin.
    pub fn of(scene: &Scene) -> Option<Self> {
        Some(Self { body: Body::of(scene)?, stays: true, press: PRESS, spot: None })
    }

    /// Moves the skin to the model's place: world from model.
    pub(super) fn place_model(&mut self, model: DAffine3) {
        self.body.place_model(model);
        self.spot = None;
    }

    /// The place that a probe at `pose` is held to. While the face's centre rests, the place stays the same,
    /// however the probe is turned.
    fn spot(&self, hand: &Hand<'_>, pose: &DAffine3) -> Spot {
        self.known(pose).unwrap_or_else(|| hand.held(pose))
    }

    /// The place that the probe was held to, where nothing else has moved its face's centre since.
    fn known(&self, pose: &DAffine3) -> Option<Spot> {
        self.spot.filter(|(centre, _)| *centre == pose.translation).map(|(_, spot)| spot)
    }

    /// Depth to which the pointer presses it in: as it is, or gently where it is held above the skin.
    fn put_on(&self) -> f64 {
        if self.press < 0.0 { PRESS } else { self.press }
    }

    fn put(&mut self, hand: &Hand<'_>, pose: &DAffine3, from: &Spot, to: Spot) -> DAffine3 {
        let put = hand.slid(pose, from, &to, self.press);
        self.spot = Some((put.translation, to));
        put
    }

    /// The pose after a movement that does not leave the skin: shifts go along it, pressing and lifting change
    /// the depth, turns are those of the hand. None for a probe that is not near the skin.
    fn moved(
        &mut self,
        skin: &Skin,
        probe: &Probe,
        pose: &DAffine3,
        axis: Axis,
        amount: f64,
    ) -> Option<DAffine3> {
        let hand = Hand::new(skin, probe);
        let from = self.spot(&hand, pose);
        // Put here by something else, it is pressed as that has pressed it; out of a hand's reach it is free.
        if self.known(pose).is_none() {
            let [least, most] = PRESSES;
            let within = |press: &f64| (least..=most).contains(press);
            self.press = hand.pressed(pose, &from).filter(within)?;
        }
        let along = |axis: DVec3| {
            let tangent = pose.transform_vector3(axis).reject_from(from.normal);
            hand.beside(&from, tangent.normalize_or_zero() * amount)
        };
        Some(match axis {
            Axis::Lateral | Axis::Elevation => {
                let axis = match axis {
                    Axis::Lateral => DVec3::X,
                    _ => DVec3::Y,
                };
                // At the end of the skin the probe stays.
                along(axis).map_or(*pose, |to| self.put(&hand, pose, &from, to))
            }
            Axis::Depth => {
                let [least, most] = PRESSES;
                self.press = (self.press + amount).clamp(least, most);
                self.put(&hand, pose, &from, from)
            }
            Axis::Rotate | Axis::Rock | Axis::Tilt => {
                let turned = moved(pose, axis, amount);
                self.put(&hand, &turned, &from, from)
            }
        })
    }
}

/// The part of the skin that can be seen and chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The whole skin.
    Whole,
    /// The skin behind the image plane.
    BehindPlane,
}

impl Model {
    /// The present skin and the probe's contact; none where the scene names no skin.
    fn skin(&mut self, now: Instant) -> Option<(Skin, &mut Hold)> {
        let seconds = self.clock.at(now);
        let hold = self.hold.as_mut()?;
        Some((hold.body.at(seconds), hold))
    }

    /// The place of the skin seen along a ray.
    pub fn spot_seen(&mut self, ray: &Ray, seen: Seen, now: Instant) -> Option<Spot> {
        let pose = self.pose;
        let (skin, _) = self.skin(now)?;
        let hand = Hand::new(&skin, &self.settings.probe);
        match seen {
            Seen::Whole => hand.pick(ray.origin, ray.direction),
            Seen::BehindPlane => {
                let origin = ray.origin + across(&pose, ray)? * ray.direction;
                // There is no skin on the cut through the body.
                skin.gap(origin, ray.direction).filter(|gap| *gap > 0.0)?;
                hand.pick(origin, ray.direction)
            }
        }
    }

    /// The place of the skin that the probe is held to.
    pub fn spot_held(&mut self, now: Instant) -> Option<Spot> {
        let pose = self.pose;
        let (skin, _) = self.skin(now)?;
        let probe = &self.settings.probe;
        let hold = self.hold.as_ref()?;
        Some(hold.spot(&Hand::new(&skin, probe), &pose))
    }

    /// The probe's pose at a place of the skin.
    pub fn pose_at(&mut self, to: &Spot, now: Instant) -> Option<DAffine3> {
        let pose = self.pose;
        let (skin, _) = self.skin(now)?;
        let hold = self.hold.as_ref()?;
        let hand = Hand::new(&skin, &self.settings.probe);
        Some(hand.slid(&pose, &hold.spot(&hand, &pose), to, hold.put_on()))
    }

    /// Slides the probe to a place of the skin.
    pub fn slide_to(&mut self, to: &Spot, now: Instant) {
        self.slide(now, |hand, hold, pose| {
            let from = hold.spot(hand, pose);
            hold.press = hold.put_on();
            Some(hold.put(hand, pose, &from, *to))
        });
    }

    /// Slides the probe along its image plane to the point where a ray crosses it.
    pub fn slide_in_plane(&mut self, ray: &Ray, now: Instant) {
        self.slide(now, |hand, hold, pose| {
            let from = hold.spot(hand, pose);
            let to = ray.origin + across(pose, ray)? * ray.direction;
            let by = (to - from.point).clamp_length_max(FARTHEST);
            let to = hand.beside(&from, by)?;
            Some(hold.put(hand, pose, &from, to))
        });
    }

    /// Turns the probe about its face's centre: rock and tilt, rad. A probe that is to stay on the skin
    /// keeps touching it.
    pub fn lean(&mut self, [rock, tilt]: [f64; 2], now: Instant) {
        self.move_by(Source::Pointer, Axis::Rock, rock, now);
        self.move_by(Source::Pointer, Axis::Tilt, tilt, now);
    }

    /// Sets whether every movement keeps the probe on the skin; if so, puts it there, pressed in gently.
    pub fn stay_on_skin(&mut self, stays: bool, now: Instant) {
        if let Some(hold) = &mut self.hold {
            hold.stays = stays;
        }
        if stays {
            self.slide(now, |hand, hold, pose| {
                let from = hold.spot(hand, pose);
                hold.press = PRESS;
                Some(hold.put(hand, pose, &from, from))
            });
        }
    }

    /// The movement of [`Model::move_probe`] on the skin, where the probe is to stay there.
    pub(super) fn moved_on_skin(
        &mut self,
        axis: Axis,
        amount: f64,
        now: Instant,
    ) -> Option<DAffine3> {
        let (pose, probe) = (self.pose, self.settings.probe.clone());
        let (skin, hold) = self.skin(now).filter(|(_, hold)| hold.stays)?;
        hold.moved(&skin, &probe, &pose, axis, amount)
    }

    fn slide(
        &mut self,
        now: Instant,
        to: impl FnOnce(&Hand<'_>, &mut Hold, &DAffine3) -> Option<DAffine3>,
    ) {
        self.stop(now);
        let (pose, probe) = (self.pose, self.settings.probe.clone());
        let Some((skin, hold)) = self.skin(now) else {
            return;
        };
        if let Some(pose) = to(&Hand::new(&skin, &probe), hold, &pose) {
            self.place_probe(Source::Pointer, pose, now);
        }
    }
}

/// Distance along a ray to the image plane of `pose`, mm.
fn across(pose: &DAffine3, ray: &Ray) -> Option<f64> {
    let normal = pose.transform_vector3(DVec3::Y).normalize();
    let sine = normal.dot(ray.direction);
    let t = normal.dot(pose.translation - ray.origin) / sine;
    (sine.abs() > EDGE_ON && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::Instant;

    use glam::{DAffine3, DVec3};

    use super::Seen;
    use crate::model::{Axis, File, Model, Ray, Source};
    use crate::scene::Scene;
    use crate::sim::Tracer;
    use crate::sim::contact::{Coupling, Skins};

    /// A ball of 80 mm whose top is at the origin, a linear probe on it.
    fn ball(extra: &str) -> (Scene, Model) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.toml");
        let text = format!(
            "{extra}\n[probe]\npreset = \"linear\"\n[probe.pose]\nposition = [0, 0, 0.5]\n[[mesh]]\n\
             name = \"skin\"\ntissue = \"skin\"\ntranslate = [0, 0, 80]\n\
             shape = {{ sphere = {{ radius = 80, subdivisions = 6 }} }}\n"
        );
        std::fs::write(&file, text).unwrap();
        let scene = Scene::load(Path::new(&file), &[]).unwrap().0;
        let model = Model::new(
            &scene,
            File::new(file, Vec::new(), &scene),
            Tracer::Bvh,
            0.0,
            Instant::now(),
        );
        (scene, model)
    }

    const CONTACT: &str = "[contact]\nmesh = [\"skin\"]";

    fn height(pose: &DAffine3) -> f64 {
        pose.translation.distance(DVec3::Z * 80.0) - 80.0
    }

    #[test]
    fn a_probe_that_stays_goes_along_the_skin_and_a_free_one_straight() {
        let now = Instant::now();
        let (_, mut model) = ball(CONTACT);
        // The scene has it pressed in by 0.5 mm, and so it stays.
        model.move_probe(Axis::Lateral, 10.0, now);
        assert!((height(&model.pose) + 0.5).abs() < 0.01);
        // Far from the skin it is free.
        let far = DAffine3::from_translation(DVec3::new(0.0, 0.0, -50.0));
        model.place_probe(Source::Keyboard, far, now);
        model.move_probe(Axis::Lateral, 10.0, now);
        assert!(model.pose.translation.distance(DVec3::new(10.0, 0.0, -50.0)) < 1e-9);
        model.place_probe(Source::Keyboard, model.home, now);
        model.stay_on_skin(false, now);
        model.move_probe(Axis::Lateral, 10.0, now);
        assert!(model.pose.translation.distance(DVec3::new(10.0, 0.0, 0.5)) < 1e-9);
        model.place_probe(Source::Keyboard, model.home, now);
        model.stay_on_skin(true, now);
        // Pressed by 1.5 mm; facets are 2 um off the ball.
        assert!((height(&model.pose) + 1.5).abs() < 0.01);
        for _ in 0..40 {
            model.move_probe(Axis::Lateral, 2.0, now);
            assert!((height(&model.pose) + 1.5).abs() < 0.01);
        }
        let angle = (model.pose.transform_vector3(DVec3::Z)).angle_between(DVec3::Z);
        // 40 steps of 2 mm along the tangent: each atan(2 / 80).
        assert!((angle - 40.0 * (2.0f64 / 80.0).atan()).abs() < 0.01, "{angle}");
        model.move_probe(Axis::Depth, 3.0, now);
        assert!((height(&model.pose) + 4.5).abs() < 0.01);
        model.move_probe(Axis::Depth, -9.0, now);
        assert!((height(&model.pose) - 4.5).abs() < 0.01, "lifted");
        model.stay_on_skin(false, now);
        let before = model.pose;
        model.move_probe(Axis::Elevation, 5.0, now);
        assert!(model.pose.translation.distance(before.translation) > 4.99);
    }

    #[test]
    fn leaning_back_and_forth_ends_where_it_began() {
        let now = Instant::now();
        let (_, mut model) = ball(CONTACT);
        model.stay_on_skin(true, now);
        let before = model.pose;
        for step in 0..40 {
            let by = if step < 20 { 0.02 } else { -0.02 };
            model.move_probe(Axis::Tilt, by, now);
        }
        assert!(model.pose.abs_diff_eq(before, 1e-6), "{:?}", model.pose);
    }

    #[test]
    fn the_skin_is_picked_whole_or_behind_the_image_plane() {
        let now = Instant::now();
        let (_, mut model) = ball(CONTACT);
        let ray = |x: f64, z: f64| Ray { origin: DVec3::new(x, -300.0, z), direction: DVec3::Y };
        let near = model.spot_seen(&ray(10.0, 60.0), Seen::Whole, now).unwrap();
        assert!(near.point.y < -70.0);
        assert_eq!(model.spot_seen(&ray(10.0, 60.0), Seen::BehindPlane, now), None, "cut");
        assert_eq!(model.spot_seen(&ray(10.0, -60.0), Seen::Whole, now), None, "beside");
        let slanted = Ray {
            origin: DVec3::new(0.0, -300.0, -150.0),
            direction: DVec3::new(0.0, 300.0, 145.0).normalize(),
        };
        let far = model.spot_seen(&slanted, Seen::BehindPlane, now).unwrap();
        assert!(far.point.y > 0.0, "{far:?}");
        model.slide_to(&far, now);
        assert!((height(&model.pose) + 1.5).abs() < 0.02);
        assert_eq!(model.spot_held(now), Some(far));
    }

    #[test]
    fn in_its_plane_the_probe_follows_the_pointer_and_does_not_leave_the_plane() {
        let now = Instant::now();
        let (scene, mut model) = ball(CONTACT);
        for x in 0..50 {
            let ray = Ray { origin: DVec3::new(f64::from(x), -300.0, 0.0), direction: DVec3::Y };
            model.slide_in_plane(&ray, now);
            let at = model.pose.translation;
            assert!(at.y.abs() < 0.1, "{at}");
            assert!((height(&model.pose) + 1.5).abs() < 0.02, "{at}");
        }
        let at = model.pose.translation;
        // On the radius through the pointer's last place.
        let expected = 78.5 * 49.0 / 49f64.hypot(80.0);
        assert!((at.x - expected).abs() < 0.1, "{at}");
        let mut moved = scene.clone();
        moved.world_from_probe = model.pose;
        let contact = Coupling::of(&moved, &mut Skins::default()).unwrap();
        // A flat face pressed into a ball by 1.5 mm, and 3 mm of gel: all of its 38 mm is coupled.
        assert_eq!(contact.touch.share, 1.0);
    }

    #[test]
    fn without_a_skin_nothing_holds_the_probe() {
        let now = Instant::now();
        let (_, mut model) = ball("");
        model.stay_on_skin(true, now);
        let ray = Ray { origin: -DVec3::Z * 50.0, direction: DVec3::Z };
        assert!(model.hold.is_none());
        assert_eq!(model.spot_seen(&ray, Seen::Whole, now), None);
        model.move_probe(Axis::Lateral, 1.0, now);
        assert!(model.pose.translation.distance(DVec3::new(1.0, 0.0, 0.5)) < 1e-9);
    }
}
