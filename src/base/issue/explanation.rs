//! The text of an error: message and causes, the lines of the file that it is about, the remedy.

use std::fmt::Write as _;

use miette::{Diagnostic, SourceCode, SourceSpan};

/// The text of an error, several lines: message, causes, lines of the file, remedy.
pub fn explanation(error: &dyn Diagnostic) -> String {
    let mut out = error.to_string();
    // The help and the place may be those of an error that others are about.
    let mut inner = error;
    while let Some(cause) = inner.diagnostic_source() {
        inner = cause;
        out += &format!("\n  because: {inner}");
    }
    let mut cause = inner.source();
    while let Some(error) = cause {
        out += &format!("\n  because: {error}");
        cause = error.source();
    }
    let source = error.source_code().or(inner.source_code());
    let mut labels = error.labels().or(inner.labels()).into_iter().flatten();
    if let (Some(source), Some(label)) = (source, labels.next())
        && let Some(lines) = lines(source, label.inner())
    {
        out += &format!("\n{lines}");
    }
    if let Some(help) = error.help().or(inner.help()) {
        out += &format!("\n  help: {help}");
    }
    out
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
