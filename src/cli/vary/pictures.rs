//! The images of a contact sheet, all from one simulator.

use image::{GrayImage, Luma};
use insonify::output;
use insonify::scene::Scene;
use insonify::scene::vary::{Parameter, Variant, short};
use insonify::settings::{Blend, Surroundings, Words};
use insonify::sim::Simulator;
use miette::{IntoDiagnostic, Result};

use crate::cli::common::{self, Progress};

/// One image and its description.
pub struct Picture {
    /// Changed parameter; `none` in the image of the scene itself.
    pub parameter: String,
    /// Its value.
    pub value: String,
    /// Its value in the scene.
    pub own: String,
    /// Unit of both; empty for factors and names.
    pub unit: &'static str,
    /// The entries of the scene file, path and value, that make the scene show it.
    pub settings: Vec<(String, String)>,
    /// Caption under it.
    pub caption: String,
    /// Name of its file, without number and extension.
    pub stem: String,
    /// 8-bit grey; 0 beside the sector.
    pub image: GrayImage,
    /// Brightness of the sector.
    pub grey: Grey,
}

/// Brightness of a sector.
pub struct Grey {
    /// Mean level, 0 to 255.
    pub mean: f64,
    /// Standard deviation of the levels.
    pub deviation: f64,
    /// Share of level 0.
    pub black: f64,
    /// Share of level 255.
    pub white: f64,
}

/// A frame that was read back.
struct Frame {
    width: u32,
    height: u32,
    rgba: Vec<u8>,
}

impl Frame {
    /// Grey levels `levels`, row by row, in this frame's sector: an image and its brightness.
    fn image(&self, levels: impl Iterator<Item = u8>) -> (GrayImage, Grey) {
        let levels: Vec<u8> = levels.collect();
        let image = GrayImage::from_raw(self.width, self.height, levels).expect("one per pixel");
        let alpha = self.rgba.iter().skip(3).step_by(4);
        let sector: Vec<u8> = image
            .pixels()
            .zip(alpha)
            .filter(|(_, alpha)| **alpha > 0)
            .map(|(&Luma([level]), _)| level)
            .collect();
        let mean_of = |f: &dyn Fn(u8) -> f64| {
            sector.iter().map(|&v| f(v)).sum::<f64>() / (sector.len() as f64).max(1.0)
        };
        let mean = mean_of(&f64::from);
        let share = |level: u8| mean_of(&|v| f64::from(u8::from(v == level)));
        let grey = Grey {
            mean,
            deviation: mean_of(&|v| (f64::from(v) - mean).powi(2)).sqrt(),
            black: share(0),
            white: share(255),
        };
        (image, grey)
    }

    fn whole(&self) -> (GrayImage, Grey) {
        self.image(self.rgba.iter().step_by(4).copied())
    }
}

/// The scene's own values as text, a row each.
pub fn own_values(scene: &Scene) -> Vec<String> {
    let own = Parameter::suggested();
    let own = own.filter_map(|p| Some(format!("  {}", p.caption(p.value(scene)?))));
    let own: Vec<String> = own.collect();
    let head = "1 is the scene itself:".to_owned();
    let tail = "The others differ in one value.".to_owned();
    [head].into_iter().chain(own).chain([tail]).collect()
}

/// Makes all images with one simulator, which takes over the settings of each.
pub struct Studio {
    simulator: Simulator,
}

impl Studio {
    /// A studio with a simulator of the scene.
    pub fn new(simulator: Simulator) -> Self {
        Self { simulator }
    }

    /// The scene, then each of its variants; `settle` is applied to every scene.
    pub fn parameters(
        &mut self,
        scene: &Scene,
        variants: &[Variant],
        settle: impl Fn(&mut Scene),
    ) -> Result<Vec<Picture>> {
        let mut progress = Progress::new(variants.len() as u32 + 1, "images");
        let (image, grey) = self.shoot(scene, "the scene itself")?.whole();
        progress.done(1);
        let mut pictures = vec![Picture {
            parameter: "none".to_owned(),
            value: String::new(),
            own: String::new(),
            unit: "",
            settings: Vec::new(),
            caption: "the scene itself".to_owned(),
            stem: "scene".to_owned(),
            image,
            grey,
        }];
        let mut changed = scene.clone();
        for (done, variant) in (2..).zip(variants) {
            changed.settings.clone_from(&variant.settings);
            settle(&mut changed);
            let parameter = variant.parameter;
            let caption = parameter.caption(variant.value);
            let (image, grey) = self.shoot(&changed, &caption)?.whole();
            pictures.push(Picture {
                parameter: parameter.key(),
                value: variant.value.to_string(),
                own: parameter.value(scene).map_or_else(String::new, |own| own.to_string()),
                unit: parameter.unit(),
                settings: vec![variant.setting.clone()],
                caption,
                stem: format!("{}-{}", parameter.key(), short(variant.value)),
                image,
                grey,
            });
            progress.done(done);
        }
        progress.finish();
        Ok(pictures)
    }

