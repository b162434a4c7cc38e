//! The graph of a scene file: its nodes, their effects, and the choices of its selectors.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use super::anatomy::Anatomy;
use super::document::Document;
use super::error::SceneError;
use super::motion::{self, MotionKeys, PERIOD};
use super::nodes::{Entry, NodeKeys, TableKind, depths, in_order, of_kind, parents};
use super::placing::placed;
use super::playing::Following;
use super::shelf::MeshKeys;
use super::table::{Stated, Table};
use crate::scene::animation::{Motion, Sequence};
use crate::scene::graph::{Graph, Node, NodeKind};
use crate::settings::group;

/// Limits of the factors and shifts, mm, of a placement with all parents at rest: beyond them single precision
/// resolves nothing, or the placement has no inverse.
const SCALES: (f64, f64) = (1e-6, 1e6);
const FAR: f64 = 1e6;

group! {
    /// A selector, which shows its choices one after the other.
    pub struct SelectorKeys in "selector" {
        /// Time in which all choices are shown.
        period: Option<f64> = None, PERIOD.by_default("required");
    }
}

/// The tables of a file that are nodes.
#[derive(Clone, Copy)]
pub(super) struct Tables<'f> {
    pub group: &'f [Table<NodeKeys>],
    pub transform: &'f [Table<MotionKeys>],
    pub selector: &'f [Table<SelectorKeys>],
    pub mesh: &'f [Table<MeshKeys>],
}

/// Makes the graph of all nodes; gives the instances with keyframes the number and the strategy of
/// their selectors. Empty where no mesh has a parent and no node is written.
pub(super) fn build(
    document: &Document<'_>,
    file: Tables<'_>,
    anatomy: &mut Anatomy,
) -> Result<Graph, SceneError> {
    let nodes = of_kind(file.group, |_| TableKind::Group)
        .chain(of_kind(file.transform, TableKind::Transform))
        .chain(of_kind(file.selector, TableKind::Selector))
        .chain(of_kind(file.mesh, TableKind::Mesh));
    let entries = in_order(document, nodes)?;
    let parents = parents(document, &entries)?;
    let depths = depths(document, &entries, &parents)?;
    let mut children = vec![Vec::new(); entries.len()];
    for (e, parent) in parents.iter().enumerate() {
        if let Some(parent) = parent {
            children[*parent].push(e);
        }
    }
    let family = Family { document, file, entries: &entries, parents: &parents, children };
    let mut choices = Choices::default();
    for (e, entry) in entries.iter().enumerate() {
        match entry.kind {
            TableKind::Selector(number) => {
                let stated = &file.selector[number].stated;
                family.choose(e, stated, number, anatomy, &mut choices)?;
            }
            TableKind::Mesh(i) if switched(anatomy, i).is_some() => family.under_selector(e)?,
            TableKind::Group | TableKind::Transform(_) | TableKind::Mesh(_) => {}
        }
    }
    group_played(file, anatomy);
    let mut order: Vec<usize> = (0..entries.len()).collect();
    // Stable: children of one depth stay in the order of the file.
    order.sort_by_key(|&e| depths[e]);
    // A mesh without a parent stays where it is, unless its file moves it.
    let stays = |&e: &usize| match entries[e].kind {
        TableKind::Mesh(i) => parents[e].is_none() && anatomy.placed[i].playing.is_none(),
        _ => false,
    };
    order.retain(|e| !stays(e));
    let mut index = vec![None; entries.len()];
    let mut graph = Graph::default();
    let mut rests: Vec<DAffine3> = Vec::new();
    for &e in &order {
        let parent = parents[e].map(|p| index[p].expect("parents come first"));
        let kind = family.kind(e, anatomy, &mut choices)?;
        let above = parent.map_or(DAffine3::IDENTITY, |p: usize| rests[p]);
        let rest = match &kind {
            NodeKind::Transform { rest, .. } | NodeKind::Mesh { rest, .. } => above * *rest,
            NodeKind::Group | NodeKind::Selector(_) => above,
        };
        family.sensible(e, rest)?;
        let node = graph.nodes.len();
        index[e] = Some(node);
        graph.nodes.push(Node {
            name: entries[e].name.to_owned(),
            parent,
            alternative: choices.alternatives.get(&e).copied(),
            kind,
        });
        if let TableKind::Mesh(i) = entries[e].kind {
            let placed = &mut anatomy.placed[i];
            if let Some(playing) = placed.playing.take() {
                playing.grow(&mut graph, node, placed.instances.start);
            }
        }
        // No node of the file is below the nodes just added.
        rests.resize(graph.nodes.len(), rest);
    }
    Ok(graph)
}

