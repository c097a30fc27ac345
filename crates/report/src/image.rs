use super::color::mix;
use super::{BACKGROUND, Color, ReportError, font};
use drape_cloth::file::write_atomic;
use std::io::Write;
use std::path::Path;

/// Pixels between images that stand beside each other.
const GAP: usize = 6;

/// A picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Shape `[height * width]`, row by row from the top left.
    pub pixels: Vec<Color>,
}

impl Image {
    /// An image of one colour.
    pub fn new(width: usize, height: usize, color: Color) -> Self {
        Self {
            width,
            height,
            pixels: vec![color; width * height],
        }
    }

    /// The images from left to right, their upper edges aligned, on the background of a
    /// scene. No images give an image without pixels.
    pub fn beside(images: &[Image]) -> Image {
        let width = images.iter().map(|image| image.width).sum::<usize>()
            + GAP * images.len().saturating_sub(1);
        let height = images.iter().map(|image| image.height).max().unwrap_or(0);
        let mut all = Image::new(width, height, BACKGROUND);
        let mut left = 0;
        for image in images.iter().filter(|image| image.width > 0) {
            for (y, row) in image.pixels.chunks_exact(image.width).enumerate() {
                all.pixels[y * width + left..][..image.width].copy_from_slice(row);
            }
            left += image.width + GAP;
        }
        all
    }

    /// Writes `text` with its upper left corner (of a capital letter) at `at` = (x, y) [px];
    /// `size` is the em size [px]. What does not fit the image is cut off.
    pub fn label(&mut self, at: [i32; 2], text: &str, size: f32, color: Color) {
        let baseline = at[1] + font::cap_height(size).round() as i32;
        font::draw_text(text, size, |x, y, coverage| {
            self.blend(at[0] + x, baseline + y, color, coverage.into());
        });
    }

    /// Lays `color` over a pixel with opacity `alpha`; nothing happens outside the image.
    pub(super) fn blend(&mut self, x: i32, y: i32, color: Color, alpha: f64) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
            return;
        };
        if x < self.width && y < self.height {
            let pixel = &mut self.pixels[y * self.width + x];
            *pixel = mix(*pixel, color, alpha.clamp(0.0, 1.0));
        }
    }

    /// Writes the image as PNG, atomically.
    pub fn save_png(&self, path: &Path) -> Result<(), ReportError> {
        let bytes = self.png().map_err(|source| ReportError::Png {
            path: path.to_path_buf(),
            source,
        })?;
        Ok(write_atomic(path, |file| file.write_all(&bytes))?)
    }

    fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let side = |n: usize| u32::try_from(n).map_err(|_| png::EncodingError::LimitsExceeded);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side(self.width)?, side(self.height)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_decodes_to_the_same_pixels() {
        let mut image = Image::new(37, 21, [9, 8, 7]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            pixel[0] = (i * 5 % 256) as u8;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        image.save_png(&path).unwrap();

        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.width, info.height), (37, 21));
        assert_eq!(info.color_type, png::ColorType::Rgb);
        assert_eq!(bytes, image.pixels.as_flattened());
    }

    #[test]
    fn image_without_pixels_is_an_error_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("nothing.png");
        let error = Image::beside(&[]).save_png(&path).unwrap_err();
        assert!(matches!(error, ReportError::Png { .. }));
        assert!(error.to_string().contains("nothing.png"));
        assert!(!path.exists());
    }

    #[test]
    fn images_stand_beside_each_other() {
        let (red, blue) = ([255, 0, 0], [0, 0, 255]);
        let both = Image::beside(&[Image::new(3, 5, red), Image::new(4, 2, blue)]);
        assert_eq!((both.width, both.height), (3 + GAP + 4, 5));
        let count = |color| both.pixels.iter().filter(|&&p| p == color).count();
        assert_eq!((count(red), count(blue)), (15, 8));
        assert_eq!(both.pixels[4 * both.width + 2], red);
        assert_eq!(both.pixels[both.width + both.width - 1], blue);
    }

    #[test]
    fn label_starts_at_its_corner_and_is_cut_at_the_edges() {
        let mut image = Image::new(60, 40, [0; 3]);
        image.label([10, 12], "H", 20.0, [255; 3]);
        let lit = |(i, pixel): (usize, &Color)| (pixel[0] > 127).then_some((i % 60, i / 60));
        let lit: Vec<_> = image.pixels.iter().enumerate().filter_map(lit).collect();
        assert_eq!(lit.iter().map(|p| p.1).min(), Some(12));
        assert!(lit.iter().all(|p| (10..28).contains(&p.0) && p.1 < 28));

        let before = image.clone();
        image.label([-500, 5], "far out", 12.0, [255; 3]);
        assert!(image == before);
        image.label([50, 35], "Cut off", 30.0, [255; 3]);
        assert!(image != before);
    }
}
