//! `docs/scenes.md` against the program: every key with its type, default, range and meaning, units, presets and shipped
//! tissues, and the examples.

use std::path::Path;

use insonify::scene::check;

mod settings;

/// Loads the examples as `insonify check` does, each beside the shipped meshes that it names.
fn of_examples(document: &str) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut faults = Vec::new();
    let examples = document.split("```toml\n").skip(1);
    for example in examples.map(|e| e.split("```").next().unwrap_or_default()) {
        let folder = tempfile::tempdir().expect("a folder");
        for mesh in example.lines().filter_map(|l| l.strip_prefix("file = ")) {
            let mesh = mesh.trim_matches('"');
            let to = folder.path().join(mesh);
            std::fs::create_dir_all(to.parent().expect("a folder")).expect("made");
            std::fs::copy(root.join(mesh), to).expect(mesh);
        }
        let file = folder.path().join("example.toml");
        std::fs::write(&file, example).expect("written");
        let report = check::report(&file);
        if !report.passed() || !report.issues.is_empty() {
            faults.push(format!("example: {report}\n{:?}", report.error));
        }
    }
    faults
}

fn document() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenes.md");
    std::fs::read_to_string(path).expect("the document")
}

/// Compares the text lines that follow from the program with the document, or writes them there.
#[test]
fn the_reference_says_what_the_program_does() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenes.md");
    let real = document();
    let written = |document: &str| settings::written(document, &settings::lines(document));
    let wanted = written(&real);
    if std::env::var_os("INSONIFY_BLESS").is_some() {
        return std::fs::write(path, wanted).expect("written");
    }
    let remedy = "INSONIFY_BLESS=1 cargo test --test cpu docs writes it";
    assert!(real == wanted, "docs/scenes.md is not up to date: {remedy}");
    // No table of keys is written by hand.
    let mut tables: Vec<_> = settings::lines(&real).into_iter().map(|line| line.table()).collect();
    tables.dedup();
    let keys = tables.iter().filter(|(_, head)| *head == "Key").count();
    assert_eq!(real.matches("\n| Key |").count(), keys);
    // A line with another text, a missing one, and one too many; of a setting and of geometry.
    for (key, from, to) in [("paths", "65535", "65536"), ("spacing", "0.1 mm", "0.2 mm")] {
        let start = format!("| `{key}` |");
        let line = real.lines().find(|line| line.starts_with(&start)).expect("a row");
        let line = format!("{line}\n");
        for planted in [line.replace(from, to), String::new(), format!("{line}| `pathz` |\n")] {
            let wrong = real.replace(&line, &planted);
            assert!(wrong != real && written(&wrong) == real, "{planted}");
        }
    }
}

#[test]
fn the_examples_of_the_reference_load() {
    let real = document();
    assert_eq!(real.matches("```toml").count(), 4);
    assert_eq!(of_examples(&real), [""; 0]);
    let wrong = real.replace("paths = 16", "pathz = 16");
    assert_eq!(of_examples(&wrong).len(), 1);
}

/// Files that the commands of a document write, and that would be left in the repository.
fn left_behind(document: &str) -> Vec<String> {
    let shells =
        document.split("```sh\n").skip(1).map(|s| s.split("```").next().unwrap_or_default());
    let mut left = Vec::new();
    for command in shells.flat_map(str::lines) {
        let command = command.split(" #").next().unwrap_or_default();
        let words: Vec<_> = command.split_whitespace().collect();
        let written = words.windows(2).filter(|pair| {
            ["-o", "--output", "--json", "--dump", "--labels", "--volume", "--captures"]
                .contains(&pair[0])
        });
        let outside = written.map(|pair| pair[1]).filter(|path| !path.starts_with("out/"));
        left.extend(outside.map(str::to_owned));
        let is_render = command.contains("insonify render");
        if is_render && !words.contains(&"-o") {
            left.push(format!("{command} names no file"));
        }
    }
    left
}

#[test]
fn the_readme_s_commands_leave_nothing_in_the_repository() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |name: &str| std::fs::read_to_string(root.join(name)).expect(name);
    let readme = read("README.md");
    assert!(readme.matches(" out/").count() >= 5, "they write there");
    assert_eq!(left_behind(&readme), Vec::<String>::new());
    assert!(read(".gitignore").lines().any(|line| line == "/out"));
    let planted = "```sh\ninsonify render a -o b.png\ninsonify render a # -o out/b.png\n```\n";
    assert_eq!(left_behind(planted).len(), 2);
}
