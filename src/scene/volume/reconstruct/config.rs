//! Settings and calibration from a configuration of PLUS (`PlusDeviceSet_*.xml`).

use std::path::Path;

use glam::DVec3;

use super::poses::Transforms;
use super::{Compounding, Fan, Filling, Interpolation, Settings};
use crate::issue::FileError;
use crate::volume::plus::{self, Element};

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

impl Config {
    /// Reads a configuration.
    ///
    /// # Errors
    /// It is no XML, lacks `VolumeReconstruction`, or asks for a method that this program lacks.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = plus::text(path)?;
        let document = plus::parse(path, &text)?;
        let root = Element::root(path, &document);
        let transforms = root.transforms()?;
        let Some(element) = root.named("VolumeReconstruction").next() else {
            return Err(FileError::file(
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

fn settings(element: &Element) -> Result<Settings, FileError> {
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
    let holes = element.named("HoleFillingElement").filter(|_| fill == Some(true));
    out.holes = holes.map(|e| filling(&e)).collect::<Result<_, _>>()?;
    Ok(out)
}

fn fan(element: &Element) -> Result<Option<Fan>, FileError> {
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

fn filling(element: &Element) -> Result<Filling, FileError> {
    let integer = |name: &str| {
        element.need(name)?;
        let value = element.numbers::<usize, 1>(name)?;
        // A larger hole is no hole, and filling it takes hours.
        let value = value.map(|[v]| v).filter(|v| (1..=99).contains(v));
        value.ok_or_else(|| element.wrong(name, "out of range", "write a number from 1 to 99"))
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
