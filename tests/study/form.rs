//! The form in a browser, filled in as by an assessor.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use insonify::scene::file::Question;
use insonify::study::answers::Answers;
use insonify::study::form::{Case, Form};
use serde_json::{Value, json};

use crate::study::browser::{Browser, ENTER, PATIENCE, RIGHT, SPACE};
use crate::study::{IMAGES, desk, program};

/// Presses the button that saves; the only file in the folder of downloads then, moved out of it.
fn save(browser: &Browser, to: &Path) -> PathBuf {
    browser.click("#save");
    let saved = "return document.getElementById('notice').textContent.startsWith('Saved as')";
    browser.wait(saved);
    let begun = std::time::Instant::now();
    loop {
        let all = std::fs::read_dir(browser.saved()).expect("a folder").flatten();
        let all: Vec<PathBuf> = all.map(|e| e.path()).collect();
        let json = |p: &&PathBuf| p.extension().is_some_and(|e| e == "json");
        let whole: Vec<&PathBuf> = all.iter().filter(json).collect();
        // Browsers make the file first and write it later.
        let written = |file: &Path| {
            let text = std::fs::read(file).expect("a file");
            serde_json::from_slice::<Value>(&text).is_ok()
        };
        if let [file] = whole.as_slice()
            && written(file)
        {
            std::fs::rename(file, to).expect("moved");
            return to.to_owned();
        }
        assert!(begun.elapsed() < PATIENCE, "no file comes: {all:?}");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
}

const SHOWN: &str =
    "return [...document.querySelectorAll('.page')].filter(p => !p.hidden).map(p => p.id)";
const LOADED: &str =
    "return [...document.querySelectorAll('.case .tile img')].every(i => i.complete)";

/// Shows a page by its button at the bottom.
fn go(browser: &Browser, page: &str) {
    let ids = browser.run("return [...document.querySelectorAll('.page')].map(p => p.id)");
    let place = ids.as_array().expect("pages").iter().position(|id| id == page);
    let nth = place.expect("a page") + 1;
    browser.click(&format!("#pages li:nth-child({nth}) button"));
    assert_eq!(browser.run(SHOWN), json!([page]));
}

fn checked(browser: &Browser, name: &str) -> Value {
    browser.run(&format!(
        "return document.querySelector('input[name=\"{name}\"]:checked')?.value ?? null"
    ))
}

fn selected(browser: &Browser, ranking: usize) -> Value {
    browser.run(&format!(
        "return [...document.querySelectorAll('#ranking-{ranking} select')].map(s => s.value)"
    ))
}

fn notice(browser: &Browser) -> String {
    let text = browser.run("return document.getElementById('notice').textContent");
    text.as_str().expect("a text").to_owned()
}

/// Controls without a label and images without an alternative text.
fn nameless(browser: &Browser) -> Value {
    browser.run(
        "return [...document.querySelectorAll('main input, select, textarea')]
             .filter(e => e.labels.length === 0).map(e => e.id || e.name)
             .concat([...document.querySelectorAll('.tile img')].filter(i => !i.alt).map(i => i.id))
             .concat([...document.querySelectorAll('button')]
                 .filter(b => !b.textContent.trim() && !b.getAttribute('aria-label')).map(b => b.id))",
    )
}

#[test]
fn an_assessor_fills_the_form() {
    let Some(browser) = Browser::start() else {
        return;
    };
    let desk = desk();
    let key = desk.key("first");
    let page = desk.path("first/form/form.html");
    browser.open(&page);
    browser.wait(LOADED);
    let sizes = browser.run(
        "return [...document.querySelectorAll('.case .tile img')].map(i => [i.naturalWidth, i.naturalHeight])",
    );
    assert_eq!(sizes, json!(vec![[72, 120]; IMAGES]));
    assert_eq!(nameless(&browser), json!([]));
    let fetched = browser.run(
        "return performance.getEntriesByType('resource').map(e => e.name).filter(n => !n.startsWith('data:'))",
    );
    assert_eq!(fetched, json!([]), "nothing is fetched");

    // With the keyboard only: on to the first case, its second image, from the enlarged view.
    browser.type_into("#name", "A. B\u{e4}r");
    browser.run("document.getElementById('next').focus()");
    browser.press(ENTER);
    assert_eq!(browser.run(SHOWN), json!(["case-1"]));
    browser.run("document.querySelector('#case-1 .enlarge').focus()");
    browser.press(ENTER);
    let alt = "return document.getElementById('large-image').alt";
    assert_eq!(browser.run(alt), json!("Case 1, image 1"));
    browser.press(RIGHT);
    assert_eq!(browser.run(alt), json!("Case 1, image 2"));
    browser.press(ENTER);
    assert_eq!(browser.run("return document.getElementById('large').open"), json!(false));
    assert_eq!(checked(&browser, "image-1"), json!("2"));
    // The chosen image stands beside the statement; the first Next leads there.
    let same = "return document.getElementById('chosen-1').src === document.getElementById('image-1-2').src";
    assert_eq!(browser.run(same), json!(true));
    browser.click("#next");
    assert_eq!(browser.run(SHOWN), json!(["case-1"]));
    assert_eq!(browser.run("return document.activeElement.name"), json!("agreement-1"));
    browser.press(SPACE);
    assert_eq!(checked(&browser, "agreement-1"), json!("1"));
    // Another image is another question.
    browser.click("#case-1 input[name='image-1'][value='3']");
    assert_eq!(checked(&browser, "agreement-1"), Value::Null);
    assert!(notice(&browser).contains("please rate it"), "{}", notice(&browser));
    browser.click("#case-1 input[name='agreement-1'][value='2']");
    browser.type_into("#remark-1", "Grainy \u{1f600} \"so\"");

    let groups = key.groups();
    go(&browser, "ranking-1");
    let locked = browser.run("return document.querySelector('#ranking-1 .locked').textContent");
    assert!(locked.as_str().expect("text").contains("opens when"), "{locked}");
    for case in 2..=key.cases() {
        go(&browser, &format!("case-{case}"));
        let (image, degree) = (case % 4 + 1, 6 - case);
        browser.click(&format!("input[name='image-{case}'][value='{image}']"));
        browser.click(&format!("input[name='agreement-{case}'][value='{degree}']"));
    }
    // The answers outlive the page. A browser takes its time to tell its next process what a page has stored.
    browser.until("the answers are here again", || {
        browser.open(&page);
        browser.wait(LOADED);
        notice(&browser).contains("here again")
    });
    for (number, group) in (1..).zip(&groups) {
        go(&browser, &format!("ranking-{number}"));
        let [first, second] = [0, 1].map(|i| format!("#rank-{number}-{}", group[i]));
        browser.type_into(&first, "1");
        browser.click(&format!("{second} option[value='2']"));
        assert_eq!(selected(&browser, number), json!(["1", "2"]));
        // No ties: the ranks change places.
        browser.click(&format!("{second} option[value='1']"));
        assert_eq!(selected(&browser, number), json!(["2", "1"]));
    }
    go(&browser, "end");
    let told = browser.run("return document.getElementById('summary').textContent");
    assert_eq!(told, json!("All questions are answered. Thank you."));
    let file = save(&browser, &desk.path("saved.json"));
    let answers = Answers::read(&file, &key).expect("as the form saved it");
    assert_eq!(answers.assessor.name, "A. B\u{e4}r");
    assert_eq!(answers.cases[0].remark, "Grainy \u{1f600} \"so\"");
    let chosen: Vec<_> = answers.cases.iter().map(|c| (c.image, c.agreement)).collect();
    let made = [(3, 2), (3, 4), (4, 3), (1, 2)].map(|(a, b)| (Some(a), Some(b)));
    assert_eq!(chosen, made);
    for (ranking, group) in answers.rankings.iter().zip(&groups) {
        assert_eq!((&ranking.cases, ranking.complete()), (group, Some(vec![2, 1])));
    }
    assert_eq!(answers.missing(), [0; 3]);
    let args = ["study", "answers", "saved.json", "--key", "first/key.csv"];
    let (went_well, said) = program::insonify(desk.path("").as_path(), &args);
    assert!(went_well && said.contains("One assessor"), "{said}");

    // A file of answers restores a page; a changed file does not.
    go(&browser, "start");
    browser.click("#anew");
    browser.accept();
    assert_eq!(checked(&browser, "image-1"), Value::Null);
    let text = std::fs::read_to_string(&file).expect("a file");
    let changed = desk.path("changed.json");
    std::fs::write(&changed, text.replacen("\"agreement\": 2", "\"agreement\": 5", 1))
        .expect("written");
    for (file, said) in [
        (&changed, "was changed after it was saved"),
        (&page, "was not loaded"),
        (&file, "The answers of the file are here."),
    ] {
        browser.type_into("#load", &file.display().to_string());
        let script = "return document.getElementById('notice').textContent.includes";
        browser.wait(&format!("{script}({})", json!(said)));
        let expected = if file.ends_with("saved.json") { json!("3") } else { Value::Null };
        assert_eq!(checked(&browser, "image-1"), expected);
    }
    go(&browser, "end");
    let again = save(&browser, &desk.path("again.json"));
    let again = Answers::read(&again, &key).expect("as the form saved it");
    assert_eq!((again.response, again.cases), (answers.response, answers.cases));
}

/// A grey picture of one pixel.
fn pixel(grey: u8) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let image = image::GrayImage::from_pixel(1, 1, image::Luma([grey]));
    image.write_to(&mut out, image::ImageFormat::Png).expect("into memory");
    out.into_inner()
}

