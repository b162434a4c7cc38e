//! The table `sweep`.

use super::document::Document;
use super::error::SceneError;
use super::schema::SweepTable;
use super::{parameters, probe};
use crate::scene::Scene;
use crate::scene::sweep::{Parameter, Variant};

impl SweepTable {
    /// The stated values of a parameter.
    fn values(&self, parameter: Parameter) -> Option<Vec<f64>> {
        fn plain<D>(list: &Option<Vec<super::units::Quantity<D>>>) -> Option<Vec<f64>> {
            list.as_ref().map(|all| all.iter().map(|q| q.0).collect())
        }
        match parameter {
            Parameter::Frequency => plain(&self.frequency),
            Parameter::Gain => plain(&self.gain),
            Parameter::TgcAttenuation => plain(&self.tgc_attenuation),
            Parameter::DynamicRange => plain(&self.dynamic_range),
            Parameter::SpeckleGain => plain(&self.speckle_gain),
            Parameter::SurfaceGain => plain(&self.surface_gain),
            Parameter::DensityScale => self.density_scale.clone(),
            Parameter::LateralPsf => self.psf_lateral.clone(),
            Parameter::AxialPsf => self.psf_axial.clone(),
            Parameter::RoughnessScale => self.roughness_scale.clone(),
            Parameter::ThicknessScale => self.thickness_scale.clone(),
        }
    }
}

/// The variants of `scene` that the table states and, where `suggested`, those of the parameters of
/// which it says nothing.
pub(super) fn variants(
    document: &Document<'_>,
    table: &SweepTable,
    scene: &Scene,
    suggested: bool,
) -> Result<Vec<Variant>, SceneError> {
    let mut out = Vec::new();
    for parameter in Parameter::ALL {
        let around = || parameter.around(parameter.value(scene)).to_vec();
        let stated = table.values(parameter);
        let values = stated.or_else(|| suggested.then(around)).unwrap_or_default();
        for (i, value) in values.into_iter().enumerate() {
            let setting = parameter.setting(scene, value);
            let made = settled(document, parameter, value, setting).map_err(|error| {
                let (key, unit) = (parameter.key(), parameter.unit());
                let blank = if unit.is_empty() { "" } else { " " };
                document.fail(
                    &format!("sweep.{key}.{i}"),
                    format!("{key} cannot be {value}{blank}{unit}"),
                    error.remedy.unwrap_or(error.message),
                )
            })?;
            out.push(made);
        }
    }
    Ok(out)
}

/// The settings of the document with one more override: what `render` makes of it, checks included.
fn settled(
    document: &Document<'_>,
    parameter: Parameter,
    value: f64,
    setting: (String, String),
) -> Result<Variant, SceneError> {
    let source = document.source.with(std::slice::from_ref(&setting));
    let document = source.document()?;
    let file = document.parse()?;
    let (probe, _) = probe::build(&document, &file.probe)?;
    let simulation = parameters::simulation(&document, file.simulation, probe.frequency)?;
    let imaging = parameters::imaging(&document, file.imaging)?;
    Ok(Variant { parameter, value, setting, probe, simulation, imaging })
}
