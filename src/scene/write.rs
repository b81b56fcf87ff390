//! Writes scene files: a document that is changed key by key, so that comments and order of the user's file stay.
//!
//! What is simulated is what would be saved: [`SceneDocument::scene`] reads the document's own text with all checks of
//! [`Scene::parse`].

use super::source::SceneError;
use super::{BUILT_IN, BUILT_IN_NAME, GeometrySource, Scene};
use crate::device::Device;
use capsense_core::geometry::Pose;
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::Interface;
use capsense_core::solver::Preconditioner;
use std::path::{Path, PathBuf};
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// Tables whose `file` or `stl` is a path, below the root.
const FILE_KEYS: [&str; 2] = ["file", "stl"];

/// A scene file in memory, with its comments.
#[derive(Clone, Debug)]
pub struct SceneDocument {
    document: DocumentMut,
    name: String,
    folder: PathBuf,
}

/// The shape of an object that is added to a document. Lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum NewShape {
    /// A cuboid with these edge lengths.
    Box(DVec3),
    /// A ball of a radius.
    Sphere(f64),
    /// A capsule along z: radius, and distance between the centres of its caps.
    Capsule(f64, f64),
    /// A cylinder along z: radius and length.
    Cylinder(f64, f64),
    /// A mesh file with the name of its unit: `m`, `cm` or `mm`.
    File(PathBuf, String),
}

/// Why a scene file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write the scene: {error}", path.display())]
pub struct WriteError {
    path: PathBuf,
    error: std::io::Error,
}

