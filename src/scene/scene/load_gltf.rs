//! glTF 2.0, text and binary: triangles of the scene's nodes in rest pose. Metres.

use std::path::Path;

use glam::DMat4;

use super::mesh::{self, Choice, Parts, Soup, Units};
use crate::issue::Issue;

mod accessor;
mod animated;
mod bounds;
mod budget;
mod buffers;
mod choice;
mod glb;
mod morph;
mod sampler;
mod schema;
mod skin;
mod surface;
mod tree;
mod typed;
mod validate;

pub(super) use animated::{AnimatedParts, Part, read_animated};
use choice::Chosen;
use surface::{Surface, Surfaces};
use typed::Typed;

/// The unit of lengths.
pub(super) const METRES: Units = Units(1000.0);

/// Most commas of the JSON part: each value of the parsed tree takes some 50 bytes of memory.
const MAX_VALUES: usize = 4_000_000;

/// A file with sound JSON and loaded buffers.
struct File<'p> {
    path: &'p Path,
    gltf: gltf::Document,
    buffers: Vec<Option<Vec<u8>>>,
    /// The animation that was asked for.
    animation: Option<Chosen>,
    /// Primitives that have no stored positions or indices and are left out.
    without_data: usize,
    /// Findings so far, none of them an error.
    issues: Vec<Issue>,
}

/// Opens a file for its rest pose, or for an animation.
fn open<'p>(
    path: &'p Path,
    bytes: &[u8],
    animation: Option<Choice<'_>>,
) -> Result<File<'p>, Vec<Issue>> {
    let one = |issue: Issue| vec![issue];
    let glb::Container { json, binary, mut issues } = glb::open(path, bytes).map_err(one)?;
    let root = parse(path, json).map_err(one)?;
    let findings = validate::validate(&root, animation.is_some());
    issues.extend(validate::issues(path, findings));
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    let chosen = animation.map(|choice| Chosen::of(path, &root, choice));
    let chosen = chosen.transpose().map_err(one)?;
    let typed = Typed::of(root, chosen.as_ref().map(|c| c.number))
        .map_err(|message| one(Issue::error(path, 1, message, validate::EXPORT_AGAIN)))?;
    let (needed, without_data) = (typed.buffers(), typed.without_data);
    let gltf = gltf::Document::from_json_without_validation(typed.root);
    let buffers::Buffers { bytes: buffers, issues: unread } =
        buffers::load(path, &gltf, binary, &needed);
    issues.extend(unread);
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    issues.extend(validate::issues(path, bounds::check(&gltf, &buffers)));
    Ok(File { path, gltf, buffers, animation: chosen, without_data, issues })
}

impl File<'_> {
    fn roots(&self) -> Vec<gltf::Node<'_>> {
        let scene = self.gltf.default_scene();
        match scene.or_else(|| self.gltf.scenes().next()) {
            Some(scene) => scene.nodes().collect(),
            None => roots(&self.gltf),
        }
    }

    /// The node called `name`.
    fn node(&self, name: &str) -> Result<gltf::Node<'_>, Issue> {
        let found = self.gltf.nodes().find(|n| n.name() == Some(name));
        found.ok_or_else(|| {
            let names = self.gltf.nodes().filter_map(|n| n.name().map(str::to_owned));
            mesh::no_such_node(self.path, name, &names.collect::<Vec<_>>())
        })
    }

    /// Findings about the file that the tree of nodes does not give.
    fn remarks(&self, visited: &[bool]) -> Vec<Issue> {
        let unseen =
            self.gltf.nodes().filter(|n| n.mesh().is_some() && !visited[n.index()]).count();
        let remark = |count: usize, message: &str, remedy: &str| {
            let message = format!("{message} ({count})");
            (count > 0).then(|| Issue::warning(self.path, count, message, remedy))
        };
        let mut loose = vec![true; self.gltf.meshes().len()];
        self.gltf.nodes().filter_map(|n| n.mesh()).for_each(|mesh| loose[mesh.index()] = false);
        let loose = loose.into_iter().filter(|loose| *loose).count();
        let both = [
            remark(loose, "meshes that no node places are ignored", "add nodes that name them"),
            remark(self.without_data, "primitives without stored positions are ignored", ""),
            remark(unseen, "nodes with meshes outside the default scene are ignored", ""),
        ];
        both.into_iter().flatten().collect()
    }
}

