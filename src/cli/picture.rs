//! What a state of a scene looks like: the pictures and films of all commands.

use rayon::prelude::*;

use std::path::Path;

use super::Failure;
use drape_cloth::math::Vec3;
use drape_cloth::measure::{crushed, shear};
use drape_cloth::mesh::TriMesh;
use drape_cloth::scene::Scene;
use drape_proof::Sensitivity;
use drape_report::{
    BACKGROUND, CLOTH, CLOTH_BIAS, Camera, Color, ColorMap, DRAPED, Drawing, Image, PATH, TOOL,
    TOUCHED, creased, save_gif,
};
use drape_task::recording::Recording;

/// Distance to the tool from which on cloth is fully yellow [m].
pub const FAR: f64 = 0.025;
/// Share of its length that a yarn has too much from which on cloth is fully yellow [-].
pub const CRUSHED: f64 = 0.1;
/// Shear from which on cloth is fully yellow [degrees].
pub const SHEARED: f64 = 45.0;
/// Free space round the lamina, as a share of its longer side.
const MARGIN: f64 = 0.04;
/// Em size of a caption, as a share of the picture's height; not below [`MIN_TEXT`] px.
const TEXT: f64 = 0.027;
const MIN_TEXT: f32 = 12.0;
/// Lines of the strip below the picture, in em sizes.
const STRIP: f32 = 1.9;
const TEXT_COLOR: Color = [232, 232, 228];
/// Time that a frame of a film is shown, and that of the last one [1/100 s].
const DELAY: u16 = 6;
const HOLD: u16 = 200;

/// The camera that shows all of a box from somewhere, such as [`Camera::top`].
pub type View = fn((Vec3, Vec3)) -> Camera;

/// Scene, eye and size [px] of a row of pictures. The eye stays where it is: it sees the
/// lamina as it lies at the start, so that pictures of later states can be compared.
pub struct Studio<'a> {
    scene: &'a Scene,
    /// The tool with sharp edges, drawn once for all pictures.
    backdrop: Drawing,
    width: usize,
    height: usize,
}

impl<'a> Studio<'a> {
    /// Looks at `scene`; pictures measure `width` by `height` with their caption.
    pub fn new(scene: &'a Scene, view: View, [width, height]: [usize; 2]) -> Self {
        let (low, high) = scene.lamina.mesh(&scene.initial.position).bounds();
        let margin = Vec3::new(1.0, 1.0, 0.0) * (MARGIN * (high - low).max());
        let camera = view((low - margin, high + margin));
        let mut backdrop = Drawing::new(&camera, [width, height - strip(height)]);
        backdrop.mesh(&creased(&scene.tool.mesh), |_| TOOL, 0.0);
        Self {
            scene,
            backdrop,
            width,
            height,
        }
    }

    /// The lamina coloured by its distance to the tool: violet on it, yellow at [`FAR`] and
    /// beyond, with a key to the colours.
    pub fn distance(&self, position: &[[f64; 3]], caption: &str) -> Image {
        let distance = |&x: &[f64; 3]| self.scene.tool.distance(x).0;
        let color = |x| ColorMap::Distance.at(distance(x) / FAR);
        let colors: Vec<Color> = position.iter().map(color).collect();
        let mut image = self.captioned(position, &colors, &[], caption);
        self.color_key(&mut image, &format!("{:.0} mm", FAR * 1e3));
        image
    }

    /// The lamina coloured by what its yarns are too long for their place: violet where they fit,
    /// yellow where they are crushed by [`CRUSHED`] and more. The greatest share is told.
    pub fn crushed(&self, position: &[[f64; 3]]) -> Image {
        let Scene { lamina, tool, .. } = self.scene;
        let shares = crushed(lamina, tool, position);
        let greatest = shares.iter().copied().fold(0.0, f64::max);
        let color = |share: &f64| ColorMap::Distance.at(share / CRUSHED);
        let colors: Vec<Color> = shares.iter().map(color).collect();
        let caption = format!(
            "yarn too long for its place, at most {:.0} %",
            1e2 * greatest
        );
        let mut image = self.captioned(position, &colors, &[], &caption);
        self.color_key(&mut image, &format!("{:.0} %", CRUSHED * 1e2));
        image
    }

