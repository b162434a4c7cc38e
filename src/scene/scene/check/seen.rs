//! Scenes of which the image shows none.

use std::path::Path;

use glam::{BVec3, DVec3};

use crate::scene::{Instance, Issue, Scene};

impl Scene {
    /// The warning that no mesh of a scene that stands still is in the image, by their boxes in the probe's frame: the picture
    /// is that of the background alone. Wires and an acquired volume are something to see.
    pub(in crate::scene) fn nothing_in_the_image(&self, file: &Path) -> Option<Issue> {
        if self.is_animated() || self.volume.is_some() || !self.wires.is_empty() {
            return None;
        }
        let shown = self.instances.iter().filter(|i| i.shown);
        let distances = shown.map(|i| (self.distance_from_image(i), i));
        let (distance, nearest) = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (distance > 0.0).then(|| {
            let name = &self.meshes[nearest.mesh].name;
            Issue::warning(
                file,
                1,
                format!(
                    "no mesh is in the image: the nearest, `{name}`, lies {distance:.0} mm beside it"
                ),
                "move the probe (probe.pose) or the meshes (translate); meshes in metres need `units`",
            )
        })
    }

    /// Distance between the box of an instance and that of the image, in the probe's frame, mm; 0 where they meet.
    fn distance_from_image(&self, instance: &Instance) -> f64 {
        let [low, high] =
            self.meshes[instance.mesh].bounds().map(|p| DVec3::from(p.map(f64::from)));
        let probe_from_object = self.world_from_probe.inverse() * instance.world_from_object;
        let corners = (0..8u32).map(|i| {
            let upper = BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4);
            probe_from_object.transform_point3(DVec3::select(upper, high, low))
        });
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = corners.fold(none, |(low, high), p| (low.min(p), high.max(p)));
        let [left, top, right, bottom] = self.probe.bounds();
        let slice = self.probe.slice_thickness / 2.0;
        let [begin, end] = [DVec3::new(left, -slice, top), DVec3::new(right, slice, bottom)];
        (begin - high).max(low - end).max(DVec3::ZERO).length()
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::Scene;

    #[test]
    fn meshes_beside_the_image_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s.toml");
        let first_of = |text: &str| {
            let head = "background = \"liver\"\n[probe]\npreset = \"linear\"\n";
            std::fs::write(&path, format!("{head}{text}")).expect("written");
            let (_, warnings) = Scene::load(&path, &[]).expect("sound");
            let texts: Vec<_> =
                warnings.into_iter().filter(|w| w.message.contains("no mesh is")).collect();
            texts.first().map(|w| w.message.clone())
        };
        let ball = |name: &str, at: &str| {
            format!(
                "[[mesh]]\nname = \"{name}\"\ntissue = \"fat\"\nshape = {{ sphere = {{ radius = 5 }} }}\n\
                 translate = [{at}]\n"
            )
        };
        let (near, far) = (ball("near", "0, 0, -50"), ball("far", "0, 400, 20"));
        assert!(
            first_of(&format!("{far}{near}")).is_some_and(|m| m.contains("`near`, lies 45 mm"))
        );
        for one in ["0, 0, 20", "0, 0, 0", "0, 5, 20", "-22, 0, 30"] {
            assert_eq!(first_of(&format!("{far}{}", ball("seen", one))), None, "{one}");
        }
        let wire = "[[wire]]\nfrom = [0, -5, 20]\nto = [0, 5, 20]\n";
        assert_eq!(first_of(&format!("{far}{wire}")), None);
        assert_eq!(first_of(""), None);
    }
}
