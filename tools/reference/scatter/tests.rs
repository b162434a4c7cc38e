use super::super::fixture::{Fixture, rows_of, tissue};
use super::*;
use insonify::sim::layout::NONE;

fn segment(length: f64) -> Segment {
    Segment {
        origin: DVec3::ZERO,
        length,
        direction: DVec3::Z,
        time: 0.0,
        lateral: DVec3::X,
        weight: 1.0,
        spread: [0.0; 3],
        lens: [0.0; 3],
        // The fixture's scanline has no neighbours: its pitch is the face's width.
        strip: [10.0, 0.0],
        reflected: false,
        share: 1.0,
        tissue: 0,
        instance: NONE,
        line: 0,
        handedness: 1.0,
    }
}

fn point_fixture(absorption: f32) -> Fixture {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, absorption)]);
    fixture.tissues[0].presence = 0.0;
    fixture
}

fn magnitude(out: &Accumulator, k: usize) -> f64 {
    out.exact[2 * k].hypot(out.exact[2 * k + 1])
}

/// Relative error of a point's echo at 20 mm, off axis, in a tissue of 0.5 dB/(cm MHz) at 3 MHz.
fn point_error(fixture: &Fixture) -> f64 {
    let [x, y] = [0.3f64, -0.5];
    let out = points(&fixture.world(), &[segment(60.0)]);
    // Two-way loss of 2 cm: 2 * 0.5 dB/(cm MHz) * 3 MHz * 2 cm = 6 dB of amplitude.
    let expected = 2.0
        * 10f64.powf(-6.0 / 20.0)
        * (-x * x / (2.0 * 0.16)).exp()
        * (-y * y / (2.0 * 0.36)).exp();
    let total = magnitude(&out, 80) + magnitude(&out, 81);
    (total / expected - 1.0).abs()
}

// Positions, widths and the decay are stored in f32: 1e-6.
#[test]
fn a_point_echoes_with_the_beam_and_two_way_attenuation() {
    let absorption = 0.5 * 3.0 * std::f64::consts::LN_10 / 100.0;
    let mut fixture = point_fixture(absorption as f32);
    fixture.points = vec![[0.3, -0.5, 20.0, 2.0]];
    assert!(point_error(&fixture) < 1e-6);
    fixture.tissues[0].absorption /= 2.0;
    assert!(point_error(&fixture) > 0.1, "one-way attenuation is caught");
}

#[test]
fn points_outside_the_beam_the_slab_or_the_segment_are_silent() {
    let mut fixture = point_fixture(0.0);
    fixture.frame.layers = 3;
    let seen = |fixture: &mut Fixture, p: [f32; 3], line: u32| {
        fixture.points = vec![[p[0], p[1], p[2], 1.0]];
        let s = Segment { line, ..segment(30.0) };
        points(&fixture.world(), &[s]).exact.iter().any(|&v| v != 0.0)
    };
    // Half a layer's slab is 1 mm, give or take a hundredth of a slab; lateral cut at 1.6 mm.
    assert!(seen(&mut fixture, [1.59, 0.97, 29.9], 1));
    assert!(!seen(&mut fixture, [1.61, 0.0, 20.0], 1));
    assert!(!seen(&mut fixture, [0.0, 1.03, 20.0], 1));
    assert!(!seen(&mut fixture, [0.0, 0.0, 30.1], 1));
    assert!(!seen(&mut fixture, [0.0, 0.0, -0.1], 1));
}

// Where layers would meet at round numbers, rounding would decide.
#[test]
fn a_point_between_two_layers_belongs_to_one() {
    let mut fixture = point_fixture(0.0);
    fixture.frame.layers = 3;
    for y in [-1.0 - 1e-6, -1.0, -1.0 + 1e-6, 1.0 - 1e-6, 1.0, 1.0 + 1e-6] {
        fixture.points = vec![[0.0, y as f32, 20.0, 1.0]];
        let heard = |layer: u32| {
            let s = Segment {
                origin: DVec3::new(0.0, 2.0 * f64::from(layer) - 2.0, 0.0),
                line: layer,
                ..segment(30.0)
            };
            points(&fixture.world(), &[s]).deposits.iter().any(|&n| n > 0)
        };
        assert_eq!((0..3).filter(|&layer| heard(layer)).count(), 1, "{y}");
    }
}

