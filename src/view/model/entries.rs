//! Settings as the entries of a scene file that say them.

use glam::{DAffine3, DVec3};
use serde::Deserialize;
use serde::de::value::{Error, StrDeserializer};
use toml_edit::{Key, Value};

use super::Settings;
use crate::probe::{Kind, Probe};
use crate::register::{Placement, Transformation};
use crate::scene::file::Entry;
use crate::scene::{Display, Fusion, Imaging, Live, Origin, Origins, Simulation, Surface, Tissue};
use crate::view::catalogue;

/// Relative difference below which two lattices are the same: each has been multiplied by frequencies
/// and divided by them, some hundred times in a long session.
const SAME_LATTICE: f64 = 1e-9;

/// What a scene file has to say so that `from`, which it gives now, becomes `to`. `lattice` is
/// [`lattice`] of the file's own settings, which a quality chosen for the device may have scaled in
/// both. The tracer is no matter of the file.
pub(super) fn changes(
    from: &Settings,
    to: &Settings,
    origins: &Origins,
    lattice: f64,
) -> Vec<Entry> {
    let mut out = probe_changes(&from.probe, &to.probe);
    out.extend(differing(simulation(&from.simulation), simulation(&to.simulation)));
    out.extend(cell(from, to, lattice));
    out.extend(differing(imaging(&from.imaging), imaging(&to.imaging)));
    out.extend(differing(live(&from.live), live(&to.live)));
    if let (Some(from), Some(to)) = (&from.fusion, &to.fusion) {
        out.extend(differing(fusion(from, origins), fusion(to, origins)));
    }
    if let (Some(from), Some(to)) = (&from.volume, &to.volume) {
        out.extend(differing(volume(from), volume(to)));
    }
    out.extend(differing(placed("model", &from.model), placed("model", &to.model)));
    out.extend(tissue_changes(&from.tissues, &to.tissues, &origins.bases));
    // Instances of one table have the same settings: the first speaks for all.
    let mut done: Vec<&Origin> = Vec::new();
    for (i, origin) in origins.instances.iter().enumerate() {
        if !done.iter().any(|o| o.mesh == origin.mesh) {
            out.extend(surface_changes(&origin.mesh, &from.surfaces[i], &to.surfaces[i]));
        }
        if from.strategies[i] != to.strategies[i]
            && let Some(strategy) = to.strategies[i]
            && !done.iter().any(|o| switch(o) == switch(origin))
        {
            let path = format!("{}.strategy", switch(origin));
            out.push((path, Some(format!("\"{strategy}\""))));
        }
        done.push(origin);
    }
    out
}

/// Path of the table that says how an instance's keyframes are followed.
pub(super) fn switch(origin: &Origin) -> String {
    match &origin.selector {
        Some(selector) => format!("selector.{}", name(selector)),
        None => format!("mesh.{}", name(&origin.mesh)),
    }
}

/// The pose of the probe, to a ten thousandth of a millimetre.
pub(super) fn pose(pose: &DAffine3) -> Vec<Entry> {
    let list = |v: DVec3, unit: f64| {
        // Minus zero is no place.
        let parts = v.to_array().map(|x| plain((x * unit).round() / unit + 0.0));
        Some(format!("[{}]", parts.join(", ")))
    };
    let (direction, lateral) = (pose.matrix3.z_axis, pose.matrix3.x_axis);
    vec![
        ("probe.pose.position".into(), list(pose.translation, 1e4)),
        ("probe.pose.direction".into(), list(direction, 1e7)),
        ("probe.pose.lateral".into(), list(lateral, 1e7)),
    ]
}

/// Edge of a lattice cell in wavelengths of 1 mm/us, as the file says it: mm MHz, before scatterers
/// that do not fit into the cells have divided them.
pub(super) fn lattice(settings: &Settings) -> f64 {
    let s = &settings.simulation;
    s.cell * s.crowding() * settings.probe.frequency
}

/// Whether two lattices, or cells, are the same but for rounding.
pub(super) fn is_same_lattice(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME_LATTICE
}

