//! The compiled kernels: embedded modules, the stamp of their sources, and reloading.
//!
//! `spirv/` is checked in, so that nobody but an author of kernels needs a GLSL compiler.
//! `tools/compile.rs` writes it; `tests/spirv.rs` fails when it is stale or invalid.

#[cfg(feature = "compile")]
pub mod authors;
#[cfg(feature = "compile")]
mod reload;

use std::collections::BTreeMap;

/// Stem and bytes of every kernel that the program uses; written by `tools/compile.rs`.
const EMBEDDED: &[(&str, &[u8])] = include!("../../spirv/embedded.rs");

/// The SPIR-V of every kernel: the embedded modules, or (feature `compile`) the last ones that
/// compiled from a folder of sources.
pub struct Library {
    words: BTreeMap<String, Vec<u32>>,
    #[cfg(feature = "compile")]
    watched: Option<reload::WatchedSources>,
}

impl Library {
    /// The kernels that the program was built with.
    pub fn embedded() -> Self {
        let words =
            EMBEDDED.iter().map(|(stem, bytes)| ((*stem).to_owned(), words_of(bytes))).collect();
        Self {
            words,
            #[cfg(feature = "compile")]
            watched: None,
        }
    }

    /// SPIR-V of the kernel variant `stem` (`beam`, `trace_bvh`, `trace_query`).
    ///
    /// # Panics
    /// When there is no such kernel: stems are literals in `sim`.
    pub fn words(&self, stem: &str) -> &[u32] {
        self.words
            .get(stem)
            .unwrap_or_else(|| panic!("no kernel '{stem}' in spirv/; run tools/compile.rs"))
    }

    /// All stems, sorted.
    pub fn stems(&self) -> impl Iterator<Item = &str> {
        self.words.keys().map(String::as_str)
    }
}

/// Little-endian bytes of a SPIR-V file as words.
///
/// # Panics
/// When the length is no multiple of 4.
pub fn words_of(bytes: &[u8]) -> Vec<u32> {
    let (words, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty(), "SPIR-V is whole words");
    words.iter().map(|w| u32::from_le_bytes(*w)).collect()
}
