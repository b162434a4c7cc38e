//! Files of zea (HDF5): an image with its segmentation, the probe's pose, and the samples from which it was made.
//!
//! The layout is that of zea 0.1.8 (`zea.data.spec`). Lengths are in m; coordinates are x lateral, y elevation, z depth in
//! the probe's frame. Written by `hdf5-pure`, which needs no C library.

use hdf5_pure::{
    AttrValue, DatasetBuilder, EnumTypeBuilder, FileBuilder, GroupBuilder, make_i8_type,
};

/// Version of the format that files state.
const VERSION: &str = "0.1.8";
/// Compression of arrays.
const LEVEL: u32 = 4;
/// m in a mm.
const METRES: f64 = 1e-3;

/// One frame: the content of a file.
pub struct Frame<'a> {
    /// What the file is, in words.
    pub description: &'a str,
    /// The anatomy.
    pub subject: &'a str,
    /// Width and height of the image, pixels.
    pub size: [u32; 2],
    /// Grey level of each pixel, row by row.
    pub image: &'a [u8],
    /// Index into `classes` of each pixel; others: none.
    pub segmentation: &'a [u8],
    /// Names of the classes, at least one.
    pub classes: &'a [String],
    /// Left upper corner of the image, mm.
    pub corner: [f64; 2],
    /// Edge of a pixel, mm.
    pub pixel: f64,
    /// Place of the middle of the probe's face in the world, mm.
    pub position: [f64; 3],
    /// Rotation of the probe as a quaternion, the real part first.
    pub rotation: [f64; 4],
    /// The samples along the scanlines.
    pub lines: Lines<'a>,
}

/// Samples along the scanlines.
pub struct Lines<'a> {
    /// Number of scanlines, and of samples along each.
    pub shape: [usize; 2],
    /// Lateral place and depth of each sample, mm, line by line.
    pub places: &'a [[f64; 2]],
    /// Envelope, line by line.
    pub envelope: Option<&'a [f32]>,
    /// Real and imaginary part of the baseband, line by line.
    pub iq: Option<&'a [f32]>,
}

/// The file of a frame.
///
/// # Panics
/// When an array does not have one value per pixel or sample.
pub fn bytes(frame: &Frame<'_>) -> Vec<u8> {
    let mut file = FileBuilder::new();
    file.set_attr("zea_version", AttrValue::VarLenString(VERSION.to_owned()));
    file.set_attr("description", AttrValue::VarLenString(frame.description.to_owned()));
    file.set_attr("us_machine", AttrValue::VarLenString("insonify".to_owned()));
    let mut metadata = file.create_group("metadata");
    let mut subject = metadata.create_group("subject");
    text(&mut subject, "id", frame.subject);
    text(&mut subject, "type", "simulation");
    metadata.add_group(subject.finish());
    let mut pose = metadata.create_group("probe_pose");
    put_pose(&mut pose, frame);
    metadata.add_group(pose.finish());
    file.add_group(metadata.finish());
    let metrics = file.create_group("metrics");
    file.add_group(metrics.finish());
    let mut tracks = file.create_group("tracks");
    let mut track = tracks.create_group("track_0");
    let mut data = track.create_group("data");
    put_image(&mut data, frame);
    put_lines(&mut data, &frame.lines);
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
    dataset.set_attr("unit", AttrValue::VarLenString(unit.to_owned()))
}

/// An array of `shape` as one chunk, compressed.
fn packed(dataset: &mut DatasetBuilder, shape: &[usize]) {
    let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
    dataset.with_shape(&shape).with_chunks(&shape).with_shuffle().with_deflate(LEVEL);
}

fn put_pose(group: &mut GroupBuilder, frame: &Frame<'_>) {
    let metres = frame.position.map(|v| (METRES * v) as f32);
    named(group, "translation", "m").with_f32_data(&metres).with_shape(&[1, 3]);
    named(group, "rotation", "-")
        .with_f32_data(&frame.rotation.map(|v| v as f32))
        .with_shape(&[1, 4]);
    text(group, "rotation_representation", "quaternion_wxyz");
    named(group, "start_time_offset", "s").with_f32_data(&[0.0]).with_shape(&[]);
    named(group, "timestamps", "s").with_f32_data(&[0.0]).with_shape(&[1]);
}

