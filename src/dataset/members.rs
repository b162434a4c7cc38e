//! The files of a sample: image, segmentation, arrays, and what was drawn.

use glam::{DAffine3, DQuat};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use serde_json::{Map, Value, json};

use super::plan::{Array, Plan};
use super::studio::Made;
use crate::output::npy::{self, Element};
use crate::scene::file::stated_pose;

/// Extension of the image.
pub(super) const IMAGE: &str = "png";
/// Extension of the segmentation.
pub(super) const SEGMENTATION: &str = "seg.png";

/// Extensions of a sample's files, in the order in which they are written.
pub(super) fn extensions(plan: &Plan) -> Vec<&'static str> {
    let arrays = plan.arrays.iter().map(|array| match array {
        Array::Envelope => "envelope.npy",
        Array::Iq => "iq.npy",
    });
    [IMAGE, SEGMENTATION].into_iter().chain(arrays).chain(["json"]).collect()
}

/// The bytes of a sample's files, in the order of [`extensions`].
pub(super) fn members(plan: &Plan, made: &Made) -> Vec<Vec<u8>> {
    let Made { settings, .. } = made;
    let shape = [settings.probe.scanlines as usize, settings.probe.samples as usize];
    let file = |extension: &&str| match *extension {
        IMAGE => grey(made),
        SEGMENTATION => indexed(made),
        "envelope.npy" => {
            let values = made.envelope.as_deref().expect("the plan asks for it");
            npy::bytes(Element::Float, &shape, bytemuck::cast_slice(values))
        }
        "iq.npy" => {
            let values = made.iq.as_deref().expect("the plan asks for it");
            npy::bytes(Element::Float, &[shape[0], shape[1], 2], bytemuck::cast_slice(values))
        }
        _ => (serde_json::to_string_pretty(&facts(plan, made)).expect("plain values") + "\n")
            .into_bytes(),
    };
    extensions(plan).iter().map(file).collect()
}

/// The image as a PNG file of 8-bit grey.
fn grey(made: &Made) -> Vec<u8> {
    let (width, height) = made.image.dimensions();
    let mut out = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut out, CompressionType::Default, FilterType::Adaptive);
    encoder
        .write_image(made.image.as_raw(), width, height, ExtendedColorType::L8)
        .expect("written to memory");
    out
}

/// The segmentation as a PNG file whose pixels are classes, and whose palette has a color for each.
fn indexed(made: &Made) -> Vec<u8> {
    let (width, height) = made.image.dimensions();
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette((0..=u8::MAX).flat_map(color).collect::<Vec<u8>>());
    let mut writer = encoder.write_header().expect("written to memory");
    writer.write_image_data(&made.segmentation).expect("a byte per pixel");
    writer.finish().expect("written to memory");
    out
}

/// The color of a class: black beside the sector, else hues a golden angle apart.
pub(super) fn color(class: u8) -> [u8; 3] {
    if class == 0 {
        return [0; 3];
    }
    // The golden angle is 0.381966 of a circle; here of 6 x 256 steps.
    let hue = (u32::from(class - 1) * 587) % 1536;
    let ramp = (hue % 256) as u8;
    let bright = |v: u8| 64 + v / 4 * 3;
    [
        [255, ramp, 0],
        [255 - ramp, 255, 0],
        [0, 255, ramp],
        [0, 255 - ramp, 255],
        [ramp, 0, 255],
        [255, 0, 255 - ramp],
    ][(hue / 256) as usize]
        .map(bright)
}

/// What was drawn for a sample, where the probe stood, and what its pixels are.
pub(super) fn facts(plan: &Plan, made: &Made) -> Value {
    let sample = &made.sample;
    let of = &plan.scenes[sample.scene];
    let mut set = Map::new();
    let (_, pose) = stated_pose(made.world_from_probe);
    for (path, text) in sample.entries.iter().chain([&pose]) {
        set.insert(path.clone(), value_of(text));
    }
    let named = |all: &[(String, f64)]| -> Map<String, Value> {
        all.iter().map(|(name, number)| (name.clone(), json!(number))).collect()
    };
    let mut pixels = Map::new();
    for (class, name) in (1u8..=u8::MAX).zip(&plan.classes) {
        let count = made.segmentation.iter().filter(|c| **c == class).count();
        if count > 0 {
            pixels.insert(name.clone(), json!({ "class": class, "pixels": count }));
        }
    }
    let (width, height) = made.image.dimensions();
    let place = made.world_from_probe;
    json!({
        "sample": sample.number,
        "split": plan.splits[of.split].name,
        "scene": of.name,
        "anatomy": of.anatomy,
        "time_s": sample.time,
        "seed": sample.seed,
        "quality": plan.quality.map(|q| format!("{q:?}").to_lowercase()),
        "set": set,
        "drawn": named(&sample.numbers),
        "variables": named(&sample.variables),
        "world_from_probe": rows(&place),
        "position_mm": place.translation.to_array(),
        "rotation_wxyz": wxyz(&place),
        "contact": made.contact.map(|touch| json!({ "share": touch.share, "depth_mm": touch.depth })),
        "image": {
            "width": width, "height": height,
            "pixel_mm": made.pixel, "left_mm": made.corner[0], "top_mm": made.corner[1],
        },
        "lines": {
            "scanlines": made.settings.probe.scanlines, "samples": made.settings.probe.samples,
            "sample_mm": made.settings.probe.sample_pitch(), "frequency_mhz": made.settings.probe.frequency,
        },
        "classes": pixels,
    })
}

/// The value of an entry of a scene file.
fn value_of(text: &str) -> Value {
    let parsed: Option<toml::Value> =
        format!("v = {text}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("v"));
    parsed.and_then(|value| serde_json::to_value(value).ok()).unwrap_or_else(|| json!(text))
}

/// Four rows of four numbers.
fn rows(place: &DAffine3) -> Value {
    let m = glam::DMat4::from(*place);
    json!([m.row(0).to_array(), m.row(1).to_array(), m.row(2).to_array(), m.row(3).to_array()])
}

/// The rotation as a quaternion whose real part comes first and is not below 0.
pub(super) fn wxyz(place: &DAffine3) -> [f64; 4] {
    let q = DQuat::from_mat3(&place.matrix3).normalize();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.x, q.y, q.z].map(|v| sign * v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_have_colors_that_are_told_apart() {
        let far = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > 30);
        for class in 0..=12 {
            assert!((0..class).all(|other| far(color(class), color(other))), "{class}");
        }
    }

    #[test]
    fn values_of_entries_are_those_of_the_file() {
        for (text, expected) in [
            ("\"3 dB\"", json!("3 dB")),
            ("12", json!(12)),
            ("[1, 2.5]", json!([1, 2.5])),
            ("{position=[0,1,2]}", json!({ "position": [0, 1, 2] })),
        ] {
            assert_eq!(value_of(text), expected);
        }
    }
}
