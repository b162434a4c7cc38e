//! Twin of `interpolate`: vectors between keyframes.

use glam::{DVec3, DVec4};

use super::wavefront::unpacked;
use insonify::sim::layout::{PACKED, SUM};
use insonify::sim::push;

/// The `count` vectors that the kernel writes from `target` on; the fourth part is the coherence of those that are
/// packed, else 0.
pub fn interpolate(push: &push::Interpolate, values: &[f32]) -> Vec<DVec4> {
    let at = |vector: u32| {
        let at = (push.stride * vector) as usize;
        if push.kind == PACKED {
            let (direction, coherence) = unpacked(values[at].to_bits());
            return direction.extend(coherence);
        }
        DVec3::new(values[at].into(), values[at + 1].into(), values[at + 2].into()).extend(0.0)
    };
    let sum = |i| {
        let keyframes = push.sources.into_iter().zip(push.weights);
        let read = keyframes.filter(|&(_, weight)| weight != 0.0);
        read.map(|(source, weight)| f64::from(weight) * at(source + i)).sum()
    };
    let unit = |v: DVec4| v.truncate().normalize_or_zero().extend(v.w.clamp(0.0, 1.0));
    let made = (0..push.count).map(sum);
    if push.kind == SUM { made.collect() } else { made.map(unit).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use insonify::scene::smoothed::pack;
    use insonify::sim::layout::UNIT;

    #[test]
    fn vectors_lie_between_those_of_their_keyframes() {
        let values = [1.0, 2.0, 3.0, f32::NAN, 0.0, 0.0, 5.0, 10.0, -1.0];
        let mut push = push::Interpolate {
            count: 1,
            sources: [0, 2, 1, 1],
            weights: [0.75, 0.25, 0.0, 0.0],
            stride: 3,
            ..push::Interpolate::default()
        };
        assert_eq!(
            interpolate(&push, &values),
            [DVec4::new(2.0, 4.0, 2.0, 0.0)],
            "and what has no weight is not read"
        );
        push.kind = UNIT;
        assert_eq!(
            interpolate(&push, &values),
            [DVec3::new(1.0, 2.0, 1.0).normalize().extend(0.0)]
        );
        push.weights = [0.0; 4];
        assert_eq!(interpolate(&push, &values), [DVec4::ZERO]);
        let means = [(DVec3::X, 1.0), (DVec3::Y, 0.0), (-DVec3::Z, 1.0 / 3.0)];
        let values = means.map(|(v, coherence)| f32::from_bits(pack(v, coherence)));
        push = push::Interpolate {
            kind: PACKED,
            stride: 1,
            sources: [0, 1, 2, 2],
            weights: [0.6, 0.0, 0.3, 0.0],
            ..push
        };
        let [mean] = interpolate(&push, &values)[..] else { panic!("one") };
        assert!((mean.truncate() - DVec3::new(2.0, 0.0, -1.0).normalize()).length() < 1e-6);
        assert!((mean.w - 0.7).abs() < 1e-6, "0.6 of 1 and 0.3 of a third");
    }
}
