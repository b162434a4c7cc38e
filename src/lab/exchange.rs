//! Frames in the formats of others: what files of zea and of UFF hold of them; the probe in the terms of DICOM.

use std::path::Path;

use glam::{DAffine3, DQuat};

use crate::output::dicom::Transducer;
use crate::output::picture::grey;
use crate::output::{uff, zea};
use crate::probe::{Probe, ProbeKind};
use crate::scene::Scene;
use crate::sim::labels::{LabelArray, LabelValues};
use crate::sim::layout::{self, NONE};
use crate::sim::{SimError, Simulator};

/// Class of a pixel that has none.
pub use crate::output::indexed::NOTHING;

/// Most numbers that a file may hold, bytes: they are in memory until it is written.
pub const MOST_BYTES: u64 = 4 << 30;

/// A format of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Files of zea (HDF5): images, segmentation, poses, baseband, radio frequency.
    Zea,
    /// Files of UFF (HDF5): baseband and radio frequency on their scans.
    Uff,
}

impl Format {
    /// The format that a file's name asks for by its extension; none for other extensions.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_lowercase().as_str() {
            "hdf5" | "h5" => Some(Self::Zea),
            "uff" => Some(Self::Uff),
            _ => None,
        }
    }
}

/// Frames of one probe. Arrays hold all of them, one after the other; what is empty is left out of files.
pub struct Frames {
    /// What they are, in words.
    pub about: String,
    /// The anatomy.
    pub subject: String,
    /// The probe.
    pub probe: Probe,
    /// Width and height of the images, pixels.
    pub size: [u32; 2],
    /// Left upper corner of the images in the probe's plane, mm.
    pub corner: [f64; 2],
    /// Edge of a pixel, mm.
    pub pixel: f64,
    /// Names of the classes of the segmentation.
    pub classes: Vec<String>,
    /// World from probe of each frame, mm.
    pub poses: Vec<DAffine3>,
    /// Time of each frame, s, increasing.
    pub times: Vec<f64>,
    /// Grey level of each pixel, row by row.
    pub images: Vec<u8>,
    /// Class of each pixel, row by row; [`NOTHING`]: none.
    pub segmentation: Vec<u8>,
    /// Labels of the pixels; the shape of an array is that of one frame.
    pub labels: Vec<LabelArray>,
    /// Envelope, [scanline, sample].
    pub envelope: Vec<f32>,
    /// Complex pairs of the baseband, [scanline, sample].
    pub iq: Vec<f32>,
    /// Radio-frequency lines, [scanline, sample]: several samples to each axial one.
    pub rf: Vec<f32>,
}

impl Frames {
    /// No frames yet, of this probe and with images of these constants.
    pub fn new(about: String, subject: String, probe: &Probe, frame: &layout::Frame) -> Self {
        Self {
            about,
            subject,
            probe: probe.clone(),
            size: [frame.image_width, frame.image_height],
            corner: [frame.image_left, frame.image_top].map(f64::from),
            pixel: f64::from(frame.pixel_pitch),
            classes: Vec::new(),
            poses: Vec::new(),
            times: Vec::new(),
            images: Vec::new(),
            segmentation: Vec::new(),
            labels: Vec::new(),
            envelope: Vec::new(),
            iq: Vec::new(),
            rf: Vec::new(),
        }
    }

    /// Adds the last frame of a simulator: of an image everything for zea, baseband and radio frequency for UFF.
    ///
    /// # Errors
    /// An error of the device.
    ///
    /// # Panics
    /// When its image has another size than those before.
    pub fn add(
        &mut self,
        format: Format,
        simulator: &mut Simulator,
        scene: &Scene,
        time: f64,
    ) -> Result<(), SimError> {
        self.poses.push(scene.world_from_probe);
        self.times.push(time);
        self.iq.extend(simulator.iq()?);
        self.rf.extend(simulator.rf(&scene.probe)?.1);
        if format == Format::Uff {
            return Ok(());
        }
        let (width, height, rgba) = simulator.pixels()?;
        assert_eq!([width, height], self.size, "frames of one size");
        self.images.extend(grey(&rgba));
        self.envelope.extend(simulator.envelope()?);
        let Some(labels) = simulator.labels()? else { return Ok(()) };
        self.classes = scene.tissues.iter().map(|tissue| tissue.name.clone()).collect();
        let class = |tissue| if tissue == NONE { NOTHING } else { tissue as u8 };
        self.segmentation.extend(labels.pixels.labels.iter().map(|label| class(label.tissue)));
        for array in labels.pixels.arrays() {
            self.extend(array);
        }
        Ok(())
    }

