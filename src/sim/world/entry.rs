//! Entries of the top level, and the entry to which an instance's row points.

use glam::DAffine3;

use super::arrays::{Bounds, GeometryRange, is_dynamic};
use super::joined::SharingSets;
use crate::fields::Fields;
use crate::layout::{self, NONE};
use crate::placement::{matrix_rows, rigid, stretch};
use crate::scene::{Instance, Scene, Strategy};

/// Mask bit of every entry that is not selected by its mask.
const UNSELECTED_BIT: u8 = 1;
/// Mask bits left for keyframes that are selected by their mask.
const SELECTING_BITS: usize = 7;

/// The geometry of an entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum EntryGeometry {
    /// A mesh of the scene.
    Mesh(usize),
    /// The latest shape that the device computed for an instance that changes its shape.
    Changing {
        /// Number of times that it was computed.
        version: u64,
    },
    /// The keyframe that the instance's row names.
    Union,
    /// The structure that the instance shares with others; the instance is the first of them.
    Joined {
        /// Number of the set.
        set: usize,
        /// Number of its structure.
        shape: usize,
        /// True if some of the instances that share it are not shown.
        partial: bool,
    },
}

/// A placed geometry in the top level. If all entries are equal to the last ones, the top level is still valid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TopLevelEntry {
    pub(super) instance: u32,
    pub(super) geometry: EntryGeometry,
    pub(super) bounds: Bounds,
    pub(super) world_from_object: DAffine3,
    pub(super) mask: u8,
}

fn by_mask(number: usize) -> u8 {
    1 << (1 + number % SELECTING_BITS)
}

pub(super) fn union(a: Bounds, b: Bounds) -> Bounds {
    let corner = |side: usize, pick: fn(f32, f32) -> f32| {
        std::array::from_fn(|axis| pick(a[side][axis], b[side][axis]))
    };
    [corner(0, f32::min), corner(1, f32::max)]
}

/// Most entries that the scene can have at any time.
pub(super) fn capacity(scene: &Scene) -> usize {
    let most = |i: &Instance| match i.keyframes.strategy {
        Strategy::Mask => i.keyframes.meshes.len().max(1),
        _ => 1,
    };
    scene.instances.iter().map(most).sum()
}

/// Entries of the scene as it is now: everything shown that has triangles, and everything that rays only pass.
/// `regions` are those of the instances that change their shape, and `sets` of those that share one.
pub(super) fn entries(
    scene: &Scene,
    places: &[GeometryRange],
    regions: &[Option<GeometryRange>],
    sets: &SharingSets,
) -> Vec<TopLevelEntry> {
    let mut entries = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let keyframes = &instance.keyframes;
        let entry = |geometry, bounds, mask| TopLevelEntry {
            instance: i as u32,
            geometry,
            bounds,
            world_from_object: instance.world_from_object,
            mask,
        };
        if let Some((number, set)) = sets.of(i) {
            let hidden = set.members.iter().filter(|&&m| !scene.instances[m].shown);
            let hidden = hidden.count();
            if set.members[0] == i && hidden < set.members.len() {
                let shape = set.shape(scene);
                let geometry = EntryGeometry::Joined { set: number, shape, partial: hidden > 0 };
                entries.push(entry(geometry, set.shapes[shape].bounds, UNSELECTED_BIT));
            }
            continue;
        }
        let mesh = |mesh: usize, mask| {
            let place = &places[mesh];
            (place.triangles > 0).then(|| entry(EntryGeometry::Mesh(mesh), place.bounds, mask))
        };
        match (keyframes.strategy, &regions[i]) {
            (_, Some(region)) if instance.shown && region.triangles > 0 => {
                let version = region.version;
                entries.push(entry(
                    EntryGeometry::Changing { version },
                    region.bounds,
                    UNSELECTED_BIT,
                ));
            }
            (_, Some(_)) => {}
            (Strategy::Mask, None) if keyframes.meshes.is_empty() => {
                entries.extend(mesh(instance.mesh, by_mask(i)));
            }
            (Strategy::Mask, None) => {
                let all = keyframes.meshes.iter().enumerate();
                let first = all.filter(|(k, m)| !keyframes.meshes[..*k].contains(m));
                entries.extend(first.filter_map(|(k, &m)| mesh(m, by_mask(k))));
            }
            (Strategy::Selector, None) => {
                let one = [instance.mesh];
                let all = match keyframes.meshes.is_empty() {
                    true => &one[..],
                    false => &keyframes.meshes,
                };
                let solid = all.iter().map(|&m| &places[m]).filter(|p| p.triangles > 0);
                let bounds = solid.map(|p| p.bounds).reduce(union);
                entries.extend(bounds.map(|b| entry(EntryGeometry::Union, b, UNSELECTED_BIT)));
            }
            _ if instance.shown => entries.extend(mesh(instance.mesh, UNSELECTED_BIT)),
            _ => {}
        }
    }
    entries
}

