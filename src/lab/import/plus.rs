//! Configurations of PLUS (`PlusDeviceSet_*.xml`): its simulator's bodies and transducer, and its transforms.
//!
//! Sources of the meanings: vtkPlusUsSimulatorAlgo, PlusSpatialModel, vtkPlusUsScanConvertLinear and
//! -Curvilinear of github.com/PlusToolkit/PlusLib. A model of higher number in the file covers those before it; one
//! without a file is everywhere. Scanlines lie in the plane of the image, whose pixels `ImageTo...` takes to mm:
//! the size of a pixel there and `OutputImageSpacingMmPerPixel`, by which the transducer is laid out in pixels, may differ.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::issue::FileError;
use crate::volume::plus::{self, Element};
use crate::volume::{Pose, Transforms};

/// Content of a configuration that a scene needs.
#[derive(Clone, Debug)]
pub struct DeviceSet {
    /// Name of the device set, where it has one.
    pub name: Option<String>,
    /// Frame of pixels.
    pub image: String,
    /// Frame that the bodies are brought to: the world of the scene.
    pub reference: String,
    /// Transforms that always hold.
    pub transforms: Transforms,
    /// Bodies, the later before the earlier.
    pub models: Vec<Model>,
    /// The transducer.
    pub transducer: Transducer,
}

/// A body.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Its name.
    pub name: String,
    /// Name of its tissue in the scene; no two models have the same.
    pub tissue: String,
    /// Its mesh; the one without is around all others.
    pub file: Option<PathBuf>,
    /// Frame of the object, the reference where none is stated.
    pub frame: Option<String>,
    /// From the mesh's coordinates to the object's.
    pub object_from_model: DAffine3,
    /// Density, g/cm3.
    pub density: f64,
    /// Speed of sound, mm/us.
    pub speed: f64,
    /// One-way attenuation at 1 MHz, dB/cm.
    pub attenuation: f64,
    /// Backscattered share of the absorbed energy.
    pub backscatter: f64,
}

/// Face and field of view, in pixels of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transducer {
    /// The face.
    pub geometry: Geometry,
    /// Middle of the face, pixels.
    pub center: DVec2,
    /// Size by which lengths are laid out in pixels, mm.
    pub spacing: DVec2,
    /// Frequency, MHz.
    pub frequency: f64,
    /// Scanlines.
    pub scanlines: u32,
    /// Samples of a scanline.
    pub samples: u32,
}

/// Shape of a face, mm and rad, in the configuration's own pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Geometry {
    Linear { width: f64, depth: f64 },
    Curvilinear { radius: f64, field_of_view: f64, depth: f64 },
}

/// A transducer in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Middle of the face, mm.
    pub position: DVec3,
    /// Depth axis: along the image's columns.
    pub direction: DVec3,
    /// Lateral axis: along its rows.
    pub lateral: DVec3,
    /// Size of its pixels in the world over that by which the transducer is laid out, along rows and columns.
    pub scale: DVec2,
}

impl Placed {
    /// From probe space (x lateral, y elevation, z depth) to the world.
    pub fn world_from_probe(&self) -> DAffine3 {
        let y = self.direction.cross(self.lateral);
        DAffine3::from_mat3_translation(
            DMat3::from_cols(self.lateral, y, self.direction),
            self.position,
        )
    }
}

impl Transducer {
    /// The transducer where `world_from_image` puts its pixels. Columns that are not at right angles to rows by a
    /// calibration's error give the depth; the rows are turned.
    pub fn placed(&self, world_from_image: &DAffine3) -> Placed {
        let DMat3 { x_axis: x, y_axis: y, .. } = world_from_image.matrix3;
        let direction = y.normalize();
        Placed {
            position: world_from_image.transform_point3(self.center.extend(0.0)),
            direction,
            lateral: x.reject_from_normalized(direction).normalize(),
            scale: DVec2::new(x.length(), y.length()) / self.spacing,
        }
    }
}

