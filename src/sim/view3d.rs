//! The 3D view: a picture of the anatomy from outside, by rays through the structures in which sound is traced.

use std::sync::Arc;

use glam::DVec3;

use super::layout::{self, Frame};
use super::shaders::Library;
use super::stages::inputs;
use super::tracer::Tracer;
use super::{SimError, Simulator};
use crate::gpu::{
    Binding, Buffer, BufferKind, Commands, Device, FrameTimings, GpuError, Image, Kernel, Stage,
};

/// Distance by which the probe's housing is wider than the face on each side, mm.
const HOUSING_RIM: f64 = 3.0;
/// Half the width of a probe whose face is a point, mm.
const POINT_FACE_HALF_WIDTH: f64 = 10.0;
/// Height of the probe's head above the middle of its face, mm.
pub const HEAD: f64 = 32.0;
/// Height of head and handle, mm.
pub const HANDLE: f64 = 105.0;

/// A view: the camera, and what is visible.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraView {
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// The eye, world, mm.
    pub eye: DVec3,
    /// Unit vector to the picture's middle, world.
    pub forward: DVec3,
    /// One pixel to the right at distance 1.
    pub right: DVec3,
    /// One pixel down at distance 1.
    pub down: DVec3,
    /// True if everything on the eye's side of the image plane is cut away.
    pub cut: bool,
    /// True if the B-mode image is shown in its place.
    pub image: bool,
    /// Colour (0..1) and opacity of each of the scene's instances; opacity 0: invisible.
    pub looks: Vec<[f32; 4]>,
}

impl CameraView {
    /// The constants for the kernel, for the probe of `frame`.
    pub fn constants(&self, frame: &Frame) -> layout::View3d {
        let vector = |v: DVec3| {
            let [x, y, z] = v.as_vec3().to_array();
            [x, y, z, 0.0]
        };
        let flag = |on: bool, flag: u32| if on { flag } else { 0 };
        let hidden = self.looks.iter().any(|look| look[3] <= 0.0);
        layout::View3d {
            eye: vector(self.eye),
            right: vector(self.right),
            down: vector(self.down),
            forward: vector(self.forward),
            width: self.size[0],
            height: self.size[1],
            flags: flag(self.cut, layout::VIEW3D_CUT)
                | flag(self.image, layout::VIEW3D_IMAGE)
                | flag(hidden, layout::VIEW3D_SOME_HIDDEN),
            unused0: 0,
            housing: housing(frame),
        }
    }
}

/// The probe's housing, mm: half its width, half its thickness, height of its head, height of head and handle.
pub fn housing(frame: &Frame) -> [f32; 4] {
    let half_width = match frame.kind {
        layout::KIND_CONVEX => {
            let half = f64::from(frame.field_of_view) / 2.0;
            f64::from(frame.radius) * half.min(std::f64::consts::FRAC_PI_2).sin()
        }
        layout::KIND_LINEAR => f64::from(frame.width) / 2.0,
        _ => POINT_FACE_HALF_WIDTH - HOUSING_RIM,
    };
    let half_thickness = f64::from(frame.face_height) / 2.0;
    [
        (half_width + HOUSING_RIM) as f32,
        (half_thickness + HOUSING_RIM) as f32,
        HEAD as f32,
        HANDLE as f32,
    ]
}

/// Kernel and buffers of the picture. Buffers grow to the largest picture so far.
pub(super) struct Viewer3d {
    kernel: Kernel,
    constants: Buffer,
    looks: Buffer,
    picture: Buffer,
}

impl Viewer3d {
    fn new(
        device: &Arc<Device>,
        library: &Library,
        tracer: Tracer,
        sight: &CameraView,
    ) -> Result<Self, GpuError> {
        let stem = format!("view3d_{}", tracer.suffix());
        let size = size_of::<layout::View3d>() as u64;
        let [looks, picture] = buffers(device, sight)?;
        Ok(Self {
            kernel: Kernel::new(device, &stem, library.words(&stem), &[])?,
            constants: device.buffer("view3d", size, BufferKind::Storage)?,
            looks,
            picture,
        })
    }

