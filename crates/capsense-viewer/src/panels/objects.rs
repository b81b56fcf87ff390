//! The list of objects: where each stands, what it is made of, and what can be added.

use crate::palette::material_colour;
use crate::session::Session;
use crate::style::{faint, named, row, segmented};
use capsense::core::geometry::{Pose, Shape};
use capsense::core::material::{Connection, Material, RelativePermittivity};
use capsense::scene::SceneObject;
use capsense::scene::write::NewShape;
use egui::{DragValue, RichText, Ui};
use glam::{DQuat, DVec3, EulerRot};
use std::path::Path;

/// Capacitance of a person to ground, in farads.
const OF_A_PERSON: f64 = 150e-12;

/// Draws the list and, below it, all of the selected object.
pub fn ui(ui: &mut Ui, session: &mut Session) {
    let Some(open) = &session.open else { return };
    let scene = open.scene.clone();
    let poses = session.poses();
    if scene.objects.is_empty() {
        ui.label(RichText::new("There are no objects.").color(faint(ui)));
    }
    for (index, object) in scene.objects.iter().enumerate() {
        ui.horizontal(|ui| {
            let (rect, _) = ui.allocate_exact_size(egui::vec2(12.0, 12.0), egui::Sense::hover());
            ui.painter().rect_filled(rect, 3.0, material_colour(&object.material));
            let is_selected = session.selected == Some(index);
            if ui.selectable_label(is_selected, &object.name).clicked() {
                session.selected = if is_selected { None } else { Some(index) };
            }
            ui.label(RichText::new(shape_text(&object.shape)).color(faint(ui)).small());
        });
    }
    add_menu(ui, session, &scene.objects);
    if let Some(index) = session.selected
        && let (Some(object), Some(pose)) = (scene.objects.get(index), poses.get(index))
    {
        ui.separator();
        selected(ui, session, index, object, *pose);
    }
}

fn shape_text(shape: &Shape) -> String {
    let mm =
        |length: f64| format!("{:.4}", length * 1e3).trim_end_matches('0').trim_end_matches('.').to_owned();
    match shape {
        Shape::Box { size } => format!("box {} × {} × {} mm", mm(size.x), mm(size.y), mm(size.z)),
        Shape::Sphere { radius } => format!("sphere Ø {} mm", mm(2.0 * radius)),
        Shape::Capsule { radius, length } => format!("capsule Ø {} × {} mm", mm(2.0 * radius), mm(*length)),
        Shape::Cylinder { radius, length } => format!("cylinder Ø {} × {} mm", mm(2.0 * radius), mm(*length)),
        Shape::Mesh(mesh) => format!("mesh of {} triangles", mesh.triangles().len()),
    }
}

fn selected(ui: &mut Ui, session: &mut Session, index: usize, object: &SceneObject, pose: Pose) {
    pose_ui(ui, session, index, object, pose);
    material_ui(ui, session, index, object.material);
    ui.add_space(2.0);
    if ui.button("remove").on_hover_text("leave the object out (Delete)").clicked() {
        session.remove_object(index);
    }
}

fn pose_ui(ui: &mut Ui, session: &mut Session, index: usize, object: &SceneObject, mut pose: Pose) {
    let mut is_changed = false;
    row(ui, "position", |ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let mut mm = pose.translation[axis] * 1e3;
            let value = DragValue::new(&mut mm).speed(0.2).max_decimals(3).range(-1e4..=1e4);
            let response = named(ui.add(value), name).on_hover_text(format!("{name} in millimetres"));
            if response.changed() {
                pose.translation[axis] = mm * 1e-3;
                is_changed = true;
            }
        }
        ui.label(RichText::new("mm").color(faint(ui)));
    });
    row(ui, "rotation", |ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let (x, y, z) = pose.rotation.to_euler(EulerRot::XYZ);
        let mut degrees = [x, y, z].map(f64::to_degrees);
        let mut turned = false;
        for (angle, name) in degrees.iter_mut().zip(["x", "y", "z"]) {
            // What is zero but for rounding reads as zero.
            *angle = (*angle * 1e6).round() * 1e-6 + 0.0;
            let value = DragValue::new(angle).speed(0.5).max_decimals(2).range(-360.0..=360.0);
            turned |= named(ui.add(value), name).on_hover_text(format!("about {name} in degrees")).changed();
        }
        if turned {
            let [x, y, z] = degrees.map(f64::to_radians);
            pose.rotation = DQuat::from_euler(EulerRot::XYZ, x, y, z).normalize();
            is_changed = true;
        }
        ui.label(RichText::new("°").color(faint(ui)));
    });
    if is_changed {
        session.hold(index, pose);
    }
    let has_motion = object.motion.end() > 0.0;
    if session.is_held(index) {
        ui.horizontal(|ui| {
            let (text, button) = match has_motion {
                true => ("held, not on its trajectory", "follow it again"),
                false => ("moved by hand", "put it back"),
            };
            ui.label(RichText::new(text).color(faint(ui)));
            if ui.small_button(button).clicked() {
                session.release(index);
            }
        });
    } else if has_motion {
        ui.label(RichText::new("moves on its trajectory").color(faint(ui)));
    }
}

/// What a material is chosen by.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Grounded,
    Floating,
    Coupled,
    Dielectric,
}

