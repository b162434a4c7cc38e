//! Masking meshes: what of the scene is heard, and what is shown of the acquired volume.

use glam::DVec3;

use super::{Instance, Scene};
use crate::settings::{Fusion, Surroundings};

impl Scene {
    /// Returns whether frames show the acquired volume.
    pub fn shows_volume(&self) -> bool {
        let shown = |f: &Fusion| f.surroundings == Surroundings::Volume;
        self.volume.is_some() && self.fusion.as_ref().is_some_and(shown)
    }

    /// Returns whether only the inside of masking meshes is heard.
    pub fn is_masked(&self) -> bool {
        let fusion = self.fusion.as_ref();
        fusion.is_some_and(|f| f.surroundings != Surroundings::Scatterers)
    }

    /// Returns whether instance `index` is one of the masking meshes.
    pub fn is_mask(&self, index: usize) -> bool {
        let fusion = self.fusion.as_ref();
        fusion.is_some_and(|f| f.masks.contains(&index))
    }

    /// Masking meshes that no scanline of the present image meets: indices into
    /// [`Scene::instances`].
    pub fn masks_off_the_image(&self) -> Vec<usize> {
        let masks = self.fusion.iter().flat_map(|f| &f.masks).copied();
        let lies_off = |&i: &usize| {
            let instance = &self.instances[i];
            !instance.shown || !self.meets_image(instance)
        };
        masks.filter(lies_off).collect()
    }

    /// Returns whether some scanline in the middle of the slice starts in `instance` or enters it.
    fn meets_image(&self, instance: &Instance) -> bool {
        let mesh = &self.meshes[instance.mesh];
        let probe_from_object = self.world_from_probe.inverse() * instance.world_from_object;
        let at = |i: u32| {
            let p = mesh.positions[i as usize].map(f64::from);
            probe_from_object.transform_point3(p.into())
        };
        // Only triangles across the plane of the scanlines can be met.
        let across: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(at))
            .filter(|t| t.iter().any(|p| p.y >= 0.0) && t.iter().any(|p| p.y <= 0.0))
            .collect();
        (0..self.probe.scanlines).any(|l| {
            let (mut origin, direction) = self.probe.ray(l, 0);
            origin.y = 0.0;
            let hits = across.iter().filter_map(|t| crossing(t, origin, direction));
            let (mut ahead, mut beyond) = (0, 0);
            for t in hits {
                match t < self.probe.depth {
                    true => ahead += 1,
                    false => beyond += 1,
                }
            }
            // A ray that crosses a closed surface an odd number of times started inside.
            ahead > 0 || beyond % 2 == 1
        })
    }
}

/// Distance ahead at which a ray meets a triangle (Moeller and Trumbore 1997).
fn crossing([a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (u, v, w) = (b - a, c - a, origin - a);
    let p = direction.cross(v);
    let determinant = u.dot(p);
    let q = w.cross(u);
    let s = w.dot(p) / determinant;
    let r = direction.dot(q) / determinant;
    let t = v.dot(q) / determinant;
    (s >= 0.0 && r >= 0.0 && s + r <= 1.0 && t > 0.0).then_some(t)
}
