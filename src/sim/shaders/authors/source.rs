//! Kernels as source: variants, includes, flags and the hash of all of these. Needs no compiler, so that
//! a stale `spirv/` is noticed everywhere.
//!
//! A kernel's first line may be a directive:
//! - `// variants: bvh query(RAY_QUERY)` compiles it once per name, with the macros in parentheses
//!   (comma separated) defined, into `STEM_bvh` and `STEM_query`;
//! - `// keep names` compiles it without optimisation, which would strip the names; such a module
//!   is for reflection only and is not embedded in the program.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::Error;

/// The macro that turns a variant into one with hardware ray query: newer SPIR-V, no naga.
const RAY_QUERY: &str = "RAY_QUERY";

/// One module to compile.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Name of the module: `spirv/STEM.spv`.
    pub stem: String,
    /// The kernel's file name in the sources' folder.
    pub file: String,
    /// Macros defined for this variant.
    pub defines: Vec<String>,
    /// Compiled without optimisation so that names survive; not embedded.
    pub keep_names: bool,
}

impl Variant {
    /// True if it uses `GL_EXT_ray_query`: this needs SPIR-V 1.4, and naga cannot read it.
    pub fn ray_query(&self) -> bool {
        self.defines.iter().any(|d| d == RAY_QUERY)
    }

    /// Lowest Vulkan version that accepts the module, as spirv-val names it.
    pub fn target(&self) -> &'static str {
        if self.ray_query() { "vulkan1.2" } else { "vulkan1.1" }
    }

    /// Flags in the manner of glslc; part of the hash.
    pub fn flags(&self) -> String {
        let optimise = if self.keep_names { "-O0" } else { "-O" };
        let mut flags = format!("--target-env={} {optimise} -Werror", self.target());
        for define in &self.defines {
            flags += &format!(" -D{define}");
        }
        flags
    }
}

/// All modules that the kernels in `dir` (`*.comp`) give, sorted by stem.
pub fn variants(dir: &Path) -> Result<Vec<Variant>, Error> {
    let mut variants = Vec::new();
    for entry in fs::read_dir(dir).map_err(|e| file_error(dir, e))? {
        let path = entry.map_err(|e| file_error(dir, e))?.path();
        if path.extension().is_some_and(|x| x == "comp") {
            variants.extend(variants_of(&path)?);
        }
    }
    variants.sort_by(|a, b| a.stem.cmp(&b.stem));
    Ok(variants)
}

fn variants_of(path: &Path) -> Result<Vec<Variant>, Error> {
    let text = read(path)?;
    let first = text.lines().next().unwrap_or_default();
    let name =
        |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, file) = (name(path.file_stem()), name(path.file_name()));
    let variant = |suffix: &str, defines| Variant {
        stem: format!("{stem}{suffix}"),
        file: file.clone(),
        defines,
        keep_names: first.trim() == "// keep names",
    };
    let Some(list) = first.strip_prefix("// variants:") else {
        return Ok(vec![variant("", Vec::new())]);
    };
    let words = split_outside_parentheses(list);
    let bad = |message: &str| Error::Source {
        file: path.to_owned(),
        line: 1,
        message: format!("{message}; write e.g. `// variants: bvh query(RAY_QUERY)`"),
    };
    if words.is_empty() {
        return Err(bad("no variants after `// variants:`"));
    }
    let mut found = Vec::new();
    for word in words {
        let (name, defines) = match word.split_once('(') {
            Some((name, rest)) => match rest.strip_suffix(')') {
                Some(list) => (name, list.split(',').map(|d| d.trim().to_owned()).collect()),
                None => return Err(bad(&format!("'{word}' lacks its closing parenthesis"))),
            },
            None => (word.as_str(), Vec::new()),
        };
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Err(bad(&format!("'{word}' is no variant name")));
        }
        found.push(variant(&format!("_{name}"), defines));
    }
    Ok(found)
}

fn split_outside_parentheses(list: &str) -> Vec<String> {
    let mut depth = 0;
    let mut words = vec![String::new()];
    for c in list.chars() {
        depth += i32::from(c == '(') - i32::from(c == ')');
        if c.is_whitespace() && depth == 0 {
            words.push(String::new());
        } else if let Some(word) = words.last_mut() {
            word.push(c);
        }
    }
    words.retain(|w| !w.is_empty());
    words
}

/// The text of kernel `file` of `dir` and of everything that it includes, by file name. Includes
/// behind `#ifdef` count too: a superset is safe, for the hash and for watching.
pub fn files(dir: &Path, file: &str) -> Result<BTreeMap<String, String>, Error> {
    let mut found = BTreeMap::from([(file.to_owned(), read(&dir.join(file))?)]);
    let mut open = vec![file.to_owned()];
    while let Some(name) = open.pop() {
        let text = found[&name].clone();
        for (index, line) in text.lines().enumerate() {
            let Some(include) = line.trim_start().strip_prefix("#include") else {
                continue;
            };
            let include = include.trim().trim_matches('"');
            if found.contains_key(include) {
                continue;
            }
            let text = read(&dir.join(include)).map_err(|error| Error::Source {
                file: dir.join(&name),
                line: index + 1,
                message: format!("include not found: {error}"),
            })?;
            found.insert(include.to_owned(), text);
            open.push(include.to_owned());
        }
    }
    Ok(found)
}

/// Hash of everything on which a module's bytes depend: sources, includes, flags and `compiler`.
pub fn hash(dir: &Path, variant: &Variant, compiler: &str) -> Result<String, Error> {
    let mut text = format!("{compiler}\n{}\n", variant.flags());
    for (name, content) in files(dir, &variant.file)? {
        text += &format!("{name} {}\n{content}", content.len());
    }
    Ok(fnv1a(text.as_bytes()))
}

/// FNV-1a, 64 bits, hexadecimal. It detects changes; it does not protect against attacks.
/// <https://www.rfc-editor.org/rfc/rfc9923>
pub fn fnv1a(bytes: &[u8]) -> String {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    format!("{hash:016x}")
}

fn read(path: &Path) -> Result<String, Error> {
    fs::read_to_string(path).map_err(|e| file_error(path, e))
}

pub(crate) fn file_error(path: impl Into<PathBuf>, cause: std::io::Error) -> Error {
    Error::File { path: path.into(), cause }
}
