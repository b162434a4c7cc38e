//! Triangles that two instances of a scene share exactly: a ray meets both at once.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use crate::scene::{Issue, Mesh, Scene};

/// World positions nearer than this count as equal, mm: single precision at 100 mm resolves 8 nm,
/// and no two anatomical surfaces are drawn this close on purpose.
const SAME: f64 = 1e-4;

/// A shape of an instance, and the conditions for it.
struct Pose<'s> {
    instance: usize,
    mesh: &'s Mesh,
    /// Selectors, by node, and the choice of each.
    conditions: Vec<(usize, usize)>,
}

impl Pose<'_> {
    /// Returns whether both can be shown at one time.
    fn meets(&self, other: &Self) -> bool {
        let apart = |a: &(usize, usize)| {
            let b = other.conditions.iter().find(|b| b.0 == a.0);
            b.is_some_and(|b| b.1 != a.1)
        };
        self.instance != other.instance && !self.conditions.iter().any(apart)
    }
}

impl Scene {
    /// Number of triangles that some other instance covers exactly, whatever the orientation: over
    /// all keyframes, also those of meshes that are hidden now, at the present placement. (Meshes
    /// that move against each other may still meet for a moment, triangle on triangle.)
    pub fn coincident_triangles(&self) -> usize {
        self.coincident_pairs().values().sum()
    }

    /// One warning for each pair of instances of equal priority that share triangles: which tissue is there then hangs on
    /// the order of crossing them. Of different priorities the higher decides, as for two organs that touch.
    pub(crate) fn coincidences(&self, file: &Path) -> Vec<Issue> {
        let mut pairs: Vec<_> = self.coincident_pairs().into_iter().collect();
        pairs.sort_unstable();
        let name = |i: usize| &self.instances[i].name;
        let tie = |pair: &[usize; 2]| {
            let [a, b] = pair.map(|i| self.instances[i].priority);
            a == b
        };
        pairs
            .into_iter()
            .filter(|(pair, _)| tie(pair))
            .map(|([a, b], count)| {
                Issue::warning(
                    file,
                    count,
                    format!("coincident interfaces: {count} triangles of `{}` and `{}` are the same", name(a), name(b)),
                    "give the meshes different priorities, so that the order of crossing them does not matter",
                )
            })
            .collect()
    }

