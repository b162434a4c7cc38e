//! Compute kernels: a name, and a pipeline of the device's.

use std::sync::Arc;

use ash::vk;

use super::device::Device;
use super::error::GpuError;
use super::pipelines::Pipeline;
use super::reflect::BindingInfo;

/// What is behind [`Kernel`].
pub(crate) struct RawKernel {
    name: String,
    pub(crate) pipeline: Arc<Pipeline>,
    // Dropped last: it owns the pipeline's objects.
    device: Arc<Device>,
}

/// A compute kernel. Clones refer to the same pipeline.
#[derive(Clone)]
pub struct Kernel(pub(crate) Arc<RawKernel>);

impl Kernel {
    /// A kernel from a SPIR-V compute module with one entry point, whose pipeline is made on another
    /// thread. `specialization` gives constants by id, each as its 32 bits.
    ///
    /// # Errors
    /// A module that does not fit the device. An error of the driver is reported by the first dispatch.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Self, GpuError> {
        let kernel = Self::when_needed(device, name, spirv, specialization)?;
        kernel.prepare();
        Ok(kernel)
    }

    /// Like [`Self::new`], but the pipeline is not made before the first dispatch or [`Self::prepare`]:
    /// for kernels that many scenes do not need.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn when_needed(
        device: &Arc<Device>,
        name: &str,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Self, GpuError> {
        let pipeline = device.pipelines.get(device, name, spirv, specialization)?;
        Ok(Self(Arc::new(RawKernel { name: name.into(), pipeline, device: device.clone() })))
    }

    /// The same module with other constants, as by [`Self::when_needed`].
    ///
    /// # Errors
    /// Constants that the module does not have, or that do not fit the device.
    pub fn specialized(&self, specialization: &[(u32, u32)]) -> Result<Self, GpuError> {
        Self::when_needed(&self.0.device, self.name(), &self.0.pipeline.spirv, specialization)
    }

    /// Starts making the pipeline on another thread, unless that has been started.
    pub fn prepare(&self) {
        self.0.pipeline.prepare();
    }

    /// The pipeline; waits where it is being made, and makes it where nobody does.
    pub(crate) fn pipeline(&self) -> Result<vk::Pipeline, GpuError> {
        let (pipeline, device) = (&self.0.pipeline, &self.0.device);
        let waits = !pipeline.is_made();
        let _waiting = waits.then(|| device.kept.patience([pipeline.id]));
        let made = pipeline.make_once().map_err(|reason| reason.of(device, self.name()))?;
        pipeline.named.call_once(|| device.set_name(made, self.name()));
        Ok(made)
    }

    /// Returns true for a kernel that has never run on this device and driver, where that is kept: its first run waits
    /// for the driver's compiler.
    pub fn is_new(&self) -> bool {
        self.0.device.kept.is_new(self.0.pipeline.id)
    }

    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Number of threads of one work group per axis, as specialized.
    pub fn local_size(&self) -> [u32; 3] {
        self.0.pipeline.reflection.local_size
    }

    /// Bindings in the order in which a dispatch takes them: by set, then number.
    pub fn bindings(&self) -> &[BindingInfo] {
        &self.0.pipeline.reflection.bindings
    }

    /// Size of the push-constant block in bytes, 0 without one.
    pub fn push_constant_bytes(&self) -> usize {
        self.0.pipeline.reflection.push_constant_bytes as usize
    }
}

impl Kernel {
    /// Returns whether it reads the number of groups: a dispatch of a part of them would give it less.
    pub(crate) fn counts_groups(&self) -> bool {
        self.0.pipeline.reflection.counts_groups
    }
}
