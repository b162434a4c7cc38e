//! Stages, the global barriers between them, and a check that none is missing.
//!
//! The validation layers (1.3.239) see a read after a write and a write after a read, but neither a
//! dispatch that overwrites the output of an earlier dispatch nor a trace of an acceleration structure still
//! being built. A software driver runs one after the other, so its result is right all the same. The check
//! below finds both from the bindings alone. A buffer that a kernel only reads must be declared
//! `readonly`, else two such kernels count as writers.

use std::collections::HashMap;

use ash::vk;

/// Stages of the pipeline, and the accesses there.
pub(crate) type Masks = (vk::PipelineStageFlags, vk::AccessFlags);

/// All work on the device but the window's. Masks of several [`Stage`]s must not be united: a barrier's accesses are
/// meant at each of its stages, and those of builds at dispatches are refused where ray queries are off
/// (VUID-vkCmdPipelineBarrier-srcAccessMask-06257). These two accesses stand for all that each stage may do.
pub(crate) fn all_work(accel: bool) -> Masks {
    let mut stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    if accel {
        stages |= vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
    }
    (stages, vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)
}

/// A kind of work on the device, for [`super::Commands::barrier`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Dispatches.
    Compute,
    /// Fills, copies, uploads.
    Transfer,
    /// Builds and copies of acceleration structures.
    Build,
    /// The CPU, reading what a finished submission left in a readback buffer.
    Host,
}

impl Stage {
    const fn bit(self) -> u8 {
        1 << self as u8
    }

    /// Stage and access masks; `accel` and `ray_query` are true where the device has enabled them, since
    /// Vulkan refuses flags of features that are off.
    pub(crate) fn masks(self, accel: bool, ray_query: bool) -> Masks {
        use vk::{AccessFlags as Access, PipelineStageFlags as Pipeline};
        match self {
            Self::Compute => {
                let memory = Access::SHADER_READ | Access::SHADER_WRITE | Access::UNIFORM_READ;
                let trace = if ray_query {
                    Access::ACCELERATION_STRUCTURE_READ_KHR
                } else {
                    Access::empty()
                };
                (Pipeline::COMPUTE_SHADER, memory | trace)
            }
            Self::Transfer => (Pipeline::TRANSFER, Access::TRANSFER_READ | Access::TRANSFER_WRITE),
            Self::Build if accel => (
                Pipeline::ACCELERATION_STRUCTURE_BUILD_KHR,
                // Vertices and instances are read as SHADER_READ, scratch and structures as
                // the other two.
                Access::SHADER_READ
                    | Access::ACCELERATION_STRUCTURE_READ_KHR
                    | Access::ACCELERATION_STRUCTURE_WRITE_KHR,
            ),
            // Nothing can have been built: there is nothing to wait for.
            Self::Build => (Pipeline::TOP_OF_PIPE, Access::empty()),
            Self::Host => (Pipeline::HOST, Access::HOST_READ | Access::HOST_WRITE),
        }
    }
}

/// An access since the last barrier that covers everything.
struct Access {
    stage: Stage,
    write: bool,
    by: String,
    /// Stages that wait for this access, as bits.
    seen_by: u8,
}

/// Accesses of one command buffer, by Vulkan handle of the buffer, image or structure.
#[derive(Default)]
pub(crate) struct HazardCheck {
    accesses: HashMap<u64, Vec<Access>>,
}

impl HazardCheck {
    /// Notes an access; returns a message where an earlier one is not waited for.
    pub(crate) fn access(
        &mut self,
        resource: u64,
        name: &str,
        stage: Stage,
        write: bool,
        by: &str,
    ) -> Option<String> {
        let earlier = self.accesses.entry(resource).or_default();
        let hazard = earlier
            .iter()
            .find(|a| {
                // The layers compare copies byte by byte, which this check cannot.
                let copies = a.stage == Stage::Transfer && stage == Stage::Transfer;
                (write || a.write) && a.seen_by & stage.bit() == 0 && !copies
            })
            .map(|a| {
                format!(
                    "HAZARD: '{by}' {} '{name}' that '{}' {}, and no barrier {:?} -> {stage:?} lies between",
                    if write { "writes" } else { "reads" },
                    a.by,
                    if a.write { "writes" } else { "reads" },
                    a.stage,
                )
            });
        earlier.push(Access { stage, write, by: by.to_owned(), seen_by: 0 });
        hazard
    }

    /// Notes a barrier; it also covers everything that `from` itself waits for.
    pub(crate) fn barrier(&mut self, from: Stage, to: Stage) {
        for access in self.accesses.values_mut().flatten() {
            if access.stage == from || access.seen_by & from.bit() != 0 {
                access.seen_by |= to.bit();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use ash::vk;

    use super::{HazardCheck, Stage, all_work};

    /// The rule of newer layers, held also where the installed ones do not check it: structures are read by shaders only where ray
    /// queries are on, and no stage or access of builds is named where structures are off.
    #[test]
    fn masks_are_of_features_that_are_on() {
        use vk::{AccessFlags as Access, PipelineStageFlags as Pipeline};
        let structures =
            Access::ACCELERATION_STRUCTURE_READ_KHR | Access::ACCELERATION_STRUCTURE_WRITE_KHR;
        let all = [Stage::Compute, Stage::Transfer, Stage::Build, Stage::Host];
        for (accel, ray_query) in [(false, false), (true, false), (true, true)] {
            let single = all.map(|stage| stage.masks(accel, ray_query));
            for (stages, access) in single.into_iter().chain([all_work(accel)]) {
                assert!(accel || !stages.contains(Pipeline::ACCELERATION_STRUCTURE_BUILD_KHR));
                assert!(accel || !access.intersects(structures));
                let shader = stages.contains(Pipeline::COMPUTE_SHADER);
                assert!(ray_query || !shader || !access.intersects(structures), "{stages:?}");
            }
        }
    }

    #[test]
    fn dispatches_need_a_barrier_when_one_of_them_writes() {
        let mut check = HazardCheck::default();
        let mut access = |stage, write| check.access(1, "b", stage, write, "k").is_some();
        assert!(!access(Stage::Compute, false));
        assert!(!access(Stage::Compute, false), "two readers may overlap");
        assert!(access(Stage::Compute, true), "write after read");
        assert!(access(Stage::Compute, false), "read after write");
    }

    #[test]
    fn a_barrier_covers_its_two_stages_and_what_it_carries_on() {
        let mut check = HazardCheck::default();
        assert!(check.access(1, "b", Stage::Transfer, true, "fill").is_none());
        check.barrier(Stage::Compute, Stage::Compute);
        check.barrier(Stage::Transfer, Stage::Compute);
        assert!(check.access(1, "b", Stage::Compute, true, "k").is_none());
        check.barrier(Stage::Compute, Stage::Build);
        assert!(check.access(1, "b", Stage::Build, false, "build").is_none());
        let message = check.access(1, "b", Stage::Transfer, true, "fill");
        assert!(message.is_some_and(|m| m.contains("'b'") && m.contains("Compute -> Transfer")));
        assert!(check.access(2, "other", Stage::Transfer, true, "fill").is_none());
    }
}
