//! Doppler for Python: packets of the colour box, and the gate's echoes with their spectra.

use insonify::doppler::broadening::Broadening;
use insonify::doppler::spectrum::{Analyser, Spectrogram};
use insonify::doppler::trace::{Measured, Trace, measure, trace};
use insonify::doppler::{gate, make_packet, nyquist};
use insonify::sim::{ColourMode, Correlation, Packet};
use numpy::Complex32;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::shaped;
use crate::error::raised;
use crate::frame::Picture;
use crate::running::{Running, Wanted};
use crate::state::State;

/// Echoes recorded between two looks for Ctrl-C.
const STEP: usize = 500;

/// An image in the colours of a packet, and what was heard and found in it.
pub struct Coloured {
    pub picture: Picture,
    rgba: Vec<u8>,
    packet: Packet,
    echoes: Vec<[f32; 2]>,
    found: Vec<Correlation>,
    prf: f64,
    nyquist: f64,
}

/// The echoes of a gate, and what they say.
pub struct Spectral {
    echoes: Vec<[f32; 2]>,
    made: Spectrogram,
    traces: Trace,
    measured: Option<Measured>,
    nyquist: f64,
}

fn complex(echoes: &[[f32; 2]]) -> Vec<Complex32> {
    echoes.iter().map(|&[re, im]| Complex32::new(re, im)).collect()
}

fn fault((key, message, remedy): (String, String, String)) -> PyErr {
    PyValueError::new_err(format!("{key}: {message}\n  help: {remedy}"))
}

/// Refuses what changes the scene's time between pulses where a program has placed meshes, which would go back then.
fn unplaced(state: &State) -> PyResult<()> {
    match state.placed.is_empty() {
        true => Ok(()),
        false => Err(PyValueError::new_err(
            "place() holds a mesh where it is, and here time goes on: give it the keys `translate` and `rotate` in its place",
        )),
    }
}

impl Running {
    /// The image of a scene in the colours of a mode, with the packet that they are of.
    pub fn coloured(
        &mut self,
        state: &mut State,
        wanted: Wanted,
        time: Option<f64>,
        mode: ColourMode,
    ) -> PyResult<Coloured> {
        if let Some(wrong) = mode.fault(&state.scene.settings) {
            return Err(fault(wrong));
        }
        if mode == ColourMode::Tissue {
            unplaced(state)?;
        }
        self.prepared(state, time, Some(wanted), |running, state| {
            let seconds = time.unwrap_or(state.time);
            let picture = running.image(state, wanted.number)?;
            let settings = mode.doppler(&state.scene.settings);
            let scene = &mut state.scene;
            let simulator = running.opened();
            let made = make_packet(simulator, scene, seconds, wanted.number, mode, &settings);
            let packet = made.map_err(|e| raised(&e))?;
            let echoes = simulator.pulses().map_err(|e| raised(&e))?;
            simulator.colour(scene, mode, None).map_err(|e| raised(&e))?;
            let rgba = simulator.coloured_pixels().map_err(|e| raised(&e))?;
            Ok(Coloured {
                rgba: rgba.expect("it was coloured"),
                found: simulator.correlations().map_err(|e| raised(&e))?,
                prf: settings.prf,
                nyquist: nyquist(&scene.probe, settings.prf),
                picture,
                packet,
                echoes,
            })
        })
    }

