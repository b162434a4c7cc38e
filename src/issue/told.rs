//! The text of an error: message and causes, the lines of the file that it is about, the remedy.

use std::fmt::{Error, Formatter, Result, Write as _};
use std::io::{IsTerminal, stderr};

use miette::{Diagnostic, ReportHandler, SourceCode, SourceSpan};

/// Makes errors of all commands appear in this form.
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
        write!(f, "{title}: {error}")?;
        // The help and the place may be those of an error that others are about.
        let mut inner = error;
        while let Some(cause) = inner.diagnostic_source() {
            inner = cause;
            write!(f, "\n  because: {inner}")?;
        }
        let mut cause = inner.source();
        while let Some(error) = cause {
            write!(f, "\n  because: {error}")?;
            cause = error.source();
        }
        let source = error.source_code().or(inner.source_code());
        let mut labels = error.labels().or(inner.labels()).into_iter().flatten();
        if let (Some(source), Some(label)) = (source, labels.next()) {
            write!(f, "\n{}", lines(source, label.inner()).ok_or(Error)?)?;
        }
        if let Some(help) = error.help().or(inner.help()) {
            write!(f, "\n  help: {help}")?;
        }
        Ok(())
    }
}

/// The line in which `span` begins, with the one before it, and a mark below the span.
fn lines(source: &dyn SourceCode, span: &SourceSpan) -> Option<String> {
    let text = source.read_span(span, 1, 1).ok()?;
    let shown = str::from_utf8(text.data()).ok()?;
    let before = shown.get(..span.offset() - text.span().offset())?;
    let first = text.line() + 1;
    let marked = before.matches('\n').count();
    let begin = before.rfind('\n').map_or(0, |at| at + 1);
    let width = (first + marked).to_string().len();
    let mut out = String::new();
    for (i, line) in shown.lines().take(marked + 1).enumerate() {
        writeln!(out, " {:>width$} | {line}", first + i).ok()?;
    }
    // Tabs stay, so that the mark stands below what it marks.
    let blank: String =
        before[begin..].chars().map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
    let rest = shown[before.len()..].lines().next().unwrap_or_default();
    let long = rest.char_indices().take_while(|(at, _)| *at < span.len()).count().max(1);
    write!(out, " {:>width$} | {blank}{}", "", "^".repeat(long)).ok()?;
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mark_stands_below_the_span() {
        let text = "[probe]\n# \u{b5}s\n\tpitch = \"3\"\nwidth = 4\n";
        let shown = |from: &str| {
            let at = text.find(from).expect("there");
            lines(&text, &(at, from.len()).into()).expect("shown")
        };
        assert_eq!(shown("\"3\""), " 2 | # \u{b5}s\n 3 | \tpitch = \"3\"\n   | \t        ^^^");
        assert_eq!(shown("pitch"), " 2 | # \u{b5}s\n 3 | \tpitch = \"3\"\n   | \t^^^^^");
        assert_eq!(shown("[probe]"), " 1 | [probe]\n   | ^^^^^^^");
        // Of a span over several lines only the first is marked.
        assert_eq!(shown("4\n"), " 3 | \tpitch = \"3\"\n 4 | width = 4\n   |         ^");
        assert_eq!(lines(&text, &(900, 2).into()), None);
    }
}