#[test]
fn a_form_of_full_size_shows_every_image() {
    let Some(browser) = Browser::start() else {
        return;
    };
    let question = Question {
        choose: "Which?".to_owned(),
        statement: "It is.".to_owned(),
        agreement: ["1", "2", "3", "4", "5"].map(str::to_owned),
        rank: "Order?".to_owned(),
    };
    let case = |n: u8| Case {
        title: format!("Case of a <test> & number {n}"),
        slice: String::new(),
        images: (0..23).map(|i| pixel(5 * n + i)).collect(),
    };
    // Cases 1, 10, 19 together, and so on.
    let groups: Vec<Vec<usize>> = (1..=9).map(|n| vec![n, n + 9, n + 18]).collect();
    let form = Form {
        study: "0123456789abcdef",
        title: "A study of full size",
        introduction: "",
        question: &question,
        cases: (1..=27).map(case).collect(),
        groups,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("form.html");
    std::fs::write(&page, form.html()).expect("written");
    browser.open(&page);
    browser.wait(LOADED);
    let count = browser.run(
        "return [...document.querySelectorAll('.case .tile img')].filter(i => i.naturalWidth === 1).length",
    );
    assert_eq!(count, json!(621));
    assert_eq!(nameless(&browser), json!([]));
    let counts = browser.run(
        "return ['.case', '.ranking', '.ranking select', 'input[type=radio]']
             .map(s => document.querySelectorAll(s).length)",
    );
    assert_eq!(counts, json!([27, 9, 27, 621 + 27 * 5]));
    let ids = browser.run("return [...document.querySelectorAll('[id]')].map(e => e.id)");
    let ids: Vec<_> = ids.as_array().expect("a list").iter().map(Value::to_string).collect();
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len(), "ids are unique");
    let about = browser.run("return document.querySelector('#case-7 .about').textContent");
    assert_eq!(about, json!("Case of a <test> & number 7"));
    // Last case, last image, by the assessor's buttons.
    go(&browser, "case-27");
    browser.click("input[name='image-27'][value='23']");
    let told = browser.run("return document.getElementById('progress-text').textContent");
    assert_eq!(told, json!("1 of 63 questions answered"));
}