    /// The spectra of a scene's gate, for as long as it says.
    pub fn spectral(
        &mut self,
        state: &mut State,
        wanted: Wanted,
        time: Option<f64>,
    ) -> PyResult<Spectral> {
        let wrong = state.scene.spectral.fault(&state.scene.probe);
        if let Some((key, message, remedy)) = wrong {
            return Err(fault((format!("spectral.{key}"), message, remedy)));
        }
        unplaced(state)?;
        self.prepared(state, time, Some(wanted), |running, state| {
            let start = time.unwrap_or(state.time);
            let generation = state.generation;
            running.simulator(&state.scene, generation)?;
            let (scene, simulator) = (&mut state.scene, running.opened());
            let spectral = scene.spectral.clone();
            let pulses = (spectral.duration * spectral.prf).round() as usize;
            let mut analyser = Analyser::new(&spectral);
            let (mut echoes, mut index) = (Vec::with_capacity(pulses), wanted.number);
            while echoes.len() < pulses {
                let at = start + echoes.len() as f64 / spectral.prf;
                let count = STEP.min(pulses - echoes.len());
                let heard;
                (heard, index) =
                    gate::record(simulator, scene, at, count, index).map_err(|e| raised(&e))?;
                analyser.add(&heard);
                echoes.extend(heard.iter().map(|e| [e.re as f32, e.im as f32]));
                Python::attach(|py| py.check_signals())?;
            }
            let made = analyser.take().shown(&scene.probe, &spectral);
            let lines = Broadening::of(&scene.probe, scene.imaging.psf_scale, &spectral);
            let traces = trace(&made, &lines);
            let measured = measure(&made.times, &traces);
            let nyquist = nyquist(&scene.probe, spectral.prf) / spectral.angle.cos();
            Ok(Spectral { echoes, made, traces, measured, nyquist })
        })
    }
}

impl Coloured {
    /// Arrays and numbers by name.
    pub fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Packet { times, lines, samples, .. } = &self.packet;
        let map = [lines.len(), samples.len()];
        let of = |value: &dyn Fn(&Correlation) -> f64| {
            let values: Vec<f32> = self.found.iter().map(|one| value(one) as f32).collect();
            shaped(py, values, &map)
        };
        let pitch = self.picture.probe.sample_pitch();
        let depth: Vec<f64> = samples.clone().map(|k| f64::from(k) * pitch).collect();
        let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let size = [self.picture.height as usize, self.picture.width as usize, 3];
        let out = PyDict::new(py);
        out.set_item("image", shaped(py, rgb, &size)?)?;
        out.set_item("iq", shaped(py, complex(&self.echoes), &[times.len(), map[0], map[1]])?)?;
        out.set_item("velocity", of(&|one| one.velocity(self.nyquist))?)?;
        out.set_item("variance", of(&|one| one.variance(self.nyquist))?)?;
        out.set_item("power", of(&|one| one.power.into())?)?;
        out.set_item("times", shaped(py, times.clone(), &[times.len()])?)?;
        out.set_item("depth", shaped(py, depth, &[map[1]])?)?;
        out.set_item("scanlines", (lines.start, lines.end))?;
        out.set_item("samples", (samples.start, samples.end))?;
        out.set_item("prf", self.prf)?;
        out.set_item("nyquist", self.nyquist)?;
        Ok(out)
    }
}

impl Spectral {
    /// Arrays and numbers by name.
    pub fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let [times, bins] = [self.made.times.len(), self.made.velocities.len()];
        let out = PyDict::new(py);
        out.set_item("iq", shaped(py, complex(&self.echoes), &[self.echoes.len()])?)?;
        out.set_item("power", shaped(py, self.made.power.clone(), &[times, bins])?)?;
        out.set_item("velocity", shaped(py, self.made.velocities.clone(), &[bins])?)?;
        out.set_item("times", shaped(py, self.made.times.clone(), &[times])?)?;
        out.set_item("maximum", shaped(py, self.traces.maximum.clone(), &[times])?)?;
        out.set_item("mean", shaped(py, self.traces.mean.clone(), &[times])?)?;
        out.set_item("nyquist", self.nyquist)?;
        let measured = self.measured.map(|measured| {
            let dict = PyDict::new(py);
            let Measured {
                beats,
                beat_s,
                psv_mm_per_s,
                edv_mm_per_s,
                ta_max_mm_per_s,
                ta_mean_mm_per_s,
                ri,
                pi,
                vti_mm,
                acceleration_time_s,
            } = measured;
            dict.set_item("beats", beats)?;
            for (name, value) in [
                ("beat", beat_s),
                ("psv", psv_mm_per_s),
                ("edv", edv_mm_per_s),
                ("ta_max", ta_max_mm_per_s),
                ("ta_mean", ta_mean_mm_per_s),
                ("ri", ri),
                ("pi", pi),
                ("vti", vti_mm),
                ("acceleration_time", acceleration_time_s),
            ] {
                dict.set_item(name, value)?;
            }
            PyResult::Ok(dict)
        });
        out.set_item("measured", measured.transpose()?)?;
        Ok(out)
    }
}