/// The instance with keyframes that a selector has to switch; none for a mesh of one shape, and for
/// one whose own animation does it.
fn switched(anatomy: &Anatomy, table: usize) -> Option<usize> {
    let placed = &anatomy.placed[table];
    let instance = placed.instances.start;
    let waits =
        placed.playing.is_none() && !anatomy.instances[instance].keyframes.meshes.is_empty();
    waits.then_some(instance)
}

/// Numbers the selectors that stand for animations of mesh files: one for all meshes of one parent that
/// change at the same times.
fn group_played(file: Tables<'_>, anatomy: &mut Anatomy) {
    let mut groups: Vec<(Option<&str>, &Sequence)> = Vec::new();
    for (stated, placed) in file.mesh.iter().map(|table| &table.stated).zip(&anatomy.placed) {
        let played = placed.playing.iter().flat_map(|p| &p.meshes);
        for (mesh, instance) in played.zip(placed.instances.clone()) {
            let Some(sequence) = &mesh.sequence else {
                continue;
            };
            let key = (stated.text("parent"), sequence);
            let group = groups.iter().position(|g| *g == key).unwrap_or_else(|| {
                groups.push(key);
                groups.len() - 1
            });
            let keyframes = &mut anatomy.instances[instance].keyframes;
            keyframes.group = Some(file.selector.len() + group);
        }
    }
}

/// The choices of selectors.
#[derive(Default)]
struct Choices {
    /// For each selector, by its entry, the order of its choices over time.
    sequences: HashMap<usize, Sequence>,
    /// For each child, by its entry, its number among the choices.
    alternatives: HashMap<usize, usize>,
}

/// The file's nodes with their relations.
struct Family<'a> {
    document: &'a Document<'a>,
    file: Tables<'a>,
    entries: &'a [Entry<'a>],
    parents: &'a [Option<usize>],
    children: Vec<Vec<usize>>,
}

