use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};

use super::*;
use crate::probe::Probe;
use crate::scene::animation::{Clock, Interpolation, Turn};
use crate::scene::{Keyframes, Mesh, Scene, Surface, Tissue};

fn instance(keyframes: &[usize]) -> Instance {
    Instance {
        name: "mesh".into(),
        mesh: 99,
        keyframes: Keyframes { meshes: keyframes.to_vec(), ..Keyframes::default() },
        shown: true,
        tissue: 0,
        priority: 0,
        world_from_object: DAffine3::IDENTITY,
        surface: [Surface { roughness: 0.0, thickness: 0.0, specularity: 1.0, gain: 0.0 }; 2],
    }
}

fn scene(instances: Vec<Instance>, nodes: Vec<Node>) -> Scene {
    Scene {
        meshes: vec![Arc::default(); 8],
        instances,
        graph: Graph { nodes, ..Graph::default() },
        ..Scene::homogeneous(Tissue::shipped("water").expect("shipped"), Probe::abdominal())
    }
}

fn node(parent: Option<usize>, alternative: Option<usize>, kind: NodeKind) -> Node {
    Node { name: String::new(), parent, alternative, kind }
}

fn mesh(instance: usize, rest: DAffine3) -> NodeKind {
    NodeKind::Mesh { instance, rest }
}

fn selector(period: f64, count: usize) -> NodeKind {
    let clock = Clock { period, ..Clock::default() };
    NodeKind::Selector(Sequence::even(clock, count, Interpolation::Linear))
}

#[test]
fn nested_transforms_multiply_from_the_world_down() {
    let shift = DAffine3::from_translation(DVec3::new(10.0, 0.0, 0.0));
    let quarter = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let double = DAffine3::from_scale(DVec3::splat(2.0));
    let orbit = Motion::Orbit {
        clock: Clock { period: 4.0, ..Clock::default() },
        turn: Turn { angle: std::f64::consts::TAU, ..Turn::default() },
    };
    let nodes = vec![
        node(None, None, NodeKind::Transform { rest: shift, motion: orbit }),
        node(Some(0), None, NodeKind::Group),
        node(Some(1), None, NodeKind::Transform { rest: quarter, motion: Motion::Still }),
        node(Some(2), None, mesh(0, double * shift)),
    ];
    let mut scene = scene(vec![instance(&[])], nodes);
    // The point (1, 0, 0): shifted to 11, doubled to 22, turned to y = 22; then the orbit turns by
    // 0, 90, 180 degrees, and the whole is shifted by 10.
    for (t, x, y) in [(0.0, 10.0, 22.0), (1.0, -12.0, 0.0), (2.0, 10.0, -22.0)] {
        scene.set_time(t);
        let at = scene.instances[0].world_from_object;
        let expected = DVec3::new(x, y, 0.0);
        let found = at.transform_point3(DVec3::X);
        assert!((found - expected).length() < 1e-12, "{t}: {found}");
        let by_hand = shift
            * DAffine3::from_quat(DQuat::from_rotation_z(t * std::f64::consts::FRAC_PI_2))
            * quarter
            * double
            * shift;
        assert!(at.abs_diff_eq(by_hand, 1e-12), "{t}: {at} {by_hand}");
    }
}

#[test]
fn a_hidden_alternative_hides_all_below_and_clocks_go_on() {
    let group = || NodeKind::Group;
    let rest = DAffine3::IDENTITY;
    // Selector 0 (2 s) over group 1 and group 2; in group 1 a selector of its own (1 s) over two
    // meshes; in group 2 a mesh in a group.
    let nodes = vec![
        node(None, None, selector(2.0, 2)),
        node(Some(0), Some(0), group()),
        node(Some(0), Some(1), group()),
        node(Some(1), None, selector(1.0, 2)),
        node(Some(3), Some(0), mesh(0, rest)),
        node(Some(3), Some(1), mesh(1, rest)),
        node(Some(2), None, group()),
        node(Some(6), None, mesh(2, rest)),
        node(None, None, mesh(3, rest)),
    ];
    let mut scene = scene(vec![instance(&[]); 4], nodes);
    for (t, expected) in [
        (0.1, [true, false, false, true]),
        (0.6, [false, true, false, true]),
        (1.1, [false, false, true, true]),
        (1.9, [false, false, true, true]),
        (2.6, [false, true, false, true]),
    ] {
        scene.set_time(t);
        let shown: Vec<_> = scene.instances.iter().map(|i| i.shown).collect();
        assert_eq!(shown, expected, "{t}");
    }
    let nodes = scene.graph.nodes_of(scene.instances.len());
    assert_eq!(scene.graph.conditions(nodes[1]), [(3, 1), (0, 0)]);
    assert_eq!(scene.graph.conditions(nodes[3]), []);
}