#[test]
fn elevation_weighs_the_distance_from_the_image_plane() {
    // Layer 2 of 3 lies at y = 2; its segment starts there.
    let mut fixture = point_fixture(0.0);
    fixture.frame.layers = 3;
    fixture.points = vec![[0.0, 1.5, 20.0, 1.0]];
    let s = Segment { origin: DVec3::new(0.0, 2.0, 0.0), line: 2, ..segment(30.0) };
    let total = |s| {
        let out = points(&fixture.world(), &[s]);
        magnitude(&out, 80) + magnitude(&out, 81)
    };
    let expected = (-(1.5f64 / 0.6).powi(2) / 2.0).exp();
    assert!((total(s) / expected - 1.0).abs() < 1e-6);
    // Mirrored twice, once with the other handedness: the elevation axis stays what it was.
    let flipped = Segment { lateral: -DVec3::X, handedness: -1.0, ..s };
    assert!((total(flipped) / expected - 1.0).abs() < 1e-6);
}

// Independent scatterers add their powers. The closed form integrates the squares of what is heard: of a tent 0.8 mm to
// either side 2/3 of 0.8 mm, in elevation sigma_e sqrt(pi) erf(4), one sample each.
// 6 lattices of 200 samples, speckle of correlation length one sample: 4 / sqrt(1200) = 12 %.
fn expected_power(fixture: &Fixture) -> f64 {
    let section = 2.0 / 3.0 * 0.8 * 0.6 * std::f64::consts::PI.sqrt();
    let t = fixture.tissues[0];
    let amplitude = f64::from(t.amplitude).powi(2);
    amplitude / f64::from(fixture.frame.cell).powi(3) * section * 0.25
}

fn mean_power(fixture: &mut Fixture, segments: &[Segment]) -> f64 {
    let mut power = 0.0;
    for seed in 0..6 {
        fixture.tissues[0].seed = seed;
        let out = scatter(&fixture.world(), segments, Scatter::IMAGE);
        power += (20..220).map(|k| magnitude(&out, k).powi(2)).sum::<f64>();
    }
    power / 1200.0
}

#[test]
fn a_lattice_is_as_bright_as_its_density_says() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    (fixture.tissues[0].density, fixture.tissues[0].amplitude) = (0.4, 0.8);
    let s = Segment {
        direction: DVec3::new(0.36, 0.48, 0.8),
        lateral: DVec3::new(0.8, -0.6, 0.0),
        ..segment(60.0)
    };
    let got = mean_power(&mut fixture, &[s]);
    let expected = expected_power(&fixture);
    assert!((got / expected - 1.0).abs() < 0.12, "{got} {expected}");
}

#[test]
fn texture_changes_the_level_but_not_the_mean_power_law() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    (fixture.tissues[0].texture_depth, fixture.tissues[0].texture_length) = (0.5, 0.7);
    let got = mean_power(&mut fixture, &[segment(60.0)]);
    // E (1 + k L)^2 = 1 + k^2; the texture adds to the spread: twice the bound above.
    let expected = 1.25 * expected_power(&fixture);
    assert!((got / expected - 1.0).abs() < 0.24, "{got} {expected}");
}

// Sums of the same terms in another order: 1e-9 is rounding.
fn worst(a: &Accumulator, b: &Accumulator) -> f64 {
    let pairs = a.exact.iter().zip(&b.exact);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_cut_segment_sums_to_the_whole() {
    for flags in [0, FLAG_VOXEL] {
        let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.01)]);
        fixture.frame.flags = flags;
        // Off the cells' faces, where rounding would choose the voxel.
        let whole = Segment { origin: DVec3::new(0.1, 0.05, 0.07), ..segment(30.0) };
        let cut = 12.34;
        let rest = Segment {
            origin: whole.origin + cut * whole.direction,
            length: 30.0 - cut,
            time: cut / 1.5,
            weight: (-f64::from(0.01f32) * cut).exp(),
            ..whole
        };
        let halves = [Segment { length: cut, ..whole }, rest];
        let (a, b) = (
            scatter(&fixture.world(), &[whole], Scatter::IMAGE),
            scatter(&fixture.world(), &halves, Scatter::IMAGE),
        );
        assert!(a.exact.iter().any(|&v| v != 0.0));
        assert!(worst(&a, &b) < 1e-9, "{}", worst(&a, &b));
        assert!(
            worst(&a, &scatter(&fixture.world(), &halves[..1], Scatter::IMAGE)) > 1e-2,
            "a lost half is caught"
        );
    }
}

