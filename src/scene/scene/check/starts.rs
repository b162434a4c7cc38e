//! Scanlines that start where no sound gets: in a gas, or in bone.

use std::path::Path;

use glam::DVec3;

use super::enclosing::encloses;
use crate::scene::{Instance, Issue, Scene};

/// Impedance below which a medium is a gas, MRayl: a quarter of the lung's, 250 times that of air.
const GAS: f64 = 0.1;
/// Scanlines that are looked at.
const SAMPLED: u32 = 33;
/// Scanlines that are looked at for bone: bones have many triangles, and those of a whole face are alike.
const SAMPLED_IN_BONE: u32 = 5;
/// Depth that the display has to show of a medium in which scanlines start, mm.
const SHOWN: f64 = 20.0;
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
        let mut starts = self.starts(SAMPLED);
        for instance in self.instances.iter().filter(|i| i.shown) {
            starts.retain(|point| !self.holds(instance, *point));
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

    /// The warning about scanlines that start inside a tissue that takes more than the display shows, there and back,
    /// within [`SHOWN`]: bone.
    pub(in crate::scene) fn lines_in_bone(&self, file: &Path) -> Option<Issue> {
        let takes = |tissue: usize| {
            let nepers = 2.0 * SHOWN * self.tissues[tissue].absorption(self.probe.frequency);
            nepers * 10.0 / std::f64::consts::LN_10
        };
        let dark = |tissue: usize| takes(tissue) > self.imaging.dynamic_range;
        let shown = || self.instances.iter().filter(|i| i.shown);
        let within = |point: &DVec3| -> Option<usize> {
            shown().find(|i| dark(i.tissue) && self.holds(i, *point))?;
            // Where several lie in each other the highest priority counts.
            let all = shown().filter(|i| self.holds(i, *point));
            all.max_by_key(|i| i.priority).map(|i| i.tissue).filter(|t| dark(*t))
        };
        let inside: Vec<_> = self.starts(SAMPLED_IN_BONE).iter().filter_map(within).collect();
        let tissue = *inside.first()?;
        let name = &self.tissues[tissue].name;
        Some(Issue::warning(
            file,
            inside.len(),
            format!(
                "{} of {SAMPLED_IN_BONE} scanlines, evenly taken, start inside `{name}`, which takes {:.0} dB within {SHOWN} mm, \
                 there and back: the display shows {:.0}",
                inside.len(),
                takes(tissue),
                self.imaging.dynamic_range
            ),
            "move the probe out of it: probe.pose",
        ))
    }

    /// Places just ahead of the face, on `count` scanlines, evenly taken.
    fn starts(&self, count: u32) -> Vec<DVec3> {
        let at = |i: u32| {
            let across = (f64::from(i) + 0.5) / f64::from(count) - 0.5;
            let (origin, direction) = self.probe.ray_across(across);
            self.world_from_probe.transform_point3(origin + direction * AHEAD)
        };
        (0..count).map(at).collect()
    }

    /// True if an instance encloses a point.
    fn holds(&self, instance: &Instance, point: DVec3) -> bool {
        let [low, high] = self.meshes[instance.mesh].bounds();
        let local = instance.world_from_object.inverse().transform_point3(point);
        let local = local.as_vec3().to_array();
        (0..3).all(|axis| (low[axis]..=high[axis]).contains(&local[axis]))
            && encloses(self, instance, point)
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::Scene;

    #[test]
    fn lines_beside_the_body_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s.toml");
        let warnings_of = |background: &str, radius: f64| {
            let text = format!(
                "background = \"{background}\"\n[probe]\npreset = \"linear\"\n[[mesh]]\nname = \"a\"\n\
                 tissue = \"liver\"\nshape = {{ sphere = {{ radius = {radius} }} }}\n"
            );
            std::fs::write(&path, text).expect("written");
            let (_, warnings) = Scene::load(&path, &[]).expect("sound");
            warnings.into_iter().map(|w| w.count).collect::<Vec<_>>()
        };
        // The face lies in the middle of the sphere: 38.4 mm of it.
        assert!(warnings_of("air", 30.0).is_empty());
        assert!(warnings_of("water", 10.0).is_empty());
        let counts = warnings_of("air", 10.0);
        assert!(counts.len() == 1 && (10..25).contains(&counts[0]), "{counts:?}");
    }

    #[test]
    fn lines_that_start_in_bone_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s.toml");
        let ball = |name: &str, tissue: &str, radius: f64, priority: i32| {
            format!(
                "[[mesh]]\nname = \"{name}\"\ntissue = \"{tissue}\"\npriority = {priority}\n\
                 shape = {{ sphere = {{ radius = {radius} }} }}\n"
            )
        };
        let warnings_of = |balls: &[String]| {
            let text =
                format!("background = \"fat\"\n[probe]\npreset = \"linear\"\n{}", balls.concat());
            std::fs::write(&path, text).expect("written");
            let (_, warnings) = Scene::load(&path, &[]).expect("sound");
            warnings.into_iter().filter(|w| w.message.contains("start inside")).collect::<Vec<_>>()
        };
        let found = warnings_of(&[ball("a", "cortical_bone", 30.0, 0)]);
        assert!(found.len() == 1 && found[0].count == 5, "{found:?}");
        assert!(found[0].message.contains("`cortical_bone`"), "{found:?}");
        // The face's middle alone.
        let found = warnings_of(&[ball("a", "cortical_bone", 5.0, 0)]);
        assert!(found.len() == 1 && found[0].count == 1, "{found:?}");
        // Marrow within, other tissue above, bone that does not show.
        assert!(warnings_of(&[ball("a", "liver", 30.0, 0)]).is_empty());
        assert!(
            warnings_of(&[ball("a", "cortical_bone", 30.0, 0), ball("b", "liver", 25.0, 1)])
                .is_empty()
        );
        assert_eq!(
            warnings_of(&[ball("a", "cortical_bone", 30.0, 1), ball("b", "liver", 25.0, 0)]).len(),
            1
        );
    }
}