impl SceneDocument {
    /// Reads a scene file.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        // What is no scene is refused here, with file, line and key.
        Scene::load(path)?;
        let text = std::fs::read_to_string(path)
            .map_err(|error| SceneError::Read { path: path.to_owned(), error })?;
        Self::parse(&path.display().to_string(), &text, path.parent().unwrap_or(Path::new("")))
    }

    /// Takes a document from its text; `name` and `folder` as in [`Scene::parse`].
    ///
    /// # Errors
    /// When it is no TOML. Whether it is a scene, [`SceneDocument::scene`] tells.
    pub fn parse(name: &str, text: &str, folder: &Path) -> Result<Self, SceneError> {
        let document = text.parse::<DocumentMut>().map_err(|error| {
            let before = error.span().map_or("", |span| text.get(..span.start).unwrap_or_default());
            SceneError::Invalid {
                file: name.to_owned(),
                line: 1 + before.matches('\n').count(),
                key: None,
                message: error.message().to_owned(),
            }
        })?;
        Ok(Self { document, name: name.to_owned(), folder: folder.to_owned() })
    }

    /// The steel-bar scene that comes with the program.
    ///
    /// # Errors
    /// None, unless the program was built from a broken file.
    pub fn built_in() -> Result<Self, SceneError> {
        Self::parse(BUILT_IN_NAME, BUILT_IN, Path::new(""))
    }

    /// The scene, checked.
    ///
    /// # Errors
    /// As [`Scene::parse`].
    pub fn scene(&self) -> Result<Scene, SceneError> {
        Scene::parse(&self.name, &self.text(), &self.folder)
    }

    /// What would be saved.
    pub fn text(&self) -> String {
        self.document.to_string()
    }

    /// What messages call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What paths in it are relative to.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Saves it to a file, which it is from then on. In another folder, paths become absolute.
    ///
    /// # Errors
    /// When the file cannot be written; the document stays what it was.
    pub fn save(&mut self, path: &Path) -> Result<(), WriteError> {
        let failed = |error| WriteError { path: path.to_owned(), error };
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let mut moved = self.clone();
        if absolute(&folder).map_err(failed)? != absolute(&self.folder).map_err(failed)? {
            let from = absolute(&self.folder).map_err(failed)?;
            make_paths_absolute(moved.document.as_table_mut(), &from);
        }
        // Whole or not at all.
        let partial = path.with_extension("toml.partial");
        std::fs::write(&partial, moved.text()).map_err(failed)?;
        std::fs::rename(&partial, path).map_err(failed)?;
        *self = Self { name: path.display().to_string(), folder, ..moved };
        Ok(())
    }

    /// What an object is made of.
    pub fn set_material(&mut self, object: usize, material: Material) {
        self.change_object(object, |entry| set(entry, "material", material_value(material)));
    }

    /// Places an object, which from then on rests there: its trajectory is left out.
    pub fn place(&mut self, object: usize, pose: Pose) {
        self.change_object(object, |entry| {
            entry.remove("trajectory");
            place(entry, pose);
        });
    }

    /// Adds an object at the end of the list.
    pub fn add_object(&mut self, name: &str, shape: &NewShape, material: Material, pose: Pose) {
        let mut entry = Table::new();
        set(&mut entry, "name", name.into());
        let (key, value) = shape_entry(shape, &self.folder);
        set(&mut entry, key, value);
        if let NewShape::File(_, unit) = shape {
            set(&mut entry, "unit", unit.as_str().into());
        }
        place(&mut entry, pose);
        set(&mut entry, "material", material_value(material));
        if let Some(objects) = self.objects() {
            objects.push(entry);
        }
    }

    /// Leaves an object out.
    pub fn remove_object(&mut self, object: usize) {
        if let Some(objects) = self.objects().filter(|objects| object < objects.len()) {
            objects.remove(object);
        }
    }

    /// What surfaces do to the mesh.
    pub fn set_interface(&mut self, interface: Interface) {
        self.change_table("simulation", "interface", interface.name().into());
    }

    /// What finds surfaces.
    pub fn set_geometry(&mut self, geometry: GeometrySource) {
        self.change_table("simulation", "geometry", geometry.name().into());
    }

    /// Relative error of C that the iteration may leave.
    pub fn set_tolerance(&mut self, tolerance: f64) {
        self.change_table("solver", "tolerance", tolerance.into());
    }

    /// What the conjugate gradients are preconditioned with.
    pub fn set_preconditioner(&mut self, preconditioner: Preconditioner) {
        let named = match preconditioner {
            // Scene files have no name of their own for factors of all of K; both are exact.
            Preconditioner::Cholesky => Preconditioner::Direct,
            other => other,
        };
        self.change_table("solver", "preconditioner", named.name().into());
    }

    /// Where fields are computed.
    pub fn set_device(&mut self, device: Device) {
        self.change_table("solver", "device", device.name().into());
    }

    /// Threads; 0 for all cores.
    pub fn set_threads(&mut self, threads: usize) {
        let threads = i64::try_from(threads).unwrap_or(i64::MAX);
        self.change_table("solver", "threads", threads.into());
    }

    /// The objects as `[[object]]` tables, whichever way the file has them.
    fn objects(&mut self) -> Option<&mut ArrayOfTables> {
        let root = self.document.as_table_mut();
        if !matches!(root.get("object"), Some(Item::ArrayOfTables(_))) {
            let tables = root.remove("object").and_then(|item| item.into_array_of_tables().ok());
            root.insert("object", Item::ArrayOfTables(tables.unwrap_or_default()));
        }
        root.get_mut("object").and_then(Item::as_array_of_tables_mut)
    }

    fn change_object(&mut self, object: usize, change: impl FnOnce(&mut Table)) {
        if let Some(entry) = self.objects().and_then(|objects| objects.get_mut(object)) {
            change(entry);
        }
    }

    fn change_table(&mut self, table: &str, key: &str, value: Value) {
        let item = self.document.as_table_mut().entry(table).or_insert_with(|| Item::Table(Table::new()));
        if let Some(entry) = item.as_table_like_mut() {
            set(entry, key, value);
        }
    }
}

