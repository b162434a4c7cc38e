//! What is set for the whole process before a driver is opened.

/// Has llvmpipe, Mesa's driver for the processor, compile kernels for vectors of four: that takes it a third of the
/// time that vectors of eight do, frames take as long within a twentieth, and bits are the same (benches/RESULTS.md).
/// Mesa's own cache does not tell the two apart: what is there is used. A `LP_NATIVE_VECTOR_WIDTH` of the user's stays.
///
/// To be called first in `main`. Once there are other threads, nothing is done.
pub fn prepare_process() {
    const WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
    let alone = std::fs::read_dir("/proc/self/task").is_ok_and(|threads| threads.count() == 1);
    if cfg!(target_os = "linux") && alone && std::env::var_os(WIDTH).is_none() {
        // SAFETY: this is the only thread, so that none reads the environment meanwhile.
        unsafe { std::env::set_var(WIDTH, "128") };
    }
}
