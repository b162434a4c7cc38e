//! What a test does on a machine that lacks what it needs.

/// What is lacking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lacking {
    /// What `tools/setup.sh` installs, or a device with all features.
    Tool,
    /// Data of others, which do not ship.
    Data,
}

/// Says that a test, or part of it, is not run, and why: "no X server". `cargo test` keeps that to itself where
/// the test passes, so the environment can forbid it: with `INSONIFY_NO_SKIP=1` a lacking tool fails the
/// test, with `INSONIFY_NO_SKIP=all` lacking data do so as well. Every skip goes through here.
///
/// # Panics
/// Where the environment forbids it, or says something else.
pub fn skip(lacking: Lacking, why: &str) {
    let rule = std::env::var("INSONIFY_NO_SKIP").ok();
    assert!(!is_forbidden(lacking, rule.as_deref()), "not run: {why} (INSONIFY_NO_SKIP)");
    println!("skipped: {why}");
}

/// Whether a rule forbids to skip.
fn is_forbidden(lacking: Lacking, rule: Option<&str>) -> bool {
    match rule {
        None | Some("" | "0") => false,
        Some("1") => lacking == Lacking::Tool,
        Some("all") => true,
        Some(other) => panic!("INSONIFY_NO_SKIP is 1 or all, not '{other}'"),
    }
}

#[test]
fn what_lacks_is_told_apart() {
    use Lacking::{Data, Tool};
    let rules = [None, Some(""), Some("0"), Some("1"), Some("all")];
    assert_eq!(rules.map(|rule| is_forbidden(Tool, rule)), [false, false, false, true, true]);
    assert_eq!(rules.map(|rule| is_forbidden(Data, rule)), [false, false, false, false, true]);
    assert!(std::panic::catch_unwind(|| is_forbidden(Tool, Some("yes"))).is_err());
}
