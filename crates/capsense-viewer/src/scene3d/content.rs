//! The vertices of what is to be seen, made again only when what they show is another.

use super::buffers::{self, SliceVertex};
use super::colour_map::{VIRIDIS, round_up};
use super::frame::{BodyPose, Computed, Frame3d};
use super::gizmo::Sight;
use super::gpu::{Body, BodyState, Globals, Part, Picture, Vertices};
use super::options::{Clip, Quantity, ViewOptions};
use super::overlay::Legend;
use super::slice::{Plane, Slice, quantile};
use super::static_scene::StaticScene;
use super::theme::Theme;
use crate::palette::material_colour;
use glam::{DMat4, DVec3};
use std::sync::Arc;

/// Magnitudes of E above that of this part of a slice are drawn alike: at edges of conductors they have no bound.
const MOST_OF_FIELD: f64 = 0.985;
/// Of the range of a slice, how far its level lines are apart.
const LEVELS: f64 = 10.0;
/// How much of what is behind a body is hidden by it.
const BODY_ALPHA: f32 = 0.34;

/// What parts were made from.
#[derive(Debug)]
struct Made {
    scene: Arc<StaticScene>,
    computed: Arc<Computed>,
    theme: Theme,
    options: ViewOptions,
}

/// A slice and where it is.
#[derive(Debug)]
struct Cut {
    plane: Plane,
    slice: Slice,
}

/// The vertices of all that is to be seen.
#[derive(Debug, Default)]
pub(super) struct Content {
    made: Option<Made>,
    parts: [Vertices; Part::COUNT],
    bodies: Vec<Vertices>,
    cut: Option<Cut>,
    legend: Option<Legend>,
}

impl Content {
    /// Makes what differs from the last time.
    pub(super) fn update(&mut self, frame: &Frame3d, options: &ViewOptions, theme: &Theme) {
        let before = self.made.take();
        let before = before.as_ref();
        let is_scene = before.is_some_and(|made| Arc::ptr_eq(&made.scene, &frame.scene));
        let is_frame = is_scene && before.is_some_and(|made| Arc::ptr_eq(&made.computed, &frame.computed));
        let is_theme = before.is_some_and(|made| made.theme == *theme);
        if !is_scene {
            self.bodies = frame.scene.bodies.iter().map(|body| Vertices::new(&buffers::body(body))).collect();
            self.cut = None;
            self.set(Part::Electrodes, &buffers::electrodes(&frame.scene));
        }
        if !(is_scene && is_theme) {
            self.set(Part::Board, &buffers::board(&frame.scene, theme));
            self.set(Part::Outlines, &buffers::outlines(&frame.scene, theme));
        }
        let clip = |options: &ViewOptions| options.mesh.then_some(options.clip);
        if !(is_scene && is_theme && before.is_some_and(|made| clip(&made.options) == clip(options))) {
            self.make_section(frame, clip(options), theme);
        }
        let same = |choice: fn(&ViewOptions) -> bool| {
            is_frame && is_theme && before.is_some_and(|made| choice(&made.options) == choice(options))
        };
        if !same(|options| options.occupied) {
            self.set(Part::Occupied, &of(options.occupied, || buffers::occupied(frame)));
        }
        if !same(|options| options.changed) {
            self.set(Part::Changed, &of(options.changed, || buffers::changed(frame, theme)));
        }
        if !same(|options| options.cut_edges) {
            self.set(Part::CutEdges, &of(options.cut_edges, || buffers::cut_edges(frame, theme)));
        }
        let slice = |options: &ViewOptions| {
            options.slice.then_some((options.slice_plane, options.quantity, options.electrode))
        };
        if !(is_frame && before.is_some_and(|made| slice(&made.options) == slice(options))) {
            self.make_slice(frame, options);
        }
        self.made = Some(Made {
            scene: frame.scene.clone(),
            computed: frame.computed.clone(),
            theme: *theme,
            options: *options,
        });
    }

    fn set<T: bytemuck::NoUninit>(&mut self, part: Part, vertices: &[T]) {
        self.parts[part as usize] = Vertices::new(vertices);
    }

    fn make_section(&mut self, frame: &Frame3d, clip: Option<Clip>, theme: &Theme) {
        let [cut, walls] = match clip {
            Some(clip) => buffers::section(&frame.scene, |point| clip.keeps(point), theme),
            None => Default::default(),
        };
        self.set(Part::Section, &cut);
        self.set(Part::Walls, &walls);
    }

    fn make_slice(&mut self, frame: &Frame3d, options: &ViewOptions) {
        let potentials = frame.potentials(options.electrode);
        if !options.slice || potentials.is_empty() {
            self.set::<SliceVertex>(Part::Slice, &[]);
            self.legend = None;
            return;
        }
        let plane = options.slice_plane;
        if self.cut.as_ref().is_none_or(|cut| cut.plane != plane) {
            self.cut = Some(Cut { plane, slice: Slice::new(&frame.scene, plane) });
        }
        let Some(Cut { slice, .. }) = &self.cut else {
            return;
        };
        let name = &frame.scene.electrodes[options.electrode].name;
        let (values, range, title) = match options.quantity {
            Quantity::Potential => {
                (slice.values(potentials), [0.0, 1.0], format!("potential, {name} at 1 V"))
            }
            Quantity::Field => {
                let at_nodes = slice.field_at_nodes(&frame.scene, potentials, &frame.computed.holders);
                let values = slice.values(&at_nodes);
                let most = round_up(f64::from(quantile(&values, MOST_OF_FIELD)));
                (values, [0.0, most], format!("|E|, {name} at 1 V"))
            }
        };
        let corners = slice.positions().iter().zip(&values);
        let vertices: Vec<SliceVertex> = corners
            .map(|(position, &value)| SliceVertex { position: position.as_vec3().to_array(), value })
            .collect();
        self.set(Part::Slice, &vertices);
        self.legend = Some(Legend { title, unit: options.quantity.unit(), range });
    }

