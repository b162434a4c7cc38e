//! Animated glTF files made here: every interpolation, format and placement, and every mistake.

use std::path::{Path, PathBuf};

use insonify::scene::mesh::{Animated, Choice, Options, Placement, Units, load_animated};
use serde_json::{Value, json};

use crate::keyframes::compare::ROUNDING;
use crate::keyframes::document::{Document, to_base64};
use crate::keyframes::gltf::compare;
use crate::keyframes::pose::{Planted, Pose, apply};

/// Bytes of a file's buffer and their descriptions.
#[derive(Default)]
struct Store {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Store {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view =
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, kind: &str, values: &[[f64; N]]) -> usize {
        let bytes: Vec<u8> =
            values.iter().flatten().flat_map(|&v| (v as f32).to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessor(
            json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind }),
        )
    }

    /// Elements of four bytes.
    fn bytes<const N: usize>(&mut self, kind: &str, normalized: bool, values: &[[u8; N]]) -> usize {
        let view = self.view(values.as_flattened());
        self.accessor(json!({ "bufferView": view, "componentType": 5121, "count": values.len(),
            "type": kind, "normalized": normalized }))
    }

    /// Displacements of a few of `count` vertices, as normalised shorts.
    fn sparse(&mut self, count: usize, at: &[u8], values: &[[i16; 3]]) -> usize {
        let shorts: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let (at_view, new) = (self.view(at), self.view(&shorts));
        self.accessor(json!({ "componentType": 5122, "normalized": true, "count": count,
            "type": "VEC3", "sparse": { "count": at.len(),
                "indices": { "bufferView": at_view, "componentType": 5121 },
                "values": { "bufferView": new } } }))
    }

    fn finish(mut self, mut json: Value) -> Value {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let uri = format!("data:application/octet-stream;base64,{}", to_base64(&self.bytes));
        json["asset"] = json!({ "version": "2.0" });
        json["scene"] = json!(0);
        json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        json["bufferViews"] = Value::Array(self.views);
        json["accessors"] = Value::Array(self.accessors);
        json
    }
}

/// A closed square bar along y in `segments` parts, 2 wide, and its triangles.
fn bar(store: &mut Store, segments: usize) -> (Vec<[f64; 3]>, usize, usize) {
    let corner = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let points: Vec<[f64; 3]> = (0..4 * (segments + 1))
        .map(|i| [corner[i % 4][0], 2.0 * (i / 4) as f64, corner[i % 4][1]])
        .collect();
    let mut triangles: Vec<[u8; 3]> = Vec::new();
    let mut quad = |a: usize, b: usize, c: usize, d: usize| {
        let [a, b, c, d] = [a, b, c, d].map(|i| i as u8);
        triangles.extend([[a, b, c], [a, c, d]]);
    };
    for ring in 0..segments {
        let low = 4 * ring;
        (0..4).for_each(|k| {
            let next = (k + 1) % 4;
            quad(low + k, low + 4 + k, low + 4 + next, low + next);
        });
    }
    quad(0, 1, 2, 3);
    let top = 4 * segments;
    quad(top + 3, top + 2, top + 1, top);
    let corners: Vec<[u8; 1]> = triangles.as_flattened().iter().map(|&i| [i]).collect();
    let indices = store.bytes("SCALAR", false, &corners);
    let positions = store.floats("VEC3", &points);
    store.accessors[positions]["min"] = json!([-1.0, 0.0, -1.0]);
    store.accessors[positions]["max"] = json!([1.0, 2.0 * segments as f64, 1.0]);
    (points, positions, indices)
}

/// Quaternion of a turn about an axis, degrees.
fn turn(axis: usize, degrees: f64) -> [f64; 4] {
    let (sin, cos) = (degrees.to_radians() / 2.0).sin_cos();
    let mut q = [0.0, 0.0, 0.0, cos];
    q[axis] = sin;
    q
}