/// The cell follows frequency and density where the file does not say it, and is divided where there
/// are more scatterers than cells.
fn cell(from: &Settings, to: &Settings, file: f64) -> Option<Entry> {
    let inputs = |s: &Settings| {
        let s = (s.simulation.cell, s.simulation.density_scale, s.probe.frequency);
        [s.0, s.1, s.2]
    };
    if inputs(from) == inputs(to) {
        return None;
    }
    // What a quality has scaled is not for the file.
    let value = match is_same_lattice(lattice(from), lattice(to)) {
        true => file / to.probe.frequency,
        false => lattice(to) / to.probe.frequency,
    };
    let default = Simulation::default_cell(to.probe.frequency);
    let path = "simulation.cell";
    Some(match is_same_lattice(value, default) {
        true => (path.into(), None),
        false => number(path, path, value),
    })
}

fn probe_changes(from: &Probe, to: &Probe) -> Vec<Entry> {
    if from == to {
        return Vec::new();
    }
    let Some((preset, _)) = Probe::PRESETS.iter().find(|(_, make)| make() == *to) else {
        return differing(probe(from), probe(to));
    };
    let mut out: Vec<Entry> = probe(to).into_iter().map(|(path, _)| (path, None)).collect();
    out.push(("probe.preset".into(), Some(format!("\"{preset}\""))));
    out
}

fn probe(p: &Probe) -> Vec<Entry> {
    // Names all fields: one that is added cannot be forgotten here.
    let Probe {
        kind,
        scanlines,
        elevation_layers,
        samples,
        depth,
        frequency,
        bandwidth,
        speed,
        focus,
        f_number_transmit,
        f_number_receive,
        aperture,
        elevation_focus,
        elevation_height,
        slice_thickness,
    } = p;
    let (word, radius, view, width) = match *kind {
        Kind::Convex { radius, field_of_view } => {
            ("convex", Some(radius), Some(field_of_view), None)
        }
        Kind::Linear { width } => ("linear", None, None, Some(width)),
        Kind::Phased { field_of_view } => ("phased", None, Some(field_of_view), None),
    };
    let maybe = |key: &str, value: Option<f64>| match value {
        Some(value) => number(key, key, value),
        None => (key.to_owned(), None),
    };
    let of = |key: &str, value: f64| {
        let path = format!("probe.{key}");
        number(&path, &path, value)
    };
    vec![
        ("probe.kind".into(), Some(format!("\"{word}\""))),
        maybe("probe.radius", radius),
        ("probe.field_of_view".into(), view.map(angle)),
        maybe("probe.width", width),
        whole("probe.scanlines", *scanlines),
        whole("probe.elevation_layers", *elevation_layers),
        whole("probe.samples", *samples),
        of("depth", *depth),
        of("frequency", *frequency),
        of("bandwidth", *bandwidth),
        of("speed", *speed),
        of("focus", *focus),
        of("f_number_transmit", *f_number_transmit),
        of("f_number_receive", *f_number_receive),
        of("aperture", *aperture),
        of("elevation_focus", *elevation_focus),
        of("elevation_height", *elevation_height),
        of("slice_thickness", *slice_thickness),
    ]
}

fn simulation(s: &Simulation) -> Vec<Entry> {
    let Simulation {
        paths,
        sampling,
        sequence,
        max_interactions,
        max_reflections,
        min_weight,
        coherence,
        rough_transmission,
        face_reflection,
        beam_footprint,
        origin_jitter,
        emission_lobe,
        beam_width,
        scatter_mode,
        cell: _,
        scatterers_per_resolution_cell,
        texture_space,
        volume_floor,
        branch_floor,
        speckle_gain,
        surface_gain,
        density_scale,
        roughness_scale,
        thickness_scale,
        seed,
    } = s;
    let of = |key: &str, value: f64| {
        let path = format!("simulation.{key}");
        number(&path, &path, value)
    };
    vec![
        whole("simulation.paths", *paths),
        word("simulation.sampling", sampling),
        word("simulation.sequence", sequence),
        whole("simulation.max_interactions", *max_interactions),
        whole("simulation.max_reflections", *max_reflections),
        of("min_weight", *min_weight),
        word("simulation.coherence", coherence),
        switched("simulation.rough_transmission", *rough_transmission),
        switched("simulation.face_reflection", *face_reflection),
        switched("simulation.beam_footprint", *beam_footprint),
        of("origin_jitter", *origin_jitter),
        of("emission_lobe", *emission_lobe),
        of("beam_width", *beam_width),
        word("simulation.scatter_mode", scatter_mode),
        of("scatterers_per_resolution_cell", *scatterers_per_resolution_cell),
        word("simulation.texture_space", texture_space),
        of("volume_floor", *volume_floor),
        of("branch_floor", *branch_floor),
        of("speckle_gain", *speckle_gain),
        of("surface_gain", *surface_gain),
        of("density_scale", *density_scale),
        of("roughness_scale", *roughness_scale),
        of("thickness_scale", *thickness_scale),
        whole("simulation.seed", *seed),
    ]
}

