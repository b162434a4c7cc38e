//! The `insonify` command: parse, run, print one error, exit code.

use std::process::ExitCode;

mod cli;

fn main() -> ExitCode {
    insonify::gpu::prepare_process();
    cli::run()
}
