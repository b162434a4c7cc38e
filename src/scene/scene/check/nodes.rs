//! The nodes of a scene as text, each below its parent.

use crate::scene::animation::{Clock, Loop, Motion, Sequence};
use crate::scene::graph::{Node, NodeKind};
use crate::scene::{Instance, Scene, Strategy};

/// A row for each node, indented by its depth; none for a scene without nodes.
pub fn describe(scene: &Scene) -> Vec<String> {
    let nodes = &scene.graph.nodes;
    let mut children = vec![Vec::new(); nodes.len()];
    let mut open = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        match node.parent {
            Some(parent) => children[parent].push(i),
            None => open.push((i, 1)),
        }
    }
    open.reverse();
    let mut lines = Vec::new();
    while let Some((i, depth)) = open.pop() {
        lines.push(format!("{}{}", "  ".repeat(depth), line(scene, &nodes[i])));
        open.extend(children[i].iter().rev().map(|&child| (child, depth + 1)));
    }
    lines
}

fn line(scene: &Scene, node: &Node) -> String {
    let name = &node.name;
    let turn = node.alternative.map_or(String::new(), |k| format!("{k}: "));
    let what = match &node.kind {
        NodeKind::Group => format!("group `{name}`"),
        NodeKind::Transform { motion, .. } => {
            format!("transform `{name}`{}", moved(motion))
        }
        NodeKind::Selector(sequence) => format!("selector `{name}`: {}", chosen(sequence)),
        NodeKind::Mesh { instance, .. } => {
            let instance = &scene.instances[*instance];
            format!("mesh `{name}`{}", shaped(scene, instance))
        }
    };
    turn + &what
}

fn moved(motion: &Motion) -> String {
    let of = |kind: &str, clock: &Clock| format!(": {kind}, {}", periods(clock));
    match motion {
        Motion::Still => String::new(),
        Motion::Sine { clock, .. } => of("sine", clock),
        Motion::Orbit { clock, .. } => of("orbit", clock),
        Motion::Track { clock, .. } => of("samples", clock),
        Motion::Fetal(fetal) => format!(
            ": fetal, seed {}, bursts of {} s, pauses of {} s",
            fetal.seed, fetal.duration, fetal.pause
        ),
    }
}

/// Period of a clock, behaviour after it, and updates per second, as text.
pub fn periods(clock: &Clock) -> String {
    let mode = match clock.mode {
        Loop::Repeat => "",
        Loop::Once => ", once",
        Loop::PingPong => ", to and fro",
    };
    let rate = clock.rate.map_or(String::new(), |rate| format!(", {rate} Hz"));
    format!("period {} s{mode}{rate}", clock.period)
}

fn chosen(sequence: &Sequence) -> String {
    let count = sequence.count();
    format!("{count} choices, {}", periods(sequence.clock()))
}

fn shaped(scene: &Scene, instance: &Instance) -> String {
    let keyframes = &instance.keyframes;
    if keyframes.meshes.is_empty() {
        return String::new();
    }
    let topology = match scene.shares_topology(instance) {
        true => "of equal triangles",
        false => "of different triangles",
    };
    let follows = match keyframes.strategy {
        Strategy::Exchange => String::new(),
        strategy => format!(", strategy {strategy}"),
    };
    format!(": {} keyframes {topology}{follows}", keyframes.meshes.len())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::scene::Scene;
    use crate::scene::shapes;

    #[test]
    fn nodes_stand_below_their_parents() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s.toml");
        let text = r#"
            [[group]]
            name = "second"
            parent = "beat"
            [[transform]]
            name = "body"
            motion = { kind = "fetal", translate = [1, 0, 0], pause = 3 }
            [[selector]]
            name = "beat"
            parent = "body"
            period = 0.8
            loop = "ping-pong"
            rate = 30
            [[mesh]]
            name = "first"
            parent = "beat"
            tissue = "blood"
            shape = { sphere = { radius = 5, subdivisions = 1 } }
        "#;
        std::fs::write(&path, text).expect("written");
        let (mut scene, _) = Scene::load(&path, &[]).expect("sound");
        assert_eq!(
            super::describe(&scene),
            [
                "  transform `body`: fetal, seed 1, bursts of 4 s, pauses of 3 s",
                "    selector `beat`: 2 choices, period 0.8 s, to and fro, 30 Hz",
                "      0: group `second`",
                "      1: mesh `first`",
            ]
        );
        let mut keyframes = |other| {
            scene.meshes.truncate(1);
            scene.meshes.push(Arc::new(other));
            scene.instances[0].keyframes.meshes = vec![0, 1];
            super::describe(&scene)[3].clone()
        };
        let equal = keyframes(shapes::sphere(6.0, 1));
        assert!(equal.ends_with("`first`: 2 keyframes of equal triangles"), "{equal}");
        let unequal = keyframes(shapes::sphere(6.0, 2));
        assert!(unequal.ends_with("of different triangles"), "{unequal}");
    }
}
