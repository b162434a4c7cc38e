//! Keeps of a glTF file what makes triangles: nodes, positions, indices. The typed reader then
//! cannot stumble over a material, and its own validation concerns the geometry only.

use serde_json::{Map, Value, json};

/// The geometry of a file, with accessors renumbered.
pub(super) struct Reduced {
    pub json: Value,
    /// Buffers that the geometry needs.
    pub buffers: Vec<usize>,
    /// Primitives whose positions or indices are not stored anywhere, which are left out.
    pub without_data: usize,
}

/// `root` has passed validation: references resolve and types are right.
pub(super) fn reduce(root: &Map<String, Value>) -> Reduced {
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
                    let position = accessors.number(position?);
                    out.insert("attributes".to_owned(), json!({ "POSITION": position }));
                    if let Some(indices) = primitive.get("indices") {
                        out.insert("indices".to_owned(), json!(accessors.number(indices)));
                    }
                    Some(Value::Object(out))
                })
                .collect();
            let mut out = pick(mesh, &["name"]);
            out.insert("primitives".to_owned(), Value::Array(primitives));
            Value::Object(out)
        })
        .collect();
    let transform = [
        "name",
        "children",
        "mesh",
        "matrix",
        "translation",
        "rotation",
        "scale",
    ];
    let nodes: Vec<Value> = list(root, "nodes")
        .iter()
        .map(|node| Value::Object(pick(node, &transform)))
        .collect();
    let scenes: Vec<Value> = list(root, "scenes")
        .iter()
        .map(|scene| {
            let mut out = pick(scene, &["name", "nodes"]);
            out.entry("nodes").or_insert_with(|| json!([]));
            Value::Object(out)
        })
        .collect();
    let keep = [
        "bufferView",
        "byteOffset",
        "componentType",
        "normalized",
        "count",
        "type",
        "sparse",
    ];
    let kept: Vec<Value> = accessors
        .0
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
    });
    if let Some(scene) = root.get("scene") {
        json["scene"] = scene.clone();
    }
    integers(&mut json);
    Reduced {
        json,
        buffers,
        without_data,
    }
}

/// Whether an accessor has bytes: without any it stands for zeros, which enclose nothing.
fn stored(root: &Map<String, Value>, accessor: &Value) -> bool {
    let index = accessor.as_f64().unwrap_or_default() as usize;
    let accessor = list(root, "accessors").get(index);
    accessor.is_some_and(|a| a.get("bufferView").is_some() || a.get("sparse").is_some())
}

#[derive(Default)]
struct Renumbering(Vec<usize>);

impl Renumbering {
    fn number(&mut self, old: &Value) -> usize {
        let old = old.as_f64().unwrap_or_default() as usize;
        self.0.iter().position(|&i| i == old).unwrap_or_else(|| {
            self.0.push(old);
            self.0.len() - 1
        })
    }
}

fn list<'a>(root: &'a Map<String, Value>, name: &str) -> &'a [Value] {
    root.get(name)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

fn list_of<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value
        .get(name)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

fn pick(value: &Value, keys: &[&str]) -> Map<String, Value> {
    let object = value.as_object();
    let found = object
        .into_iter()
        .flatten()
        .filter(|(key, _)| keys.contains(&key.as_str()));
    found
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect()
}

fn stripped(root: &Map<String, Value>, name: &str) -> Vec<Value> {
    let keys = ["buffer", "byteOffset", "byteLength", "byteStride", "uri"];
    list(root, name)
        .iter()
        .map(|v| Value::Object(pick(v, &keys)))
        .collect()
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
            let part = |name| {
                sparse
                    .and_then(|s| s.get(name))
                    .and_then(|p| p.get("bufferView"))
            };
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
