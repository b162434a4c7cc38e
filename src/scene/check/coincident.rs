//! Triangles that two instances of a scene share exactly: a ray meets both at once.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use crate::scene::{Issue, Scene};

/// World positions nearer than this count as equal, mm: single precision at 100 mm resolves 8 nm,
/// and no two anatomical surfaces are drawn this close on purpose.
const SAME: f64 = 1e-4;

impl Scene {
    /// Number of triangles that some other instance covers exactly, whatever the orientation.
    pub fn coincident_triangles(&self) -> usize {
        self.coincident_pairs().values().sum()
    }

    /// One warning for each pair of instances that share triangles.
    pub(crate) fn coincidences(&self, file: &Path) -> Vec<Issue> {
        let mut pairs: Vec<_> = self.coincident_pairs().into_iter().collect();
        pairs.sort_unstable();
        let name = |i: usize| &self.instances[i].name;
        pairs
            .into_iter()
            .map(|([a, b], count)| {
                let tie = self.instances[a].priority == self.instances[b].priority;
                Issue::warning(
                    file,
                    count,
                    format!("coincident interfaces: {count} triangles of `{}` and `{}` are the same", name(a), name(b)),
                    match tie {
                        true => "give the meshes different priorities, so that the order of crossing them does not matter",
                        false => "the mesh of higher priority decides the tissue",
                    },
                )
            })
            .collect()
    }

    fn coincident_pairs(&self) -> HashMap<[usize; 2], usize> {
        let mut seen: HashMap<[[i64; 3]; 3], usize> = HashMap::new();
        let mut pairs = HashMap::new();
        for (i, instance) in self.instances.iter().enumerate() {
            let mesh = &self.meshes[instance.mesh];
            for triangle in &mesh.triangles {
                let mut key = triangle.map(|v| {
                    let local = DVec3::from(mesh.positions[v as usize].map(f64::from));
                    let world = instance.world_from_object.transform_point3(local) / SAME;
                    world.to_array().map(|x| x.round() as i64)
                });
                key.sort_unstable();
                match seen.get(&key) {
                    Some(&other) if other != i => *pairs.entry([other, i]).or_default() += 1,
                    Some(_) => {}
                    None => {
                        seen.insert(key, i);
                    }
                }
            }
        }
        pairs
    }
}
