//! Checks that `spirv/` is compiled from `glsl/`, and that every module is valid. Needs no GLSL compiler.

use std::fs;
use std::path::{Path, PathBuf};

use insonify::sim::shaders::Library;

#[cfg(feature = "compile")]
use insonify::sim::shaders::authors;
// A user's build does not contain it, nor does the library that is tested without `compile`.
#[cfg(not(feature = "compile"))]
#[allow(dead_code)]
#[path = "../src/sim/shaders/authors/mod.rs"]
mod authors;

use authors::{bytes_of, source, stamp, validate};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn compiler() -> String {
    stamp::compiler(&fs::read_to_string(root().join("Cargo.lock")).unwrap())
}

fn module(stem: &str) -> Vec<u8> {
    fs::read(root().join("spirv").join(format!("{stem}.spv"))).unwrap()
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
    }
}

#[test]
fn no_module_is_stale() {
    let found =
        stamp::differences(&root().join("glsl"), &root().join("spirv"), &compiler()).unwrap();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Places of a device's own trigonometry in a module: Sin (13) to Acosh, Atanh and Atan2 (25) of
/// GLSL.std.450, the only set of extended instructions in use.
fn trigonometry(words: &[u32]) -> Vec<usize> {
    const EXTENDED_INSTRUCTION: u32 = 12;
    let mut found = Vec::new();
    let mut at = 5;
    while at < words.len() {
        let (length, opcode) = (words[at] >> 16, words[at] & 0xffff);
        if opcode == EXTENDED_INSTRUCTION && (13..=25).contains(&words[at + 4]) {
            found.push(at);
        }
        at += length as usize;
    }
    found
}

#[test]
fn no_kernel_relies_on_the_trigonometry_of_a_device() {
    let library = Library::embedded();
    for stem in library.stems() {
        let found = trigonometry(library.words(stem));
        assert!(
            found.is_empty(),
            "{stem}: a sine may be 2^-11 off; use glsl/angles.glsl (words {found:?})"
        );
    }
    // Behind a header: x = Floor(y), then Cos(y).
    let planted = [0, 0, 0, 0, 0, 6 << 16 | 12, 1, 2, 3, 8, 4, 6 << 16 | 12, 1, 5, 3, 14, 4];
    assert_eq!(trigonometry(&planted), [11]);
}

#[test]
fn every_way_of_being_stale_is_noticed() {
    let dir = tempfile::tempdir().unwrap();
    let (glsl, spirv) = (dir.path().join("glsl"), dir.path().join("spirv"));
    copy(&root().join("glsl"), &glsl);
    copy(&root().join("spirv"), &spirv);
    let found = || stamp::differences(&glsl, &spirv, &compiler()).unwrap().join("\n");
    assert_eq!(found(), "");

    let edit = |path: PathBuf, change: &dyn Fn(Vec<u8>) -> Vec<u8>, expected: &[&str]| {
        let good = fs::read(&path).unwrap();
        fs::write(&path, change(good.clone())).unwrap();
        for text in expected {
            assert!(found().contains(text), "'{text}' not in: {}", found());
        }
        fs::write(&path, good).unwrap();
        assert_eq!(found(), "", "restored");
    };
    let append = |mut bytes: Vec<u8>| {
        bytes.extend(b"\n// later\n");
        bytes
    };
    let flip = |mut bytes: Vec<u8>| {
        *bytes.last_mut().unwrap() ^= 1;
        bytes
    };
    let older = "older than its sources";
    edit(glsl.join("darken.comp"), &append, &[&format!("darken.spv: {older}")]);
    // An include: everything that uses it is stale, directly or not.
    let by_include = [format!("geometry.spv: {older}"), format!("trace_query.spv: {older}")];
    edit(glsl.join("probe.glsl"), &append, &[&by_include[0], &by_include[1]]);
    edit(spirv.join("darken.spv"), &flip, &["darken.spv: not the bytes"]);
    let other_flags = |bytes: Vec<u8>| {
        let text = String::from_utf8(bytes).unwrap();
        text.replace("query(RAY_QUERY)", "query(RAY_QUERY,MORE)").into_bytes()
    };
    edit(glsl.join("trace.comp"), &other_flags, &["trace_query.spv: older"]);

    fs::write(spirv.join("orphan.spv"), b"").unwrap();
    assert!(found().contains("orphan.spv: no kernel gives it"), "{}", found());
    fs::remove_file(spirv.join("orphan.spv")).unwrap();
    fs::remove_file(glsl.join("darken.comp")).unwrap();
    assert!(found().contains("darken: stamped, but no kernel"), "{}", found());
    fs::write(glsl.join("extra.comp"), b"void main() {}").unwrap();
    assert!(found().contains("extra: not compiled"), "{}", found());
    let other = stamp::differences(&glsl, &spirv, "shaderc-sys 0.0.0").unwrap();
    assert!(other.join("\n").contains("geometry.spv: older"));
}

#[test]
fn every_kernel_is_embedded_and_nothing_else() {
    let library = Library::embedded();
    let variants = source::variants(&root().join("glsl")).unwrap();
    let kernels: Vec<_> = variants.iter().filter(|v| !v.keep_names).map(|v| &v.stem).collect();
    assert_eq!(library.stems().collect::<Vec<_>>(), kernels);
    for stem in kernels {
        assert_eq!(bytes_of(library.words(stem)), module(stem), "{stem}");
    }
}

#[test]
fn naga_and_spirv_val_accept_every_module() {
    let mut by_naga = 0;
    for variant in source::variants(&root().join("glsl")).unwrap() {
        let bytes = module(&variant.stem);
        if !variant.ray_query() {
            validate::naga(&variant.stem, &bytes).unwrap();
            by_naga += 1;
        }
        let checked = validate::spirv_val(&variant.stem, &bytes, variant.target()).unwrap();
        assert!(checked, "spirv-val is not installed (Debian: apt-get install spirv-tools)");
    }
    assert!(by_naga > 0);
}

#[test]
fn an_invalid_module_is_refused() {
    let mut bytes = module("geometry");
    // The last instruction is OpFunctionEnd; without it the function never ends.
    bytes.truncate(bytes.len() - 4);
    let error = validate::naga("cut", &bytes).unwrap_err().to_string();
    assert!(error.starts_with("cut: refused by naga"), "{error}");
    let error = validate::spirv_val("cut", &bytes, "vulkan1.1").unwrap_err().to_string();
    assert!(error.starts_with("cut: refused by spirv-val"), "{error}");
    // A ray-query module is valid, but not for the older target and not for naga.
    let bytes = module("trace_query");
    assert!(validate::naga("trace_query", &bytes).is_err());
    assert!(validate::spirv_val("trace_query", &bytes, "vulkan1.1").is_err());
}

#[test]
fn malformed_directives_and_includes_name_the_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bad.comp");
    for first in ["// variants:", "// variants: a(B", "// variants: a-b"] {
        fs::write(&path, format!("{first}\nvoid main() {{}}\n")).unwrap();
        let error = source::variants(dir.path()).unwrap_err().to_string();
        assert!(error.contains("bad.comp:1: ") && error.contains("write e.g."), "{error}");
    }
    fs::write(&path, "#version 460\n#include \"absent.glsl\"\n").unwrap();
    let error = source::files(dir.path(), "bad.comp").unwrap_err().to_string();
    assert!(error.contains("bad.comp:2: include not found"), "{error}");
}