    /// The lamina coloured by its shear, of either sign: that of the triangles around each vertex, on average; yellow from
    /// [`SHEARED`] on.
    pub fn shear(&self, position: &[[f64; 3]]) -> Image {
        let lamina = &self.scene.lamina;
        let mut around = vec![[0.0; 2]; position.len()];
        for (corners, angle) in lamina.triangles.iter().zip(shear(lamina, position)) {
            for &v in corners {
                around[v as usize][0] += angle.abs().to_degrees();
                around[v as usize][1] += 1.0;
            }
        }
        let color = |[sum, count]: &[f64; 2]| ColorMap::Distance.at(sum / count / SHEARED);
        let colors: Vec<Color> = around.iter().map(color).collect();
        let mut image = self.captioned(position, &colors, &[], "shear");
        self.color_key(&mut image, &format!("{SHEARED:.0}\u{b0}"));
        image
    }

    /// The lamina coloured by what has become of each vertex (draped, touched but not
    /// draped, free), with the path of the stencil over it.
    pub fn progress(&self, recording: &Recording, number: usize) -> Image {
        let frame = &recording.frames[number];
        let color = |v: usize| {
            if frame.draped.contains(v) {
                DRAPED
            } else if frame.touched.contains(v) {
                TOUCHED
            } else {
                CLOTH
            }
        };
        let colors: Vec<Color> = (0..frame.position.len()).map(color).collect();
        let place = |v: u32| Vec3::from(frame.position[v as usize]);
        let strokes = recording.strokes(number);
        let path: Vec<Vec<Vec3>> = strokes.map(|stroke| stroke.map(place).collect()).collect();
        let caption = format!(
            "press {number}   D = {:.3} m   surplus {:.2} mm a yarn   score {:.1} %",
            frame.distance,
            1e3 * frame.surplus,
            100.0 * frame.score
        );
        self.captioned(&frame.position, &colors, &path, &caption)
    }

    /// Writes [`Studio::progress`] of some frames as a GIF, drawn side by side on all threads.
    pub fn film(&self, of: &Recording, frames: &[usize], path: &Path) -> Result<(), Failure> {
        let images = frames.par_iter().map(|&frame| self.progress(of, frame));
        Ok(save_gif(&images.collect::<Vec<_>>(), DELAY, HOLD, path)?)
    }

    fn captioned(
        &self,
        position: &[[f64; 3]],
        colors: &[Color],
        path: &[Vec<Vec3>],
        text: &str,
    ) -> Image {
        let lamina: TriMesh = self.scene.lamina.mesh(position);
        let mut picture = self.backdrop.clone();
        picture.mesh(&lamina, |v| colors[v], CLOTH_BIAS);
        picture.path(path, PATH);
        let mut image = picture.image();
        let count = self.width * self.height;
        image.pixels.resize(count, BACKGROUND);
        image.height = self.height;
        let (left, top) = self.text_corner();
        image.label([left, top], text, text_size(self.height), TEXT_COLOR);
        image
    }

    /// Draws the scale of colours from 0 to `end` at the right end of the strip.
    fn color_key(&self, image: &mut Image, end: &str) {
        let size = text_size(self.height);
        let (_, top) = self.text_corner();
        let em = |count: f32| (count * size) as i32;
        let right = self.width as i32 - em(0.8);
        let text_left = right - em(3.5);
        let (bar_left, bar_right) = (text_left - em(5.5), text_left - em(0.5));
        image.label([bar_left - em(1.0), top], "0", size, TEXT_COLOR);
        image.label([text_left, top], end, size, TEXT_COLOR);
        let size = [bar_right - bar_left, em(0.73)];
        image.gradient([bar_left, top], size, ColorMap::Distance);
    }

    /// Where the caption begins [px].
    fn text_corner(&self) -> (i32, i32) {
        let size = text_size(self.height);
        let top = (self.height - strip(self.height)) as f32 + 0.5 * (STRIP - 0.73) * size;
        ((0.8 * size) as i32, top as i32)
    }
}

fn text_size(height: usize) -> f32 {
    ((TEXT * height as f64) as f32).max(MIN_TEXT)
}

