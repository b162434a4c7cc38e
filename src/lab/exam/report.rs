//! The report of an examination: one HTML file, which a browser prints.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::worksheet::Worksheet;

/// A picture of the report.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The PNG file.
    pub png: Vec<u8>,
    /// The line below it.
    pub caption: String,
}

/// Everything that stands in a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The kind of the examination.
    pub exam: String,
    /// Names and contents of the fields at its head; those without content are left out.
    pub fields: Vec<(&'static str, String)>,
    /// Measured and derived values.
    pub worksheet: Worksheet,
    /// Pictures.
    pub pictures: Vec<Picture>,
    /// Findings, as they were typed.
    pub findings: String,
}

const STYLE: &str = "body{font:11pt/1.4 sans-serif;max-width:190mm;margin:8mm auto;color:#111}\
h1{font-size:16pt;margin:0 0 4mm}h2{font-size:12pt;margin:6mm 0 2mm}\
table{border-collapse:collapse}td,th{text-align:left;padding:1mm 6mm 1mm 0;vertical-align:top}\
th{font-weight:600}.n{text-align:right}small{color:#555}figure{margin:0 0 6mm;break-inside:avoid}\
img{max-width:100%;max-height:120mm}p.f{white-space:pre-wrap}\
@page{size:A4;margin:12mm}@media print{body{margin:0;max-width:none}tr{break-inside:avoid}}";

impl Report {
    /// The report as one HTML file without links to others; its style suits printing.
    pub fn html(&self) -> String {
        let title = format!("Ultrasound examination: {}", self.exam);
        let mut out = format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\
             <style>{STYLE}</style></head><body>\n<h1>{0}</h1>\n<table>\n",
            plain(&title)
        );
        for (name, content) in self.fields.iter().filter(|(_, content)| !content.trim().is_empty())
        {
            let _ = writeln!(out, "<tr><th>{name}</th><td>{}</td></tr>", plain(content));
        }
        out.push_str("</table>\n");
        self.values(&mut out);
        if !self.findings.trim().is_empty() {
            let _ =
                writeln!(out, "<h2>Findings</h2>\n<p class=\"f\">{}</p>", plain(&self.findings));
        }
        if !self.pictures.is_empty() {
            out.push_str("<h2>Pictures</h2>\n");
        }
        for Picture { png, caption } in &self.pictures {
            let (data, caption) = (STANDARD.encode(png), plain(caption));
            let _ = writeln!(
                out,
                "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\">\
                 <figcaption>{caption}</figcaption></figure>"
            );
        }
        out.push_str(
            "<p><small>Simulated images: not of a patient, not for diagnosis.</small></p>\n",
        );
        out.push_str("</body></html>\n");
        out
    }

    fn values(&self, out: &mut String) {
        let Worksheet { lines, derived } = &self.worksheet;
        if !lines.is_empty() {
            out.push_str("<h2>Measured</h2>\n<table>\n");
        }
        for line in lines {
            let unit = line.quantity.unit();
            let all: Vec<String> = line.values.iter().map(|value| format!("{value:.1}")).collect();
            let several =
                if all.len() > 1 { format!("mean of {}", all.join(", ")) } else { String::new() };
            let _ = writeln!(
                out,
                "<tr><th>{}</th><td class=\"n\">{:.1} {unit}</td><td><small>{several}</small></td>\
                 <td><small>{}</small></td></tr>",
                plain(&line.name),
                line.mean(),
                plain(line.meaning)
            );
        }
        if !lines.is_empty() {
            out.push_str("</table>\n");
        }
        if derived.is_empty() {
            return;
        }
        out.push_str("<h2>Derived</h2>\n<table>\n");
        for one in derived {
            let _ = writeln!(
                out,
                "<tr><th>{}</th><td class=\"n\">{}</td><td><small>{}</small></td></tr>",
                plain(one.name),
                plain(&one.text),
                plain(one.source)
            );
        }
        out.push_str("</table>\n");
    }
}

/// A text without signs that mean something in HTML.
fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            _ => out.push(sign),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::worksheet::Measured;
    use super::*;
    use crate::settings::Exam;

    #[test]
    fn a_report_holds_everything_in_one_file() {
        let crl = Measured { name: "CRL".into(), length: Some(43.0), ..Measured::default() };
        let report = Report {
            exam: "obstetric".into(),
            fields: vec![("Patient", "<A & \"B\">".into()), ("Born", " ".into())],
            worksheet: Worksheet::of(Exam::Obstetric, &[crl.clone(), crl]),
            pictures: vec![Picture { png: b"png".to_vec(), caption: "plane 1".into() }],
            findings: "one\ntwo".into(),
        };
        let html = report.html();
        for part in [
            "&lt;A &amp; &quot;B&quot;&gt;",
            "43.0 mm",
            "mean of 43.0, 43.0",
            "11w 0d",
            "Robinson",
            "data:image/png;base64,cG5n",
            "one\ntwo",
            "@media print",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
        assert!(!html.contains("Born"), "an empty field");
        // Nothing is fetched from elsewhere, and what is typed runs no script.
        assert!(!html.contains("http") && !html.contains("<A"));
    }
}
