//! The data that make triangles, as the types of the `gltf` crate; for an animation also those that move them.
//! They are taken from the tree that was parsed and validated, so that a file is parsed once and no material or
//! texture can prevent the loading of its geometry.

use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::validate::integer;

/// The geometry of a file.
pub(super) struct Typed {
    /// Every list is in the file's order; of animations only the one that was asked for is there.
    pub root: Root,
    /// Primitives whose positions or indices are not stored anywhere, which are left out.
    pub without_data: usize,
}

impl Typed {
    /// The geometry of `file`, which has passed validation: references resolve and types are right. With
    /// the number of an `animation` also that one, morph targets and skins.
    ///
    /// # Errors
    /// A list that the crate cannot read, and why: a fault that validation let pass.
    pub fn of(mut file: Map<String, Value>, animation: Option<usize>) -> Result<Self, String> {
        for scene in file.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
            if scene.get("nodes").is_none() {
                scene["nodes"] = json!([]);
            }
        }
        let mut root = Root {
            accessors: list(&mut file, "accessors")?,
            buffers: list(&mut file, "buffers")?,
            buffer_views: list(&mut file, "bufferViews")?,
            meshes: list(&mut file, "meshes")?,
            nodes: list(&mut file, "nodes")?,
            scene: file.get("scene").and_then(integer).map(|scene| Index::new(scene as u32)),
            scenes: list(&mut file, "scenes")?,
            ..Root::default()
        };
        if let Some(number) = animation {
            root.skins = list(&mut file, "skins")?;
            keep_motion(&mut file, number);
            root.animations = list(&mut file, "animations")?;
        }
        let without_data = keep_stored(&mut root, animation.is_some());
        Ok(Self { root, without_data })
    }

    /// Returns the buffers that the geometry needs.
    pub fn buffers(&self) -> Vec<usize> {
        let root = &self.root;
        let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|p| {
            let targets = p.targets.iter().flatten().filter_map(|t| t.positions.as_ref());
            p.attributes.values().chain(&p.indices).chain(targets)
        });
        let skins = root.skins.iter().filter_map(|skin| skin.inverse_bind_matrices.as_ref());
        let samplers = root.animations.iter().flat_map(|animation| &animation.samplers);
        let samplers = samplers.flat_map(|sampler| [&sampler.input, &sampler.output]);
        let accessors = primitives.chain(skins).chain(samplers);
        let views = accessors.filter_map(|i| root.accessors.get(i.value())).flat_map(|accessor| {
            let sparse = accessor.sparse.as_ref();
            let parts = sparse.map(|s| [s.indices.buffer_view, s.values.buffer_view]);
            accessor.buffer_view.into_iter().chain(parts.into_iter().flatten())
        });
        let mut out: Vec<usize> =
            views.filter_map(|i| Some(root.buffer_views.get(i.value())?.buffer.value())).collect();
        out.sort_unstable();
        out.dedup();
        out
    }
}

/// Takes a list out of a file.
fn list<T: DeserializeOwned>(file: &mut Map<String, Value>, name: &str) -> Result<Vec<T>, String> {
    let mut list = file.remove(name).unwrap_or_else(|| json!([]));
    plain(&mut list);
    serde_json::from_value(list).map_err(|e| format!("its {name} cannot be read: {e}"))
}

/// Drops what authors may put anywhere, and writes integers as integers: `1.0` is one, too.
fn plain(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(plain),
        Value::Object(object) => {
            object.retain(|key, _| key != "extras" && key != "extensions");
            object.values_mut().for_each(plain);
        }
        Value::Number(number) if number.is_f64() => {
            if let Some(whole) = integer(value) {
                *value = whole.into();
            }
        }
        _ => {}
    }
}

/// Leaves one animation, with those of its channels that move nodes or morph targets.
fn keep_motion(file: &mut Map<String, Value>, number: usize) {
    let Some(Value::Array(animations)) = file.get_mut("animations") else {
        return;
    };
    *animations = animations.drain(..).skip(number).take(1).collect();
    let channels = animations.iter_mut().filter_map(|a| a.get_mut("channels")?.as_array_mut());
    for channels in channels {
        channels.retain(|channel| {
            let target = channel.get("target");
            let path = target.and_then(|t| t.get("path")).and_then(Value::as_str);
            target.is_some_and(|t| t.get("node").is_some())
                && ["translation", "rotation", "scale", "weights"].map(Some).contains(&path)
        });
    }
}

/// Leaves the primitives whose positions and indices are stored, and of these the attributes of position; if
/// `animated` also those of motion. Returns the number of the other primitives.
fn keep_stored(root: &mut Root, animated: bool) -> usize {
    // Without any bytes an accessor means zeros, which enclose nothing.
    let stored = |at: &Index<Accessor>| {
        let accessor = root.accessors.get(at.value());
        accessor.is_some_and(|a| a.buffer_view.is_some() || a.sparse.is_some())
    };
    let mut without_data = 0;
    for mesh in &mut root.meshes {
        let all = mesh.primitives.len();
        mesh.primitives.retain(|p| {
            let positions = p.attributes.get(&Checked::Valid(Semantic::Positions));
            positions.is_some_and(stored) && p.indices.as_ref().is_none_or(stored)
        });
        without_data += all - mesh.primitives.len();
        for primitive in &mut mesh.primitives {
            primitive.attributes.retain(|meaning, at| match meaning {
                Checked::Valid(Semantic::Positions) => true,
                Checked::Valid(Semantic::Joints(_) | Semantic::Weights(_)) => {
                    animated && stored(at)
                }
                _ => false,
            });
            primitive.targets = primitive.targets.take().filter(|_| animated);
            for target in primitive.targets.iter_mut().flatten() {
                target.positions = target.positions.filter(stored);
            }
        }
    }
    without_data
}
