//! Fasciae: thin sheets are seen while they face the beam, and fade as they tilt out of the aperture's reach.

use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

/// A sheet of fat in muscle that does not scatter, turned about the elevation axis.
fn sheet(angle: f64, more: &str) -> Scene {
    let text = format!(
        r#"
        background = "still"
        [probe]
        preset = "linear"
        frequency = "5 MHz"
        depth = "50 mm"
        focus = "25 mm"
        scanlines = 128
        samples = 1024
        elevation_layers = 5
        {more}
        [imaging]
        noise = -inf
        [tissues.still]
        based_on = "muscle"
        echogenicity = -inf
        [tissues.fat_still]
        based_on = "visceral_fat"
        echogenicity = -inf
        [[mesh]]
        name = "sheet"
        shape = {{ box = {{ size = [60, 40, 0.3] }} }}
        tissue = "fat_still"
        rotate = {{ axis = [0, 1, 0], angle = "{angle} deg" }}
        translate = [0, 0, 22]
        "#
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    Scene::load(&path, &[]).expect("sound").0
}

/// Seeds over which the power of echoes is averaged: the phases of the sheet's cells are theirs.
const SEEDS: u32 = 24;

/// Power of the echoes of the sheet, per scanline, dB.
fn power(angle: f64, more: &str) -> f64 {
    let mut scene = sheet(angle, more);
    let mut simulator =
        Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh).expect("made");
    let mut of_seed = |seed| {
        scene.simulation.seed = seed;
        simulator.frame(&scene, 0).expect("a frame");
        let iq = simulator.iq().expect("samples");
        let samples = scene.probe.samples as usize;
        iq[2 * 32 * samples..2 * 96 * samples].iter().map(|v| f64::from(v * v)).sum::<f64>()
    };
    10.0 * (1..=SEEDS).map(&mut of_seed).sum::<f64>().log10()
}

/// Levels of a sheet tilted by these angles below that of one that faces the beam, dB.
fn fallen(angles: [f64; 4], more: &str) -> [f64; 4] {
    let facing = power(0.0, more);
    angles.map(|angle| power(angle, more) - facing)
}

/// Level of a sheet of tissue's own roughness, tilted by `angle`, below that of one that faces the beam, dB: of either face,
/// the overlap of what it reflects of the transmit aperture with the receive aperture, and what its small mirrors send back;
/// and, since the phase is the same over 0.5 mm of the sheet, what the beam adds up of the scanlines that meet it there.
fn closed_form(angle: f64) -> f64 {
    let scene = sheet(0.0, "");
    let probe = &scene.probe;
    let (lobe, sigma, pitch) =
        (probe.lobe(22.0), probe.sigma_lateral(22.0), probe.line_pitch(22.0));
    let speed_of = |i: usize| scene.tissues[i].speed;
    let [speed, within] = [scene.background, scene.instances[0].tissue].map(speed_of);
    let surface = &scene.instances[0].surface[0];
    let diffuse = 2.0 / (surface.roughness + 2.0);
    let face = |angle: f64| {
        let (sine, cosine) = (2.0 * angle).sin_cos();
        let energy = (-2.0 * lobe * sine * sine / (1.0 + 8.0 * lobe * diffuse)).exp();
        (energy + diffuse * (1.0 - energy)) * cosine.powf(2.0 * surface.specularity)
    };
    // Behind the face in front the path is refracted.
    let received = 0.5 * (face(angle) + face((angle.sin() * within / speed).asin()));
    let turns = 2.0 * std::f64::consts::TAU * probe.frequency / speed;
    let added = |angle: f64| -> f64 {
        let cell = 0.5 * angle.cos();
        let pair = |u: f64| (1.0 - u / cell).max(0.0) * (-u * u / (4.0 * sigma * sigma)).exp();
        let apart = (1..=8).map(|i| f64::from(i) * pitch);
        1.0 + 2.0 * apart.map(|u| pair(u) * (turns * angle.tan() * u).cos()).sum::<f64>()
    };
    10.0 * (received * added(angle) / added(0.0)).log10()
}

#[test]
fn a_tilted_fascia_fades_as_it_leaves_the_aperture() {
    let angles = [2.5, 5.0, 10.0, 20.0];
    // F/2: half of the aperture is seen under 14 degrees.
    let found = fallen(angles, "");
    println!("{found:.1?}, {:.1?}", angles.map(|a| closed_form(a.to_radians())));
    assert!(found[0] > -3.0, "nearly facing: {found:?}");
    assert!(found[2] < -10.0 && found[3] < -20.0, "{found:?}");
    for (angle, found) in angles.iter().zip(found).take(3) {
        let expected = closed_form(angle.to_radians());
        assert!((found - expected).abs() < 0.6, "{angle} degrees: {found} dB, {expected}");
    }
    // An aperture twice as wide still sees what is tilted by 10 degrees.
    let wide = fallen(angles, "f_number_receive = 1\nf_number_transmit = 1");
    assert!(wide[2] > -10.0, "{wide:?}");
    assert_eq!(test_device().validation_messages(), Vec::<String>::new());
}

/// The closed form of the lobe is the overlap of two Gaussian apertures, one of them reflected, by quadrature.
#[test]
fn the_lobe_is_the_overlap_of_both_apertures() {
    let mut probe = sheet(0.0, "").probe.clone();
    (probe.f_number_transmit, probe.f_number_receive) = (3.0, 1.5);
    // 0.6 wavelengths times the F-number: the deviation of the focus of a Gaussian aperture, whose own is the
    // inverse of that times the wavenumber.
    let deviation = |f_number: f64| 1.0 / (std::f64::consts::TAU * 0.6 * f_number);
    for (z, transmitted) in [(12.0, 3.0), (25.0, 3.0), (50.0, 6.0)] {
        let [a, b] = [deviation(transmitted), deviation(1.5)];
        let overlap = |shift: f64| -> f64 {
            let at = |i: i32| f64::from(i) * 1e-3;
            let pupil = |x: f64, s: f64| (-x * x / (2.0 * s * s)).exp();
            (-3000..=3000).map(at).map(|x| pupil(x, a) * pupil(x - shift, b)).sum()
        };
        for shift in [0.1f64, 0.2, 0.35] {
            let expected = overlap(shift) / overlap(0.0);
            let found = (-probe.lobe(z) * shift * shift).exp();
            assert!((found / expected - 1.0).abs() < 1e-6, "{z} mm, {shift}: {found} {expected}");
        }
    }
}
