//! Drawing of the interface: egui's primitives through egui-ash-renderer.

use std::collections::HashMap;
use std::sync::Arc;

use ash::vk;
use egui::epaint::{ImageData, ImageDelta};
use egui_ash_renderer::allocator::DefaultAllocator;
use egui_ash_renderer::{Options, RenderMode, Renderer, RendererError};

use super::commands::Commands;
use super::device::Device;
use super::error::{GpuError, during};
use super::frames::FRAMES_IN_FLIGHT;
use super::queues::QueueUser;

/// Textures and buffers of the interface.
pub(crate) struct Overlay {
    /// `None` only while it is dropped.
    renderer: Option<Renderer<DefaultAllocator>>,
    /// All texels of each texture: the renderer's own updates of a part discard the rest (from the layout
    /// UNDEFINED), so it always gets the whole texture.
    textures: HashMap<egui::TextureId, egui::ColorImage>,
    /// Textures that the frames under way may still show, oldest first.
    leaving: Vec<Vec<egui::TextureId>>,
    pool: vk::CommandPool,
    device: Arc<Device>,
}

/// Render pass, framebuffer and size to draw on.
pub(crate) type DrawTarget = (vk::RenderPass, vk::Framebuffer, vk::Extent2D);

impl Overlay {
    pub(crate) fn new(device: &Arc<Device>, pass: vk::RenderPass) -> Result<Self, GpuError> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queues.family(QueueUser::Window))
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the family is the device's own; `Drop` destroys the pool.
        let pool = unsafe { device.raw.create_command_pool(&info, None) }
            .map_err(during("making the interface's command pool"))?;
        let mut made = Self {
            renderer: None,
            textures: HashMap::new(),
            leaving: Vec::new(),
            pool,
            device: device.clone(),
        };
        let renderer = Renderer::with_default_allocator(
            &device.instance.raw,
            device.physical,
            device.raw.clone(),
            RenderMode::RenderPass(pass),
            Options { in_flight_frames: FRAMES_IN_FLIGHT, ..Options::default() },
        );
        made.renderer = Some(renderer.map_err(failed("making the interface's pipeline"))?);
        Ok(made)
    }

    /// Takes over changed textures. The frame before the last must have been waited for.
    pub(crate) fn update(&mut self, mut delta: egui::TexturesDelta) -> Result<(), GpuError> {
        let renderer = self.renderer.as_mut().expect("not being dropped");
        for (id, changes) in delta.set.drain() {
            for change in changes {
                patch(&mut self.textures, id, change);
            }
            let all = ImageDelta::full(self.textures[&id].clone(), egui::TextureOptions::LINEAR);
            let queue = self.device.queues.lock(QueueUser::Window);
            renderer
                .set_texture(*queue, self.pool, id, &all)
                .map_err(failed("uploading a texture of the interface"))?;
        }
        self.leaving.push(delta.free.drain().collect());
        if self.leaving.len() > FRAMES_IN_FLIGHT {
            for id in self.leaving.remove(0) {
                self.textures.remove(&id);
                renderer.free_texture(id).map_err(failed("dropping a texture of the interface"))?;
            }
        }
        Ok(())
    }

    /// Records the primitives into `commands`.
    pub(crate) fn draw(
        &mut self,
        commands: &Commands<'_>,
        (pass, framebuffer, extent): DrawTarget,
        primitives: &[egui::ClippedPrimitive],
        pixels_per_point: f32,
    ) -> Result<(), GpuError> {
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(pass)
            .framebuffer(framebuffer)
            .render_area(extent.into());
        let (raw, buffer) = (&self.device.raw, commands.raw());
        // SAFETY: pass and framebuffer belong together; the commands are being recorded.
        unsafe { raw.cmd_begin_render_pass(buffer, &begin, vk::SubpassContents::INLINE) };
        let renderer = self.renderer.as_mut().expect("not being dropped");
        let drawn = renderer.cmd_draw(buffer, extent, pixels_per_point, primitives);
        // SAFETY: the pass was begun.
        unsafe { raw.cmd_end_render_pass(buffer) };
        drawn.map_err(failed("drawing the interface"))
    }
}

impl Drop for Overlay {
    fn drop(&mut self) {
        // Its objects belong to the device, which outlives it.
        self.renderer = None;
        // SAFETY: the painter has waited for the queue; the pool's buffers are done with.
        unsafe { self.device.raw.destroy_command_pool(self.pool, None) };
    }
}

/// Puts a change into its texture.
fn patch(
    textures: &mut HashMap<egui::TextureId, egui::ColorImage>,
    id: egui::TextureId,
    change: ImageDelta,
) {
    let ImageData::Color(part) = change.image;
    let Some([left, top]) = change.pos else {
        textures.insert(id, Arc::unwrap_or_clone(part));
        return;
    };
    let whole = textures.get_mut(&id).expect("egui sends the whole texture before its parts");
    let ([width, height], stride) = (part.size, whole.size[0]);
    for row in 0..height {
        let to = (top + row) * stride + left;
        whole.pixels[to..to + width].copy_from_slice(&part.pixels[row * width..][..width]);
    }
}

fn failed(what: &'static str) -> impl Fn(RendererError) -> GpuError {
    move |error| match error {
        RendererError::Vulkan(code) => super::swapchain::lost_or(what)(code),
        other => GpuError::Allocation {
            name: "the interface".into(),
            bytes: 0,
            reason: other.to_string(),
        },
    }
}
