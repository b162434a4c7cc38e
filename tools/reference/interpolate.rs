//! Twin of `interpolate`: vectors between keyframes.

use glam::DVec3;

use insonify::sim::layout::Interpolation;

/// The `count` vectors that the kernel writes from `target` on.
pub fn interpolate(push: &Interpolation, values: &[f32]) -> Vec<DVec3> {
    let at = |vector: u32| {
        let at = (push.stride * vector) as usize;
        DVec3::new(values[at].into(), values[at + 1].into(), values[at + 2].into())
    };
    let sum = |i| {
        let keyframes = push.sources.into_iter().zip(push.weights);
        let read = keyframes.filter(|&(_, weight)| weight != 0.0);
        read.map(|(source, weight)| f64::from(weight) * at(source + i)).sum()
    };
    let made = (0..push.count).map(sum);
    if push.unit == 0 { made.collect() } else { made.map(DVec3::normalize_or_zero).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_lie_between_those_of_their_keyframes() {
        let values = [1.0, 2.0, 3.0, f32::NAN, 0.0, 0.0, 5.0, 10.0, -1.0];
        let mut push = Interpolation {
            count: 1,
            sources: [0, 2, 1, 1],
            weights: [0.75, 0.25, 0.0, 0.0],
            stride: 3,
            ..Interpolation::default()
        };
        assert_eq!(
            interpolate(&push, &values),
            [DVec3::new(2.0, 4.0, 2.0)],
            "and what has no weight is not read"
        );
        push.unit = 1;
        assert_eq!(interpolate(&push, &values), [DVec3::new(1.0, 2.0, 1.0).normalize()]);
        push.weights = [0.0; 4];
        assert_eq!(interpolate(&push, &values), [DVec3::ZERO]);
    }
}
