//! What is set for the whole process before a driver is opened.

use super::kept;

/// Has llvmpipe, Mesa's driver for the processor, compile kernels for vectors of four: that takes it a third of the
/// time that vectors of eight do, frames take as long within a twentieth, and bits are the same (benches/RESULTS.md).
/// What it compiled goes to a folder of this program's own: Mesa does not tell the two apart, and to run what was
/// compiled for the other width would end the process. Who sets `LP_NATIVE_VECTOR_WIDTH` or `MESA_SHADER_CACHE_DIR`
/// has both as they are.
///
/// And has glibc make no heap for each thread: what drivers free on one of those after compiling stays there, 25 MB
/// in two threads.
///
/// To be called first in `main`. Once there are other threads, nothing is done.
pub fn prepare_process() {
    const NAMES: [&str; 2] = ["LP_NATIVE_VECTOR_WIDTH", "MESA_SHADER_CACHE_DIR"];
    let alone = std::fs::read_dir("/proc/self/task").is_ok_and(|threads| threads.count() == 1);
    if alone {
        share_heaps();
    }
    let set = NAMES.iter().any(|name| std::env::var_os(name).is_some());
    let (true, false, Some(folder)) = (alone, set, kept::mesa_folder()) else {
        return;
    };
    // Mesa makes no folders above its own.
    if std::fs::create_dir_all(&folder).is_ok() {
        // SAFETY: this is the only thread, so that none reads the environment meanwhile.
        unsafe {
            std::env::set_var(NAMES[0], "128");
            std::env::set_var(NAMES[1], folder);
        }
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
