//! The kernels of the passes, each in the variant that suits the tracer and the tissue.

use std::cmp::Reverse;
use std::sync::Arc;

use super::pass::{Pass, Variants};
use super::shaders::Library;
use super::world::{TissueMotion, World};
use crate::gpu::{Device, GpuError, Kernel};
use crate::scene::Scene;

/// The kernels of the passes that frames of a scene may run.
pub(super) struct PassKernels(Vec<PassKernel>);

struct PassKernel {
    pass: &'static Pass,
    kernel: Kernel,
    /// The variants for deforming and for flowing tissue, where there are some: a mesh that a program reshapes begins to deform.
    others: Option<[Kernel; 2]>,
    /// True if the frames that the scene began with run it.
    needed: bool,
}

impl PassKernel {
    fn of(&self, tissue: TissueMotion) -> &Kernel {
        match (&self.others, tissue) {
            (Some([deforming, _]), TissueMotion::Deforming) => deforming,
            (Some([_, flowing]), TissueMotion::Flowing) => flowing,
            (None, _) | (_, TissueMotion::Rigid) => &self.kernel,
        }
    }
}

impl PassKernels {
    /// The kernels of `passes`, for frames of `scene`.
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        passes: impl Iterator<Item = &'static Pass>,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let passes = passes.map(|pass| (pass, (pass.needed)(scene)));
        Self::of_passes(device, library, passes, world, counting)
    }

    /// The same kernels from another library, in the variants that count steps if `counting`.
    pub(super) fn again(
        &self,
        device: &Arc<Device>,
        library: &Library,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let passes = self.0.iter().map(|made| (made.pass, made.needed));
        Self::of_passes(device, library, passes, world, counting)
    }

    fn of_passes(
        device: &Arc<Device>,
        library: &Library,
        passes: impl Iterator<Item = (&'static Pass, bool)>,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let mut kernels = Vec::new();
        for (pass, needed) in passes {
            let tracer = world.tracer().suffix();
            let suffix = match pass.variants {
                Variants::One => None,
                Variants::Counting if counting => Some("count"),
                Variants::Tracer | Variants::Counting => Some(tracer),
                Variants::Tissue => Some("rigid"),
            };
            let kernel = |suffix: Option<&str>| {
                let stem =
                    suffix.map_or(pass.name.into(), |suffix| format!("{}_{suffix}", pass.name));
                Kernel::when_needed(device, &stem, library.words(&stem), pass.constants)
            };
            let others = match pass.variants {
                Variants::Tissue => Some([kernel(Some("deforming"))?, kernel(Some("flowing"))?]),
                _ => None,
            };
            kernels.push(PassKernel { pass, kernel: kernel(suffix)?, others, needed });
        }
        let tissue = world.tissue();
        // The kernels that take longest to compile begin first.
        let due = kernels.iter().filter(|made| made.needed);
        let mut due: Vec<_> = due.map(|made| made.of(tissue)).collect();
        due.sort_by_key(|kernel| Reverse(library.words(kernel.name()).len()));
        due.iter().for_each(|kernel| kernel.prepare());
        Ok(Self(kernels))
    }

    /// The kernel of a pass, for a world with such tissue.
    pub(super) fn of(&self, pass: &Pass, tissue: TissueMotion) -> &Kernel {
        let is = |made: &&PassKernel| {
            made.pass.name == pass.name && made.pass.constants == pass.constants
        };
        self.0.iter().find(is).expect("a pass of the scene").of(tissue)
    }
}
