use drape_cloth::sim::{ALLOWED, DRAPED, Observation, STENCIL, TOUCHED};
use drape_task::env::Terrain;

/// 1 where a mark has a bit, else 0.
fn flag(mark: u8, bit: u8) -> f32 {
    f32::from(u8::from(mark & bit != 0))
}

/// Draped, distance, touched as three planes `[3, rows, columns]`; `scale` is 1 / m.
pub fn write_planes(seen: Observation, scale: f32, out: &mut [f32]) {
    let count = seen.distance.len();
    let (draped, rest) = out.split_at_mut(count);
    let (distance, touched) = rest.split_at_mut(count);
    for (k, (&mark, d)) in seen.marks.iter().zip(seen.distance).enumerate() {
        draped[k] = flag(mark, DRAPED);
        distance[k] = d * scale;
        touched[k] = flag(mark, TOUCHED);
    }
}

/// Planes of [`write_all`].
pub const PLANES: usize = 9;
/// Those before the terrain's.
pub const SEEN: usize = 5;
/// Height of the tool that is seen as 1 [m].
const HEIGHT: f32 = 0.1;

/// The last four of the planes that [`write_all`] writes: inside, height, slopes.
pub fn terrain_planes(terrain: &Terrain) -> Vec<f32> {
    let count = terrain.height.len();
    let inside = (0..count).map(|i| f32::from(u8::from(terrain.inside.contains(i))));
    let height = terrain.height.iter().map(|z| z / HEIGHT);
    let slope = [0, 1].map(|k| terrain.slope.iter().map(move |slope| slope[k]));
    inside
        .chain(height)
        .chain(slope.into_iter().flatten())
        .collect()
}

/// Draped, distance, touched, allowed, under the last press, and the `terrain`'s planes `[PLANES, rows, columns]`; `scale` is
/// 1 / m.
pub fn write_all(seen: Observation, terrain: &[f32], scale: f32, out: &mut [f32]) {
    let count = seen.distance.len();
    let (three, rest) = out.split_at_mut(3 * count);
    write_planes(seen, scale, three);
    let (flags, fixed) = rest.split_at_mut((SEEN - 3) * count);
    for (plane, bit) in flags.chunks_exact_mut(count).zip([ALLOWED, STENCIL]) {
        for (pixel, &mark) in plane.iter_mut().zip(seen.marks) {
            *pixel = flag(mark, bit);
        }
    }
    fixed.copy_from_slice(terrain);
}

/// Cuts an image into square patches with a border, so that a convolution whose stride is the
/// patch becomes one matrix product: on a CPU several times faster than burn's convolutions.
#[derive(Clone, Debug)]
pub struct Patches {
    rows: usize,
    columns: usize,
    patch: usize,
    border: usize,
}

/// Channels of a pixel in a patch: draped, distance, touched, allowed.
const CHANNELS: usize = 4;

impl Patches {
    /// Patches of `patch` x `patch` pixels with `border` more on each side. The image is
    /// extended with zeros to whole patches.
    pub fn new(rows: usize, columns: usize, patch: usize, border: usize) -> Self {
        Self {
            rows,
            columns,
            patch,
            border,
        }
    }

    /// Rows and columns of patches.
    pub fn grid(&self) -> [usize; 2] {
        [
            self.rows.div_ceil(self.patch),
            self.columns.div_ceil(self.patch),
        ]
    }

    /// Number of patches.
    pub fn count(&self) -> usize {
        self.grid().iter().product()
    }

    /// Numbers in a patch with its border.
    pub fn width(&self) -> usize {
        (self.patch + 2 * self.border).pow(2) * CHANNELS
    }

