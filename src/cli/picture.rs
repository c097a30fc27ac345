//! What a state of a scene looks like: the pictures and films of all commands.

use fixedbitset::FixedBitSet;
use rayon::prelude::*;

use crate::math::Vec3;
use crate::mesh::TriMesh;
use crate::report::{
    BACKGROUND, CLOTH, Camera, Color, ColorMap, DRAPED, Film, Image, PATH, Paint,
    Scene as Picture, TOOL, TOUCHED,
};
use crate::scene::Scene;
use crate::sim::Snapshot;

/// Distance to the tool from which on cloth is fully red [m].
pub(super) const FAR: f64 = 0.025;
/// Cloth counts as this much nearer to the eye than it is [m], so that the tool does not
/// shine through its facets where they cut a corner of the tool.
const CLOTH_BIAS: f64 = 3e-3;
/// Free space round the lamina, as a share of its longer side.
const MARGIN: f64 = 0.04;
/// Em size of a caption, as a share of the picture's height; not below [`LEAST_TEXT`] px.
const TEXT: f64 = 0.027;
const LEAST_TEXT: f32 = 12.0;
/// Lines of the strip below the picture, in em sizes.
const STRIP: f32 = 1.9;
const TEXT_COLOR: Color = [232, 232, 228];
/// Time that a frame of a film is shown, and that of the last one [1/100 s].
const DELAY: u16 = 6;
const HOLD: u16 = 200;

/// From where a scene is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// From above: x to the right, y up.
    Top,
    /// From above the front left corner.
    Isometric,
}

/// A moment of an episode.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub state: Snapshot,
    /// One bit a vertex of the blank.
    pub draped: FixedBitSet,
    pub touched: FixedBitSet,
    /// Vertices that the stencil has pressed so far, in order.
    pub path: Vec<u32>,
    /// Text below the picture; should fit one line.
    pub caption: String,
}

/// Scene, eye and size [px] of a row of pictures. The eye stays where it is: it sees the
/// lamina as it lies at the start, so that pictures of later states can be compared.
pub(super) struct Studio<'a> {
    scene: &'a Scene,
    camera: Camera,
    width: usize,
    height: usize,
}

impl<'a> Studio<'a> {
    /// Looks at `scene`; pictures measure `width` by `height` with their caption.
    pub fn new(scene: &'a Scene, view: View, [width, height]: [usize; 2]) -> Self {
        let (low, high) = scene.lamina.mesh(&scene.initial.position).bounds();
        let margin = Vec3::new(1.0, 1.0, 0.0) * (MARGIN * (high - low).max());
        let bounds = (low - margin, high + margin);
        let camera = match view {
            View::Top => Camera::top(bounds),
            View::Isometric => Camera::isometric(bounds),
        };
        Self {
            scene,
            camera,
            width,
            height,
        }
    }

    /// The lamina coloured by its distance to the tool: blue on it, red at [`FAR`] and
    /// beyond, with a key to the colours.
    pub fn distance(&self, state: &Snapshot, caption: &str) -> Image {
        let distance = |&x: &[f64; 3]| self.scene.tool.distance(x).0;
        let distances: Vec<f64> = state.position.iter().map(distance).collect();
        let colors = ColorMap::Distance.colors(&distances, FAR);
        let mut image = self.captioned(state, &colors, &[], caption);
        self.color_key(&mut image);
        image
    }

    /// The lamina coloured by what has become of each vertex (draped, touched but not
    /// draped, free), with the path of the stencil over it.
    pub fn progress(&self, frame: &Frame) -> Image {
        let color = |v: usize| {
            if frame.draped.contains(v) {
                DRAPED
            } else if frame.touched.contains(v) {
                TOUCHED
            } else {
                CLOTH
            }
        };
        let colors: Vec<Color> = (0..frame.state.position.len()).map(color).collect();
        let place = |&v: &u32| Vec3::from(frame.state.position[v as usize]);
        let path: Vec<Vec3> = frame.path.iter().map(place).collect();
        self.captioned(&frame.state, &colors, &path, &frame.caption)
    }

    /// [`Studio::progress`] of all frames, drawn side by side on all threads.
    pub fn film(&self, frames: &[Frame]) -> Film {
        let mut film = Film::new(DELAY, HOLD);
        let images = frames.par_iter().map(|frame| self.progress(frame));
        film.frames = images.collect();
        film
    }

    fn captioned(&self, state: &Snapshot, colors: &[Color], path: &[Vec3], text: &str) -> Image {
        let lamina: TriMesh = self.scene.lamina.mesh(&state.position);
        let mut picture = Picture::default();
        picture.add(&self.scene.tool.mesh, Paint::Uniform(TOOL), 0.0);
        picture.add(&lamina, Paint::PerVertex(colors), CLOTH_BIAS);
        if !path.is_empty() {
            picture.add_path(path, PATH);
        }
        let strip = self.strip();
        let mut image = picture.render(&self.camera, self.width, self.height - strip);
        let count = self.width * self.height;
        image.pixels.resize(count, BACKGROUND);
        image.height = self.height;
        let (left, top) = self.text_corner();
        image.label([left, top], text, self.text_size(), TEXT_COLOR);
        image
    }

    /// Draws the scale of distances at the right end of the strip.
    fn color_key(&self, image: &mut Image) {
        let size = self.text_size();
        let (_, top) = self.text_corner();
        let em = |count: f32| (count * size) as i32;
        let right = self.width as i32 - em(0.8);
        let text = format!("{:.0} mm", FAR * 1e3);
        let text_left = right - em(3.5);
        let (bar_left, bar_right) = (text_left - em(7.5), text_left - em(0.5));
        image.label([bar_left - em(1.0), top], "0", size, TEXT_COLOR);
        image.label([text_left, top], &text, size, TEXT_COLOR);
        for x in bar_left.max(0)..bar_right {
            let t = f64::from(x - bar_left) / f64::from(bar_right - bar_left);
            for y in top..top + em(0.73) {
                image.pixels[y as usize * self.width + x as usize] = ColorMap::Distance.at(t);
            }
        }
    }

    fn text_size(&self) -> f32 {
        ((TEXT * self.height as f64) as f32).max(LEAST_TEXT)
    }

    /// Height of the strip that holds the caption [px].
    fn strip(&self) -> usize {
        ((STRIP * self.text_size()) as usize).min(self.height / 2)
    }

    /// Where the caption begins [px].
    fn text_corner(&self) -> (i32, i32) {
        let size = self.text_size();
        let top = (self.height - self.strip()) as f32 + 0.5 * (STRIP - 0.73) * size;
        ((0.8 * size) as i32, top as i32)
    }
}
