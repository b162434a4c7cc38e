use super::*;
use insonify::sim::lobe::Lobes;

/// The interface that a path along -z meets at an angle of incidence, between two fluids of speed and impedance.
fn inclined(roughness: f64, specularity: f64, degrees: f64, fluids: [[f64; 2]; 2]) -> Interface {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let normal = DVec3::new(sine, 0.0, cosine);
    Interface {
        geometric: normal,
        shading: normal,
        refracting: normal,
        turning: DVec3::ZERO,
        ray: normal,
        // Of a mirror; what is drawn of a lobe has others.
        micro: Some(Micro { normal, reflected: mirror(-DVec3::Z, normal) }),
        fluids: fluids.map(|[speed, impedance]| Fluid { speed, impedance }),
        reflectance: 0.0,
        curved: false,
        turn: 0.0,
        roughness,
        surface: Surface {
            roughness: roughness as f32,
            specularity: specularity as f32,
            lobe: Lobes::default().of(roughness, specularity),
            ..Surface::default()
        },
        absorption: 0.0,
        instance: 0,
        behind: 0,
    }
}

/// Mean, and root of the mean square, of what small mirrors send back, one drawn after the other.
fn drawn(interface: &Interface, draws: u32) -> [f64; 2] {
    let d = -DVec3::Z;
    let (mut mean, mut square, mut mirrors) = (0.0, 0.0, 0.0);
    for n in 0..draws {
        let words = pcg4d([n, 1, 2, 3]);
        let u = [(f64::from(n) + 0.5) / f64::from(draws), unit(words[1])];
        let normal = power_cosine(interface.shading, interface.roughness, u);
        let reflected = mirror(d, normal);
        if d.dot(normal) >= 0.0 || reflected.dot(interface.geometric) <= 0.0 {
            continue;
        }
        let micro = Some(Micro { normal, reflected });
        let sent = Interface { micro, ..*interface }.sent_back(d).unwrap_or(0.0);
        mean += sent;
        square += sent * sent;
        mirrors += 1.0;
    }
    [mean / mirrors, (square / mirrors).sqrt()]
}

#[test]
fn the_mean_over_a_lobe_is_what_draws_come_to() {
    let (fat, muscle, bone) = ([1.45, 1.33], [1.588, 1.73], [3.515, 6.7]);
    for fluids in [[fat, muscle], [muscle, fat], [muscle, bone], [bone, muscle]] {
        for (roughness, specularity) in [(60.0, 3.0), (100.0, 0.0), (300.0, 2.0), (1000.0, 2.0)] {
            for degrees in [0.0, 5.0, 12.0, 20.0, 25.0, 30.0, 40.0] {
                let interface = inclined(roughness, specularity, degrees, fluids);
                let found = interface.sent_back_in_the_mean(-DVec3::Z).unwrap();
                let expected = drawn(&interface, 100_000);
                // The power counts with the angles of the amplitude, which differ where mirrors are widely spread.
                let parts = [0.02, if roughness < 100.0 { 0.1 } else { 0.03 }];
                for i in 0..2 {
                    let (found, expected) = (found[i], expected[i]);
                    assert!(
                        (found - expected).abs() < parts[i] * expected.abs() + 2e-4,
                        "{fluids:?} {roughness} {specularity} {degrees}: {found}, drawn {expected}"
                    );
                }
                // The mirror in their middle is another one.
                if (roughness, degrees) == (60.0, 0.0) {
                    let one = inclined(1e9, specularity, degrees, fluids);
                    let [one, _] = one.sent_back_in_the_mean(-DVec3::Z).unwrap();
                    assert!((one - expected[0]).abs() > 0.1 * one.abs());
                }
            }
        }
    }
}