#[test]
fn keyframes_follow_the_selector_by_their_strategy() {
    let nodes = vec![
        node(None, None, selector(0.8, 4)),
        node(Some(0), None, mesh(0, DAffine3::IDENTITY)),
        node(Some(0), None, mesh(1, DAffine3::IDENTITY)),
        node(Some(0), Some(2), mesh(2, DAffine3::IDENTITY)),
    ];
    let mut all = vec![instance(&[4, 5, 6, 7]), instance(&[0, 1, 2, 3]), instance(&[])];
    all[1].keyframes.strategy = Strategy::Interpolate;
    let mut scene = scene(all, nodes);
    // A quarter of the way from keyframe 2 to keyframe 3.
    scene.set_time(0.45);
    let [step, between, alternative] = scene.instances.as_slice() else {
        panic!("three");
    };
    assert_eq!((step.mesh, step.keyframes.blend[0]), (6, (2, 1.0)));
    let [a, b, ..] = between.keyframes.blend;
    assert_eq!((between.mesh, a.0, b.0), (2, 2, 3));
    assert!((a.1 - 0.75).abs() < 1e-12 && (b.1 - 0.25).abs() < 1e-12);
    assert_eq!((alternative.shown, alternative.mesh), (true, 99));
    // Past the middle the other keyframe is the nearer one.
    scene.set_time(0.55);
    assert_eq!((scene.instances[0].mesh, scene.instances[1].mesh), (6, 3));
    assert_eq!(scene.graph.switch_of(scene.graph.nodes_of(scene.instances.len())[1]), Some(0));
}

#[test]
fn a_scene_without_nodes_stays_as_it_is() {
    let mut scene = scene(vec![instance(&[])], Vec::new());
    let before = format!("{:?}", scene.instances);
    scene.set_time(3.0);
    assert_eq!(format!("{:?}", scene.instances), before);
}

#[test]
fn topology_is_shared_where_triangles_and_vertex_counts_agree() {
    let of = |triangles: &[[u32; 3]], vertices| Mesh {
        positions: vec![[0.0; 3]; vertices],
        triangles: triangles.to_vec(),
        ..Mesh::default()
    };
    let mut scene = scene(vec![instance(&[0, 1])], Vec::new());
    for (other, shared) in
        [(of(&[[0, 1, 2]], 3), true), (of(&[[0, 2, 1]], 3), false), (of(&[[0, 1, 2]], 4), false)]
    {
        scene.meshes = vec![of(&[[0, 1, 2]], 3).into(), other.into()];
        assert_eq!(scene.shares_topology(&scene.instances[0]), shared);
    }
}

#[test]
fn only_instances_scaled_in_time_have_a_placement_at_rest() {
    let clock = Clock { period: 4.0, ..Clock::default() };
    let sine = |scale: DVec3, angle: f64| Motion::Sine {
        clock,
        translation: DVec3::X,
        turn: Turn { angle, ..Turn::default() },
        scale,
    };
    let transform = |rest, motion| NodeKind::Transform { rest, motion };
    let even = DAffine3::from_scale(DVec3::splat(2.0)) * DAffine3::from_rotation_x(0.3);
    let uneven = DAffine3::from_scale(DVec3::new(1.0, 2.0, 1.0));
    let inner = DAffine3::from_translation(DVec3::Y);
    let cases = [
        (even, sine(DVec3::ONE, 0.5), false),
        (even, Motion::Still, false),
        (uneven, Motion::Still, false),
        (uneven, sine(DVec3::ONE, 0.5), true),
        (even, sine(DVec3::new(1.0, 0.8, 1.0), 0.0), true),
        (even, sine(DVec3::splat(1.1), 0.0), true),
    ];
    for (case, (rest, motion, squeezes)) in cases.into_iter().enumerate() {
        let graph = Graph {
            nodes: vec![
                node(None, None, transform(rest, motion)),
                node(Some(0), None, mesh(1, inner)),
            ],
            ..Graph::default()
        };
        let expected = squeezes.then_some(rest * inner);
        assert_eq!(graph.rests(3), [None, expected, None], "{case}");
    }
    // A rotation above an uneven shape keeps its form.
    let graph = Graph {
        nodes: vec![
            node(None, None, transform(even, sine(DVec3::ONE, 0.5))),
            node(Some(0), None, transform(uneven, Motion::Still)),
            node(Some(1), None, mesh(0, inner)),
        ],
        ..Graph::default()
    };
    assert_eq!(graph.rests(1), [None]);
}
