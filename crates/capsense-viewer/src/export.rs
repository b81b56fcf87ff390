//! Pictures as PNG files.

use egui::ColorImage;
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Why a picture cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {error}", path.display())]
pub struct PngError {
    path: PathBuf,
    error: image::ImageError,
}

/// Writes four bytes a pixel, red first, row by row.
///
/// # Errors
/// When the file cannot be written.
pub fn write_png(path: &Path, pixels: &[u8], [width, height]: [u32; 2]) -> Result<(), PngError> {
    let failed = |error| PngError { path: path.to_owned(), error };
    let file = std::fs::File::create(path).map_err(|error| failed(error.into()))?;
    // Small files, as pictures of windows are mostly ground.
    let encoder =
        PngEncoder::new_with_quality(BufWriter::new(file), CompressionType::Best, FilterType::Adaptive);
    encoder.write_image(pixels, width, height, image::ExtendedColorType::Rgba8).map_err(failed)
}

/// Writes the next frame of the window to a file. A failure is told on standard error, as the frame comes later.
pub fn window_png(ctx: &egui::Context, path: PathBuf) {
    let write = move |picture: std::sync::Arc<ColorImage>| {
        let pixels: Vec<u8> = picture.pixels.iter().flat_map(egui::Color32::to_array).collect();
        if let Err(error) = write_png(&path, &pixels, picture.size.map(|side| side as u32)) {
            eprintln!("error: {error}");
        }
    };
    ctx.send_viewport_cmd(egui::ViewportCommand::Screenshot(egui::ScreenshotCallback::new(write)));
    ctx.request_repaint();
}
