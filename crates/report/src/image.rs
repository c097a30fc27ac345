use super::text::{self, Area};
use super::{BACKGROUND, Color, ColorMap};
use drape_cloth::file::{WriteError, write_atomic};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use std::io::{self, Write};
use std::path::Path;

/// Pixels between images that stand beside each other.
const GAP: usize = 6;
/// Samples per pixel each way of what plotters draws, so that strokes and letters are smooth.
pub(super) const PX: i32 = 3;

/// Em size of the texts of a colour bar, height of the bar, and of the strip that holds title,
/// bar and ticks [px].
const BAR_EM: f32 = 15.0;
const BAR: i32 = 14;
const BAR_STRIP: usize = 66;
const BAR_INK: Color = [232, 232, 228];

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
        let gaps = GAP * images.len().saturating_sub(1);
        let width = gaps + images.iter().map(|image| image.width).sum::<usize>();
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

    /// The image with a strip below that says what colours mean: a bar of the whole `map` over
    /// `ticks` at even steps, and a `title` with the unit.
    pub fn with_color_bar(&self, map: ColorMap, title: &str, ticks: &[String]) -> Image {
        let mut all = Image::new(self.width, self.height + BAR_STRIP, BACKGROUND);
        all.pixels[..self.pixels.len()].copy_from_slice(&self.pixels);
        let em = f64::from(BAR_EM);
        // Ticks at the ends stick out by half of their width.
        let widths = ticks.iter().map(|tick| text::width(tick, em));
        let left = BAR + widths.max().unwrap_or(0) / 2;
        let top = self.height as i32 + 8;
        all.label([BAR, top], title, BAR_EM, BAR_INK);
        let length = (self.width as i32 - 2 * left).max(0);
        all.gradient([left, top + 20], [length, BAR], map);
        for (k, tick) in (0..).zip(ticks) {
            let x = left + length * k / (ticks.len() as i32 - 1).max(1);
            let place = [x - text::width(tick, em) / 2, top + 26 + BAR];
            all.label(place, tick, BAR_EM, BAR_INK);
        }
        all
    }

    /// Fills a rectangle with all colours of `map` from left to right; what does not fit the
    /// image is cut off.
    pub fn gradient(&mut self, [left, top]: [i32; 2], [width, height]: [i32; 2], map: ColorMap) {
        let area = self.area();
        for x in 0..width {
            let color = text::rgb(map.at(f64::from(x) / f64::from((width - 1).max(1))));
            let column = [(left + x, top), (left + x, top + height - 1)];
            let drawn = area.draw(&PathElement::new(column, color));
            drawn.expect("memory takes all pixels");
        }
    }

    /// Writes `text` with its upper left corner (of a capital letter) at `at` = (x, y) [px];
    /// `size` is the em size [px]. What does not fit the image is cut off.
    pub fn label(&mut self, [x, y]: [i32; 2], text: &str, size: f32, color: Color) {
        let em = f64::from(size);
        let middle = y + text::capital(em) / 2;
        text::draw(&self.area(), text, [x, middle], em, color, HPos::Left);
    }

    /// The image for plotters to draw on.
    pub(super) fn area(&mut self) -> Area<'_> {
        let size = (self.width as u32, self.height as u32);
        BitMapBackend::with_buffer(self.pixels.as_flattened_mut(), size).into_drawing_area()
    }

    /// The image with each `factor` x `factor` pixels averaged; a rest is left out.
    pub(super) fn reduced(&self, factor: usize) -> Image {
        let mut image = Image::new(self.width / factor, self.height / factor, [0; 3]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            let [x, y] = [i % image.width, i / image.width].map(|at| at * factor);
            let mut sum = [0; 3];
            for row in y..y + factor {
                for sample in &self.pixels[row * self.width + x..][..factor] {
                    sum = std::array::from_fn(|c| sum[c] + usize::from(sample[c]));
                }
            }
            let count = factor * factor;
            *pixel = sum.map(|sum| ((sum + count / 2) / count) as u8);
        }
        image
    }

    /// Writes the image as PNG, atomically.
    pub fn save_png(&self, path: &Path) -> Result<(), WriteError> {
        write_atomic(path, |file| Ok(self.encode(file)?))
    }

    /// The image as PNG.
    ///
    /// # Errors
    /// If it has no pixels.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.encode(&mut bytes)?;
        Ok(bytes)
    }

    fn encode(&self, to: impl Write) -> Result<(), png::EncodingError> {
        let [width, height] = [self.width, self.height].map(|side| side as u32);
        let mut encoder = png::Encoder::new(to, width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()
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

    #[test]
    fn color_bar_has_all_colours_below_an_unchanged_picture() {
        let image = Image::new(400, 50, [1, 2, 3]);
        let ticks = ["-5", "0", "5"].map(String::from);
        let bar = |image: &Image| image.with_color_bar(ColorMap::Deviation, "d [mm]", &ticks);
        let all = bar(&image);
        assert_eq!((all.width, all.height), (400, 50 + BAR_STRIP));
        assert_eq!(all.pixels[..image.pixels.len()], image.pixels);
        for t in [0.0, 0.5, 1.0] {
            let color = ColorMap::Deviation.at(t);
            let near = |p: &&Color| (0..3).all(|c| p[c].abs_diff(color[c]) < 3);
            let count = all.pixels.iter().filter(near).count();
            assert!(count >= BAR as usize, "{t}");
        }
        // Too narrow for a bar: no panic.
        assert_eq!(bar(&Image::new(9, 3, [0; 3])).width, 9);
    }
}