pub(super) fn read(path: &Path, bytes: &[u8], node: Option<&str>) -> Result<Parts, Vec<Issue>> {
    let one = |issue: Issue| vec![issue];
    let mut file = open(path, bytes, None)?;
    let issues = std::mem::take(&mut file.issues);
    let mut walk = Walk {
        surfaces: Surfaces::new(&file),
        parts: Vec::new(),
        visited: vec![false; file.gltf.nodes().len()],
    };
    walk.surfaces.issues = issues;
    let chosen = node.map(|name| file.node(name)).transpose().map_err(one)?;
    for root in file.roots() {
        walk.node(&root, DMat4::IDENTITY, chosen.as_ref().map(gltf::Node::index)).map_err(one)?;
    }
    if let Some(node) = &chosen
        && !walk.visited[node.index()]
    {
        walk.node(node, DMat4::IDENTITY, None).map_err(one)?;
        walk.surfaces.warn(
            1,
            "the node is outside the file's scene: its parents' transforms are not applied",
        );
    }
    let mut issues = walk.surfaces.issues;
    issues.extend(file.remarks(&walk.visited));
    Ok(Parts { parts: walk.parts, issues, units: Some(METRES), ..Parts::default() })
}

/// Names of a file's animations; none where it cannot be read.
pub(super) fn animations(path: &Path, bytes: &[u8]) -> Vec<String> {
    let container = glb::open(path, bytes).ok();
    let root = container.and_then(|c| parse(path, c.json).ok());
    root.map_or(Vec::new(), |root| choice::names(&root))
}

fn parse(path: &Path, json: &[u8]) -> Result<serde_json::Map<String, serde_json::Value>, Issue> {
    let fail = |message: String, remedy: &str| Issue::error(path, 1, message, remedy);
    if json.iter().filter(|&&b| b == b',').count() > MAX_VALUES {
        return Err(fail("its JSON part is too large".to_owned(), "store numbers in buffers"));
    }
    let again = "export or copy it again";
    match serde_json::from_slice(json) {
        Ok(serde_json::Value::Object(root)) => Ok(root),
        Ok(_) => Err(fail("its JSON is not an object".to_owned(), again)),
        Err(e) => Err(fail(format!("is not valid JSON: {e}"), again)),
    }
}

/// Nodes without a parent, for files without scenes.
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
    surfaces: Surfaces<'a>,
    parts: Vec<Soup>,
    visited: Vec<bool>,
}

impl Walk<'_> {
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
                    self.surfaces.reader.path,
                    1,
                    format!(
                        "node {} is reached twice: the nodes form a loop or share a child",
                        node.index()
                    ),
                    "every node may have one parent only",
                ));
            }
            let kept = kept || only == Some(node.index());
            let local = node.transform().matrix().map(|column| column.map(f64::from));
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
        let Some(Surface { positions, mut triangles }) =
            self.surfaces.primitive(name, primitive)?
        else {
            return Ok(());
        };
        // A mirroring transform turns the winding around (glTF 2.0, 3.7.4).
        if matrix.determinant() < 0.0 {
            for t in &mut triangles {
                t.swap(1, 2);
            }
        }
        let placed =
            positions.into_iter().map(|p| matrix.transform_point3(p.into()).as_vec3().to_array());
        self.parts.push(Soup { name: name.to_owned(), positions: placed.collect(), triangles });
        Ok(())
    }
}

#[cfg(test)]
mod tests;