fn absolute(folder: &Path) -> std::io::Result<PathBuf> {
    match folder.as_os_str().is_empty() {
        true => std::env::current_dir(),
        false => std::path::absolute(folder),
    }
}

/// Sets a value; what is written around the one before it, such as a comment, stays.
fn set(entry: &mut dyn TableLike, key: &str, mut value: Value) {
    if let Some(before) = entry.get(key).and_then(Item::as_value) {
        *value.decor_mut() = before.decor().clone();
    }
    entry.insert(key, Item::Value(value));
}

fn place(entry: &mut dyn TableLike, pose: Pose) {
    set(entry, "position", array(&pose.translation.to_array()));
    if pose.rotation == capsense_core::glam::DQuat::IDENTITY {
        entry.remove("rotation");
    } else {
        set(entry, "rotation", array(&pose.rotation.to_array()));
    }
}

fn array(numbers: &[f64]) -> Value {
    Value::Array(numbers.iter().copied().collect::<Array>())
}

fn material_value(material: Material) -> Value {
    let mut table = InlineTable::new();
    match material {
        Material::Dielectric(permittivity) => {
            table.insert("relative_permittivity", permittivity.value().into());
        }
        Material::Conductor(connection) => {
            table.insert("conductor", connection_value(connection));
        }
    }
    table.into()
}

fn connection_value(connection: Connection) -> Value {
    match connection {
        Connection::Grounded => "grounded".into(),
        Connection::Floating => "floating".into(),
        Connection::Capacitance(farads) => {
            let mut table = InlineTable::new();
            table.insert("capacitance", farads.into());
            table.into()
        }
    }
}

fn shape_entry(shape: &NewShape, folder: &Path) -> (&'static str, Value) {
    let table = |keys: &[(&str, f64)]| {
        let mut table = InlineTable::new();
        for (key, length) in keys {
            table.insert(*key, (*length).into());
        }
        Value::from(table)
    };
    match shape {
        NewShape::Box(size) => {
            let mut table = InlineTable::new();
            table.insert("size", array(&size.to_array()));
            ("box", table.into())
        }
        NewShape::Sphere(radius) => ("sphere", table(&[("radius", *radius)])),
        NewShape::Capsule(radius, length) => ("capsule", table(&[("radius", *radius), ("length", *length)])),
        NewShape::Cylinder(radius, length) => {
            ("cylinder", table(&[("radius", *radius), ("length", *length)]))
        }
        NewShape::File(path, _) => {
            // Below the scene's folder a relative path lets both be moved together.
            let from = absolute(folder).unwrap_or_default();
            let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
            let shown = path.strip_prefix(&from).unwrap_or(&path);
            ("file", shown.to_string_lossy().into_owned().into())
        }
    }
}

/// Makes every path in a table and in those below absolute.
fn make_paths_absolute(table: &mut dyn TableLike, folder: &Path) {
    for (key, item) in table.iter_mut() {
        let is_file = FILE_KEYS.contains(&key.get());
        make_item_absolute(item, is_file, folder);
    }
}

fn make_item_absolute(item: &mut Item, is_file: bool, folder: &Path) {
    match item {
        Item::Value(Value::String(path)) if is_file => {
            let text = folder.join(path.value()).to_string_lossy().into_owned();
            let mut value = Value::from(text);
            *value.decor_mut() = path.decor().clone();
            *item = Item::Value(value);
        }
        Item::Value(Value::InlineTable(table)) => make_paths_absolute(table, folder),
        Item::Value(Value::Array(array)) => {
            for value in array.iter_mut() {
                if let Value::InlineTable(table) = value {
                    make_paths_absolute(table, folder);
                }
            }
        }
        Item::Table(table) => make_paths_absolute(table, folder),
        Item::ArrayOfTables(tables) => {
            tables.iter_mut().for_each(|table| make_paths_absolute(table, folder));
        }
        Item::Value(_) | Item::None => {}
    }
}
