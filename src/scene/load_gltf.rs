//! glTF 2.0, text and binary: triangles of the scene's nodes in rest pose. Metres.

use std::path::Path;

use glam::DMat4;
use gltf::mesh::Mode;

use super::issue::Issue;
use super::mesh::{self, MAX_ELEMENTS, Parts, Soup};

mod accessor;
mod bounds;
mod buffers;
mod glb;
mod reduce;
mod schema;
mod validate;

use accessor::Reader;

/// Most commas of the JSON part: each value of the parsed tree takes some 50 bytes of memory.
const MAX_VALUES: usize = 4_000_000;

pub(super) fn read(path: &Path, bytes: &[u8], node: Option<&str>) -> Result<Parts, Vec<Issue>> {
    let one = |issue: Issue| vec![issue];
    let glb::Container {
        json,
        binary,
        mut issues,
    } = glb::open(path, bytes).map_err(one)?;
    let root = parse(path, json).map_err(one)?;
    issues.extend(validate::issues(path, validate::validate(&root)));
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    let reduced = reduce::reduce(&root);
    let invalid = |cause: String| {
        let message = format!("is not a valid glTF file: {cause}");
        one(Issue::error(path, 1, message, "export it again"))
    };
    let json: gltf::json::Root =
        serde_json::from_value(reduced.json).map_err(|e| invalid(e.to_string()))?;
    let gltf = gltf::Document::from_json(json).map_err(|e| invalid(e.to_string()))?;
    let buffers::Buffers {
        bytes: buffers,
        issues: unread,
    } = buffers::load(path, &gltf, binary, &reduced.buffers);
    issues.extend(unread);
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    issues.extend(validate::issues(path, bounds::check(&root, &buffers)));
    let reader = Reader {
        path,
        buffers: &buffers,
    };
    let mut walk = Walk {
        reader,
        parts: Vec::new(),
        issues,
        visited: vec![false; gltf.nodes().len()],
        elements: 0,
    };
    if reduced.without_data > 0 {
        walk.warn(
            reduced.without_data,
            "primitives without stored positions are ignored",
        );
    }
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let roots: Vec<_> = match &scene {
        Some(scene) => scene.nodes().collect(),
        None => roots(&gltf),
    };
    let chosen = match node {
        Some(name) => Some(
            gltf.nodes()
                .find(|n| n.name() == Some(name))
                .ok_or_else(|| {
                    let names: Vec<_> = gltf
                        .nodes()
                        .filter_map(|n| n.name().map(str::to_owned))
                        .collect();
                    one(mesh::no_such_node(path, name, &names))
                })?,
        ),
        None => None,
    };
    for root in roots {
        walk.node(
            &root,
            DMat4::IDENTITY,
            chosen.as_ref().map(gltf::Node::index),
        )
        .map_err(one)?;
    }
    if let Some(node) = &chosen
        && !walk.visited[node.index()]
    {
        walk.node(node, DMat4::IDENTITY, None).map_err(one)?;
        walk.warn(
            1,
            "the node is outside the file's scene: its parents' transforms are not applied",
        );
    }
    let unseen = gltf
        .nodes()
        .filter(|n| n.mesh().is_some() && !walk.visited[n.index()])
        .count();
    if unseen > 0 {
        walk.warn(
            unseen,
            "nodes with meshes outside the default scene are ignored",
        );
    }
    Ok(Parts {
        parts: walk.parts,
        issues: walk.issues,
    })
}

fn parse(path: &Path, json: &[u8]) -> Result<serde_json::Map<String, serde_json::Value>, Issue> {
    let fail = |message: String, remedy: &str| Issue::error(path, 1, message, remedy);
    if json.iter().filter(|&&b| b == b',').count() > MAX_VALUES {
        return Err(fail(
            "its JSON part is too large".to_owned(),
            "store numbers in buffers",
        ));
    }
    let again = "export or copy it again";
    match serde_json::from_slice(json) {
        Ok(serde_json::Value::Object(root)) => Ok(root),
        Ok(_) => Err(fail("its JSON is not an object".to_owned(), again)),
        Err(e) => Err(fail(format!("is not valid JSON: {e}"), again)),
    }
}

/// Nodes that are nobody's child, for files without scenes.
fn roots(gltf: &gltf::Document) -> Vec<gltf::Node<'_>> {
    let mut child = vec![false; gltf.nodes().len()];
    for node in gltf.nodes() {
        for c in node.children() {
            child[c.index()] = true;
        }
    }
    gltf.nodes().filter(|n| !child[n.index()]).collect()
}

