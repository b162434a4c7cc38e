//! Sine, cosine and arctangent as `glsl/angles.glsl` computes them, operation by operation in single
//! precision: a device that rounds sums and products as Vulkan demands gives the same bits.

/// Point of the unit circle at an angle in turns: cosine and sine.
#[expect(clippy::excessive_precision, reason = "as in the kernel")]
pub fn phasor(turns: f32) -> [f32; 2] {
    let t = turns - (turns + 0.5).floor();
    let half_turn = if t < 0.0 { -0.5 } else { 0.5 };
    let sine_of = |z: f32| {
        let w = z * z;
        z * (6.283185005
            + w * (-41.34165573 + w * (81.60100555 + w * (-76.54978180 + w * 39.53670502))))
    };
    let folded = if t.abs() > 0.25 { half_turn - t } else { t };
    [sine_of(0.25 - t.abs()), sine_of(folded)]
}

/// Angle of the point (x, y) from the x axis towards y, radians.
#[expect(clippy::excessive_precision, reason = "as in the kernel")]
pub fn arc(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, PI};
    let (a, b) = (x.abs(), y.abs());
    let longer = a.max(b);
    let z = if longer > 0.0 { a.min(b) / longer } else { 0.0 };
    let w = z * z;
    let end = 0.02186295576 - w * 0.004054566845;
    let end = -0.1390862912 + w * (0.09642197192 + w * (-0.05591232330 + w * end));
    let mut angle = z * (0.9999993443 + w * (-0.3332985938 + w * (0.1994656622 + w * end)));
    if b > a {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    if y < 0.0 { -angle } else { angle }
}

/// Arcsine of s in [-1, 1], radians.
pub fn arcsine(s: f32) -> f32 {
    arc(s, ((1.0 - s) * (1.0 + s)).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Largest error of `got` over a million angles, turns in [-1/2, 1/2].
    fn worst(got: impl Fn(f32) -> f64) -> f64 {
        let at = |i: i32| i as f32 / 1_000_000.0;
        (-500_000..=500_000).map(|i| got(at(i))).fold(0.0, f64::max)
    }

    #[test]
    fn the_unit_circle_is_met_within_a_quarter_of_a_millionth() {
        let error = |turns: f32| {
            let (sin, cos) = (TAU * f64::from(turns)).sin_cos();
            let [x, y] = phasor(turns).map(f64::from);
            (x - cos).abs().max((y - sin).abs())
        };
        let found = worst(error);
        println!("within half a turn {found:.2e}");
        assert!(found < 2.5e-7, "{found:e}");
        // Whole turns are taken off without error; what is left is the argument's own place.
        let far = worst(|t| error(t * 3000.0)).max(error(4_194_303.5));
        println!("within 1500 turns {far:.2e}");
        assert!(far < 2.5e-7, "{far:e}");
        for quarter in -8i16..8 {
            let [x, y] = phasor(f32::from(quarter) / 4.0);
            let whole = quarter.rem_euclid(4);
            let on = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][whole as usize];
            let [off_x, off_y] = [x - on[0], y - on[1]];
            assert!(off_x.abs() < 2.5e-7 && off_y.abs() < 2.5e-7, "{quarter}");
        }
        // A device may err by 2^-11: that would not pass.
        assert!(worst(|t| error(t) + f64::powi(2.0, -11)) > 2.5e-7);
    }

    #[test]
    fn directions_and_arcsines_are_met_within_half_a_millionth() {
        let found = worst(|turns| {
            let (sin, cos) = (TAU * f64::from(turns)).sin_cos();
            let [x, y] = [130.0 * cos, 130.0 * sin].map(|x| x as f32);
            (f64::from(arc(y, x)) - f64::from(y).atan2(x.into())).abs()
        });
        println!("arc {found:.2e}");
        assert!(found < 4e-7, "{found:e}");
        let found = worst(|half| {
            let s = 2.0 * half;
            (f64::from(arcsine(s)) - f64::from(s).asin()).abs()
        });
        println!("arcsine {found:.2e}");
        assert!(found < 5e-7, "{found:e}");
        assert_eq!([arc(0.0, 0.0), arc(0.0, 2.0), arcsine(0.0)], [0.0; 3]);
    }
}
