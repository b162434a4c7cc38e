//! Controls of settings, made from their rows.

use egui::{ComboBox, DragValue, Response, Slider, SliderClamping, Ui};

use crate::settings::units::ANGLE;
use crate::settings::{Facts, Form, Group, Off, Row, Value, Words};

/// Adds a tooltip: meaning, range and name of a key. `path` is its table.
pub(super) fn explained(response: Response, path: &str, facts: &Facts) -> Response {
    let unit = facts.unit();
    let range = match facts.range {
        [least, most] if least.is_finite() && most.is_finite() => {
            format!("\n{least} to {most} {unit}")
        }
        [least, _] if least.is_finite() => format!("\nat least {least} {unit}"),
        [_, most] if most.is_finite() => format!("\nat most {most} {unit}"),
        _ => String::new(),
    };
    let meaning = facts.meaning().replace('`', "");
    response.on_hover_text(format!("{meaning}{range}\n{path}.{}", facts.key))
}

/// Draws a grid with two columns for the controls below.
pub(super) fn grid(ui: &mut Ui, id: &str, add: impl FnOnce(&mut Ui)) {
    egui::Grid::new(id).num_columns(2).spacing([8.0, 4.0]).min_col_width(96.0).show(ui, add);
}

/// Draws a setting that needs more than its row; returns true where it has drawn it.
pub(super) type Special<'s, T> = &'s mut dyn FnMut(&mut Ui, &Facts, &mut T) -> bool;

/// Draws the controls of all settings of a group, its sections one below the other. `path` is its table.
pub(crate) fn group<T: Group>(ui: &mut Ui, path: &str, settings: &mut T) {
    group_with(ui, path, settings, &mut |_, _, _| false);
}

/// Like [`group`]; settings that need more than a row are drawn by `special`.
pub(super) fn group_with<T: Group>(
    ui: &mut Ui,
    path: &str,
    settings: &mut T,
    special: Special<'_, T>,
) {
    section(ui, path, settings, "", special);
    let mut shown = vec![""];
    for row in T::rows() {
        let name = row.facts.under;
        if !shown.contains(&name) {
            shown.push(name);
            ui.collapsing(name, |ui| section(ui, path, settings, name, special));
        }
    }
}

/// Draws the controls of one section of a group.
pub(super) fn section<T: Group>(
    ui: &mut Ui,
    path: &str,
    settings: &mut T,
    name: &str,
    special: Special<'_, T>,
) {
    grid(ui, &format!("{path} {name}"), |ui| {
        // A setting without a label has its control elsewhere.
        let rows = T::rows().iter().filter(|row| row.facts.under == name);
        for row in rows.filter(|row| !row.facts.label.is_empty()) {
            if !special(ui, &row.facts, settings) {
                control(ui, path, row, settings);
            }
        }
    });
}

/// Draws label and control of one setting.
fn control<T>(ui: &mut Ui, path: &str, row: &Row<T>, settings: &mut T) {
    let facts = &row.facts;
    let before = (row.get)(settings);
    let mut value = before.clone();
    if value == Value::Absent && !matches!(facts.off, Some((Off::Absent, _))) {
        return;
    }
    if let Value::List(list) = &mut value {
        for (part, number) in facts.parts.iter().zip(list) {
            explained(ui.label(format!("{} {part}", facts.label)), path, facts);
            ui.horizontal(|ui| slider(ui, path, facts, number));
            ui.end_row();
        }
    } else {
        explained(ui.label(facts.label), path, facts);
        ui.horizontal(|ui| match &mut value {
            _ if facts.off.is_some() => number_or_off(ui, path, facts, &mut value),
            Value::Number(radians) if facts.form.measures(&ANGLE) => {
                angle(ui, path, facts, radians)
            }
            Value::Number(number) => slider(ui, path, facts, number),
            Value::Whole(number) => count(ui, path, facts, number),
            Value::Switch(on) => drop(explained(ui.checkbox(on, ""), path, facts)),
            Value::Word(word) => choice(ui, path, facts, word),
            Value::List(_) | Value::Text(_) | Value::Texts(_) | Value::Absent => {}
        });
        ui.end_row();
    }
    if value != before {
        (row.set)(settings, &value);
    }
}

/// A slider over the usual values; the keyboard takes every value that a scene file may give.
fn slider(ui: &mut Ui, path: &str, facts: &Facts, value: &mut f64) {
    // A long unit needs the room, also within a section of a section.
    let beyond = facts.unit().len().saturating_sub(5) as f32;
    ui.spacing_mut().slider_width -= 12.0 * beyond;
    let slider = over(facts, value).max_decimals(4).suffix(format!(" {}", facts.unit()));
    explained(ui.add(slider.custom_parser(|text| typed(facts, text))), path, facts);
    let [least, most] = facts.range;
    *value = value.clamp(least, most);
}

