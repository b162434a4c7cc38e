//! The properties of glTF 2.0 (chapter 5 of the specification) as tables for the validator.

use std::f64::consts::PI;

use ValueKind::{Bool, Id, Int, IntIn, List, Map, Num, Object, Text, TextIn, Uri};

/// Kind of a property.
pub(super) enum ValueKind {
    Bool,
    Text,
    Uri,
    Int(i64, i64),
    Num(f64, f64),
    IntIn(&'static [i64]),
    TextIn(&'static [&'static str]),
    /// Index into a top-level list.
    Id(&'static str),
    Object(&'static Table),
    /// Elements: least and largest number, and whether all differ.
    List(&'static ValueKind, usize, usize, bool),
    /// Any keys.
    Map(&'static ValueKind),
}

/// Properties of an object: name, whether required, kind.
pub(super) type Table = [(&'static str, bool, ValueKind)];

const MANY: usize = usize::MAX;
const INF: f64 = f64::INFINITY;
const ANY: ValueKind = Num(-INF, INF);
const UNIT: ValueKind = Num(0.0, 1.0);
const COUNT: ValueKind = Int(0, i64::MAX);
const SOME: ValueKind = Int(1, i64::MAX);
const COMPONENTS: &[i64] = &[5120, 5121, 5122, 5123, 5125, 5126];

pub(super) const ROOT: &Table = &[
    ("extensionsUsed", false, List(&Text, 1, MANY, true)),
    ("extensionsRequired", false, List(&Text, 1, MANY, true)),
    ("accessors", false, List(&Object(ACCESSOR), 1, MANY, false)),
    ("animations", false, List(&Object(ANIMATION), 1, MANY, false)),
    ("asset", true, Object(ASSET)),
    ("buffers", false, List(&Object(BUFFER), 1, MANY, false)),
    ("bufferViews", false, List(&Object(VIEW), 1, MANY, false)),
    ("cameras", false, List(&Object(CAMERA), 1, MANY, false)),
    ("images", false, List(&Object(IMAGE), 1, MANY, false)),
    ("materials", false, List(&Object(MATERIAL), 1, MANY, false)),
    ("meshes", false, List(&Object(MESH), 1, MANY, false)),
    ("nodes", false, List(&Object(NODE), 1, MANY, false)),
    ("samplers", false, List(&Object(SAMPLER), 1, MANY, false)),
    ("scene", false, Id("scenes")),
    ("scenes", false, List(&Object(SCENE), 1, MANY, false)),
    ("skins", false, List(&Object(SKIN), 1, MANY, false)),
    ("textures", false, List(&Object(TEXTURE), 1, MANY, false)),
];

const ASSET: &Table = &[
    ("copyright", false, Text),
    ("generator", false, Text),
    ("version", true, Text),
    ("minVersion", false, Text),
];

const ACCESSOR: &Table = &[
    ("bufferView", false, Id("bufferViews")),
    ("byteOffset", false, COUNT),
    ("componentType", true, IntIn(COMPONENTS)),
    ("normalized", false, Bool),
    ("count", true, SOME),
    ("type", true, TextIn(&["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"])),
    ("max", false, List(&ANY, 1, 16, false)),
    ("min", false, List(&ANY, 1, 16, false)),
    ("sparse", false, Object(SPARSE)),
    ("name", false, Text),
];

const SPARSE: &Table = &[
    ("count", true, SOME),
    ("indices", true, Object(SPARSE_INDICES)),
    ("values", true, Object(SPARSE_VALUES)),
];

const SPARSE_INDICES: &Table = &[
    ("bufferView", true, Id("bufferViews")),
    ("byteOffset", false, COUNT),
    ("componentType", true, IntIn(&[5121, 5123, 5125])),
];

const SPARSE_VALUES: &Table =
    &[("bufferView", true, Id("bufferViews")), ("byteOffset", false, COUNT)];

const BUFFER: &Table = &[("uri", false, Uri), ("byteLength", true, SOME), ("name", false, Text)];

const VIEW: &Table = &[
    ("buffer", true, Id("buffers")),
    ("byteOffset", false, COUNT),
    ("byteLength", true, SOME),
    ("byteStride", false, Int(4, 252)),
    ("target", false, IntIn(&[34962, 34963])),
    ("name", false, Text),
];

const NODE: &Table = &[
    ("camera", false, Id("cameras")),
    ("children", false, List(&Id("nodes"), 1, MANY, true)),
    ("skin", false, Id("skins")),
    ("matrix", false, List(&ANY, 16, 16, false)),
    ("mesh", false, Id("meshes")),
    ("rotation", false, List(&Num(-1.0, 1.0), 4, 4, false)),
    ("scale", false, List(&ANY, 3, 3, false)),
    ("translation", false, List(&ANY, 3, 3, false)),
    ("weights", false, List(&ANY, 1, MANY, false)),
    ("name", false, Text),
];

const SCENE: &Table = &[("nodes", false, List(&Id("nodes"), 1, MANY, true)), ("name", false, Text)];

const MESH: &Table = &[
    ("primitives", true, List(&Object(PRIMITIVE), 1, MANY, false)),
    ("weights", false, List(&ANY, 1, MANY, false)),
    ("name", false, Text),
];

const PRIMITIVE: &Table = &[
    ("attributes", true, Map(&Id("accessors"))),
    ("indices", false, Id("accessors")),
    ("material", false, Id("materials")),
    ("mode", false, Int(0, 6)),
    ("targets", false, List(&Map(&Id("accessors")), 1, MANY, false)),
];

const SKIN: &Table = &[
    ("inverseBindMatrices", false, Id("accessors")),
    ("skeleton", false, Id("nodes")),
    ("joints", true, List(&Id("nodes"), 1, MANY, true)),
    ("name", false, Text),
];

const ANIMATION: &Table = &[
    ("channels", true, List(&Object(CHANNEL), 1, MANY, false)),
    ("samplers", true, List(&Object(ANIMATION_SAMPLER), 1, MANY, false)),
    ("name", false, Text),
];

const CHANNEL: &Table = &[("sampler", true, COUNT), ("target", true, Object(TARGET))];

const TARGET: &Table = &[("node", false, Id("nodes")), ("path", true, Text)];

const ANIMATION_SAMPLER: &Table = &[
    ("input", true, Id("accessors")),
    ("interpolation", false, TextIn(&["LINEAR", "STEP", "CUBICSPLINE"])),
    ("output", true, Id("accessors")),
];

const CAMERA: &Table = &[
    ("orthographic", false, Object(ORTHOGRAPHIC)),
    ("perspective", false, Object(PERSPECTIVE)),
    ("type", true, TextIn(&["perspective", "orthographic"])),
    ("name", false, Text),
];

const ORTHOGRAPHIC: &Table = &[
    ("xmag", true, ANY),
    ("ymag", true, ANY),
    ("zfar", true, Num(f64::MIN_POSITIVE, INF)),
    ("znear", true, Num(0.0, INF)),
];

const PERSPECTIVE: &Table = &[
    ("aspectRatio", false, Num(f64::MIN_POSITIVE, INF)),
    ("yfov", true, Num(f64::MIN_POSITIVE, PI)),
    ("zfar", false, Num(f64::MIN_POSITIVE, INF)),
    ("znear", true, Num(f64::MIN_POSITIVE, INF)),
];

const IMAGE: &Table = &[
    ("uri", false, Uri),
    ("mimeType", false, Text),
    ("bufferView", false, Id("bufferViews")),
    ("name", false, Text),
];

const TEXTURE: &Table =
    &[("sampler", false, Id("samplers")), ("source", false, Id("images")), ("name", false, Text)];

const WRAPS: &[i64] = &[33071, 33648, 10497];

const SAMPLER: &Table = &[
    ("magFilter", false, IntIn(&[9728, 9729])),
    ("minFilter", false, IntIn(&[9728, 9729, 9984, 9985, 9986, 9987])),
    ("wrapS", false, IntIn(WRAPS)),
    ("wrapT", false, IntIn(WRAPS)),
    ("name", false, Text),
];

const MATERIAL: &Table = &[
    ("name", false, Text),
    ("pbrMetallicRoughness", false, Object(PBR)),
    ("normalTexture", false, Object(NORMAL_TEXTURE)),
    ("occlusionTexture", false, Object(OCCLUSION_TEXTURE)),
    ("emissiveTexture", false, Object(TEXTURE_INFO)),
    ("emissiveFactor", false, List(&UNIT, 3, 3, false)),
    ("alphaMode", false, TextIn(&["OPAQUE", "MASK", "BLEND"])),
    ("alphaCutoff", false, Num(0.0, INF)),
    ("doubleSided", false, Bool),
];

const PBR: &Table = &[
    ("baseColorFactor", false, List(&UNIT, 4, 4, false)),
    ("baseColorTexture", false, Object(TEXTURE_INFO)),
    ("metallicFactor", false, UNIT),
    ("roughnessFactor", false, UNIT),
    ("metallicRoughnessTexture", false, Object(TEXTURE_INFO)),
];

const TEXTURE_INFO: &Table = &[("index", true, Id("textures")), ("texCoord", false, COUNT)];

const NORMAL_TEXTURE: &Table =
    &[("index", true, Id("textures")), ("texCoord", false, COUNT), ("scale", false, ANY)];

const OCCLUSION_TEXTURE: &Table =
    &[("index", true, Id("textures")), ("texCoord", false, COUNT), ("strength", false, UNIT)];
