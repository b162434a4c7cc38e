//! Kinds of examination, and the settings with which a machine begins each.

use super::{GreyMap, Imaging, Probe, Settings, words};

words! {
    /// The kind of an examination.
    pub enum Exam {
        /// None in particular.
        General = "general",
        /// Liver, kidneys, gallbladder, aorta.
        Abdomen = "abdomen",
        /// The heart.
        Cardiac = "cardiac",
        /// Pregnancy.
        Obstetric = "obstetric",
        /// Vessels near the skin.
        Vascular = "vascular",
        /// Muscles, thyroid, breast, limbs.
        SmallParts = "small parts",
        /// Pleura and lung.
        Lung = "lung",
    }
}

/// The settings of an examination that differ from the defaults.
struct Preset {
    probe: fn() -> Probe,
    /// mm.
    depth: f64,
    /// mm.
    focus: f64,
    /// dB.
    gain: f64,
    /// dB.
    dynamic_range: f64,
    /// dB/(cm MHz).
    tgc_attenuation: f64,
    /// dB, from the face to full depth.
    tgc_sliders: [f64; 8],
    grey_map: GreyMap,
}

const FLAT: [f64; 8] = [0.0; 8];

impl Exam {
    /// All values are ours, chosen on the shipped scenes: makers do not publish theirs, and levels are relative to
    /// the machine's own full scale. What they follow: the heart is shown in higher contrast than organs, so that
    /// walls stand out from blood; behind fluid the far sliders go down; the lung is shown in less contrast, since its
    /// artefacts are what is read; with this gain and grey map the liver is as dark, and its speckle as skewed to bright,
    /// as in clinical frames (`tests/greys.rs`).
    fn preset(self) -> Option<Preset> {
        let preset = |probe: fn() -> Probe, depth, focus, dynamic_range| Preset {
            probe,
            depth,
            focus,
            gain: 28.0,
            dynamic_range,
            tgc_attenuation: 0.5,
            tgc_sliders: FLAT,
            grey_map: GreyMap::Toe,
        };
        Some(match self {
            Self::General => return None,
            Self::Abdomen => preset(Probe::abdominal, 160.0, 80.0, 60.0),
            Self::Cardiac => Preset {
                gain: 37.0,
                tgc_sliders: [0.0, -1.0, -3.0, -6.0, -9.0, -12.0, -16.0, -20.0],
                ..preset(Probe::cardiac, 160.0, 80.0, 54.0)
            },
            Self::Obstetric => Preset {
                gain: 35.0,
                tgc_sliders: [0.0, 0.0, 0.0, -2.0, -4.0, -7.0, -10.0, -12.0],
                ..preset(Probe::abdominal, 140.0, 70.0, 72.0)
            },
            Self::Vascular => Preset { gain: 34.0, ..preset(Probe::linear, 40.0, 20.0, 56.0) },
            Self::SmallParts => Preset { gain: 34.0, ..preset(Probe::linear, 50.0, 25.0, 64.0) },
            Self::Lung => {
                Preset { tgc_attenuation: 0.3, ..preset(Probe::abdominal, 120.0, 40.0, 66.0) }
            }
        })
    }

    /// The probe with the depth and focus of this examination; none of [`Self::General`].
    pub fn probe(self) -> Option<Probe> {
        let preset = self.preset()?;
        Some(Probe { depth: preset.depth, focus: preset.focus, ..(preset.probe)() })
    }

    /// Image formation in this examination: of a scene file that names it, the values of the keys that it leaves out.
    pub fn imaging(self) -> Imaging {
        let mut out = Imaging { exam: self, ..Imaging::default() };
        self.form(&mut out);
        out
    }

    /// Puts the settings of this examination in the place of the present ones. Counts of scanlines, layers and samples
    /// stay, noise and resolution too: they are the machine's, not the examination's.
    pub fn apply(self, settings: &mut Settings) {
        settings.imaging.exam = self;
        let Some(probe) = self.probe() else { return };
        let (before, old) = (settings.probe.frequency, &settings.probe);
        settings.probe = Probe {
            scanlines: old.scanlines,
            elevation_layers: old.elevation_layers,
            samples: old.samples,
            ..probe
        };
        settings.follow_frequency(before);
        settings.imaging.power = 0.0;
        self.form(&mut settings.imaging);
    }

    /// Sets what its preset says of image formation.
    fn form(self, imaging: &mut Imaging) {
        let Some(preset) = self.preset() else { return };
        imaging.gain = preset.gain;
        imaging.dynamic_range = preset.dynamic_range;
        imaging.tgc_attenuation = preset.tgc_attenuation;
        imaging.tgc_sliders = preset.tgc_sliders;
        imaging.grey_map = preset.grey_map;
        imaging.grey_gamma = 1.0;
    }

    /// The examination of these settings by name, with a star where they are not those of its preset.
    pub fn title(settings: &Settings) -> String {
        let exam = settings.imaging.exam;
        let mut fresh = settings.clone();
        exam.apply(&mut fresh);
        starred(super::Words::word(exam), fresh != *settings)
    }
}

impl Probe {
    /// The preset that most keys agree with, by name, with a star where not all do.
    pub fn title(&self) -> String {
        use super::Group as _;
        let apart = |made: &Probe| {
            Self::rows().iter().filter(|row| (row.get)(self) != (row.get)(made)).count()
        };
        let all = Self::PRESETS.iter().map(|(name, make)| (*name, apart(&make())));
        let (name, apart) = all.min_by_key(|(_, apart)| *apart).expect("there are presets");
        starred(name, apart > 0)
    }
}

fn starred(name: &str, edited: bool) -> String {
    if edited { format!("{name} *") } else { name.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Words;

    #[test]
    fn a_preset_that_is_edited_has_a_star() {
        for &exam in Exam::ALL {
            let mut settings = Settings::of(Probe::paper_table1());
            settings.probe.scanlines = 64;
            exam.apply(&mut settings);
            assert_eq!(Exam::title(&settings), exam.word());
            assert_eq!(settings.probe.scanlines, 64, "counts stay");
            settings.imaging.gain += 1.0;
            let edited = exam != Exam::General;
            assert_eq!(Exam::title(&settings).ends_with(" *"), edited, "{exam}");
        }
        for (name, make) in Probe::PRESETS {
            assert_eq!(make().title(), name);
            let edited = Probe { depth: 77.0, frequency: 4.4, ..make() };
            assert_eq!(edited.title(), format!("{name} *"));
        }
    }

    #[test]
    fn another_frequency_takes_its_lattice_with_it() {
        let mut settings = Settings::of(Probe::abdominal());
        let cell = settings.simulation.cell;
        Exam::Vascular.apply(&mut settings);
        let expected = cell * Probe::abdominal().frequency / Probe::linear().frequency;
        assert!((settings.simulation.cell / expected - 1.0).abs() < 1e-12);
    }
}