/// A file with a mirrored matrix above a spline of translations above turns and steps of scale above a mesh.
pub fn tree() -> Value {
    let mut store = Store::default();
    let (_, positions, indices) = bar(&mut store, 1);
    let times = store.floats("SCALAR", &[[0.5], [1.0], [2.5]]);
    let knots = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [4.0, 0.0, -1.0],
        [0.0, 2.0, 0.0],
        [0.0, 3.0, 1.0],
        [0.0, -3.0, 0.0],
        [1.0, 1.0, 1.0],
        [2.0, 2.0, 2.0],
        [0.0, 0.0, 0.0],
    ];
    let spline = store.floats("VEC3", &knots);
    // The last is 170 degrees, stored as the quaternion of the long way round.
    let turns = [turn(2, 0.0), turn(2, 100.0), turn(2, 170.0).map(|v| -v)];
    let turns = store.floats("VEC4", &turns);
    let scales = store.floats("VEC3", &[[1.0; 3], [2.0, 1.0, 0.5], [1.5; 3]]);
    store.finish(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [
            { "name": "mirror", "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1], "children": [1] },
            { "name": "slide", "rotation": turn(0, 30.0), "children": [2] },
            { "name": "turn", "translation": [0.25, 0, 0], "scale": [1, 2, 1], "children": [3, 4] },
            { "name": "bar", "mesh": 0, "translation": [0, 0, 3] },
            { "name": "idle" }
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices }] }],
        "animations": [
            { "name": "still", "channels": [{ "sampler": 0, "target": { "node": 4, "path": "scale" } }],
              "samplers": [{ "input": times, "output": scales }] },
            { "name": "all", "channels": [
                { "sampler": 0, "target": { "node": 1, "path": "translation" } },
                { "sampler": 1, "target": { "node": 2, "path": "rotation" } },
                { "sampler": 2, "target": { "node": 2, "path": "scale" } } ],
              "samplers": [
                { "input": times, "output": spline, "interpolation": "CUBICSPLINE" },
                { "input": times, "output": turns },
                { "input": times, "output": scales, "interpolation": "STEP" } ] }
        ]
    }))
}

/// A file with a bar that bends about two joints while a sparse target widens it, all weights in bytes; its node
/// and the one above the joints have placements.
pub fn bending() -> Value {
    let mut store = Store::default();
    let (points, positions, indices) = bar(&mut store, 3);
    let target = store.sparse(16, &[4, 6, 9], &[[32767, 0, -16000], [-32767, 99, 0], [0, 0, 8000]]);
    let weights: Vec<[u8; 4]> = points
        .iter()
        .map(|p| {
            let high = (p[1] / 6.0 * 255.0) as u8;
            // Third and fourth name the first joint, with a weight of zero and one more.
            [255 - high, high, 0, 0]
        })
        .collect();
    let weights = store.bytes("VEC4", true, &weights);
    let joints = store.bytes("VEC4", false, &[[1, 0, 0, 0]; 16]);
    let bind = |y: f64| {
        let mut m = [0.0; 16];
        (0..4).for_each(|i| m[5 * i] = 1.0);
        m[13] = -y;
        m
    };
    let bind = store.floats("MAT4", &[bind(3.0), bind(0.0)]);
    let morph_times = store.floats("SCALAR", &[[0.0], [0.75]]);
    let knots = store.floats("SCALAR", &[[0.0], [0.0], [2.0], [-1.0], [1.0], [0.0]]);
    let times = store.floats("SCALAR", &[[0.25], [0.5], [1.25]]);
    let turns = store.floats("VEC4", &[turn(0, 0.0), turn(0, 80.0), turn(0, -20.0)]);
    let moves = store.floats("VEC3", &[[0.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 2.0]]);
    store.finish(json!({
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "name": "bearer", "mesh": 0, "skin": 0, "translation": [7, 8, 9] },
            { "name": "armature", "scale": [2, 2, 2], "children": [2] },
            { "name": "low", "children": [3] },
            { "name": "high", "translation": [0, 3, 0] }
        ],
        "meshes": [{ "weights": [0.5], "primitives": [{ "indices": indices,
            "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights },
            "targets": [{ "POSITION": target }] }] }],
        "skins": [{ "joints": [3, 2], "inverseBindMatrices": bind }],
        "animations": [{ "channels": [
            { "sampler": 0, "target": { "node": 0, "path": "weights" } },
            { "sampler": 1, "target": { "node": 3, "path": "rotation" } },
            { "sampler": 2, "target": { "node": 1, "path": "translation" } } ],
          "samplers": [
            { "input": morph_times, "output": knots, "interpolation": "CUBICSPLINE" },
            { "input": times, "output": turns },
            { "input": times, "output": moves } ] }]
    }))
}

pub fn written(folder: &Path, json: &Value) -> PathBuf {
    let path = folder.join("made.gltf");
    std::fs::write(&path, json.to_string()).expect("written");
    path
}

fn options() -> Options {
    Options { units: Units::named("cm"), ..Options::default() }
}

/// Scene from the space of a mesh.
fn placed(animated: &Animated, node: Option<usize>, time: f64, p: [f32; 3]) -> [f64; 3] {
    let mut at = p.map(f64::from).into();
    let mut next = node;
    while let Some(n) = next {
        at = animated.nodes[n].placement.at(time).transform_point3(at);
        next = animated.nodes[n].parent;
        assert!(next < Some(n), "parents come first");
    }
    at.into()
}

