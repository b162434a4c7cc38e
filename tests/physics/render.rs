//! Frames by the f64 twins, brute force from rays to pixels, and by the device with either tracer.

use std::cell::Cell;
use std::ops::Deref;
use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;
use insonify::gpu;
use insonify::scene::Scene;
use insonify::sim::contact::{self, Coupling, Skins};
use insonify::sim::push::Scatter;
use insonify::sim::{Simulator, Tracer, layout, placement, shaders::Library, tables};
use insonify_tools::reference::{Accumulator, Owned, Segment};
use insonify_tools::reference::{axial, beam, detect, display, scatter};

use crate::physics::check::{Memo, Picture};

/// A scene in the form that the kernels read.
pub struct Inputs(Owned);

impl Inputs {
    /// Inputs for rigidly placed meshes only: their texture rests in object space.
    pub fn new(scene: &Scene) -> Self {
        let mut inputs = Owned {
            frame: tables::frame(scene, 0),
            rows: tables::rows(scene),
            tissues: tables::tissues(scene),
            surfaces: tables::surfaces(scene),
            points: tables::points(scene),
            ..Owned::default()
        };
        for (i, placed) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[placed.mesh];
            let object_from_world = placement::matrix_rows(&placed.world_from_object.inverse());
            let instance = layout::Instance {
                world_from_object: placement::matrix_rows(&placed.world_from_object),
                object_from_world,
                texture_from_world: object_from_world,
                tissue: placed.tissue as u32,
                priority: placed.priority,
                surface_outside: 2 * i as u32,
                surface_inside: 2 * i as u32 + 1,
                field: layout::NONE,
                ..layout::Instance::default()
            };
            inputs.place(&mesh.positions, &mesh.normals, &mesh.triangles, instance);
        }
        inputs.converge();
        Self(inputs)
    }
}

impl Deref for Inputs {
    type Target = Owned;

    fn deref(&self) -> &Owned {
        &self.0
    }
}

/// Stages of a frame.
pub struct Frame {
    /// Complex baseband after the axial kernel, per scanline.
    pub iq: Vec<Vec<[f64; 2]>>,
    /// Displayed level 0..=1, per scanline.
    pub levels: Vec<Vec<f64>>,
    /// Pixels row by row, 0 outside the sector.
    pub pixels: Vec<u32>,
}

impl Frame {
    /// Magnitude of the baseband along scanline `l`.
    pub fn envelope(&self, l: usize) -> Vec<f64> {
        self.iq[l].iter().map(|v| v[0].hypot(v[1])).collect()
    }

    /// Its pixels, at the image height of `scene`; white outside the sector.
    pub fn picture(&self, title: impl Into<String>, scene: &Scene) -> Picture {
        let grey = |&p: &u32| if p >> 24 == 0 { 255 } else { (p & 0xff) as u8 };
        Picture {
            title: title.into(),
            width: self.pixels.len() as u32 / scene.imaging.image_height,
            grey: self.pixels.iter().map(grey).collect(),
        }
    }
}

/// The sums in the device's 32-bit buffers.
fn narrow(a: &Accumulator) -> Vec<i32> {
    assert_eq!(a.saturated, 0, "echoes fit the fixed point");
    let fit = |&v: &i64| i32::try_from(v).expect("sums fit the fixed point");
    a.fixed.iter().map(fit).collect()
}

/// The frame of `scene`.
pub fn twin(scene: &Scene) -> Frame {
    twin_of(scene, |_| ())
}

