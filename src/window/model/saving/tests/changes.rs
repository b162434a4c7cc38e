//! Changes of every setting that the console has.

use crate::model::Settings;
use crate::scene::Strategy;
use crate::settings::{Facts, Group, Surroundings, Value};

/// Draws a number between two ends.
pub type Draw<'d> = &'d mut dyn FnMut([f64; 2]) -> f64;

/// Changes a setting to a value that it draws.
pub type Apply = dyn Fn(&mut Settings, Draw<'_>);

/// A setting by its path, and a function that changes it.
pub struct Change {
    pub path: String,
    pub apply: Box<Apply>,
}

/// Another value that a key may have.
fn another(facts: &Facts, now: Value, draw: Draw<'_>) -> Value {
    match now {
        Value::Absent if facts.off.is_none() => Value::Absent,
        Value::Absent | Value::Number(_) => Value::Number(draw(facts.range)),
        Value::Whole(_) => Value::Whole(draw(facts.range) as u32),
        Value::Switch(on) => Value::Switch(!on),
        Value::Word(word) => {
            let words = facts.words();
            let at = words.iter().position(|w| *w == word).expect("one of them");
            Value::Word(words[(at + 1) % words.len()])
        }
        Value::List(list) => Value::List(list.iter().map(|_| draw(facts.range)).collect()),
        other => other,
    }
}

/// The changes of all settings of a group; `path` is its table.
fn group<T: Group>(out: &mut Vec<Change>, path: &str, of: fn(&mut Settings) -> &mut T) {
    for row in T::rows() {
        let apply = move |settings: &mut Settings, draw: Draw<'_>| {
            let (frequency, density) =
                (settings.probe.frequency, settings.simulation.density_scale);
            let value = another(&row.facts, (row.get)(of(settings)), draw);
            (row.set)(of(settings), &value);
            settings.follow_frequency(frequency);
            let wanted = settings.simulation.density_scale;
            if wanted != density {
                settings.simulation.density_scale = density;
                settings.set_density_scale(wanted);
            }
        };
        let path = format!("{path}.{}", row.facts.key);
        out.push(Change { path, apply: Box::new(apply) });
    }
}

/// All changes that the console can make.
pub fn changes() -> Vec<Change> {
    let mut out = Vec::new();
    for (word, settings) in [("convex", 0), ("linear", 1), ("phased", 2)] {
        let apply = move |s: &mut Settings, _: Draw<'_>| {
            s.probe.kind = s.probe.kind.turned(word);
            s.probe.depth = 50.0 + f64::from(settings);
        };
        out.push(Change { path: format!("probe, {word}"), apply: Box::new(apply) });
        group(&mut out, "probe", |s| &mut s.probe);
    }
    group(&mut out, "simulation", |s| &mut s.simulation);
    group(&mut out, "imaging", |s| &mut s.imaging);
    group(&mut out, "live", |s| &mut s.live);
    group(&mut out, "fusion", |s| s.fusion.as_mut().expect("there"));
    let none = |s: &mut Settings, _: Draw<'_>| {
        // The scene has no volume to be shown there.
        let fusion = s.fusion.as_mut().expect("there");
        if fusion.surroundings == Surroundings::Volume {
            fusion.surroundings = Surroundings::None;
        }
    };
    out.push(Change { path: "surroundings".to_owned(), apply: Box::new(none) });
    group(&mut out, "tissue 0", |s| &mut s.tissues[0]);
    group(&mut out, "tissue 1", |s| &mut s.tissues[1]);
    group(&mut out, "tissue 2", |s| &mut s.tissues[2]);
    group(&mut out, "tissue 3", |s| &mut s.tissues[3]);
    group(&mut out, "surface 0", |s| &mut s.surfaces[0][0]);
    group(&mut out, "surface 1", |s| &mut s.surfaces[1][0]);
    group(&mut out, "surface 2", |s| &mut s.surfaces[2][0]);
    group(&mut out, "surface 0, inside", |s| &mut s.surfaces[0][1]);
    group(&mut out, "surface 2, inside", |s| &mut s.surfaces[2][1]);
    let interpolate = |s: &mut Settings, _: Draw<'_>| s.strategies[1] = Some(Strategy::Interpolate);
    out.push(Change { path: "strategy".to_owned(), apply: Box::new(interpolate) });
    out
}

/// Least, greatest, and values with many digits between, in turn.
pub fn values(seed: u64) -> impl FnMut([f64; 2]) -> f64 {
    let mut state = seed;
    move |[least, most]| {
        // Knuth's MMIX generator: any sequence will do.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let share = (state >> 11) as f64 / (1_u64 << 53) as f64;
        match (state >> 7) % 8 {
            0 => least,
            1 => most,
            _ => {
                let (low, high) = (least.max(-1e4), most.min(1e4));
                low + share * (high - low)
            }
        }
    }
}
