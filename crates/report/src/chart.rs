use super::image::PX;
use super::legend::{self, Entry};
use super::text::{self, Area, rgb};
use super::{Color, Image};
use plotters::prelude::*;
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, VPos};
use std::error::Error;
use std::ops::Range;

/// Width and height of a chart [px]; all further lengths are in samples.
const SIZE: [usize; 2] = [960, 560];
const EDGE: i32 = 24 * PX;
/// Height of the title line.
const TITLE_HEIGHT: i32 = 48 * PX;
/// Em sizes of the title, and of names and numbers at the axes.
const TITLE: f64 = (20 * PX) as f64;
const NAME: f64 = (14 * PX) as f64;
const NUMBER: f64 = (13 * PX) as f64;

const INK: Color = [45, 48, 54];
const FAINT: RGBColor = RGBColor(222, 225, 229);

/// Numbers beyond this are left out: scales and ticks lose their meaning, and differences
/// overflow.
const LARGEST: f64 = 1e100;

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; none where empty.
    pub label: String,
    /// (x, y), drawn in this order. A point that is not finite interrupts the curve.
    pub points: Vec<[f64; 2]>,
    /// Colour of the curve.
    pub color: Color,
}

/// A horizontal line over the whole chart, such as a baseline.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Name in the legend; none where empty.
    pub label: String,
    /// Where it is on the y axis. Nothing is drawn where it is not finite.
    pub value: f64,
    /// Half the height of a faint band around it; none where 0 or not finite.
    pub deviation: f64,
    /// Colour of line and band.
    pub color: Color,
}

/// A faint area between two curves, such as an interval around a mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// (x, lower y, upper y) from left to right. One that is not finite interrupts the band.
    pub points: Vec<[f64; 3]>,
    /// Colour that it is a tint of.
    pub color: Color,
}

/// What the numbers of a chart stand for on both axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Themselves.
    #[default]
    Linear,
    /// Their powers of ten, with which ticks are labelled.
    Log10,
}

/// Curves and levels over common axes, which fit what is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// What x is, with its unit.
    pub x_label: String,
    /// What y is, with its unit.
    pub y_label: String,
    /// Curves, the last one on top.
    pub series: Vec<Series>,
    /// Bands, below all curves.
    pub bands: Vec<Band>,
    /// Levels, below all curves.
    pub levels: Vec<Level>,
    /// Of both axes.
    pub scale: Scale,
}

impl Chart {
    /// The chart as a picture.
    pub fn image(&self) -> Image {
        let [width, height] = SIZE.map(|side| side * PX as usize);
        let mut image = Image::new(width, height, [255; 3]);
        let drawn = self.draw(&image.area());
        drawn.expect("memory takes all pixels, and the font is part of the program");
        image.reduced(PX as usize)
    }

    fn draw(&self, root: &Area) -> Result<(), Box<dyn Error>> {
        text::draw(root, &self.title, [EDGE, EDGE], TITLE, INK, HPos::Left);
        let below = self.draw_legend(root);
        let (_, plot) = root.split_vertically(below);

        let [x, y] = self.ranges();
        let mut chart = ChartBuilder::on(&plot)
            .margin_top(8 * PX)
            .margin_right(EDGE + 12 * PX)
            .margin_left(12 * PX)
            .margin_bottom(8 * PX)
            .x_label_area_size(44 * PX)
            .y_label_area_size(76 * PX)
            .build_cartesian_2d(x.clone(), y)?;
        let mut mesh = chart.configure_mesh();
        let label = |tick: &f64| match self.scale {
            // Ticks next to zero are zero.
            Scale::Linear if tick.abs() < 1e-12 => "0".into(),
            Scale::Linear => label(*tick, 6),
            Scale::Log10 => label(10f64.powf(*tick), 2),
        };
        mesh.x_labels(9)
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .y_labels(7)
            .bold_line_style(ShapeStyle::from(FAINT).stroke_width(PX as u32))
            .light_line_style(TRANSPARENT)
            .axis_style(rgb(INK).mix(0.6).stroke_width(PX as u32))
            .set_all_tick_mark_size(4 * PX)
            .y_label_offset(text::middle(NUMBER))
            .label_style(text::style(NUMBER, INK, HPos::Left, VPos::Top))
            .axis_desc_style(text::style(NAME, INK, HPos::Left, VPos::Top))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .draw()?;

        for level in self.levels.iter().filter(|level| drawable(&[level.value])) {
            let [low, high] = level.range();
            if low < high {
                let corners = [(x.start, low), (x.end, high)];
                chart.draw_series([Rectangle::new(corners, tint(level.color))])?;
            }
            let line = [(x.start, level.value), (x.end, level.value)];
            let dashes = DashedLineSeries::new(line, 7 * PX, 5 * PX, stroke(level.color));
            chart.draw_series(dashes)?;
        }
        for band in &self.bands {
            for run in runs(&band.points) {
                let lower = run.iter().map(|&[x, low, _]| (x, low));
                let upper = run.iter().rev().map(|&[x, _, high]| (x, high));
                let outline: Vec<_> = lower.chain(upper).collect();
                let area = Polygon::new(outline, tint(band.color));
                chart.draw_series([area])?;
            }
        }
        for series in &self.series {
            for run in runs(&series.points) {
                if let [[x, y]] = *run {
                    let dot = Circle::new((x, y), 4 * PX, rgb(series.color).filled());
                    chart.draw_series([dot])?;
                } else {
                    let points = run.iter().map(|&[x, y]| (x, y));
                    chart.draw_series(LineSeries::new(points, stroke(series.color)))?;
                }
            }
        }
        Ok(())
    }