#[test]
fn the_lattice_moves_with_its_instance() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    fixture.block([-1.0; 3], [1.0; 3], 0, 0);
    let still = Segment { instance: 0, ..segment(20.0) };
    let a = scatter(&fixture.world(), &[still], Scatter::IMAGE);
    // A quarter turn and whole millimetres: exact in f32.
    let turn = DAffine3 {
        matrix3: glam::DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z),
        translation: DVec3::new(5.0, -3.0, 2.0),
    };
    fixture.instances[0].texture_from_world = rows_of(&turn.inverse());
    let moved = Segment {
        origin: turn.transform_point3(still.origin),
        direction: turn.transform_vector3(still.direction),
        lateral: turn.transform_vector3(still.lateral),
        ..still
    };
    assert!(worst(&a, &scatter(&fixture.world(), &[moved], Scatter::IMAGE)) < 1e-9);
    fixture.frame.flags = insonify::sim::layout::FLAG_WORLD_TEXTURE;
    assert!(
        worst(&a, &scatter(&fixture.world(), &[moved], Scatter::IMAGE)) > 0.1,
        "now it slides through the world"
    );
}

#[test]
fn spread_averages_down_and_never_up() {
    let mut fixture = point_fixture(0.0);
    fixture.points = vec![[0.0, 0.0, 20.0, 1.0]];
    let echo = |spread, share| {
        let s = Segment { spread, share, ..segment(60.0) };
        let out = points(&fixture.world(), &[s]);
        magnitude(&out, 80) + magnitude(&out, 81)
    };
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    close(echo([0.0; 3], 1.0), 1.0);
    // Variance 0.01 * 20^2 = 4 mm^2 over sigmas 0.4 and 0.6.
    let cells = (1.0f64 + 4.0 / 0.16).sqrt() * (1.0f64 + 4.0 / 0.36).sqrt();
    close(echo([0.0, 0.0, 0.01], 1.0), cells.recip().sqrt());
    close(echo([0.0, 0.0, 0.01], 4.0), (4.0 / cells).sqrt());
    close(echo([0.0, 0.0, 0.01], 1e3), 1.0);
}

/// A lens widens the transmitted and the received beam by the offset's square, their product by half of it; energy
/// stays, so that the echo on the axis falls as the width grows.
#[test]
fn a_lens_widens_and_dims() {
    let mut fixture = point_fixture(0.0);
    let mut echo = |lens, x| {
        fixture.points = vec![[x, 0.0, 20.0, 1.0]];
        let s = Segment { lens, ..segment(60.0) };
        let out = points(&fixture.world(), &[s]);
        magnitude(&out, 80) + magnitude(&out, 81)
    };
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    // 0.1 mm - 0.03 * 20 mm + 0.002 / mm * 400 mm^2 = 0.3 mm.
    let lens = [0.1, -0.03, 0.002];
    let widened = 1.0 + 0.045 / 0.16;
    close(echo(lens, 0.0), 1.0 / f64::sqrt(widened));
    let off_axis = f64::exp(-0.25 / (2.0 * 0.16 * widened));
    close(echo(lens, 0.5), off_axis / f64::sqrt(widened));
    close(echo(lens.map(|l| -l), 0.5), off_axis / f64::sqrt(widened));
    close(echo([100.0, 0.0, 0.0], 0.0), 1.0 / 3.0);
}

#[test]
fn voxels_are_one_sample_each_and_as_bright_as_their_presence() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    fixture.frame.flags = FLAG_VOXEL;
    fixture.tissues[0].presence = 0.4;
    fixture.frame.cell = 0.25;
    let out = scatter(&fixture.world(), &[segment(60.0)], Scatter::IMAGE);
    assert!(out.deposits.iter().sum::<u32>() <= 240);
    let got = mean_power(&mut fixture, &[segment(60.0)]);
    // One echo per sample.
    let expected = 0.4;
    assert!((got / expected - 1.0).abs() < 0.2, "{got} {expected}");
}

