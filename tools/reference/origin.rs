//! Twin of `origin`: the media that enclose the start of each line, and the place where its paths begin.

use super::geometry::world_line;
use super::path::step;
use super::stack::Stack;
use super::straight::Start;
use super::world::{Crossing, World};
use insonify::sim::layout::{MAX_STACK, NONE, START_WORDS};

/// Most crossings that are followed.
const CROSSINGS: usize = 64;

/// One start per line e * scanlines + l, and the number of media that did not fit into a stack.
pub fn origin(world: &World) -> (Vec<Start>, u32) {
    let mut overflow = 0;
    let mut starts = Vec::new();
    for e in 0..world.frame.layers {
        for l in 0..world.frame.scanlines {
            let line = world_line(world.frame, l, e);
            let mut crossings = world.crossings(line.origin, line.direction, [0.0, f64::INFINITY]);
            crossings.truncate(CROSSINGS);
            let close = step(line.origin);
            let ahead = line.origin + close * line.direction;
            let behind = world.crossings(ahead, -line.direction, [0.0, f64::INFINITY]);
            let unsure = behind.first().is_some_and(|c| c.t < 2.0 * close);
            let decides = if !unsure && is_ordered(world, &behind) { &behind } else { &crossings };
            let (media, full) = media(world, decides);
            overflow += u32::from(full);
            let (start, full) = world.start(media, &crossings);
            overflow += full;
            starts.push(start);
        }
    }
    (starts, overflow)
}

/// The media at the start of a straight line with these crossings, and true if not all fit into a stack.
pub(super) fn media(world: &World, crossings: &[Crossing]) -> (Stack, bool) {
    let mut media = enclosing(crossings);
    let full = media.len() > MAX_STACK;
    media.truncate(MAX_STACK);
    if media.is_empty() && world.frame.couplant != NONE {
        media.push(world.frame.couplant);
    }
    (Stack(media), full)
}

/// True if these crossings are all and no two of the instances that enclose the start have the same priority: it is the same
/// then in which order they are left, and the kernel does not follow the line for it.
fn is_ordered(world: &World, crossings: &[Crossing]) -> bool {
    let around = enclosing(crossings);
    let mut priorities: Vec<i32> =
        around.iter().map(|&i| world.instances[i as usize].priority).collect();
    priorities.sort_unstable();
    priorities.dedup();
    priorities.len() == around.len() && around.len() <= MAX_STACK && crossings.len() < CROSSINGS
}

/// Instances left more often than entered; the one whose last exit is farthest comes first.
fn enclosing(crossings: &[Crossing]) -> Vec<u32> {
    let mut instances: Vec<u32> = Vec::new();
    for c in crossings.iter().rev().filter(|c| !c.entry) {
        let own = crossings.iter().filter(|o| o.instance == c.instance);
        let net: i32 = own.map(|o| if o.entry { -1 } else { 1 }).sum();
        if net > 0 && !instances.contains(&c.instance) {
            instances.push(c.instance);
        }
    }
    instances
}

/// The starts in the layout of the device's buffer.
pub fn pack(starts: &[Start]) -> Vec<u32> {
    let mut packed = vec![0; starts.len() * START_WORDS];
    for (slot, start) in packed.chunks_mut(START_WORDS).zip(starts) {
        let media = &start.media.0;
        slot[0] = media.len() as u32;
        slot[1..=media.len()].copy_from_slice(media);
        slot[MAX_STACK + 1] = (start.travelled as f32).to_bits();
        slot[MAX_STACK + 2] = (start.weight as f32).to_bits();
        slot[MAX_STACK + 3] = start.interactions;
    }
    packed
}

