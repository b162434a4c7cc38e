//! Dependencies between modules (ARCHITECTURE.md), read from the sources.

use std::path::Path;

/// Modules, and the crate's modules that each must not name.
const FORBIDDEN: [(&str, &[&str]); 5] = [
    ("gpu", &["scene", "probe", "sim", "reference", "harness", "view"]),
    ("scene", &["gpu", "sim", "reference", "harness", "view"]),
    ("probe", &["gpu", "sim", "reference", "harness", "view"]),
    ("reference", &["gpu", "harness", "view"]),
    ("sim", &["harness", "view"]),
];

fn offences(source: &str, forbidden: &[&str]) -> Vec<String> {
    let used = |line: &str, module: &str| {
        line.match_indices("crate::").any(|(at, found)| {
            let rest = line[at + found.len()..].trim_start_matches('{');
            rest.split([',', '}']).any(|path| {
                path.trim()
                    .split("::")
                    .next()
                    .is_some_and(|first| first.trim_end_matches(';') == module)
            })
        })
    };
    source
        .lines()
        .filter(|line| forbidden.iter().any(|module| used(line, module)))
        .map(str::to_owned)
        .collect()
}

fn sources(dir: &Path, out: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(dir).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

#[test]
fn modules_use_only_what_lies_below_them() {
    for (module, forbidden) in FORBIDDEN {
        let mut files = Vec::new();
        sources(&Path::new("src").join(module), &mut files);
        assert!(!files.is_empty(), "{module} has sources");
        for file in files {
            let text = std::fs::read_to_string(&file).expect("a source");
            // A module's own tests may compare with other layers.
            let code = text.split("#[cfg(test)]").next().expect("some text");
            let found = offences(code, forbidden);
            assert!(found.is_empty(), "{}: {found:?}", file.display());
        }
    }
}

#[test]
fn unsafe_code_stays_in_gpu() {
    let mut files = Vec::new();
    sources(Path::new("src"), &mut files);
    sources(Path::new("tools"), &mut files);
    for file in files.iter().filter(|f| !f.starts_with("src/gpu")) {
        let text = std::fs::read_to_string(file).expect("a source");
        let found: Vec<_> =
            text.lines().filter(|l| l.contains("unsafe {") || l.contains("unsafe fn")).collect();
        assert!(found.is_empty(), "{}: {found:?}", file.display());
    }
}

#[test]
fn a_planted_use_is_noticed() {
    assert_eq!(offences("use crate::gpu::Device;", &["gpu"]).len(), 1);
    assert_eq!(offences("use crate::{scene::Scene, gpu::Device};", &["gpu"]).len(), 1);
    assert!(offences("use crate::scene::Scene; // gpu", &["gpu"]).is_empty());
}
