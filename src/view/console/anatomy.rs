//! Inspectors: the acoustic table, and how surfaces reflect.

use egui::{ComboBox, Ui};

use super::controls::{grid, number, number_or};
use crate::scene::{Surface, Tissue};
use crate::view::model::{Placed, Settings};

/// One of a list; what was chosen last may be gone with another scene.
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

pub(super) fn tissues(ui: &mut Ui, settings: &mut Settings, loaded: &Settings, chosen: &mut usize) {
    ui.horizontal(|ui| {
        pick(ui, "tissue", settings.tissues.iter().map(|t| t.name.as_str()), chosen);
        if let Some(original) = loaded.tissues.get(*chosen)
            && ui.button("Reset").on_hover_text("As in the scene file").clicked()
        {
            settings.tissues[*chosen].clone_from(original);
        }
    });
    let Some(tissue) = settings.tissues.get_mut(*chosen) else {
        return;
    };
    grid(ui, "tissue values", |ui| values(ui, tissue));
    ui.label(format!("Impedance {:.3} MRayl", tissue.impedance()))
        .on_hover_text("Density times speed of sound");
    ui.collapsing("Sources", |ui| ui.small(&tissue.source));
}

fn values(ui: &mut Ui, t: &mut Tissue) {
    let key = |name: &str| format!("tissues.NAME.{name}");
    number(ui, &key("speed"), "Speed", &mut t.speed, 0.3..=4.0);
    number(ui, &key("density"), "Density", &mut t.density, 0.001..=2.5);
    number(ui, &key("attenuation"), "Attenuation", &mut t.attenuation, 0.0..=10.0);
    let echogenicity = &mut t.echogenicity;
    let silent = (f64::NEG_INFINITY, "silent");
    number_or(ui, &key("echogenicity"), "Echogenicity", echogenicity, -40.0..=20.0, silent);
    let density = &mut t.density_of_scatterers;
    number(ui, &key("density_of_scatterers"), "Scatterers", density, 0.0..=1.0);
    let ratio = &mut t.mean_over_sigma;
    number(ui, &key("mean_over_sigma"), "Mean / sigma", ratio, -5.0..=5.0);
    number(ui, &key("texture_depth"), "Texture depth", &mut t.texture_depth, 0.0..=0.5);
    number(ui, &key("texture_length"), "Texture length", &mut t.texture_length, 0.5..=20.0);
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
            && ui.button("Reset").on_hover_text("As in the scene file").clicked()
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
        ui.push_id(name, |ui| grid(ui, "surface", |ui| surface(ui, path, side)));
    }
}

fn surface(ui: &mut Ui, path: &str, s: &mut Surface) {
    let key = |name: &str| format!("{path}.{name}");
    let mirror = (f64::INFINITY, "mirror");
    number_or(ui, &key("roughness"), "Roughness", &mut s.roughness, 0.0..=2000.0, mirror);
    number(ui, &key("thickness"), "Thickness", &mut s.thickness, 0.0..=1.0);
    number(ui, &key("specularity"), "Specularity", &mut s.specularity, 0.0..=50.0);
    let none = (f64::NEG_INFINITY, "none");
    number_or(ui, &key("surface_gain"), "Gain", &mut s.gain, -30.0..=30.0, none);
}
