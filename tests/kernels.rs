//! Every kernel against its f64 twin: random, empty, of size one, of odd sizes, with NaN and
//! infinity; and an error planted into each kernel's outputs is caught.

use insonify::gpu::{Kernel, test_device};
use insonify::harness::{self, Case, SUBJECTS, Size};
use insonify::sim::shaders::Library;

fn subject(name: &str) {
    let subject = SUBJECTS.iter().find(|s| s.name == name).unwrap();
    let device = test_device();
    assert!(
        device.supports_ray_query(),
        "the tests need a device with ray query; ./tools/test.sh installs one"
    );
    let library = Library::embedded();
    let mut wrong = Vec::new();
    for stem in subject.stems {
        let kernel = Kernel::new(&device, stem, library.words(stem), &[]).unwrap();
        for case in Case::ALL {
            let job = (subject.job)(case, Size::Small);
            let extent = (subject.extent)(&job);
            let mut outputs = harness::run(&device, &kernel, &job, &extent).unwrap().outputs;
            for check in (subject.check)(&job, &outputs) {
                println!("{stem} {case:?}: {check}");
                if !check.passed() {
                    wrong.push(format!("{stem} {case:?}: {check}"));
                }
            }
            if case == Case::Random {
                (subject.plant)(&job, &mut outputs);
                let checks = (subject.check)(&job, &outputs);
                if checks.iter().all(harness::Check::passed) {
                    wrong.push(format!("{stem}: the planted error passes"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}\ntolerance: {}", wrong.join("\n"), subject.tolerance);
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

macro_rules! subjects {
    ($($name:ident),*) => {
        $(#[test] fn $name() { subject(stringify!($name)); })*

        #[test]
        fn no_kernel_lacks_a_test() {
            let tested = [$(stringify!($name)),*];
            assert_eq!(tested, SUBJECTS.map(|s| s.name));
            let mut stems: Vec<&str> = SUBJECTS.iter().flat_map(|s| s.stems).copied().collect();
            stems.sort_unstable();
            stems.dedup(); // `detect` is the last step of `axial`
            assert_eq!(stems, Library::embedded().stems().collect::<Vec<_>>());
        }
    };
}

subjects!(
    angles,
    geometry,
    rays,
    interpolate,
    refit,
    origin,
    trace,
    scatter_rigid,
    scatter_deforming,
    beam,
    axial,
    detect,
    display,
    mask,
    shadow,
    darken,
    convert,
    blur,
    difference,
    reduce,
    collapse,
    fuse,
    survey,
    tint
);