    /// All shapes of all instances.
    fn poses(&self) -> Vec<Pose<'_>> {
        let mut out = Vec::new();
        let nodes = self.graph.nodes_of(self.instances.len());
        for (i, instance) in self.instances.iter().enumerate() {
            let conditions = self.graph.conditions(nodes[i]);
            let switch = self.graph.switch_of(nodes[i]);
            let shapes = match instance.keyframes.meshes.as_slice() {
                [] => std::slice::from_ref(&instance.mesh),
                all => all,
            };
            for (k, &mesh) in shapes.iter().enumerate() {
                let mut conditions = conditions.clone();
                if !instance.keyframes.meshes.is_empty() {
                    conditions.extend(switch.map(|node| (node, k)));
                }
                out.push(Pose { instance: i, mesh: &self.meshes[mesh], conditions });
            }
        }
        out
    }

    fn coincident_pairs(&self) -> HashMap<[usize; 2], usize> {
        let poses = self.poses();
        // By the triangle's corners, the last pose that has it, as an index into `seen`; each entry there leads
        // to the pose before.
        let mut last: HashMap<[[i64; 3]; 3], usize> = HashMap::new();
        let mut seen: Vec<(usize, Option<usize>)> = Vec::new();
        let mut pairs = HashMap::new();
        for (p, pose) in poses.iter().enumerate() {
            let placement = self.instances[pose.instance].world_from_object;
            for triangle in &pose.mesh.triangles {
                let mut key = triangle.map(|v| {
                    let local = DVec3::from(pose.mesh.positions[v as usize].map(f64::from));
                    let world = placement.transform_point3(local) / SAME;
                    world.to_array().map(|x| x.round() as i64)
                });
                key.sort_unstable();
                let before = last.insert(key, seen.len());
                seen.push((p, before));
                let mut at = before;
                while let Some((other, next)) = at.map(|i| seen[i]) {
                    // Counted once, against the first of the instances that share it.
                    if pose.meets(&poses[other]) {
                        let pair = [poses[other].instance, pose.instance];
                        *pairs.entry(pair).or_default() += 1;
                        break;
                    }
                    at = next;
                }
            }
        }
        pairs
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::Scene;

    /// A scene beside three cubes as files.
    fn load(text: &str) -> (Scene, Vec<String>) {
        let folder = tempfile::tempdir().expect("temporary folder");
        for (name, edge) in [("a", 10), ("b", 20), ("c", 30)] {
            let cube = "v 0 0 0\nv E 0 0\nv E E 0\nv 0 E 0\nv 0 0 E\nv E 0 E\nv E E E\nv 0 E E\n\
                f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
            let text = cube.replace('E', &edge.to_string());
            let file = folder.path().join(format!("{name}.obj"));
            std::fs::write(file, text).expect("written");
        }
        let path = folder.path().join("s.toml");
        std::fs::write(&path, text).expect("written");
        let (scene, warnings) = Scene::load(&path, &[]).expect("sound");
        let texts = warnings.iter().map(|w| w.message.clone()).collect();
        (scene, texts)
    }

    fn mesh(name: &str, more: &str) -> String {
        format!("[[mesh]]\nname = \"{name}\"\ntissue = \"liver\"\n{more}\n")
    }

    const BEAT: &str = "[[selector]]\nname = \"beat\"\nperiod = 1\n";

    #[test]
    fn every_keyframe_counts_whatever_the_time() {
        // At rest the two differ; in the last keyframe they agree.
        let text = BEAT.to_owned()
            + &mesh("x", "parent = \"beat\"\nkeyframes = [\"a.obj\", \"b.obj\", \"c.obj\"]")
            + &mesh("y", "file = \"c.obj\"");
        let (scene, texts) = load(&text);
        assert_eq!(scene.coincident_triangles(), 12);
        assert!(texts[0].contains("12 triangles of `x` and `y`"), "{texts:?}");
    }

    #[test]
    fn keyframes_that_are_never_shown_together_do_not_meet() {
        let pair = |second: &str| {
            BEAT.to_owned()
                + &mesh("x", "parent = \"beat\"\nkeyframes = [\"a.obj\", \"b.obj\"]")
                + &mesh("y", &format!("parent = \"beat\"\nkeyframes = {second}"))
        };
        assert_eq!(load(&pair("[\"b.obj\", \"a.obj\"]")).0.coincident_triangles(), 0);
        assert_eq!(load(&pair("[\"c.obj\", \"b.obj\"]")).0.coincident_triangles(), 12);
    }

    #[test]
    fn hidden_alternatives_count_against_all_but_each_other() {
        let alternatives = BEAT.to_owned()
            + &mesh("x", "parent = \"beat\"\nfile = \"a.obj\"")
            + &mesh("y", "parent = \"beat\"\nfile = \"a.obj\"");
        assert_eq!(load(&alternatives).0.coincident_triangles(), 0);
        let hidden = alternatives.replace("file = \"a.obj\"", "file = \"b.obj\"");
        let beside = hidden + &mesh("z", "file = \"b.obj\"");
        let (scene, _) = load(&beside);
        assert!(!scene.instances[1].shown);
        // Different priorities decide.
        let decided = beside.clone() + "priority = 1\n";
        let (scene, silent) = load(&decided);
        assert_eq!((scene.coincident_triangles(), silent.len()), (12, 0));
        let (scene, texts) = load(&beside);
        // Each triangle of z has a twin in x and one in y; it counts once.
        assert_eq!(scene.coincident_triangles(), 12);
        assert_eq!(texts.len(), 1, "{texts:?}");
    }
}
