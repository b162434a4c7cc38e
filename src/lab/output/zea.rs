//! Files of zea (HDF5): images with their segmentation and the probe's poses, and the samples from which they were made.
//!
//! The layout is that of zea 0.1.8 (`zea.data.spec`). Lengths are in m; coordinates are x lateral, y elevation, z depth in
//! the probe's frame. Written by `hdf5-pure`, which needs no C library.

use hdf5_pure::{
    AttrValue, DatasetBuilder, EnumTypeBuilder, FileBuilder, FinishedGroup, GroupBuilder,
    make_i8_type,
};

/// Version of the format that files state.
const VERSION: &str = "0.1.8";
/// Compression of arrays.
const LEVEL: u32 = 4;
/// m in a mm.
const METRES: f64 = 1e-3;

/// Frames of one probe: the content of a file. Arrays hold all frames, one after the other.
pub struct Frames<'a> {
    /// What the file is, in words.
    pub description: &'a str,
    /// The anatomy.
    pub subject: &'a str,
    /// Time of each frame, s, increasing from 0 on.
    pub times: &'a [f64],
    /// Place of the middle of the probe's face in the world, mm.
    pub positions: &'a [[f64; 3]],
    /// Rotation of the probe as a quaternion, the real part first.
    pub rotations: &'a [[f64; 4]],
    /// Width and height of the images, pixels.
    pub size: [u32; 2],
    /// Left upper corner of the images, mm.
    pub corner: [f64; 2],
    /// Edge of a pixel, mm.
    pub pixel: f64,
    /// Grey level of each pixel, row by row.
    pub images: &'a [u8],
    /// Index into `classes` of each pixel; others: none.
    pub segmentation: Option<&'a [u8]>,
    /// Names of the classes, at least one.
    pub classes: &'a [String],
    /// Further quantities of the pixels.
    pub maps: &'a [Map<'a>],
    /// The samples along the scanlines.
    pub lines: Lines<'a>,
}

/// A quantity of the pixels.
pub struct Map<'a> {
    /// Its name in the file.
    pub name: &'a str,
    /// Its unit; empty: none.
    pub unit: &'a str,
    /// What it says.
    pub meaning: &'a str,
    /// Numbers of each pixel.
    pub parts: usize,
    /// The numbers.
    pub values: Values<'a>,
}

/// Numbers of a map.
pub enum Values<'a> {
    /// Indices; -1: none.
    Indices(&'a [i32]),
    /// Quantities; NaN: none.
    Quantities(&'a [f32]),
}

/// Samples along the scanlines.
pub struct Lines<'a> {
    /// Number of scanlines, and of samples along each.
    pub shape: [usize; 2],
    /// Lateral place and depth of each sample, mm, line by line.
    pub places: &'a [[f64; 2]],
    /// Frequency that the baseband was shifted by, MHz.
    pub frequency: f64,
    /// Speed by which depth is time, mm/us.
    pub speed: f64,
    /// Envelope, line by line.
    pub envelope: Option<&'a [f32]>,
    /// Real and imaginary part of the baseband, line by line.
    pub iq: Option<&'a [f32]>,
    /// Radio-frequency lines, and the place of each of their samples.
    pub rf: Option<(&'a [f32], &'a [[f64; 2]])>,
}

/// The file of frames.
///
/// # Panics
/// When an array does not have one value per pixel or sample of each frame.
pub fn bytes(of: &Frames<'_>) -> Vec<u8> {
    let mut file = FileBuilder::new();
    file.set_attr("zea_version", AttrValue::VarLenString(VERSION.to_owned()));
    file.set_attr("description", AttrValue::VarLenString(of.description.to_owned()));
    file.set_attr("us_machine", AttrValue::VarLenString("insonify".to_owned()));
    let mut metadata = file.create_group("metadata");
    let mut subject = metadata.create_group("subject");
    text(&mut subject, "id", of.subject);
    text(&mut subject, "type", "simulation");
    metadata.add_group(subject.finish());
    let mut pose = metadata.create_group("probe_pose");
    put_poses(&mut pose, of);
    metadata.add_group(pose.finish());
    file.add_group(metadata.finish());
    let metrics = file.create_group("metrics");
    file.add_group(metrics.finish());
    let mut tracks = file.create_group("tracks");
    let mut track = tracks.create_group("track_0");
    let mut data = track.create_group("data");
    put_images(&mut data, of);
    put_lines(&mut data, &of.lines, of.times.len());
    track.add_group(data.finish());
    tracks.add_group(track.finish());
    file.add_group(tracks.finish());
    file.finish().expect("groups, names and shapes fit the format")
}