fn imaging(i: &Imaging) -> Vec<Entry> {
    let Imaging {
        gain,
        dynamic_range,
        tgc_attenuation,
        tgc_limit,
        tgc_sliders,
        noise,
        grey_gamma,
        psf_scale,
        image_height,
    } = i;
    let of = |key: &str, value: f64| {
        let path = format!("imaging.{key}");
        number(&path, &path, value)
    };
    let list = |values: &[f64]| {
        let texts: Vec<_> = values.iter().map(|v| plain(*v)).collect();
        Some(format!("[{}]", texts.join(", ")))
    };
    vec![
        of("gain", *gain),
        of("dynamic_range", *dynamic_range),
        of("tgc_attenuation", *tgc_attenuation),
        of("tgc_limit", *tgc_limit),
        ("imaging.tgc_sliders".into(), list(tgc_sliders)),
        of("noise", *noise),
        of("grey_gamma", *grey_gamma),
        ("imaging.psf_scale".into(), list(psf_scale)),
        whole("imaging.image_height", *image_height),
    ]
}

fn live(l: &Live) -> Vec<Entry> {
    let Live { budget } = l;
    let path = "live.budget";
    vec![match budget {
        Some(budget) => number(path, path, *budget),
        None => (path.into(), None),
    }]
}

fn fusion(f: &Fusion, origins: &Origins) -> Vec<Entry> {
    let Fusion { masks, surroundings, blur, blend, mask_speed, background_shadows } = f;
    let masks = masks.iter().filter_map(|&i| origins.instances.get(i));
    // An animated file has several instances of one name.
    let mut names: Vec<String> = masks.map(|o| Value::from(o.mesh.as_str()).to_string()).collect();
    names.dedup();
    vec![
        ("fusion.mask".into(), Some(format!("[{}]", names.join(", ")))),
        word("fusion.surroundings", surroundings),
        whole("fusion.blur", *blur),
        word("fusion.blend", blend),
        word("fusion.mask_speed", mask_speed),
        switched("fusion.background_shadows", *background_shadows),
    ]
}

fn volume(d: &Display) -> Vec<Entry> {
    let Display { world_from_lps, black, white } = d;
    let mut out = placed("volume", world_from_lps);
    out.extend([
        number("volume.black", "volume.black", *black),
        number("volume.white", "volume.white", *white),
    ]);
    out
}

/// Where `table` places something that keeps its proportions.
fn placed(table: &str, place: &DAffine3) -> Vec<Entry> {
    Placement::of(place, Transformation::Similarity).entries(table)
}

/// Those that are based on another one say themselves what that one no longer says as before.
fn tissue_changes(from: &[Tissue], to: &[Tissue], bases: &[Vec<String>]) -> Vec<Entry> {
    let differs: Vec<Vec<bool>> = (from.iter().zip(to))
        .map(|(from, to)| {
            let pairs = tissue(from).into_iter().zip(tissue(to));
            pairs.map(|(a, b)| a.1 != b.1).collect()
        })
        .collect();
    let mut out = Vec::new();
    for (i, to_tissue) in to.iter().enumerate() {
        let on = |other: &Tissue| bases.get(i).is_some_and(|b| b.contains(&other.name));
        let based: Vec<usize> = (0..to.len()).filter(|&j| j == i || on(&to[j])).collect();
        for (key, entry) in tissue(to_tissue).into_iter().enumerate() {
            if based.iter().any(|&j| differs[j][key]) {
                out.push(entry);
            }
        }
        let t = (from[i].impedance(), to_tissue.impedance());
        if t.0 != t.1 {
            // It is derived; a stated one would contradict it.
            let path = format!("tissues.{}.impedance", name(&to_tissue.name));
            out.push((path, None));
        }
    }
    out
}

