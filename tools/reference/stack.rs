//! Media that enclose a point: nested and overlapping meshes with priorities.

use insonify::sim::layout::{FLAG_MASKED, Frame, Instance, MAX_STACK};

/// Instances entered and not left, in the order of entering.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stack(pub Vec<u32>);

impl Stack {
    /// Pushes `instance`; false if the stack is full and unchanged.
    pub fn enter(&mut self, instance: u32) -> bool {
        let room = self.0.len() < MAX_STACK;
        if room {
            self.0.push(instance);
        }
        room
    }

    /// Removes the last occurrence of `instance`, if there is one.
    pub fn leave(&mut self, instance: u32) {
        if let Some(at) = self.0.iter().rposition(|&i| i == instance) {
            self.0.remove(at);
        }
    }

    /// True if echoes from here are wanted: everywhere, or in a masked frame inside a masking instance.
    pub fn is_heard(&self, frame: &Frame, instances: &[Instance]) -> bool {
        let masks = |&i: &u32| instances[i as usize].masks != 0;
        frame.flags & FLAG_MASKED == 0 || self.0.iter().any(masks)
    }

    /// The instance whose tissue fills the point: the highest priority, of equals the last pushed.
    pub fn current(&self, instances: &[Instance]) -> Option<u32> {
        // max_by_key keeps the last of equal maxima.
        let priority = |&i: &u32| instances[i as usize].priority;
        self.0.iter().copied().max_by_key(priority)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instances(priorities: &[i32]) -> Vec<Instance> {
        let instance = |&priority| Instance { priority, ..Instance::default() };
        priorities.iter().map(instance).collect()
    }

    fn after(instances: &[Instance], crossings: &[i32]) -> Option<u32> {
        let mut stack = Stack::default();
        for &c in crossings {
            match c {
                0.. => assert!(stack.enter(c as u32)),
                _ => stack.leave((-c - 1) as u32),
            }
        }
        stack.current(instances)
    }

    // A crossing is i for entering instance i, -1 - i for leaving it.
    #[test]
    fn the_highest_priority_fills_overlaps_and_the_last_entered_breaks_ties() {
        let equal = instances(&[0, 0]);
        assert_eq!(after(&equal, &[]), None);
        assert_eq!(after(&equal, &[0, 1]), Some(1));
        assert_eq!(after(&equal, &[1, 0]), Some(0));
        assert_eq!(after(&equal, &[0, 1, -1]), Some(1), "left the outer one first");
        assert_eq!(after(&equal, &[0, 1, -2]), Some(0));
        let vessel_wins = instances(&[5, 1, -3]);
        assert_eq!(after(&vessel_wins, &[0, 1]), Some(0));
        assert_eq!(after(&vessel_wins, &[0, 1, 2, -1]), Some(1));
        assert_eq!(after(&vessel_wins, &[2]), Some(2), "negative priorities beat nothing at all");
    }

    #[test]
    fn leaving_removes_the_last_occurrence_and_forgives_strangers() {
        let mut stack = Stack(vec![3, 1, 3, 2]);
        stack.leave(3);
        assert_eq!(stack.0, [3, 1, 2]);
        stack.leave(7);
        assert_eq!(stack.0, [3, 1, 2]);
        for i in 3..MAX_STACK as u32 {
            assert!(stack.enter(i));
        }
        assert!(!stack.enter(9), "full");
        assert_eq!(stack.0.len(), MAX_STACK);
    }
}
