//! Colours that electrodes, curves and bodies share, so that what belongs together looks alike.

use capsense_core::material::{Connection, Material};
use egui::Color32;

/// Colours that tell curves and electrodes apart on dark and on light ground.
pub fn palette(index: usize) -> Color32 {
    const COLOURS: [Color32; 10] = [
        Color32::from_rgb(0x4e, 0x9a, 0xdb),
        Color32::from_rgb(0xf2, 0x8e, 0x2b),
        Color32::from_rgb(0xe1, 0x57, 0x59),
        Color32::from_rgb(0x3f, 0xb3, 0xa8),
        Color32::from_rgb(0x59, 0xa1, 0x4f),
        Color32::from_rgb(0xc9, 0xa2, 0x27),
        Color32::from_rgb(0xb0, 0x7a, 0xa1),
        Color32::from_rgb(0xff, 0x7f, 0xa0),
        Color32::from_rgb(0x9c, 0x75, 0x5f),
        Color32::from_rgb(0x9a, 0x9a, 0x9a),
    ];
    match COLOURS.get(index) {
        Some(&colour) => colour,
        // Steps of the golden ratio around the colour circle.
        None => egui::ecolor::Hsva::new((index as f32 * 0.618_034).fract(), 0.7, 0.8, 1.0).into(),
    }
}

/// What bodies of a material are drawn in.
pub fn material_colour(material: &Material) -> Color32 {
    match material {
        Material::Conductor(Connection::Grounded) => Color32::from_rgb(0x8f, 0xa3, 0xb8),
        Material::Conductor(Connection::Floating) => Color32::from_rgb(0xa7, 0x93, 0xcf),
        Material::Conductor(Connection::Capacitance(_)) => Color32::from_rgb(0xcf, 0xa5, 0x8f),
        Material::Dielectric(_) => Color32::from_rgb(0x6f, 0xbf, 0xb0),
    }
}
