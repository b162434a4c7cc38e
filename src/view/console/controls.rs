//! Controls of one key each.

use std::ops::RangeInclusive;

use egui::{ComboBox, DragValue, Response, Slider, SliderClamping, Ui};
use serde::Deserialize;
use serde::de::value::{Error, StrDeserializer};

use crate::view::catalogue::{self, Entry};

/// Name and meaning of a key in a tooltip.
pub(super) fn explained(response: Response, key: &str, entry: &Entry) -> Response {
    let unit = &entry.unit;
    let range = match entry.range {
        [least, most] if least.is_finite() && most.is_finite() => {
            format!("\n{least} to {most} {unit}")
        }
        [least, _] if least.is_finite() => format!("\nat least {least} {unit}"),
        [_, most] if most.is_finite() => format!("\nat most {most} {unit}"),
        _ => String::new(),
    };
    response.on_hover_text(format!("{}{range}\n{key}", entry.meaning))
}

/// A label and a control in a row of a two-column grid.
pub(super) fn row(ui: &mut Ui, key: &str, label: &str, add: impl FnOnce(&mut Ui, &Entry)) {
    let entry = catalogue::entry(key);
    explained(ui.label(label), key, entry);
    ui.horizontal(|ui| add(ui, entry));
    ui.end_row();
}

/// The two columns that the controls below fill.
pub(super) fn grid(ui: &mut Ui, id: &str, add: impl FnOnce(&mut Ui)) {
    egui::Grid::new(id).num_columns(2).spacing([8.0, 4.0]).min_col_width(96.0).show(ui, add);
}

/// A slider over the `usual` values; typing takes all that a scene file may give.
fn slider(ui: &mut Ui, key: &str, entry: &Entry, value: &mut f64, usual: RangeInclusive<f64>) {
    let wide = *usual.start() > 0.0 && usual.end() / usual.start() > 50.0;
    // A long unit needs the room.
    let beyond = entry.unit.len().saturating_sub(5) as f32;
    ui.spacing_mut().slider_width -= 7.0 * beyond;
    let slider = Slider::new(value, usual)
        .clamping(SliderClamping::Never)
        .logarithmic(wide)
        .max_decimals(4)
        .suffix(format!(" {}", entry.unit));
    explained(ui.add(slider), key, entry);
    let [least, most] = entry.range;
    *value = value.clamp(least, most);
}

/// A number.
pub(super) fn number(
    ui: &mut Ui,
    key: &str,
    label: &str,
    value: &mut f64,
    usual: RangeInclusive<f64>,
) {
    row(ui, key, label, |ui, entry| slider(ui, key, entry, value, usual));
}

/// An angle, shown in degrees and held in radians.
pub(super) fn angle(ui: &mut Ui, key: &str, label: &str, value: &mut f64, most: f64) {
    row(ui, key, label, |ui, entry| {
        let mut degrees = value.to_degrees();
        let slider = Slider::new(&mut degrees, 10.0..=most).max_decimals(1).suffix(" deg");
        if explained(ui.add(slider), key, entry).changed() {
            *value = degrees.to_radians();
        }
    });
}

/// A whole number.
pub(super) fn count(
    ui: &mut Ui,
    key: &str,
    label: &str,
    value: &mut u32,
    usual: RangeInclusive<u32>,
) {
    row(ui, key, label, |ui, entry| {
        let mut number = f64::from(*value);
        let wide = *usual.start() > 0 && usual.end() / usual.start().max(&1) > 50;
        let range = f64::from(*usual.start())..=f64::from(*usual.end());
        let slider = Slider::new(&mut number, range)
            .clamping(SliderClamping::Never)
            .logarithmic(wide)
            .integer()
            .suffix(match entry.unit.as_str() {
                "" => String::new(),
                unit => format!(" {unit}"),
            });
        explained(ui.add(slider), key, entry);
        *value = number.clamp(entry.range[0], entry.range[1]) as u32;
    });
}

/// A number that may be switched off: `off` is infinite.
pub(super) fn number_or(
    ui: &mut Ui,
    key: &str,
    label: &str,
    value: &mut f64,
    usual: RangeInclusive<f64>,
    (off, word): (f64, &str),
) {
    row(ui, key, label, |ui, entry| {
        let mut is_off = *value == off;
        if ui.checkbox(&mut is_off, word).changed() {
            *value = if is_off { off } else { (usual.start() + usual.end()) / 2.0 };
        }
        if !is_off {
            let number = DragValue::new(value)
                .speed((usual.end() - usual.start()) / 200.0)
                .max_decimals(3)
                .suffix(format!(" {}", entry.unit));
            explained(ui.add(number), key, entry);
            *value = value.clamp(entry.range[0], entry.range[1]);
        }
    });
}

/// Yes or no.
pub(super) fn switch(ui: &mut Ui, key: &str, label: &str, value: &mut bool) {
    row(ui, key, label, |ui, entry| {
        explained(ui.checkbox(value, ""), key, entry);
    });
}

/// One of the words that the key takes.
pub(super) fn choice<T>(ui: &mut Ui, key: &str, label: &str, value: &mut T)
where
    T: for<'de> Deserialize<'de> + PartialEq,
{
    row(ui, key, label, |ui, entry| words(ui, key, value, entry, |_| true));
}

/// The list of words alone, those that are `possible`; `id` tells several of one key apart.
pub(super) fn words<T>(
    ui: &mut Ui,
    id: &str,
    value: &mut T,
    entry: &Entry,
    possible: impl Fn(&T) -> bool,
) where
    T: for<'de> Deserialize<'de> + PartialEq,
{
    let of = |word: &str| T::deserialize(StrDeserializer::<Error>::new(word)).ok();
    let chosen = entry.choices.iter().find(|w| of(w).as_ref() == Some(value));
    let shown = chosen.map_or("", String::as_str);
    let list = ComboBox::from_id_salt(id).selected_text(shown).show_ui(ui, |ui| {
        for word in &entry.choices {
            if let Some(choice) = of(word).filter(&possible) {
                ui.selectable_value(value, choice, word);
            }
        }
    });
    explained(list.response, id, entry);
}