    /// Adds a frame's values of a kind of labels.
    fn extend(&mut self, more: LabelArray) {
        let known = self.labels.iter_mut().find(|array| array.kind == more.kind);
        match (known.map(|array| &mut array.values), more.values) {
            (Some(LabelValues::Indices(all)), LabelValues::Indices(new)) => all.extend(new),
            (Some(LabelValues::Quantities(all)), LabelValues::Quantities(new)) => all.extend(new),
            (_, values) => self.labels.push(LabelArray { values, ..more }),
        }
    }

    /// Memory of all numbers that a file has of them, bytes.
    pub fn held(&self) -> u64 {
        let of_labels = |array: &LabelArray| match &array.values {
            LabelValues::Indices(values) => values.len(),
            LabelValues::Quantities(values) => values.len(),
        };
        let words = self.envelope.len() + self.iq.len() + self.rf.len();
        let words = words + self.labels.iter().map(of_labels).sum::<usize>();
        (4 * words + self.images.len() + self.segmentation.len() * self.classes.len()) as u64
    }

    /// The file in a format.
    ///
    /// # Panics
    /// When arrays are not of as many frames as there are poses.
    pub fn bytes(&self, format: Format) -> Vec<u8> {
        match format {
            Format::Zea => self.zea(),
            Format::Uff => self.uff(),
        }
    }

    fn zea(&self) -> Vec<u8> {
        let places = places(&self.probe, 1);
        let (_, fine) = self.fine();
        let first = self.times[0];
        let maps: Vec<zea::Map<'_>> = self.labels.iter().map(map).collect();
        zea::bytes(&zea::Frames {
            description: &self.about,
            subject: &self.subject,
            times: &self.times.iter().map(|time| time - first).collect::<Vec<_>>(),
            positions: &self.poses.iter().map(|p| p.translation.to_array()).collect::<Vec<_>>(),
            rotations: &self.poses.iter().map(wxyz).collect::<Vec<_>>(),
            size: self.size,
            corner: self.corner,
            pixel: self.pixel,
            images: &self.images,
            segmentation: given(&self.segmentation),
            classes: &self.classes,
            maps: &maps,
            lines: zea::Lines {
                shape: [self.probe.scanlines as usize, self.probe.samples as usize],
                places: &places,
                frequency: self.probe.frequency,
                speed: self.probe.speed,
                envelope: given(&self.envelope),
                iq: given(&self.iq),
                rf: given(&self.rf).map(|rf| (rf, &fine[..])),
            },
        })
    }

    fn uff(&self) -> Vec<u8> {
        let places = places(&self.probe, 1);
        let (factor, fine) = self.fine();
        let (count, pitch) = (self.probe.samples as usize, self.probe.sample_pitch());
        uff::bytes(&uff::Frames {
            name: &self.about,
            axes: axes(&self.probe),
            frames: self.poses.len(),
            frequency: self.probe.frequency,
            speed: self.probe.speed,
            iq: given(&self.iq).map(|values| uff::Samples {
                count,
                pitch,
                places: &places,
                values,
            }),
            rf: given(&self.rf).map(|values| uff::Samples {
                count: count * factor,
                pitch: pitch / factor as f64,
                places: &fine,
                values,
            }),
        })
    }

    /// Samples of the radio-frequency lines to each axial one, and their places.
    fn fine(&self) -> (usize, Vec<[f64; 2]>) {
        let axial = self.poses.len() * self.probe.scanlines as usize * self.probe.samples as usize;
        let factor = self.rf.len() / axial.max(1);
        (factor, places(&self.probe, factor as u32))
    }
}

