//! Kernels compiled ahead, several at once, for a driver that compiles only when a kernel first runs.
//!
//! llvmpipe has one queue, which compiles kernel after kernel, each when it is first dispatched. A dispatch
//! of no groups compiles as well, on any device, and Mesa keeps the result in its folder. So each new kernel
//! is dispatched on a device of its own, beside others, and the device that asked finds it in the folder.
//!
//! Where the program can be started as a compiler ([`super::prepare_process`]), that device is in a process of its
//! own: LLVM meets code that it cannot translate by ending the process, which then is not the user's, and an error says
//! the kernel and the remedy. Drivers of GPUs compile in `vkCreateComputePipelines` and need not keep what they compile:
//! there a process of its own would double the wait, so they compile in this one.

use std::ffi::OsString;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::blas::{Blas, BlasInput, BlasOptions};
use super::commands::{Binding, Commands};
use super::device::{Device, DeviceOptions};
use super::error::GpuError;
use super::image::{AddressMode, Filter, Image, ImageDim, ImageFormat, Sampler};
use super::kernel::Kernel;
use super::memory::{Buffer, BufferKind};
use super::reflect::{BindingInfo, BindingKind};
use super::tlas::{Tlas, TlasInstance};
use super::{Stage, kept, process};

/// The argument with which a program of ours is started as a compiler.
pub(super) const COMPILE: &str = "--compile-kernel";

/// The first line of a compiler's output: who else is started, an older or newer program say, does not write it.
const GREETING: &str = "insonify compiles a kernel\n";

/// The program, and its arguments, that compiles a [`Job`] given on its standard input.
static COMPILER: OnceLock<(PathBuf, Vec<OsString>)> = OnceLock::new();

/// Names the program that compiles kernels in a process of its own: with these arguments it calls
/// [`compile_standard_input`]. Only the first call counts.
pub fn set_compiler(program: PathBuf, arguments: Vec<OsString>) {
    let _ = COMPILER.set((program, arguments));
}

/// Returns whether kernels are compiled in a process of their own.
pub(super) fn has_compiler() -> bool {
    COMPILER.get().is_some()
}

/// A kernel to be compiled for a device.
#[derive(Serialize, Deserialize)]
pub(super) struct KernelJob {
    /// Name of the device.
    pub(super) device: String,
    /// Name of the kernel.
    pub(super) kernel: String,
    pub(super) spirv: Vec<u32>,
    pub(super) specialization: Vec<(u32, u32)>,
}

/// Work that a driver may not survive.
#[derive(Serialize, Deserialize)]
enum Job {
    Kernel(KernelJob),
    /// Acceleration structures to be built, on the device of this name.
    Structures(String),
}

/// Longest time for building two small structures, on a machine however busy: faults of memory may also end in a loop.
const PATIENCE: Duration = Duration::from_secs(120);

/// End of a driver's compiler.
#[derive(Clone, Debug)]
pub(crate) struct Died {
    /// The way in which the process ended: "signal: 6 (SIGABRT)".
    pub(crate) status: ExitStatus,
    /// Its last words; may be empty.
    pub(crate) words: String,
}

impl Died {
    /// The error of a device on a piece of work, such as "on the kernel 'beam'".
    pub(crate) fn of(&self, device: &Device, work: &str) -> GpuError {
        let [width, _] = kept::MESA_VARIABLES.map(|name| std::env::var(name).ok());
        GpuError::Driver {
            device: device.name().into(),
            work: work.into(),
            status: self.status,
            words: if self.words.is_empty() { String::new() } else { format!(": {}", self.words) },
            width: width.unwrap_or("the processor's".into()),
        }
    }
}

/// Compiles a kernel, in a process of its own where there is a program for that. An error of Vulkan occurs again, and is
/// reported, where the kernel is needed.
pub(super) fn compile(job: KernelJob) -> Result<(), Died> {
    let job = Job::Kernel(job);
    match COMPILER.get().and_then(|compiler| apart(compiler, &job)) {
        Some(compiled) => compiled.map(|_| ()),
        None => {
            let _ = job.run();
            Ok(())
        }
    }
}

/// Builds small acceleration structures on a device of this name, in a process of its own where there is a program for
/// that: Mesa 26.2 writes outside its memory there, for vectors of four. Where there is no such program, nothing is tried.
pub(super) fn build_structures(device: &str) -> Result<(), Died> {
    let job = Job::Structures(device.into());
    COMPILER.get().and_then(|compiler| apart(compiler, &job)).unwrap_or(Ok(true)).map(|_| ())
}

