//! Configurations of PLUS (`PlusDeviceSet_*.xml`): its simulator's bodies and transducer, and its transforms.
//!
//! Sources of the meanings: vtkPlusUsSimulatorAlgo, PlusSpatialModel, vtkPlusUsScanConvertLinear and
//! -Curvilinear of github.com/PlusToolkit/PlusLib. A model of higher number in the file covers those before it; one
//! without a file is everywhere. Scanlines lie in the plane of the image, whose pixels `ImageTo...` takes to mm:
//! the size of a pixel there and `OutputImageSpacingMmPerPixel`, by which the transducer is laid out in pixels, may differ.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec2, DVec3};
use roxmltree::{Document, Node};

use super::error::ImportError;
use crate::volume::{Pose, Transforms, transform};

/// Longest configuration, bytes.
const MAX_CONFIG: u64 = 4 << 20;

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
    pub fn load(path: &Path) -> Result<Self, ImportError> {
        let text = text(path)?;
        let document = Document::parse(&text).map_err(|e| {
            let line = e.pos().row as usize;
            ImportError::line(path, line, format!("is no XML: {e}"), "correct it")
        })?;
        let find = |names: &[&str]| {
            let node =
                document.descendants().find(|n| names.iter().any(|name| n.has_tag_name(*name)));
            node.map(|node| Element { node, path })
        };
        let transforms = transforms(&document, path)?;
        let Some(simulator) = find(&["vtkPlusUsSimulatorAlgo", "vtkUsSimulatorAlgo"]) else {
            return Err(ImportError::file(
                path,
                "has no element `vtkPlusUsSimulatorAlgo`: it simulates nothing",
                "give the configuration of a device of Type=\"UsSimulator\"",
            ));
        };
        let Some(scan) = find(&["ScanConversion"]) else {
            return Err(
                simulator.error("has no element `ScanConversion`", "add it: the transducer")
            );
        };
        let nodes = simulator.node.children().filter(|n| n.has_tag_name("SpatialModel"));
        let models: Result<Vec<_>, _> =
            nodes.enumerate().map(|(n, node)| model(&Element { node, path }, n)).collect();
        let own = |name: &str, otherwise: &str| {
            simulator.node.attribute(name).unwrap_or(otherwise).to_owned()
        };
        let set = document.descendants().find(|n| n.has_tag_name("DeviceSet"));
        Ok(Self {
            name: set.and_then(|n| n.attribute("Name")).map(str::to_owned),
            image: own("ImageCoordinateFrame", "Image"),
            reference: own("ReferenceCoordinateFrame", "Reference"),
            transforms,
            models: models?,
            transducer: transducer(&simulator, &scan)?,
        })
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
pub fn definitions(path: &Path) -> Result<Transforms, ImportError> {
    let text = text(path)?;
    let document = Document::parse(&text).map_err(|e| {
        let line = e.pos().row as usize;
        ImportError::line(path, line, format!("is no XML: {e}"), "correct it")
    })?;
    transforms(&document, path)
}

fn text(path: &Path) -> Result<String, ImportError> {
    let fail = |e: std::io::Error| {
        ImportError::file(path, format!("cannot be read: {e}"), "check the path")
    };
    if !std::fs::metadata(path).map_err(fail)?.is_file() {
        return Err(ImportError::file(path, "is not an ordinary file", "give a file"));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(fail)?;
    file.take(MAX_CONFIG + 1).read_to_end(&mut bytes).map_err(fail)?;
    if bytes.len() as u64 > MAX_CONFIG {
        let message = format!("is larger than {} MB", MAX_CONFIG >> 20);
        return Err(ImportError::file(path, message, "give a configuration of PLUS"));
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

fn transforms(document: &Document, path: &Path) -> Result<Transforms, ImportError> {
    let mut out = Transforms::default();
    for node in document.descendants().filter(|n| n.has_tag_name("Transform")) {
        let element = Element { node, path };
        // Transforms in other parts of a configuration have no matrix.
        if let Some(matrix) = element.matrix("Matrix")? {
            out.add(element.need("From")?, element.need("To")?, matrix);
        }
    }
    Ok(out)
}

struct Element<'d, 'p> {
    node: Node<'d, 'd>,
    path: &'p Path,
}

impl Element<'_, '_> {
    fn error(&self, message: impl Into<String>, remedy: &str) -> ImportError {
        let line = self.node.document().text_pos_at(self.node.range().start).row as usize;
        let message = format!("`{}`: {}", self.node.tag_name().name(), message.into());
        ImportError::line(self.path, line, message, remedy)
    }

    fn need(&self, name: &str) -> Result<&str, ImportError> {
        self.node.attribute(name).ok_or_else(|| self.error(format!("lacks `{name}`"), "add it"))
    }

    fn matrix(&self, name: &str) -> Result<Option<DAffine3>, ImportError> {
        let Some(text) = self.node.attribute(name) else { return Ok(None) };
        let matrix = transform(text).map_err(|cause| {
            self.error(format!("`{name}` {cause}"), "write 16 numbers, row by row")
        })?;
        if matrix.matrix3.determinant().abs() < 1e-12 {
            return Err(self.error(format!("`{name}` is singular"), "correct it"));
        }
        Ok(Some(matrix))
    }

    /// N numbers in a range, where the attribute is there.
    fn numbers<const N: usize>(
        &self,
        name: &str,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<Option<[f64; N]>, ImportError> {
        let Some(text) = self.node.attribute(name) else { return Ok(None) };
        let values: Option<Vec<f64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
        let values = values.and_then(|v| <[f64; N]>::try_from(v).ok());
        match values.filter(|v| v.iter().all(|x| range.contains(x))) {
            Some(values) => Ok(Some(values)),
            None => {
                let text: String = text.chars().take(60).collect();
                let remedy = format!("write {N} numbers from {} to {}", range.start(), range.end());
                Err(self.error(format!("`{name}` is `{text}`"), &remedy))
            }
        }
    }

    fn number(
        &self,
        name: &str,
        otherwise: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<f64, ImportError> {
        Ok(self.numbers::<1>(name, range)?.map_or(otherwise, |[v]| v))
    }

    fn length(&self, name: &str) -> Result<f64, ImportError> {
        self.need(name)?;
        self.number(name, 0.0, 0.01..=1000.0)
    }
}

/// PLUS's own values where none is given.
fn model(element: &Element, number: usize) -> Result<Model, ImportError> {
    let own = |name: &str| element.node.attribute(name).filter(|v| !v.is_empty());
    Ok(Model {
        name: own("Name").map_or_else(|| format!("model {}", number + 1), str::to_owned),
        file: own("ModelFile").map(PathBuf::from),
        frame: own("ObjectCoordinateFrame").map(str::to_owned),
        object_from_model: element.matrix("ModelToObjectTransform")?.unwrap_or(DAffine3::IDENTITY),
        density: element.number("DensityKgPerM3", 910.0, 0.1..=25_000.0)? / 1000.0,
        speed: element.number("SoundVelocityMPerSec", 1540.0, 100.0..=10_000.0)? / 1000.0,
        attenuation: element.number("AttenuationCoefficientDbPerCmMhz", 0.65, 0.0..=1000.0)?,
        backscatter: element.number("BackscatterDiffuseReflectionCoefficient", 0.1, 0.0..=1e6)?,
    })
}

fn transducer(simulator: &Element, scan: &Element) -> Result<Transducer, ImportError> {
    let kind = scan.need("TransducerGeometry")?;
    let geometry = match kind.to_ascii_uppercase().as_str() {
        "LINEAR" => Geometry::Linear {
            width: scan.length("TransducerWidthMm")?,
            depth: scan.length("ImagingDepthMm")?,
        },
        "CURVILINEAR" => {
            let angle = |name| {
                scan.need(name)?;
                scan.number(name, 0.0, -90.0..=90.0)
            };
            let (radius, stop) = (scan.length("RadiusStartMm")?, scan.length("RadiusStopMm")?);
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
    let center = scan.numbers::<2>("TransducerCenterPixel", -1e5..=1e5)?.unwrap_or_default();
    let spacing = scan.numbers::<2>("OutputImageSpacingMmPerPixel", 1e-4..=100.0)?;
    Ok(Transducer {
        geometry,
        center: center.into(),
        spacing: spacing.unwrap_or([1.0; 2]).into(),
        frequency: simulator.number("FrequencyMhz", 2.5, 0.1..=100.0)?,
        scanlines: simulator.number("NumberOfScanlines", 256.0, 1.0..=4096.0)? as u32,
        samples: simulator.number("NumberOfSamplesPerScanline", 1000.0, 16.0..=65_536.0)? as u32,
    })
}
