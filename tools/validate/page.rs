//! The validation report as one HTML page that needs nothing else.

use std::fmt::Write;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::physics::check::{Check, Examined, Figure, Picture};
use insonify::output::plot::{escape, svg};

/// Rows of the validation table.
pub const ROWS: u32 = 35;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;\
max-width:1180px;margin:2em auto;padding:0 1em}h1{font-size:1.7em}h2{font-size:1.2em;margin:2.2em 0 .3em;\
border-top:1px solid #ccc;padding-top:1em}table{border-collapse:collapse;margin:.8em 0}\
th,td{padding:.2em .7em;text-align:left;border-bottom:1px solid #e2e2e2;vertical-align:top}\
td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}\
.yes{color:#00663c}.no{color:#b00020;font-weight:bold}.row{color:#666;font-weight:normal}\
.shown{display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start}figure{margin:0}\
figcaption{font-size:.9em;color:#444}img{max-width:560px;max-height:480px;border:1px solid #ccc}\
svg{max-width:100%;height:auto}p{max-width:52em}";

/// Returns the page. `origin` gives by name the origin of the figures; `rows` are those of every existing
/// check, whether it is among `examined` or not.
pub fn page(origin: &[(&str, &str)], rows: &[&str], examined: &[(Check, Examined)]) -> String {
    let mut out = String::new();
    let failing = examined.iter().filter(|(_, e)| !e.holds()).count();
    let verdict = match failing {
        0 => format!("All {} checks hold.", examined.len()),
        n => format!("{n} of {} checks do not hold.", examined.len()),
    };
    let origin: String = origin
        .iter()
        .map(|(name, text)| format!("<tr><th>{name}</th><td>{}</td></tr>", escape(text)))
        .collect();
    let _ = write!(
        out,
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>insonify: validation</title>\
         <meta name='viewport' content='width=device-width'><style>{STYLE}</style></head><body>\n\
         <h1>insonify: the picture obeys acoustics</h1>\n\
         <p>Every figure below is measured in a picture or a path that the simulator computed and held \
         against a closed form. The same comparisons are the project's tests. Each is also made with an error \
         planted, which every figure has to notice, but for those beside which another error is named. <b>twins</b> are implementations in double precision on the \
         CPU; <b>bvh</b> and <b>query</b> (<b>ray-query</b>) are the device with the compute tracer and with hardware ray queries.</p>\n\
         <table>{origin}<tr><th>Verdict</th><td class='{}'>{verdict}</td></tr></table>\n",
        if failing == 0 { "yes" } else { "no" },
    );
    missing(&mut out, rows, examined);
    summary(&mut out, examined);
    for (check, found) in examined {
        section(&mut out, check, found);
    }
    out.push_str("</body></html>\n");
    out
}

/// Writes which rows of the table have no check, and which have one that was not requested.
fn missing(out: &mut String, rows: &[&str], examined: &[(Check, Examined)]) {
    let all = || (1..=ROWS).map(|n| format!("T{n}"));
    let list = |rows: Vec<String>| rows.join(", ");
    let absent: Vec<String> = all().filter(|r| !rows.contains(&r.as_str())).collect();
    let _ = match absent.is_empty() {
        true => writeln!(out, "<p>Every row of T1 to T{ROWS} has a check.</p>"),
        false => writeln!(
            out,
            "<p>Rows of the table T1 to T{ROWS} without a check yet: <b>{}</b>.</p>",
            list(absent)
        ),
    };
    let ran = |r: &str| examined.iter().any(|(check, _)| check.row == r);
    let left = all().filter(|r| rows.contains(&r.as_str()) && !ran(r));
    let left: Vec<String> = left.collect();
    if !left.is_empty() {
        let _ = writeln!(out, "<p>Not run for this page: {}.</p>", list(left));
    }
}

fn summary(out: &mut String, examined: &[(Check, Examined)]) {
    out.push_str(
        "<table><tr><th>Row</th><th>What it proves</th><th>Figures</th>\
         <th>Worst, of its tolerance</th><th>Planted error</th><th>Verdict</th></tr>\n",
    );
    for (check, found) in examined {
        let figures = &found.right.figures;
        let used = |f: &Figure| match (f.measured - f.expected).abs() {
            0.0 => 0.0,
            error => error / f.tolerance,
        };
        let worst = figures.iter().map(used).fold(0.0, f64::max);
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td><a href='#{}'>{}</a></td><td class='n'>{}</td><td class='n'>{:.0} %</td>\
             {}{}</tr>",
            check.row,
            check.name,
            spoken(check.name),
            figures.len(),
            100.0 * worst,
            cell(found.noticed(), "noticed", "not noticed"),
            cell(found.holds(), "holds", "does not hold"),
        );
    }
    out.push_str("</table>\n");
}

/// A verdict as a table cell.
fn cell(holds: bool, yes: &str, no: &str) -> String {
    match holds {
        true => format!("<td class='yes'>{yes}</td>"),
        false => format!("<td class='no'>{no}</td>"),
    }
}

/// `a_point_is_round` as a sentence.
fn spoken(name: &str) -> String {
    let mut words = name.replace('_', " ");
    if let Some(first) = words.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    escape(&words)
}

fn section(out: &mut String, check: &Check, found: &Examined) {
    let noticed = match found.noticed() {
        true => "<span class='yes'>noticed</span>",
        false => "<span class='no'>not noticed</span>",
    };
    let _ = writeln!(
        out,
        "<h2 id='{}'><span class='row'>{}</span> {}</h2>\n<p>{}</p>\n<p>Planted error, {noticed}: {}</p>\n\
         <div class='shown'>",
        check.name,
        check.row,
        spoken(check.name),
        escape(check.claim),
        escape(check.planted),
    );
    for picture in &found.right.pictures {
        let _ = writeln!(
            out,
            "<figure><img alt='{0}' src='data:image/png;base64,{1}'><figcaption>{0}</figcaption></figure>",
            escape(&picture.title),
            base64(&png(picture)),
        );
    }
    for plot in &found.right.plots {
        let _ = writeln!(out, "<figure>{}</figure>", svg(plot));
    }
    out.push_str(
        "</div>\n<table><tr><th>Figure</th><th>Measured</th><th>Expected</th><th>Tolerance</th><th>Verdict</th></tr>\n",
    );
    for f in &found.right.figures {
        let other = f.other.map(|(error, value)| format!(" (not {}: {error})", number(value)));
        let other = other.unwrap_or_default();
        let _ = writeln!(
            out,
            "<tr><td>{}{}</td><td class='n'>{}</td><td class='n'>{}</td><td class='n'>{}</td>{}</tr>",
            escape(&f.what),
            escape(&other),
            number(f.measured),
            number(f.expected),
            number(f.tolerance),
            cell(f.holds(), "holds", "does not hold"),
        );
    }
    out.push_str("</table>\n");
    for message in &found.messages {
        let _ = writeln!(out, "<p class='no'>Validation: {}</p>", escape(message));
    }
}

/// Formats a number with five digits.
fn number(v: f64) -> String {
    let size = v.abs();
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{v:.2e}");
    }
    let decimals = (4.0 - size.log10().floor()).max(0.0) as usize;
    let text = format!("{v:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

fn png(picture: &Picture) -> Vec<u8> {
    let mut bytes = vec![];
    let height = picture.grey.len() as u32 / picture.width;
    PngEncoder::new(&mut bytes)
        .write_image(&picture.grey, picture.width, height, ExtendedColorType::L8)
        .expect("whole rows of grey levels");
    bytes
}

/// Encodes bytes in base64 (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i)) as usize & 63] as char;
            out.push(if i <= chunk.len() { digit } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::check::{Bench, Curve, Outcome, Physics, Plot, examine, prove};
    use crate::physics::rows;

    fn one_figure(measured: f64) -> Outcome {
        let mut out = Outcome::default();
        out.compare("bvh: length, mm", measured, 2.0, 0.1);
        let line = Curve::line("law", vec![[0.0, 0.0], [1.0, 2.0]]);
        let dots = Curve::dots("bvh", vec![[0.5, measured]]);
        out.plots.push(Plot::linear("Length", ["x", "y"], vec![line, dots]));
        out.pictures.push(Picture { title: "all grey".into(), width: 2, grey: vec![128; 4] });
        out
    }

    fn check(name: &'static str, run: fn(&Bench, Physics) -> Outcome) -> Check {
        Check { row: "T5", name, claim: "Two millimetres.", planted: "Three.", run }
    }

    /// A right check, a wrong one, and one that would not notice: the page's verdict is the test's for each.
    #[test]
    fn verdicts_of_the_page_are_those_of_the_tests() {
        let checks = [
            check("right", |_, physics| {
                one_figure(if physics == Physics::Right { 2.05 } else { 3.0 })
            }),
            check("wrong", |_, _| one_figure(3.0)),
            check("blind", |_, _| one_figure(2.05)),
            check("undefined", |_, physics| {
                one_figure(if physics == Physics::Right { f64::NAN } else { 3.0 })
            }),
        ];
        let bench = Bench::new();
        let origin = [("Device", "a < b")];
        for c in checks {
            let proven =
                std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| prove(&c))).is_ok();
            let name = c.name;
            let found = examine(&c, &bench);
            assert_eq!(proven, name == "right");
            assert_eq!(found.holds(), proven, "{name}");
            let html = page(&origin, &["T5"], &[(c, found)]);
            assert_eq!(html.contains("All 1 checks hold."), proven, "{name}");
            assert_eq!(html.contains("1 of 1 checks do not hold."), !proven, "{name}");
            assert_eq!(html.contains("<td class='no'>does not hold</td>"), !proven, "{name}");
            assert_eq!(html.contains("not noticed"), name == "blind", "{name}");
            assert!(html.contains("a &lt; b") && html.contains("<polyline"));
            assert!(html.contains("data:image/png;base64,iVBORw0KGgo"));
            assert!(!html.contains("src='http") && !html.contains("<script"));
        }
    }

    #[test]
    fn rows_without_a_check_are_named() {
        let rows: Vec<&str> = rows::all().iter().map(|c| c.row).collect();
        let html = page(&[], &rows, &[]);
        for n in 1..=ROWS {
            let row = format!("T{n}");
            let absent = html
                .lines()
                .filter(|l| l.contains("without a check yet"))
                .any(|l| l.contains(&format!("{row},")) || l.contains(&format!("{row}<")));
            assert_eq!(absent, !rows.contains(&row.as_str()), "{row}");
        }
    }

    #[test]
    fn bytes_and_numbers_are_written_as_usual() {
        let cases: [(&[u8], &str); 4] =
            [(b"", ""), (b"f", "Zg=="), (b"fo", "Zm8="), (b"foobar", "Zm9vYmFy")];
        for (bytes, text) in cases {
            assert_eq!(base64(bytes), text);
        }
        let numbers = [0.0, 1.5, -0.162_01, 123_456.0, 1e-7, f64::NAN].map(number);
        assert_eq!(numbers, ["0", "1.5", "-0.16201", "123456", "1.00e-7", "NaN"]);
    }
}