fn material_ui(ui: &mut Ui, session: &mut Session, index: usize, material: Material) {
    let mut kind = match material {
        Material::Conductor(Connection::Grounded) => Kind::Grounded,
        Material::Conductor(Connection::Floating) => Kind::Floating,
        Material::Conductor(Connection::Capacitance(_)) => Kind::Coupled,
        Material::Dielectric(_) => Kind::Dielectric,
    };
    let is_conductor = kind != Kind::Dielectric;
    let mut wanted = None;
    row(ui, "material", |ui| {
        let mut conducts = is_conductor;
        let choices = [(true, "conductor", "steel, tissue"), (false, "dielectric", "plastic, water")];
        if segmented(ui, &mut conducts, &choices) {
            let dielectric = RelativePermittivity::new(4.0).map(Material::Dielectric);
            wanted = if conducts { Some(Material::Conductor(Connection::Grounded)) } else { dielectric };
        }
    });
    if is_conductor {
        row(ui, "connection", |ui| {
            let choices = [
                (Kind::Grounded, "ground", "at 0 V"),
                (Kind::Floating, "floating", "no net charge"),
                (Kind::Coupled, "C to ground", "tied to ground through a capacitance"),
            ];
            if segmented(ui, &mut kind, &choices) {
                wanted = Some(Material::Conductor(match kind {
                    Kind::Floating => Connection::Floating,
                    Kind::Coupled => Connection::Capacitance(OF_A_PERSON),
                    Kind::Grounded | Kind::Dielectric => Connection::Grounded,
                }));
            }
        });
    }
    match material {
        Material::Conductor(Connection::Capacitance(farads)) => {
            let changed = number(ui, "to ground", farads * 1e12, "pF", 0.0..=1e6);
            wanted = changed.map(|pf| Material::Conductor(Connection::Capacitance(pf * 1e-12))).or(wanted);
        }
        Material::Dielectric(permittivity) => {
            let changed = number(ui, "permittivity", permittivity.value(), "relative", 1e-3..=1e6);
            wanted = changed.and_then(RelativePermittivity::new).map(Material::Dielectric).or(wanted);
        }
        Material::Conductor(_) => {}
    }
    if let Some(material) = wanted.filter(|wanted| *wanted != material) {
        session.edit(|document| document.set_material(index, material));
    }
}

/// A number that is taken over when it is let go of, as every change builds the scene anew.
fn number(
    ui: &mut Ui,
    label: &str,
    value: f64,
    unit: &str,
    range: std::ops::RangeInclusive<f64>,
) -> Option<f64> {
    row(ui, label, |ui| {
        let id = ui.scope_id().with(label);
        let mut shown = ui.data(|data| data.get_temp::<f64>(id)).unwrap_or(value);
        let speed = (0.01 * value.abs()).max(1e-3);
        let drag = DragValue::new(&mut shown).speed(speed).max_decimals(4).range(range);
        let response = named(ui.add(drag), label);
        ui.label(RichText::new(unit).color(faint(ui)));
        if response.drag_stopped() || response.lost_focus() {
            ui.data_mut(|data| data.remove::<f64>(id));
            return (shown != value).then_some(shown);
        }
        if response.dragged() || response.has_focus() {
            ui.data_mut(|data| data.insert_temp(id, shown));
        }
        None
    })
}

fn add_menu(ui: &mut Ui, session: &mut Session, objects: &[SceneObject]) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("add").color(faint(ui)));
        let shapes = [
            ("box", NewShape::Box(DVec3::new(0.06, 0.06, 0.02))),
            ("sphere", NewShape::Sphere(0.025)),
            ("capsule", NewShape::Capsule(0.01, 0.05)),
            ("cylinder", NewShape::Cylinder(0.02, 0.06)),
        ];
        for (name, shape) in shapes {
            if ui.button(name).clicked() {
                add(session, name, &shape, objects);
            }
        }
    });
    ui.label(RichText::new("Drop a .glb, .obj or .stl file to add it.").color(faint(ui)).small());
}

fn add(session: &mut Session, name: &str, shape: &NewShape, objects: &[SceneObject]) {
    let name = free_name(name, objects);
    let place = DVec3::new(0.0, 0.0, 0.1);
    let material = Material::Conductor(Connection::Grounded);
    session.edit(|document| document.add_object(&name, shape, material, Pose::at(place)));
    session.selected = Some(objects.len());
}

/// Adds a mesh file, in metres.
pub fn add_file(session: &mut Session, path: &Path) {
    let Some(open) = &session.open else { return };
    let scene = open.scene.clone();
    let name = path.file_stem().map_or_else(|| "mesh".into(), |stem| stem.to_string_lossy().into_owned());
    let shape = NewShape::File(path.to_owned(), unit_of(path, scene.domain.size().max_element()).to_owned());
    add(session, &name, &shape, &scene.objects);
}

/// The unit in which a file is of plausible size in a domain. STL and OBJ files do not say theirs.
fn unit_of(path: &Path, domain: f64) -> &'static str {
    let Ok(mesh) = capsense_render::load_mesh(path, capsense::core::units::LengthUnit::Metre) else {
        return "m";
    };
    let bounds = capsense::core::geometry::Aabb::around(mesh.vertices().iter().copied());
    let size = bounds.size().max_element();
    if size > 10.0 * domain { "mm" } else { "m" }
}

/// A name that no object has.
fn free_name(wanted: &str, objects: &[SceneObject]) -> String {
    let is_taken = |name: &str| objects.iter().any(|object| object.name == name);
    let numbered = (2..).map(|count| format!("{wanted} {count}"));
    let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
    names.find(|name| !is_taken(name)).unwrap_or_else(|| wanted.to_owned())
}
