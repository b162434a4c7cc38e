//! The form for assessors: one HTML file with everything inside. It knows the numbers of cases and images, and
//! the cases ranked together; the identity of an image is in the key only.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use super::answers::{FORMAT, VERSION};
use crate::scene::file::Question;

const PAGE: &str = include_str!("form/page.html");
const STYLE: &str = include_str!("form/style.css");
const SCRIPT: &str = include_str!("form/script.js");

/// Content of a form.
pub struct Form<'a> {
    /// Id of the study: [`super::key::Key::id`].
    pub study: &'a str,
    /// Headline.
    pub title: &'a str,
    /// Introduction for the assessor: plain text, an empty line between paragraphs.
    pub introduction: &'a str,
    /// The question.
    pub question: &'a Question,
    /// The cases, in the order of their numbers.
    pub cases: Vec<Case>,
    /// Numbers of cases whose chosen images are ranked together: [`super::key::Key::groups`].
    pub groups: Vec<Vec<usize>>,
}

/// One case.
pub struct Case {
    /// Text above its images; may be empty.
    pub title: String,
    /// Text added to that where it is ranked with others; may be empty. Not earlier: it would reveal the cases
    /// that belong together.
    pub slice: String,
    /// PNG files, in the order of their numbers.
    pub images: Vec<Vec<u8>>,
}