/// The frame of `scene` if its segments are changed behind the trace.
pub fn twin_of(scene: &Scene, change: impl Fn(&mut Segment)) -> Frame {
    let inputs = Inputs::new(scene);
    let world = inputs.world();
    let traced = inputs.traced();
    let mut segments: Vec<Segment> = traced.segments.concat();
    segments.iter_mut().for_each(change);
    let volume = scatter::scatter(&world, &segments, Scatter::IMAGE);
    let points = scatter::points(&world, &segments);
    let single = |v: Vec<f64>| v.iter().map(|&x| x as f32).collect::<Vec<f32>>();
    let (frame, rows) = (&inputs.frame, &inputs.rows);
    let coupling = Coupling::of(scene, &mut Skins::default());
    let lateral = single(beam::beam(
        frame,
        rows,
        [&narrow(&traced.surface), &narrow(&volume), &narrow(&points)],
        &contact::table(scene, coupling.as_ref()),
    ));
    let iq = axial::axial(frame, &lateral);
    let levels = detect::detect(frame, rows, &single(iq.clone()));
    let samples = frame.samples as usize;
    let grey = tables::grey_map(&scene.imaging);
    Frame {
        iq: iq.chunks(2 * samples).map(|l| l.chunks(2).map(|v| [v[0], v[1]]).collect()).collect(),
        pixels: display::display(frame, &single(levels.clone()), &grey),
        levels: levels.chunks(samples).map(<[f64]>::to_vec).collect(),
    }
}

/// A renderer of frames, with its name.
pub type Renderer = (&'static str, Box<dyn Fn(&Scene) -> Rc<Frame>>);

/// Most samples of the frames that one renderer keeps: 200 MB.
const KEPT: usize = 1 << 23;

/// The twins, and the device with each of the tracers. The first frames of each are kept for when they are asked for again.
pub fn renderers(device: &Arc<gpu::Device>, tracers: &[Tracer], memo: &Memo) -> Vec<Renderer> {
    let kept = |name: &'static str, make: Box<dyn Fn(&Scene) -> Frame>| -> Renderer {
        let (memo, room) = (memo.clone(), Cell::new(KEPT));
        let frame = move |scene: &Scene| {
            let samples = (scene.probe.scanlines * scene.probe.samples) as usize;
            let fits = samples <= room.get();
            memo.once(&(name, scene), fits, || {
                room.update(|left| if fits { left - samples } else { left });
                make(scene)
            })
        };
        (name, Box::new(frame))
    };
    let mut all = vec![kept("twins", Box::new(twin))];
    for &tracer in tracers {
        let device = device.clone();
        let name = if tracer == Tracer::Bvh { "bvh" } else { "query" };
        all.push(kept(name, Box::new(move |s| on(&device, s, tracer))));
    }
    all
}

/// The frame of `scene` by the device. Nothing may be lost on the way, and validation is silent.
fn on(device: &Arc<gpu::Device>, scene: &Scene, tracer: Tracer) -> Frame {
    let mut simulator = Simulator::new(device, &Library::embedded(), scene, tracer)
        .unwrap_or_else(|e| panic!("{tracer}: {e}"));
    let mut read = || {
        simulator.frame(scene, 0)?;
        let counters = simulator.counters()?;
        assert_eq!(
            [counters.saturated, counters.segments_dropped, counters.stack_overflow],
            [0; 3],
            "{tracer}: saturated, dropped, overflown"
        );
        Ok::<_, insonify::sim::SimError>((
            simulator.iq()?,
            simulator.log_image()?,
            simulator.pixels()?.2,
        ))
    };
    let (iq, levels, pixels) = read().unwrap_or_else(|e| panic!("{tracer}: {e}"));
    drop(simulator);
    assert_eq!(device.validation_messages(), Vec::<String>::new());
    let samples = scene.probe.samples as usize;
    let wide = |v: &[f32]| v.iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
    Frame {
        iq: iq
            .chunks(2 * samples)
            .map(|l| wide(l).chunks(2).map(|v| [v[0], v[1]]).collect())
            .collect(),
        levels: levels.chunks(samples).map(wide).collect(),
        pixels: bytemuck::pod_collect_to_vec(&pixels),
    }
}

/// Angle of a direction in the image plane from the depth axis, rad.
pub fn angle(d: DVec3) -> f64 {
    d.x.atan2(d.z)
}