impl DeviceSet {
    /// Reads a configuration.
    ///
    /// # Errors
    /// It is no XML, has no simulator, or one without what a scene needs.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::simulated(path)?.ok_or_else(|| {
            FileError::file(
                path,
                "has no element `vtkPlusUsSimulatorAlgo`: it simulates nothing",
                "give the configuration of a device of Type=\"UsSimulator\"",
            )
        })
    }

    /// Reads a configuration; none of one without a simulator.
    ///
    /// # Errors
    /// It is no XML, or has a simulator without what a scene needs.
    pub fn simulated(path: &Path) -> Result<Option<Self>, FileError> {
        let text = plus::text(path)?;
        let document = plus::parse(path, &text)?;
        let root = Element::root(path, &document);
        let transforms = root.transforms()?;
        let mut simulators =
            ["vtkPlusUsSimulatorAlgo", "vtkUsSimulatorAlgo"].map(|name| root.named(name).next());
        let Some(simulator) = simulators.iter_mut().find_map(Option::take) else {
            return Ok(None);
        };
        // That of another device is another transducer.
        let Some(scan) = simulator.named("ScanConversion").next() else {
            return Err(
                simulator.error("has no element `ScanConversion`", "add it: the transducer")
            );
        };
        let mut names = TissueNames::default();
        let models: Result<Vec<_>, _> = simulator
            .named("SpatialModel")
            .enumerate()
            .map(|(n, found)| model(&found, n, &mut names))
            .collect();
        let own = |name: &str, otherwise: &str| {
            simulator.node.attribute(name).unwrap_or(otherwise).to_owned()
        };
        let name = root.named("DeviceSet").next().and_then(|set| set.node.attribute("Name"));
        Ok(Some(Self {
            name: name.map(str::to_owned),
            image: own("ImageCoordinateFrame", "Image"),
            reference: own("ReferenceCoordinateFrame", "Reference"),
            transforms,
            models: models?,
            transducer: transducer(&simulator, &scan)?,
        }))
    }

    /// The transform from a frame to the reference, by these poses and what always holds.
    ///
    /// # Errors
    /// The missing parts, in words.
    pub fn reference_from(
        &self,
        frame: &str,
        poses: &BTreeMap<String, Pose>,
    ) -> Result<DAffine3, String> {
        match self.transforms.between(poses, frame, &self.reference) {
            Some(Some(found)) => Ok(found),
            Some(None) => {
                Err(format!("a pose between `{frame}` and `{}` is not OK", self.reference))
            }
            None => Err(format!("nothing leads from `{frame}` to `{}`", self.reference)),
        }
    }
}

/// The transforms of the `CoordinateDefinitions` of a configuration, whatever else it has.
///
/// # Errors
/// It is no XML, or has a matrix that is none.
pub fn definitions(path: &Path) -> Result<Transforms, FileError> {
    let text = plus::text(path)?;
    Element::root(path, &plus::parse(path, &text)?).transforms()
}

/// N numbers in a range, where the attribute is there.
fn numbers<const N: usize>(
    element: &Element,
    name: &str,
    range: RangeInclusive<f64>,
) -> Result<Option<[f64; N]>, FileError> {
    let values = element.numbers::<f64, N>(name)?;
    if values.iter().flatten().all(|x| range.contains(x)) {
        return Ok(values);
    }
    let remedy = format!("write {N} numbers from {} to {}", range.start(), range.end());
    Err(element.wrong(name, "out of range", &remedy))
}

