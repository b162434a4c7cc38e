//! Settings of image formation and of live quality.

use super::units::{ATTENUATION, DURATION, LEVEL};
use super::{Exam, Form, GreyMap, group};

const OFF: f64 = f64::NEG_INFINITY;

group! {
    /// Image formation.
    pub struct Imaging in "imaging" {
        /// The kind of examination: which measurements the window offers. Keys of `imaging` that the file leaves out
        /// have the values of its preset, and so has the probe where `[probe]` names no `preset` (docs/exam.md).
        exam: Exam = Exam::General,
            Facts::word::<Exam>();
        /// An echo this far below a perfect mirror is white at the face.
        gain: f64 = 16.0,
            Facts::quantity(&LEVEL, -200.0, 200.0).label("Gain").usual(-20.0, 60.0);
        /// Level of the sent pulse below full power. Echoes become as much fainter, the electronic noise does not:
        /// what `gain` gives back lies deeper in it.
        power: f64 = 0.0,
            Facts::quantity(&LEVEL, -60.0, 0.0).label("Power").usual(-30.0, 0.0);
        /// From white to black.
        dynamic_range: f64 = 60.0,
            Facts::quantity(&LEVEL, 1.0, 200.0).label("Dynamic range").usual(20.0, 100.0);
        /// Attenuation that the time-gain compensation makes up for, both ways.
        tgc_attenuation: f64 = 0.5,
            Facts::quantity(&ATTENUATION, 0.0, 100.0).under("Time gain").label("Attenuation").usual(0.0, 2.0);
        /// Largest compensation, sliders not counted.
        tgc_limit: f64 = 80.0,
            Facts::quantity(&LEVEL, 0.0, 200.0).under("Time gain").label("Limit").usual(0.0, 120.0);
        /// Added gain, evenly spaced from the face to full depth, linear between.
        tgc_sliders: [f64; 8] = [0.0; 8],
            Facts::quantities(&LEVEL, 8, -100.0, 100.0).under("Time gain").label("Sliders").usual(-20.0, 20.0);
        /// RMS of the electronic noise before compensation, relative to a perfect mirror.
        noise: f64 = -116.0,
            Facts::quantity(&LEVEL, OFF, 200.0).under("Noise and resolution")
                .label("Noise").usual(-160.0, -60.0).off(OFF, "off");
        /// The grey in which levels between black and white are shown: `linear` in dB; with a dark `toe` or `long-toe`
        /// as on scanners; an `s-curve`; or the curve of `grey_table`.
        grey_map: GreyMap = GreyMap::Linear,
            Facts::word::<GreyMap>().label("Grey map");
        /// The curve of the grey map `table`: greys from 0 to 255 at evenly spaced levels from black to white, linear
        /// between them. Other grey maps leave it out.
        grey_table: Vec<f64> = vec![0.0, 255.0],
            Facts::several(&Form::Number, [2, 256], 0.0, 255.0);
        /// Exponent by which the grey map is bent further.
        grey_gamma: f64 = 1.0,
            Facts::number(0.01, 100.0).label("Grey gamma").usual(0.4, 2.5);
        /// Factors on the point-spread function's widths: axial, lateral, elevational.
        psf_scale: [f64; 3] = [1.0; 3],
            Facts::numbers(&["axial", "lateral", "elevation"], 0.01, 100.0).under("Noise and resolution")
                .label("PSF").usual(0.25, 4.0);
        /// Height of the picture; its width follows, and may be 65535 pixels.
        image_height: u32 = 800,
            Facts::whole(16, 8192).counted("pixels").under("Noise and resolution")
                .label("Height").usual(200.0, 2000.0);
    }
}

group! {
    /// Live quality of the window and of `serve`.
    pub struct Live in "live" {
        /// Time that an image may take while the probe, the anatomy or a setting moves. Where the scene's own counts
        /// take longer, images are made with fewer lines, layers, samples and paths; at rest they are the scene's own.
        /// Default: 66 ms with a software driver, 16 ms on a GPU.
        budget: Option<f64> = None,
            Facts::quantity(&DURATION, 0.001, 10.0).by_default("by device")
                .label("Image in").usual(0.01, 0.2).off_if_absent("device's");
    }
}

impl Live {
    /// The time that an image may take, ms. Unless the scene says it: 15 images a second with a software
    /// driver, 60 on a GPU.
    pub fn budget_ms(&self, machine: Machine) -> f64 {
        let default = match machine {
            Machine::Software => 0.066,
            Machine::Gpu => 0.016,
        };
        1e3 * self.budget.unwrap_or(default)
    }
}

/// The kind of machine that computes the images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Machine {
    /// A software driver: every path and scatterer costs time.
    Software,
    /// A GPU: a frame with few paths does not use all of it.
    Gpu,
}
