//! Pictures as PNG files.

use egui::ColorImage;
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

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

/// Pictures of the window that were asked for. They come with the frame after, and what became of them later still.
#[derive(Debug)]
pub struct WindowPictures {
    sender: Sender<Written>,
    receiver: Receiver<Written>,
}

/// The file that was written, or why not.
type Written = Result<PathBuf, PngError>;

impl Default for WindowPictures {
    fn default() -> Self {
        let (sender, receiver) = channel();
        Self { sender, receiver }
    }
}

impl WindowPictures {
    /// Writes the next frame of the window to a file.
    pub fn ask(&self, ctx: &egui::Context, path: PathBuf) {
        let (sender, again) = (self.sender.clone(), ctx.clone());
        let write = move |picture: std::sync::Arc<ColorImage>| {
            let pixels: Vec<u8> = picture.pixels.iter().flat_map(egui::Color32::to_array).collect();
            let written = write_png(&path, &pixels, picture.size.map(|side| side as u32));
            // A window that is closed has nobody to tell.
            let _ = sender.send(written.map(|()| path));
            again.request_repaint();
        };
        ctx.send_viewport_cmd(egui::ViewportCommand::Screenshot(egui::ScreenshotCallback::new(write)));
        ctx.request_repaint();
    }

    /// What became of a picture, if that is new.
    pub fn news(&self) -> Option<Written> {
        self.receiver.try_recv().ok()
    }
}
