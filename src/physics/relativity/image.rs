//! Pictures of pixels.

/// A picture of red, green and blue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixels, row by row from the upper left corner.
    pub pixels: Vec<[u8; 3]>,
}

impl Image {
    /// Pictures side by side, with white columns between them; what is not as high as the highest is white below.
    pub(crate) fn beside(images: &[Self], gap: usize) -> Self {
        let white = [255; 3];
        let height = images.iter().map(|image| image.height).max().unwrap_or(0);
        let mut pixels = Vec::new();
        for row in 0..height {
            for (k, image) in images.iter().enumerate() {
                pixels.extend(std::iter::repeat_n(white, if k > 0 { gap } else { 0 }));
                match image.pixels.chunks_exact(image.width.max(1)).nth(row) {
                    Some(row) => pixels.extend_from_slice(row),
                    None => pixels.extend(std::iter::repeat_n(white, image.width)),
                }
            }
        }
        let width = images.iter().map(|image| image.width).sum::<usize>() + gap * images.len().saturating_sub(1);
        Self { width, height, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let one = Image { width: 1, height: 2, pixels: vec![[1; 3], [2; 3]] };
        let two = Image { width: 2, height: 1, pixels: vec![[3; 3], [4; 3]] };
        let both = Image::beside(&[one, two], 1);
        let (white, numbers) = ([255; 3], |k: u8| [k; 3]);
        assert_eq!((both.width, both.height), (4, 2));
        assert_eq!(both.pixels[..4], [numbers(1), white, numbers(3), numbers(4)]);
        assert_eq!(both.pixels[4..], [numbers(2), white, white, white]);
        assert_eq!(Image::beside(&[], 3), Image { width: 0, height: 0, pixels: Vec::new() });
    }
}
