use std::f64::consts::PI;

use super::*;

fn line(points: &[[f64; 3]], radii: &[f64]) -> CentreLine {
    CentreLine::new(points.iter().map(|p| (*p).into()).collect(), radii.to_vec()).expect("a line")
}

/// A vessel along z that divides at 0 into two, in the plane of x and z, the first of which gives off a small branch.
fn tree() -> Vessel {
    let lines = [
        line(&[[0.0, 0.0, -40.0], [0.0, 0.0, 0.0]], &[3.2, 3.0]),
        line(
            &[[0.0, 0.0, 0.0], [12.0, 0.0, 20.0], [12.0, 0.0, 24.0], [12.0, 0.0, 56.0]],
            &[2.6, 2.4, 2.4, 2.0],
        ),
        line(
            &[[0.05, 0.0, 0.1], [-12.0, 0.0, 20.0], [-12.0, 0.0, 24.0], [-12.0, 0.0, 60.0]],
            &[2.0, 1.9, 1.9, 1.9],
        ),
        line(&[[12.0, 0.0, 40.0], [26.0, 0.0, 40.0]], &[1.0, 1.0]),
    ];
    let tubes = lines.into_iter().zip([2.0, 4.0, 2.0, 3.0]);
    Vessel::new(tubes.map(|(line, exponent)| Tube::new(line, exponent)).collect()).expect("a tree")
}

/// Rate of flow through the circle around a place, across a direction, over the speed: by rings and sectors.
fn rate(vessel: &Vessel, place: [f64; 3], across: DVec3, radius: f64) -> f64 {
    let (u, v) = across.any_orthonormal_pair();
    let (rings, sectors) = (400, 24);
    let step = radius / f64::from(rings);
    let mut sum = 0.0;
    for i in 0..rings {
        let r = step * (f64::from(i) + 0.5);
        for j in 0..sectors {
            let angle = 2.0 * PI * f64::from(j) / f64::from(sectors);
            let at = DVec3::from(place) + r * (angle.cos() * u + angle.sin() * v);
            let area = 2.0 * PI * r * step / f64::from(sectors);
            sum += area * vessel.velocity(at, &DMat3::IDENTITY).dot(across);
        }
    }
    sum
}

/// The root's rate is pi R^2 K / (K + 2); what divides adds up to it, by the areas, wherever it is looked at. Within 0.1 %.
#[test]
fn what_divides_adds_up_to_what_arrives() {
    let vessel = tree();
    let whole = PI * 3.2 * 3.2 / 2.0;
    let near = |rate: f64, expected: f64| (rate / expected - 1.0).abs() < 1e-3;
    for z in [-35.0, -8.0] {
        let arriving = rate(&vessel, [0.0, 0.0, z], DVec3::Z, 3.3);
        assert!(near(arriving, whole), "{z}: {arriving} {whole}");
    }
    let [first, behind, second, side] = [
        rate(&vessel, [12.0, 0.0, 30.0], DVec3::Z, 2.6),
        rate(&vessel, [12.0, 0.0, 50.0], DVec3::Z, 2.6),
        rate(&vessel, [-12.0, 0.0, 40.0], DVec3::Z, 2.2),
        rate(&vessel, [20.0, 0.0, 40.0], DVec3::X, 1.2),
    ];
    assert!(near(first + second, whole), "{first} {second} {whole}");
    assert!(near(behind + side, first), "{behind} {side} {first}");
    assert!(near(first / second, 2.6 * 2.6 / (2.0 * 2.0)), "{first} {second}");
    // Where the small branch begins, the large one is half-way from 2.4 to 2.0 mm.
    assert!(near(behind / side, 2.2 * 2.2), "{behind} {side}");
    // The planted errors: shares by radii, and a large branch that goes on as if nothing had left it.
    assert!(!near(first / second, 2.6 / 2.0));
    assert!(!near(behind, first));
    assert_eq!(vessel.line(0).1, 1.0);
    assert!((vessel.line(1).1 + vessel.line(2).1 - 1.0).abs() < 1e-12);
}

/// A straight vessel that ends and goes on as a branch of the same width is the same vessel.
#[test]
fn a_junction_of_one_branch_changes_nothing() {
    let whole = Vessel::tube(line(&[[0.0, 0.0, -40.0], [0.0, 0.0, 40.0]], &[3.0, 3.0]), 2.0);
    let half =
        |from: f64, to: f64| Tube::new(line(&[[0.0, 0.0, from], [0.0, 0.0, to]], &[3.0, 3.0]), 2.0);
    let cut = Vessel::new(vec![half(-40.0, 0.0), half(0.0, 40.0)]).expect("a vessel");
    for i in 0..2000 {
        let t = f64::from(i);
        let place =
            DVec3::new(3.0 * (7.0 * t).sin(), 2.0 * (5.0 * t).cos(), 12.0 * (3.0 * t).sin());
        let [a, b] = [&whole, &cut].map(|v| v.velocity(place, &DMat3::IDENTITY));
        // A hemisphere of each half reaches into the other, and is slower off the axis.
        assert!(a.z >= b.z - 1e-12 && b.z >= a.z / 2.0, "{place}: {a} {b}");
        if place.z.abs() > 3.0 {
            assert!(a.abs_diff_eq(b, 1e-12), "{place}: {a} {b}");
        }
    }
}