struct Walk<'a> {
    reader: Reader<'a>,
    parts: Vec<Soup>,
    issues: Vec<Issue>,
    visited: Vec<bool>,
    elements: usize,
}

impl Walk<'_> {
    fn warn(&mut self, count: usize, message: &str) {
        let message = format!("{message} ({count})");
        self.issues
            .push(Issue::warning(self.reader.path, count, message, ""));
    }

    /// Follows the tree without recursion, because a file may nest nodes as deep as it likes.
    /// With `only`, keeps the meshes of that node and of those under it.
    fn node(
        &mut self,
        root: &gltf::Node<'_>,
        parent: DMat4,
        only: Option<usize>,
    ) -> Result<(), Issue> {
        let mut todo = vec![(root.clone(), parent, only.is_none())];
        while let Some((node, parent, kept)) = todo.pop() {
            if std::mem::replace(&mut self.visited[node.index()], true) {
                return Err(Issue::error(
                    self.reader.path,
                    1,
                    format!(
                        "node {} is reached twice: the nodes form a loop or share a child",
                        node.index()
                    ),
                    "every node may have one parent only",
                ));
            }
            let kept = kept || only == Some(node.index());
            let local = node
                .transform()
                .matrix()
                .map(|column| column.map(f64::from));
            let matrix = parent * DMat4::from_cols_array_2d(&local);
            if let Some(mesh) = node.mesh().filter(|_| kept) {
                let name = node.name().or(mesh.name()).unwrap_or_default();
                for primitive in mesh.primitives() {
                    self.primitive(name, &primitive, matrix)?;
                }
            }
            todo.extend(node.children().map(|child| (child, matrix, kept)));
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        name: &str,
        primitive: &gltf::Primitive<'_>,
        matrix: DMat4,
    ) -> Result<(), Issue> {
        let mode = primitive.mode();
        if matches!(
            mode,
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip
        ) {
            self.warn(1, "points or lines are ignored");
            return Ok(());
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let positions = positions.expect("primitives without positions were left out");
        self.elements += positions.count();
        self.elements += primitive.indices().map_or(0, |a| a.count() / 3);
        if self.elements > MAX_ELEMENTS {
            return Err(Issue::error(
                self.reader.path,
                self.elements,
                "has too many vertices or triangles",
                "reduce the mesh",
            ));
        }
        let mut transformed = Vec::new();
        for p in self.reader.positions(&positions).map_err(|e| e.of(name))? {
            let world = matrix.transform_point3(p.into());
            transformed.push(world.as_vec3().to_array());
        }
        let corners = match primitive.indices() {
            Some(indices) => self.reader.indices(&indices).map_err(|e| e.of(name))?,
            None => (0..transformed.len() as u32).collect(),
        };
        self.in_range(name, &corners, transformed.len())?;
        let (mut triangles, left_over) = assemble(mode, &corners);
        if left_over > 0 {
            self.warn(left_over, "indices that complete no triangle are ignored");
        }
        // A mirroring transform turns the winding around (glTF 2.0, 3.7.4).
        if matrix.determinant() < 0.0 {
            for t in &mut triangles {
                t.swap(1, 2);
            }
        }
        self.parts.push(Soup {
            name: name.to_owned(),
            positions: transformed,
            triangles,
        });
        Ok(())
    }

    fn in_range(&self, name: &str, corners: &[u32], vertices: usize) -> Result<(), Issue> {
        let outside = corners.iter().filter(|&&i| i as usize >= vertices).count();
        if outside == 0 {
            return Ok(());
        }
        Err(Issue::error(
            self.reader.path,
            outside,
            format!("{outside} indices are out of range: there are {vertices} vertices"),
            "export it again",
        )
        .of(name))
    }
}

/// Triangles of a list, strip or fan, and the indices left over (glTF 2.0, 3.7.2.1).
fn assemble(mode: Mode, corners: &[u32]) -> (Vec<[u32; 3]>, usize) {
    match mode {
        Mode::TriangleStrip => {
            let strip = corners.windows(3).enumerate();
            let turned = strip.map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            });
            (
                turned.collect(),
                if corners.len() < 3 { corners.len() } else { 0 },
            )
        }
        Mode::TriangleFan => {
            let rim = corners.get(1..).unwrap_or_default().windows(2);
            let fan = rim.map(|w| [w[0], w[1], corners[0]]);
            (
                fan.collect(),
                if corners.len() < 3 { corners.len() } else { 0 },
            )
        }
        _ => {
            let (whole, rest) = corners.as_chunks();
            (whole.to_vec(), rest.len())
        }
    }
}

#[cfg(test)]
mod tests;
