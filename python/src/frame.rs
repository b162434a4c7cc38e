//! Frames of Python: an image and what it was made of.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use glam::{DAffine3, DVec3};
use insonify::output::picture::grey_png;
use insonify::probe::Probe;
use insonify::sim::labels::{LabelValues, Labels};
use insonify::sim::{layout, rf};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{self, shaped};
use crate::kept_frame;
use crate::save;
use crate::simulator::Simulator;

/// What a frame has besides its image.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ArrayKind {
    Iq,
    Envelope,
    Log,
    Rf,
    Labels,
}

impl ArrayKind {
    /// All, by the names that Python knows.
    pub const ALL: [(&'static str, Self); 5] = [
        ("iq", Self::Iq),
        ("envelope", Self::Envelope),
        ("log", Self::Log),
        ("rf", Self::Rf),
        ("labels", Self::Labels),
    ];
}

/// What was read from the device.
#[derive(Clone)]
pub enum Contents {
    /// Rows of scanlines, and the values for each axial sample.
    Rows(Vec<f32>, usize),
    /// Labels and what their numbers mean, as JSON; none of a frame without them.
    Labels(Arc<Option<(Labels, String)>>),
}

/// The image of a frame, and how it was made.
pub struct Picture {
    pub constants: layout::Frame,
    pub probe: Probe,
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
    pub passes: Vec<(String, f64)>,
    /// From the call into the simulator until the image was read.
    pub took_ms: f64,
    pub pose: DAffine3,
}

/// An image, and on request what it was made of.
///
/// Arrays besides the image are those named in frame(want=...), or of the simulator's last frame any.
/// L scanlines, K axial samples, an image of H rows and W columns.
#[pyclass(frozen, module = "insonify")]
pub struct Frame {
    /// None of a frame that was unpickled: it has what was read of it before.
    simulator: Option<Py<Simulator>>,
    number: u64,
    picture: Picture,
    contents: Mutex<Vec<(ArrayKind, Contents)>>,
    /// Arrays that have been made of them: the next time they are the same ones.
    arrays: Mutex<Vec<(&'static str, Py<PyAny>)>>,
}

impl Frame {
    pub fn new(
        simulator: Option<Py<Simulator>>,
        number: u64,
        picture: Picture,
        contents: Vec<(ArrayKind, Contents)>,
    ) -> Self {
        Self {
            simulator,
            number,
            picture,
            contents: Mutex::new(contents),
            arrays: Mutex::default(),
        }
    }

    fn shape(&self) -> [usize; 2] {
        [self.picture.height as usize, self.picture.width as usize]
    }

    /// What the frame has of a kind, read from the device when it is first asked for.
    fn read(&self, py: Python<'_>, kind: ArrayKind) -> PyResult<Contents> {
        let all = || self.contents.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = all().iter().find(|(known, _)| *known == kind).map(|(_, kept)| kept.clone());
        if let Some(kept) = kept {
            return Ok(kept);
        }
        let Some(simulator) = &self.simulator else {
            return Err(PyRuntimeError::new_err(
                "this frame was unpickled: it has what was read of it before; name the rest in frame(want=...)",
            ));
        };
        let contents = simulator.get().contents(py, self.number, kind, &self.picture.probe)?;
        all().push((kind, contents.clone()));
        Ok(contents)
    }

    /// The array of this name, made when it is first asked for.
    fn kept<'py>(
        &self,
        py: Python<'py>,
        name: &'static str,
        make: impl FnOnce() -> PyResult<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let all = || self.arrays.lock().unwrap_or_else(PoisonError::into_inner);
        let find = || {
            let all = all();
            let found = all.iter().find(|(known, _)| *known == name);
            found.map(|(_, array)| array.clone_ref(py).into_bound(py))
        };
        if let Some(array) = find() {
            return Ok(array);
        }
        let made = make()?;
        // Another thread may have been faster.
        if let Some(array) = find() {
            return Ok(array);
        }
        all().push((name, made.clone().unbind()));
        Ok(made)
    }

