//! Files of UFF (HDF5), the format of the UltraSound ToolBox: beamformed baseband on its scan.
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

/// Beamformed baseband of one frame: the content of a file.
pub struct Beamformed<'a> {
    /// What the file is, in words.
    pub name: &'a str,
    /// The scanlines.
    pub axes: Axes,
    /// Number of samples along a line, and the distance between them, mm; the first lies on the face.
    pub samples: usize,
    /// Distance between samples, mm.
    pub pitch: f64,
    /// Lateral place and depth of each sample, mm, line by line.
    pub places: &'a [[f64; 2]],
    /// Real and imaginary part of each sample, line by line.
    pub iq: &'a [f32],
    /// Frequency that the baseband was shifted by, MHz.
    pub frequency: f64,
    /// Speed by which depth is time, mm/us.
    pub speed: f64,
}

/// The file; its one object is `beamformed_data`.
///
/// # Panics
/// When there is not one pair per sample.
pub fn bytes(of: &Beamformed<'_>) -> Vec<u8> {
    let lines = match &of.axes {
        Axes::Linear(axis) | Axes::Sector(_, axis) => axis.len(),
    };
    let count = lines * of.samples;
    assert_eq!([of.places.len(), of.iq.len()], [count, 2 * count], "a place and a pair per sample");
    let mut file = FileBuilder::new();
    let mut object = file.create_group("beamformed_data");
    class(&mut object, "beamformed_data", "uff.beamformed_data");
    put_text(&mut object, "info", of.name);
    let scan = scan(&mut object, of);
    object.add_group(scan.finish());
    let mut data = object.create_group("data");
    for (name, value) in [("class", "single"), ("name", "data")] {
        data.set_attr(name, AttrValue::VarLenString(value.to_owned()));
    }
    data.set_attr("complex", AttrValue::I64Array(vec![1]));
    data.set_attr("imaginary", AttrValue::I64Array(vec![0]));
    for (name, part) in [("real", 0), ("imag", 1)] {
        let values: Vec<f32> = of.iq.iter().skip(part).step_by(2).copied().collect();
        let dataset = data.create_dataset(name).with_f32_data(&values);
        dataset.with_shape(&[count as u64, 1, 1, 1]);
        number(dataset, "data", part == 1);
    }
    object.add_group(data.finish());
    put(&mut object, "modulation_frequency", &[HERTZ * of.frequency]);
    put(&mut object, "sampling_frequency", &[HERTZ * of.speed / (2.0 * of.pitch)]);
    file.add_group(object.finish());
    file.finish().expect("groups, names and shapes fit the format")
}

/// The scan with its axes, and where each pixel lies.
fn scan(object: &mut GroupBuilder, of: &Beamformed<'_>) -> GroupBuilder {
    let mut scan = object.create_group("scan");
    let metres =
        |all: &mut dyn Iterator<Item = f64>| all.map(|mm| METRES * mm).collect::<Vec<f64>>();
    let depths = (0..of.samples).map(|k| k as f64 * of.pitch);
    match &of.axes {
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