/// The row that stands for what is between face and body, in front of everything in the background.
fn couplant(tissue: usize) -> layout::Instance {
    let identity = matrix_rows(&DAffine3::IDENTITY);
    layout::Instance {
        world_from_object: identity,
        object_from_world: identity,
        texture_from_world: identity,
        tissue: tissue as u32,
        priority: -i32::MAX,
        slot: NONE,
        field: NONE,
        ..layout::Instance::default()
    }
}

/// Rows of the scene's instances, and of the couplant where the scene has contact. `slots` has the place of each entry in the top level.
pub(super) fn rows(
    scene: &Scene,
    places: &[GeometryRange],
    regions: &[Option<GeometryRange>],
    sets: &SharingSets,
    fields: &Fields,
    entries: &[TopLevelEntry],
    slots: &[u32],
) -> Vec<layout::Instance> {
    let mut rows: Vec<_> = (scene.instances.iter().zip(regions).enumerate())
        .map(|(i, (placed, region))| {
            let own = region.as_ref().unwrap_or(&places[placed.mesh]);
            let shared = sets.of(i).map(|(_, set)| &set.shapes[set.shape(scene)]);
            let place = shared.unwrap_or(own);
            let corner = |c: [f32; 3]| [c[0], c[1], c[2], 0.0];
            layout::Instance {
                world_from_object: matrix_rows(&placed.world_from_object),
                object_from_world: matrix_rows(&placed.world_from_object.inverse()),
                texture_from_world: matrix_rows(&rigid(&placed.world_from_object).inverse()),
                tissue: placed.tissue as u32,
                priority: placed.priority,
                surface_outside: 2 * i as u32,
                surface_inside: 2 * i as u32 + 1,
                first_triangle: place.first_triangle,
                triangles: place.triangles,
                bvh_root: place.root,
                slot: NONE,
                low: corner(own.bounds[0]),
                high: corner(own.bounds[1]),
                field: fields.offset(scene, i),
                flow: fields.flow(scene, i),
                masks: u32::from(scene.is_mask(i)),
                owners: place.owners,
                finest: (places[placed.mesh].finest * stretch(&placed.world_from_object)) as f32,
                ..layout::Instance::default()
            }
        })
        .collect();
    for (entry, &slot) in entries.iter().zip(slots) {
        if let EntryGeometry::Joined { set, .. } = entry.geometry {
            for &i in &sets.all[set].members {
                rows[i].slot = if scene.instances[i].shown { slot } else { NONE };
            }
            continue;
        }
        let instance = &scene.instances[entry.instance as usize];
        if instance.shown && shows(instance, entry) {
            rows[entry.instance as usize].slot = slot;
        }
    }
    rows.extend(scene.contact.as_ref().map(|contact| couplant(contact.couplant)));
    rows
}

/// True if `entry` is the one of its instance that is visible.
fn shows(instance: &Instance, entry: &TopLevelEntry) -> bool {
    !matches!(entry.geometry, EntryGeometry::Mesh(mesh) if mesh != instance.mesh)
}

/// The selection of entries for rays of a ray query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RayMask {
    /// Bits of the entries that are shown.
    pub(super) bits: u32,
    /// True if some entries that are not shown have the same bits.
    pub(super) ambiguous: bool,
}

/// The mask with which rays meet every entry that is shown.
pub(super) fn mask(scene: &Scene, entries: &[TopLevelEntry]) -> RayMask {
    let seen = |entry: &&TopLevelEntry| {
        if let EntryGeometry::Joined { partial, .. } = entry.geometry {
            return !partial;
        }
        let instance = &scene.instances[entry.instance as usize];
        instance.shown && shows(instance, entry)
    };
    // Shared structures have the bit UNSELECTED_BIT: rays enter them whichever instance is shown.
    let bits = entries.iter().filter(seen).fold(UNSELECTED_BIT, |bits, e| bits | e.mask);
    let hidden = entries.iter().filter(|e| !seen(e));
    RayMask { bits: bits.into(), ambiguous: hidden.into_iter().any(|e| e.mask & bits != 0) }
}

/// True if the top level can be changed from `old` to `new` by a refit, as the strategies of the changed
/// instances ask.
pub(super) fn may_refit(scene: &Scene, old: &[TopLevelEntry], new: &[TopLevelEntry]) -> bool {
    let wants = |entry: &TopLevelEntry| {
        let instance = &scene.instances[entry.instance as usize];
        instance.keyframes.strategy == Strategy::Update && !is_dynamic(instance)
    };
    old.len() == new.len()
        && (old.iter().zip(new)).all(|(a, b)| a == b || (a.instance == b.instance && wants(b)))
}
