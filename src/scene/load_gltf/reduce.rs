//! Keeps of a glTF file what makes triangles: nodes, positions, indices; for an animation also what moves
//! them. The typed reader then cannot stumble over a material, and its own validation concerns the
//! geometry only.

use std::collections::HashMap;

use serde_json::{Map, Value, json};

/// The geometry of a file, with accessors renumbered.
pub(super) struct Reduced {
    pub json: Value,
    /// The file's number of each accessor that is kept.
    pub accessors: Vec<usize>,
    /// Buffers that the geometry needs.
    pub buffers: Vec<usize>,
    /// Primitives whose positions or indices are not stored anywhere, which are left out.
    pub without_data: usize,
}

/// `root` has passed validation: references resolve and types are right. With the number of an
/// `animation`, keeps that one, morph targets and skins.
pub(super) fn reduce(root: &Map<String, Value>, animation: Option<usize>) -> Reduced {
    let mut accessors = Renumbering::default();
    let mut without_data = 0;
    let meshes: Vec<Value> = list(root, "meshes")
        .iter()
        .map(|mesh| {
            let primitives: Vec<Value> = list_of(mesh, "primitives")
                .iter()
                .filter_map(|primitive| {
                    let position = primitive.get("attributes")?.get("POSITION");
                    let stored = position.is_some_and(|p| stored(root, p))
                        && primitive.get("indices").is_none_or(|i| stored(root, i));
                    if !stored {
                        without_data += 1;
                        return None;
                    }
                    let mut out = pick(primitive, &["mode"]);
                    let mut attributes = Map::new();
                    attributes.insert("POSITION".to_owned(), json!(accessors.number(position?)));
                    if animation.is_some() {
                        attributes.extend(influences(root, primitive, &mut accessors));
                        if let Some(targets) = targets(root, primitive, &mut accessors) {
                            out.insert("targets".to_owned(), targets);
                        }
                    }
                    out.insert("attributes".to_owned(), Value::Object(attributes));
                    if let Some(indices) = primitive.get("indices") {
                        out.insert("indices".to_owned(), json!(accessors.number(indices)));
                    }
                    Some(Value::Object(out))
                })
                .collect();
            let mut out = pick(mesh, &["name"]);
            if animation.is_some() {
                out.extend(pick(mesh, &["weights"]));
            }
            out.insert("primitives".to_owned(), Value::Array(primitives));
            Value::Object(out)
        })
        .collect();
    let skins: Vec<Value> = match animation {
        Some(_) => list(root, "skins")
            .iter()
            .map(|skin| {
                let mut out = pick(skin, &["joints"]);
                if let Some(matrices) = skin.get("inverseBindMatrices") {
                    let number = accessors.number(matrices);
                    out.insert("inverseBindMatrices".to_owned(), json!(number));
                }
                Value::Object(out)
            })
            .collect(),
        None => Vec::new(),
    };
    let animations: Vec<Value> = animation
        .and_then(|i| list(root, "animations").get(i))
        .map(|animation| motion(animation, &mut accessors))
        .into_iter()
        .collect();
    let mut transform =
        vec!["name", "children", "mesh", "matrix", "translation", "rotation", "scale"];
    if animation.is_some() {
        transform.extend(["skin", "weights"]);
    }
    let nodes: Vec<Value> =
        list(root, "nodes").iter().map(|node| Value::Object(pick(node, &transform))).collect();
    let scenes: Vec<Value> = list(root, "scenes")
        .iter()
        .map(|scene| {
            let mut out = pick(scene, &["name", "nodes"]);
            out.entry("nodes").or_insert_with(|| json!([]));
            Value::Object(out)
        })
        .collect();
    let keep =
        ["bufferView", "byteOffset", "componentType", "normalized", "count", "type", "sparse"];
    let kept: Vec<Value> = accessors
        .kept
        .iter()
        .filter_map(|&i| list(root, "accessors").get(i))
        .map(|accessor| {
            let mut out = pick(accessor, &keep);
            // Bounds are required of positions; the reader does not use them.
            if out.get("type").and_then(Value::as_str) == Some("VEC3") {
                out.insert("min".to_owned(), json!([0, 0, 0]));
                out.insert("max".to_owned(), json!([0, 0, 0]));
            }
            Value::Object(out)
        })
        .collect();
    let buffers = buffers_of(root, &kept);
    let mut json = json!({
        "asset": { "version": "2.0" },
        "accessors": kept,
        "bufferViews": stripped(root, "bufferViews"),
        "buffers": stripped(root, "buffers"),
        "meshes": meshes,
        "nodes": nodes,
        "scenes": scenes,
        "skins": skins,
        "animations": animations,
    });
    if let Some(scene) = root.get("scene") {
        json["scene"] = scene.clone();
    }
    integers(&mut json);
    Reduced { json, accessors: accessors.kept, buffers, without_data }
}

