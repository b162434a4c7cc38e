//! The files of a sample: image, segmentation, arrays, and what was drawn.

use std::borrow::Cow;

use glam::DAffine3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use serde_json::{Map, Value, json};

use super::packed;
use super::plan::{Array, Plan, Precision};
use super::studio::Made;
use crate::exchange::wxyz;
use crate::output;
use crate::output::indexed::{self, NOTHING};
use crate::output::npy::{self, Element};
use crate::scene::file::stated_pose;
use crate::scene::palette;
use crate::sim::labels::LabelValues;

/// Extension of the image.
pub(super) const IMAGE: &str = "png";
/// Extension of the segmentation.
pub(super) const SEGMENTATION: &str = "seg.png";

/// Extensions of a sample's files, in the order in which they are written.
pub(super) fn extensions(plan: &Plan) -> Vec<String> {
    let arrays = plan.arrays.iter().map(|array| format!("{}.npy", array.name()));
    let pictures = [IMAGE, SEGMENTATION].map(str::to_owned);
    pictures.into_iter().chain(arrays).chain(["json".to_owned()]).collect()
}

/// The bytes of a sample's files, in the order of [`extensions`].
pub(super) fn members(plan: &Plan, made: &Made) -> Vec<Vec<u8>> {
    let mut out = vec![grey(made), indexed(plan, made)];
    out.extend(plan.arrays.iter().map(|array| npy(*array, made, plan.precision)));
    let facts = output::json(&facts(plan, made));
    out.push(facts.into_bytes());
    out
}

/// The values of an array, and its shape.
fn values(array: Array, made: &Made) -> (Vec<usize>, Values<'_>) {
    let probe = &made.settings.probe;
    let [lines, samples] = [probe.scanlines as usize, probe.samples as usize];
    let asked = "the plan asks for it";
    match array {
        Array::Envelope => {
            let values = made.envelope.as_deref().expect(asked);
            (vec![lines, samples], Values::Quantities(values))
        }
        Array::Iq => {
            let values = made.iq.as_deref().expect(asked);
            (vec![lines, samples, 2], Values::Quantities(values))
        }
        Array::Rf => {
            let values = made.rf.as_deref().expect(asked);
            (vec![lines, values.len() / lines], Values::Quantities(values))
        }
        Array::Label(kind) => {
            let label = made.labels.iter().find(|label| label.kind == kind).expect(asked);
            let values = match &label.values {
                LabelValues::Indices(values) => Values::Indices(values),
                LabelValues::Quantities(values) => Values::Quantities(values),
            };
            (label.shape.clone(), values)
        }
    }
}

/// Values of an array.
enum Values<'m> {
    Indices(&'m [i32]),
    Quantities(&'m [f32]),
}

/// An array as a NumPy file.
fn npy(array: Array, made: &Made, precision: Precision) -> Vec<u8> {
    let (shape, values) = values(array, made);
    let (element, bytes): (_, Cow<'_, [u8]>) = match (values, precision) {
        (Values::Quantities(all), Precision::Half) => (Element::Half, packed::halves(all).into()),
        (Values::Quantities(all), _) => (Element::Float, bytemuck::cast_slice(all).into()),
        (Values::Indices(all), precision) => {
            let short = (precision == Precision::Half).then(|| packed::shorts(all)).flatten();
            match short {
                Some(short) => (Element::Short, short.into()),
                None => (Element::Integer, bytemuck::cast_slice(all).into()),
            }
        }
    };
    let mut out = Vec::new();
    npy::write_to(&mut out, element, &shape, &bytes).expect("written to memory");
    out
}

/// The factor by which the numbers of each array in half precision are to be multiplied, by the array's name.
fn scales(plan: &Plan, made: &Made) -> Map<String, Value> {
    let half = plan.arrays.iter().filter(|_| plan.precision == Precision::Half);
    let scaled = half.filter_map(|array| match values(*array, made) {
        (_, Values::Quantities(all)) => {
            Some((array.name().to_owned(), json!(f64::from(packed::scale(all)))))
        }
        (_, Values::Indices(_)) => None,
    });
    scaled.collect()
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

/// The segmentation as a PNG file whose grey levels are classes, with their names and colours as text.
fn indexed(plan: &Plan, made: &Made) -> Vec<u8> {
    let (width, height) = made.image.dimensions();
    let legend = json!({ "classes": plan.classes, "colours": colours(plan) }).to_string();
    indexed::plain([width, height], &made.segmentation, &legend)
}

/// The colour of each class.
pub fn colours(plan: &Plan) -> Vec<[u8; 3]> {
    let numbered = plan.classes.iter().enumerate();
    numbered.map(|(i, name)| palette::look(name, i).0).collect()
}

/// The description of a sample: its draws, the place of the probe, the meaning of its pixels.
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
    for (class, name) in (0..NOTHING).zip(&plan.classes) {
        let count = made.segmentation.iter().filter(|c| **c == class).count();
        if count > 0 {
            pixels.insert(name.clone(), json!({ "class": class, "pixels": count }));
        }
    }
    let (width, height) = made.image.dimensions();
    let place = made.world_from_probe;
    let mut facts = json!({
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
    });
    let scales = scales(plan, made);
    if !scales.is_empty() {
        facts["scales"] = scales.into();
    }
    facts
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

#[cfg(test)]
mod tests {
    use super::*;

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
