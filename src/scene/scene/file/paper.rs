//! Settings of the paper (Starkov et al. 2019) where our defaults differ; `docs/paper.md` says how and why.

use std::path::Path;

/// Settings for every scene.
const SIMULATION: [(&str, &str); 8] = [
    ("simulation.sampling", "plain"),
    ("simulation.coherence", "coherent"),
    ("simulation.rough_transmission", "true"),
    ("simulation.beam_footprint", "false"),
    ("simulation.refraction", "ray"),
    ("simulation.loss", "ray"),
    ("simulation.scatter_mode", "voxel"),
    ("simulation.texture_space", "world"),
];
/// Settings for a scene with an acquired volume.
const FUSION: [(&str, &str); 4] = [
    ("fusion.blend", "linear"),
    ("fusion.blur", "32"),
    ("fusion.mask_speed", "enclosing"),
    ("fusion.background_shadows", "false"),
];

/// Overrides, for [`crate::scene::Scene::load`], with which the scene file at `path` is imaged as in the
/// paper. With `selectors` keyframes are switched by the paper's selector nodes, which only the compute tracer has.
/// For a file that cannot be read these are the overrides for every scene: loading it then reports the fault.
pub fn paper(path: &Path, selectors: bool) -> Vec<(String, String)> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let file: toml::Table = toml::from_str(&text).unwrap_or_default();
    let pair = |&(key, value): &(&str, &str)| (key.to_owned(), value.to_owned());
    let mut all: Vec<_> = SIMULATION.iter().map(pair).collect();
    if file.contains_key("fusion") {
        all.extend(FUSION.iter().map(pair));
    }
    let list = |name: &str| file.get(name).and_then(toml::Value::as_array);
    let each = |name: &'static str, switches: fn(&toml::Value) -> bool| {
        let tables = list(name).into_iter().flatten().enumerate();
        let switching = tables.filter(move |(_, table)| selectors && switches(table));
        switching.map(move |(i, _)| (format!("{name}.{i}.strategy"), "selector".to_owned()))
    };
    all.extend(each("selector", |_| true));
    all.extend(each("mesh", |table| table.get("animation").is_some()));
    all
}

#[cfg(test)]
mod tests {
    use super::super::tests::graph::{BEAT, beating, case, mesh};
    use super::*;
    use crate::scene::{Scene, Strategy};
    use crate::settings::{Coherence, Sampling, ScatterMode, TextureSpace};

    #[test]
    fn a_scene_is_imaged_as_in_the_paper() {
        let case = case();
        let path = case.folder.path().join("scene.toml");
        let text = BEAT.to_owned() + &beating("heart", "a b") + &mesh("m", "file = \"cube.obj\"");
        for (selectors, strategy) in [(true, Strategy::Selector), (false, Strategy::Exchange)] {
            std::fs::write(&path, &text).expect("written");
            let (scene, _) = Scene::load(&path, &paper(&path, selectors)).expect("sound");
            let s = &scene.simulation;
            assert_eq!(
                (s.sampling, s.coherence, s.scatter_mode, s.texture_space),
                (Sampling::Plain, Coherence::Coherent, ScatterMode::Voxel, TextureSpace::World)
            );
            assert!(s.rough_transmission && !s.beam_footprint);
            assert_eq!(scene.instances[0].keyframes.strategy, strategy);
        }
        assert_eq!(paper(Path::new("nowhere.toml"), true).len(), SIMULATION.len());
        std::fs::write(&path, "[volume]\nfile = \"v.mha\"\n[fusion]\nmask = [\"m\"]\n")
            .expect("written");
        assert_eq!(paper(&path, true).len(), SIMULATION.len() + FUSION.len());
    }
}
