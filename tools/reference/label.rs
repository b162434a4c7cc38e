//! Twin of `label`: what each sample shows, where that is, and what became of the sound on the way.

use glam::DVec3;

use super::aperture::{counted, loses_by_aperture, nepers};
use super::beam::coupling;
use super::field::Field;
use super::geometry::world_line;
use super::mask::{depth, middle};
use super::origin::media;
use super::straight::Start;
use super::transmitted::{self, Way, sample, ways};
use super::world::{Crossing, World, affine};
use insonify::sim::layout::{Frame, Instance, NONE};

/// Most ways of a line.
const MAX_WAYS: usize = 64;

/// The last frame, of which the labels tell how the tissue has moved since.
#[derive(Clone, Copy, Debug)]
pub struct Past<'a> {
    /// Constants.
    pub frame: &'a Frame,
    /// Placed meshes.
    pub instances: &'a [Instance],
    /// Displacement fields, in vectors.
    pub fields: &'a [[f32; 3]],
}

/// One scanline in the middle of the slice.
#[derive(Clone, Debug)]
pub struct Labels {
    /// The crossings straight along it, by distance.
    pub crossings: Vec<Crossing>,
    /// The instance before the first crossing, and behind each.
    around: Vec<Option<u32>>,
    ways: Vec<Way>,
    /// The sample at which each way begins.
    pub begins: Vec<f64>,
}

/// Where the main path is when a sample's echo is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Index of the tissue.
    pub tissue: u32,
    /// Index of the instance; NONE in the background.
    pub instance: u32,
    /// World, mm.
    pub place: DVec3,
    /// Loss on the way there and back, dB.
    pub loss: f64,
}

impl Labels {
    /// The instance at a distance, mm; none in the background.
    pub fn at(&self, distance: f64) -> Option<u32> {
        self.around[self.passed(distance)]
    }

    /// The tissue at a distance, mm.
    pub fn tissue(&self, world: &World, distance: f64) -> u32 {
        let gap = self.passed(distance) == 0 && world.frame.couplant != NONE;
        let instance = self.at(distance).or(gap.then_some(world.frame.couplant));
        instance.map_or(world.frame.background, |i| world.instances[i as usize].tissue)
    }

    fn passed(&self, distance: f64) -> usize {
        self.crossings.iter().take_while(|c| c.t <= distance).count()
    }

    /// Where the main path is at sample `k`; none where it has ended or is not heard.
    pub fn seen(&self, world: &World, k: f64) -> Option<Seen> {
        let at = self.begins[1..].iter().take_while(|begin| **begin <= k).count();
        let way = &self.ways[at];
        if way.ends || !way.heard {
            return None;
        }
        let frame = world.frame;
        let time = (k - self.begins[at]) * f64::from(frame.sample_pitch) / f64::from(frame.speed);
        let x = time * way.speed;
        let (tissue, instance) = world.medium(&way.path.stack);
        let instance = if instance == frame.couplant { NONE } else { instance };
        let place = way.path.origin + x * way.path.direction;
        let mut lost = way.absorption * x - way.path.weight.ln();
        if loses_by_aperture(frame) {
            let table = counted(world.apertures);
            let time = k * f64::from(frame.sample_pitch) / f64::from(frame.speed);
            // The layers beside the middle of the slice.
            let beside = [(frame.layers - 1) / 2, frame.layers / 2].map(|layer| {
                let line = layer * frame.scanlines + way.path.line;
                nepers(frame, &table, line, time, lost)
            });
            lost -= (beside[0] + beside[1]) / 2.0;
            if lost > -f64::from(frame.min_weight).ln() {
                return None;
            }
        }
        Some(Seen { tissue, instance, place, loss: lost * 20.0 / std::f64::consts::LN_10 })
    }

    /// Angle from the normal of the first surface that the main path meets in sample `k`, degrees.
    pub fn incidence(&self, k: u32) -> Option<f64> {
        let met = self.begins.iter().zip(&self.ways);
        let mut here = met.filter(|(begin, _)| (**begin + 0.5).floor() == f64::from(k));
        here.find_map(|(_, way)| way.surface).map(|surface| surface.incidence.to_degrees())
    }
}

/// Where the tissue of an instance that is at `p` in the world was in the last frame.
pub fn place_before(world: &World, past: &Past, instance: u32, p: DVec3) -> DVec3 {
    if instance == NONE {
        return p;
    }
    let now = affine(&world.instances[instance as usize].texture_from_world);
    let before = &past.instances[instance as usize];
    let mut q = now.transform_point3(p);
    if let Some(field) = world.field(instance) {
        q = field.reference(q);
        // Without a field then, the reference shape was shown.
        if before.field != NONE {
            q += Field::new(past.fields, before.field).displacement(q);
        }
    }
    affine(&before.texture_from_world).inverse().transform_point3(q)
}

