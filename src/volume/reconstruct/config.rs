//! Settings and calibration from a configuration of PLUS (`PlusDeviceSet_*.xml`).

use std::path::Path;
use std::str::FromStr;

use glam::DVec3;
use roxmltree::{Document, Node};

use super::poses::Transforms;
use super::{Compounding, Fan, Filling, Interpolation, Settings};
use crate::volume::error::VolumeError;
use crate::volume::sequence::frames;
use crate::volume::source;

/// Longest configuration, bytes.
const MAX_CONFIG: u64 = 4 << 20;

/// Content of a configuration for a reconstruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Its `CoordinateDefinitions`.
    pub transforms: Transforms,
    /// Its `VolumeReconstruction`.
    pub settings: Settings,
    /// Name of the frame of pixels.
    pub image: Option<String>,
    /// Name of the frame of the volume.
    pub reference: Option<String>,
}

/// An element and its file.
struct Element<'d, 'p> {
    node: Node<'d, 'd>,
    path: &'p Path,
}

impl Config {
    /// Reads a configuration.
    ///
    /// # Errors
    /// It is no XML, lacks `VolumeReconstruction`, or asks for a method that this program lacks.
    pub fn load(path: &Path) -> Result<Self, VolumeError> {
        let bytes = source::prefix(path, MAX_CONFIG)?;
        let text = String::from_utf8_lossy(&bytes);
        let document = Document::parse(&text).map_err(|e| {
            let line = e.pos().row as usize;
            VolumeError::line(path, line, format!("is no XML: {e}"), "correct it")
        })?;
        let named = |name: &'static str| {
            let nodes = document.descendants().filter(move |n| n.has_tag_name(name));
            nodes.map(|node| Element { node, path })
        };
        let mut transforms = Transforms::default();
        for element in named("Transform") {
            // Transforms in other parts of a configuration have no matrix.
            if let Some(matrix) = element.node.attribute("Matrix") {
                let matrix = frames::matrix(matrix)
                    .map_err(|cause| element.error("Matrix", cause, "write 16 numbers"))?;
                transforms.add(element.need("From")?, element.need("To")?, matrix);
            }
        }
        let Some(element) = named("VolumeReconstruction").next() else {
            return Err(VolumeError::file(
                path,
                "has no element `VolumeReconstruction`",
                "add it with at least OutputSpacing",
            ));
        };
        let own = |name: &str| element.node.attribute(name).map(str::to_owned);
        Ok(Self {
            transforms,
            settings: settings(&element)?,
            image: own("ImageCoordinateFrame"),
            reference: own("ReferenceCoordinateFrame"),
        })
    }
}

impl Element<'_, '_> {
    fn error(&self, name: &str, cause: &str, remedy: &str) -> VolumeError {
        let line = self.node.document().text_pos_at(self.node.range().start).row;
        let value = self.node.attribute(name).unwrap_or_default();
        let value: String = value.chars().take(60).collect();
        let message = format!("`{name}` is `{value}`: {cause}");
        VolumeError::line(self.path, line as usize, message, remedy)
    }

    fn need(&self, name: &str) -> Result<&str, VolumeError> {
        let missing = || self.error(name, "it is missing", "add it");
        self.node.attribute(name).ok_or_else(missing)
    }

    /// N numbers, where the attribute is there.
    fn numbers<T: FromStr, const N: usize>(
        &self,
        name: &str,
    ) -> Result<Option<[T; N]>, VolumeError> {
        let Some(text) = self.node.attribute(name) else {
            return Ok(None);
        };
        let values: Option<Vec<T>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
        let values = values.and_then(|v| <[T; N]>::try_from(v).ok());
        match values {
            Some(values) => Ok(Some(values)),
            None => Err(self.error(name, "does not fit", &format!("write {N} numbers"))),
        }
    }

    /// The value of a word, where the attribute is there.
    fn choice<T: Copy>(&self, name: &str, known: &[(&str, T)]) -> Result<Option<T>, VolumeError> {
        let Some(word) = self.node.attribute(name) else {
            return Ok(None);
        };
        let found = known.iter().find(|(w, _)| w.eq_ignore_ascii_case(word));
        let words: Vec<_> = known.iter().map(|(w, _)| *w).collect();
        let remedy = format!("write one of {}", words.join(", "));
        let value = found.ok_or_else(|| self.error(name, "cannot be done", &remedy))?;
        Ok(Some(value.1))
    }
}

