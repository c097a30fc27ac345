use super::Color;

/// Bits per channel by which colours are told apart while a palette is sought.
const BITS: u32 = 6;
const BINS: usize = 1 << (3 * BITS);

/// A small set of colours that stands for those of many pictures.
pub(super) struct Palette {
    /// At least one colour.
    pub colors: Vec<Color>,
    /// Number of the nearest colour for each bin that was counted, 0 elsewhere.
    index: Vec<u8>,
}

impl Palette {
    /// At most `limit` (1 to 256) colours for all of `pixels`, found by dividing the colours
    /// again and again where that removes most variance, then rounding each colour to the
    /// nearest mean.
    pub(super) fn new(pixels: impl Iterator<Item = Color>, limit: usize) -> Self {
        let mut bins = vec![Bin::default(); BINS];
        for color in pixels {
            let bin = &mut bins[bin_of(color)];
            bin.count += 1;
            for (sum, c) in bin.sum.iter_mut().zip(color) {
                *sum += u64::from(c);
            }
        }
        let used = bins.iter().enumerate().filter(|(_, bin)| bin.count > 0);
        let mut points: Vec<Point> = used
            .map(|(number, bin)| Point {
                bin: number,
                value: bin.sum.map(|sum| sum as f64 / bin.count as f64),
                // The root keeps small things, such as a path over the cloth, from drowning
                // in a large background.
                weight: (bin.count as f64).sqrt(),
            })
            .collect();

        let colors = divide(&mut points, limit);
        let mut index = vec![0; BINS];
        for point in &points {
            let distance = |color: &Color| -> f64 {
                let squares = (0..3).map(|c| (f64::from(color[c]) - point.value[c]).powi(2));
                squares.sum()
            };
            let distances = colors.iter().map(distance).enumerate();
            let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
            index[point.bin] = nearest.map_or(0, |(i, _)| i as u8);
        }
        Self { colors, index }
    }

    /// Number of the colour that stands for `color`, which must be one of those that the
    /// palette was made from.
    pub(super) fn index(&self, color: Color) -> u8 {
        self.index[bin_of(color)]
    }
}

/// Pixels of nearly the same colour.
#[derive(Clone, Copy, Default)]
struct Bin {
    count: u64,
    sum: [u64; 3],
}

/// Which bin holds `color`.
fn bin_of(color: Color) -> usize {
    let part = |c: u8| usize::from(c >> (8 - BITS));
    part(color[0]) << (2 * BITS) | part(color[1]) << BITS | part(color[2])
}

/// The mean colour of one bin.
struct Point {
    bin: usize,
    value: [f64; 3],
    weight: f64,
}

/// Some of the points, with the axis along which they vary most.
struct Group<'a> {
    points: &'a mut [Point],
    mean: [f64; 3],
    axis: usize,
    /// Weighted sum of squares along that axis.
    spread: f64,
}

impl<'a> Group<'a> {
    fn new(points: &'a mut [Point]) -> Self {
        let sum = |f: &dyn Fn(&Point) -> f64| points.iter().map(|p| f(p) * p.weight).sum::<f64>();
        let weight = sum(&|_| 1.0).max(f64::MIN_POSITIVE);
        let mean = [0, 1, 2].map(|c| sum(&|p| p.value[c]) / weight);
        let spread = [0, 1, 2].map(|c| sum(&|p| (p.value[c] - mean[c]).powi(2)));
        let axis = (0..3).max_by(|&a, &b| spread[a].total_cmp(&spread[b]));
        let axis = axis.expect("there are three channels");
        // The mean of a single point differs from it by rounding.
        let divisible = points.len() > 1;
        Self {
            points,
            mean,
            axis,
            spread: if divisible { spread[axis] } else { 0.0 },
        }
    }

    /// Both sides of the mean; neither is empty where the spread is above 0.
    fn split(self) -> [Group<'a>; 2] {
        let Group {
            points, mean, axis, ..
        } = self;
        points.sort_unstable_by(|a, b| a.value[axis].total_cmp(&b.value[axis]));
        let below = points.partition_point(|p| p.value[axis] < mean[axis]);
        let (low, high) = points.split_at_mut(below.clamp(1, points.len() - 1));
        [Group::new(low), Group::new(high)]
    }
}

/// Means of at most `limit` groups of `points`, always dividing the group with the largest
/// spread.
fn divide(points: &mut [Point], limit: usize) -> Vec<Color> {
    let mut groups = vec![Group::new(points)];
    while groups.len() < limit {
        let spreads = groups.iter().map(|g| g.spread).enumerate();
        let widest = spreads.max_by(|a, b| a.1.total_cmp(&b.1));
        let (i, spread) = widest.expect("there is at least one group");
        if spread <= 0.0 {
            break;
        }
        let parts = groups.swap_remove(i).split();
        groups.extend(parts);
    }
    groups
        .iter()
        .map(|g| g.mean.map(|c| c.round() as u8))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colors_are_kept() {
        let colors: [Color; 5] = [[0; 3], [255; 3], [252, 0, 0], [0, 128, 64], [30, 30, 32]];
        let pixels = || {
            colors
                .iter()
                .flat_map(|&c| std::iter::repeat_n(c, 1000))
                .chain([[8, 200, 8]])
        };
        let palette = Palette::new(pixels(), 255);
        assert_eq!(palette.colors.len(), 6);
        for color in pixels() {
            let found = palette.colors[usize::from(palette.index(color))];
            assert_eq!(found, color);
        }
    }

    #[test]
    fn many_colors_are_rounded_to_near_ones() {
        // A plane of 65 536 colours and a tiny mark of another one.
        let plane = (0..=255).flat_map(|r| (0..=255).map(move |g| [r, g, 40]));
        let pixels: Vec<Color> = plane.chain([[250, 240, 255]; 20]).collect();
        let palette = Palette::new(pixels.iter().copied(), 255);
        assert_eq!(palette.colors.len(), 255);
        let error = |&color: &Color| {
            let found = palette.colors[usize::from(palette.index(color))];
            (0..3)
                .map(|c| f64::from(found[c].abs_diff(color[c])).powi(2))
                .sum::<f64>()
        };
        let mean = pixels.iter().map(error).sum::<f64>() / pixels.len() as f64;
        // 255 squares of side 16 have a mean square error of 2 * 16² / 12 = 43.
        assert!(mean < 50.0, "mean square error {mean}");
        assert!(error(&[250, 240, 255]) < 50.0);
    }

    #[test]
    fn limits_of_the_size() {
        let pixels = [[1, 2, 3], [200, 100, 0]];
        assert_eq!(Palette::new(pixels.into_iter(), 1).colors.len(), 1);
        assert_eq!(Palette::new(std::iter::empty(), 255).colors.len(), 1);
    }
}