#[test]
fn moving_nodes_are_where_they_should_be() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = written(folder.path(), &tree());
    let all = Choice::Named("all");
    let (animated, issues) = load_animated(&path, &options(), all).expect("sound");
    assert!(issues.is_empty(), "{issues:?}");
    let names: Vec<_> = animated.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["mirror", "slide", "turn", "bar"]);
    let moving = |n: usize| matches!(animated.nodes[n].placement, Placement::Moving { .. });
    assert_eq!([0, 1, 2, 3].map(moving), [false, true, true, false]);
    assert_eq!(animated.span, (0.5, 2.5));
    let mesh = &animated.meshes[0];
    assert_eq!((mesh.shapes.len(), mesh.times.len()), (1, 0));
    let document = Document::open(&path);
    let off = |planted| {
        let pose = Pose { document: &document, animation: 1, planted };
        let triangles = pose.triangles(3);
        let mut off = 0f64;
        for step in 0..40 {
            let time = 0.1 * f64::from(step) - 0.5;
            let global = pose.global(3, time);
            let vertices = pose.vertices(3, time);
            for (stored, loaded) in triangles.iter().zip(&mesh.shapes[0].triangles) {
                for (&s, &l) in stored.iter().zip(loaded) {
                    let expected = apply(&global, &vertices[s]);
                    let position = mesh.shapes[0].positions[l as usize];
                    let found = placed(&animated, mesh.node, time, position);
                    for axis in 0..3 {
                        off = off.max((10.0 * expected[axis] - found[axis]).abs());
                    }
                }
            }
        }
        off
    };
    // Resting values are single precision: four levels of four roundings each at most 200 mm away.
    let allowed = 16.0 * ROUNDING * 200.0;
    println!("off by {:.1e} mm, {allowed:.1e} allowed", off(None));
    assert!(off(None) <= allowed);
    for planted in [Planted::Late, Planted::Lerp, Planted::Unmoved] {
        assert!(off(Some(planted)) > allowed, "{planted:?}");
    }
}

#[test]
fn a_report_tells_what_plays_and_what_does_not() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut json = tree();
    // Metres: from the size of a house to that of an organ.
    let matrix =
        [-0.01, 0.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0, 1.0];
    json["nodes"][0]["matrix"] = json!(matrix);
    let report = insonify::scene::check::report(&written(folder.path(), &json));
    let text = report.to_string();
    assert!(report.passed(), "{text}");
    for said in [
        "  animation `all`: 0.500 to 2.500 s, 2 moving nodes, 0 shapes of 1 meshes",
        "animation `still`: animation `still` moves no mesh; choose one of `all`",
    ] {
        assert!(text.contains(said), "{said}:\n{text}");
    }
}

#[test]
fn skins_and_morph_targets_work_together() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = written(folder.path(), &bending());
    let document = Document::open(&path);
    let pose = |planted| Pose { document: &document, animation: 0, planted };
    for most in [24, 3] {
        let options = Options { keyframes: Some(most), ..options() };
        let (animated, _) = load_animated(&path, &options, Choice::First).expect("sound");
        let mesh = &animated.meshes[0];
        let times: &[f64] = match most {
            24 => &[0.0, 0.25, 0.5, 0.75, 1.25],
            _ => &[0.0, 0.625, 1.25],
        };
        assert_eq!((mesh.node, mesh.times.as_slice()), (None, times));
        let (off, allowed) = compare(mesh, 0, &pose(None), 10.0);
        println!("off by {off:.1e} mm, {allowed:.1e} allowed");
        assert!(off <= allowed, "{off:e} {allowed:e}");
        let mistakes = [Planted::Late, Planted::Target, Planted::Unbound, Planted::Carried];
        for planted in mistakes {
            let (off, allowed) = compare(mesh, 0, &pose(Some(planted)), 10.0);
            assert!(off > allowed, "{planted:?}");
        }
    }
}

#[test]
fn a_mirroring_skin_stays_outward() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut json = bending();
    json["nodes"][1]["scale"] = json!([-2, 2, 2]);
    // Open, so that only the winding shows which side is outside.
    let open = json["accessors"][0]["count"].as_u64().expect("indices") - 6;
    json["accessors"][0]["count"] = json!(open);
    let path = written(folder.path(), &json);
    let (animated, _) = load_animated(&path, &options(), Choice::First).expect("sound");
    let shape = &animated.meshes[0].shapes[0];
    let inside = shape.positions.iter().fold([0.0; 3], |sum, p| {
        [0, 1, 2].map(|i| sum[i] + f64::from(p[i]) / shape.positions.len() as f64)
    });
    let outward = shape.triangles.iter().filter(|t| {
        let [a, b, c] = t.map(|i| glam::DVec3::from(shape.positions[i as usize].map(f64::from)));
        (b - a).cross(c - a).dot(a - glam::DVec3::from(inside)) > 0.0
    });
    assert_eq!(outward.count(), shape.triangles.len());
}
