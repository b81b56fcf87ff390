//! What things are drawn in, on dark and on light ground.

use egui::{Color32, Visuals};

/// Colours of the scene; all but the background may be transparent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Theme {
    pub(super) is_dark: bool,
    pub(super) background: Color32,
    pub(super) domain: Color32,
    pub(super) board: Color32,
    pub(super) board_edge: Color32,
    pub(super) section: Color32,
    pub(super) section_in_board: Color32,
    pub(super) wall: Color32,
    /// Sides of triangles of the mesh.
    pub(super) wire: Color32,
    pub(super) cut: Color32,
    pub(super) changed: Color32,
    pub(super) selected: Color32,
    pub(super) text: Color32,
}

impl Theme {
    /// What goes with the rest of the window.
    pub(super) fn of(visuals: &Visuals) -> Self {
        let shade = |level: u8, alpha: u8| Color32::from_rgba_unmultiplied(level, level, level, alpha);
        if visuals.dark_mode {
            Self {
                is_dark: true,
                background: Color32::from_rgb(0x17, 0x1a, 0x1f),
                domain: shade(0xc8, 0x50),
                board: Color32::from_rgba_unmultiplied(0x4d, 0x7a, 0x62, 0x60),
                board_edge: Color32::from_rgba_unmultiplied(0x7d, 0xb0, 0x96, 0x90),
                section: Color32::from_rgb(0x2b, 0x33, 0x3d),
                section_in_board: Color32::from_rgb(0x30, 0x49, 0x3d),
                wall: shade(0xff, 0x00),
                wire: shade(0xe0, 0x4c),
                cut: Color32::from_rgb(0xff, 0xc1, 0x4d),
                changed: Color32::from_rgba_unmultiplied(0xff, 0x7a, 0x3c, 0x58),
                selected: Color32::from_rgb(0xff, 0xd5, 0x80),
                text: shade(0xdc, 0xff),
            }
        } else {
            Self {
                is_dark: false,
                background: Color32::from_rgb(0xf7, 0xf8, 0xfa),
                domain: shade(0x30, 0x58),
                board: Color32::from_rgba_unmultiplied(0x7f, 0xb5, 0x98, 0x70),
                board_edge: Color32::from_rgba_unmultiplied(0x4d, 0x80, 0x66, 0xa0),
                section: Color32::from_rgb(0xe3, 0xe8, 0xee),
                section_in_board: Color32::from_rgb(0xcf, 0xe4, 0xd8),
                wall: shade(0x00, 0x00),
                wire: shade(0x28, 0x58),
                cut: Color32::from_rgb(0xc2, 0x6a, 0x00),
                changed: Color32::from_rgba_unmultiplied(0xf0, 0x5a, 0x14, 0x58),
                selected: Color32::from_rgb(0xd0, 0x84, 0x00),
                text: shade(0x30, 0xff),
            }
        }
    }
}
