//! Errors of programs as they are printed.

use std::fmt::{Formatter, Result};
use std::io::{IsTerminal, stderr};

use miette::{Diagnostic, ReportHandler};

use super::explanation;

/// Makes an error that ends this program appear as cause and remedy, with `error:` before it. To be called once, when
/// the program begins.
pub fn tell_errors() {
    let red = stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
    miette::set_hook(Box::new(move |_| Box::new(Teller { red }))).expect("set once");
}

struct Teller {
    /// True for text in colour.
    red: bool,
}

impl ReportHandler for Teller {
    fn debug(&self, error: &dyn Diagnostic, f: &mut Formatter<'_>) -> Result {
        let title = if self.red { "\x1b[1;31merror\x1b[0m" } else { "error" };
        write!(f, "{title}: {}", explanation(error))
    }
}