// Every level is as bright as the finest lattice, in the middle of a level and in the cross-fade to the
// next. A coarse lattice has fewer scatterers under the beam: up to 8 in 24 lattices of 200 samples, 6 %.
#[test]
fn every_level_is_as_bright_as_the_finest() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    let s = Segment {
        direction: DVec3::new(0.36, 0.48, 0.8),
        lateral: DVec3::new(0.8, -0.6, 0.0),
        ..segment(60.0)
    };
    let expected = expected_power(&fixture);
    for level in [0.0, 0.9, 1.5, 2.85, 4.0] {
        for row in &mut fixture.rows {
            row.shape[3] = level;
        }
        let mut got = 0.0;
        for seed in 0..4 {
            fixture.frame.cell = 0.25 + 1e-3 * seed as f32;
            got += mean_power(&mut fixture, &[s]) / 4.0;
        }
        let ratio = got / expected;
        assert!((ratio - 1.0).abs() < 0.08, "level {level}: {ratio}");
    }
}

// Behind a lens that makes a beam four times as wide each scatterer is heard with half the power; no more of them are.
#[test]
fn a_lens_dims_speckle_by_what_it_widens_the_beam() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    let mut measured = |s: Segment| {
        let power = mean_power(&mut fixture, &[s]);
        (power, scatter(&fixture.world(), &[s], Scatter::IMAGE).deposits)
    };
    // Both beams, which converge there, have a variance more by 0.96 mm^2; without a lens they add up to 0.64 mm^2.
    let (even, behind) = (
        measured(segment(60.0)),
        measured(Segment { lens: [f64::sqrt(0.96), 0.0, 0.0], ..segment(60.0) }),
    );
    assert!((behind.0 / even.0 - 0.5).abs() < 1e-6, "{} {}", behind.0, even.0);
    assert_eq!(behind.1, even.1);
}

// A thin lens of power p, `x` in front of a target: a ray turns by p times its distance from the axis. The received beam
// converges on the target, the transmitted one on its focus, in front of it or behind.
#[test]
fn a_thin_lens_moves_both_focuses() {
    let fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    let [waist, x, sine, receive] = [0.4_f64, 20.0, 0.08, 0.12];
    for [power, focus] in [[-0.01_f64, 30.0], [0.01, 30.0], [-0.01, -12.0], [0.02, 0.0]] {
        // Behind the lens rays of one deviation were this far from the axis there.
        let transmitted = (sine * (focus + x), sine * focus);
        let after = transmitted.1 + power * x * transmitted.0;
        let missed = power * x * receive * x;
        let variances = waist.powi(2) + transmitted.1.powi(2) + 0.09;
        let expected = (variances / (waist.powi(2) + after.powi(2) + 0.09 + missed.powi(2))).sqrt();
        let expected = expected.min(1.0);
        let row = Row {
            aperture: receive as f32,
            variances: variances as f32,
            defocus: transmitted.1 as f32,
            transmit_sine: sine as f32,
            ..fixture.rows[0]
        };
        let s = Segment { lens: [0.0, 0.0, receive * power], ..segment(60.0) };
        let world = fixture.world();
        let got = Tube::new(&world, &s, DAffine3::IDENTITY, None).spoiled(x, &row);
        assert!((got / expected - 1.0).abs() < 1e-6, "{power} {focus}: {got} {expected}");
    }
}

// Where neighbouring paths lie twice as far apart, a line hears twice as many scatterers, each with half the power.
#[test]
fn a_wider_strip_is_as_bright_with_more_scatterers() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    let mut measured = |strip: [f64; 2]| {
        let s = Segment { strip, ..segment(60.0) };
        let (mut power, mut deposits) = (0.0, 0);
        for seed in 0..10 {
            fixture.frame.cell = 0.25 + 1e-3 * seed as f32;
            power += mean_power(&mut fixture, &[s]) / 10.0;
            deposits +=
                scatter(&fixture.world(), &[s], Scatter::IMAGE).deposits.iter().sum::<u32>();
        }
        (power, f64::from(deposits))
    };
    let even = measured([10.0, 0.0]);
    // Its width is that at the middle, 30 mm away; the last is limited.
    for (strip, ratio) in
        [([20.0, 0.0], 2.0), ([5.0, 0.5], 2.0), ([-5.0, 0.0], 0.5), ([90.0, 0.0], 4.0)]
    {
        let (power, deposits) = measured(strip);
        assert!((power / even.0 - 1.0).abs() < 0.1, "{strip:?}: {power} {even:?}");
        assert!((deposits / even.1 / ratio - 1.0).abs() < 0.05, "{strip:?}: {deposits} {even:?}");
    }
}