/// The number that is typed into the field of a setting, in the unit that the field shows: alone, with that unit, or with
/// another one of its measure ("14.5 cm"). While a unit is half typed, none.
pub(super) fn typed(facts: &Facts, text: &str) -> Option<f64> {
    let counted = || number(text.trim().strip_suffix(facts.unit())?);
    number(text).or_else(counted).or_else(|| facts.measure()?.parse(text).ok())
}

/// A plain number as it is typed; the sign may be a true minus, as the fields show it.
fn number(text: &str) -> Option<f64> {
    text.trim().replace('\u{2212}', "-").parse().ok()
}

/// The slider of a setting, logarithmic where its usual values span decades.
fn over<'v>(facts: &Facts, value: &'v mut f64) -> Slider<'v> {
    let [low, high] = facts.usual;
    let wide = low > 0.0 && high / low > 50.0;
    Slider::new(value, low..=high).clamping(SliderClamping::Never).logarithmic(wide)
}

/// An angle, shown in degrees and held in radians.
fn angle(ui: &mut Ui, path: &str, facts: &Facts, radians: &mut f64) {
    let [low, high] = facts.usual.map(f64::to_degrees);
    let mut degrees = radians.to_degrees();
    let slider = Slider::new(&mut degrees, low..=high).max_decimals(1).suffix(" deg");
    // A plain number is what stands there: degrees.
    let degrees_of = |text: &str| {
        number(text).or_else(|| facts.measure()?.parse(text).ok().map(f64::to_degrees))
    };
    if explained(ui.add(slider.custom_parser(degrees_of)), path, facts).changed() {
        *radians = degrees.to_radians();
    }
}

/// A whole number.
fn count(ui: &mut Ui, path: &str, facts: &Facts, value: &mut u32) {
    let mut number = f64::from(*value);
    let suffix = match facts.unit() {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    let slider = over(facts, &mut number).integer().suffix(suffix);
    explained(ui.add(slider.custom_parser(|text| typed(facts, text))), path, facts);
    *value = number.clamp(facts.range[0], facts.range[1]) as u32;
}

/// A number that may be switched off.
fn number_or_off(ui: &mut Ui, path: &str, facts: &Facts, value: &mut Value) {
    let Some((off, word)) = facts.off else { return };
    let off = match off {
        Off::At(number) => Value::Number(number),
        Off::Absent => Value::Absent,
    };
    let [low, high] = facts.usual;
    let mut is_off = *value == off;
    if ui.checkbox(&mut is_off, word).changed() {
        *value = if is_off { off } else { Value::Number((low + high) / 2.0) };
    }
    if let (false, Value::Number(number)) = (is_off, value) {
        let drag = DragValue::new(number)
            .speed((high - low) / 200.0)
            .max_decimals(3)
            .suffix(format!(" {}", facts.unit()))
            .custom_parser(|text| typed(facts, text));
        explained(ui.add(drag), path, facts);
        *number = number.clamp(facts.range[0], facts.range[1]);
    }
}

/// A list of the words that a key takes.
fn choice(ui: &mut Ui, path: &str, facts: &Facts, chosen: &mut &'static str) {
    let Form::Words(words) = facts.form else { return };
    let id = format!("{path}.{}", facts.key);
    let list = ComboBox::from_id_salt(id).selected_text(*chosen).show_ui(ui, |ui| {
        for &word in words {
            ui.selectable_value(chosen, word, word);
        }
    });
    explained(list.response, path, facts);
}

/// The list of words alone, those that are `possible`; `id` distinguishes several lists.
pub(super) fn words<W: Words>(
    ui: &mut Ui,
    id: &str,
    value: &mut W,
    possible: impl Fn(&W) -> bool,
) -> Response {
    let list = ComboBox::from_id_salt(id).selected_text(value.word()).show_ui(ui, |ui| {
        for &choice in W::ALL.iter().filter(|choice| possible(choice)) {
            ui.selectable_value(value, choice, choice.word());
        }
    });
    list.response
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Imaging, Probe};

    #[test]
    fn numbers_are_typed_with_the_unit_that_is_shown_another_one_or_none() {
        let facts = |key: &str| {
            let probe = Probe::rows().iter().map(|row| &row.facts);
            let all = probe.chain(Imaging::rows().iter().map(|row| &row.facts));
            all.into_iter().find(|facts| facts.key == key).expect(key)
        };
        for (key, text, expected) in [
            ("depth", "145", Some(145.0)),
            ("depth", "145 mm", Some(145.0)),
            ("depth", "14.5cm", Some(145.0)),
            ("depth", "14.5 c", None),
            ("depth", "14.5 MHz", None),
            ("frequency", " 4 MHz", Some(4.0)),
            ("frequency", "4000 kHz", Some(4.0)),
            ("gain", "\u{2212}12 dB", Some(-12.0)),
            ("gain", "-inf", Some(f64::NEG_INFINITY)),
            ("scanlines", "96", Some(96.0)),
            ("depth", "", None),
        ] {
            assert_eq!(typed(facts(key), text), expected, "{key} {text}");
        }
    }
}
