use super::Image;
use drape_cloth::file::{WriteError, write_atomic};
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use rayon::prelude::*;
use std::error::Error;
use std::io::{self, Write};
use std::path::Path;

/// Of NeuQuant, which chooses the 256 colours of a frame that has more: from 1, best, to 30.
const QUANTISATION_SPEED: i32 = 10;

/// Writes `images` of one size as an animated GIF which loops endlessly, atomically. Each is
/// shown for `delay` and the last one for `hold` [1/100 s]; viewers show less than 2 as 10.
///
/// A frame stores only what changed since the one before. The file depends on the images
/// alone, not on the number of threads.
pub fn save_gif(images: &[Image], delay: u16, hold: u16, path: &Path) -> Result<(), WriteError> {
    write_atomic(path, |file| {
        let bytes = gif(images, delay, hold).map_err(io::Error::other)?;
        file.write_all(&bytes)
    })
}

fn gif(images: &[Image], delay: u16, hold: u16) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
    let size = |image: &Image| [image.width, image.height];
    let expected = images.first().map_or([0; 2], size);
    if let Some(image) = images.iter().find(|image| size(image) != expected) {
        let found = size(image);
        return Err(format!("found a frame of {found:?} pixels, expected {expected:?}").into());
    }
    let side = |side: usize| match u16::try_from(side) {
        Ok(side) if side > 0 => Ok(side),
        _ => Err(format!(
            "found frames of {expected:?} pixels, expected 1 to 65535 each way"
        )),
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, side(expected[0])?, side(expected[1])?, &[])?;
    encoder.set_repeat(Repeat::Infinite)?;
    let encoded = images.par_iter().enumerate().map(|(i, image)| {
        let mut frame = match i {
            0 => whole(image),
            _ => change(&images[i - 1], image),
        };
        frame.delay = if i + 1 == images.len() { hold } else { delay };
        frame.dispose = DisposalMethod::Keep;
        frame.make_lzw_pre_encoded();
        frame
    });
    for frame in encoded.collect::<Vec<Frame>>() {
        encoder.write_lzw_pre_encoded_frame(&frame)?;
    }
    drop(encoder);
    Ok(bytes)
}

fn whole(image: &Image) -> Frame<'static> {
    let (width, height) = (image.width as u16, image.height as u16);
    let pixels = image.pixels.as_flattened();
    Frame::from_rgb_speed(width, height, pixels, QUANTISATION_SPEED)
}

/// The smallest rectangle that holds all that differs between two pictures of one size; in it,
/// what does not differ is transparent. One pixel where nothing differs.
fn change(before: &Image, now: &Image) -> Frame<'static> {
    let width = now.width;
    let rows = || {
        let before = before.pixels.chunks_exact(width);
        before.zip(now.pixels.chunks_exact(width))
    };
    let (mut left, mut right, mut top, mut bottom) = (width, 0, usize::MAX, 0);
    for (y, (a, b)) in rows().enumerate() {
        let differs = |x: &usize| a[*x] != b[*x];
        if let (Some(l), Some(r)) = ((0..width).find(differs), (0..width).rfind(differs)) {
            (left, right) = (left.min(l), right.max(r + 1));
            (top, bottom) = (top.min(y), y + 1);
        }
    }
    if bottom == 0 {
        (left, right, top, bottom) = (0, 1, 0, 1);
    }
    let mut pixels = Vec::with_capacity(4 * (right - left) * (bottom - top));
    for (a, b) in rows().take(bottom).skip(top) {
        for ([r, g, b], is_same) in (left..right).map(|x| (b[x], a[x] == b[x])) {
            pixels.extend(if is_same { [0; 4] } else { [r, g, b, 255] });
        }
    }
    let (width, height) = ((right - left) as u16, (bottom - top) as u16);
    Frame {
        left: left as u16,
        top: top as u16,
        ..Frame::from_rgba_speed(width, height, &mut pixels, QUANTISATION_SPEED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Color;

    const FIELD: Color = [30, 30, 32];

    /// A white square that moves to the right over a shaded field.
    fn moving(count: usize) -> Vec<Image> {
        let mut film = Vec::new();
        for step in 0..count {
            let mut image = Image::new(40, 30, FIELD);
            for y in 0..30 {
                image.pixels[y * 40] = [0, (8 * y) as u8, 0];
            }
            for y in 10..14 {
                image.pixels[y * 40 + 4 + 3 * step..][..4].fill([255; 3]);
            }
            film.push(image);
        }
        film
    }

    fn save(film: &[Image]) -> Result<Vec<u8>, WriteError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.gif");
        save_gif(film, 5, 150, &path)?;
        Ok(std::fs::read(&path).unwrap())
    }

    #[test]
    fn decodes_to_the_frames() {
        let mut film = moving(6);
        film.push(film[5].clone());
        let bytes = save(&film).unwrap();
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes.as_slice()).unwrap();
        assert_eq!((decoder.width(), decoder.height()), (40, 30));

        let mut screen = vec![[0_u8; 3]; 40 * 30];
        let mut delays = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            let width = usize::from(frame.width);
            for (i, pixel) in frame.buffer.chunks_exact(4).enumerate() {
                let x = usize::from(frame.left) + i % width;
                let y = usize::from(frame.top) + i / width;
                if pixel[3] > 0 {
                    screen[y * 40 + x].copy_from_slice(&pixel[..3]);
                }
            }
            let expected = &film[delays.len()].pixels;
            // Fewer than 256 colours: all are exact.
            assert!(screen == *expected, "frame {}", delays.len());
            delays.push(frame.delay);
        }
        assert_eq!(delays, [5, 5, 5, 5, 5, 5, 150]);
        assert_eq!(decoder.repeat(), Repeat::Infinite);
    }

    #[test]
    fn a_frame_stores_what_changed() {
        let mut before = Image::new(4, 3, FIELD);
        before.pixels[0] = [9; 3];
        let mut now = before.clone();
        (now.pixels[5], now.pixels[10]) = ([2; 3], [3; 3]);
        let frame = change(&before, &now);
        let place = (frame.left, frame.top, frame.width, frame.height);
        assert_eq!(place, (1, 1, 2, 2));
        let is_same = |i: usize| Some(frame.buffer[i]) == frame.transparent;
        assert_eq!([0, 1, 2, 3].map(is_same), [false, true, true, false]);
        let frame = change(&now, &now);
        assert_eq!((frame.width, frame.height), (1, 1));
        assert_eq!(Some(frame.buffer[0]), frame.transparent);
    }

    #[test]
    fn file_does_not_depend_on_threads() {
        let film = moving(9);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| save(&film).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn unusable_films_are_errors_that_name_the_file_and_the_size() {
        let mut mixed = moving(3);
        mixed[2] = Image::new(40, 31, FIELD);
        for (film, size) in [
            (mixed, "[40, 31]"),
            (vec![Image::new(70_000, 1, FIELD)], "[70000, 1]"),
            (Vec::new(), "[0, 0]"),
        ] {
            let error = save(&film).unwrap_err();
            let cause = std::error::Error::source(&error).unwrap().to_string();
            assert!(
                error.to_string().ends_with("film.gif") && cause.contains(size),
                "{cause}"
            );
        }
    }
}