/// Height of the strip that holds the caption [px].
fn strip(height: usize) -> usize {
    ((STRIP * text_size(height)) as usize).min(height / 2)
}

/// What each quantity costs by itself: a bar as long as what is lost in the worst world, up to where it is lost on
/// average in the colour of draped cloth.
pub fn sensitivity(all: &[Sensitivity]) -> Image {
    let (row, left, longest, width) = (26, 190, 320, 640);
    let mut image = Image::new(width, row * (all.len() + 1), BACKGROUND);
    let lost = |score: f64| (1.0 - score).max(0.0);
    let losses = all.iter().map(|one| lost(one.worst_score));
    let most = losses.fold(1e-3, f64::max);
    let title = "share that is left where one quantity varies alone: on average, at worst";
    image.label([8, 7], title, MIN_TEXT, TEXT_COLOR);
    for (k, one) in all.iter().enumerate() {
        let top = row * (k + 1);
        let at = top as i32 + 7;
        image.label([8, at], &one.quantity.name(), MIN_TEXT, TEXT_COLOR);
        for (score, color) in [(one.worst_score, TOUCHED), (one.score, DRAPED)] {
            let length = (longest as f64 * lost(score) / most) as usize;
            for y in top + 4..top + row - 4 {
                image.pixels[y * width + left..][..length].fill(color);
            }
        }
        let [mean, worst] = [one.score, one.worst_score].map(|score| 100.0 * lost(score));
        let text = match one.score.is_finite() {
            true => format!("{mean:.1}, {worst:.1} %"),
            false => "diverges".into(),
        };
        image.label(
            [(left + longest + 10) as i32, at],
            &text,
            MIN_TEXT,
            TEXT_COLOR,
        );
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::fabric::BlankConfig;
    use drape_cloth::scene::{Fall, SceneConfig};
    use drape_cloth::sim::Snapshot;
    use drape_task::env::{EnvConfig, EpisodeState, Task};
    use fixedbitset::FixedBitSet;

    /// A coarse blank flat over the middle of the rib's plate, which nothing has moved.
    fn scene() -> Scene {
        let mut config = SceneConfig::rib();
        config.blank = BlankConfig {
            vertices: [9, 9],
            ..BlankConfig::default()
        };
        config.placement.tilt_deg = 0.0;
        config.placement.height_mm = 80.0;
        config.clamps.clear();
        config.tool.grid.spacing_mm = Some(20.0);
        config.fall = Fall {
            fall_s: 0.0,
            settle_s: 0.0,
            ..Fall::default()
        };
        Scene::new(&config, |_| {}).unwrap()
    }

    /// The state as the last frame of presses on some vertices.
    fn recording(scene: &Scene, draped: &[usize], touched: &[usize], path: &[u32]) -> Recording {
        let bits = |set: &[usize]| {
            let mut bits = FixedBitSet::with_capacity(scene.lamina.vertex_count());
            bits.extend(set.iter().copied());
            bits
        };
        let mut state = Snapshot::clone(&scene.initial);
        (state.pressed.draped, state.pressed.touched) = (bits(draped), bits(touched));
        let env = EnvConfig {
            // Strokes join all.
            stencil_mm: 1000.0,
            ..EnvConfig::default()
        };
        let task = Task::new(scene.clone().into(), &env).unwrap();
        let mut recording = Recording::new(&task);
        let presses = path.iter().map(|&v| (v, state.position[v as usize]));
        let presses: Vec<_> = presses.collect();
        for count in 0..=presses.len() {
            let episode = EpisodeState::new(presses[..count].to_vec(), state.clone());
            recording.see(&task, &episode);
        }
        recording
    }

    /// Pixels near the yellow end of the map, of any brightness.
    fn yellow(image: &Image) -> usize {
        let is = |p: &&Color| p[0].min(p[1]) > p[2].saturating_add(60);
        image.pixels.iter().filter(is).count()
    }

    /// Pixels of which blue is the strongest channel, as near the violet end of the map and of draped cloth.
    fn blue(image: &Image) -> usize {
        let is = |p: &&Color| p[2] > p[1].saturating_add(25) && p[2] > p[0];
        image.pixels.iter().filter(is).count()
    }

    #[test]
    fn far_cloth_is_yellow_and_near_cloth_is_violet() {
        let scene = scene();
        let studio = Studio::new(&scene, Camera::top, [320, 240]);
        let mut state = Snapshot::clone(&scene.initial);
        let far = studio.distance(&state.position, "");
        // Half of the picture is cloth; little of that is a crest 20 mm below.
        assert!(yellow(&far) > 20_000 && blue(&far) < 200);
        for x in &mut state.position {
            let distance = scene.tool.distance(*x).0;
            x[2] -= distance;
        }
        let near = studio.distance(&state.position, "");
        assert!(blue(&near) > 15_000 && yellow(&near) < 500);
        assert_eq!((near.width, near.height), (320, 240));
        assert_eq!(near.pixels.len(), 320 * 240);
    }

    /// Cloth of the length of its trace is violet; pushed together by a tenth it is yellow.
    #[test]
    fn crushed_cloth_is_yellow() {
        let scene = scene();
        let studio = Studio::new(&scene, Camera::top, [320, 240]);
        let mut state = Snapshot::clone(&scene.initial);
        let crushed = |state: &Snapshot| yellow(&studio.crushed(&state.position));
        for x in &mut state.position {
            let distance = scene.tool.distance(*x).0;
            x[2] -= distance;
        }
        assert!(crushed(&state) < 2000, "{}", crushed(&state));
        for x in &mut state.position {
            x[0] *= 0.8;
        }
        assert!(crushed(&state) > 15_000, "{}", crushed(&state));
    }

    /// A flat blank is violet; sheared by 45 degrees it is yellow.
    #[test]
    fn sheared_cloth_is_yellow() {
        let scene = scene();
        let studio = Studio::new(&scene, Camera::top, [320, 240]);
        let mut state = Snapshot::clone(&scene.initial);
        let flat = studio.shear(&state.position);
        assert!(blue(&flat) > 15_000 && yellow(&flat) < 500);
        for x in &mut state.position {
            x[0] += 0.71 * x[1];
            x[1] *= 0.7;
        }
        assert!(yellow(&studio.shear(&state.position)) > 10_000);
    }

    #[test]
    fn progress_shows_every_state_and_the_path() {
        let scene = scene();
        let all: Vec<usize> = (0..81).collect();
        let studio = Studio::new(&scene, Camera::isometric, [320, 240]);
        let image = |recording: Recording| studio.progress(&recording, recording.presses.len());
        let free = image(recording(&scene, &[], &[], &[]));
        assert_eq!(blue(&free), 0);
        let draped = image(recording(&scene, &all, &all, &[]));
        assert!(blue(&draped) > 10_000);
        let touched = image(recording(&scene, &[], &all, &[]));
        assert!(blue(&touched) == 0 && touched != free);
        let path = image(recording(&scene, &[], &[], &[0, 40, 80]));
        let lines = |image: &Image| image.pixels.iter().filter(|&&p| p == PATH).count();
        assert!(lines(&free) == 0 && lines(&path) > 100);
    }

    #[test]
    fn edges_of_the_plate_are_sharp_and_the_rib_is_smooth() {
        let mesh = scene().tool.mesh.clone();
        let creased = creased(&mesh);
        // The border of the upper face and that of the base have a copy for either side, and
        // corners one for each of three.
        let border = 2 * (77 - 1 + 56 - 1);
        let extra = creased.vertices.len() - mesh.vertices.len();
        assert!((border..=2 * border + 8).contains(&extra), "{extra}");
        for (t, triangle) in creased.triangles.iter().enumerate() {
            let corners = triangle.map(|v| creased.vertices[v as usize]);
            assert_eq!(corners, mesh.corners(t));
        }
    }

    #[test]
    fn tiny_pictures_have_the_size_asked_for() {
        let scene = scene();
        for size in [[1, 1], [64, 20], [7, 300]] {
            let studio = Studio::new(&scene, Camera::top, size);
            let image = studio.distance(&scene.initial.position, "long caption that cannot fit");
            assert_eq!([image.width, image.height], size);
            assert_eq!(image.pixels.len(), size[0] * size[1]);
        }
    }
}
