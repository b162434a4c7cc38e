//! Samples in the formats of others: zea and UFF.

use super::members::wxyz;
use super::plan::{Array, Plan};
use super::studio::Made;
use crate::output::{uff, zea};
use crate::probe::{Kind, Probe};

/// The file of zea of a sample.
pub(super) fn zea(plan: &Plan, made: &Made) -> Vec<u8> {
    let scene = &plan.scenes[made.sample.scene];
    let (width, height) = made.image.dimensions();
    let probe = &made.settings.probe;
    let asked = |array: Array| plan.arrays.contains(&array);
    zea::bytes(&zea::Frame {
        description: &format!("{}, sample {} of `{}`", plan.title, made.sample.number, scene.name),
        subject: &scene.anatomy,
        size: [width, height],
        image: made.image.as_raw(),
        segmentation: &made.segmentation,
        classes: &plan.classes,
        corner: made.corner,
        pixel: made.pixel,
        position: made.world_from_probe.translation.to_array(),
        rotation: wxyz(&made.world_from_probe),
        lines: zea::Lines {
            shape: [probe.scanlines as usize, probe.samples as usize],
            places: &places(probe),
            envelope: made.envelope.as_deref().filter(|_| asked(Array::Envelope)),
            iq: made.iq.as_deref().filter(|_| asked(Array::Iq)),
        },
    })
}

/// The file of UFF of a sample.
pub(super) fn uff(plan: &Plan, made: &Made) -> Vec<u8> {
    let scene = &plan.scenes[made.sample.scene];
    let probe = &made.settings.probe;
    uff::bytes(&uff::Beamformed {
        name: &format!("insonify, sample {} of `{}`", made.sample.number, scene.name),
        axes: axes(probe),
        samples: probe.samples as usize,
        pitch: probe.sample_pitch(),
        places: &places(probe),
        iq: made.iq.as_deref().expect("the plan writes it"),
        frequency: probe.frequency,
        speed: probe.speed,
    })
}

/// Place across the face of each scanline, from -1/2 to 1/2.
fn across(probe: &Probe) -> impl Iterator<Item = f64> {
    let count = probe.scanlines;
    (0..count).map(move |l| (f64::from(l) + 0.5) / f64::from(count) - 0.5)
}

fn axes(probe: &Probe) -> uff::Axes {
    match probe.kind {
        Kind::Linear { width } => uff::Axes::Linear(across(probe).map(|u| width * u).collect()),
        Kind::Convex { radius, field_of_view } => {
            uff::Axes::Sector(radius, across(probe).map(|u| field_of_view * u).collect())
        }
        Kind::Phased { field_of_view } => {
            uff::Axes::Sector(0.0, across(probe).map(|u| field_of_view * u).collect())
        }
    }
}

/// Lateral place and depth of each sample, mm, line by line.
fn places(probe: &Probe) -> Vec<[f64; 2]> {
    let pitch = probe.sample_pitch();
    let line = |l: u32| {
        // Sine and cosine that are the same on every machine.
        let u = (f64::from(l) + 0.5) / f64::from(probe.scanlines) - 0.5;
        let fan = |radius: f64, view: f64| {
            let (sin, cos) = (libm::sin(view * u), libm::cos(view * u));
            ([radius * sin, radius * cos - radius], [sin, cos])
        };
        match probe.kind {
            Kind::Linear { width } => ([width * u, 0.0], [0.0, 1.0]),
            Kind::Convex { radius, field_of_view } => fan(radius, field_of_view),
            Kind::Phased { field_of_view } => fan(0.0, field_of_view),
        }
    };
    let samples = probe.samples;
    (0..probe.scanlines)
        .flat_map(|l| {
            let ([x, z], [dx, dz]) = line(l);
            (0..samples).map(move |k| f64::from(k) * pitch).map(move |t| [x + t * dx, z + t * dz])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_along_the_rays_of_the_probe() {
        for probe in [Probe::linear(), Probe::abdominal(), Probe::phased()] {
            let places = places(&probe);
            for (line, sample) in [(0, 0), (7, 100), (probe.scanlines - 1, probe.samples - 1)] {
                let (origin, direction) = probe.ray(line, 0);
                let at = origin + direction * f64::from(sample) * probe.sample_pitch();
                let [x, z] = places[(line * probe.samples + sample) as usize];
                assert!((x - at.x).abs() < 1e-9 && (z - at.z).abs() < 1e-9, "{:?}", probe.kind);
            }
        }
    }
}
