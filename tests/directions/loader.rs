//! Calls that make Vulkan's loader read or change its lists of instances and devices hold the lock for that
//! (`gpu::instance`): the loader's own locks do not keep one thread from destroying what another one reads.

use std::fs;
use std::path::Path;

use quote::ToTokens;
use syn::{Block, ImplItem, Item, Signature};

/// Calls that do so, as tokens: tables of functions, and what goes through the loader itself.
const CALLS: [&str; 14] = [
    ":: Instance :: new",
    ":: Device :: new",
    ". create_instance",
    ". destroy_instance",
    ". create_device",
    ". destroy_device",
    ". enumerate_physical_devices",
    ". enumerate_device_extension_properties",
    ". create_debug_utils_messenger",
    ". destroy_debug_utils_messenger",
    ". set_debug_utils_object_name",
    "ash_window :: create_surface",
    ". destroy_surface",
    ". create_swapchain",
];

/// Functions that make such a call without the lock, each with the call.
fn unlocked(items: &[Item]) -> Vec<String> {
    let check = |signature: &Signature, block: &Block| -> Vec<String> {
        let text = block.to_token_stream().to_string();
        let locks = ["loader_reads ()", "loader_changes ()"].iter().any(|lock| text.contains(lock));
        let calls = CALLS.iter().filter(|call| !locks && text.contains(&format!("{call} (")));
        calls.map(|call| format!("{}: {call}", signature.ident)).collect()
    };
    let inside = |item: &Item| match item {
        Item::Fn(function) => check(&function.sig, &function.block),
        Item::Impl(implementation) => {
            let functions = implementation.items.iter().filter_map(|item| match item {
                ImplItem::Fn(function) => Some(function),
                _ => None,
            });
            functions.flat_map(|function| check(&function.sig, &function.block)).collect()
        }
        Item::Mod(module) => module.content.iter().flat_map(|(_, items)| unlocked(items)).collect(),
        _ => Vec::new(),
    };
    items.iter().flat_map(inside).collect()
}

fn unlocked_in(source: &str) -> Vec<String> {
    unlocked(&syn::parse_file(source).expect("Rust").items)
}

#[test]
fn calls_into_the_loader_hold_its_lock() {
    let mut todo = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu")];
    let mut files = 0;
    while let Some(path) = todo.pop() {
        if path.is_dir() {
            let entries = fs::read_dir(&path).expect("a folder");
            todo.extend(entries.map(|entry| entry.expect("an entry").path()));
        } else if path.extension().is_some_and(|e| e == "rs") {
            let found = unlocked_in(&fs::read_to_string(&path).expect("a source"));
            assert!(found.is_empty(), "{}: {found:?}", path.display());
            files += 1;
        }
    }
    assert!(files > 20, "{files} files of the gpu folder");
    for planted in [
        "fn f() { let functions = khr::swapchain::Device::new(&instance.raw, &raw); }",
        "impl Drop for D { fn drop(&mut self) { unsafe { self.raw.destroy_device(None) } } }",
        "fn f() { unsafe { instance.raw.enumerate_physical_devices() } }",
    ] {
        assert_eq!(unlocked_in(planted).len(), 1, "{planted}");
    }
    let locked = "fn f() { let _r = loader_reads(); khr::swapchain::Device::new(&a, &b); }";
    assert!(unlocked_in(locked).is_empty());
}
