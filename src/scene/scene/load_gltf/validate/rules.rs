//! Rules between properties that a table of types cannot state.

use serde_json::Value;

use super::{Findings, integer};

/// Extensions that a file may require although they are not read: they leave positions and
/// triangles as they are. Mesh quantisation only widens the component types.
const HARMLESS: [&str; 9] = [
    "KHR_mesh_quantization",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_animation_pointer",
    "KHR_xmp",
    "MSFT_texture_",
];

/// Rotations shorter or longer than one by this are not the exporter's rounding.
const UNIT_TOLERANCE: f64 = 5e-3;

pub(super) fn check(findings: &mut Findings<'_>) {
    version(findings);
    extensions(findings);
    unread(findings);
    views(findings);
    accessors(findings);
    nodes(findings);
    tree(findings);
    meshes(findings);
    channels(findings);
}

fn list<'a>(findings: &Findings<'a>, name: &str) -> &'a [Value] {
    findings.root.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn number(value: &Value, key: &str) -> Option<i64> {
    value.get(key).and_then(integer)
}

fn version(findings: &mut Findings<'_>) {
    let asset = findings.root.get("asset");
    let read = |key| asset.and_then(|a| a.get(key)).and_then(Value::as_str);
    let parse = |text: &str| {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
    };
    let version = read("version").map(|v| (v, parse(v)));
    match version {
        Some((_, Some((2, 0)))) | None => {}
        Some((v, Some((2, _)))) => {
            findings.remark("/asset/version", format!("is {v}; read as 2.0"))
        }
        Some((v, Some(_))) => {
            findings.fault("/asset/version", format!("is {v}; glTF 2.0 can be read"));
            // Other differences from 2.0 are no faults in a file of another version.
            findings.only_last("export it as glTF 2.0, or convert it (gltf-pipeline does)");
        }
        Some((v, None)) => findings.fault("/asset/version", format!("is `{v}`, not a version")),
    }
    match read("minVersion").map(|v| (v, parse(v))) {
        Some((_, Some(least))) if least <= (2, 0) => {}
        Some((v, _)) => {
            findings.fault("/asset/minVersion", format!("requires `{v}`; 2.0 can be read"))
        }
        None => {}
    }
}

fn extensions(findings: &mut Findings<'_>) {
    let used: Vec<_> = list(findings, "extensionsUsed").iter().filter_map(Value::as_str).collect();
    for name in list(findings, "extensionsRequired").iter().filter_map(Value::as_str) {
        if !HARMLESS.iter().any(|known| name.starts_with(known)) {
            findings.fault(
                "/meshes",
                format!("the file requires the extension {name}, which cannot be read"),
            );
        }
        if !used.contains(&name) {
            findings
                .remark("/extensionsRequired", format!("{name} is not declared in extensionsUsed"));
        }
    }
    // Component types are taken as they are, quantised or not.
    let unread: Vec<_> = used.into_iter().filter(|name| *name != "KHR_mesh_quantization").collect();
    if !unread.is_empty() {
        findings.note("/extensionsUsed", format!("not read: {}", unread.join(", ")));
    }
}

/// Notes the lists that do not affect the triangles: only their types are checked.
fn unread(findings: &mut Findings<'_>) {
    for name in ["animations", "skins", "cameras", "images"] {
        let count = list(findings, name).len();
        let read = findings.animated && ["animations", "skins"].contains(&name);
        if count > 0 && !read {
            let unless = match name {
                "animations" | "skins" => " unless an animation is asked for",
                _ => "",
            };
            let message = format!("{count} {name} are not read{unless}");
            findings.note(&format!("/{name}"), message);
        }
    }
    for (i, material) in list(findings, "materials").iter().enumerate() {
        let masked = material.get("alphaMode").and_then(Value::as_str) == Some("MASK");
        if material.get("alphaCutoff").is_some() && !masked {
            findings.remark(&format!("/materials/{i}/alphaCutoff"), "needs alphaMode MASK");
        }
    }
}

