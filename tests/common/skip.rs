//! The skipping of a test on a machine that lacks something it needs.

use std::io::Write as _;

/// Kind of the missing thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lacking {
    /// A tool that `tools/setup.sh` installs, or a device with all features.
    Tool,
    /// Data of others, which do not ship.
    Data,
}

/// Reports that a test, or part of it, is not run, and why: "no X server". `cargo test` hides that where the test
/// passes, so the environment can forbid it: with `INSONIFY_NO_SKIP=1` a missing tool fails the test, with
/// `INSONIFY_NO_SKIP=all` missing data do so as well. Every skip calls this.
///
/// # Panics
/// The environment forbids it, or has another value.
pub fn skip(lacking: Lacking, why: &str) {
    let rule = std::env::var("INSONIFY_NO_SKIP").ok();
    assert!(!is_forbidden(lacking, rule.as_deref()), "not run: {why} (INSONIFY_NO_SKIP)");
    println!("skipped: {why}");
    // The end of tools/test.sh says it.
    if let Some(list) = std::env::var_os("INSONIFY_SKIPPED") {
        let list = std::fs::File::options().append(true).create(true).open(list);
        let written = list.and_then(|mut list| list.write_all(format!("{why}\n").as_bytes()));
        written.expect("the list of skipped tests");
    }
}

/// Returns whether a rule forbids the skip.
fn is_forbidden(lacking: Lacking, rule: Option<&str>) -> bool {
    match rule {
        None | Some("" | "0") => false,
        Some("1") => lacking == Lacking::Tool,
        Some("all") => true,
        Some(other) => panic!("INSONIFY_NO_SKIP is 1 or all, not '{other}'"),
    }
}

#[test]
fn missing_tools_and_missing_data_are_told_apart() {
    use Lacking::{Data, Tool};
    let rules = [None, Some(""), Some("0"), Some("1"), Some("all")];
    assert_eq!(rules.map(|rule| is_forbidden(Tool, rule)), [false, false, false, true, true]);
    assert_eq!(rules.map(|rule| is_forbidden(Data, rule)), [false, false, false, false, true]);
    assert!(std::panic::catch_unwind(|| is_forbidden(Tool, Some("yes"))).is_err());
}