impl Family<'_> {
    /// Fails unless the mesh with keyframes at entry `e` is the child of a selector.
    fn under_selector(&self, e: usize) -> Result<(), SceneError> {
        let kind = self.parents[e].map(|p| self.entries[p].kind);
        if matches!(kind, Some(TableKind::Selector(_))) {
            return Ok(());
        }
        Err(self.document.fail(
            &format!("{}.keyframes", self.entries[e].path),
            format!("nothing switches the keyframes of `{}`", self.entries[e].name),
            "add a [[selector]] with a period, and name it as the mesh's `parent`",
        ))
    }

    /// Numbers the children of the selector at entry `e`, and tells those with keyframes.
    fn choose(
        &self,
        e: usize,
        stated: &Stated,
        number: usize,
        anatomy: &mut Anatomy,
        choices: &mut Choices,
    ) -> Result<(), SceneError> {
        let path = &self.entries[e].path;
        let name = self.entries[e].name;
        let fail = |path: &str, message: String, remedy: &str| {
            Err(self.document.fail(path, message, remedy))
        };
        let Following { strategy, interpolation } = stated.get("");
        let mut alternatives = 0;
        let mut count: Option<(usize, &str)> = None;
        for &child in &self.children[e] {
            let entry = &self.entries[child];
            let own = match entry.kind {
                TableKind::Mesh(i) => switched(anatomy, i),
                _ => None,
            };
            let Some(instance) = own else {
                choices.alternatives.insert(child, alternatives);
                alternatives += 1;
                continue;
            };
            let keyframes = &mut anatomy.instances[instance].keyframes;
            keyframes.group = Some(number);
            keyframes.strategy = strategy;
            let at = format!("{}.keyframes", entry.path);
            let (own, first) = (keyframes.meshes.len(), count.unwrap_or((0, "")));
            if count.is_some() && own != first.0 {
                let message = format!(
                    "`{}` has {own} keyframes, but `{}` under the same selector has {}",
                    entry.name, first.1, first.0
                );
                return fail(&at, message, "all that change together need as many");
            }
            count = Some((own, entry.name));
            let all = || keyframes.meshes.iter().map(|&m| &anatomy.meshes[m]);
            let odd = all().position(|m| !m.shares_topology(&anatomy.meshes[keyframes.meshes[0]]));
            if let Some(k) = odd.filter(|_| strategy.needs_shared_topology()) {
                let message = format!(
                    "`{}` has other triangles in keyframe {k} than in keyframe 0, which strategy \
                     `{strategy}` cannot follow",
                    entry.name
                );
                let remedy =
                    "use `exchange`, or export all keyframes from one mesh, vertex by vertex";
                return fail(&at, message, remedy);
            }
        }
        let count = match (count, alternatives) {
            (None, 0) => {
                let message = format!("selector `{name}` has nothing to choose from");
                let remedy = format!("name it as `parent` of what it shows: parent = \"{name}\"");
                return fail(path, message, &remedy);
            }
            (None, _) if strategy.needs_shared_topology() => {
                return fail(
                    &format!("{path}.strategy"),
                    format!("`{strategy}` moves the vertices of keyframes, and `{name}` has none"),
                    "use `exchange`, or a mesh with `keyframes`",
                );
            }
            (None, count) | (Some((count, _)), 0) => count,
            (Some((count, with)), _) if count != alternatives => {
                let message = format!(
                    "selector `{name}` has {alternatives} alternatives, but `{with}` under it has \
                     {count} keyframes"
                );
                return fail(path, message, "they are chosen together and must be as many");
            }
            (Some((count, _)), _) => count,
        };
        let SelectorKeys { period } = stated.get("");
        let period = period.ok_or_else(|| {
            let message = format!("selector `{name}` has no period");
            let remedy = "add the time in which all its choices are shown: period = \"0.8 s\"";
            self.document.fail(path, message, remedy)
        })?;
        let clock = motion::clock(stated, "", period);
        let sequence = Sequence::even(clock, count, interpolation);
        choices.sequences.insert(e, sequence);
        Ok(())
    }

    /// The node of entry `e`; for a mesh with an animation the one that holds all of it.
    fn kind(
        &self,
        e: usize,
        anatomy: &Anatomy,
        choices: &mut Choices,
    ) -> Result<NodeKind, SceneError> {
        Ok(match self.entries[e].kind {
            TableKind::Group => NodeKind::Group,
            TableKind::Transform(i) => {
                let stated = &self.file.transform[i].stated;
                NodeKind::Transform {
                    rest: placed(self.document, &self.entries[e].path, stated)?,
                    motion: motion::motion(self.document, stated, &self.entries[e].path)?,
                }
            }
            TableKind::Selector(_) => {
                let sequence = choices.sequences.remove(&e);
                NodeKind::Selector(sequence.expect("every selector has chosen"))
            }
            TableKind::Mesh(i) => {
                let placed = &anatomy.placed[i];
                let (rest, instance) = (placed.rest, placed.instances.start);
                match placed.playing {
                    Some(_) => NodeKind::Transform { rest, motion: Motion::Still },
                    None => NodeKind::Mesh { instance, rest },
                }
            }
        })
    }

    /// Fails where a placement with all parents is too large, too small or too far.
    fn sensible(&self, e: usize, rest: DAffine3) -> Result<(), SceneError> {
        let m = &rest.matrix3;
        let sizes = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
        let wrong = |size: &f64| !(SCALES.0..=SCALES.1).contains(size);
        let scale = sizes.into_iter().find(wrong).unwrap_or(1.0);
        let far = rest.translation.abs().max_element();
        let (cause, limits) = match (!wrong(&scale), far <= FAR) {
            (true, true) => return Ok(()),
            (false, _) => (
                format!("is scaled by {scale:.3e}"),
                format!("between {} and {}", SCALES.0, SCALES.1),
            ),
            (true, false) => (format!("is {far:.3e} mm away"), format!("at most {FAR} mm")),
        };
        let entry = &self.entries[e];
        Err(self.document.fail(
            &entry.path,
            format!("with its parents, `{}` {cause}", entry.name),
            format!("it must be {limits}"),
        ))
    }
}