    fn holds(&self, sight: &CameraView) -> bool {
        let [looks, picture] = bytes(sight);
        self.looks.size() >= looks && self.picture.size() >= picture
    }
}

/// Bytes of looks and picture.
fn bytes(sight: &CameraView) -> [u64; 2] {
    let [width, height] = sight.size.map(u64::from);
    [16 * sight.looks.len() as u64, 4 * width * height].map(|size| size.max(16))
}

/// The buffers of looks and picture.
fn buffers(device: &Arc<Device>, sight: &CameraView) -> Result<[Buffer; 2], GpuError> {
    let [looks, picture] = bytes(sight);
    Ok([
        device.buffer("looks", looks, BufferKind::Storage)?,
        device.buffer("view3d picture", picture, BufferKind::Storage)?,
    ])
}

impl Simulator {
    /// Draws the anatomy of the last frame into `image`, RGBA of the view's size, with that frame's
    /// probe and B-mode image, and waits for it. Returns the time that it took on the device.
    ///
    /// # Errors
    /// Device out of memory; a lost device.
    ///
    /// # Panics
    /// When `looks` are not as many as the scene's instances.
    pub fn view3d(
        &mut self,
        library: &Library,
        sight: &CameraView,
        image: &Image,
    ) -> Result<FrameTimings, SimError> {
        let passes = &self.passes;
        assert_eq!(sight.looks.len(), passes.world.instances(), "looks");
        let mut viewer3d = match self.viewer3d.take() {
            Some(made) => made,
            None => Viewer3d::new(&self.device, library, passes.world.tracer(), sight)?,
        };
        if !viewer3d.holds(sight) {
            // Only buffers are made again, not the pipeline: dragging the window asks for many sizes.
            self.submissions.wait()?;
            [viewer3d.looks, viewer3d.picture] = buffers(&self.device, sight)?;
        }
        // Stored before recording, so that it is kept if the picture is abandoned.
        let viewer3d = self.viewer3d.insert(viewer3d);
        let mut cmd = self.submissions.begin()?;
        cmd.scope("view3d");
        viewer3d.record(&mut cmd, sight, passes, self.last.fused)?;
        cmd.copy_to_image(&viewer3d.picture, image)?;
        cmd.submit()?;
        self.submissions.wait()?;
        Ok(self.submissions.take_timings().pop().unwrap_or_default())
    }
}

impl Viewer3d {
    fn record(
        &self,
        cmd: &mut Commands<'_>,
        sight: &CameraView,
        passes: &super::Passes,
        fused: bool,
    ) -> Result<(), GpuError> {
        let (frame, world) = (&passes.lanes[0].buffers[&inputs::FRAME], &passes.world);
        // The constants of the last complete picture: the last frame may have been abandoned.
        let constants = sight.constants(&passes.shown);
        cmd.write(frame, 0, bytemuck::bytes_of(&passes.shown))?;
        cmd.write(&self.constants, 0, bytemuck::bytes_of(&constants))?;
        if !sight.looks.is_empty() {
            cmd.write(&self.looks, 0, bytemuck::cast_slice(&sight.looks))?;
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
        let [instances, vertices, normals, triangles, structure] = world.bindings();
        cmd.dispatch(
            &self.kernel,
            [sight.size[0], sight.size[1], 1],
            &[],
            &[
                Binding::Buffer(frame),
                instances,
                vertices,
                normals,
                triangles,
                structure,
                Binding::Buffer(&self.constants),
                Binding::Buffer(&self.looks),
                Binding::Buffer(passes.lanes[0].pixels(fused)),
                Binding::Buffer(&self.picture),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Transfer);
        Ok(())
    }
}