fn views(findings: &mut Findings<'_>) {
    let buffers = list(findings, "buffers");
    for (i, view) in list(findings, "bufferViews").iter().enumerate() {
        let at = format!("/bufferViews/{i}");
        let held = number(view, "buffer")
            .and_then(|b| buffers.get(usize::try_from(b).ok()?))
            .and_then(|b| number(b, "byteLength"));
        let end = number(view, "byteOffset")
            .unwrap_or(0)
            .saturating_add(number(view, "byteLength").unwrap_or(0));
        if held.is_some_and(|held| end > held) {
            findings.fault(&at, format!("ends at byte {end}, beyond its buffer"));
        }
        if let Some(stride) = number(view, "byteStride") {
            if stride % 4 != 0 {
                findings.fault(
                    &format!("{at}/byteStride"),
                    format!("is {stride}, not a multiple of 4"),
                );
            }
            if number(view, "byteLength").is_some_and(|length| stride > length) {
                findings.fault(&format!("{at}/byteStride"), "is larger than the view");
            }
            if number(view, "target") == Some(34963) {
                findings.fault(&format!("{at}/byteStride"), "does not belong to indices");
            }
        }
    }
    let first_embedded = usize::from(!buffers.is_empty());
    for (i, buffer) in buffers.iter().enumerate().skip(first_embedded) {
        if buffer.get("uri").is_none() {
            findings.remark(&format!("/buffers/{i}"), "has no uri");
        }
    }
    for (i, buffer) in buffers.iter().enumerate() {
        let uri = buffer.get("uri").and_then(Value::as_str).unwrap_or_default();
        let header = uri.split(',').next().unwrap_or_default();
        if header.starts_with("data:") && header.contains(";;") {
            findings.remark(&format!("/buffers/{i}/uri"), "is not a valid data URI");
        }
        let media = uri.strip_prefix("data:").and_then(|u| u.split([',', ';']).next());
        if media
            .is_some_and(|m| !["application/octet-stream", "application/gltf-buffer"].contains(&m))
        {
            findings.remark(&format!("/buffers/{i}/uri"), "has the media type of something else");
        }
    }
}

fn accessors(findings: &mut Findings<'_>) {
    for (i, accessor) in list(findings, "accessors").iter().enumerate() {
        let at = format!("/accessors/{i}");
        let has = |key| accessor.get(key).is_some();
        let kind = accessor.get("type").and_then(Value::as_str).unwrap_or_default();
        let component = number(accessor, "componentType").unwrap_or_default();
        for key in ["min", "max"] {
            let bounds = accessor.get(key).and_then(Value::as_array);
            let wanted = components(kind);
            if bounds.is_some_and(|b| wanted > 0 && b.len() != wanted) {
                findings.fault(&format!("{at}/{key}"), format!("should have {wanted} elements"));
            }
        }
        if has("byteOffset") && !has("bufferView") {
            findings.fault(&format!("{at}/byteOffset"), "needs a bufferView");
        }
        let normalized = accessor.get("normalized").and_then(Value::as_bool) == Some(true);
        if normalized && matches!(component, 5125 | 5126) {
            findings.fault(&format!("{at}/normalized"), "does not go with this componentType");
        }
        let sparse = accessor.get("sparse");
        let replaced = sparse.and_then(|s| number(s, "count"));
        if replaced.is_some_and(|n| Some(n) > number(accessor, "count")) {
            findings.fault(&format!("{at}/sparse/count"), "is larger than the accessor");
        }
    }
}

fn nodes(findings: &mut Findings<'_>) {
    for (i, node) in list(findings, "nodes").iter().enumerate() {
        let at = format!("/nodes/{i}");
        let numbers = |key: &str| -> Option<Vec<f64>> {
            node.get(key)?.as_array()?.iter().map(Value::as_f64).collect()
        };
        if let Some(q) = numbers("rotation").filter(|q| q.len() == 4) {
            let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            if (length - 1.0).abs() > UNIT_TOLERANCE {
                findings.fault(&format!("{at}/rotation"), format!("has length {length:.4}, not 1"));
            }
        }
        for key in ["weights", "skin"] {
            if node.get(key).is_some() && node.get("mesh").is_none() {
                findings.remark(&format!("{at}/{key}"), "needs a mesh");
            }
        }
        let Some(m) = numbers("matrix").filter(|m| m.len() == 16) else {
            continue;
        };
        for key in ["translation", "rotation", "scale"] {
            if node.get(key).is_some() {
                findings.fault(&at, format!("has both matrix and {key}"));
            }
        }
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            findings.fault(&format!("{at}/matrix"), "is not affine");
        }
        let axis = |k: usize| glam::DVec3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
        let skew =
            |a: usize, b: usize| axis(a).normalize_or_zero().dot(axis(b).normalize_or_zero()).abs();
        if skew(0, 1).max(skew(1, 2)).max(skew(0, 2)) > UNIT_TOLERANCE {
            findings.remark(&format!("{at}/matrix"), "shears, which glTF does not allow");
        }
        if axis(0).cross(axis(1)).dot(axis(2)) == 0.0 {
            findings.fault(&format!("{at}/matrix"), "flattens its mesh (determinant zero)");
        }
    }
}

