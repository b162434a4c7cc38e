//! Shapes that a program gives to instances, and the scene's present shapes alone.

use std::sync::Arc;

use super::Scene;
use super::keyframes::{Keyframes, Strategy};
use super::mesh::Mesh;

impl Scene {
    /// Gives an instance another shape of its present topology. The first time it gets two keyframes, its shape at rest
    /// and this one: tissue then moves with the surface. Back in its shape at rest it shows the first of them, and is as
    /// if it had never left it. The world takes the shape at its next update.
    ///
    /// # Panics
    /// Another topology; an instance with keyframes of its own.
    pub fn reshape(&mut self, instance: usize, shape: Arc<Mesh>) {
        let keyframes = &self.instances[instance].keyframes;
        let [rest, live] = match keyframes.meshes[..] {
            [] => [self.instances[instance].mesh, self.meshes.len()],
            [rest, live] if keyframes.revision > 0 => [rest, live],
            _ => panic!("`{}` has keyframes of its own", self.instances[instance].name),
        };
        assert!(shape.shares_topology(&self.meshes[rest]), "`{}` has other triangles", shape.name);
        // A field that moves tissue is made for what differs from the shape at rest.
        let rests = shape.positions == self.meshes[rest].positions;
        match live == self.meshes.len() {
            true if rests => return,
            true => self.meshes.push(shape),
            false if rests => {}
            false => self.meshes[live] = shape,
        }
        let instance = &mut self.instances[instance];
        let shown = usize::from(!rests);
        instance.mesh = [rest, live][shown];
        instance.keyframes = Keyframes {
            meshes: vec![rest, live],
            strategy: Strategy::Refit,
            blend: [(shown, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
            group: None,
            revision: instance.keyframes.revision + 1,
        };
    }

    /// The present scene without keyframes, which every strategy has to match. Instances keep their numbers;
    /// hidden ones have no triangles.
    pub fn still(&self) -> Self {
        let mut still = self.clone();
        for instance in &mut still.instances {
            let keyframes = std::mem::take(&mut instance.keyframes);
            let between = keyframes.blend.iter().filter(|(_, weight)| *weight != 0.0);
            if keyframes.strategy == Strategy::Interpolate && between.count() > 1 {
                instance.mesh = still.meshes.len();
                still.meshes.push(keyframes.blended(&self.meshes).into());
            }
            if !std::mem::replace(&mut instance.shown, true) {
                instance.mesh = still.meshes.len();
                still.meshes.push(Arc::default());
            }
        }
        still
    }
}