/// Shape of the probe in the terms of DICOM.
pub fn transducer(probe: &Probe) -> Transducer {
    match probe.kind {
        ProbeKind::Convex { .. } => Transducer::Curved,
        ProbeKind::Linear { .. } => Transducer::Linear,
        ProbeKind::Phased { .. } => Transducer::Phased,
    }
}

/// None of an empty array.
fn given<T>(array: &[T]) -> Option<&[T]> {
    (!array.is_empty()).then_some(array)
}

fn map(array: &LabelArray) -> zea::Map<'_> {
    zea::Map {
        name: array.kind.name,
        unit: array.kind.unit,
        meaning: array.kind.meaning,
        parts: array.kind.parts(),
        values: match &array.values {
            LabelValues::Indices(values) => zea::Values::Indices(values),
            LabelValues::Quantities(values) => zea::Values::Quantities(values),
        },
    }
}

/// The rotation as a quaternion whose real part comes first and is not below 0.
pub fn wxyz(place: &DAffine3) -> [f64; 4] {
    let q = DQuat::from_mat3(&place.matrix3).normalize();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.x, q.y, q.z].map(|v| sign * v)
}

/// Place across the face of each scanline, from -1/2 to 1/2.
fn across(probe: &Probe) -> impl Iterator<Item = f64> {
    let count = probe.scanlines;
    (0..count).map(move |l| (f64::from(l) + 0.5) / f64::from(count) - 0.5)
}

fn axes(probe: &Probe) -> uff::Axes {
    match probe.kind {
        ProbeKind::Linear { width } => {
            uff::Axes::Linear(across(probe).map(|u| width * u).collect())
        }
        ProbeKind::Convex { radius, field_of_view } => {
            uff::Axes::Sector(radius, across(probe).map(|u| field_of_view * u).collect())
        }
        ProbeKind::Phased { field_of_view } => {
            uff::Axes::Sector(0.0, across(probe).map(|u| field_of_view * u).collect())
        }
    }
}

/// Lateral place and depth of each sample, mm, line by line; `factor` of them to each axial sample.
fn places(probe: &Probe, factor: u32) -> Vec<[f64; 2]> {
    let samples = probe.samples * factor;
    let pitch = probe.sample_pitch() / f64::from(factor.max(1));
    let line = |u: f64| {
        // Sine and cosine that are the same on every machine.
        let fan = |radius: f64, view: f64| {
            let (sin, cos) = (libm::sin(view * u), libm::cos(view * u));
            ([radius * sin, radius * cos - radius], [sin, cos])
        };
        match probe.kind {
            ProbeKind::Linear { width } => ([width * u, 0.0], [0.0, 1.0]),
            ProbeKind::Convex { radius, field_of_view } => fan(radius, field_of_view),
            ProbeKind::Phased { field_of_view } => fan(0.0, field_of_view),
        }
    };
    across(probe)
        .flat_map(|u| {
            let ([x, z], [dx, dz]) = line(u);
            (0..samples).map(move |k| f64::from(k) * pitch).map(move |t| [x + t * dx, z + t * dz])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_along_the_rays_of_the_probe() {
        for probe in [Probe::linear(), Probe::abdominal(), Probe::phased()] {
            for factor in [1, 3] {
                let places = places(&probe, factor);
                let samples = probe.samples * factor;
                for (line, sample) in [(0, 0), (7, 100), (probe.scanlines - 1, samples - 1)] {
                    let (origin, direction) = probe.ray(line, 0);
                    let way = f64::from(sample) / f64::from(factor) * probe.sample_pitch();
                    let at = origin + direction * way;
                    let [x, z] = places[(line * samples + sample) as usize];
                    assert!((x - at.x).abs() < 1e-9 && (z - at.z).abs() < 1e-9, "{:?}", probe.kind);
                }
            }
        }
    }

    #[test]
    fn a_files_name_says_its_format() {
        for (name, format) in [
            ("a.uff", Some(Format::Uff)),
            ("a.HDF5", Some(Format::Zea)),
            ("a.h5", Some(Format::Zea)),
            ("a.png", None),
            ("uff", None),
        ] {
            assert_eq!(Format::of(Path::new(name)), format, "{name}");
        }
    }
}