fn settings(element: &Element) -> Result<Settings, VolumeError> {
    element.need("OutputSpacing")?;
    let spacing = element.numbers("OutputSpacing")?.map(DVec3::from_array);
    let mut out = Settings::new(spacing.unwrap_or(DVec3::ONE));
    let modes = [("NEAREST_NEIGHBOR", Interpolation::Nearest), ("LINEAR", Interpolation::Linear)];
    if let Some(mode) = element.choice("Interpolation", &modes)? {
        out.interpolation = mode;
    }
    let modes = [
        ("MEAN", Compounding::Mean),
        ("MAXIMUM", Compounding::Maximum),
        ("LATEST", Compounding::Latest),
    ];
    if let Some(mode) = element.choice("CompoundingMode", &modes)? {
        out.compounding = mode;
    }
    let origin = element.numbers::<f64, 3>("OutputOrigin")?;
    let extent = element.numbers::<i32, 6>("OutputExtent")?;
    out.lattice = match (origin, extent) {
        (Some(origin), Some([x0, x1, y0, y1, z0, z1])) => {
            let size = [(x0, x1), (y0, y1), (z0, z1)].map(|(a, b)| i64::from(b) - i64::from(a) + 1);
            let first = DVec3::new(f64::from(x0), f64::from(y0), f64::from(z0));
            let size = size.map(|n| usize::try_from(n).unwrap_or(0));
            Some((DVec3::from(origin) + first * out.spacing, size))
        }
        _ => None,
    };
    let clip = element.numbers::<i32, 2>("ClipRectangleOrigin")?;
    let clip = clip.zip(element.numbers("ClipRectangleSize")?);
    out.clip = clip.filter(|(_, [w, h])| *w > 0 && *h > 0).map(|([x, y], [w, h])| [x, y, w, h]);
    out.fan = fan(element)?;
    out.reject_below = element.numbers("PixelRejectionThreshold")?.map(|[v]: [f64; 1]| v);
    out.every = element.numbers("SkipInterval")?.map_or(1, |[n]: [usize; 1]| n.max(1));
    element.choice("EnableFanAnglesAutoDetect", &[("FALSE", ())])?;
    let fill = element.choice("FillHoles", &[("ON", true), ("OFF", false)])?;
    out.holes = Vec::new();
    if fill == Some(true) {
        let nodes = element.node.descendants();
        for node in nodes.filter(|n| n.has_tag_name("HoleFillingElement")) {
            let element = Element { node, path: element.path };
            out.holes.push(filling(&element)?);
        }
    }
    Ok(out)
}

fn fan(element: &Element) -> Result<Option<Fan>, VolumeError> {
    let Some(angles) = element.numbers::<f64, 2>("FanAnglesDeg")? else {
        return Ok(None);
    };
    if angles == [0.0, 0.0] {
        return Ok(None);
    }
    let radius = |name: &str, otherwise: f64| {
        let value = element.numbers::<f64, 1>(name)?;
        Ok(value.map_or(otherwise, |[v]| v))
    };
    Ok(Some(Fan {
        origin: element.numbers("FanOriginPixel")?.unwrap_or([0.0; 2]),
        angles: [angles[0].min(angles[1]), angles[0].max(angles[1])],
        // PLUS's own values where none is given.
        radii: [radius("FanRadiusStartPixel", 0.0)?, radius("FanRadiusStopPixel", 500.0)?],
    }))
}

fn filling(element: &Element) -> Result<Filling, VolumeError> {
    let integer = |name: &str| {
        element.need(name)?;
        let value = element.numbers::<usize, 1>(name)?;
        // A larger hole is no hole, and filling it takes hours.
        let value = value.map(|[v]| v).filter(|v| (1..=99).contains(v));
        value.ok_or_else(|| element.error(name, "out of range", "write a number from 1 to 99"))
    };
    element.need("Type")?;
    let kinds = [("STICK", true), ("NEAREST_NEIGHBOR", false)];
    if element.choice("Type", &kinds)? == Some(true) {
        return Ok(Filling::Stick {
            length: integer("StickLengthLimit")?,
            count: integer("NumberOfSticksToUse")?,
        });
    }
    element.need("MinimumKnownVoxelsRatio")?;
    let share = element.numbers::<f64, 1>("MinimumKnownVoxelsRatio")?;
    Ok(Filling::Nearest { size: integer("Size")?, share: share.map_or(0.0, |[v]| v) })
}