/// Whether an accessor has bytes: without any it stands for zeros, which enclose nothing.
fn stored(root: &Map<String, Value>, accessor: &Value) -> bool {
    let index = accessor.as_f64().unwrap_or_default() as usize;
    let accessor = list(root, "accessors").get(index);
    accessor.is_some_and(|a| a.get("bufferView").is_some() || a.get("sparse").is_some())
}

/// Joints and their weights of a primitive's vertices.
fn influences(
    root: &Map<String, Value>,
    primitive: &Value,
    accessors: &mut Renumbering,
) -> Map<String, Value> {
    let attributes = primitive.get("attributes").and_then(Value::as_object);
    let mut out = Map::new();
    for (name, accessor) in attributes.into_iter().flatten() {
        let set = name.strip_prefix("JOINTS_").or(name.strip_prefix("WEIGHTS_"));
        if set.is_some_and(|s| s.parse::<u8>().is_ok()) && stored(root, accessor) {
            out.insert(name.clone(), json!(accessors.number(accessor)));
        }
    }
    out
}

/// Morph targets: displacements, none where they are not stored and hence zero.
fn targets(
    root: &Map<String, Value>,
    primitive: &Value,
    accessors: &mut Renumbering,
) -> Option<Value> {
    let targets = primitive.get("targets")?.as_array()?;
    let kept = targets.iter().map(|target| {
        let mut out = Map::new();
        if let Some(position) = target.get("POSITION").filter(|p| stored(root, p)) {
            out.insert("POSITION".to_owned(), json!(accessors.number(position)));
        }
        Value::Object(out)
    });
    Some(Value::Array(kept.collect()))
}

/// An animation with those of its channels that move nodes or morph targets.
fn motion(animation: &Value, accessors: &mut Renumbering) -> Value {
    let channels: Vec<&Value> = list_of(animation, "channels")
        .iter()
        .filter(|channel| {
            let target = channel.get("target");
            let path = target.and_then(|t| t.get("path")).and_then(Value::as_str);
            let known = ["translation", "rotation", "scale", "weights"];
            target.is_some_and(|t| t.get("node").is_some())
                && path.is_some_and(|p| known.contains(&p))
        })
        .collect();
    let samplers: Vec<Value> = list_of(animation, "samplers")
        .iter()
        .map(|sampler| {
            let mut out = pick(sampler, &["interpolation"]);
            for key in ["input", "output"] {
                if let Some(accessor) = sampler.get(key) {
                    out.insert(key.to_owned(), json!(accessors.number(accessor)));
                }
            }
            Value::Object(out)
        })
        .collect();
    json!({ "channels": channels, "samplers": samplers })
}

#[derive(Default)]
struct Renumbering {
    kept: Vec<usize>,
    new: HashMap<usize, usize>,
}

impl Renumbering {
    fn number(&mut self, old: &Value) -> usize {
        let old = old.as_f64().unwrap_or_default() as usize;
        *self.new.entry(old).or_insert_with(|| {
            self.kept.push(old);
            self.kept.len() - 1
        })
    }
}

fn list<'a>(root: &'a Map<String, Value>, name: &str) -> &'a [Value] {
    root.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn list_of<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn pick(value: &Value, keys: &[&str]) -> Map<String, Value> {
    let object = value.as_object();
    let found = object.into_iter().flatten().filter(|(key, _)| keys.contains(&key.as_str()));
    found.map(|(key, value)| (key.clone(), value.clone())).collect()
}

fn stripped(root: &Map<String, Value>, name: &str) -> Vec<Value> {
    let keys = ["buffer", "byteOffset", "byteLength", "byteStride", "uri"];
    list(root, name).iter().map(|v| Value::Object(pick(v, &keys))).collect()
}

fn buffers_of(root: &Map<String, Value>, accessors: &[Value]) -> Vec<usize> {
    let views = list(root, "bufferViews");
    let buffer = |view: Option<&Value>| {
        let view = views.get(view?.as_f64()? as usize)?;
        Some(view.get("buffer")?.as_f64()? as usize)
    };
    let mut out: Vec<usize> = accessors
        .iter()
        .flat_map(|a| {
            let sparse = a.get("sparse");
            let part = |name| sparse.and_then(|s| s.get(name)).and_then(|p| p.get("bufferView"));
            [a.get("bufferView"), part("indices"), part("values")]
        })
        .filter_map(buffer)
        .collect();
    out.sort_unstable();
    out.dedup();
    out
}

/// Writes `1.0` as `1`, which the typed reader insists on.
fn integers(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(integers),
        Value::Object(map) => map.values_mut().for_each(integers),
        Value::Number(n) if !n.is_i64() && !n.is_u64() => {
            // 2^53: past it a double no longer tells integers apart.
            let v = n.as_f64().filter(|v| v.fract() == 0.0 && v.abs() < 9e15);
            if let Some(v) = v {
                *value = json!(v as i64);
            }
        }
        _ => {}
    }
}