/// Image and segmentation, [frame, z, x], with the places of their pixels.
fn put_image(data: &mut GroupBuilder, frame: &Frame<'_>) {
    let [width, height] = frame.size.map(|n| n as usize);
    assert_eq!(
        [frame.image.len(), frame.segmentation.len()],
        [width * height; 2],
        "a value per pixel"
    );
    let at = |i: usize, axis: usize| METRES * (frame.corner[axis] + (i as f64 + 0.5) * frame.pixel);
    let places = (0..height).flat_map(|row| (0..width).map(move |column| [column, row]));
    let places: Vec<f32> =
        places.flat_map(|[x, z]| [at(x, 0) as f32, 0.0, at(z, 1) as f32]).collect();
    let mut image = data.create_group("image");
    packed(named(&mut image, "values", "-").with_u8_data(frame.image), &[1, height, width]);
    packed(named(&mut image, "coordinates", "m").with_f32_data(&places), &[height, width, 3]);
    data.add_group(image.finish());
    // What h5py calls bool.
    let yes_or_no =
        EnumTypeBuilder::with_base(make_i8_type()).value("FALSE", 0).value("TRUE", 1).build();
    let yes_or_no = yes_or_no.expect("a byte holds 0 and 1");
    let classes = frame.classes.len();
    let mut values = vec![0u8; width * height * classes];
    for (pixel, class) in frame.segmentation.iter().enumerate() {
        let class = usize::from(*class);
        if class < classes {
            values[pixel * classes + class] = 1;
        }
    }
    let mut segmentation = data.create_group("segmentation");
    let dataset = named(&mut segmentation, "values", "-").with_enum_u8_data(yes_or_no, &values);
    packed(dataset, &[1, height, width, classes]);
    packed(
        named(&mut segmentation, "coordinates", "m").with_f32_data(&places),
        &[height, width, 3],
    );
    let labels: Vec<&str> = frame.classes.iter().map(String::as_str).collect();
    segmentation.create_dataset("labels").with_vlen_strings(&labels);
    data.add_group(segmentation.finish());
}

/// Envelope and baseband, [frame, z, x]: samples along depth, scanlines side by side.
fn put_lines(data: &mut GroupBuilder, of: &Lines<'_>) {
    let [lines, samples] = of.shape;
    assert_eq!(of.places.len(), lines * samples, "a place per sample");
    let by_depth = || (0..samples).flat_map(move |k| (0..lines).map(move |l| l * samples + k));
    let metres = |mm: f64| (METRES * mm) as f32;
    let places: Vec<f32> =
        by_depth().flat_map(|i| [metres(of.places[i][0]), 0.0, metres(of.places[i][1])]).collect();
    if let Some(envelope) = of.envelope {
        let mut group = data.create_group("envelope_data");
        let values: Vec<f32> = by_depth().map(|i| envelope[i]).collect();
        packed(named(&mut group, "values", "-").with_f32_data(&values), &[1, samples, lines]);
        packed(named(&mut group, "coordinates", "m").with_f32_data(&places), &[samples, lines, 3]);
        data.add_group(group.finish());
    }
    if let Some(iq) = of.iq {
        let mut group = data.create_group("beamformed_data");
        let values: Vec<f32> = by_depth().flat_map(|i| [iq[2 * i], iq[2 * i + 1]]).collect();
        packed(named(&mut group, "values", "-").with_f32_data(&values), &[1, samples, lines, 2]);
        packed(named(&mut group, "coordinates", "m").with_f32_data(&places), &[samples, lines, 3]);
        group.create_dataset("labels").with_vlen_strings(&["I", "Q"]);
        data.add_group(group.finish());
    }
}