/// How the tissue of a sample has moved since the last frame, in the probe's frame, mm.
pub fn moved(world: &World, past: &Past, seen: &Seen) -> DVec3 {
    let now = affine(&world.frame.probe_from_world).transform_point3(seen.place);
    let place = place_before(world, past, seen.instance, seen.place);
    now - affine(&past.frame.probe_from_world).transform_point3(place)
}

/// The coupled share of scanline `l` at sample `k`.
pub fn contact(world: &World, shares: &[f32], l: u32, k: u32) -> f64 {
    coupling(world.frame, &world.rows[k as usize], shares, l)
}

/// The labels of each scanline.
pub fn label(world: &World) -> Vec<Labels> {
    let frame = world.frame;
    (0..frame.scanlines)
        .map(|l| {
            let (origin, direction) = middle(frame, l);
            let crossings = world.crossings(origin, direction, [0.0, f64::INFINITY]);
            let around = (0..=crossings.len()).map(|passed| world.behind(&crossings, passed));
            let around = around.collect();
            let (media, _) = media(world, &crossings);
            let along = super::geometry::Line { origin, ..world_line(frame, l, 0) };
            let mut path = transmitted::middle(frame, l, along, &Start::at_face(media));
            let jitter = f64::from(frame.origin_jitter);
            let lobe = f64::from(frame.emission_lobe);
            let fan = if lobe > 0.0 { (lobe + 2.0).recip() } else { 0.0 };
            path.spread = [jitter * jitter, 0.0, fan];
            let ways = ways(world, path, |path, count| {
                count + 1 == MAX_WAYS
                    || path.interactions >= frame.max_interactions
                    || !loses_by_aperture(frame) && path.weight < f64::from(frame.min_weight)
            });
            let begins = ways.iter().map(|way| sample(frame, &way.path)).collect();
            Labels { crossings, around, ways, begins }
        })
        .collect()
}

/// Distance of sample `k` straight along its scanline, mm.
pub fn distance(frame: &Frame, k: u32) -> f64 {
    depth(frame, k)
}

#[cfg(test)]
mod tests {
    use super::label;
    use crate::reference::fixture::{Fixture, tissue};

    #[test]
    fn a_label_is_the_innermost_mesh_by_priority() {
        let mut world = Fixture::new(vec![tissue(1.5, 1.5, 0.0); 3]);
        world.block([-5.0, -5.0, 10.0], [5.0, 5.0, 30.0], 1, 0);
        world.block([-2.0, -2.0, 15.0], [2.0, 2.0, 20.0], 2, 1);
        // It has a lower priority, so it is not labelled where it overlaps the first.
        world.block([-3.0, -3.0, 25.0], [3.0, 3.0, 40.0], 2, -1);
        let world = world.world();
        let labels = &label(&world)[0];
        let places = [5.0, 12.0, 17.0, 22.0, 28.0, 35.0, 45.0];
        let found = places.map(|z| labels.at(z));
        assert_eq!(found, [None, Some(0), Some(1), Some(0), Some(0), Some(2), None]);
        // Where nothing refracts, what is seen is what is there.
        let seen = places.map(|z| labels.seen(&world, z / 0.25).unwrap());
        assert_eq!(seen.map(|s| s.instance), found.map(|i| i.unwrap_or(u32::MAX)));
        assert!(
            seen.iter().zip(places).all(|(s, z)| (s.place.z - z).abs() < 1e-9 && s.loss == 0.0)
        );
    }

    // A slab of 10 mm, 3 Np/cm, twice the impedance, half as fast again: behind it sound arrives earlier, and
    // has lost what the slab absorbs and what both of its faces reflect.
    #[test]
    fn what_lies_behind_a_slab_is_seen_too_early_and_has_lost_what_the_slab_takes() {
        let mut world = Fixture::new(vec![tissue(1.5, 1.5, 0.0), tissue(2.25, 3.0, 0.3)]);
        world.block([-40.0, -40.0, 10.0], [40.0, 40.0, 20.0], 1, 0);
        let world = world.world();
        let labels = &label(&world)[0];
        let transmitted: f64 = 1.0 - (1.5_f64 / 4.5).powi(2);
        let decibel = |amplitude: f64| -20.0 * amplitude.log10();
        for (k, z, loss) in [
            (39.0, 9.75, 0.0),
            (50.0, 13.75, decibel(transmitted * (-0.3 * 3.75_f64).exp())),
            // 10 mm in front, 10 mm in two thirds of the time, 5 mm behind: 21.667 mm at 1.5 mm/us.
            (65.0 / 0.75, 25.0, decibel(transmitted.powi(2) * (-3.0_f64).exp())),
        ] {
            let seen = labels.seen(&world, k).unwrap();
            // Properties are given in single precision.
            assert!((seen.place.z - z).abs() < 1e-5, "{k}: {}", seen.place.z);
            assert!((seen.loss - loss).abs() < 1e-5, "{k}: {} {loss}", seen.loss);
        }
        assert_eq!(labels.incidence(40), Some(0.0));
        assert_eq!(labels.incidence(41), None);
    }
}
