use super::palette::Palette;
use super::{Image, ReportError};
use drape_cloth::file::write_atomic;
use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

/// Number, in the palette, of what shows the frame before.
const UNCHANGED: u8 = 255;

/// Images that follow each other in an endless loop.
///
/// All frames are kept until the film is saved, 0.5 MB each at 480 x 360 pixels: they share
/// one palette of 255 colours, which nobody knows before the last frame.
#[derive(Clone, Debug)]
pub struct Film {
    /// Images of equal size.
    pub frames: Vec<Image>,
    /// How long a frame is shown [1/100 s]. Viewers show less than 2 as 10.
    pub delay: u16,
    /// How long the last frame is shown [1/100 s].
    pub hold: u16,
}

impl Film {
    /// A film without frames that shows each for `delay` and the last one for `hold`
    /// [1/100 s].
    pub fn new(delay: u16, hold: u16) -> Self {
        Self {
            frames: Vec::new(),
            delay,
            hold,
        }
    }

    /// Writes the film as animated GIF, atomically. A frame stores only what changed since
    /// the one before. The file depends on the frames alone, not on the number of threads.
    pub fn save_gif(&self, path: &Path) -> Result<(), ReportError> {
        let size = self.size(path)?;
        let bytes = self.gif(size).map_err(|source| ReportError::Gif {
            path: path.to_path_buf(),
            source,
        })?;
        Ok(write_atomic(path, |file| file.write_all(&bytes))?)
    }

    /// Width and height [px], the same for all frames.
    fn size(&self, path: &Path) -> Result<[u16; 2], ReportError> {
        let path = || path.to_path_buf();
        let size = |image: &Image| [image.width, image.height];
        let first = self.frames.first();
        let expected = size(first.ok_or_else(|| ReportError::NoFrames { path: path() })?);
        let fits = expected.map(|side| u16::try_from(side).ok().filter(|&side| side > 0));
        let odd = self.frames.iter().position(|image| size(image) != expected);
        match (fits, odd) {
            ([Some(width), Some(height)], None) => Ok([width, height]),
            (_, odd) => {
                let frame = odd.unwrap_or(0);
                Err(ReportError::FrameSize {
                    path: path(),
                    frame,
                    found: size(&self.frames[frame]),
                    expected,
                })
            }
        }
    }

    fn gif(&self, [width, height]: [u16; 2]) -> Result<Vec<u8>, EncodingError> {
        let pixels = self.frames.iter().flat_map(|image| &image.pixels);
        let palette = Palette::new(pixels.copied(), usize::from(UNCHANGED));
        let indices =
            |image: &Image| -> Vec<u8> { image.pixels.iter().map(|&p| palette.index(p)).collect() };
        let last = self.frames.len() - 1;
        let encoded = self.frames.par_iter().enumerate().map(|(i, image)| {
            let now = indices(image);
            let mut frame = if i == 0 {
                whole(now, width, height)
            } else {
                change(&indices(&self.frames[i - 1]), &now, usize::from(width))
            };
            frame.delay = if i == last { self.hold } else { self.delay };
            frame.dispose = DisposalMethod::Keep;
            frame.make_lzw_pre_encoded();
            frame
        });
        let encoded: Vec<Frame> = encoded.collect();

        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, width, height, &table(&palette))?;
        encoder.set_repeat(Repeat::Infinite)?;
        for frame in &encoded {
            encoder.write_lzw_pre_encoded_frame(frame)?;
        }
        drop(encoder);
        Ok(bytes)
    }
}

/// The 256 colours of the file, so that [`UNCHANGED`] is among them.
fn table(palette: &Palette) -> Vec<u8> {
    let mut colors = palette.colors.clone();
    colors.resize(usize::from(UNCHANGED) + 1, [0; 3]);
    colors.into_flattened()
}

fn whole(pixels: Vec<u8>, width: u16, height: u16) -> Frame<'static> {
    Frame {
        width,
        height,
        buffer: Cow::Owned(pixels),
        ..Frame::default()
    }
}

/// The smallest rectangle that holds all that differs between two pictures of `width`; in
/// it, what does not differ is transparent. One pixel where nothing differs.
fn change(before: &[u8], now: &[u8], width: usize) -> Frame<'static> {
    let rows = || before.chunks_exact(width).zip(now.chunks_exact(width));
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
    let mut buffer = Vec::with_capacity((right - left) * (bottom - top));
    for (a, b) in rows().take(bottom).skip(top) {
        let pairs = a[left..right].iter().zip(&b[left..right]);
        buffer.extend(pairs.map(|(a, b)| if a == b { UNCHANGED } else { *b }));
    }
    Frame {
        left: left as u16,
        top: top as u16,
        transparent: Some(UNCHANGED),
        ..whole(buffer, (right - left) as u16, (bottom - top) as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Color;

    const FIELD: Color = [30, 30, 32];

    /// A white square that moves to the right over a shaded field.
    fn moving(count: usize) -> Film {
        let mut film = Film::new(5, 150);
        for step in 0..count {
            let mut image = Image::new(40, 30, FIELD);
            for y in 0..30 {
                image.pixels[y * 40] = [0, (8 * y) as u8, 0];
            }
            for y in 10..14 {
                image.pixels[y * 40 + 4 + 3 * step..][..4].fill([255; 3]);
            }
            film.frames.push(image);
        }
        film
    }

    fn save(film: &Film) -> Result<Vec<u8>, ReportError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.gif");
        film.save_gif(&path)?;
        Ok(std::fs::read(&path).unwrap())
    }

    #[test]
    fn decodes_to_the_frames() {
        let mut film = moving(6);
        film.frames.push(film.frames[5].clone());
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
            let expected = &film.frames[delays.len()].pixels;
            // Fewer than 255 colours, at least 8 apart: all are exact.
            assert!(screen == *expected, "frame {}", delays.len());
            delays.push(frame.delay);
        }
        assert_eq!(delays, [5, 5, 5, 5, 5, 5, 150]);
        assert_eq!(decoder.repeat(), Repeat::Infinite);
    }

    #[test]
    fn a_frame_stores_what_changed() {
        let before = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1];
        let now = [1, 1, 1, 1, 1, 2, 1, 1, 1, 1, 3, 1];
        let frame = change(&before, &now, 4);
        assert_eq!(
            (frame.left, frame.top, frame.width, frame.height),
            (1, 1, 2, 2)
        );
        assert_eq!(*frame.buffer, [2, UNCHANGED, UNCHANGED, 3]);
        let frame = change(&now, &now, 4);
        assert_eq!((frame.width, frame.height), (1, 1));
        assert_eq!(*frame.buffer, [UNCHANGED]);
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
    fn unusable_films_are_located_errors() {
        let error = save(&Film::new(5, 5)).unwrap_err();
        assert!(matches!(error, ReportError::NoFrames { .. }));

        let mut film = moving(3);
        film.frames[2] = Image::new(40, 31, FIELD);
        let message = save(&film).unwrap_err().to_string();
        assert!(
            message.starts_with("frame 2 of ") && message.contains("40 x 31"),
            "{message}"
        );

        film.frames = vec![Image::new(70_000, 1, FIELD)];
        let error = save(&film).unwrap_err();
        assert!(matches!(error, ReportError::FrameSize { frame: 0, .. }));

        let missing = Path::new("/nowhere/at/all/film.gif");
        let error = moving(2).save_gif(missing).unwrap_err();
        assert!(error.to_string().contains("/nowhere/at/all/film.gif"));
    }
}
