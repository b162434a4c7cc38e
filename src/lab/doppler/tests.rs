use std::f64::consts::TAU;

use super::*;

/// Echoes of one sample that turns `turns` times from pulse to pulse.
fn turning(turns: f64, pulses: usize) -> Vec<[f32; 2]> {
    let at = |n: usize| TAU * turns * n as f64;
    (0..pulses).map(|n| [at(n).cos() as f32, at(n).sin() as f32]).collect()
}

fn power(echoes: &[[f32; 2]]) -> f64 {
    let squares = echoes.as_flattened().iter().map(|&x| f64::from(x).powi(2));
    squares.sum::<f64>() / echoes.len() as f64
}

/// 1 - (1/N) sum |q_k^H e(f)|^2 with orthonormal polynomials: Bjaerum, Torp, Kristoffersen 2002 give the form.
#[test]
fn the_filter_passes_what_the_regression_leaves() {
    for (order, turns, expected) in [
        (1, 0.0, 0.0),
        (1, 0.05, 0.043),
        (1, 0.1, 0.409),
        (1, 0.25, 0.905),
        (0, 0.125, 1.0),
        (0, 0.0, 0.0),
    ] {
        let mut echoes = turning(turns, 8);
        wall_filter(&mut echoes, 8, Some(order));
        let passed = power(&echoes);
        assert!((passed - expected).abs() < 6e-4, "{order}, {turns}: {passed}");
    }
    let mut echoes = turning(0.1, 8);
    wall_filter(&mut echoes, 8, None);
    assert_eq!(echoes, turning(0.1, 8));
    // A parabola over the pulses is all of what a quadratic filter takes off.
    let mut echoes: Vec<[f32; 2]> =
        (0..6u8).map(f32::from).map(|n| [3.0 - n + 0.5 * n * n, 2.0 * n]).collect();
    wall_filter(&mut echoes, 6, Some(2));
    assert!(power(&echoes) < 1e-10);
}

#[test]
fn velocities_are_those_of_the_turns_up_to_nyquist() {
    for (turns, expected) in [(0.1, 20.0), (-0.3, -60.0), (0.6, -80.0), (0.0, 0.0)] {
        let found = correlations(&turning(turns, 6), 6, 1, 1)[0];
        assert!((found.velocity(100.0) - expected).abs() < 1e-4, "{turns}: {found:?}");
        assert!(found.variance(100.0) < 1e-3 && (found.power - 1.0).abs() < 1e-6);
    }
    assert_eq!(Correlation::default().velocity(100.0), 0.0);
    assert_eq!(Correlation::default().variance(100.0), 0.0);
    // Of c = 1.54 mm/us at 5 MHz and 4000 pulses a second.
    let probe = Probe { frequency: 5.0, ..Probe::linear() };
    assert!((nyquist(&probe, 4000.0) - 1.54e6 * 4000.0 / (4.0 * 5e6)).abs() < 1e-9);
}

#[test]
fn the_gate_averages_along_the_scanline_and_not_across() {
    // Two scanlines of three samples, of which one each is heard; two pulses.
    let pulse = [[0.0; 2], [1.0, 0.0], [0.0; 2], [0.0; 2], [0.0; 2], [2.0, 0.0]];
    let echoes = [pulse, pulse].concat();
    let found = correlations(&echoes, 2, 3, 3);
    let powers: Vec<f64> = found.iter().map(|c| c.power).collect();
    let expected = [0.5, 1.0 / 3.0, 0.5, 0.0, 4.0 / 3.0, 2.0];
    assert!(powers.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{powers:?}");
}

#[test]
fn the_box_is_within_the_image() {
    let probe = Probe::linear();
    let whole = Doppler { left: 0.0, right: 1.0, top: 0.0, bottom: 1.0, ..Doppler::default() };
    let made = packet(&probe, &whole);
    assert_eq!((made.lines, made.samples), (0..probe.scanlines, 0..probe.samples));
    let none = Doppler { left: 1.0, right: 0.0, top: 0.5, bottom: 0.5, ..Doppler::default() };
    let made = packet(&probe, &none);
    assert_eq!((made.lines.len(), made.samples.len()), (1, 1));
    let times = packet(&probe, &Doppler { pulses: 3, prf: 1000.0, ..Doppler::default() }).times;
    assert_eq!(times, [-1e-3, 0.0, 1e-3]);
}
