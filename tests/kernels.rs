//! Every kernel against its f64 twin: random, empty, of size one, of odd sizes, with NaN and
//! infinity; and an error planted into each kernel's outputs is caught.

use std::path::Path;

use insonify::gpu::{Kernel, test_device};
use insonify::output::npy;
use insonify::sim::shaders::Library;
use insonify::sim::stages;
use insonify_tools::harness::{self, Case, Element, Job, SUBJECTS, Size, dump};

use crate::common::skip::{Lacking, skip};

const GLSL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/glsl");

/// Kernels of pictures for the user, without a twin: tests/view3d.rs, tests/fusion.rs and tests/labels compare them
/// with closed forms.
const CLOSED_FORMS: [&str; 4] = ["view3d_bvh", "view3d_query", "tint", "paint"];

fn subject(name: &str) {
    let subject = SUBJECTS.iter().find(|s| s.name == name).unwrap();
    let device = test_device();
    let library = Library::embedded();
    let mut wrong = Vec::new();
    for stem in subject.stems(&library) {
        if stem.ends_with("_query") && !device.supports_ray_query() {
            skip(Lacking::Tool, &format!("'{}' has no ray queries", device.name()));
            continue;
        }
        let kernel = Kernel::new(&device, stem, library.words(stem), &[]).unwrap();
        for case in Case::ALL {
            let job = (subject.job)(case, Size::Small);
            let extent = subject.extent(&job);
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
            let library = Library::embedded();
            let mut stems: Vec<&str> = SUBJECTS.iter().flat_map(|s| s.stems(&library)).collect();
            stems.extend(CLOSED_FORMS);
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
    aperture,
    scatter_rigid,
    scatter_deforming,
    scatter_flowing,
    beam,
    axial,
    detect,
    moments,
    enhance,
    display,
    expect,
    label,
    level,
    chart,
    mask,
    shadow,
    darken,
    tiles,
    convert,
    blur,
    difference,
    reduce,
    collapse,
    fuse,
    wall_filter,
    autocorrelation,
    gate,
    colour
);

/// Names of a kernel's bindings in its source, by number; a ray query's `tlas` takes the place of `nodes`.
fn declared(kernel: &str) -> Vec<String> {
    let source = std::fs::read_to_string(Path::new(GLSL).join(format!("{kernel}.comp"))).unwrap();
    let mut names = Vec::new();
    for line in source.lines().filter(|line| line.starts_with("layout(") && !line.contains("tlas"))
    {
        let Some((_, rest)) = line.split_once("binding = ") else { continue };
        let (number, rest) = rest.split_once(')').unwrap();
        assert_eq!(number.parse(), Ok(names.len()), "{kernel}: {line}");
        // For a block its only member, for a texture its own name.
        let member = rest.split_once('{').map_or(rest, |(_, member)| member);
        let declaration = member.split(';').next().unwrap().trim();
        let name = declaration.split(' ').next_back().unwrap();
        names.push(name.split('[').next().unwrap().to_owned());
    }
    names
}

#[test]
fn bindings_of_stages_and_jobs_have_the_names_of_the_sources() {
    for pass in stages::all() {
        let binds: Vec<&str> = pass.binds.iter().map(|array| array.name).collect();
        assert_eq!(declared(pass.name), binds, "{}", pass.name);
    }
    for subject in &SUBJECTS {
        let kernel = subject.pass.map_or(subject.name, |pass| pass.name);
        let job = (subject.job)(Case::One, Size::Small);
        let names: Vec<&str> = job.inputs.iter().map(|input| input.name).collect();
        assert_eq!(declared(kernel), names, "{}", subject.name);
    }
}

/// For each buffer that a dispatch binds, or its stand-in, the array names the stage that fills it.
#[test]
fn every_array_that_a_stage_binds_is_made_by_one() {
    // Filled level by level, the volume, and those of a packet, which are as large as its box.
    let given = [
        "level",
        "fine",
        "coarse",
        "coarse_change",
        "change",
        "acquired",
        "pulses",
        "lags",
        "correlations",
    ];
    for pass in stages::all() {
        for array in pass.binds {
            let is_given = given.contains(&array.name);
            assert!(
                stages::array(array.name).is_some() != is_given,
                "{}: {}",
                pass.name,
                array.name
            );
        }
    }
}

fn contents(job: &Job) -> Vec<Vec<u8>> {
    job.inputs.iter().map(|i| i.bytes.clone()).collect()
}

#[test]
fn every_job_survives_the_folder() {
    for subject in &SUBJECTS {
        for case in Case::ALL {
            let job = (subject.job)(case, Size::Small);
            let dir = tempfile::tempdir().unwrap();
            dump::write(dir.path(), &job, &contents(&job)).unwrap();
            let mut again = (subject.job)(Case::One, Size::Small);
            dump::read(dir.path(), subject, &mut again).unwrap();
            assert_eq!(again, job, "{} {case:?}", subject.name);
        }
    }
}

#[test]
fn a_folder_of_nothing_and_arrays_too_small_are_refused() {
    let subject = SUBJECTS.iter().find(|s| s.name == "axial").unwrap();
    let mut job = (subject.job)(Case::Odd, Size::Small);
    let dir = tempfile::tempdir().unwrap();
    let empty = dump::read(dir.path(), subject, &mut job).unwrap_err();
    assert!(empty.contains("frame, rows, lateral, iq"), "{empty}");
    let path = dir.path().join("lateral.npy");
    let at = job.index("lateral");
    let words = job.inputs[at].bytes.len() / 4;
    for (words, fits) in [(words, true), (words - 2, false)] {
        let lateral = &job.inputs[at].bytes[..4 * words];
        npy::write(&path, Element::Float, &[words], lateral).unwrap();
        match dump::read(dir.path(), subject, &mut job) {
            Ok(found) => assert!(fits && found == ["lateral"], "{found:?}"),
            Err(e) => assert!(!fits && e.contains("lateral has"), "{e}"),
        }
    }
}
