use super::*;
use insonify::sim::layout::KIND_LINEAR;

/// A linear array of 101 lines of 0.2 mm, a band for each mm, f/2; lines left of the middle lose `nepers` from 16 mm on.
fn half_plane(nepers: f64) -> (Frame, Vec<Row>, Vec<Passed>) {
    let frame = Frame {
        kind: KIND_LINEAR,
        scanlines: 101,
        layers: 1,
        samples: 10 * APERTURE_BANDS,
        depth: APERTURE_BANDS as f32,
        sample_pitch: 0.1,
        width: 20.2,
        speed: 1.54,
        ..Frame::default()
    };
    let rows = (0..10 * APERTURE_BANDS).map(|k| {
        let half = 0.1 * k as f32 / 4.0;
        Row { transmit_half: half, receive_half: half, ..Row::default() }
    });
    let mut passed = vec![Passed::default(); 101 * (APERTURE_BANDS as usize + 1)];
    for line in 0..50 {
        for node in 17..=APERTURE_BANDS {
            passed[place(&frame, line, node)].lost = nepers;
        }
    }
    (frame, rows.collect(), passed)
}

#[test]
fn behind_a_half_plane_the_amplitude_is_the_square_of_the_free_part_of_the_aperture() {
    let (frame, rows, lost) = half_plane(46.0);
    let gains = aperture(&frame, &rows, &lost);
    for node in [20, 32, 40] {
        // Width of the aperture where it passes the plane, in the middle of the band.
        let width = f64::from(node) / 2.0 * (1.0 - 16.5 / f64::from(node));
        for line in 30..70 {
            let left = (gains[place(&frame, line, node)].gain
                - lost[place(&frame, line, node)].lost)
                .exp();
            let beside = (f64::from(line) - 49.5) * 0.2;
            let free = (0.5 + beside / width).clamp(0.0, 1.0);
            // A ray of 16, the line that it falls on, and where in a step of four bands the plane lies.
            let step = 2.0 / (f64::from(node) - 16.5) * beside.abs() / width;
            let allowed = 1.0 / 16.0 + 0.1 / width + step;
            assert!((left.sqrt() - free).abs() < allowed, "{node} {line}: {left} {free}");
        }
    }
}

#[test]
fn what_all_lines_lose_alike_changes_nothing_and_little_losses_add_up_to_their_mean() {
    let (frame, rows, lost) = half_plane(0.0);
    assert!(aperture(&frame, &rows, &lost).iter().all(|found| *found == Found::default()));
    // 1 % of the amplitude on one side: on the border the mean is half of it.
    let (frame, rows, lost) = half_plane(0.01);
    let gains = aperture(&frame, &rows, &lost);
    let at = place(&frame, 50, 40);
    assert!((gains[at].gain + 0.005).abs() < 5e-4, "{:?}", gains[at]);
}

#[test]
fn an_inclined_surface_is_passed_by_no_ray() {
    // Lines lose everything where a surface falls by 60 degrees across them: 0.35 mm, or bands, per line.
    let (frame, rows, mut lost) = half_plane(0.0);
    for line in 0..101 {
        for node in 0..=APERTURE_BANDS {
            let behind = f64::from(node) >= 3.0 + 0.35 * f64::from(line);
            lost[place(&frame, line, node)].lost = if behind { 46.0 } else { 0.0 };
        }
    }
    let gains = aperture(&frame, &rows, &lost);
    for (line, node) in [(20, 30), (40, 40), (60, 46)] {
        // A tenth of the rays may slip through: 20 dB on either way.
        let left = gains[place(&frame, line, node)].gain - 46.0;
        assert!(left < -4.0, "{line} {node}: {left}");
    }
}

#[test]
fn in_front_of_a_surface_counts_what_is_there() {
    let frame = half_plane(0.0).0;
    let table = |at: usize| if at == place(&frame, 3, 17) { [30.0, 40.0] } else { [0.0, 0.0] };
    let time = 1.54_f64.recip() * 16.4;
    assert_eq!(nepers(&frame, table, 3, time, 0.0), 0.0);
    assert_eq!(nepers(&frame, table, 3, time, 40.0), 30.0);
    // Without a surface in between, as deep as it is.
    let even = |at: usize| if at == place(&frame, 3, 17) { [0.3, 0.1] } else { [0.1, 0.0] };
    assert!((nepers(&frame, even, 3, time, 0.0) - 0.18).abs() < 1e-6);
}

/// A thin lens turns rays in proportion to where they pass it. Beams whose intensities are Gaussians then stay such, and
/// what two hear together goes by the root of the sum of their variances.
#[test]
fn a_thin_lens_widens_both_beams_as_gaussian_ones() {
    let (frame, mut rows, mut passed) = half_plane(0.0);
    let sine = (std::f64::consts::TAU * 0.6 * 2.0).recip();
    let (waist, focus, lens) = (0.37, 25.0, 16.5);
    for (k, row) in rows.iter_mut().enumerate() {
        let defocus = sine * (focus - 0.1 * k as f64);
        row.variances = (2.0 * waist * waist + defocus * defocus) as f32;
        row.defocus = defocus as f32;
        [row.transmit_sine, row.receive_sine] = [sine as f32; 2];
    }
    for power in [-0.01, 0.01] {
        for line in 0..101 {
            let beside = (f64::from(line) - 50.0) * 0.2;
            passed[place(&frame, line, 17)].bent = power * beside;
        }
        for node in [24, 32, 40] {
            let level = aperture(&frame, &rows, &passed)[place(&frame, 50, node)].level;
            let depth = f64::from(node);
            let defocus = sine * (focus - depth);
            let received = power * sine * (depth - lens).powi(2);
            let sent = defocus + power * sine * (focus - lens) * (depth - lens);
            let more = received.powi(2) + sent.powi(2) - defocus.powi(2);
            let even = 2.0 * waist * waist + defocus * defocus;
            let expected = (-0.25 * (1.0 + more / even).ln()).min(0.0);
            // Sixteen rays to either side of a Gaussian that ends at 1.9 deviations.
            assert!(
                (level - expected).abs() < 0.02 + 0.05 * expected.abs(),
                "{power} {node}: {level} {expected}"
            );
        }
    }
}