    /// The steps of a fused image, as in figures 10 and 12 of the paper.
    pub fn steps(&mut self, scene: &Scene) -> Result<Vec<Picture>> {
        let mut scene = scene.clone();
        let fusion = scene.fusion.as_mut().expect("a volume is shown by a fusion");
        fusion.surroundings = Surroundings::Volume;
        let (blend, blur) = (fusion.blend.word(), fusion.blur);
        let blurred = match fusion.blend {
            Blend::Multiband => "mask, of which each band blurs its own".to_owned(),
            _ => format!("mask blurred over {blur} px"),
        };
        let frame = self.shoot(&scene, "the steps")?;
        let steps = self.simulator.fusion_steps().into_diagnostic()?;
        let steps = steps.expect("the frame was fused");
        let fusion = scene.fusion.as_mut().expect("it is still there");
        (fusion.blur, fusion.blend) = (1, Blend::Linear);
        let sharp = self.shoot(&scene, "the sharp border")?;
        // Levels 0..1, rounded as by the kernel that fuses.
        let levels = |plane: &[f32]| frame.image(plane.iter().map(|v| (v * 255.0 + 0.5) as u8));
        let simulated = frame.image(steps.simulated.iter().step_by(4).copied());
        let step = |value: &str, caption: String, (image, grey): (GrayImage, Grey)| Picture {
            parameter: "step".to_owned(),
            value: value.to_owned(),
            own: "fused".to_owned(),
            unit: "",
            settings: Vec::new(),
            caption,
            stem: value.to_owned(),
            image,
            grey,
        };
        let plain = str::to_owned;
        let sharp_border = [("blur", "1"), ("blend", Blend::Linear.word())];
        let sharp_border = sharp_border.map(|(key, value)| (format!("fusion.{key}"), plain(value)));
        Ok(vec![
            step("volume", plain("acquired volume"), levels(&steps.background)),
            step("simulation", plain("simulation alone"), simulated),
            step("mask", plain("mask (white: the acquired volume)"), levels(&steps.mask)),
            Picture {
                settings: sharp_border.to_vec(),
                ..step("composed", plain("composed, border sharp"), sharp.whole())
            },
            step("blurred-mask", blurred, levels(&steps.blurred)),
            step("fused", format!("fused, {blend}"), frame.whole()),
        ])
    }

    /// The possible surroundings of the mask, as in figure 14 of the paper.
    pub fn surroundings(&mut self, scene: &Scene) -> Result<Vec<Picture>> {
        let own = fusion(scene).surroundings;
        let shown = |s: Surroundings| match s {
            Surroundings::Volume => "acquired volume",
            Surroundings::None => "no surroundings",
            Surroundings::Scatterers => "simulated surroundings",
        };
        let each: Vec<_> = Surroundings::ALL.iter().map(|&s| (s.word(), shown(s))).collect();
        self.each("surroundings", own.word(), &each, scene, |fusion, i| {
            fusion.surroundings = Surroundings::ALL[i];
        })
    }

    /// The methods of blending the two images.
    pub fn blends(&mut self, scene: &Scene) -> Result<Vec<Picture>> {
        let own = fusion(scene).blend;
        let each: Vec<_> = Blend::ALL.iter().map(|b| (b.word(), b.word())).collect();
        self.each("blend", own.word(), &each, scene, |fusion, i| {
            fusion.surroundings = Surroundings::Volume;
            fusion.blend = Blend::ALL[i];
        })
    }

    /// One image per value of a choice in the table `fusion`: names in files and on the contact sheet.
    fn each(
        &mut self,
        key: &'static str,
        own: &str,
        values: &[(&str, &str)],
        scene: &Scene,
        set: impl Fn(&mut insonify::scene::Fusion, usize),
    ) -> Result<Vec<Picture>> {
        let mut progress = Progress::new(values.len() as u32, "images");
        let mut scene = scene.clone();
        let mut pictures = Vec::new();
        for (i, (value, caption)) in values.iter().enumerate() {
            set(scene.fusion.as_mut().expect("a fusion"), i);
            let (image, grey) = self.shoot(&scene, caption)?.whole();
            pictures.push(Picture {
                parameter: key.to_owned(),
                value: (*value).to_owned(),
                own: own.to_owned(),
                unit: "",
                settings: vec![(format!("fusion.{key}"), (*value).to_owned())],
                caption: (*caption).to_owned(),
                stem: (*value).to_owned(),
                image,
                grey,
            });
            progress.done(i as u32 + 1);
        }
        progress.finish();
        Ok(pictures)
    }

    /// One frame, 8-bit grey, 0 beside the sector; reports its losses with `name`.
    pub fn image(&mut self, scene: &Scene, name: &str) -> Result<GrayImage> {
        Ok(self.shoot(scene, name)?.whole().0)
    }

    /// Simulates one frame; reports its losses with `name`.
    fn shoot(&mut self, scene: &Scene, name: &str) -> Result<Frame> {
        self.simulator.frame(scene, 0).into_diagnostic()?;
        let (width, height, rgba) = self.simulator.pixels().into_diagnostic()?;
        let counters = self.simulator.counters().into_diagnostic()?;
        for lost in common::lost(&counters) {
            output::note(format!("warning: {name}: {lost}"));
        }
        Ok(Frame { width, height, rgba })
    }
}

fn fusion(scene: &Scene) -> &insonify::scene::Fusion {
    scene.fusion.as_ref().expect("a volume is shown by a fusion")
}
