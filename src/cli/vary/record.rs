//! The table of a contact sheet: identity and brightness of each image.

use std::path::Path;

use miette::{Context, IntoDiagnostic, Result};
use serde::Serialize;

use super::pictures::Picture;
use insonify::output::files::Draft;

/// One row. Columns are named as the fields.
#[derive(Debug, Serialize)]
pub struct Record {
    /// Number on the contact sheet, from 1.
    pub image: usize,
    /// Changed parameter; `none` in the image of the scene itself.
    pub parameter: String,
    /// Its value here.
    pub value: String,
    /// Its value in the scene.
    pub own: String,
    /// Unit of both; empty for factors and names.
    pub unit: &'static str,
    /// Values for `--set`, blanks between: `insonify render SCENE --set ...` is the same image.
    pub set: String,
    /// The single image, beside the table; empty where none was written.
    pub file: String,
    /// Left upper corner of the image on the contact sheet, px.
    pub x: u32,
    /// Left upper corner of the image on the contact sheet, px.
    pub y: u32,
    /// Size, px.
    pub width: u32,
    /// Size, px.
    pub height: u32,
    /// Mean grey level of the sector, 0 to 255.
    pub mean_grey: f64,
    /// Standard deviation of the sector's grey levels.
    pub sd_grey: f64,
    /// Share of the sector that is black (0), percent.
    pub black_percent: f64,
    /// Share of the sector that is white (255), percent.
    pub white_percent: f64,
}

impl Record {
    /// The row of one picture.
    pub fn new(image: usize, picture: &Picture, place: [u32; 2], file: Option<String>) -> Self {
        let grey = &picture.grey;
        let entries = picture.settings.iter();
        let set: Vec<String> = entries.map(|(path, value)| format!("{path}={value}")).collect();
        let three = |x: f64| (x * 1000.0).round() / 1000.0;
        Self {
            image,
            parameter: picture.parameter.clone(),
            value: picture.value.clone(),
            own: picture.own.clone(),
            unit: picture.unit,
            set: set.join(" "),
            file: file.unwrap_or_default(),
            x: place[0],
            y: place[1],
            width: picture.image.width(),
            height: picture.image.height(),
            mean_grey: three(grey.mean),
            sd_grey: three(grey.deviation),
            black_percent: three(100.0 * grey.black),
            white_percent: three(100.0 * grey.white),
        }
    }
}

/// Writes the table as CSV with a header.
pub fn write(path: &Path, records: &[Record]) -> Result<()> {
    let whole = || -> Result<(), csv::Error> {
        let mut writer = csv::Writer::from_writer(Draft::new(path)?);
        for record in records {
            writer.serialize(record)?;
        }
        let draft = writer.into_inner().map_err(|e| e.into_error())?;
        Ok(draft.finish()?)
    };
    whole().into_diagnostic().wrap_err_with(|| format!("writing {}", path.display()))
}