impl Form<'_> {
    /// The HTML file.
    pub fn html(&self) -> String {
        let cases: String = (1..).zip(&self.cases).map(|(n, c)| self.case(n, c)).collect();
        let rankings = self.groups.iter().filter(|group| group.len() > 1);
        let rankings: Vec<&Vec<usize>> = rankings.collect();
        let about = json!({
            "format": FORMAT,
            "version": VERSION,
            "study": self.study,
            "images": self.cases.iter().map(|c| c.images.len()).collect::<Vec<_>>(),
            "rankings": rankings,
        });
        let ranked: String =
            (1..).zip(&rankings).map(|(n, group)| self.ranking(n, rankings.len(), group)).collect();
        let paragraphs = self.introduction.split("\n\n").map(str::trim);
        let introduction: String = paragraphs
            .filter(|p| !p.is_empty())
            .map(|p| format!("<p>{}</p>\n", escaped(p)))
            .collect();
        // Texts of the plan are not searched for places of their own.
        filled(
            PAGE,
            &[
                ("STYLE", STYLE),
                ("TITLE", &escaped(self.title)),
                ("INTRODUCTION", &introduction),
                ("CASES", &cases),
                ("RANKINGS", &ranked),
                // Inside a script element only its end tag counts.
                ("ABOUT", &about.to_string().replace('<', "\\u003c")),
                ("SCRIPT", SCRIPT),
            ],
        )
    }

    fn case(&self, number: usize, case: &Case) -> String {
        let mut tiles = String::new();
        for (image, png) in (1..).zip(&case.images) {
            let data = STANDARD.encode(png);
            let _ = write!(
                tiles,
                r#"<div class="tile">
<button type="button" class="enlarge" data-image="{image}" aria-label="Enlarge image {image}"><img id="image-{number}-{image}" alt="Case {number}, image {image}" src="data:image/png;base64,{data}"></button>
<label><input type="radio" name="image-{number}" value="{image}"> Image {image}</label>
</div>
"#
            );
        }
        let degrees = (1..).zip(&self.question.agreement);
        let degrees: String = degrees
            .map(|(n, text)| {
                let text = escaped(text);
                format!(
                    r#"<label><input type="radio" name="agreement-{number}" value="{n}"> {text}</label>
"#
                )
            })
            .collect();
        format!(
            r#"<section class="page case" id="case-{number}" data-case="{number}" hidden>
<h2 tabindex="-1">Case {number} of {count}</h2>
{title}<fieldset class="choice">
<legend>{choose}</legend>
<p class="hint">Click an image, or press Enter on it, to see it larger.</p>
<div class="tiles">
{tiles}</div>
</fieldset>
<fieldset class="rating" id="rating-{number}" hidden>
<legend>{statement}</legend>
<div class="beside"><img class="chosen" id="chosen-{number}" alt="">
<div class="degrees">
{degrees}</div></div>
</fieldset>
<label class="remark">Remark (optional)<textarea id="remark-{number}" rows="2" maxlength="4000"></textarea></label>
</section>
"#,
            count = self.cases.len(),
            title = titled(&case.title),
            choose = escaped(&self.question.choose),
            statement = escaped(&self.question.statement),
        )
    }

    fn ranking(&self, number: usize, count: usize, group: &[usize]) -> String {
        let Case { title, slice, .. } = &self.cases[group[0] - 1];
        let title = match (title.trim(), slice.trim()) {
            (title, "") => title.to_owned(),
            ("", slice) => slice.to_owned(),
            (title, slice) => format!("{title}: {slice}"),
        };
        let mut images = String::new();
        for (letter, case) in ('A'..).zip(group) {
            let mut options = String::from(r#"<option value="">not yet</option>"#);
            for rank in 1..=group.len() {
                let meaning = match rank {
                    1 => " (most realistic)",
                    n if n == group.len() => " (least realistic)",
                    _ => "",
                };
                let _ = write!(options, r#"<option value="{rank}">{rank}{meaning}</option>"#);
            }
            let _ = write!(
                images,
                r#"<div class="tile">
<button type="button" class="enlarge" data-case="{case}" aria-label="Enlarge image {letter}"><img class="ranked" data-case="{case}" alt="Image {letter}, chosen in case {case}"></button>
<label>Image {letter}, rank <select id="rank-{number}-{case}" data-ranking="{number}" data-case="{case}">{options}</select></label>
</div>
"#
            );
        }
        format!(
            r#"<section class="page ranking" id="ranking-{number}" data-ranking="{number}" hidden>
<h2 tabindex="-1">Comparison {number} of {count}</h2>
{title}<p class="locked"></p>
<fieldset class="order">
<legend>{rank}</legend>
<p class="hint">These are the images that you chose. Each rank is given once: an image that takes another's rank gives it its own.</p>
<div class="tiles few">
{images}</div>
</fieldset>
</section>
"#,
            title = titled(&title),
            rank = escaped(&self.question.rank),
        )
    }
}

fn titled(title: &str) -> String {
    match title.trim() {
        "" => String::new(),
        title => format!("<p class=\"about\">{}</p>\n", escaped(title)),
    }
}

/// Text inside an element.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// A page with the text for each `{{NAME}}`.
fn filled(page: &str, parts: &[(&str, &str)]) -> String {
    let mut out =
        String::with_capacity(page.len() + parts.iter().map(|p| p.1.len()).sum::<usize>());
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").expect("a name ends");
        let part = parts.iter().find(|(n, _)| *n == name);
        out.push_str(before);
        out.push_str(part.expect("a part of this name").1);
        rest = after;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_the_plan_are_texts_of_the_page() {
        let hostile = "a < b & </script><b>{{CASES}}";
        let question = Question {
            choose: hostile.to_owned(),
            statement: "It is.".to_owned(),
            agreement: ["1", "2", "3", "4", "5"].map(str::to_owned),
            rank: "Order?".to_owned(),
        };
        let case = || Case {
            title: hostile.to_owned(),
            slice: "from above".to_owned(),
            images: vec![b"one".to_vec(), b"two".to_vec()],
        };
        let form = Form {
            study: "</script>",
            title: hostile,
            introduction: "First.\n\n  \n\nSecond & last.",
            question: &question,
            cases: vec![case(), case()],
            groups: vec![vec![1, 2]],
        };
        let html = form.html();
        assert!(html.contains("a &lt; b &amp; &lt;/script&gt;&lt;b&gt;{{CASES}}"));
        assert!(!html.contains("<b>") && html.matches("</script>").count() == 2);
        assert!(html.contains("<p>First.</p>\n<p>Second &amp; last.</p>"));
        assert_eq!(html.matches("data:image/png;base64,dHdv\"").count(), 2);
        assert_eq!(html.matches("<select").count(), 2);
        // Cases that belong together are revealed only where they are compared.
        assert_eq!(html.matches("from above").count(), 1);
    }
}