/// Along any way through a junction the velocity changes by little, and in the middle blood never stands.
#[test]
fn no_blood_stands_where_a_vessel_divides() {
    let vessel = tree();
    let at = |place: DVec3| vessel.velocity(place, &DMat3::IDENTITY);
    for (toward, offset) in [([12.0, 0.0, 20.0], 0.5), ([-12.0, 0.0, 20.0], -0.5)] {
        let mut before = at(DVec3::Z * -4.0);
        for i in 1..=400 {
            let t = f64::from(i) / 400.0;
            let place = (DVec3::Z * -4.0).lerp(DVec3::ZERO, (2.0 * t).min(1.0))
                + DVec3::from(toward) * (t - 0.5).max(0.0)
                + DVec3::X * offset * t;
            let now = at(place);
            assert!(now.length() > 0.3, "{place}: {now}");
            // Steps of 0.06 mm at most: the parabola of the small branch changes by 1 a mm.
            assert!(now.distance(before) < 0.15, "{place}: {before} {now}");
            before = now;
        }
    }
    // Without the mean of the tubes the crotch would have a jump: the directions differ by 62 degrees.
    let [left, right] = [-1e-6, 1e-6].map(|x| at(DVec3::new(x, 0.0, 2.0)));
    assert!(left.distance(right) < 1e-4, "{left} {right}");
}

#[test]
fn a_narrow_part_counts_only_where_it_lies() {
    let narrow = line(
        &[[0.0, 0.0, -40.0], [0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 0.0, 40.0]],
        &[3.0, 3.0, 1.0, 3.0],
    );
    let exponents = vec![2.0, 2.0, 10.0, 2.0];
    let vessel = Vessel::new(vec![Tube { line: narrow, exponents }]).expect("a vessel");
    // Nine times the mean speed, of a profile whose middle is 1.2 times as fast as its mean, not twice.
    let throat = 9.0 * 1.2 / 2.0;
    let v = vessel.velocity(DVec3::Z * 5.0, &DMat3::IDENTITY);
    assert!(v.abs_diff_eq(DVec3::Z * throat, 1e-12), "{v}");
    let through = rate(&vessel, [0.0, 0.0, 5.0], DVec3::Z, 1.0);
    assert!((through / (PI * 9.0 / 2.0) - 1.0).abs() < 1e-3, "{through}");
    let (speed, shear) = vessel.extremes(|_| true);
    assert!((speed - throat).abs() < 1e-12, "{speed}");
    // In its middle the throat is nearly flat: at nine tenths of its radius 10 * 0.9^9 a radius. Before it blood gains more speed
    // along the line than that, for what it counts.
    assert!(
        throat * 10.0 * 0.9_f64.powi(9) < shear && shear > ALONG * (throat - 1.0) / 5.0,
        "{shear}"
    );
    assert_eq!(vessel.extremes(|p| p.z < -1.0), (1.0, 2.0 / 3.0));
    assert_eq!(vessel.narrowest(|p| p.z < -1.0), 3.0);
    assert_eq!((vessel.narrowest(|_| true), vessel.narrowest(|_| false)), (1.0, 1.0));
}

#[test]
fn a_branch_begins_on_a_line_before_it() {
    let root = || Tube::new(line(&[[0.0; 3], [0.0, 0.0, 40.0]], &[3.0, 3.0]), 2.0);
    let branch = |x: f64, z: f64| Tube::new(line(&[[x, 0.0, z], [20.0, 0.0, z]], &[1.0; 2]), 2.0);
    let [first, second] = [branch(2.9, 20.0), branch(5.0, 20.5)];
    // The second one begins two millimetres beside the root, and in the first one.
    let vessel = Vessel::new(vec![root(), first.clone(), second]).expect("in the root");
    assert_eq!([0, 1, 2].map(|i| vessel.line(i).1), [1.0, 0.1, 0.05]);
    let apart = Vessel::new(vec![root(), first, branch(5.0, 10.0)]).expect_err("beside both");
    assert_eq!(apart, Apart { line: 2, gap: 2.0 });
}