fn number(
    element: &Element,
    name: &str,
    otherwise: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, FileError> {
    Ok(numbers::<1>(element, name, range)?.map_or(otherwise, |[v]| v))
}

fn length(element: &Element, name: &str) -> Result<f64, FileError> {
    element.need(name)?;
    number(element, name, 0.0, 0.01..=1000.0)
}

/// Names of tissues that are taken, and how often each was wanted.
#[derive(Default)]
struct TissueNames {
    taken: HashSet<String>,
    wanted: HashMap<String, usize>,
}

impl TissueNames {
    /// A name for the tissue of a model.
    fn add(&mut self, model: &str) -> String {
        let letters = model.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
        let own = format!("plus_{}", letters.collect::<String>().to_lowercase());
        let count = self.wanted.entry(own.clone()).or_default();
        loop {
            *count += 1;
            let name = if *count == 1 { own.clone() } else { format!("{own}_{count}") };
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }
}

/// PLUS's own values where none is given.
fn model(element: &Element, n: usize, names: &mut TissueNames) -> Result<Model, FileError> {
    let own = |name: &str| element.node.attribute(name).filter(|v| !v.is_empty());
    let name = own("Name").map_or_else(|| format!("model {}", n + 1), str::to_owned);
    Ok(Model {
        tissue: names.add(&name),
        name,
        file: own("ModelFile").map(PathBuf::from),
        frame: own("ObjectCoordinateFrame").map(str::to_owned),
        object_from_model: element.matrix("ModelToObjectTransform")?.unwrap_or(DAffine3::IDENTITY),
        density: number(element, "DensityKgPerM3", 910.0, 0.1..=25_000.0)? / 1000.0,
        speed: number(element, "SoundVelocityMPerSec", 1540.0, 100.0..=10_000.0)? / 1000.0,
        attenuation: number(element, "AttenuationCoefficientDbPerCmMhz", 0.65, 0.0..=1000.0)?,
        backscatter: number(element, "BackscatterDiffuseReflectionCoefficient", 0.1, 0.0..=1e6)?,
    })
}

fn transducer(simulator: &Element, scan: &Element) -> Result<Transducer, FileError> {
    let kind = scan.need("TransducerGeometry")?;
    let geometry = match kind.to_ascii_uppercase().as_str() {
        "LINEAR" => Geometry::Linear {
            width: length(scan, "TransducerWidthMm")?,
            depth: length(scan, "ImagingDepthMm")?,
        },
        "CURVILINEAR" => {
            let angle = |name| {
                scan.need(name)?;
                number(scan, name, 0.0, -90.0..=90.0)
            };
            let (radius, stop) = (length(scan, "RadiusStartMm")?, length(scan, "RadiusStopMm")?);
            let (from, to) = (angle("ThetaStartDeg")?, angle("ThetaStopDeg")?);
            if stop <= radius || to <= from {
                return Err(scan.error("its radii or angles do not grow", "correct them"));
            }
            if (from + to).abs() > 1e-6 {
                let cause =
                    format!("its sector is not even about the middle: {from} to {to} degrees");
                return Err(scan.error(cause, "insonify has sectors from -a to a; set them so"));
            }
            let field_of_view = (to - from).to_radians();
            Geometry::Curvilinear { radius, field_of_view, depth: stop - radius }
        }
        _ => {
            let cause = format!("`TransducerGeometry` is `{kind}`");
            return Err(scan.error(cause, "write LINEAR or CURVILINEAR"));
        }
    };
    scan.need("TransducerCenterPixel")?;
    scan.need("OutputImageSpacingMmPerPixel")?;
    let center = numbers::<2>(scan, "TransducerCenterPixel", -1e5..=1e5)?.unwrap_or_default();
    let spacing = numbers::<2>(scan, "OutputImageSpacingMmPerPixel", 1e-4..=100.0)?;
    Ok(Transducer {
        geometry,
        center: center.into(),
        spacing: spacing.unwrap_or([1.0; 2]).into(),
        frequency: number(simulator, "FrequencyMhz", 2.5, 0.1..=100.0)?,
        scanlines: number(simulator, "NumberOfScanlines", 256.0, 1.0..=4096.0)? as u32,
        samples: number(simulator, "NumberOfSamplesPerScanline", 1000.0, 16.0..=65_536.0)? as u32,
    })
}
