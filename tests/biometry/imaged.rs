//! The fetus measured on images of it: marks where an examiner sees the edges.
//!
//! The examiner waits until the fetus lies as it should; here it is laid so. Each measurement is taken on [`IMAGES`]
//! with speckle of their own, of which the worksheet takes the mean. Sizes are those that the model was made with. The
//! femur is left out: its 7 mm are a few resolution cells, and its ends fade into the tissue around it.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use insonify::exam::{CaliperKind, Measured, Worksheet};
use insonify::gpu::test_device;
use insonify::settings::{Exam, GreyMap};
use insonify::sim::shaders::Library;
use insonify::sim::{Shot, Simulator, Tracer};

use super::{close, corners, named, plane, scene};

/// Depth of the middle of what is measured, mm: that of the fetus in its scene.
const DEPTH: f64 = 68.0;

/// Thickness of the skull in tools/anatomy/fetus.rs, mm.
const VAULT: f64 = 0.7;

/// Half of a power, and of an amplitude.
const HALF_POWER: f64 = 0.5;
/// See [`HALF_POWER`].
const HALF_AMPLITUDE: f64 = 0.25;

/// How the fetus lies in the image, in its own frame: x to the crown, y to the left, z to the back, mm.
struct Lie {
    /// What is in the middle of the image, [`DEPTH`] deep.
    at: DVec3,
    /// The image's lateral axis.
    lateral: DVec3,
    /// The image's depth axis.
    depth: DVec3,
    /// True where the probe is turned by a right angle, so that the fetus lies along the womb all the same.
    across: bool,
}

/// The power of the echoes of an image.
struct Picture {
    size: [usize; 2],
    power: Vec<f64>,
    /// Size of a pixel, mm.
    pitch: f64,
    /// Middle of the first pixel, mm lateral and deep.
    first: DVec2,
}

impl Picture {
    /// The power at a point between the pixels.
    fn at(&self, point: DVec2) -> f64 {
        let place = (point - self.first) / self.pitch;
        let (whole, part) = (place.floor(), place - place.floor());
        let [x, y] = whole.to_array().map(|v| v as usize);
        let of = |dx: usize, dy: usize| self.power[(y + dy) * self.size[0] + x + dx];
        let row = |dy| of(0, dy) + part.x * (of(1, dy) - of(0, dy));
        row(0) + part.y * (row(1) - row(0))
    }

    /// The way from one point to another in steps of half a pixel, with the mean power over 1 mm to both sides, within
    /// which the edges that are measured are straight to a tenth of a millimetre.
    fn way(&self, from: DVec2, to: DVec2) -> Vec<(DVec2, f64)> {
        let (length, across) = (from.distance(to), (to - from).normalize().perp());
        let steps = (2.0 * length / self.pitch).ceil();
        let sides = || (-8..=8).map(|i| f64::from(i) / 8.0 * across);
        (0..=steps as u32)
            .map(|i| from.lerp(to, f64::from(i) / steps))
            .map(|point| (point, sides().map(|side| self.at(point + side)).sum::<f64>() / 17.0))
            .collect()
    }

    /// Where the power on the way first reaches `part` of the loudest on it.
    fn edge_of_line(&self, from: DVec2, to: DVec2, part: f64) -> DVec2 {
        let way = self.way(from, to);
        let loudest = way.iter().map(|(_, power)| *power).fold(0.0, f64::max);
        reached(&way, part * loudest)
    }

    /// Where the power on the way into tissue first reaches half of its mean in the way's last third, which lies in
    /// the tissue: where the edge of speckle is.
    fn edge_of_tissue(&self, from: DVec2, to: DVec2) -> DVec2 {
        let way = self.way(from, to);
        let inside = &way[way.len() * 2 / 3..];
        let mean = inside.iter().map(|(_, power)| power).sum::<f64>() / inside.len() as f64;
        reached(&way, HALF_POWER * mean)
    }
}

/// Where a power is first reached.
fn reached(way: &[(DVec2, f64)], power: f64) -> DVec2 {
    let at = way.iter().position(|step| step.1 >= power).expect("it is reached");
    assert!(at > 0, "the way begins outside");
    let [before, after] = [way[at - 1], way[at]];
    before.0.lerp(after.0, (power - before.1) / (after.1 - before.1))
}

/// Images of a lie: by speckle alone one of them is off by some percent.
const IMAGES: u32 = 12;

/// Images of the fetus as it lies, each with other speckle.
fn pictures(lie: &Lie) -> Vec<Picture> {
    let mut world_from_probe = scene("fetus.toml", &[]).world_from_probe;
    if lie.across {
        world_from_probe *= DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
    }
    let depth = lie.depth.reject_from(lie.lateral).normalize();
    let fetus_from_probe = plane(lie.at - DEPTH * depth, lie.lateral, depth);
    let world_from_fetus = world_from_probe * fetus_from_probe.inverse();
    let (axis, angle) = DQuat::from_mat3(&world_from_fetus.matrix3).to_axis_angle();
    let set = |key: &str, value: String| (format!("transform.fetus.{key}"), value);
    let angle = angle.to_degrees();
    let laid = [
        set("translate", format!("{:?}", world_from_fetus.translation.to_array())),
        set("rotate", format!("{{ axis = {:?}, angle = \"{angle} deg\" }}", axis.to_array())),
    ];
    let mut scene = scene("fetus.toml", &laid);
    scene.world_from_probe = world_from_probe;
    // Greys that tell the power: in dB, and the loudest edges not yet white.
    let imaging = &mut scene.imaging;
    (imaging.grey_map, imaging.gain, imaging.dynamic_range) = (GreyMap::Linear, 16.0, 60.0);
    let mut simulator =
        Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh).expect("made");
    let shots: Vec<Shot> = (1..=IMAGES).map(|seed| Shot { seed, ..Shot::of(&scene, 0) }).collect();
    simulator.frames(&scene, &shots).expect("no device error");
    let frame = *simulator.constants();
    let pitch = f64::from(frame.pixel_pitch);
    let corner = DVec2::new(frame.image_left.into(), frame.image_top.into());
    let first = corner + pitch / 2.0;
    let bel = scene.imaging.dynamic_range / 10.0 / 255.0;
    let one = |shot| {
        simulator.choose(shot);
        let (width, height, rgba) = simulator.pixels().expect("no device error");
        let grey = rgba.chunks_exact(4).map(|pixel| f64::from(pixel[0]));
        // Black is anything below the dynamic range.
        let power = grey.map(|level| 10f64.powf(bel * level) - 1.0).collect();
        Picture { size: [width as usize, height as usize], power, pitch, first }
    };
    (0..shots.len()).map(one).collect()
}

