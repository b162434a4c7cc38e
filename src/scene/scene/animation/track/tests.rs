use super::*;

fn turn(degrees: f64) -> DQuat {
    DQuat::from_rotation_z(degrees.to_radians())
}

fn line(values: &[f64], curve: Curve) -> Channel<DVec3> {
    let values: Vec<_> = values.iter().map(|&x| DVec3::splat(x)).collect();
    let each = if curve == Curve::CubicSpline { 3 } else { 1 };
    let times = (0..values.len() / each).map(|i| 2.0 * i as f64).collect();
    Channel::new(times, values, curve).expect("sound")
}

#[test]
fn steps_hold_lines_join_and_the_ends_stay() {
    let step = line(&[1.0, 5.0, 3.0], Curve::Step);
    for (t, x) in [(-9.0, 1.0), (0.0, 1.0), (1.99, 1.0), (2.0, 5.0), (9.0, 3.0)] {
        assert_eq!(step.at(t).x, x, "{t}");
    }
    let linear = line(&[1.0, 5.0, 3.0], Curve::Linear);
    for (t, x) in [(-9.0, 1.0), (0.5, 2.0), (2.0, 5.0), (3.5, 3.5), (9.0, 3.0)] {
        assert_eq!(linear.at(t).x, x, "{t}");
    }
}

#[test]
fn a_cubic_spline_with_a_parabolas_tangents_is_the_parabola() {
    // x = t^2 at 0, 2, 4 s: slopes 0, 4, 8. A cubic Hermite reproduces it exactly.
    let spline = line(&[0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 8.0, 16.0, 8.0], Curve::CubicSpline);
    for i in 0..=40 {
        let t = f64::from(i) / 10.0;
        assert!((spline.at(t).x - t * t).abs() < 1e-12, "{t}");
    }
    // Tangents per second: taken per step they would miss.
    assert!((spline.at(1.0).x - 0.0).abs() > 0.5);
}

#[test]
fn rotations_take_the_short_way_at_constant_speed() {
    let far = -turn(90.0);
    let channel = Channel::rotations(vec![0.0, 1.0], vec![turn(0.0) * 3.0, far], Curve::Linear)
        .expect("sound");
    for i in 0..=9 {
        let t = f64::from(i) / 9.0;
        let off = channel.at(t).angle_between(turn(90.0 * t));
        // The angle of nearly equal quaternions is an arc cosine near 1: half the digits.
        assert!(off < 1e-7, "{t}: {off}");
    }
}

#[test]
fn a_cubic_spline_of_rotations_is_normalised() {
    let (a, b) = (turn(0.0), turn(80.0));
    let flat = DQuat::from_array([0.0; 4]);
    let values = vec![flat, a, flat, flat, b, flat];
    let channel = Channel::rotations(vec![0.0, 1.0], values, Curve::CubicSpline).expect("sound");
    let half = channel.at(0.5);
    assert!((half.length() - 1.0).abs() < 1e-12);
    // Without tangents the middle is the mean, which by symmetry points half way.
    assert!(half.angle_between(turn(40.0)) < 1e-7);
    // At a quarter the weights are 27/32 and 5/32.
    let sum = a * (27.0 / 32.0) + b * (5.0 / 32.0);
    assert!(channel.at(0.25).angle_between(sum.normalize()) < 1e-7);
}

#[test]
fn a_track_keeps_what_has_no_channel() {
    let track = Track {
        rotation: Some(
            Channel::rotations(vec![1.0, 3.0], vec![turn(0.0), turn(60.0)], Curve::Linear)
                .expect("sound"),
        ),
        scale: Some(line(&[1.0, 3.0], Curve::Linear)),
        ..Track::default()
    };
    let rest = Trs { translation: DVec3::new(1.0, 2.0, 3.0), ..Trs::default() };
    let now = track.at(rest, 2.0);
    assert_eq!(now.translation, rest.translation);
    assert_eq!(now.scale, DVec3::splat(3.0));
    assert!(now.rotation.angle_between(turn(30.0)) < 1e-7);
    assert_eq!(track.span(), Some((0.0, 3.0)));
    // x scaled by 3, turned by 30 degrees, shifted.
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let expected = DVec3::new(1.0 + 3.0 * cos, 2.0 + 3.0 * sin, 3.0);
    let placed = now.matrix().transform_point3(DVec3::X);
    assert!((placed - expected).length() < 1e-12);
}

#[test]
fn bad_samples_are_named() {
    let make = |times: &[f64], values: &[f64]| {
        let values = values.iter().map(|&x| DVec3::splat(x)).collect();
        Channel::new(times.to_vec(), values, Curve::Linear).map(|_| ())
    };
    assert_eq!(make(&[], &[]), Err(TrackError::Empty));
    let count = TrackError::Count { times: 2, values: 1 };
    assert_eq!(make(&[0.0, 1.0], &[1.0]), Err(count));
    assert_eq!(make(&[0.0, 0.0], &[1.0; 2]), Err(TrackError::Order(1)));
    assert_eq!(make(&[0.0, -1.0], &[1.0; 2]), Err(TrackError::Order(1)));
    let bad = [1.0, f64::NAN];
    assert_eq!(make(&[0.0, 1.0], &bad), Err(TrackError::NotFinite(1)));
    assert_eq!(make(&bad, &[1.0; 2]), Err(TrackError::NotFinite(1)));
    for size in [1e-200, 1e200] {
        let tiny = vec![DQuat::from_xyzw(0.0, 0.0, size, size)];
        let channel = Channel::rotations(vec![0.0], tiny, Curve::Step).expect("sound");
        assert!(channel.at(0.0).angle_between(turn(90.0)) < 1e-7);
    }
    let zero = vec![DQuat::IDENTITY, DQuat::from_array([0.0; 4])];
    let found = Channel::rotations(vec![0.0, 1.0], zero, Curve::Step).map(|_| ());
    assert_eq!(found, Err(TrackError::ZeroQuaternion(1)));
    for bad in [[1.0, 0.0], [1.0, -1.0]] {
        let scale = Some(line(&bad, Curve::Linear));
        let track = Track { scale, ..Track::default() };
        assert_eq!(track.invertible(), Err(TrackError::ZeroScale(1)));
    }
}
