//! Morphing and skinned samples.

use std::path::Path;

use insonify::scene::mesh::{AnimatedMesh, Choice, Options, Units, load_animated};

use crate::common::shared_data::shared_data;
use crate::keyframes::compare::{Corners, ROUNDING, reach};
use crate::keyframes::document::Document;
use crate::keyframes::pose::{Planted, Pose};

struct Sample {
    file: &'static str,
    /// Name of the animation.
    animation: &'static str,
    /// The file's unit, chosen to give the sample the size of an organ.
    units: &'static str,
    /// Most shapes of a skin.
    keyframes: Option<usize>,
    /// Mistakes that matter in this sample.
    planted: &'static [Planted],
}

const MORPH: &[Planted] = &[Planted::Late, Planted::Target];
const SKIN: &[Planted] = &[Planted::Late, Planted::Unbound, Planted::Unmoved];
const BETWEEN: &[Planted] = &[Planted::Late, Planted::Unbound, Planted::Lerp];

const FOX: &str = "gltf-samples/bevy/assets/models/animated/Fox.glb";
const STRESS: &str = "gltf-samples/bevy/assets/models/animated/MorphStressTest.gltf";
const ASSIMP: &str = "gltf-samples/assimp-glTF2/MorphStressTest/glTF/MorphStressTest.gltf";

#[rustfmt::skip]
const SAMPLES: &[Sample] = &[
    Sample { file: FOX, animation: "Survey", units: "mm", keyframes: None, planted: BETWEEN },
    Sample { file: FOX, animation: "Survey", units: "mm", keyframes: Some(100), planted: SKIN },
    Sample { file: FOX, animation: "Walk", units: "mm", keyframes: None, planted: SKIN },
    Sample { file: FOX, animation: "Run", units: "mm", keyframes: Some(11), planted: BETWEEN },
    Sample { file: STRESS, animation: "Individuals", units: "cm", keyframes: None, planted: MORPH },
    Sample { file: STRESS, animation: "TheWave", units: "cm", keyframes: None, planted: MORPH },
    Sample { file: STRESS, animation: "Pulse", units: "cm", keyframes: None, planted: MORPH },
    Sample { file: ASSIMP, animation: "TheWave", units: "cm", keyframes: None, planted: MORPH },
    Sample {
        file: "gltf-samples/assimp-glTF2/AnimatedMorphCube/glTF/AnimatedMorphCube.gltf",
        animation: "Square", units: "cm", keyframes: None, planted: MORPH,
    },
    Sample {
        file: "gltf-samples/assimp-glTF2/AnimatedMorphSphere/glTF/AnimatedMorphSphere.gltf",
        animation: "Globe", units: "cm", keyframes: None, planted: MORPH,
    },
    Sample {
        file: "gltf-samples/assimp-glTF2/SimpleMorph/glTF/SimpleMorph.gltf",
        animation: "animation 0", units: "cm", keyframes: None, planted: MORPH,
    },
    Sample {
        file: "gltf-samples/assimp-glTF2/simple_skin/simple_skin.gltf",
        animation: "animation 0", units: "cm", keyframes: Some(7), planted: &[Planted::Late, Planted::Lerp, Planted::Unmoved],
    },
    Sample {
        file: "heart-4d-bivme/heart-4d-25frames-morph.glb",
        animation: "cardiac-cycle", units: "mm", keyframes: None, planted: MORPH,
    },
];