    fn array<'py>(&self, py: Python<'py>, kind: ArrayKind) -> PyResult<Bound<'py, PyAny>> {
        let Contents::Rows(values, per_sample) = self.read(py, kind)? else {
            unreachable!("labels are no rows")
        };
        let frame = &self.picture.constants;
        let shape = [frame.scanlines as usize, frame.samples as usize * per_sample];
        if kind != ArrayKind::Iq {
            return shaped(py, values, &shape);
        }
        let complex = |z: &[f32]| numpy::Complex32::new(z[0], z[1]);
        shaped(py, values.chunks_exact(2).map(complex).collect(), &shape)
    }

    fn labelled(&self, py: Python<'_>) -> PyResult<Arc<Option<(Labels, String)>>> {
        match self.read(py, ArrayKind::Labels)? {
            Contents::Labels(labels) if labels.is_some() => Ok(labels),
            _ => Err(PyRuntimeError::new_err(
                "this frame was made without labels: sim.frame(want=[\"labels\"]), or \
                 scene[\"simulation.labels\"] = True",
            )),
        }
    }
}

#[pymethods]
impl Frame {
    /// Grey levels [H, W]; 0 outside the sector.
    #[getter]
    fn bmode<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let grey = || self.picture.rgba.chunks_exact(4).map(|p| p[0]).collect();
        self.kept(py, "bmode", || shaped(py, grey(), &self.shape()))
    }

    /// True inside the sector [H, W].
    #[getter]
    fn sector<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let inside = || self.picture.rgba.chunks_exact(4).map(|p| p[3] != 0).collect();
        self.kept(py, "sector", || shaped(py, inside(), &self.shape()))
    }

    /// Complex baseband before time-gain compensation, relative to a perfect mirror [L, K].
    #[getter]
    fn iq<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.kept(py, "iq", || self.array(py, ArrayKind::Iq))
    }

    /// Envelope after time-gain compensation [L, K].
    #[getter]
    fn envelope<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.kept(py, "envelope", || self.array(py, ArrayKind::Envelope))
    }

    /// Log-compressed envelope, 0 black to 1 white [L, K].
    #[getter]
    fn log<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.kept(py, "log", || self.array(py, ArrayKind::Log))
    }

    /// Radio-frequency lines before time-gain compensation [L, n K], n samples to each axial one.
    #[getter]
    fn rf<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.kept(py, "rf", || self.array(py, ArrayKind::Rf))
    }

    /// Labels (docs/labels.md): of samples [L, K], of pixels [H, W] with `pixel_` before the name.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let labelled = self.labelled(py)?;
        let (labels, _) = labelled.as_ref().as_ref().expect("checked");
        let out = PyDict::new(py);
        for (prefix, grid) in [("", &labels.samples), ("pixel_", &labels.pixels)] {
            for array in grid.arrays() {
                let values = match array.values {
                    LabelValues::Indices(values) => shaped(py, values, &array.shape)?,
                    LabelValues::Quantities(values) => shaped(py, values, &array.shape)?,
                };
                out.set_item(format!("{prefix}{}", array.kind.name), values)?;
            }
        }
        Ok(out)
    }

    /// Meaning of the labels: names of tissues and meshes, units.
    #[getter]
    fn legend<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let labelled = self.labelled(py)?;
        let (_, legend) = labelled.as_ref().as_ref().expect("checked");
        py.import("json")?.call_method1("loads", (legend,))
    }

    /// Settings of the probe by their keys (docs/scenes.md), in the units of Scene.describe; angles as text.
    #[getter]
    fn probe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        save::keys(py, &self.picture.probe)
    }

    /// World from probe space [4, 4].
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::fixed_rows(py, &self.picture.pose)
    }

    /// Milliseconds on the device by stage; of frames that were made together, the mean.
    #[getter]
    fn timings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (name, ms) in &self.picture.passes {
            let before: f64 = out.get_item(name)?.map_or(Ok(0.0), |v| v.extract())?;
            out.set_item(name, before + ms)?;
        }
        Ok(out)
    }

    /// Milliseconds by the clock until the image was read, without Python's part; of frames that were made together,
    /// that of one of them.
    #[getter]
    fn took(&self) -> f64 {
        self.picture.took_ms
    }

    /// Coordinates in probe space, mm: x [W] and z [H] of pixels' centres, depth [K] of samples, rf_depth [n K] of
    /// those of `rf`, origins and directions [L, 3] of scanlines.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Picture { constants: frame, probe, width, height, .. } = &self.picture;
        let pitch = f64::from(frame.pixel_pitch);
        let centres = |first: f32, count: u32| -> Vec<f64> {
            (0..count).map(|i| f64::from(first) + (f64::from(i) + 0.5) * pitch).collect()
        };
        let lines = frame.scanlines as usize;
        let rays: Vec<(DVec3, DVec3)> = (0..frame.scanlines)
            .map(|l| {
                let (origin, direction) = probe.ray(l, 0);
                (origin.with_y(0.0), direction)
            })
            .collect();
        let vectors = |of: fn(&(DVec3, DVec3)) -> DVec3| -> Vec<f64> {
            rays.iter().flat_map(|ray| of(ray).to_array()).collect()
        };
        let every = |count: usize, pitch: f64| (0..count).map(|k| k as f64 * pitch).collect();
        let (samples, finer) = (frame.samples as usize, rf::oversampling(probe));
        let depths = every(samples, probe.sample_pitch());
        let rf_depths = every(samples * finer, probe.sample_pitch() / finer as f64);
        let out = PyDict::new(py);
        out.set_item("x", shaped(py, centres(frame.image_left, *width), &[*width as usize])?)?;
        out.set_item("z", shaped(py, centres(frame.image_top, *height), &[*height as usize])?)?;
        out.set_item("depth", shaped::<f64>(py, depths, &[samples])?)?;
        out.set_item("rf_depth", shaped::<f64>(py, rf_depths, &[samples * finer])?)?;
        out.set_item("origins", shaped(py, vectors(|ray| ray.0), &[lines, 3])?)?;
        out.set_item("directions", shaped(py, vectors(|ray| ray.1), &[lines, 3])?)?;
        Ok(out)
    }

    /// Left, right, lower and upper edge of the image, mm, as matplotlib's imshow takes them.
    #[getter]
    fn extent(&self) -> [f64; 4] {
        let Picture { constants: frame, width, height, .. } = &self.picture;
        let [left, top, pitch] =
            [frame.image_left, frame.image_top, frame.pixel_pitch].map(f64::from);
        [left, left + f64::from(*width) * pitch, top + f64::from(*height) * pitch, top]
    }

    /// Rate of the samples of `rf`, MHz.
    #[getter]
    fn sampling_frequency(&self) -> f64 {
        let probe = &self.picture.probe;
        rf::oversampling(probe) as f64 * probe.speed / (2.0 * probe.sample_pitch())
    }

    /// Writes the frame as a file, as insonify.save does: `frame.save("image.png")`.
    fn save(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        slf.py().import("insonify.files")?.call_method1("save", (path, slf))?;
        Ok(())
    }

    /// The image as PNG, for notebooks.
    fn _repr_png_(&self) -> Vec<u8> {
        let Picture { constants, width, height, rgba, .. } = &self.picture;
        grey_png([*width, *height], rgba, f64::from(constants.pixel_pitch), None)
    }

    /// The frame as `pickle` keeps it: with what was read of it.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let contents = self.contents.lock().unwrap_or_else(PoisonError::into_inner).clone();
        kept_frame::kept(py, self.number, &self.picture, &contents)
    }

    /// A frame cannot be changed: its copy is itself.
    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, _memo: &Bound<'_, PyAny>) -> Bound<'py, Self> {
        slf
    }

    /// True for the same image, made with the same constants at the same place.
    fn __eq__(&self, other: &Self) -> bool {
        let (a, b) = (&self.picture, &other.picture);
        a.rgba == b.rgba
            && bytemuck::bytes_of(&a.constants) == bytemuck::bytes_of(&b.constants)
            && a.pose == b.pose
    }

    fn __repr__(&self) -> String {
        let [height, width] = self.shape();
        format!("<insonify.Frame {width} x {height}, {} lines>", self.picture.constants.scanlines)
    }
}