// Two lines side by side hear every scatterer as loud as one line that lies on it. Planted: strips with a gap.
#[test]
fn neighbouring_strips_share_scatterers_without_gaps() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0)]);
    // Of one pitch, 0.8 mm: tents that reach to the next lines.
    (fixture.frame.scanlines, fixture.frame.width) = (5, 4.0);
    let of = |fixture: &Fixture, distance: f64| {
        let lines = (0..5).map(|l| Segment {
            origin: DVec3::new(0.8 * (f64::from(l) - 2.0), 0.0, 0.0),
            strip: [0.8, 0.0],
            line: l,
            ..segment(60.0)
        });
        let lines: Vec<Segment> = lines.map(|s| Segment { strip: [distance, 0.0], ..s }).collect();
        let out = scatter(&fixture.world(), &lines, Scatter::IMAGE);
        let line = |l: usize| &out.exact[l * 800..(l + 1) * 800];
        (0..800).map(|i| line(1)[i] + line(2)[i] + line(3)[i]).collect::<Vec<f64>>()
    };
    // What three lines hear together is heard whole from the first to the last of them, and falls to nothing at the next.
    let three = of(&fixture, 0.8);
    let shape = fixture.rows[0].shape[0];
    for row in &mut fixture.rows {
        row.shape[0] = 2.0 * shape;
        row.strip_core = 0.5;
    }
    let one = of_middle(&fixture);
    let off = three.iter().zip(&one).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // Widths are given in single precision.
    assert!(off < 1e-5, "{off}");
    for row in &mut fixture.rows {
        (row.shape[0], row.strip_core) = (shape, 0.0);
    }
    let gaps = of(&fixture, 0.7);
    let off = gaps.iter().zip(&one).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off > 0.1, "narrower strips leave gaps: {off}");
}

/// What the middle one of five lines hears alone.
fn of_middle(fixture: &Fixture) -> Vec<f64> {
    let s = Segment { strip: [0.8, 0.0], line: 2, ..segment(60.0) };
    scatter(&fixture.world(), &[s], Scatter::IMAGE).exact[1600..2400].to_vec()
}

// If a second path is 20 dB louder, the first one needs a hundredth of its scatterers; its level stays the same.
#[test]
fn masked_tissue_is_as_bright_with_fewer_scatterers() {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.5, 0.0), tissue(1.5, 1.5, 0.0)]);
    for row in &mut fixture.rows {
        row.shape[3] = 0.0;
    }
    fixture.tissues[1].presence = 1.0;
    fixture.tissues[1].amplitude = 0.0;
    let faint = Segment { weight: 0.1, ..segment(60.0) };
    let loud = Segment { tissue: 1, ..segment(60.0) };
    let count = |fixture: &Fixture, segments: &[Segment]| {
        let out = scatter(&fixture.world(), segments, Scatter::IMAGE);
        out.exact.chunks(2).filter(|v| v[0] != 0.0 || v[1] != 0.0).count()
    };
    let alone = count(&fixture, &[faint]);
    let drowned = count(&fixture, &[faint, loud]);
    assert!(drowned < alone, "{drowned} {alone}");
    let expected = 0.01 * mean_power(&mut fixture, &[segment(60.0)]);
    let mut got = 0.0;
    for seed in 0..20 {
        fixture.frame.cell = 0.25 + 1e-3 * seed as f32;
        got += mean_power(&mut fixture, &[faint, loud]) / 20.0;
    }
    assert!((got / expected - 1.0).abs() < 0.2, "{got} {expected}");
    for row in &mut fixture.rows {
        row.black = 1.0;
    }
    assert_eq!(count(&fixture, &[faint]), 0, "20 dB under black");
}
