//! Scanlines that start in a gas, where no sound gets.

use std::path::Path;

use glam::DVec3;

use super::enclosing::encloses;
use crate::scene::{Issue, Scene};

/// Impedance below which a medium is a gas, MRayl: a quarter of the lung's, 250 times that of air.
const GAS: f64 = 0.1;
/// Scanlines that are looked at.
const SAMPLED: u32 = 33;
/// Distance ahead of the face at which a scanline's medium is looked up, mm.
const AHEAD: f64 = 0.05;

impl Scene {
    /// The warning about scanlines that start in a background of gas: they are black. With `[contact]` that is what
    /// lines do that do not touch, and nothing is said.
    pub(in crate::scene) fn lines_in_gas(&self, file: &Path) -> Option<Issue> {
        let background = &self.tissues[self.background];
        if background.impedance() >= GAS || self.contact.is_some() {
            return None;
        }
        let mut starts: Vec<DVec3> = (0..SAMPLED)
            .map(|i| {
                let across = (f64::from(i) + 0.5) / f64::from(SAMPLED) - 0.5;
                let (origin, direction) = self.probe.ray_across(across);
                self.world_from_probe.transform_point3(origin + direction * AHEAD)
            })
            .collect();
        for instance in self.instances.iter().filter(|i| i.shown) {
            let [low, high] = self.meshes[instance.mesh].bounds();
            let object_from_world = instance.world_from_object.inverse();
            let near = |point: &DVec3| {
                let local = object_from_world.transform_point3(*point).as_vec3().to_array();
                (0..3).all(|axis| (low[axis]..=high[axis]).contains(&local[axis]))
            };
            starts.retain(|point| !near(point) || !encloses(self, instance, *point));
        }
        let outside = starts.len();
        (outside > 0).then(|| {
            let name = &background.name;
            Issue::warning(
                file,
                outside,
                format!(
                    "{outside} of {SAMPLED} scanlines, evenly taken, start in the background `{name}`: \
                     they are black"
                ),
                "move the probe into the body, or name its skin in [contact]: gel then fills the gap",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::Scene;

    #[test]
    fn lines_beside_the_body_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s.toml");
        let said = |background: &str, radius: f64| {
            let text = format!(
                "background = \"{background}\"\n[probe]\npreset = \"linear\"\n[[mesh]]\nname = \"a\"\n\
                 tissue = \"liver\"\nshape = {{ sphere = {{ radius = {radius} }} }}\n"
            );
            std::fs::write(&path, text).expect("written");
            let (_, warnings) = Scene::load(&path, &[]).expect("sound");
            warnings.into_iter().map(|w| w.count).collect::<Vec<_>>()
        };
        // The face lies in the middle of the sphere: 38.4 mm of it.
        assert!(said("air", 30.0).is_empty());
        assert!(said("water", 10.0).is_empty());
        let counts = said("air", 10.0);
        assert!(counts.len() == 1 && (10..25).contains(&counts[0]), "{counts:?}");
    }
}