    /// Where [`Patches::write`] takes each of its numbers from, among draped, distance, touched, allowed, one
    /// plane after the other, and a 0 behind them.
    pub fn sources(&self) -> Vec<i32> {
        let pixels = self.rows * self.columns;
        let [grid_rows, grid_columns] = self.grid();
        let window = self.patch + 2 * self.border;
        let mut sources = Vec::with_capacity(self.count() * self.width());
        for token in 0..grid_rows * grid_columns {
            let [down, right] =
                [token / grid_columns, token % grid_columns].map(|k| k * self.patch);
            for place in 0..window * window {
                let row = (down + place / window).checked_sub(self.border);
                let column = (right + place % window).checked_sub(self.border);
                let pixel = row
                    .zip(column)
                    .filter(|&(row, column)| row < self.rows && column < self.columns);
                sources.extend((0..CHANNELS).map(|channel| match pixel {
                    Some((row, column)) => (channel * pixels + row * self.columns + column) as i32,
                    None => (CHANNELS * pixels) as i32,
                }));
            }
        }
        sources
    }

    /// Writes `[count, width]`; `scale` is 1 / m.
    pub fn write(&self, seen: Observation, scale: f32, out: &mut [f32]) {
        let [grid_rows, grid_columns] = self.grid();
        let window = self.patch + 2 * self.border;
        let line = (grid_columns * self.patch + 2 * self.border) * CHANNELS;
        let mut image = vec![0.0; line * (grid_rows * self.patch + 2 * self.border)];
        let rows = seen.marks.chunks_exact(self.columns);
        let rows = rows.zip(seen.distance.chunks_exact(self.columns));
        for (row, (marks, distances)) in rows.enumerate() {
            let start = (row + self.border) * line + self.border * CHANNELS;
            let pixels = image[start..].chunks_exact_mut(CHANNELS);
            for ((pixel, &mark), distance) in pixels.zip(marks).zip(distances) {
                pixel[0] = flag(mark, DRAPED);
                pixel[1] = distance * scale;
                pixel[2] = flag(mark, TOUCHED);
                pixel[3] = flag(mark, ALLOWED);
            }
        }
        let runs = out.chunks_exact_mut(window * CHANNELS);
        for (index, run) in runs.enumerate() {
            let (token, dy) = (index / window, index % window);
            let (row, column) = (token / grid_columns, token % grid_columns);
            let start = (row * self.patch + dy) * line + column * self.patch * CHANNELS;
            run.copy_from_slice(&image[start..start + window * CHANNELS]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_draped_distance_touched() {
        let seen = Observation {
            view: 0,
            distance: &[0.5, 1.0],
            marks: &[DRAPED, TOUCHED],
        };
        let mut out = [f32::NAN; 6];
        write_planes(seen, 10.0, &mut out);
        assert_eq!(out, [1.0, 0.0, 5.0, 10.0, 0.0, 1.0]);
    }

    #[test]
    fn every_patch_shows_its_pixels_and_their_neighbours() {
        let (rows, columns, patch, border) = (5, 3, 2, 1);
        let distance: Vec<f32> = (1..=15).map(|i| i as f32).collect();
        let mut marks = [0; 15];
        (marks[0], marks[7], marks[14]) = (DRAPED, TOUCHED, ALLOWED);
        let seen = Observation {
            view: 0,
            distance: &distance,
            marks: &marks,
        };
        let patches = Patches::new(rows, columns, patch, border);
        assert_eq!((patches.grid(), patches.width()), ([3, 2], 64));
        let mut out = vec![f32::NAN; patches.count() * patches.width()];
        patches.write(seen, 2.0, &mut out);
        let mut numbers = out.iter();
        for token in 0..6 {
            for y in 0..4 {
                for x in 0..4 {
                    let row = (token / 2 * patch + y).checked_sub(border);
                    let column = (token % 2 * patch + x).checked_sub(border);
                    let inside = row.zip(column).filter(|&(r, c)| r < rows && c < columns);
                    let expected = inside.map_or([0.0; 4], |(r, c)| {
                        let i = r * columns + c;
                        let bit = |bit: u8| flag(marks[i], bit);
                        [bit(DRAPED), distance[i] * 2.0, bit(TOUCHED), bit(ALLOWED)]
                    });
                    for value in expected {
                        assert_eq!(*numbers.next().unwrap(), value, "{token} {y} {x}");
                    }
                }
            }
        }
    }
}
