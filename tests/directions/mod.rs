//! Dependencies between the folders of `src` that one crate holds, and of the twins: the table of ARCHITECTURE.md, held against the
//! paths in the code. Those between crates the compiler holds.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

mod loader;
mod uses;

use uses::Uses;

/// Begins the table in ARCHITECTURE.md.
const HEADER: &str = "| folder | uses |";

/// Folders or files of `src/`, each with the modules it may use: `scene`, or more narrowly `scene::tracker`.
type Table = Vec<(String, Vec<String>)>;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn table() -> Table {
    let map = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("the map");
    let (_, rows) = map.split_once(HEADER).expect("ARCHITECTURE.md has the table");
    let rows = rows.lines().skip(2).take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        // What stands between backticks.
        let names = |cell: &str| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        let mut cells = line.split('|').skip(1);
        let mut folders: Vec<String> = names(cells.next().expect("a folder"));
        assert_eq!(folders.len(), 1, "one folder a row: {line}");
        (folders.remove(0), names(cells.next().expect("what it uses")))
    };
    rows.map(row).collect()
}

fn covers(allowed: &str, used: &str) -> bool {
    used == allowed || used.strip_prefix(allowed).is_some_and(|rest| rest.starts_with("::"))
}

/// Uses that the table does not allow, and permissions that no code needs.
fn differences(table: &Table, found: &BTreeMap<String, Uses>) -> Vec<String> {
    let mut out = Vec::new();
    for (folder, uses) in found {
        let Some((_, allowed)) = table.iter().find(|(name, _)| name == folder) else {
            out.push(format!("`{folder}` has no row in ARCHITECTURE.md"));
            continue;
        };
        let outside = |used: &&String| !covers(folder, used);
        for (used, place) in uses.paths.iter().filter(|(used, _)| outside(used)) {
            if !allowed.iter().any(|a| covers(a, used)) {
                out.push(format!("{place}: `{folder}` uses `{used}`"));
            }
        }
        for name in allowed.iter().filter(|a| !uses.paths.keys().any(|used| covers(a, used))) {
            out.push(format!("`{folder}` does not use `{name}`: take it out of ARCHITECTURE.md"));
        }
    }
    let gone = table.iter().filter(|(folder, _)| !found.contains_key(folder));
    out.extend(gone.map(|(folder, _)| format!("`{folder}` of ARCHITECTURE.md is not there")));
    out
}

#[test]
fn folders_use_what_the_map_says_and_nothing_else() {
    let mut found = BTreeMap::new();
    for library in ["src/scene/lib.rs", "src/lab/lib.rs"].map(|file| root().join(file)) {
        let mut modules = uses::of_library(&library);
        // What crates below have.
        let below = uses::passed_on(&library);
        assert!(below.contains(&"issue".to_owned()), "{below:?}");
        for uses in modules.values_mut() {
            uses.paths.retain(|used, _| !below.iter().any(|module| covers(module, used)));
        }
        found.extend(modules);
    }
    let twins = uses::of_module(&root().join("tools/reference.rs"), "reference");
    found.insert("reference".to_owned(), twins);
    let wrong = differences(&table(), &found);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn each_row_uses_rows_above_it_so_that_there_is_no_circle() {
    // Those of crates below are above all.
    let mut above: BTreeSet<String> =
        uses::passed_on(&root().join("src/lib.rs")).into_iter().collect();
    let tabled = table();
    above.retain(|module| !tabled.iter().any(|(folder, _)| folder == module));
    for (folder, uses) in tabled {
        for used in uses {
            let top = used.split("::").next().expect("a name").to_owned();
            assert!(above.contains(&top), "`{folder}` uses `{used}`, which is not above it");
        }
        assert!(above.insert(folder.clone()), "`{folder}` has two rows");
    }
}

/// `eprintln!` panics where nobody reads standard error any more; `output::note` does not.
#[test]
fn standard_error_is_written_by_one_module() {
    let mut todo = vec![root().join("src")];
    while let Some(path) = todo.pop() {
        if path.is_dir() {
            let entries = fs::read_dir(&path).expect("a folder");
            todo.extend(entries.map(|entry| entry.expect("an entry").path()));
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&path).expect("a source");
            assert!(!text.contains("eprint"), "{}: write `output::note`", path.display());
        }
    }
}

/// What Windows or macOS has not, as it stands in sources.
const OF_ONE_SYSTEM: [&str; 6] = ["os::unix", "os::linux", "os::fd", "libc::", "\"/proc", "\"/dev"];

/// Lines of a source, without the tests at its end, that need one system.
fn bound_to_one_system(source: &str) -> Vec<&str> {
    let code = source.split("#[cfg(test)]").next().expect("a part");
    code.lines().filter(|line| OF_ONE_SYSTEM.iter().any(|word| line.contains(word))).collect()
}

/// Windows and macOS are not ruled out: docs/install.md says what they need.
#[test]
fn one_module_alone_needs_a_certain_system() {
    let mut todo: Vec<_> = ["src", "python/src"].map(|folder| root().join(folder)).into();
    while let Some(path) = todo.pop() {
        if path.is_dir() {
            let entries = fs::read_dir(&path).expect("a folder");
            todo.extend(entries.map(|entry| entry.expect("an entry").path()));
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            let text = fs::read_to_string(&path).expect("a source");
            let found = bound_to_one_system(&text);
            let allowed = path.ends_with("gpu/process.rs");
            assert_eq!(!found.is_empty(), allowed, "{}: {found:?}", path.display());
        }
    }
    for planted in
        ["use std::os::unix::fs::PermissionsExt;", "libc::getpid()", "read(\"/proc/self/maps\")"]
    {
        assert_eq!(bound_to_one_system(planted), [planted]);
    }
    assert!(bound_to_one_system("a // b\n#[cfg(test)]\nuse std::os::unix::fs;").is_empty());
}

#[test]
fn a_planted_use_is_found_however_it_is_written() {
    let table = vec![("low".to_owned(), vec!["ground".to_owned(), "high::floor".to_owned()])];
    let said = |source: &str| {
        let found = BTreeMap::from([("low".to_owned(), uses::of_source("low::deep", source))]);
        differences(&table, &found).join("\n")
    };
    // Both permissions are needed; otherwise the test would report one.
    let sound =
        "use crate::ground::A; use crate::high::floor::{self, B}; use crate::low::C; use super::D;";
    assert_eq!(said(sound), "");
    for planted in [
        "use crate::high::E;",
        "use crate::{ground::F,\n    high::{\n        floor, roof},\n};",
        "use super::super::high::roof;",
        "mod inner { use super::super::super::high::roof; }",
        "fn f() -> u32 { crate::high::g() }",
        "fn f(h: crate::high::H) {}",
        "fn f() { println!(\"{}\", crate::high::g()); }",
        "impl crate::high::H for u32 {}",
        "pub use crate::high as other;",
    ] {
        let wrong = said(&format!("{sound} {planted}"));
        assert!(wrong.contains("`low` uses `high"), "{planted}: {wrong}");
    }
    for harmless in [
        "// use crate::high::E;",
        "/// As [`crate::high::E`] does.\nfn f() {}",
        "const TEXT: &str = \"crate::high::E\";",
        "#[cfg(test)] mod tests { use crate::high::E; }",
        "#[cfg(test)] use crate::high::E;",
        "use super::high::E;",
    ] {
        assert_eq!(said(&format!("{sound} {harmless}")), "", "{harmless}");
    }
    assert!(said("use crate::ground::A;").contains("does not use `high::floor`"));
}
