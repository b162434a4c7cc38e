//! `refit`: the boxes of one level of a hierarchy whose triangles have moved.

use super::inputs::Random;
use super::{Case, Check, Extent, Input, Job, Size, Subject};
use crate::reference::refit::{self, Child, Extent as Box3, Geometry};
use insonify::scene::{Mesh, shapes};
use insonify::sim::bvh::{MeshBvh, SceneBvh, levels};
use insonify::sim::push;

/// Words of a node.
const WORDS: usize = 20;

pub const SUBJECT: Subject = Subject {
    name: "refit",
    pass: None,
    tolerance: "none: boxes are exact, planes are the exact ones; where a vertex is not finite \
                only nodes that it is not in count",
    job,
    size: |job, name| {
        let push = push(job);
        let beyond = |name| job.get::<u32>(name).into_iter().max().map_or(0, |n| n as usize + 1);
        match name {
            "nodes" => 4 * WORDS * beyond("order"),
            "vertices" => 12 * beyond("triangles"),
            "boxes" => 24 * beyond("order"),
            "order" => 4 * (push.first + push.count) as usize,
            _ => 0,
        }
    },
    extent: Some(|job| Extent::threads(8 * push(job).count, 1)),
    check,
    plant: |job, outputs| {
        // The upper plane along y of some child of the level's first node, one quantum too low.
        let push = push(job);
        let node = job.get::<u32>("order")[push.first as usize] as usize;
        job.edit(outputs, "nodes", |nodes: &mut [u32]| {
            nodes[WORDS * node + 14] = nodes[WORDS * node + 14].wrapping_sub(1);
        });
    },
};

fn push(job: &Job) -> push::Refit {
    bytemuck::pod_read_unaligned(&job.push)
}

/// The meshes of a case; if there are three, the first one does not move.
fn meshes(case: Case, size: Size) -> Vec<Mesh> {
    let fine = match size {
        Size::Small => 3,
        Size::Standard => 6,
    };
    match case {
        Case::Empty => vec![Mesh::default()],
        Case::One => {
            let mut one = shapes::cuboid([4.0, 5.0, 6.0]);
            one.triangles.truncate(1);
            vec![one]
        }
        Case::Modes => vec![shapes::plane([40.0, 30.0], 0.0), shapes::cuboid([9.0; 3])],
        _ => vec![
            shapes::cylinder(2.0, 5.0, 5),
            shapes::sphere(20.0, fine),
            shapes::ellipsoid([9.0, 13.0, 31.0], fine - 1),
        ],
    }
}

fn job(case: Case, size: Size) -> Job {
    let meshes = meshes(case, size);
    let trees: Vec<MeshBvh> = meshes.iter().map(MeshBvh::build).collect();
    let (mut vertices, mut triangles, mut firsts) = (Vec::new(), Vec::new(), Vec::new());
    for (mesh, tree) in meshes.iter().zip(&trees) {
        let base = vertices.len() as u32;
        firsts.push(triangles.len() as u32);
        vertices.extend_from_slice(&mesh.positions);
        let order = tree.triangle_order.iter();
        triangles.extend(order.map(|&t| mesh.triangles[t as usize].map(|v| base + v)));
    }
    let (scene, roots) = SceneBvh::of(&trees, &firsts, trees.len());
    let moving: Vec<_> = trees.iter().zip(roots).collect();
    let levels = levels(&moving[usize::from(moving.len() > 2)..]);
    let mut random = Random(41);
    if case != Case::Modes {
        for p in &mut vertices {
            *p = p.map(|c| (f64::from(c) * 1.3 + random.within(-2.0, 2.0)) as f32);
        }
    }
    if case == Case::NotFinite {
        let last = vertices.len() - 1;
        vertices[last][0] = f32::NAN;
        vertices[last - 40][1] = f32::INFINITY;
        vertices[last - 80][2] = f32::NEG_INFINITY;
    }
    // The largest level of all, the last, or the one above the deepest.
    let ranges = &levels.ranges;
    let done = match case {
        Case::Random => ranges.len() - 2,
        Case::Odd | Case::One => ranges.len() - 1,
        _ => {
            let largest = (0..ranges.len()).max_by_key(|&i| ranges[i].count);
            largest.unwrap_or(0)
        }
    };
    let geometry = Geometry { vertices: &vertices, triangles: &triangles };
    let mut nodes = scene.nodes.clone();
    let mut boxes: Vec<Box3> = vec![[[0.0; 3]; 2]; nodes.len()];
    for &range in &ranges[..done] {
        let words = nodes.as_flattened_mut();
        let level = &levels.order[range.first as usize..][..range.count as usize];
        refit::refit(level, words, geometry, &mut boxes);
    }
    let level = ranges.get(done).copied().unwrap_or_default();
    Job {
        inputs: vec![
            Input::words("nodes", &nodes),
            Input::floats("vertices", vertices.as_flattened()),
            Input::words("triangles", &triangles),
            Input::floats("boxes", boxes.as_flattened().as_flattened()),
            Input::words("order", &levels.order),
        ],
        push: bytemuck::bytes_of(&level).to_vec(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let push = push(job);
    let (vertices, triangles): (Vec<[f32; 3]>, Vec<[u32; 3]>) =
        (job.get("vertices"), job.get("triangles"));
    let geometry = Geometry { vertices: &vertices, triangles: &triangles };
    let (mut nodes, mut boxes): (Vec<u32>, Vec<Box3>) = (job.get("nodes"), job.get("boxes"));
    let order: Vec<u32> = job.get("order");
    let level = &order[push.first as usize..][..push.count as usize];
    refit::refit(level, &mut nodes, geometry, &mut boxes);
    let mut found: Vec<u32> = job.after(outputs, "nodes");
    let mut found_boxes: Vec<Box3> = job.after(outputs, "boxes");
    for &number in &order[push.first as usize..][..push.count as usize] {
        let number = number as usize;
        let words = WORDS * number..WORDS * (number + 1);
        if !finite(&nodes[words.clone()], geometry, &boxes) {
            found[words.clone()].copy_from_slice(&nodes[words]);
            found_boxes[number] = boxes[number];
        }
    }
    let flat = |boxes: &[Box3]| -> Vec<u32> {
        let floats = boxes.as_flattened().as_flattened().iter();
        // Zeros of either sign are the same place.
        floats.map(|f| (f + 0.0).to_bits()).collect()
    };
    let signless = |words: &[u32]| -> Vec<u32> {
        let zero = (-0f32).to_bits();
        let corner = |i: usize, w: u32| if i % WORDS < 3 && w == zero { 0 } else { w };
        let words = words.iter().enumerate();
        words.map(|(i, &w)| corner(i, w)).collect()
    };
    vec![
        Check::equal("nodes", &signless(&found), &signless(&nodes)),
        Check::equal("boxes", &flat(&found_boxes), &flat(&boxes)),
    ]
}

/// True if everything that a node encloses is finite.
fn finite(node: &[u32], geometry: Geometry<'_>, boxes: &[Box3]) -> bool {
    (0..8).all(|c| match refit::child(node, c) {
        Child::Empty => true,
        Child::Inner(inner) => (boxes[inner as usize].iter().flatten()).all(|c| c.is_finite()),
        Child::Triangles(first, count) => (first..first + count)
            .flat_map(|t| geometry.triangles[t as usize])
            .all(|v| geometry.vertices[v as usize].iter().all(|c| c.is_finite())),
    })
}
