//! Files of UFF (HDF5), the format of the UltraSound ToolBox: beamformed baseband and radio frequency on their scans.
//!
//! As `pyuff_ustb` 3.0 writes them: data [pixel, channel, wave, frame], pixels line by line and by depth along each. Lengths
//! are in m, angles in rad. Written by `hdf5-pure`, which needs no C library.

use hdf5_pure::{AttrValue, DatasetBuilder, FileBuilder, GroupBuilder};

/// m in a mm.
const METRES: f64 = 1e-3;
/// Hz in a MHz, and mm/us in m/s.
const HERTZ: f64 = 1e6;

/// The axes along which the scanlines lie.
#[derive(Clone, Debug, PartialEq)]
pub enum Axes {
    /// Side by side: lateral place of each line, mm.
    Linear(Vec<f64>),
    /// From an apex behind the face: its distance to the middle of the face, mm; angle of each line, rad.
    Sector(f64, Vec<f64>),
}

/// Beamformed frames: the content of a file. Arrays hold all frames, one after the other.
pub struct Frames<'a> {
    /// What the file is, in words.
    pub name: &'a str,
    /// The scanlines.
    pub axes: Axes,
    /// Number of frames.
    pub frames: usize,
    /// Frequency that the baseband was shifted by, MHz.
    pub frequency: f64,
    /// Speed by which depth is time, mm/us.
    pub speed: f64,
    /// Real and imaginary part of the baseband: the object `beamformed_data`.
    pub iq: Option<Samples<'a>>,
    /// Radio-frequency lines: the object `beamformed_rf`.
    pub rf: Option<Samples<'a>>,
}

/// Samples along the scanlines, line by line.
pub struct Samples<'a> {
    /// Number of samples along a line; the first lies on the face.
    pub count: usize,
    /// Distance between samples, mm.
    pub pitch: f64,
    /// Lateral place and depth of each sample of a frame, mm.
    pub places: &'a [[f64; 2]],
    /// Their values.
    pub values: &'a [f32],
}

/// The file of frames.
///
/// # Panics
/// When there is not one pair, or one value of the radio frequency, per sample and frame.
pub fn bytes(of: &Frames<'_>) -> Vec<u8> {
    let mut file = FileBuilder::new();
    let objects = [
        ("beamformed_data", &of.iq, &["real", "imag"][..], of.frequency),
        // What was not shifted.
        ("beamformed_rf", &of.rf, &["data"][..], 0.0),
    ];
    for (name, samples, parts, frequency) in objects {
        let Some(samples) = samples else { continue };
        let mut object = file.create_group(name);
        class(&mut object, name, "uff.beamformed_data");
        put_text(&mut object, "info", of.name);
        let scan = scan(&mut object, &of.axes, samples);
        object.add_group(scan.finish());
        let lines = samples.places.len() / samples.count;
        assert_eq!(lines, of.axes.lines(), "a place per sample");
        put_data(&mut object, samples, parts, of.frames);
        put(&mut object, "modulation_frequency", &[HERTZ * frequency]);
        put(&mut object, "sampling_frequency", &[HERTZ * of.speed / (2.0 * samples.pitch)]);
        file.add_group(object.finish());
    }
    file.finish().expect("groups, names and shapes fit the format")
}

impl Axes {
    fn lines(&self) -> usize {
        match self {
            Self::Linear(axis) | Self::Sector(_, axis) => axis.len(),
        }
    }
}

