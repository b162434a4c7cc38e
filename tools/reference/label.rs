//! Twin of `label`: the instance at each sample, straight along its scanline.

use super::mask::middle;
use super::world::{Crossing, World};
use insonify::sim::layout::NONE;

/// The crossings of a scanline and the instances around it.
#[derive(Clone, Debug)]
pub struct Labels {
    /// The crossings, by distance.
    pub crossings: Vec<Crossing>,
    /// The instance before the first crossing, and behind each.
    around: Vec<Option<u32>>,
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
}

/// The labels of each scanline.
pub fn label(world: &World) -> Vec<Labels> {
    (0..world.frame.scanlines)
        .map(|l| {
            let (origin, direction) = middle(world.frame, l);
            let crossings = world.crossings(origin, direction, [0.0, f64::INFINITY]);
            let around = (0..=crossings.len()).map(|passed| world.behind(&crossings, passed));
            let around = around.collect();
            Labels { crossings, around }
        })
        .collect()
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
        let labels = &label(&world.world())[0];
        let found = [5.0, 12.0, 17.0, 22.0, 28.0, 35.0, 45.0].map(|z| labels.at(z));
        assert_eq!(found, [None, Some(0), Some(1), Some(0), Some(0), Some(2), None]);
    }
}
