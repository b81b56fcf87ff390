//! How the scene is simulated: interface model, geometry, solver; and on what mesh.

use crate::session::Session;
use crate::style::{faint, named, row, segmented};
use capsense::Device;
use capsense::core::occupancy::Interface;
use capsense::core::solver::Preconditioner;
use capsense::scene::GeometrySource;
use egui::{ComboBox, RichText, Ui};

/// Draws the form.
pub fn ui(ui: &mut Ui, session: &mut Session) {
    let Some(open) = &session.open else { return };
    let (scene, mesh) = (open.scene.clone(), open.mesh);
    let (renderer, device) = (open.renderer.clone(), open.device.clone());
    row(ui, "geometry", |ui| {
        let mut geometry = GeometrySource::of(&scene.geometry);
        let choices = [
            (GeometrySource::Camera, "depth camera", "surfaces as a depth camera sees them"),
            (GeometrySource::Solids, "solids", "the exact surfaces"),
        ];
        if segmented(ui, &mut geometry, &choices) {
            session.edit(|document| document.set_geometry(geometry));
        }
    });
    row(ui, "interface", |ui| {
        let mut interface = scene.interface;
        let list = ComboBox::from_id_salt("interface").selected_text(interface.name()).show_ui(ui, |ui| {
            for choice in [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction] {
                ui.selectable_value(&mut interface, choice, choice.name());
            }
        });
        named(list.response, "interface");
        if interface != scene.interface {
            session.edit(|document| document.set_interface(interface));
        }
    });
    row(ui, "tolerance", |ui| {
        let mut tolerance = scene.solver.tolerance;
        let shown = format!("{tolerance:.0e}");
        let list = ComboBox::from_id_salt("tolerance").selected_text(shown).show_ui(ui, |ui| {
            for choice in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8] {
                ui.selectable_value(&mut tolerance, choice, format!("{choice:.0e}"));
            }
        });
        named(list.response, "tolerance");
        ui.label(RichText::new("of C").color(faint(ui)));
        if tolerance != scene.solver.tolerance {
            session.edit(|document| document.set_tolerance(tolerance));
        }
    });
    row(ui, "preconditioner", |ui| {
        let mut chosen = scene.solver.preconditioner;
        let list = ComboBox::from_id_salt("preconditioner").selected_text(chosen.name()).show_ui(ui, |ui| {
            for choice in [
                Preconditioner::Multigrid,
                Preconditioner::Ic0,
                Preconditioner::Jacobi,
                Preconditioner::None,
                Preconditioner::Direct,
            ] {
                ui.selectable_value(&mut chosen, choice, choice.name());
            }
        });
        named(list.response, "preconditioner");
        if chosen != scene.solver.preconditioner {
            session.edit(|document| document.set_preconditioner(chosen));
        }
    });
    row(ui, "device", |ui| {
        let mut device = scene.device;
        let list = ComboBox::from_id_salt("device").selected_text(device.name()).show_ui(ui, |ui| {
            for choice in [Device::Cpu, Device::Gpu, Device::Auto] {
                ui.selectable_value(&mut device, choice, choice.name());
            }
        });
        named(list.response, "device");
        if device != scene.device {
            session.edit(|document| document.set_device(device));
        }
    });
    row(ui, "threads", |ui| {
        let mut threads = scene.threads;
        let text = |threads: usize| if threads == 0 { "all cores".to_owned() } else { threads.to_string() };
        let list = ComboBox::from_id_salt("threads").selected_text(text(threads)).show_ui(ui, |ui| {
            for choice in [0, 1, 2, 4, 8, 16] {
                ui.selectable_value(&mut threads, choice, text(choice));
            }
        });
        named(list.response, "threads");
        if threads != scene.threads {
            session.edit(|document| document.set_threads(threads));
        }
    });
    let facts = [
        ("mesh", format!("{} tets, {} nodes", grouped(mesh.tets), grouped(mesh.nodes))),
        ("surfaces", renderer),
        ("fields", device),
        ("frames", format!("{} at {} Hz", scene.frames, scene.frame_rate)),
    ];
    for (name, text) in facts {
        row(ui, name, |ui| ui.add(egui::Label::new(text).truncate()));
    }
}

/// A count with thin spaces between its thousands.
pub fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{2009}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn thousands_are_apart() {
        assert_eq!(super::grouped(1_234_567).replace('\u{2009}', " "), "1 234 567");
        assert_eq!(super::grouped(999), "999");
    }
}
