//! The process and its system: settings before a driver is opened, and all that only one system has. Other code calls
//! nothing of one system alone (`tests/directions`).

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use super::{ahead, kept};

/// Makes llvmpipe, Mesa's driver for the processor, compile kernels for vectors of four: that takes it a third of the
/// time for vectors of eight, frames take as long within a twentieth, and bits are the same (benches/RESULTS.md).
/// Its compiled kernels go to a folder of this program's own: Mesa does not distinguish the two widths, and running
/// a kernel compiled for the other width would end the process. If `LP_NATIVE_VECTOR_WIDTH` or
/// `MESA_SHADER_CACHE_DIR` is set, both stay as they are.
///
/// Limits the number of glibc's heaps, which otherwise grows with the threads: memory that drivers free in them after
/// compiling is not given back to the system, 25 MB in two threads.
///
/// Lets this program be started again as a compiler of kernels, in a process of its own: where that is what this process
/// was started for, it compiles and ends here.
///
/// To be called first in `main`. Once there are other threads, it does nothing.
pub fn prepare_process() {
    let alone = std::fs::read_dir("/proc/self/task").is_ok_and(|threads| threads.count() == 1);
    if alone {
        share_heaps();
    }
    if alone {
        for (name, value) in driver_environment() {
            // SAFETY: this is the only thread, so that none reads the environment meanwhile.
            unsafe { std::env::set_var(name, value) };
        }
        if std::env::args_os().nth(1).is_some_and(|first| first == ahead::COMPILE) {
            std::process::exit(ahead::compile_standard_input().into());
        }
        if let Ok(program) = std::env::current_exe() {
            ahead::set_compiler(program, vec![ahead::COMPILE.into()]);
        }
    }
}

/// The variables that [`prepare_process`] sets, with their values; none where one of them is set.
pub fn driver_environment() -> Vec<(&'static str, OsString)> {
    let set = kept::MESA_VARIABLES.iter().any(|name| std::env::var_os(name).is_some());
    // Mesa makes no folders above its own.
    let made = |folder: &PathBuf| std::fs::create_dir_all(folder).is_ok();
    match kept::mesa_folder().filter(made) {
        Some(folder) if !set => {
            kept::MESA_VARIABLES.into_iter().zip(["128".into(), folder.into()]).collect()
        }
        _ => Vec::new(),
    }
}

/// Makes the system keep no image of this process where it ends by a signal: somebody expects that.
pub(super) fn without_core_file() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let none = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        // SAFETY: the structure is alive during the call, which can only fail.
        unsafe { libc::setrlimit(libc::RLIMIT_CORE, &none) };
    }
}

/// Keeps an interrupt of the terminal, Ctrl-C, from a process to be started: whoever waits for it would take its end for
/// a fault.
pub(super) fn not_interrupted(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(not(unix))]
    let _ = command;
}

/// Lets a process that was forked from one with a device end as soon as it exits, without the last deeds of libraries:
/// drivers then wait for their threads, which are not here (Mesa 25.0 with glibc 2.41 for ever).
pub fn end_without_drivers() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        use std::ffi::{c_int, c_void};
        use std::ptr::null_mut;

        // SAFETY: as glibc declares it (stdlib.h).
        unsafe extern "C" {
            fn on_exit(deed: extern "C" fn(c_int, *mut c_void), argument: *mut c_void) -> c_int;
        }

        extern "C" fn end(status: c_int, _: *mut c_void) {
            // SAFETY: all open streams are written, which needs none of them; then nothing of this process runs any more.
            unsafe {
                libc::fflush(null_mut());
                libc::_exit(status)
            }
        }

        // Of all that was registered before, the drivers' deeds among it, this comes first.
        // SAFETY: the function stays as long as the program, and takes no argument.
        unsafe { on_exit(end, null_mut()) };
    }
}

fn share_heaps() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const HEAPS: libc::c_int = 2;
        // SAFETY: a number for the allocator, which takes or refuses it.
        unsafe { libc::mallopt(libc::M_ARENA_MAX, HEAPS) };
    }
}

/// Largest resident size of this process so far, bytes, where the system tells it.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// The device of a game pad that this user may not read, where there is one. Only Linux keeps pads from users.
pub fn unreadable_pad() -> Option<PathBuf> {
    // Elsewhere there is no such folder.
    let devices = std::fs::read_dir("/dev/input").ok()?;
    let joystick = devices.flatten().find(|device| {
        let name = device.file_name();
        name.to_string_lossy().starts_with("js")
    })?;
    let error = std::fs::File::open(joystick.path()).err()?;
    let denied = error.kind() == std::io::ErrorKind::PermissionDenied;
    denied.then(|| joystick.path())
}
