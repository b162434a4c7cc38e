//! The colours of the tissues over the image.

use insonify::gpu::{Image, ImageDim, ImageFormat, test_device};
use insonify::sim::labels::colours;
use insonify::sim::layout::NONE;
use insonify::sim::{Outputs, Shot, Tracer};

use super::scenes::{add_layer, linear, tissue};
use super::{frame, simulator};

#[test]
fn colours_lie_over_the_pixels_of_their_tissues_and_leave_the_image_alone() {
    let mut scene = linear(16, 20.0, tissue(1.54, 1.6, 0.5));
    add_layer(&mut scene, 30.0, tissue(1.6, 1.7, 0.5));
    scene.imaging.image_height = 120;
    let mut simulator = simulator(&mut scene, Tracer::Bvh);
    let labels = frame(&mut simulator, &scene, 0);
    let plain = simulator.pixels().expect("pixels");
    assert_eq!(simulator.painted_pixels().expect("no device error"), None, "nobody asked");
    let extent = [plain.0, plain.1, 1];
    let device = test_device();
    let image = Image::new(&device, "painted", ImageDim::D2, extent, ImageFormat::Rgba8Unorm);
    let image = image.expect("an image");
    for opacity in [0.35_f32, 1.0] {
        let outputs = Outputs { painted: Some((&image, opacity)), ..Outputs::default() };
        simulator.frames_into(&scene, &[Shot::of(&scene, 0)], &outputs).expect("a frame");
        let painted = simulator.painted_pixels().expect("no device error").expect("asked for");
        assert!(image.read_back().expect("read") == painted);
        assert!(simulator.pixels().expect("pixels") == plain);
        let colours = colours(&scene);
        assert_ne!(colours[0], colours[1]);
        let pairs = plain.2.chunks_exact(4).zip(painted.chunks_exact(4)).zip(&labels.pixels.labels);
        for ((plain, painted), label) in pairs {
            let expected = match label.tissue {
                NONE => plain.to_vec(),
                tissue => {
                    let mix = |i: usize| {
                        let [grey, hue] = [plain[i], colours[tissue as usize][i]].map(f64::from);
                        grey + f64::from(opacity) * (hue - grey)
                    };
                    // Half of a level rounds either way by what single precision leaves of it.
                    let off = (0..3).map(|i| (f64::from(painted[i]) - mix(i)).abs());
                    assert!(off.fold(0.0, f64::max) < 0.501, "{plain:?} {painted:?}");
                    continue;
                }
            };
            assert_eq!(painted, expected);
        }
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}
