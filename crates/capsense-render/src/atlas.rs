//! Where each object's image lies in the depth atlas.
//!
//! An atlas is a grid of equal tiles. Objects that do not fit into one atlas are drawn in further pages, one after the
//! other into the same texture.

use crate::error::RenderError;

/// Rows of a texture copied to a buffer start at multiples of this many bytes.
const ROW_ALIGNMENT: u64 = 256;

/// Bytes of one depth value.
const DEPTH_BYTES: u64 = 4;

/// Two layers of more than this many bytes are split into pages even if the adapter would take them at once.
const PAGE_BYTES: u64 = 256 << 20;

/// A grid of tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Atlas {
    tile_width: u32,
    tile_height: u32,
    columns: u32,
    rows: u32,
}

impl Atlas {
    /// The smallest grid for some objects that fits into a square texture of `max_dimension` and whose two layers fit
    /// into a buffer of `max_bytes`.
    pub(crate) fn new(
        (width, height): (usize, usize),
        objects: usize,
        max_dimension: u32,
        max_bytes: u64,
    ) -> Result<Self, RenderError> {
        let dimension = |what, pixels: usize| match u32::try_from(pixels) {
            Ok(pixels) if pixels <= max_dimension => Ok(pixels),
            _ => Err(RenderError::LimitExceeded { what, needed: pixels as u64, limit: max_dimension.into() }),
        };
        let tile_width = dimension("the width of the depth image", width)?;
        let tile_height = dimension("the height of the depth image", height)?;
        let single = Self { tile_width, tile_height, columns: 1, rows: 1 };
        if single.buffer_bytes() > max_bytes {
            return Err(RenderError::LimitExceeded {
                what: "the size of the depth image in bytes",
                needed: single.buffer_bytes(),
                limit: max_bytes,
            });
        }
        let objects = u32::try_from(objects).unwrap_or(u32::MAX).max(1);
        let page_bytes = max_bytes.min(PAGE_BYTES);
        let mut atlas = Self { columns: objects.min(max_dimension / tile_width), ..single };
        while atlas.columns > 1 && atlas.buffer_bytes() > page_bytes {
            atlas.columns = atlas.columns.div_ceil(2);
        }
        let rows_in_bytes = (page_bytes / atlas.buffer_bytes()).clamp(1, u32::MAX.into()) as u32;
        atlas.rows =
            objects.div_ceil(atlas.columns).min(max_dimension / tile_height).min(rows_in_bytes).max(1);
        Ok(atlas)
    }

    /// Number of objects that fit into one page.
    pub(crate) fn capacity(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Width and height of the texture.
    pub(crate) fn size(&self) -> (u32, u32) {
        (self.columns * self.tile_width, self.rows * self.tile_height)
    }

    /// Column and row of the first pixel of a tile.
    pub(crate) fn tile(&self, index: usize) -> (u32, u32) {
        let index = index as u32;
        (index % self.columns * self.tile_width, index / self.columns * self.tile_height)
    }

    /// Bytes from one row of pixels to the next, once copied to a buffer.
    pub(crate) fn row_bytes(&self) -> u64 {
        (u64::from(self.size().0) * DEPTH_BYTES).next_multiple_of(ROW_ALIGNMENT)
    }

    /// Bytes of one layer, once copied to a buffer.
    pub(crate) fn layer_bytes(&self) -> u64 {
        self.row_bytes() * u64::from(self.size().1)
    }

    /// Bytes of the front and the back layer.
    pub(crate) fn buffer_bytes(&self) -> u64 {
        2 * self.layer_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLENTY: u64 = 1 << 40;

    #[test]
    fn a_few_objects_stand_side_by_side() {
        let atlas = Atlas::new((64, 48), 3, 1024, PLENTY).unwrap();
        assert_eq!((atlas.size(), atlas.capacity()), ((192, 48), 3));
        assert_eq!(atlas.tile(2), (128, 0));
        assert_eq!((atlas.row_bytes(), atlas.buffer_bytes()), (768, 2 * 768 * 48));
    }

    #[test]
    fn rows_and_pages_follow() {
        let atlas = Atlas::new((97, 61), 40, 256, PLENTY).unwrap();
        assert_eq!((atlas.size(), atlas.capacity()), ((194, 244), 8));
        assert_eq!(atlas.tile(3), (97, 61));
        assert_eq!(atlas.row_bytes(), 1024);
    }

    #[test]
    fn a_small_buffer_shrinks_the_page() {
        let atlas = Atlas::new((64, 64), 40, 4096, 6 * 64 * 256 * 2).unwrap();
        assert!(atlas.buffer_bytes() <= 6 * 64 * 256 * 2 && atlas.capacity() >= 4, "{atlas:?}");
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let too_wide = Atlas::new((257, 1), 1, 256, PLENTY).unwrap_err();
        assert!(too_wide.to_string().contains("width of the depth image is 257"), "{too_wide}");
        let too_high = Atlas::new((1, 300), 1, 256, PLENTY).unwrap_err();
        assert!(too_high.to_string().contains("height of the depth image is 300"), "{too_high}");
        let too_large = Atlas::new((64, 64), 1, 256, 1000).unwrap_err();
        assert!(too_large.to_string().contains("bytes is 32768"), "{too_large}");
    }

    #[test]
    fn no_objects_need_one_tile() {
        assert_eq!(Atlas::new((64, 64), 0, 256, PLENTY).unwrap().capacity(), 1);
    }
}
