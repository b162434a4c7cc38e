//! Rules for the sources as a whole: who writes standard error, who needs a certain system, who holds the lock of Vulkan's
//! loader.

use std::path::{Path, PathBuf};

use crate::common::limited::files;

/// The Rust sources below folders, each with its text.
fn sources(folders: &[&str]) -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let is_source = |path: &Path| path.extension().is_some_and(|e| e == "rs");
    let paths = folders.iter().flat_map(|folder| files(&root.join(folder), is_source));
    let read = |path: PathBuf| (path.clone(), std::fs::read_to_string(path).expect("a source"));
    let found: Vec<_> = paths.map(read).collect();
    assert!(found.len() > 20, "{} sources in {folders:?}", found.len());
    found
}

/// `eprintln!` panics where nobody reads standard error any more; `output::note` does not.
#[test]
fn standard_error_is_written_by_one_module() {
    for (path, text) in sources(&["src"]) {
        assert!(!text.contains("eprint"), "{}: write `output::note`", path.display());
    }
}

/// Parts of a source that Windows or macOS has not.
const OF_ONE_SYSTEM: [&str; 6] = ["os::unix", "os::linux", "os::fd", "libc::", "\"/proc", "\"/dev"];

/// Lines of a source, without the tests at its end, that need one system.
fn bound_to_one_system(source: &str) -> Vec<&str> {
    let code = source.split("#[cfg(test)]").next().expect("a part");
    code.lines().filter(|line| OF_ONE_SYSTEM.iter().any(|word| line.contains(word))).collect()
}

/// Windows and macOS are not ruled out: docs/install.md says what they need.
#[test]
fn one_module_alone_needs_a_certain_system() {
    for (path, text) in sources(&["src", "python/src"]) {
        if !path.ends_with("tests.rs") {
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

/// Calls that make Vulkan's loader read or change its lists of instances and devices.
const LOADER_CALLS: [&str; 14] = [
    "::Instance::new(",
    "::Device::new(",
    ".create_instance(",
    ".destroy_instance(",
    ".create_device(",
    ".destroy_device(",
    ".enumerate_physical_devices(",
    ".enumerate_device_extension_properties(",
    ".create_debug_utils_messenger(",
    ".destroy_debug_utils_messenger(",
    ".set_debug_utils_object_name(",
    "ash_window::create_surface(",
    ".destroy_surface(",
    ".create_swapchain(",
];

/// Functions of a source, as rustfmt lays them out: from the line with `fn` to the brace of the same indentation.
fn functions(source: &str) -> Vec<String> {
    let lines: Vec<&str> = source.lines().collect();
    let indentation = |line: &str| line.len() - line.trim_start().len();
    let begins = |line: &str| {
        let mut words = line.trim_start().split(' ').take_while(|word| !word.contains("fn"));
        let before_name = ["pub", "pub(super)", "pub(crate)", "unsafe", "const", "extern", "\"C\""];
        line.contains("fn ") && words.all(|word| before_name.contains(&word))
    };
    let one = |(first, line): (usize, &&str)| {
        let end = format!("{}}}", " ".repeat(indentation(line)));
        let rest = lines[first + 1..].iter().position(|line| *line == end).unwrap_or(0);
        let last =
            if line.ends_with('}') || line.ends_with(';') { first } else { first + 1 + rest };
        lines[first..=last].join("\n")
    };
    lines.iter().enumerate().filter(|(_, line)| begins(line)).map(one).collect()
}

/// Functions that make such a call without the lock, each with the call.
fn unlocked(source: &str) -> Vec<String> {
    let locks =
        |text: &str| ["loader_reads()", "loader_changes()"].iter().any(|l| text.contains(l));
    let calls = |text: String| -> Vec<String> {
        let calls = LOADER_CALLS.iter().filter(|call| text.contains(*call));
        calls.map(|call| format!("{call} in\n{text}")).collect()
    };
    functions(source).into_iter().filter(|text| !locks(text)).flat_map(calls).collect()
}

/// The loader's own locks do not keep one thread from destroying what another one reads (`gpu::instance`).
#[test]
fn calls_into_the_loader_hold_its_lock() {
    let mut calls = 0;
    for (path, text) in sources(&["src/gpu"]) {
        let found = unlocked(&text);
        assert!(found.is_empty(), "{}: {found:?}", path.display());
        let all = functions(&text).concat();
        let outside = LOADER_CALLS.iter().map(|call| text.matches(call).count());
        let inside = LOADER_CALLS.iter().map(|call| all.matches(call).count());
        calls += outside.clone().sum::<usize>();
        assert!(inside.ge(outside), "{}: a call in no function that is found", path.display());
    }
    assert!(calls > 10, "{calls} calls in the gpu crate");
    for planted in [
        "fn f() { let functions = khr::swapchain::Device::new(&instance.raw, &raw); }",
        "impl Drop for D {\n    fn drop(&mut self) {\n        unsafe { self.raw.destroy_device(None) }\n    }\n}",
        "pub(super) fn f(\n    a: u32,\n) {\n    unsafe { instance.raw.enumerate_physical_devices() }\n}\n\
         fn g() {\n    let _reading = loader_reads();\n}",
    ] {
        assert_eq!(unlocked(planted).len(), 1, "{planted}");
    }
    let locked =
        "fn f() {\n    let _r = loader_reads();\n    khr::swapchain::Device::new(&a, &b);\n}";
    assert_eq!((functions(locked).len(), unlocked(locked)), (1, vec![]));
}
