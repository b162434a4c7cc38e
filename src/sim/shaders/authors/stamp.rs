//! `spirv/stamp.json`: hashes of the sources of each module, and of the resulting bytes.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Error;
use super::source::{self, file_error, fnv1a};

/// Name of the stamp in the folder of modules.
pub const FILE: &str = "stamp.json";
/// Name of the generated table of embedded modules.
pub const TABLE: &str = "embedded.rs";
const REMEDY: &str =
    "run `SHADERC_LIB_DIR=$(./tools/shaderc.sh) cargo run --features compile --bin compile`";

/// Hashes of one module.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuleHashes {
    /// Hash of sources, includes, flags and compiler.
    pub source: String,
    /// Hash of the module's bytes.
    pub spirv: String,
}

/// The compiler's name and version for the hash, from `Cargo.lock` (the static library is built
/// from that crate's own sources, see tools/shaderc.sh).
pub fn compiler(lock: &str) -> String {
    let mut lines = lock.lines();
    lines
        .find(|l| *l == "name = \"shaderc-sys\"")
        .and_then(|_| lines.next())
        .map(|l| format!("shaderc-sys {}", l.trim_start_matches("version = ").trim_matches('"')))
        .expect("Cargo.lock lists shaderc-sys")
}

/// The stamp's text, one module a line so that git merges it.
pub fn text(entries: &BTreeMap<String, ModuleHashes>) -> String {
    let lines: Vec<_> = entries
        .iter()
        .map(|(stem, ModuleHashes { source, spirv })| {
            format!("  \"{stem}\": {{ \"source\": \"{source}\", \"spirv\": \"{spirv}\" }}")
        })
        .collect();
    format!("{{\n{}\n}}\n", lines.join(",\n"))
}

/// The differences between the modules in `spirv` and what `glsl` compiled by `compiler` would
/// give, each with its remedy; empty if all modules are current.
pub fn differences(glsl: &Path, spirv: &Path, compiler: &str) -> Result<Vec<String>, Error> {
    let path = spirv.join(FILE);
    let text = fs::read_to_string(&path).map_err(|e| file_error(&path, e))?;
    let mut stamped: BTreeMap<String, ModuleHashes> = match serde_json::from_str(&text) {
        Ok(stamped) => stamped,
        Err(error) => return Ok(vec![format!("{}: {error}; {REMEDY}", path.display())]),
    };
    let variants = source::variants(glsl)?;
    let mut found = Vec::new();
    for variant in &variants {
        let stem = &variant.stem;
        let Some(entry) = stamped.remove(stem) else {
            found.push(format!("{stem}: not compiled; {REMEDY}"));
            continue;
        };
        if entry.source != source::hash(glsl, variant, compiler)? {
            found.push(format!("{stem}.spv: older than its sources or compiler; {REMEDY}"));
        }
        match fs::read(spirv.join(format!("{stem}.spv"))) {
            Ok(bytes) if fnv1a(&bytes) == entry.spirv => {}
            Ok(_) => found.push(format!("{stem}.spv: not the bytes that were stamped; {REMEDY}")),
            Err(error) => found.push(format!("{stem}.spv: {error}; {REMEDY}")),
        }
    }
    for stem in stamped.keys() {
        found.push(format!("{stem}: stamped, but no kernel gives it; {REMEDY}"));
    }
    for entry in fs::read_dir(spirv).map_err(|e| file_error(spirv, e))? {
        let path = entry.map_err(|e| file_error(spirv, e))?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        if path.extension().is_some_and(|x| x == "spv") && variants.iter().all(|v| v.stem != stem) {
            found.push(format!("{stem}.spv: no kernel gives it; {REMEDY}"));
        }
    }
    Ok(found)
}