/// The values, [pixel, channel, wave, frame]: complex ones as a group of their two parts.
fn put_data(object: &mut GroupBuilder, of: &Samples<'_>, parts: &[&str], frames: usize) {
    let count = of.places.len();
    assert_eq!(of.values.len(), frames * count * parts.len(), "a value per sample");
    let part = |part: usize| -> Vec<f32> {
        let at = |i, frame| of.values[(frame * count + i) * parts.len() + part];
        (0..count).flat_map(|i| (0..frames).map(move |frame| at(i, frame))).collect()
    };
    let put = |group: &mut GroupBuilder, place: usize| {
        let dataset = group.create_dataset(parts[place]).with_f32_data(&part(place));
        dataset.with_shape(&[count as u64, 1, 1, frames as u64]);
        number(dataset, "data", place == 1);
    };
    if parts.len() == 1 {
        return put(object, 0);
    }
    let mut data = object.create_group("data");
    for (name, value) in [("class", "single"), ("name", "data")] {
        data.set_attr(name, AttrValue::VarLenString(value.to_owned()));
    }
    data.set_attr("complex", AttrValue::I64Array(vec![1]));
    data.set_attr("imaginary", AttrValue::I64Array(vec![0]));
    put(&mut data, 0);
    put(&mut data, 1);
    object.add_group(data.finish());
}

/// The scan with its axes, and where each pixel lies.
fn scan(object: &mut GroupBuilder, axes: &Axes, of: &Samples<'_>) -> GroupBuilder {
    let mut scan = object.create_group("scan");
    let metres =
        |all: &mut dyn Iterator<Item = f64>| all.map(|mm| METRES * mm).collect::<Vec<f64>>();
    let depths = (0..of.count).map(|k| k as f64 * of.pitch);
    match axes {
        Axes::Linear(lateral) => {
            class(&mut scan, "scan", "uff.linear_scan");
            put(&mut scan, "x_axis", &metres(&mut lateral.iter().copied()));
            put(&mut scan, "z_axis", &metres(&mut depths.clone()));
        }
        Axes::Sector(radius, angles) => {
            class(&mut scan, "scan", "uff.sector_scan");
            put(&mut scan, "azimuth_axis", angles);
            put(&mut scan, "depth_axis", &metres(&mut depths.clone().map(|z| radius + z)));
            let mut apex = scan.create_group("origin");
            class(&mut apex, "origin", "uff.point");
            put(&mut apex, "distance", &[METRES * radius]);
            // Behind the face.
            put(&mut apex, "azimuth", &[std::f64::consts::PI]);
            put(&mut apex, "elevation", &[0.0]);
            scan.add_group(apex.finish());
        }
    }
    put(&mut scan, "x", &metres(&mut of.places.iter().map(|p| p[0])));
    put(&mut scan, "y", &vec![0.0; of.places.len()]);
    put(&mut scan, "z", &metres(&mut of.places.iter().map(|p| p[1])));
    scan
}

fn class(group: &mut GroupBuilder, name: &str, class: &str) {
    group.set_attr("class", AttrValue::VarLenString(class.to_owned()));
    group.set_attr("name", AttrValue::VarLenString(name.to_owned()));
    group.set_attr("array", AttrValue::I64Array(vec![0]));
    group.set_attr("size", AttrValue::I64Array(vec![1, 1]));
}

/// Says of an array what it is.
fn number(dataset: &mut DatasetBuilder, name: &str, imaginary: bool) {
    dataset.set_attr("class", AttrValue::VarLenString("single".to_owned()));
    dataset.set_attr("name", AttrValue::VarLenString(name.to_owned()));
    dataset.set_attr("complex", AttrValue::I64Array(vec![0]));
    dataset.set_attr("imaginary", AttrValue::I64Array(vec![i64::from(imaginary)]));
}

fn put(group: &mut GroupBuilder, name: &str, values: &[f64]) {
    let dataset = group.create_dataset(name).with_f64_data(values);
    number(dataset.with_shape(&[values.len() as u64]), name, false);
}

/// A text: a column of the numbers of its characters.
fn put_text(group: &mut GroupBuilder, name: &str, text: &str) {
    let codes: Vec<u16> = text.encode_utf16().collect();
    let dataset = group.create_dataset(name).with_u16_data(&codes);
    dataset.with_shape(&[codes.len() as u64, 1]);
    dataset.set_attr("class", AttrValue::VarLenString("char".to_owned()));
    dataset.set_attr("name", AttrValue::VarLenString(name.to_owned()));
}
