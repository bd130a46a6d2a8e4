/// A picture in linear RGB, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels, row by row.
    pub pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture of one color.
    #[must_use]
    pub fn filled(width: u32, height: u32, color: [f32; 3]) -> Self {
        Self { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// Index of a pixel in [`Picture::pixels`]; `x` is less than the width, `y` less than the height.
    #[must_use]
    pub fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// The part of the picture with this top left corner and this size.
    ///
    /// # Panics
    /// If it exceeds the picture.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        let pixels = cropped(&self.pixels, self.width, corner, size);
        Self { width: size[0], height: size[1], pixels }
    }

    /// Fills a rectangle given by its top left corner and its size, clipped to the picture.
    pub(crate) fn fill(&mut self, [left, top]: [u32; 2], [width, height]: [u32; 2], color: [f32; 3]) {
        for y in top..top.saturating_add(height).min(self.height) {
            for x in left..left.saturating_add(width).min(self.width) {
                let index = self.index(x, y);
                self.pixels[index] = color;
            }
        }
    }
}

/// The values in a rectangle of a picture of `width` pixels in a row.
pub(crate) fn cropped<T: Copy>(all: &[T], width: u32, [left, top]: [u32; 2], [columns, rows]: [u32; 2]) -> Vec<T> {
    let row = |y: u32| y as usize * width as usize + left as usize;
    (top..top + rows).flat_map(|y| &all[row(y)..row(y) + columns as usize]).copied().collect()
}
