//! Scene files that are written are the scenes that were read.

use capsense::core::geometry::Pose;
use capsense::core::glam::{DQuat, DVec3};
use capsense::core::material::{Connection, Material, RelativePermittivity};
use capsense::core::occupancy::Interface;
use capsense::core::solver::Preconditioner;
use capsense::scene::GeometrySource;
use capsense::scene::Scene;
use capsense::scene::write::{NewShape, SceneDocument};
use std::path::{Path, PathBuf};

fn assets() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    assert!(files.len() >= 4, "{files:?}");
    files
}

/// All of a scene but where its keys stand in the file.
fn content(scene: &Scene) -> String {
    let source = Scene::built_in().unwrap().source;
    format!("{:?}", Scene { source, warnings: Vec::new(), ..scene.clone() })
}

/// Writes into the document all that it says already.
fn set_everything_again(document: &mut SceneDocument, scene: &Scene) {
    for (index, object) in scene.objects.iter().enumerate() {
        document.set_material(index, object.material);
    }
    document.set_interface(scene.interface);
    document.set_geometry(GeometrySource::of(&scene.geometry));
    document.set_tolerance(scene.solver.tolerance);
    document.set_preconditioner(scene.solver.preconditioner);
    document.set_threads(scene.threads);
}

#[test]
fn what_is_written_is_what_was_read_in_any_folder() {
    let folder = tempfile::tempdir().unwrap();
    for file in assets() {
        let scene = Scene::load(&file).unwrap();
        let mut document = SceneDocument::load(&file).unwrap();
        set_everything_again(&mut document, &scene);
        let elsewhere = folder.path().join(file.file_name().unwrap());
        document.save(&elsewhere).unwrap();
        let again = Scene::load(&elsewhere).unwrap();
        assert_eq!(content(&again), content(&scene), "{}", file.display());
        assert_eq!(content(&document.scene().unwrap()), content(&scene), "{}", file.display());
        // Comments are the user's.
        let comments = |text: &str| text.matches('#').count();
        let before = std::fs::read_to_string(&file).unwrap();
        assert_eq!(comments(&std::fs::read_to_string(&elsewhere).unwrap()), comments(&before));
    }
}

#[test]
fn every_change_is_read_back() {
    let mut document = SceneDocument::built_in().unwrap();
    let pose = Pose { translation: DVec3::new(0.01, -0.02, 0.0725), rotation: DQuat::from_rotation_y(0.3) };
    let water = Material::Dielectric(RelativePermittivity::new(80.0).unwrap());
    let person = Material::Conductor(Connection::Capacitance(150e-12));
    document.place(0, pose);
    document.set_material(0, person);
    let shapes = [
        ("ball", NewShape::Sphere(0.02)),
        ("brick", NewShape::Box(DVec3::new(0.01, 0.02, 0.03))),
        ("finger", NewShape::Capsule(0.01, 0.05)),
        ("can", NewShape::Cylinder(0.03, 0.1)),
    ];
    for (name, shape) in &shapes {
        document.add_object(name, shape, water, Pose::at(DVec3::new(0.0, 0.0, 0.2)));
    }
    document.remove_object(2);
    document.set_interface(Interface::VolumeFraction);
    document.set_geometry(GeometrySource::Solids);
    document.set_tolerance(3e-6);
    document.set_preconditioner(Preconditioner::Ic0);
    document.set_threads(3);
    let scene = document.scene().unwrap();
    let names: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["bar", "ball", "finger", "can"]);
    let read = scene.objects[0].motion.pose_at(0.7);
    assert_eq!(read.translation, pose.translation);
    // Rotations are made of unit length as they are read, which rounds.
    assert!((read.rotation - pose.rotation).length() < 1e-15, "{read:?}");
    assert_eq!(scene.frames, 1, "the bar rests");
    assert_eq!(scene.objects[0].material, person);
    assert_eq!(scene.objects[3].material, water);
    assert_eq!(GeometrySource::of(&scene.geometry), GeometrySource::Solids);
    assert_eq!(scene.interface, Interface::VolumeFraction);
    assert_eq!(scene.solver.preconditioner, Preconditioner::Ic0);
    assert_eq!((scene.solver.tolerance, scene.threads), (3e-6, 3));
}

#[test]
fn objects_in_one_line_can_be_changed_too() {
    let text = r#"
        sensor.electrode = [{ name = "E", disk = { center = [0.0, 0.0], radius = 0.02 } }]
        object = [
            { name = "a", sphere = { radius = 0.01 }, material = { relative_permittivity = 4.0 }, position = [0, 0, 0.1] },
            { name = "b", sphere = { radius = 0.01 }, material = { conductor = "floating" }, position = [0, 0, 0.2] },
        ]
    "#;
    let mut document = SceneDocument::parse("s.toml", text, Path::new("")).unwrap();
    document.place(1, Pose::at(DVec3::new(0.1, 0.0, 0.1)));
    document.remove_object(0);
    let scene = document.scene().unwrap();
    assert_eq!(scene.objects.len(), 1);
    assert_eq!(scene.objects[0].name, "b");
    assert_eq!(scene.objects[0].motion.pose_at(0.0).translation.x, 0.1);
}

#[test]
fn a_mesh_file_is_named_so_that_it_is_found_again() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut document = SceneDocument::load(&root.join("assets/scenes/steel_bar.toml")).unwrap();
    let shape = NewShape::File(root.join("assets/objects/hand.glb"), "m".to_owned());
    document.add_object("hand", &shape, Material::Conductor(Connection::Grounded), Pose::at(DVec3::Z * 0.2));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("with_hand.toml");
    document.save(&path).unwrap();
    assert_eq!(Scene::load(&path).unwrap().objects[1].name, "hand");
    assert!(document.save(&folder.path().join("no/such/folder.toml")).is_err());
    assert_eq!(document.name(), path.display().to_string(), "a file that cannot be written changes nothing");
}