/// Compiles a kernel in a process of its own. Returns whether the driver took it.
///
/// # Errors
/// The driver's compiler ended its process.
///
/// # Panics
/// When this program cannot be started as a compiler ([`super::prepare_process`]).
pub fn try_kernel(
    device: &Device,
    name: &str,
    spirv: &[u32],
    specialization: &[(u32, u32)],
) -> Result<bool, GpuError> {
    let compiler = COMPILER.get().expect("prepare_process was called");
    let job = KernelJob {
        device: device.name().into(),
        kernel: name.into(),
        spirv: spirv.into(),
        specialization: specialization.into(),
    };
    let compiled = apart(compiler, &Job::Kernel(job)).expect("this program is a compiler");
    compiled.map_err(|died| died.of(device, &format!("on the kernel '{name}'")))
}

/// Does a job in a process of its own. Returns whether Vulkan did it; `None` where the program cannot be started so.
fn apart(compiler: &(PathBuf, Vec<OsString>), job: &Job) -> Option<Result<bool, Died>> {
    let mut command = Command::new(&compiler.0);
    command.args(&compiler.1).env_remove("INSONIFY_VALIDATE");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    process::not_interrupted(&mut command);
    let mut child = command.spawn().ok()?;
    let text = serde_json::to_vec(job).ok()?;
    // A program that does not read is told by its greeting.
    let _ = child.stdin.take()?.write_all(&text);
    // How long a kernel takes to compile nobody knows.
    if matches!(job, Job::Structures(_)) {
        let end = Instant::now() + PATIENCE;
        while child.try_wait().ok()?.is_none() {
            if Instant::now() > end {
                let _ = child.kill();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    let out = child.wait_with_output().ok()?;
    if !out.stdout.starts_with(GREETING.as_bytes()) {
        return None;
    }
    // 1: an error of Vulkan.
    if let Some(code @ (0 | 1)) = out.status.code() {
        return Some(Ok(code == 0));
    }
    let words = String::from_utf8_lossy(&out.stderr);
    let words = words.lines().find(|line| line.contains("ERROR")).or(words.lines().last());
    Some(Err(Died { status: out.status, words: words.unwrap_or_default().trim().to_owned() }))
}

/// Does the job that standard input describes, which another process of this program has started it for: a kernel is
/// compiled, and the driver keeps the result. Returns the exit code.
pub fn compile_standard_input() -> u8 {
    process::without_core_file();
    let mut out = std::io::stdout();
    let greeted = out.write_all(GREETING.as_bytes()).and_then(|()| out.flush());
    let mut text = Vec::new();
    let read = greeted.and_then(|()| std::io::stdin().read_to_end(&mut text));
    let job = read.ok().and_then(|_| serde_json::from_slice::<Job>(&text).ok());
    let done = job.is_some_and(|job| job.run().is_ok());
    u8::from(!done)
}

impl Job {
    /// Does it in this process.
    fn run(&self) -> Result<(), GpuError> {
        let open = |name: &String| {
            Device::for_compiling(&DeviceOptions {
                selector: Some(name.clone()),
                ..Default::default()
            })
        };
        match self {
            Self::Kernel(job) => {
                let device = open(&job.device)?;
                let kernel =
                    Kernel::when_needed(&device, &job.kernel, &job.spirv, &job.specialization)?;
                dispatch_nothing(&device, &kernel)
            }
            Self::Structures(name) => build_two(&open(name)?),
        }
    }
}

/// Builds a mesh of some triangles, and a scene of it.
fn build_two(device: &Arc<Device>) -> Result<(), GpuError> {
    let positions: Vec<[f32; 3]> =
        (0..96).map(|i| [(i % 7) as f32, (i % 11) as f32, (i % 13) as f32]).collect();
    let triangles: Vec<[u32; 3]> = (0..32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let input = BlasInput { name: "trial", positions: &positions, triangles: &triangles };
    let blas = Blas::build_many(device, &[input], BlasOptions::default())?.remove(0);
    let mut tlas = Tlas::new(device, "trial", 1)?;
    let transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let instance = TlasInstance { blas: &blas, transform, custom_index: 0, mask: 1 };
    device.once(|commands| tlas.build(commands, &[instance]))
}

/// An object that a kernel can bind, as small as possible: nobody reads it.
enum Nothing {
    Buffer(Buffer),
    Image(Image),
    Sampled(Image, Sampler),
    Sampler(Sampler),
    Tlas(Box<Tlas>),
}

impl Nothing {
    fn new(
        device: &Arc<Device>,
        commands: &mut Commands<'_>,
        binding: &BindingInfo,
    ) -> Result<Self, GpuError> {
        let image = || {
            let dim = if binding.image_dimensions == 3 { ImageDim::D3 } else { ImageDim::D2 };
            Image::new(device, "nothing", dim, [1; 3], ImageFormat::R32Float)
        };
        let sampler = || Sampler::new(device, "nothing", Filter::Nearest, AddressMode::ClampToEdge);
        Ok(match binding.kind {
            BindingKind::StorageBuffer | BindingKind::UniformBuffer => {
                Self::Buffer(device.buffer("nothing", 4, BufferKind::Storage)?)
            }
            BindingKind::StorageImage | BindingKind::SampledImage => Self::Image(image()?),
            BindingKind::ImageAndSampler => Self::Sampled(image()?, sampler()?),
            BindingKind::Sampler => Self::Sampler(sampler()?),
            BindingKind::AccelerationStructure => {
                let mut tlas = Tlas::new(device, "nothing", 1)?;
                tlas.build(commands, &[])?;
                commands.barrier(Stage::Build, Stage::Compute);
                Self::Tlas(Box::new(tlas))
            }
        })
    }

    fn binding(&self) -> Binding<'_> {
        match self {
            Self::Buffer(buffer) => Binding::Buffer(buffer),
            Self::Image(image) => Binding::Image(image),
            Self::Sampled(image, sampler) => Binding::Sampled(image, sampler),
            Self::Sampler(sampler) => Binding::Sampler(sampler),
            Self::Tlas(tlas) => Binding::Tlas(tlas),
        }
    }
}

/// Makes the device compile a kernel.
fn dispatch_nothing(device: &Arc<Device>, kernel: &Kernel) -> Result<(), GpuError> {
    let push = vec![0; kernel.push_constant_bytes()];
    device.once(|commands| {
        let made = kernel.bindings().iter().map(|b| Nothing::new(device, commands, b));
        let made = made.collect::<Result<Vec<_>, _>>()?;
        let bindings: Vec<_> = made.iter().map(Nothing::binding).collect();
        commands.dispatch_groups(kernel, [0; 3], &push, &bindings)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lone_test_device;

    #[test]
    fn a_kernel_is_dispatched_with_nothing_to_do() {
        let words = |bytes: &[u8]| -> Vec<u32> { bytemuck::pod_collect_to_vec(bytes) };
        let add = words(include_bytes!("../../tests/gpu/add.spv"));
        let sample = words(include_bytes!("../../tests/gpu/sample.spv"));
        let nearest = words(include_bytes!("../../tests/gpu/nearest.spv"));
        let device = lone_test_device();
        for spirv in [&add, &sample, &nearest] {
            let kernel = Kernel::when_needed(&device, "it", spirv, &[]);
            // The last one needs ray queries.
            let Ok(kernel) = kernel else { continue };
            dispatch_nothing(&device, &kernel).unwrap();
        }
        assert_eq!(device.validation_messages(), [""; 0]);
        let job = |device: &str, constant| {
            Job::Kernel(KernelJob {
                device: device.into(),
                kernel: "add".into(),
                spirv: add.clone(),
                specialization: vec![(constant, 3)],
            })
        };
        job(device.name(), 1).run().unwrap();
        assert!(job(device.name(), 9).run().is_err());
        assert!(job("no such device", 1).run().is_err());
        if device.supports_acceleration_structure() {
            build_two(&device).unwrap();
            assert_eq!(device.validation_messages(), [""; 0]);
        }
    }

    #[test]
    fn a_program_that_is_no_compiler_is_not_waited_for() {
        // More than a pipe holds.
        let job = Job::Structures("x".repeat(1 << 20));
        let here = std::env::current_exe().unwrap();
        let listing = (here, vec!["--list".into(), "no such test".into()]);
        assert!(apart(&listing, &job).is_none());
        assert!(apart(&("no such program".into(), vec![]), &job).is_none());
    }

    #[cfg(unix)]
    #[test]
    fn the_end_of_a_compiler_is_told() {
        let compile = |then: &str| {
            let script = format!("printf '{GREETING}'; cat >/dev/null; {then}");
            let compiler = ("sh".into(), vec!["-c".into(), script.into()]);
            apart(&compiler, &Job::Structures("it".into()))
        };
        assert!(matches!(compile("exit 0"), Some(Ok(true))));
        assert!(matches!(compile("exit 1"), Some(Ok(false))), "the device in use meets the error");
        let died = compile("echo 'LLVM ERROR: no such copy' >&2; echo more >&2; kill -ABRT $$");
        let died = died.unwrap().unwrap_err();
        assert_eq!(died.words, "LLVM ERROR: no such copy");
        let device = lone_test_device();
        let text = died.of(&device, "on the kernel 'add'").to_string();
        for part in [device.name(), "'add'", "signal: 6", "no such copy", "LP_NATIVE_VECTOR_WIDTH"]
        {
            assert!(text.contains(part), "{text}");
        }
        assert!(compile("kill -SEGV $$").unwrap().unwrap_err().words.is_empty());
    }
}
