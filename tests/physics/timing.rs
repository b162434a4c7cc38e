//! Where echoes appear.

use insonify::scene::Scene;

use crate::profile::centre;
use crate::render::{Renderer, renderers};
use crate::scenes::{add_layer, linear, silent};

/// Sample at which a plate at `depth` mm shows.
fn shown_at((_, render): &Renderer, scene: &Scene, depth: f64) -> f64 {
    let envelope = render(scene).envelope(0);
    let k = (depth / scene.probe.sample_pitch()) as usize;
    centre(&envelope, k - 60..k + 60, 8)
}

// A tenth of a sample: the split over two samples has the exact centre; the fixed point rounds it.
#[test]
fn a_plate_in_water_shows_at_its_time_of_flight() {
    for (renderer, depth) in renderers()
        .iter()
        .flat_map(|r| [20.0, 33.333, 71.7].map(|d| (r, d)))
    {
        let name = renderer.0;
        let mut scene = linear(1, 1.0, silent(1.480, 1.480, 0.0));
        add_layer(&mut scene, depth, silent(1.580, 1.650, 0.0));
        let expected = 1.540 * (depth / 1.480) / scene.probe.sample_pitch();
        let error = shown_at(renderer, &scene, depth * 1.540 / 1.480) - expected;
        assert!(error.abs() < 0.1, "{name} {depth}: {error}");
        scene.tissues[0].speed = 1.482;
        let wrong = shown_at(renderer, &scene, depth * 1.540 / 1.480) - expected;
        assert!(wrong.abs() > 0.1, "two metres per second are noticed");
    }
}

// 10 (1540 / 1440 - 1) = 0.694 mm.
#[test]
fn ten_millimetres_of_fat_push_what_is_behind_down_by_two_thirds_of_one() {
    let plate = |renderer: &Renderer, with_fat: bool| {
        let tissue = silent(1.540, 1.600, 0.0);
        let mut scene = linear(
            1,
            1.0,
            if with_fat {
                silent(1.440, 1.340, 0.0)
            } else {
                tissue.clone()
            },
        );
        add_layer(&mut scene, 10.0, tissue);
        add_layer(&mut scene, 40.0, silent(1.540, 1.700, 0.0));
        (shown_at(renderer, &scene, 40.3), scene.probe.sample_pitch())
    };
    for renderer in &renderers() {
        let (straight, pitch) = plate(renderer, false);
        let (delayed, _) = plate(renderer, true);
        let name = renderer.0;
        let error = straight - 40.0 / pitch;
        assert!(error.abs() < 0.1, "{name}: {error}");
        let error = delayed - straight - 0.6944 / pitch;
        assert!(error.abs() < 0.1, "{name}: {error}");
    }
}