fn text(group: &mut GroupBuilder, name: &str, value: &str) {
    group.create_dataset(name).with_vlen_strings(&[value]).with_shape(&[]);
}

fn named<'g>(group: &'g mut GroupBuilder, name: &str, unit: &str) -> &'g mut DatasetBuilder {
    let dataset = group.create_dataset(name);
    let unit = if unit.is_empty() { "-" } else { unit };
    dataset.set_attr("unit", AttrValue::VarLenString(unit.to_owned()))
}

/// An array of `shape`, compressed in chunks of one along its first axis.
fn packed(dataset: &mut DatasetBuilder, shape: &[usize]) {
    let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
    let mut chunk = shape.clone();
    chunk[0] = 1;
    dataset.with_shape(&shape).with_chunks(&chunk).with_shuffle().with_deflate(LEVEL);
}

/// The places of samples or pixels, m; `places` are mm, row by row of `rows`.
fn put_places(
    group: &mut GroupBuilder,
    places: impl Iterator<Item = [f64; 2]>,
    [rows, columns]: [usize; 2],
) {
    let metres = |mm: f64| (METRES * mm) as f32;
    let all: Vec<f32> = places.flat_map(|[x, z]| [metres(x), 0.0, metres(z)]).collect();
    let shape = [rows, columns, 3].map(|n| n as u64);
    let dataset = named(group, "coordinates", "m").with_f32_data(&all);
    dataset.with_shape(&shape).with_chunks(&shape).with_shuffle().with_deflate(LEVEL);
}

fn put_poses(group: &mut GroupBuilder, of: &Frames<'_>) {
    let count = of.times.len() as u64;
    let metres: Vec<f32> = of.positions.iter().flatten().map(|v| (METRES * v) as f32).collect();
    let turns: Vec<f32> = of.rotations.iter().flatten().map(|v| *v as f32).collect();
    let times: Vec<f32> = of.times.iter().map(|v| *v as f32).collect();
    named(group, "translation", "m").with_f32_data(&metres).with_shape(&[count, 3]);
    named(group, "rotation", "").with_f32_data(&turns).with_shape(&[count, 4]);
    text(group, "rotation_representation", "quaternion_wxyz");
    named(group, "start_time_offset", "s").with_f32_data(&[0.0]).with_shape(&[]);
    named(group, "timestamps", "s").with_f32_data(&times).with_shape(&[count]);
}

