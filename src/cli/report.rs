//! Errors of commands as they are printed.

use std::fmt::{Formatter, Result};
use std::io::{IsTerminal, stderr};

use insonify::issue::told;
use miette::{Diagnostic, ReportHandler};

/// Makes errors of all commands appear in the same form.
pub fn install() {
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
        write!(f, "{title}: {}", told(error))
    }
}
