//! The `insonify` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    insonify::gpu::prepare_process();
    insonify::cli::run(std::env::args_os().collect())
}
