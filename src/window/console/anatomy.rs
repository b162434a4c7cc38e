//! Inspectors: the acoustic table, and how surfaces reflect.

use egui::{ComboBox, Slider, Ui};

use super::controls::group;
use crate::model::{Layer, Placed, Settings};
use crate::settings::{Group, Tissue};
use crate::style::button;

/// A list to choose one name from; the last choice may be gone with another scene.
fn pick<'n>(ui: &mut Ui, id: &str, names: impl Iterator<Item = &'n str>, chosen: &mut usize) {
    let names: Vec<_> = names.collect();
    *chosen = (*chosen).min(names.len().saturating_sub(1));
    ComboBox::from_id_salt(id)
        .width(200.0)
        .selected_text(names.get(*chosen).copied().unwrap_or_default())
        .show_ui(ui, |ui| {
            for (index, name) in names.iter().enumerate() {
                ui.selectable_value(chosen, index, *name);
            }
        });
}

/// The switch of the tissues' colours over the image.
pub(super) fn layer(ui: &mut Ui, layer: &mut Layer) {
    ui.checkbox(&mut layer.shown, "Tissues in colours").on_hover_text(
        "Colours each pixel by the tissue that is seen there, where refracted sound shows it (I). \
             Saved images are not coloured.",
    );
    if layer.shown {
        let slider = Slider::new(&mut layer.opacity, 0.05..=1.0).max_decimals(2).text("opacity");
        ui.add(slider).on_hover_text("Of the colours; 1 hides the image's grey levels");
    }
}

pub(super) fn tissues(ui: &mut Ui, settings: &mut Settings, loaded: &Settings, chosen: &mut usize) {
    ui.horizontal(|ui| {
        pick(ui, "tissue", settings.tissues.iter().map(|t| t.name.as_str()), chosen);
        if let Some(original) = loaded.tissues.get(*chosen)
            && button(ui, "Reset", "As in the scene file")
        {
            settings.tissues[*chosen].clone_from(original);
        }
    });
    let Some(tissue) = settings.tissues.get_mut(*chosen) else {
        return;
    };
    group(ui, Tissue::TABLE, tissue);
    ui.label(format!("Impedance {:.3} MRayl", tissue.impedance()))
        .on_hover_text("Density times speed of sound");
    ui.collapsing("Sources", |ui| ui.small(&tissue.source));
}

pub(super) fn surfaces(
    ui: &mut Ui,
    settings: &mut Settings,
    loaded: &Settings,
    meshes: &[Placed],
    chosen: &mut usize,
) {
    ui.horizontal(|ui| {
        pick(ui, "mesh", meshes.iter().map(|m| m.name.as_str()), chosen);
        if let Some(original) = loaded.surfaces.get(*chosen)
            && button(ui, "Reset", "As in the scene file")
        {
            settings.surfaces[*chosen] = *original;
        }
    });
    let Some([outside, inside]) = settings.surfaces.get_mut(*chosen) else {
        return;
    };
    let tissue = &settings.tissues[meshes[*chosen].tissue].name;
    ui.label(format!("encloses {tissue}"));
    for (name, path, side) in
        [("Met from outside", "mesh", outside), ("Met from within", "mesh.inside", inside)]
    {
        ui.label(name);
        group(ui, path, side);
    }
}
