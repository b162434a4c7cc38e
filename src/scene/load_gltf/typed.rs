//! The data that make triangles, as the types of the `gltf` crate; for an animation also those that move them.
//! They are taken from the tree that was parsed and validated, so that a file is parsed once and no material or
//! texture can prevent the loading of its geometry.

use gltf::json::accessor::sparse::{Indices, Sparse, Values};
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType, Type};
use gltf::json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf::json::buffer::{Stride, View};
use gltf::json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Animation, Buffer, Index, Mesh, Node, Root, Scene, Skin};
use serde_json::{Map, Value};

use super::validate;

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
    pub fn of(file: &Map<String, Value>, animation: Option<usize>) -> Self {
        let animated = animation.is_some();
        let mut root = Root {
            accessors: each(file.get("accessors"), accessor),
            buffers: each(file.get("buffers"), buffer),
            buffer_views: each(file.get("bufferViews"), view),
            nodes: each(file.get("nodes"), |value| node(value, animated)),
            scene: index(file.get("scene")),
            scenes: each(file.get("scenes"), scene),
            ..Root::default()
        };
        let mut without_data = 0;
        root.meshes = each(file.get("meshes"), |value| {
            let all = list(value.get("primitives"));
            let primitives: Vec<Primitive> =
                all.iter().filter_map(|p| primitive(&root.accessors, p, animated)).collect();
            without_data += all.len() - primitives.len();
            Mesh {
                extensions: None,
                extras: Default::default(),
                name: text(value.get("name")),
                primitives,
                weights: numbers(value.get("weights")).filter(|_| animated),
            }
        });
        if let Some(number) = animation {
            root.skins = each(file.get("skins"), skin);
            root.animations =
                list(file.get("animations")).get(number).map(motion).into_iter().collect();
        }
        Self { root, without_data }
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

fn accessor(value: &Value) -> Accessor {
    let kind = match value.get("type").and_then(Value::as_str) {
        Some("SCALAR") => Checked::Valid(Type::Scalar),
        Some("VEC2") => Checked::Valid(Type::Vec2),
        Some("VEC3") => Checked::Valid(Type::Vec3),
        Some("VEC4") => Checked::Valid(Type::Vec4),
        Some("MAT2") => Checked::Valid(Type::Mat2),
        Some("MAT3") => Checked::Valid(Type::Mat3),
        Some("MAT4") => Checked::Valid(Type::Mat4),
        _ => Checked::Invalid,
    };
    Accessor {
        buffer_view: index(value.get("bufferView")),
        byte_offset: whole(value.get("byteOffset")).map(USize64),
        count: size(value.get("count")),
        component_type: component(value)
            .map_or(Checked::Invalid, |c| Checked::Valid(GenericComponentType(c))),
        extensions: None,
        extras: Default::default(),
        type_: kind,
        min: None,
        max: None,
        name: None,
        normalized: value.get("normalized").and_then(Value::as_bool).unwrap_or_default(),
        sparse: value.get("sparse").and_then(sparse),
    }
}

fn sparse(value: &Value) -> Option<Sparse> {
    let (indices, values) = (value.get("indices")?, value.get("values")?);
    Some(Sparse {
        count: size(value.get("count")),
        indices: Indices {
            buffer_view: index(indices.get("bufferView"))?,
            byte_offset: size(indices.get("byteOffset")),
            component_type: component(indices)
                .map_or(Checked::Invalid, |c| Checked::Valid(IndexComponentType(c))),
            extensions: None,
            extras: Default::default(),
        },
        values: Values {
            buffer_view: index(values.get("bufferView"))?,
            byte_offset: size(values.get("byteOffset")),
            extensions: None,
            extras: Default::default(),
        },
        extensions: None,
        extras: Default::default(),
    })
}

fn component(value: &Value) -> Option<ComponentType> {
    Some(match whole(value.get("componentType"))? {
        5120 => ComponentType::I8,
        5121 => ComponentType::U8,
        5122 => ComponentType::I16,
        5123 => ComponentType::U16,
        5125 => ComponentType::U32,
        5126 => ComponentType::F32,
        _ => return None,
    })
}

fn buffer(value: &Value) -> Buffer {
    Buffer {
        byte_length: size(value.get("byteLength")),
        name: None,
        uri: text(value.get("uri")),
        extensions: None,
        extras: Default::default(),
    }
}

fn view(value: &Value) -> View {
    View {
        buffer: index(value.get("buffer")).unwrap_or_else(|| Index::new(0)),
        byte_length: size(value.get("byteLength")),
        byte_offset: whole(value.get("byteOffset")).map(USize64),
        byte_stride: whole(value.get("byteStride")).map(|n| Stride(n as usize)),
        name: None,
        target: None,
        extensions: None,
        extras: Default::default(),
    }
}

fn node(value: &Value, animated: bool) -> Node {
    Node {
        camera: None,
        children: value.get("children").map(|children| indices(Some(children))),
        extensions: None,
        extras: Default::default(),
        matrix: array(value.get("matrix")),
        mesh: index(value.get("mesh")),
        name: text(value.get("name")),
        rotation: array(value.get("rotation")).map(UnitQuaternion),
        scale: array(value.get("scale")),
        translation: array(value.get("translation")),
        skin: index(value.get("skin")).filter(|_| animated),
        weights: numbers(value.get("weights")).filter(|_| animated),
    }
}

fn scene(value: &Value) -> Scene {
    Scene {
        extensions: None,
        extras: Default::default(),
        name: text(value.get("name")),
        nodes: indices(value.get("nodes")),
    }
}

fn skin(value: &Value) -> Skin {
    Skin {
        extensions: None,
        extras: Default::default(),
        inverse_bind_matrices: index(value.get("inverseBindMatrices")),
        joints: indices(value.get("joints")),
        name: None,
        skeleton: None,
    }
}

/// A primitive; none where positions or indices are not stored.
fn primitive(accessors: &[Accessor], value: &Value, animated: bool) -> Option<Primitive> {
    // Without any bytes an accessor means zeros, which enclose nothing.
    let stored = |value: Option<&Value>| {
        let at: Index<Accessor> = index(value)?;
        let accessor = accessors.get(at.value())?;
        (accessor.buffer_view.is_some() || accessor.sparse.is_some()).then_some(at)
    };
    let attributes = value.get("attributes").and_then(Value::as_object);
    let attributes = attributes.into_iter().flatten().filter_map(|(name, accessor)| {
        let meaning = semantic(name).filter(|s| *s == Semantic::Positions || animated)?;
        Some((Checked::Valid(meaning), stored(Some(accessor))?))
    });
    let attributes: std::collections::BTreeMap<_, _> = attributes.collect();
    let indices = stored(value.get("indices"));
    if !attributes.contains_key(&Checked::Valid(Semantic::Positions))
        || indices.is_none() && value.get("indices").is_some()
    {
        return None;
    }
    let target = |target: &Value| MorphTarget {
        positions: stored(target.get("POSITION")),
        normals: None,
        tangents: None,
    };
    Some(Primitive {
        attributes,
        extensions: None,
        extras: Default::default(),
        indices,
        material: None,
        mode: match whole(value.get("mode")) {
            None | Some(4) => Checked::Valid(Mode::Triangles),
            Some(0) => Checked::Valid(Mode::Points),
            Some(1) => Checked::Valid(Mode::Lines),
            Some(2) => Checked::Valid(Mode::LineLoop),
            Some(3) => Checked::Valid(Mode::LineStrip),
            Some(5) => Checked::Valid(Mode::TriangleStrip),
            Some(6) => Checked::Valid(Mode::TriangleFan),
            Some(_) => Checked::Invalid,
        },
        targets: animated.then(|| each(value.get("targets"), target)),
    })
}

/// Returns the meaning of an attribute of position or motion; none for colour, texture and the like.
fn semantic(name: &str) -> Option<Semantic> {
    if name == "POSITION" {
        return Some(Semantic::Positions);
    }
    let joints = name.strip_prefix("JOINTS_").map(|set| set.parse().map(Semantic::Joints));
    joints.or(name.strip_prefix("WEIGHTS_").map(|set| set.parse().map(Semantic::Weights)))?.ok()
}

/// An animation with those of its channels that move nodes or morph targets.
fn motion(value: &Value) -> Animation {
    let channels = list(value.get("channels")).iter().filter_map(|channel| {
        let target = channel.get("target")?;
        let path = match target.get("path").and_then(Value::as_str)? {
            "translation" => Property::Translation,
            "rotation" => Property::Rotation,
            "scale" => Property::Scale,
            "weights" => Property::MorphTargetWeights,
            _ => return None,
        };
        Some(Channel {
            sampler: index(channel.get("sampler"))?,
            target: Target {
                extensions: None,
                extras: Default::default(),
                node: index(target.get("node"))?,
                path: Checked::Valid(path),
            },
            extensions: None,
            extras: Default::default(),
        })
    });
    let samplers = list(value.get("samplers")).iter().filter_map(|sampler| {
        Some(Sampler {
            extensions: None,
            extras: Default::default(),
            input: index(sampler.get("input"))?,
            interpolation: Checked::Valid(
                match sampler.get("interpolation").and_then(Value::as_str) {
                    Some("STEP") => Interpolation::Step,
                    Some("CUBICSPLINE") => Interpolation::CubicSpline,
                    _ => Interpolation::Linear,
                },
            ),
            output: index(sampler.get("output"))?,
        })
    });
    Animation {
        extensions: None,
        extras: Default::default(),
        channels: channels.collect(),
        name: None,
        samplers: samplers.collect(),
    }
}

fn list(value: Option<&Value>) -> &[Value] {
    value.and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn each<T>(value: Option<&Value>, typed: impl FnMut(&Value) -> T) -> Vec<T> {
    list(value).iter().map(typed).collect()
}

/// An integer, which may be written as `1.0`.
fn whole(value: Option<&Value>) -> Option<u64> {
    validate::integer(value?)?.try_into().ok()
}

fn size(value: Option<&Value>) -> USize64 {
    USize64(whole(value).unwrap_or_default())
}

fn index<T>(value: Option<&Value>) -> Option<Index<T>> {
    whole(value)?.try_into().ok().map(Index::new)
}

fn indices<T>(value: Option<&Value>) -> Vec<Index<T>> {
    list(value).iter().filter_map(|value| index(Some(value))).collect()
}

fn text(value: Option<&Value>) -> Option<String> {
    value?.as_str().map(str::to_owned)
}

fn numbers(value: Option<&Value>) -> Option<Vec<f32>> {
    value?.as_array()?.iter().map(|number| Some(number.as_f64()? as f32)).collect()
}

fn array<const N: usize>(value: Option<&Value>) -> Option<[f32; N]> {
    numbers(value)?.try_into().ok()
}