/// The start in one line's words of the device's buffer.
pub fn unpack(words: &[u32; START_WORDS]) -> Start {
    let count = (words[0] as usize).min(MAX_STACK);
    Start {
        media: Stack(words[1..=count].to_vec()),
        travelled: f32::from_bits(words[MAX_STACK + 1]).into(),
        weight: f32::from_bits(words[MAX_STACK + 2]).into(),
        interactions: words[MAX_STACK + 3],
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::fixture::{Fixture, tissue};
    use super::*;

    fn spheres(radii: &[f64]) -> Fixture {
        let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
        for &r in radii {
            fixture.sphere(DVec3::new(0.3, 0.2, 0.1), r, 24, 0, 0);
        }
        fixture
    }

    #[test]
    fn nested_spheres_enclose_the_start_from_the_outermost_in() {
        let mut fixture = spheres(&[5.0, 20.0, 10.0]);
        // Ahead of the probe, behind it and beside it: none encloses the start.
        fixture.sphere(DVec3::new(0.0, 0.0, 50.0), 8.0, 24, 0, 0);
        fixture.sphere(DVec3::new(0.0, 0.0, -50.0), 8.0, 24, 0, 0);
        fixture.sphere(DVec3::new(30.0, 0.0, 0.0), 8.0, 24, 0, 0);
        let (stacks, overflow) = origin(&fixture.world());
        assert_eq!((&stacks[0].media.0[..], overflow), (&[1, 2, 0][..], 0));
        let mut packed = vec![3, 1, 2, 0];
        packed.resize(MAX_STACK + 1, 0);
        packed.extend([0.0_f32, 1.0].map(f32::to_bits));
        packed.push(0);
        assert_eq!(pack(&stacks), packed);
        let back: [u32; START_WORDS] = packed.try_into().expect("the words of one line");
        assert_eq!(unpack(&back), stacks[0]);
    }

    #[test]
    fn where_equals_overlap_the_one_that_the_line_leaves_last_is_the_outermost() {
        let around = |priorities: [i32; 2]| {
            let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
            for (z, priority) in [3.0, -3.0].into_iter().zip(priorities) {
                fixture.sphere(DVec3::new(0.3, 0.2, z), 10.0, 24, 0, priority);
            }
            origin(&fixture.world()).0[0].media.0.clone()
        };
        assert_eq!(around([4, 4]), [0, 1]);
        assert_eq!(around([4, 5]), [1, 0], "by the ray the other way, as it does not matter");
    }

    #[test]
    fn a_face_exactly_on_a_surface_is_inside_the_body_ahead() {
        for (z, inside) in [(0.0, true), (-1.0, true), (1.0, false)] {
            let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
            fixture.block([-20.0, -19.0, z], [21.0, 20.0, z + 8.0], 0, 0);
            let expected: &[u32] = if inside { &[0] } else { &[] };
            assert_eq!(origin(&fixture.world()).0[0].media.0, expected, "{z}");
        }
    }

    #[test]
    fn if_media_do_not_fit_the_outermost_are_kept() {
        let most = MAX_STACK as u32;
        let radii: Vec<f64> = (1..=most + 2).map(|i| 2.0 * f64::from(i)).collect();
        let (stacks, overflow) = origin(&spheres(&radii).world());
        let outermost: Vec<u32> = (2..most + 2).rev().collect();
        assert_eq!((&stacks[0].media.0, overflow), (&outermost, 1));
    }

    #[test]
    fn lines_differ_where_only_some_start_inside() {
        let mut fixture = spheres(&[]);
        fixture.block([0.0, -9.0, -9.0], [9.0, 9.0, 9.0], 0, 0);
        (fixture.frame.scanlines, fixture.frame.layers) = (4, 2);
        let (stacks, _) = origin(&fixture.world());
        let counts: Vec<usize> = stacks.iter().map(|s| s.media.0.len()).collect();
        assert_eq!(counts, [0, 0, 1, 1, 0, 0, 1, 1]);
    }

    #[test]
    fn a_ray_through_edges_crosses_once() {
        let mut fixture = spheres(&[]);
        // The pole is a fan of triangles, and the ray runs through both poles.
        let turn = glam::DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        fixture.sphere(DVec3::ZERO, 5.0, 12, 0, 0);
        fixture.instances[0].object_from_world = super::super::fixture::rows_of(&turn);
        let (stacks, _) = origin(&fixture.world());
        assert_eq!(stacks[0].media.0, [0]);
    }
}
