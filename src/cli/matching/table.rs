//! The result of matching as text.

use insonify::matching::{Matching, Stage, Statistics, Width, depths};
use insonify::output;
use insonify::probe::Probe;

/// Prints brightness by depth, spread and size: the acquired volume, the simulation before and after.
pub fn print(probe: &Probe, made: &Matching) {
    output::line(format!("compared around the mask: {}", made.tissue));
    output::line(format!("{:<24} {:>9} {:>9} {:>9}", "", "acquired", "before", "after"));
    let places = depths(probe);
    for &i in &made.compared {
        let grey = |s: &Statistics| number(s.levels[i].level.map(|l| 255.0 * l), 1);
        row(&format!("brightness at {:.0} mm", places[i]), made, grey);
    }
    row("spread (grey levels)", made, |s| number(s.spread.map(|s| 255.0 * s), 1));
    row("size axial (mm)", made, |s| mm(s.axial));
    row("size lateral (mm)", made, |s| mm(s.lateral));
    row("patches of speckle", made, |s| format!("{:.0}", s.cells));
    let error = |stage: &Stage| {
        let off = made.level_errors(stage);
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        (format!("{mean:+.1}"), format!("{:.1}", made.level_deviation(stage)))
    };
    let (before, after) = (error(&made.before), error(&made.after));
    for (what, before, after) in
        [("mean difference (dB)", before.0, after.0), ("rms difference (dB)", before.1, after.1)]
    {
        output::line(format!("{what:<24} {:>9} {before:>9} {after:>9}", ""));
    }
}

fn row(what: &str, made: &Matching, value: impl Fn(&Statistics) -> String) {
    let stages = [&made.acquired, &made.before.simulated, &made.after.simulated];
    let [acquired, before, after] = stages.map(value);
    output::line(format!("{what:<24} {acquired:>9} {before:>9} {after:>9}"));
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |v| format!("{v:.digits$}"))
}

fn mm(width: Option<Width>) -> String {
    let open = width.is_some_and(|w| w.open);
    let number = number(width.map(|w| w.mm), 2);
    if open { format!("> {number}") } else { number }
}