/// Images, segmentation and further maps, [frame, z, x], with the places of their pixels.
fn put_images(data: &mut GroupBuilder, of: &Frames<'_>) {
    let [width, height] = of.size.map(|n| n as usize);
    let frames = of.times.len();
    let pixels = frames * width * height;
    let at = |i: usize, axis: usize| of.corner[axis] + (i as f64 + 0.5) * of.pixel;
    let places = || (0..height).flat_map(|row| (0..width).map(move |x| [at(x, 0), at(row, 1)]));
    assert_eq!(of.images.len(), pixels, "a value per pixel");
    let mut image = data.create_group("image");
    packed(named(&mut image, "values", "").with_u8_data(of.images), &[frames, height, width]);
    put_places(&mut image, places(), [height, width]);
    data.add_group(image.finish());
    if let Some(segmentation) = of.segmentation {
        assert_eq!(segmentation.len(), pixels, "a class per pixel");
        // What h5py calls bool.
        let yes_or_no =
            EnumTypeBuilder::with_base(make_i8_type()).value("FALSE", 0).value("TRUE", 1).build();
        let yes_or_no = yes_or_no.expect("a byte holds 0 and 1");
        let classes = of.classes.len();
        let mut values = vec![0u8; pixels * classes];
        for (pixel, class) in segmentation.iter().enumerate() {
            let class = usize::from(*class);
            if class < classes {
                values[pixel * classes + class] = 1;
            }
        }
        let mut group = data.create_group("segmentation");
        let dataset = named(&mut group, "values", "").with_enum_u8_data(yes_or_no, &values);
        packed(dataset, &[frames, height, width, classes]);
        put_places(&mut group, places(), [height, width]);
        let labels: Vec<&str> = of.classes.iter().map(String::as_str).collect();
        group.create_dataset("labels").with_vlen_strings(&labels);
        data.add_group(group.finish());
    }
    for map in of.maps {
        let mut group = data.create_group(map.name);
        let dataset = named(&mut group, "values", map.unit);
        let dataset = match map.values {
            Values::Quantities(values) => dataset.with_f32_data(values),
            // The format knows no longer integers.
            Values::Indices(values) => {
                let short: Result<Vec<i16>, _> = values.iter().map(|v| i16::try_from(*v)).collect();
                match short {
                    Ok(short) => dataset.with_i16_data(&short),
                    Err(_) => {
                        let long: Vec<f32> = values.iter().map(|v| *v as f32).collect();
                        dataset.with_f32_data(&long)
                    }
                }
            }
        };
        let shape = [frames, height, width, map.parts];
        packed(dataset, if map.parts == 1 { &shape[..3] } else { &shape });
        put_places(&mut group, places(), [height, width]);
        text(&mut group, "description", map.meaning);
        if !map.unit.is_empty() {
            text(&mut group, "unit", map.unit);
        }
        data.add_group(group.finish());
    }
}

/// Envelope, baseband and radio frequency, [frame, z, x]: samples along depth, scanlines side by side.
fn put_lines(data: &mut GroupBuilder, of: &Lines<'_>, frames: usize) {
    let [lines, samples] = of.shape;
    if let Some(envelope) = of.envelope {
        let group = data.create_group("envelope_data");
        data.add_group(put_samples(group, [frames, lines, samples, 1], envelope, of.places));
    }
    if let Some(iq) = of.iq {
        let mut group = data.create_group("beamformed_data");
        group.create_dataset("labels").with_vlen_strings(&["I", "Q"]);
        let about = format!(
            "complex baseband before time-gain compensation, shifted by {} MHz; depth is time by {} m/s",
            of.frequency,
            1e3 * of.speed
        );
        text(&mut group, "description", &about);
        data.add_group(put_samples(group, [frames, lines, samples, 2], iq, of.places));
    }
    if let Some((rf, places)) = of.rf {
        let mut group = data.create_group("rf");
        let about = format!(
            "radio-frequency lines before time-gain compensation; depth is time by {} m/s",
            1e3 * of.speed
        );
        text(&mut group, "description", &about);
        data.add_group(put_samples(group, [frames, lines, places.len() / lines, 1], rf, places));
    }
}

/// Values of samples, `parts` of each, with their places.
fn put_samples(
    mut group: GroupBuilder,
    [frames, lines, samples, parts]: [usize; 4],
    values: &[f32],
    places: &[[f64; 2]],
) -> FinishedGroup {
    let count = lines * samples;
    assert_eq!([places.len(), values.len()], [count, frames * count * parts], "one per sample");
    let by_depth = || (0..samples).flat_map(move |k| (0..lines).map(move |l| l * samples + k));
    let turned: Vec<f32> = (0..frames)
        .flat_map(|frame| by_depth().map(move |i| (frame * count + i) * parts))
        .flat_map(|first| &values[first..first + parts])
        .copied()
        .collect();
    let shape = [frames, samples, lines, parts];
    let dataset = named(&mut group, "values", "").with_f32_data(&turned);
    packed(dataset, if parts == 1 { &shape[..3] } else { &shape });
    put_places(&mut group, by_depth().map(|i| places[i]), [samples, lines]);
    group.finish()
}