fn tissue(t: &Tissue) -> Vec<Entry> {
    let Tissue {
        name: own,
        speed,
        density,
        attenuation,
        echogenicity,
        density_of_scatterers,
        mean_over_sigma,
        texture_depth,
        texture_length,
        // A default of meshes, and words for people: the file says neither.
        surface: _,
        source: _,
    } = t;
    let of = |key: &str, value: f64| {
        let path = format!("tissues.{}.{key}", name(own));
        number(&path, &format!("tissues.NAME.{key}"), value)
    };
    vec![
        of("speed", *speed),
        of("density", *density),
        of("attenuation", *attenuation),
        of("echogenicity", *echogenicity),
        of("density_of_scatterers", *density_of_scatterers),
        of("mean_over_sigma", *mean_over_sigma),
        of("texture_depth", *texture_depth),
        of("texture_length", *texture_length),
    ]
}

/// The inside is as the outside where the file does not say it: who changes that one says it.
fn surface_changes(mesh: &str, from: &[Surface; 2], to: &[Surface; 2]) -> Vec<Entry> {
    let path = format!("mesh.{}", name(mesh));
    let [outside, inside] = [(0, path.clone()), (1, format!("{path}.inside"))]
        .map(|(side, path)| (surface(&path, &from[side]), surface(&path, &to[side])));
    let mut out = Vec::new();
    let keys = outside.0.into_iter().zip(outside.1);
    for (out_side, in_side) in keys.zip(inside.0.into_iter().zip(inside.1)) {
        let changed = out_side.0 != out_side.1;
        if changed || in_side.0 != in_side.1 {
            out.push(in_side.1);
        }
        if changed {
            out.push(out_side.1);
        }
    }
    out
}

fn surface(path: &str, s: &Surface) -> Vec<Entry> {
    let Surface { roughness, thickness, specularity, gain } = s;
    let of =
        |key: &str, value: f64| number(&format!("{path}.{key}"), &format!("mesh.{key}"), value);
    vec![
        of("roughness", *roughness),
        of("thickness", *thickness),
        of("specularity", *specularity),
        of("surface_gain", *gain),
    ]
}

/// Entries of `to` that are not in `from`; both have the same paths.
fn differing(from: Vec<Entry>, to: Vec<Entry>) -> Vec<Entry> {
    let pairs = from.into_iter().zip(to).filter(|(a, b)| a != b);
    pairs.map(|(_, entry)| entry).collect()
}

/// A name as a part of a path.
fn name(name: &str) -> String {
    Key::new(name).display_repr().into_owned()
}

/// The value at `path`, with the unit of `key` in the reference.
fn number(path: &str, key: &str, value: f64) -> Entry {
    let text = plain(value);
    let text = match catalogue::entry(key).unit.as_str() {
        "" => text,
        _ if value.is_infinite() => text,
        unit => format!("\"{text} {unit}\""),
    };
    (path.to_owned(), Some(text))
}

/// In degrees where they are the same number: most people would write them.
fn angle(radians: f64) -> String {
    let degrees = (radians.to_degrees() * 1e9).round() / 1e9;
    match degrees * (std::f64::consts::PI / 180.0) == radians {
        true => format!("\"{} deg\"", plain(degrees)),
        false => format!("\"{} rad\"", plain(radians)),
    }
}

fn whole(path: &str, value: u32) -> Entry {
    (path.to_owned(), Some(value.to_string()))
}

fn switched(path: &str, value: bool) -> Entry {
    (path.to_owned(), Some(value.to_string()))
}

/// One of the words that a key takes.
fn word<T>(path: &str, value: &T) -> Entry
where
    T: for<'de> Deserialize<'de> + PartialEq,
{
    let of = |word: &&String| T::deserialize(StrDeserializer::<Error>::new(word)).ok();
    let mut words = catalogue::entry(path).choices.iter();
    let word = words.find(|word| of(word).as_ref() == Some(value));
    let word = word.expect("the reference has all words");
    (path.to_owned(), Some(format!("\"{word}\"")))
}

/// As TOML reads it back, to the last bit.
fn plain(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}