/// A point so many mm beside and deeper than the middle.
fn beside(lateral: f64, deeper: f64) -> DVec2 {
    DVec2::new(lateral, DEPTH + deeper)
}

/// From the outer edge of the skull's near wall to the inner edge of its far one, the first echo of each, `radius` mm
/// from its middle. The far wall's outer edge is fainter by 10 dB, behind the inner one.
fn skull(lie: &Lie, radius: f64, name: &str) -> Vec<Measured> {
    let one = |picture: &Picture| {
        let edge = |from, to| picture.edge_of_line(from, to, HALF_AMPLITUDE);
        let near = edge(beside(0.0, -radius - 4.0), beside(0.0, 4.0 - radius));
        let far = edge(beside(0.0, radius - 4.0), beside(0.0, radius + 4.0));
        named(CaliperKind::Distance, vec![near, far], name)
    };
    pictures(lie).iter().map(one).collect()
}

/// An ellipse through the edges of the trunk left, right and near.
fn trunk(lie: &Lie) -> Vec<Measured> {
    let one = |picture: &Picture| {
        let edge = |from: DVec2, to: DVec2| picture.edge_of_tissue(from, to);
        let [near, far] = [-12.0, 12.0].map(|out| edge(beside(0.0, out), beside(0.0, 0.25 * out)));
        let middle = near.midpoint(far).y - DEPTH;
        // Of three ways the one between the others: a dark grain at the edge would be taken for fluid.
        let side = |out: f64| {
            let mut marks = [-0.8, 0.0, 0.8]
                .map(|up| edge(beside(out, middle + up), beside(0.25 * out, middle + up)).x);
            marks.sort_by(f64::total_cmp);
            beside(marks[1], middle)
        };
        let [left, right] = [-12.0, 12.0].map(side);
        named(CaliperKind::Ellipse, vec![left, right, near], "AC")
    };
    pictures(lie).iter().map(one).collect()
}

/// From the crown to the rump, which lie on the lateral axis, `half` mm from the middle.
fn crown_to_rump(lie: &Lie, half: f64) -> Vec<Measured> {
    let one = |picture: &Picture| {
        let crown =
            picture.edge_of_line(beside(half + 4.0, 0.0), beside(half - 2.0, 0.0), HALF_AMPLITUDE);
        let rump = picture.edge_of_tissue(beside(-half - 4.0, 0.0), beside(8.0 - half, 0.0));
        named(CaliperKind::Distance, vec![crown, rump], "CRL")
    };
    pictures(lie).iter().map(one).collect()
}

#[test]
fn the_fetus_is_as_large_on_its_images_as_it_was_made() {
    let scene = scene("fetus.toml", &[]);
    let of = |name: &str| {
        let instance = scene.instances.iter().find(|i| i.name == name).expect("there is one");
        let fetus = scene.instances.iter().find(|i| i.name == "trunk").expect("there is one");
        let fetus_from_mesh = fetus.world_from_object.inverse() * instance.world_from_object;
        corners(&scene.meshes[instance.mesh], &fetus_from_mesh)
    };
    let middle = super::middle(&of("skull"));
    // The forehead is bent forwards by 0.24 rad.
    let back = DVec3::new(0.24f64.sin(), 0.0, 0.24f64.cos());
    let head = |lateral, depth| Lie { at: middle, lateral, depth, across: true };
    let mut all = skull(&head(back, DVec3::Y), 8.5, "BPD");
    all.extend(skull(&head(DVec3::Y, back), 10.75, "OFD"));
    let navel = DVec3::new(-8.0, 0.0, -0.6);
    all.extend(trunk(&Lie { at: navel, lateral: -DVec3::Y, depth: DVec3::Z, across: true }));
    let (trunk, head) = (of("trunk"), of("head"));
    let by = |a: &&DVec3, b: &&DVec3| a.x.total_cmp(&b.x);
    let rump = *trunk.iter().flatten().min_by(by).expect("a trunk");
    let crown = *head.iter().flatten().max_by(by).expect("a head");
    let (at, lateral) = (rump.midpoint(crown), crown - rump);
    let long = Lie { at, lateral, depth: DVec3::Y, across: false };
    all.extend(crown_to_rump(&long, lateral.length() / 2.0));
    assert_eq!(test_device().validation_messages(), Vec::<String>::new());
    let sheet = Worksheet::of(Exam::Obstetric, &all);
    for (name, expected) in [
        ("BPD", super::BPD - VAULT),
        ("OFD", super::OFD - VAULT),
        ("AC", super::AC),
        ("CRL", super::CRL),
    ] {
        close(name, sheet.mean(name).expect("measured"), expected, 0.03);
    }
}
