//! Checks of the stored values of accessors against the file's statements about them.

use serde_json::{Map, Value};

use super::validate::{EXPORT_AGAIN, Finding};
use crate::issue::Severity;

/// Most values that are compared in all, component by component.
const MOST_VALUES: usize = 50_000_000;

/// Components of an element, 0 for an unknown type.
pub(super) fn components(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => 0,
    }
}

/// Bytes of a component, 0 for an unknown type.
fn width(component: u64) -> usize {
    match component {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5125 | 5126 => 4,
        _ => 0,
    }
}

/// Checks alignment and extent of all accessors, and their values against `min` and `max`. `buffers` may
/// lack those that were not needed.
pub(super) fn check(root: &Map<String, Value>, buffers: &[Option<Vec<u8>>]) -> Vec<Finding> {
    let list = |name| root.get(name).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let mut out = Vec::new();
    let mut budget = MOST_VALUES;
    for (i, accessor) in list("accessors").iter().enumerate() {
        let mut remark = |message: String| {
            out.push(Finding {
                pointer: format!("/accessors/{i}"),
                message,
                severity: Severity::Warning,
                remedy: EXPORT_AGAIN,
            });
        };
        let Some(layout) = Layout::of(accessor, list("bufferViews")) else {
            continue;
        };
        if layout.offset % layout.width != 0 || layout.stride % layout.width != 0 {
            remark("is not aligned to its component size".to_owned());
        }
        if layout.kind.starts_with("MAT") && layout.width < 4 && layout.kind != "MAT4" {
            remark("is a matrix of small integers, whose columns need padding".to_owned());
            continue;
        }
        if layout.stride < components(layout.kind) * layout.width {
            remark("has elements larger than the stride of its bufferView".to_owned());
        }
        if layout.relative_end() > layout.view_length {
            remark("reaches beyond its bufferView".to_owned());
            continue;
        }
        let values = layout.count * components(layout.kind);
        // A sparse accessor's bounds hold for the substituted values.
        let plain = accessor.get("sparse").is_none() && values <= budget;
        let buffer = buffers.get(layout.buffer).and_then(Option::as_ref);
        if let Some(bytes) = buffer.filter(|_| plain) {
            budget -= values;
            compare(accessor, &layout, bytes, &mut remark);
        }
    }
    out
}

struct Layout<'a> {
    kind: &'a str,
    component: u64,
    width: usize,
    count: usize,
    buffer: usize,
    /// From the start of the buffer.
    offset: usize,
    in_view: usize,
    view_length: usize,
    stride: usize,
}

impl<'a> Layout<'a> {
    fn of(accessor: &'a Value, views: &[Value]) -> Option<Self> {
        let number = |value: &Value, key: &str| {
            let value = value.get(key)?;
            let whole = value.as_u64().or_else(|| value.as_f64().map(|v| v as u64))?;
            usize::try_from(whole).ok()
        };
        let view = views.get(number(accessor, "bufferView")?)?;
        let kind = accessor.get("type")?.as_str()?;
        let component = number(accessor, "componentType")? as u64;
        let width = width(component);
        let element = components(kind) * width;
        if element == 0 {
            return None;
        }
        let in_view = number(accessor, "byteOffset").unwrap_or(0);
        Some(Self {
            kind,
            component,
            width,
            count: number(accessor, "count")?,
            buffer: number(view, "buffer")?,
            offset: number(view, "byteOffset").unwrap_or(0).checked_add(in_view)?,
            in_view,
            view_length: number(view, "byteLength")?,
            stride: number(view, "byteStride").unwrap_or(element),
        })
    }

    fn relative_end(&self) -> usize {
        let last = self.stride.saturating_mul(self.count.saturating_sub(1));
        let element = components(self.kind) * self.width;
        last.saturating_add(element).saturating_add(self.in_view)
    }

    fn value(&self, bytes: &[u8], element: usize, component: usize) -> Option<f64> {
        let at = self.offset + element * self.stride + component * self.width;
        let raw = bytes.get(at..at + self.width)?;
        let word = raw.iter().rev().fold(0u32, |sum, &b| sum << 8 | u32::from(b));
        Some(match self.component {
            5120 => f64::from(word as u8 as i8),
            5122 => f64::from(word as u16 as i16),
            5126 => f64::from(f32::from_bits(word)),
            _ => f64::from(word),
        })
    }
}

fn compare(accessor: &Value, layout: &Layout<'_>, bytes: &[u8], remark: &mut impl FnMut(String)) {
    let n = components(layout.kind);
    let (mut low, mut high) = (vec![f64::INFINITY; n], vec![f64::NEG_INFINITY; n]);
    let mut not_finite = 0;
    for element in 0..layout.count {
        for component in 0..n {
            let Some(value) = layout.value(bytes, element, component) else {
                return remark("reaches beyond its buffer".to_owned());
            };
            not_finite += usize::from(!value.is_finite());
            low[component] = low[component].min(value);
            high[component] = high[component].max(value);
        }
    }
    if not_finite > 0 {
        remark(format!("holds {not_finite} values that are not finite"));
    }
    for (key, found) in [("min", low), ("max", high)] {
        let stated: Option<Vec<f64>> = accessor
            .get(key)
            .and_then(Value::as_array)
            .and_then(|a| a.iter().map(Value::as_f64).collect());
        let differs = |stated: &Vec<f64>| {
            // Stated bounds are decimal text of single-precision values.
            stated.iter().zip(&found).any(|(s, f)| *s as f32 != *f as f32)
        };
        if stated.as_ref().is_some_and(differs) {
            remark(format!(
                "its {key} is stated as {:?} and is {found:?}",
                stated.unwrap_or_default()
            ));
        }
    }
}
