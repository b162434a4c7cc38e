//! The paths in sources: `crate::directions::a::b`, chains of `super`, trees of a `use`, inside macros too.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;
use syn::{Attribute, Item, UseTree};

/// Modules that a part of the crate names, each with a file that does; the first two names of a path,
/// or one where the second is no module.
#[derive(Debug, Default)]
pub struct Uses {
    pub paths: BTreeMap<String, String>,
}

/// The uses of each module at the crate's root, without tests.
pub fn of_library(root: &Path) -> BTreeMap<String, Uses> {
    let mut out = BTreeMap::new();
    for item in parsed(root).items {
        let Item::Mod(module) = item else { continue };
        if !is_test(&module.attrs) {
            let name = module.ident.to_string();
            let mut uses = Uses::default();
            let folder = root.parent().expect("a folder");
            uses.file(&found(folder, &name, &module.attrs), std::slice::from_ref(&name));
            out.insert(name, uses);
        }
    }
    out
}

/// The modules that the crate at this root passes on from the crates below it. What these use is the compiler's to say.
pub fn passed_on(root: &Path) -> Vec<String> {
    let ours = |name: &syn::Ident| name.to_string().starts_with("insonify_");
    let mut uses = Uses::default();
    for item in parsed(root).items {
        let Item::Use(item) = item else { continue };
        let names = match item.tree {
            UseTree::Path(from) if ours(&from.ident) => from.tree.to_token_stream(),
            UseTree::Rename(whole) if ours(&whole.ident) => whole.rename.to_token_stream(),
            _ => continue,
        };
        uses.scan(quote::quote!(crate::#names), &[], root);
    }
    uses.paths.into_keys().collect()
}

/// The uses of the module in a file: of this library, and of another crate if the file belongs to one.
pub fn of_module(file: &Path, name: &str) -> Uses {
    let mut uses = Uses::default();
    uses.file(file, &[name.to_owned()]);
    uses
}

/// The uses of a source text, read as the module `path`.
pub fn of_source(path: &str, source: &str) -> Uses {
    let mut uses = Uses::default();
    let module: Vec<String> = path.split("::").map(str::to_owned).collect();
    let items = syn::parse_file(source).expect("Rust").items;
    uses.items(items, &module, Path::new("planted.rs"));
    uses
}

fn parsed(file: &Path) -> syn::File {
    let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

/// The path of the source of a module in `folder`.
fn found(folder: &Path, name: &str, attrs: &[Attribute]) -> PathBuf {
    assert!(!attrs.iter().any(|a| a.path().is_ident("path")), "`{name}` stands elsewhere");
    let beside = folder.join(format!("{name}.rs"));
    if beside.exists() { beside } else { folder.join(name).join("mod.rs") }
}

fn is_test(attrs: &[Attribute]) -> bool {
    let test = |a: &Attribute| {
        a.path().is_ident("cfg") && a.parse_args::<syn::Path>().is_ok_and(|p| p.is_ident("test"))
    };
    attrs.iter().any(test)
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

impl Uses {
    fn file(&mut self, file: &Path, module: &[String]) {
        self.items(parsed(file).items, module, file);
    }

    fn items(&mut self, items: Vec<Item>, module: &[String], file: &Path) {
        for item in items {
            if is_test(attributes(&item)) {
                continue;
            }
            let Item::Mod(inner) = item else {
                self.scan(item.to_token_stream(), module, file);
                continue;
            };
            let name = inner.ident.to_string();
            let path = [module, std::slice::from_ref(&name)].concat();
            match inner.content {
                Some((_, items)) => self.items(items, &path, file),
                None => {
                    let is_root = file.file_name().is_some_and(|n| n == "mod.rs");
                    let folder =
                        if is_root { file.with_file_name("") } else { file.with_extension("") };
                    self.file(&found(&folder, &name, &inner.attrs), &path);
                }
            }
        }
    }

    /// Finds the beginnings of paths among tokens and within their groups.
    fn scan(&mut self, tokens: TokenStream, module: &[String], file: &Path) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        for (i, token) in tokens.iter().enumerate() {
            match token {
                TokenTree::Group(group) => self.scan(group.stream(), module, file),
                TokenTree::Ident(name) if !continues(&tokens[..i]) => {
                    let begin = match name.to_string().as_str() {
                        // As other crates call it.
                        "crate" | "insonify" => Some(&module[..0]),
                        "super" => module.len().checked_sub(1).map(|n| &module[..n]),
                        "self" => Some(module),
                        _ => None,
                    };
                    if let Some(begin) = begin {
                        self.follow(begin, &tokens[i + 1..], file);
                    }
                }
                _ => {}
            }
        }
    }

    /// Follows a path from `begin` through the tokens of `rest`.
    fn follow(&mut self, begin: &[String], rest: &[TokenTree], file: &Path) {
        let next = match rest {
            [a, b, next, ..] if is(a, ':') && is(b, ':') => next,
            _ => return self.found(begin, file),
        };
        match next {
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                let tokens: Vec<TokenTree> = group.stream().into_iter().collect();
                for branch in tokens.split(|t| is(t, ',')).filter(|b| !b.is_empty()) {
                    self.step(begin, branch, file);
                }
            }
            _ => self.step(begin, &rest[2..], file),
        }
    }

    /// Follows the path by the first token of `rest`.
    fn step(&mut self, begin: &[String], rest: &[TokenTree], file: &Path) {
        let TokenTree::Ident(name) = &rest[0] else {
            return self.found(begin, file);
        };
        match name.to_string().as_str() {
            "self" => self.found(begin, file),
            "super" => {
                let up = begin.len().checked_sub(1).expect("nothing is above the root");
                self.follow(&begin[..up], &rest[1..], file);
            }
            name => self.follow(&[begin, &[name.to_owned()]].concat(), &rest[1..], file),
        }
    }

    fn found(&mut self, path: &[String], file: &Path) {
        let is_module = |name: &&String| name.starts_with(|c: char| c.is_ascii_lowercase());
        let names: Vec<&str> =
            path.iter().take(2).take_while(is_module).map(String::as_str).collect();
        if !names.is_empty() {
            self.paths.entry(names.join("::")).or_insert_with(|| file.display().to_string());
        }
    }
}

/// True if these tokens end in `::`, so that a path continues after them.
fn continues(before: &[TokenTree]) -> bool {
    matches!(before, [.., a, b] if is(a, ':') && is(b, ':'))
}

fn is(token: &TokenTree, sign: char) -> bool {
    matches!(token, TokenTree::Punct(p) if p.as_char() == sign)
}
