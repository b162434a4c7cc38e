//! The queues of a device, and their users.

use parking_lot::{Mutex, MutexGuard};

use ash::vk;

/// User of a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum QueueUser {
    /// The simulation, and everything without a window.
    Work,
    /// The window.
    Window,
}

/// A queue by its family and its index there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct QueueIndex {
    pub(crate) family: u32,
    pub(crate) index: u32,
}

/// The queue of each user; both may be the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct QueuePlan {
    pub(crate) work: QueueIndex,
    pub(crate) window: QueueIndex,
}

impl QueuePlan {
    /// The plan without a window: one queue of a family with compute, with graphics if there is one, since
    /// every driver runs that at full speed. None where no family computes.
    pub(crate) fn alone(families: &[vk::QueueFamilyProperties]) -> Option<Self> {
        let (compute, graphics) = (vk::QueueFlags::COMPUTE, vk::QueueFlags::GRAPHICS);
        let found = find(families, |_, flags| flags.contains(compute | graphics))
            .or_else(|| find(families, |_, flags| flags.contains(compute)))?;
        Some(Self { work: found, window: found })
    }

    /// The plan with a window: it takes a family with graphics that presents to it, and the simulation a family
    /// for compute alone, so that neither waits for the other; else a second queue of the window's
    /// family; else the window's queue. None where no family can show pictures.
    pub(crate) fn with_window(
        families: &[vk::QueueFamilyProperties],
        presents: impl Fn(u32) -> bool,
    ) -> Option<Self> {
        let (compute, graphics) = (vk::QueueFlags::COMPUTE, vk::QueueFlags::GRAPHICS);
        let window =
            find(families, |family, flags| flags.contains(compute | graphics) && presents(family))?;
        let alone = find(families, |_, flags| flags.contains(compute) && !flags.contains(graphics));
        let second = QueueIndex { index: 1, ..window };
        let several = families[window.family as usize].queue_count > 1;
        let work = alone.unwrap_or(if several { second } else { window });
        Some(Self { work, window })
    }

    /// Number of queues to make, per family.
    pub(crate) fn families(&self) -> Vec<(u32, u32)> {
        match self.work.family == self.window.family {
            true => vec![(self.work.family, 1 + self.work.index.max(self.window.index))],
            false => vec![(self.work.family, 1), (self.window.family, 1)],
        }
    }
}

/// The first queue of the first family that `fits`.
fn find(
    families: &[vk::QueueFamilyProperties],
    fits: impl Fn(u32, vk::QueueFlags) -> bool,
) -> Option<QueueIndex> {
    let mut numbered = (0..).zip(families);
    let fits =
        |(i, f): &(u32, &vk::QueueFamilyProperties)| f.queue_count > 0 && fits(*i, f.queue_flags);
    let (family, _) = numbered.find(fits)?;
    Some(QueueIndex { family, index: 0 })
}

/// The queues of a plan. No ownership has to move between two families: images are shared by both, and
/// buffers belong to one user.
pub(crate) struct Queues {
    plan: QueuePlan,
    work: Mutex<vk::Queue>,
    /// The window's queue, where it is another one.
    window: Option<Mutex<vk::Queue>>,
    with_window: bool,
}

impl Queues {
    /// Takes the queues of `plan`, with which `device` was made.
    pub(crate) fn new(device: &ash::Device, plan: QueuePlan, with_window: bool) -> Self {
        // SAFETY: the device was made with these queues.
        let queue = |at: QueueIndex| unsafe { device.get_device_queue(at.family, at.index) };
        let other = plan.window != plan.work;
        Self {
            work: Mutex::new(queue(plan.work)),
            window: other.then(|| Mutex::new(queue(plan.window))),
            plan,
            with_window,
        }
    }

    /// Locks the queue of `user` against other threads.
    pub(crate) fn lock(&self, user: QueueUser) -> MutexGuard<'_, vk::Queue> {
        match (user, &self.window) {
            (QueueUser::Window, Some(window)) => window.lock(),
            _ => self.work.lock(),
        }
    }

    /// The family of a user's queue.
    pub(crate) fn family(&self, user: QueueUser) -> u32 {
        match user {
            QueueUser::Work => self.plan.work.family,
            QueueUser::Window => self.plan.window.family,
        }
    }

    /// The families that use the same images, if there are two.
    pub(crate) fn sharing(&self) -> Option<[u32; 2]> {
        let [work, window] = [QueueUser::Work, QueueUser::Window].map(|user| self.family(user));
        (work != window).then_some([work, window])
    }

    /// Returns whether the window has to wait for submissions of the simulation.
    pub(crate) fn are_shared(&self) -> bool {
        self.with_window && self.window.is_none()
    }
}

#[cfg(test)]
mod tests {
    use ash::vk;

    use super::{QueueIndex, QueuePlan};

    const GRAPHICS: vk::QueueFlags = vk::QueueFlags::GRAPHICS;
    const COMPUTE: vk::QueueFlags = vk::QueueFlags::COMPUTE;

    fn family(queue_flags: vk::QueueFlags, queue_count: u32) -> vk::QueueFamilyProperties {
        vk::QueueFamilyProperties { queue_flags, queue_count, ..Default::default() }
    }

    fn at(family: u32, index: u32) -> QueueIndex {
        QueueIndex { family, index }
    }

    #[test]
    fn the_simulation_has_a_queue_of_its_own_where_there_is_one() {
        let all = GRAPHICS | COMPUTE | vk::QueueFlags::TRANSFER;
        let plan = |families: &[_]| QueuePlan::with_window(families, |_| true).unwrap();
        let amd = [family(all, 1), family(COMPUTE, 4)];
        let made = plan(&amd);
        assert_eq!((made.work, made.window), (at(1, 0), at(0, 0)));
        assert_eq!(made.families(), [(1, 1), (0, 1)]);

        let two = plan(&[family(all, 16)]);
        assert_eq!((two.work, two.window), (at(0, 1), at(0, 0)));
        assert_eq!(two.families(), [(0, 2)]);

        let one = plan(&[family(all, 1)]);
        assert_eq!((one.work, one.window), (at(0, 0), at(0, 0)));
        assert_eq!(one.families(), [(0, 1)]);
    }

    #[test]
    fn the_window_takes_a_family_that_presents() {
        let all = GRAPHICS | COMPUTE;
        let families = [family(COMPUTE, 1), family(all, 1), family(all, 1)];
        let made = QueuePlan::with_window(&families, |family| family == 2).unwrap();
        assert_eq!((made.work, made.window), (at(0, 0), at(2, 0)));
        assert_eq!(QueuePlan::with_window(&families, |_| false), None);
        assert_eq!(QueuePlan::with_window(&families, |family| family == 0), None);
        let empty = [family(all, 0)];
        assert_eq!(QueuePlan::with_window(&empty, |_| true), None);
    }

    #[test]
    fn without_a_window_one_queue_is_taken() {
        let all = GRAPHICS | COMPUTE;
        let alone = |families: &[_]| QueuePlan::alone(families).map(|plan| plan.families());
        assert_eq!(alone(&[family(COMPUTE, 4), family(all, 2)]), Some(vec![(1, 1)]));
        assert_eq!(alone(&[family(COMPUTE, 4)]), Some(vec![(0, 1)]));
        assert_eq!(alone(&[family(GRAPHICS, 4)]), None);
    }
}
