//! The cases of a study: their images and numbers.

use insonify::random::order;
use insonify::scene::file::Plan;
use insonify::scene::vary::Variant;
use insonify::scene::{Scene, SceneError};
use insonify::settings::{Surroundings, Words};
use insonify::study::key::{Row, UNPERTURBED};
use miette::Result;

/// A scenario's loaded scene with its variants.
pub struct Loaded {
    pub scene: Scene,
    pub variants: Vec<Variant>,
}

/// One case: a scenario and a slice of the plan before one background, by their places in the plan.
pub struct Case {
    pub scenario: usize,
    pub slice: usize,
    pub background: Surroundings,
    /// Image at each place of the order: 0 the scene itself, then its variants from 1.
    pub images: Vec<usize>,
}

/// All cases in the order drawn by `seed`, each with its images in an order of its own.
pub fn cases(plan: &Plan, loaded: &[Loaded], seed: u32) -> Vec<Case> {
    let mut all = Vec::new();
    for (scenario, found) in plan.scenarios.iter().enumerate() {
        for slice in 0..found.slices.len() {
            for &background in &plan.backgrounds {
                all.push((scenario, slice, background));
            }
        }
    }
    // Stream 0 orders the cases, stream n the images of case n.
    let numbered = (1..).zip(order(all.len(), seed, 0));
    let case = |(number, place): (u32, usize)| {
        let (scenario, slice, background) = all[place];
        let count = loaded[scenario].variants.len() + 1;
        Case { scenario, slice, background, images: order(count, seed, number) }
    };
    numbered.map(case).collect()
}

impl Case {
    /// The scene of this case, without variants; and the equivalent entries of a scene file, path and value
    /// without blanks.
    pub fn scene(&self, plan: &Plan, loaded: &Loaded) -> (Scene, Vec<(String, String)>) {
        let mut scene = loaded.scene.clone();
        let slice = &plan.scenarios[self.scenario].slices[self.slice];
        let (pose, entry) = slice.pose(&scene);
        scene.world_from_probe = pose;
        let mut entries = vec![entry];
        if let Some(fusion) = &mut scene.fusion {
            fusion.surroundings = self.background;
            let name = self.background.word().to_owned();
            entries.push(("fusion.surroundings".to_owned(), name));
        }
        (scene, entries)
    }

    /// The row of the key for image `image` of case `number`, both from 1; `entries` are those of
    /// [`Case::scene`].
    pub fn row(
        &self,
        plan: &Plan,
        loaded: &Loaded,
        number: usize,
        image: usize,
        entries: &[(String, String)],
    ) -> Row {
        let scenario = &plan.scenarios[self.scenario];
        let variant = self.images[image - 1].checked_sub(1);
        let variant = variant.map(|i| &loaded.variants[i]);
        let entries = entries.iter().chain(variant.map(|v| &v.setting));
        let set: Vec<String> = entries.map(|(path, value)| format!("{path}={value}")).collect();
        let text = |f: &dyn Fn(&Variant) -> String| variant.map(f).unwrap_or_default();
        Row {
            study: String::new(),
            case: number,
            image,
            scenario: scenario.name.clone(),
            slice: scenario.slices[self.slice].name.clone(),
            background: self.background.word().to_owned(),
            parameter: variant.map_or_else(|| UNPERTURBED.to_owned(), |v| v.parameter.key()),
            value: text(&|v| v.value.to_string()),
            own: text(&|v| {
                v.parameter.value(&loaded.scene).map_or_else(String::new, |own| own.to_string())
            }),
            unit: text(&|v| v.parameter.unit().to_owned()),
            set: set.join(" "),
            crc: String::new(),
            wording: String::new(),
        }
    }
}

/// Fails where a scene cannot be shown before one of the plan's backgrounds.
pub fn check_backgrounds(plan: &Plan, scenario: usize, scene: &Scene) -> Result<(), SceneError> {
    let file = plan.scenarios[scenario].scene.display();
    for background in &plan.backgrounds {
        let (lacks, remedy) = match background {
            Surroundings::Volume if scene.volume.is_none() => (
                "no acquired volume",
                "add [volume] and [fusion] to the scene, or leave `volume` out of the plan's backgrounds",
            ),
            Surroundings::None if scene.fusion.is_none() => (
                "no mask around which nothing is shown",
                "add [fusion] with its mask to the scene, or leave `none` out of the plan's backgrounds",
            ),
            _ => continue,
        };
        let message =
            format!("{file} has {lacks}, and is to be shown before `{}`", background.word());
        return Err(plan.fault(&format!("scenario.{scenario}.scene"), message, remedy));
    }
    Ok(())
}