/// Largest distance of a vertex from its place and what rounding allows, mm.
pub fn compare(mesh: &AnimatedMesh, node: usize, pose: &Pose<'_>, mm: f64) -> (f64, f64) {
    let triangles = pose.triangles(node);
    let place = |time: f64| -> Vec<[f64; 3]> {
        let stored = pose.vertices(node, time);
        stored.into_iter().map(|p| p.map(|v| v * mm)).collect()
    };
    let corners = Corners::new(&mesh.shapes[0], &triangles, &place(mesh.times[0]));
    let (mut off, mut far) = (0f64, 0f64);
    for (shape, &time) in mesh.shapes.iter().zip(&mesh.times) {
        assert!(shape.shares_topology(&mesh.shapes[0]));
        let expected = place(time);
        off = off.max(corners.off(shape, &expected));
        far = far.max(reach(&expected));
    }
    // The program rounds a position once, each axis by half a unit: less than twice that in length. Resting
    // rotations and translations above a joint are single precision, too: each turns everything below it by no
    // more than four roundings of a quaternion's components.
    let above = pose.joints(node).map_or(0, |joints| {
        let depth = joints.iter().map(|&j| pose.chain(j).len());
        depth.max().unwrap_or(0)
    });
    (off, ROUNDING * far * (2.0 + 4.0 * above as f64))
}

/// Times at which the program should sample a mesh, where they are not too many.
fn key_times(node: usize, pose: &Pose<'_>) -> Vec<f64> {
    let mut times = pose.times(node, "weights");
    for joint in pose.joints(node).unwrap_or_default() {
        for above in pose.chain(joint) {
            for path in ["translation", "rotation", "scale"] {
                times.extend(pose.times(above, path));
            }
        }
    }
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

fn check(folder: &Path, sample: &Sample) {
    let path = folder.join(sample.file);
    let units = Units::named(sample.units).expect("a unit");
    let options = Options { units: Some(units), keyframes: sample.keyframes, ..Options::default() };
    let loaded = load_animated(&path, &options, Choice::Named(sample.animation));
    let (animated, _) = loaded.unwrap_or_else(|issues| panic!("{}: {issues:?}", sample.file));
    assert_eq!(animated.animation, sample.animation);
    let document = Document::open(&path);
    let animations = document.json["animations"].as_array().expect("animations");
    let named = |a: &serde_json::Value| a["name"].as_str() == Some(sample.animation);
    let animation = animations.iter().position(named).unwrap_or(0);
    let pose = |planted| Pose { document: &document, animation, planted };
    let nodes = document.json["nodes"].as_array().expect("nodes");
    let bearing: Vec<usize> =
        (0..nodes.len()).filter(|&n| nodes[n].get("mesh").is_some()).collect();
    assert_eq!(bearing.len(), animated.meshes.len());
    let mut caught = vec![false; sample.planted.len()];
    for mesh in &animated.meshes {
        let node = bearing.iter().find(|&&n| match nodes[n]["name"].as_str() {
            Some(name) => name == mesh.name,
            None => mesh.name == format!("node {n}"),
        });
        let node = *node.expect("a node of that name");
        let keys = key_times(node, &pose(None));
        match keys.len() <= sample.keyframes.unwrap_or(24) || pose(None).joints(node).is_none() {
            true => assert_eq!(mesh.times, keys),
            false => assert_eq!(mesh.times.len(), sample.keyframes.unwrap_or(24)),
        }
        let (off, allowed) = compare(mesh, node, &pose(None), units.0);
        println!(
            "{}, {}, {}: {} shapes, {} vertices, off by {off:.2e} mm, {allowed:.2e} allowed",
            path.file_name().unwrap_or_default().display(),
            sample.animation,
            mesh.name,
            mesh.shapes.len(),
            mesh.shapes[0].positions.len(),
        );
        assert!(off <= allowed, "{}: {off:e} of {allowed:e}", mesh.name);
        for (caught, &planted) in caught.iter_mut().zip(sample.planted) {
            let (off, allowed) = compare(mesh, node, &pose(Some(planted)), units.0);
            *caught |= off > allowed;
        }
    }
    for (caught, planted) in caught.iter().zip(sample.planted) {
        assert!(caught, "{}: {planted:?} was not noticed", sample.file);
    }
}

#[test]
fn shapes_are_where_an_evaluation_of_the_file_puts_them() {
    let Some(data) = shared_data() else { return };
    for sample in SAMPLES {
        check(&data, sample);
    }
}
