//! The result of a registration as text, as a comment and as JSON.

use insonify::output;
use insonify::register::landmarks::{rms, worst};
use insonify::register::{Fit, Placement};
use serde_json::{Value, json};

use super::Registered;

/// Share of the surface's size from which on the remaining distance counts as no fit.
const APART: f64 = 0.03;
/// Share of trimmed points from which on it is mentioned.
const TRIMMED: f64 = 0.4;

/// Prints the fit of landmarks and surface, and the size of the movement.
pub fn print(made: &Registered) {
    if let Some((landmark, off)) = worst(&made.start, &made.landmarks) {
        let after = match made.fit {
            Some(_) => {
                let left = rms(&made.transform, &made.landmarks);
                format!("; {left:.2} mm after the surface was fitted")
            }
            None => String::new(),
        };
        output::line(format!(
            "landmarks: {}, rms {:.2} mm, worst `{}` {off:.2} mm{after}",
            made.landmarks.len(),
            rms(&made.start, &made.landmarks),
            landmark.name
        ));
    }
    if let Some(fit) = &made.fit {
        let cutoff = fit.residuals.cutoff;
        output::line(format!(
            "surface: {} beyond {cutoff:.3} mm; {} steps",
            distances(fit),
            fit.rounds
        ));
    }
    let (shift, angle, scale) = made.motion();
    output::line(format!("moved by {shift:.2} mm and {angle:.2} degrees, scale {scale:.4}"));
}

fn distances(fit: &Fit) -> String {
    let r = &fit.residuals;
    format!(
        "{} points, rms {:.3} mm, median {:.3} mm, 95 % {:.3} mm, {:.1} % trimmed",
        r.points,
        r.rms,
        r.median,
        r.p95,
        100.0 * r.trimmed()
    )
}

/// Prints the warnings on standard error.
pub fn warn(warnings: &[String]) {
    for warning in warnings {
        output::note(format!("warning: {warning}"));
    }
}

/// Doubts about the result.
pub fn doubts(made: &Registered) -> Vec<String> {
    let Some(fit) = &made.fit else {
        return Vec::new();
    };
    let mut out = Vec::new();
    if !fit.settled {
        out.push(format!(
            "not settled after {} steps; write it and register again, or give landmarks",
            fit.rounds
        ));
    }
    let trimmed = fit.residuals.trimmed();
    if trimmed > TRIMMED {
        out.push(format!(
            "{:.0} % of the points were trimmed: more than half have to lie on the surface",
            100.0 * trimmed
        ));
    }
    out.extend(fit.loose.iter().map(|what| {
        format!("the surface does not say {what}: that is left as it was at the start")
    }));
    out
}

/// A warning that points and surface, which is `size` mm large, do not belong to one structure.
pub fn apart(fit: &Fit, size: f64) -> Option<String> {
    let off = fit.residuals.rms;
    (off > APART * size).then(|| {
        format!(
            "the points stay {off:.1} mm off the surface: is it the same structure, of the same size? \
             Better landmarks or --transformation similarity may help"
        )
    })
}

/// The comment in the scene file.
pub fn note(made: &Registered, names: &[String]) -> String {
    let names: Vec<_> = names.iter().map(|n| n.escape_debug().to_string()).collect();
    let fit = match &made.fit {
        Some(fit) => distances(fit),
        None => {
            let (count, left) = (made.landmarks.len(), rms(&made.transform, &made.landmarks));
            format!("{count} landmarks, rms {left:.3} mm")
        }
    };
    format!("registered: {}: {fit}", names.join(", "))
}

/// The report for machines.
pub fn json(made: &Registered, table: &str, placement: &Placement, warnings: &[String]) -> Value {
    let (shift, angle, scale) = made.motion();
    let surface = made.fit.as_ref().map(|fit| {
        let r = &fit.residuals;
        json!({
            "points": r.points,
            "kept": r.kept,
            "trimmed_share": r.trimmed(),
            "cutoff_mm": r.cutoff,
            "rms_mm": r.rms,
            "median_mm": r.median,
            "p95_mm": r.p95,
            "steps": fit.rounds,
            "settled": fit.settled,
        })
    });
    let landmarks = worst(&made.start, &made.landmarks).map(|(landmark, off)| {
        json!({
            "count": made.landmarks.len(),
            "rms_mm": rms(&made.start, &made.landmarks),
            "worst": landmark.name,
            "worst_mm": off,
            "rms_after_mm": rms(&made.transform, &made.landmarks),
        })
    });
    json!({
        "table": table,
        "translate_mm": placement.translate.to_array(),
        "rotate_axis": placement.axis.to_array(),
        "rotate_angle_deg": placement.degrees,
        "scale": placement.scale,
        "moved_mm": shift,
        "turned_deg": angle,
        "grown": scale,
        "surface": surface,
        "landmarks": landmarks,
        "warnings": warnings,
    })
}
