//! Checks of the stored values of accessors against the file's statements about them.

use gltf::accessor::Dimensions;

use super::accessor::number;
use super::validate::{EXPORT_AGAIN, Finding};
use crate::issue::Severity;

/// Most values that are compared in all, component by component.
const MOST_VALUES: usize = 50_000_000;

/// Checks alignment and extent of all accessors, and their values against `min` and `max`. `buffers` may
/// lack those that were not needed.
pub(super) fn check(gltf: &gltf::Document, buffers: &[Option<Vec<u8>>]) -> Vec<Finding> {
    let mut out = Vec::new();
    let mut budget = MOST_VALUES;
    for accessor in gltf.accessors() {
        let mut remark = |message: String| {
            out.push(Finding {
                pointer: format!("/accessors/{}", accessor.index()),
                message,
                severity: Severity::Warning,
                remedy: EXPORT_AGAIN,
            });
        };
        let Some(view) = accessor.view() else {
            continue;
        };
        let (kind, width) = (accessor.dimensions(), accessor.data_type().size());
        let stride = view.stride().unwrap_or(accessor.size());
        let offset = view.offset().saturating_add(accessor.offset());
        if offset % width != 0 || stride % width != 0 {
            remark("is not aligned to its component size".to_owned());
        }
        if matches!(kind, Dimensions::Mat2 | Dimensions::Mat3) && width < 4 {
            remark("is a matrix of small integers, whose columns need padding".to_owned());
            continue;
        }
        if stride < accessor.size() {
            remark("has elements larger than the stride of its bufferView".to_owned());
        }
        let last = stride.saturating_mul(accessor.count().saturating_sub(1));
        if last.saturating_add(accessor.size()).saturating_add(accessor.offset()) > view.length() {
            remark("reaches beyond its bufferView".to_owned());
            continue;
        }
        let values = accessor.count().saturating_mul(kind.multiplicity());
        // A sparse accessor's bounds hold for the substituted values.
        let plain = accessor.sparse().is_none() && values <= budget;
        let buffer = buffers.get(view.buffer().index()).and_then(Option::as_ref);
        if let Some(bytes) = buffer.filter(|_| plain) {
            budget -= values;
            compare(&accessor, bytes.get(offset..).unwrap_or_default(), stride, &mut remark);
        }
    }
    out
}

/// Compares the elements that `bytes` begin with, each `stride` bytes after the one before.
fn compare(
    accessor: &gltf::Accessor<'_>,
    bytes: &[u8],
    stride: usize,
    remark: &mut impl FnMut(String),
) {
    let (n, width) = (accessor.dimensions().multiplicity(), accessor.data_type().size());
    let (mut low, mut high) = (vec![f64::INFINITY; n], vec![f64::NEG_INFINITY; n]);
    let mut not_finite = 0;
    for element in 0..accessor.count() {
        for component in 0..n {
            let at = element * stride + component * width;
            let Some(raw) = bytes.get(at..at + width) else {
                return remark("reaches beyond its buffer".to_owned());
            };
            let value = number(accessor.data_type(), false, raw);
            not_finite += usize::from(!value.is_finite());
            low[component] = low[component].min(value);
            high[component] = high[component].max(value);
        }
    }
    if not_finite > 0 {
        remark(format!("holds {not_finite} values that are not finite"));
    }
    for (key, stated, found) in [("min", accessor.min(), low), ("max", accessor.max(), high)] {
        let stated = stated.and_then(|list| serde_json::from_value::<Vec<f64>>(list).ok());
        let stated = stated.unwrap_or_default();
        // Stated bounds are decimal text of single-precision values.
        if stated.iter().zip(&found).any(|(s, f)| *s as f32 != *f as f32) {
            remark(format!("its {key} is stated as {stated:?} and is {found:?}"));
        }
    }
}