    /// Draws the legend below the title and returns where it ends [samples]. It stands above
    /// the curves: inside it would hide some.
    fn draw_legend(&self, root: &Area) -> i32 {
        let series = self.series.iter().map(|s| (&*s.label, s.color, false));
        let levels = self.levels.iter().map(|l| (&*l.label, l.color, true));
        let named = series.chain(levels).filter(|(text, ..)| !text.is_empty());
        let entries: Vec<Entry> = named.collect();
        let right = SIZE[0] as i32 * PX - EDGE;
        let (places, height) = legend::places(&entries, EDGE, right);
        for (entry, [x, y]) in entries.iter().zip(places) {
            legend::draw(root, entry, [x, TITLE_HEIGHT + y], INK);
        }
        TITLE_HEIGHT + height
    }

    /// Ranges of x and y that hold all that is drawn, neither of them empty.
    fn ranges(&self) -> [Range<f64>; 2] {
        let series = self.series.iter().flat_map(|s| runs(&s.points).flatten());
        let levels = self.levels.iter().filter(|l| drawable(&[l.value]));
        let levels = levels.flat_map(|level| level.range());
        let bands = self.bands.iter().flat_map(|b| runs(&b.points).flatten());
        let xs = series.clone().map(|p| p[0]);
        let xs = xs.chain(bands.clone().map(|p| p[0]));
        let ys = series.map(|p| p[1]).chain(levels);
        let ys = ys.chain(bands.flat_map(|p| [p[1], p[2]]));
        // The ends of x are data, such as the first update; y gets some air.
        [padded(xs, 0.0), padded(ys, 0.05)]
    }
}

impl Level {
    /// Lower and upper end of the band; both are the level itself where there is none.
    fn range(&self) -> [f64; 2] {
        let deviation = Some(self.deviation).filter(|&deviation| drawable(&[deviation]));
        let deviation = deviation.map_or(0.0, |deviation| deviation.max(0.0));
        [self.value - deviation, self.value + deviation]
    }
}

fn tint(color: Color) -> ShapeStyle {
    rgb(color).mix(0.18).filled()
}

fn stroke(color: Color) -> ShapeStyle {
    rgb(color).stroke_width(2 * PX as u32)
}

fn drawable(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.abs() <= LARGEST)
}

/// The longest stretches of points that can be drawn.
fn runs<const N: usize>(points: &[[f64; N]]) -> impl Iterator<Item = &[[f64; N]]> + Clone {
    let stretches = points.split(|point| !drawable(point));
    stretches.filter(|run| !run.is_empty())
}

/// The range of `values`, longer by `share` of its length at both ends. Values that are all
/// (nearly) the same stand in the middle of a range that ticks can tell apart; without
/// values it is 0 to 1.
fn padded(values: impl Iterator<Item = f64>, share: f64) -> Range<f64> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    values.for_each(|v| (low, high) = (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let size = low.abs().max(high.abs());
    if high - low <= 1e-9 * size {
        let air = if size > 0.0 { 0.1 * size } else { 0.5 };
        return low - air..high + air;
    }
    let air = share * (high - low);
    low - air..high + air
}

/// A number in so many digits, without zeros at its end.
fn label(number: f64, digits: usize) -> String {
    let rounded: f64 = format!("{number:.*e}", digits - 1)
        .parse()
        .expect("a number");
    rounded.to_string()
}

#[cfg(test)]
mod tests;