/// Components of an element, 0 for an unknown type.
fn components(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => 0,
    }
}

/// Every node has one parent at most and no node is its own ancestor.
fn tree(findings: &mut Findings<'_>) {
    let nodes = list(findings, "nodes");
    let mut parent: Vec<Option<usize>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        let children = node.get("children").and_then(Value::as_array);
        for child in children.into_iter().flatten().filter_map(integer) {
            let Some(slot) = usize::try_from(child).ok().and_then(|c| parent.get_mut(c)) else {
                continue;
            };
            if slot.is_some_and(|other| other != i) {
                findings.fault(&format!("/nodes/{child}"), "has two parents");
            }
            *slot = Some(i);
        }
    }
    for start in 0..nodes.len() {
        let mut at = parent[start];
        // A path longer than the number of nodes is a cycle.
        let mut steps = 0;
        while let Some(up) = at.filter(|&up| up != start && steps <= nodes.len()) {
            at = parent[up];
            steps += 1;
        }
        if at == Some(start) {
            findings.fault(&format!("/nodes/{start}"), "is its own ancestor");
            break;
        }
    }
    for (i, scene) in list(findings, "scenes").iter().enumerate() {
        let roots = scene.get("nodes").and_then(Value::as_array);
        for root in roots.into_iter().flatten().filter_map(integer) {
            let inner = usize::try_from(root).ok().and_then(|r| parent.get(r).copied().flatten());
            if inner.is_some() {
                findings.fault(
                    &format!("/scenes/{i}/nodes"),
                    format!("node {root} is no root: it has a parent"),
                );
            }
        }
    }
}

fn meshes(findings: &mut Findings<'_>) {
    let accessors = list(findings, "accessors");
    let count = |value: Option<&Value>| {
        let accessor = accessors.get(usize::try_from(integer(value?)?).ok()?)?;
        number(accessor, "count")
    };
    for (m, mesh) in list(findings, "meshes").iter().enumerate() {
        let primitives = mesh.get("primitives").and_then(Value::as_array);
        for (p, primitive) in primitives.into_iter().flatten().enumerate() {
            let at = format!("/meshes/{m}/primitives/{p}");
            let attributes = primitive.get("attributes").and_then(Value::as_object);
            let positions = count(attributes.and_then(|a| a.get("POSITION")));
            for (name, accessor) in attributes.into_iter().flatten() {
                let known = ["POSITION", "NORMAL", "TANGENT"].contains(&name.as_str())
                    || ["TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_", "_"]
                        .iter()
                        .any(|p| name.starts_with(p));
                if !known {
                    findings.remark(
                        &format!("{at}/attributes/{name}"),
                        "is not an attribute of glTF 2.0",
                    );
                }
                let other = count(Some(accessor));
                if positions.is_some() && other.is_some() && other != positions {
                    findings.fault(
                        &format!("{at}/attributes/{name}"),
                        "differs in count from POSITION",
                    );
                }
            }
            if primitive.get("targets").is_some() && !findings.animated {
                findings.note(
                    &format!("{at}/targets"),
                    "morph targets are not read unless an animation is asked for",
                );
            }
        }
    }
}

/// The only index into a list that is not at the top.
fn channels(findings: &mut Findings<'_>) {
    for (a, animation) in list(findings, "animations").iter().enumerate() {
        let parts = |name| animation.get(name).and_then(Value::as_array).into_iter().flatten();
        let held = parts("samplers").count();
        for (c, channel) in parts("channels").enumerate() {
            let sampler = number(channel, "sampler");
            if let Some(i) = sampler.filter(|i| !(0..held as i64).contains(i)) {
                findings.fault(
                    &format!("/animations/{a}/channels/{c}/sampler"),
                    format!("names samplers[{i}], which does not exist ({held} do)"),
                );
            }
        }
    }
}
