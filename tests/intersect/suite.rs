//! Uses of the device by this suite only: moving instances, planted errors.

use insonify::gpu::{Binding, Buffer, BufferKind, test_device};
use insonify::scene::Scene;
use insonify::sim::bvh::Splits;
use insonify::sim::tracer::Tracer;

use super::device::Rig;

impl Rig {
    pub fn new(scene: &Scene, tracer: Tracer) -> Self {
        Self::on(&test_device(), scene, tracer)
    }

    /// The compute tracer with trees built by `splits`.
    pub fn split(scene: &Scene, splits: Splits) -> Self {
        Self::with_splits(&test_device(), scene, Tracer::Bvh, splits)
    }

    /// No validation message so far.
    pub fn assert_silent(&self) {
        let messages = self.device.validation_messages();
        assert!(messages.is_empty(), "{messages:#?}");
    }

    /// Exchanges the planes of one child of the first mesh's root along x.
    pub fn swap_a_bound(&mut self) {
        let Binding::Buffer(nodes) = self.world.structure() else { panic!("not this tracer") };
        let mut bytes = self.device.read_back(nodes).unwrap();
        let root = 80 * self.world.rows()[0].bvh_root as usize;
        // After corner, exponents, links and kinds: eight lower planes, eight upper planes.
        let child = (0..8).find(|i| bytes[root + 24 + i] != 0).expect("a root has children");
        bytes.swap(root + 32 + child, root + 40 + child);
        self.spoil(4, &bytes);
    }

    /// Makes one triangle a point.
    pub fn drop_a_triangle(&mut self) {
        let mut indices: Vec<u32> = self.device.read_back_as(self.world.triangles()).unwrap();
        indices[301] = indices[300];
        indices[302] = indices[300];
        self.spoil(3, bytemuck::cast_slice(&indices));
    }

    fn spoil(&mut self, slot: usize, bytes: &[u8]) {
        let buffer = self.storage("spoilt", bytes);
        self.replaced.push((slot, buffer));
    }

    /// A buffer for kernels with this content.
    pub fn storage(&self, name: &str, bytes: &[u8]) -> Buffer {
        let size = bytes.len() as u64;
        let buffer = self.device.buffer(name, size, BufferKind::Storage).unwrap();
        self.device.upload(&buffer, bytes).unwrap();
        buffer
    }
}