    /// What the colours of the slice stand for, if there is one.
    pub(super) fn legend(&self) -> Option<&Legend> {
        self.legend.as_ref()
    }

    /// The picture from somewhere.
    pub(super) fn picture(&self, sight: &Sight, seen: &Seen<'_>, pixels_per_point: f32) -> Picture {
        let size = (sight.rect.size() * pixels_per_point).round();
        let theme = seen.theme;
        let (bodies, behind) = self.sorted_bodies(sight, seen);
        Picture {
            size: [size.x.max(1.0) as u32, size.y.max(1.0) as u32],
            background: theme.background.to_normalized_gamma_f32(),
            globals: self.globals(sight, theme, size, pixels_per_point),
            parts: self.parts.clone(),
            bodies,
            behind,
        }
    }

    fn globals(&self, sight: &Sight, theme: &Theme, size: egui::Vec2, pixels_per_point: f32) -> Globals {
        let camera = &sight.camera;
        let is_perspective = f32::from(u8::from(!camera.is_orthographic));
        // What brings lines in front of the surfaces that they lie in, in depths from 0 to 1.
        let pull = if camera.is_orthographic { 1e-5 } else { 2.5e-5 };
        let range = self.legend.as_ref().map_or([0.0, 1.0], |legend| legend.range.map(|end| end as f32));
        let wire = theme.wire.to_srgba_unmultiplied().map(|part| f32::from(part) / 255.0);
        let clip = camera.clip_from_sensor(f64::from(size.x / size.y.max(1.0)));
        Globals {
            clip_from_sensor: clip.as_mat4().to_cols_array_2d(),
            eye: camera.eye().as_vec3().extend(is_perspective).to_array(),
            forward: camera.axes()[2].as_vec3().extend(0.0).to_array(),
            picture: [size.x, size.y, pixels_per_point, pull],
            scale: [range[0], range[1], (range[1] - range[0]) / LEVELS as f32, 1.0],
            wire,
            map: VIRIDIS.map(|[r, g, b]| [r, g, b, 255].map(|part| f32::from(part) / 255.0)),
        }
    }

    /// Bodies, those behind the slice before the others and the farthest first, and how many are behind the slice.
    fn sorted_bodies(&self, sight: &Sight, seen: &Seen<'_>) -> (Vec<Body>, usize) {
        if !seen.options.bodies {
            return (Vec::new(), 0);
        }
        let forward = sight.camera.axes()[2];
        let Plane { axis, position } = seen.options.slice_plane;
        let eye = sight.camera.eye()[axis] - position;
        let is_behind = |place: DVec3| seen.options.slice && (place[axis] - position) * eye < 0.0;
        let surfaces = self.bodies.iter().zip(&seen.frame.scene.bodies);
        let mut bodies: Vec<(bool, f64, Body)> = surfaces
            .zip(seen.bodies)
            .enumerate()
            .filter(|(_, ((vertices, _), _))| !vertices.is_empty())
            .map(|(index, ((vertices, surface), body))| {
                let middle = 0.5 * (surface.bounds.min + surface.bounds.max);
                let middle = body.pose().sensor_from_object(middle);
                let is_selected = seen.selected == Some(index);
                let [r, g, b, _] = material_colour(&surface.material).to_normalized_gamma_f32();
                let sensor_from_body =
                    DMat4::from_scale_rotation_translation(DVec3::ONE, body.rotation, body.position);
                let state = BodyState {
                    sensor_from_body: sensor_from_body.as_mat4().to_cols_array_2d(),
                    colour: [r, g, b, BODY_ALPHA],
                    state: [f32::from(u8::from(is_selected)), 0.0, 0.0, 0.0],
                };
                (is_behind(middle), middle.dot(forward), Body { vertices: vertices.clone(), state })
            })
            .collect();
        bodies.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
        let behind = bodies.iter().filter(|(is_behind, ..)| *is_behind).count();
        (bodies.into_iter().map(|(.., body)| body).collect(), behind)
    }
}

/// What a picture shows beside vertices.
pub(super) struct Seen<'a> {
    pub(super) frame: &'a Frame3d,
    pub(super) bodies: &'a [BodyPose],
    pub(super) selected: Option<usize>,
    pub(super) options: &'a ViewOptions,
    pub(super) theme: &'a Theme,
}

/// Vertices if they are wanted.
fn of<T>(is_wanted: bool, make: impl FnOnce() -> Vec<T>) -> Vec<T> {
    if is_wanted { make() } else { Vec::new() }
}
