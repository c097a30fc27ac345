use super::canvas::{Canvas, SIZE_PER_EM};
use super::{Color, Image, ReportError, font};
use drape_cloth::file::write_atomic;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::io::Write;
use std::ops::Range;
use std::path::Path;

/// Width and height of a chart [px].
const SIZE: (u32, u32) = (960, 560);
const EDGE: i32 = 24;
/// Height of the title line and of a row of the legend [px].
const TITLE_HEIGHT: i32 = 44;
const LEGEND_HEIGHT: i32 = 24;
/// Width of the sample in front of a legend entry, and of the gap behind the entry [px].
const SAMPLE: i32 = 24;
const LEGEND_GAP: i32 = 26;

const INK: RGBColor = RGBColor(45, 48, 54);
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
    /// Levels, below all curves.
    pub levels: Vec<Level>,
    /// Of both axes.
    pub scale: Scale,
}

impl Chart {
    /// Writes the chart as PNG or SVG, which the extension of `path` decides, atomically.
    pub fn save(&self, path: &Path) -> Result<(), ReportError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        match extension.to_ascii_lowercase().as_str() {
            "png" => self.image().save_png(path),
            "svg" => Ok(write_atomic(path, |file| {
                file.write_all(self.svg().as_bytes())
            })?),
            _ => Err(ReportError::ChartFormat {
                path: path.to_path_buf(),
            }),
        }
    }

    /// The chart as a picture.
    pub fn image(&self) -> Image {
        let mut image = Image::new(SIZE.0 as usize, SIZE.1 as usize, [255; 3]);
        self.draw(Canvas(&mut image));
        image
    }

    /// The chart as a text of SVG. Its letters are those of whoever shows it.
    pub fn svg(&self) -> String {
        let mut text = String::new();
        self.draw(SVGBackend::with_string(&mut text, SIZE));
        text
    }

    fn draw<DB: DrawingBackend>(&self, backend: DB) {
        font::register();
        let root = backend.into_drawing_area();
        let drawn = self.draw_all(&root).and_then(|()| root.present());
        // Both backends draw into memory, with a font that is part of the program.
        drawn.expect("drawing a chart cannot fail");
    }

    fn draw_all<DB: DrawingBackend>(&self, root: &Area<DB>) -> Drawn<DB> {
        root.fill(&WHITE)?;
        let title = text_style(20.0, HPos::Left, VPos::Top);
        root.draw_text(&self.title, &title, (EDGE, EDGE - 6))?;
        let below = self.draw_legend(root, TITLE_HEIGHT + 4)?;
        let (_, plot) = root.split_vertically(below);

        let [x, y] = self.ranges();
        let mut chart = ChartBuilder::on(&plot)
            .margin_top(8)
            .margin_right(EDGE + 12)
            .margin_left(12)
            .margin_bottom(8)
            .x_label_area_size(44)
            .y_label_area_size(76)
            .build_cartesian_2d(x.clone(), y.clone())?;
        chart
            .configure_mesh()
            .x_labels(9)
            .y_labels(7)
            .x_label_formatter(&|value| self.label(*value, &x))
            .y_label_formatter(&|value| self.label(*value, &y))
            .bold_line_style(FAINT)
            .light_line_style(TRANSPARENT)
            .axis_style(INK.mix(0.6))
            .set_all_tick_mark_size(4)
            .label_style(text_style(13.0, HPos::Left, VPos::Top))
            .axis_desc_style(text_style(14.0, HPos::Left, VPos::Top))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .draw()?;

        for level in self.levels.iter().filter(|level| drawable(&[level.value])) {
            let [low, high] = level.range();
            if low < high {
                let area = Rectangle::new([(x.start, low), (x.end, high)], faint(level.color));
                chart.draw_series([area])?;
            }
            let line = [(x.start, level.value), (x.end, level.value)];
            chart.draw_series(DashedLineSeries::new(line, 7, 5, stroke(level.color)))?;
        }
        for series in &self.series {
            for run in runs(&series.points) {
                let points = run.iter().map(|&[x, y]| (x, y));
                if let [[x, y]] = *run {
                    let dot = Circle::new((x, y), 4, rgb(series.color).filled());
                    chart.draw_series([dot])?;
                } else {
                    chart.draw_series(LineSeries::new(points, stroke(series.color)))?;
                }
            }
        }
        Ok(())
    }

    fn label(&self, value: f64, range: &Range<f64>) -> String {
        match self.scale {
            Scale::Linear => tick_label(value, range),
            Scale::Log10 => power_label(value),
        }
    }

    /// Draws the legend in rows from `top` and returns where it ends [px]. It stands above
    /// the curves: inside it would hide some.
    fn draw_legend<DB: DrawingBackend>(
        &self,
        root: &Area<DB>,
        top: i32,
    ) -> Result<i32, DrawingAreaErrorKind<DB::ErrorType>> {
        let series = self.series.iter().map(|s| (&s.label, s.color, Key::Line));
        let levels = self.levels.iter().map(|l| (&l.label, l.color, Key::Dashes));
        let style = text_style(14.0, HPos::Left, VPos::Center);
        let (mut x, mut y) = (EDGE, top);
        let mut rows = 0;
        for (label, color, key) in series.chain(levels) {
            if label.is_empty() {
                continue;
            }
            let text_width = root.estimate_text_size(label, &style)?.0 as i32;
            let width = SAMPLE + 8 + text_width;
            if rows == 0 {
                rows = 1;
            } else if x + width > SIZE.0 as i32 - EDGE {
                (x, y) = (EDGE, y + LEGEND_HEIGHT);
                rows += 1;
            }
            let middle = y + LEGEND_HEIGHT / 2;
            let dash = |from: i32, to: i32| {
                PathElement::new([(x + from, middle), (x + to, middle)], stroke(color))
            };
            match key {
                Key::Line => root.draw(&dash(0, SAMPLE))?,
                Key::Dashes => {
                    root.draw(&dash(0, SAMPLE / 2 - 3))?;
                    root.draw(&dash(SAMPLE / 2 + 3, SAMPLE))?;
                }
            }
            root.draw_text(label, &style, (x + SAMPLE + 8, middle))?;
            x += width + LEGEND_GAP;
        }
        Ok(top + rows * LEGEND_HEIGHT)
    }

    /// Ranges of x and y that hold all that is drawn, neither of them empty.
    fn ranges(&self) -> [Range<f64>; 2] {
        let series = self.series.iter().flat_map(|s| runs(&s.points).flatten());
        let levels = self.levels.iter().filter(|l| drawable(&[l.value]));
        let levels = levels.flat_map(|level| level.range());
        let xs = series.clone().map(|p| p[0]);
        let ys = series.map(|p| p[1]).chain(levels);
        // The ends of x are data, such as the first update; y gets some air.
        [padded(xs, 0.0), padded(ys, 0.05)]
    }
}

impl Level {
    /// Lower and upper end of the band; both are the level itself where there is none.
    fn range(&self) -> [f64; 2] {
        let deviation = if drawable(&[self.deviation]) {
            self.deviation.max(0.0)
        } else {
            0.0
        };
        [self.value - deviation, self.value + deviation]
    }
}

/// How a legend entry looks.
enum Key {
    Line,
    Dashes,
}

type Area<DB> = DrawingArea<DB, Shift>;
type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

fn rgb([r, g, b]: Color) -> RGBColor {
    RGBColor(r, g, b)
}

fn stroke(color: Color) -> ShapeStyle {
    rgb(color).stroke_width(2)
}

fn faint(color: Color) -> ShapeStyle {
    rgb(color).mix(0.18).filled()
}

/// Text of em size `size` [px].
fn text_style(size: f64, h_pos: HPos, v_pos: VPos) -> TextStyle<'static> {
    let style = TextStyle::from((font::FAMILY, size * SIZE_PER_EM).into_font());
    style.color(&INK).pos(Pos::new(h_pos, v_pos))
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
    let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    let (low, high) = ends;
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

/// A tick's number, with as many decimals as the ticks of `range` need, and k for thousands
/// or M for millions where all would be long.
fn tick_label(value: f64, range: &Range<f64>) -> String {
    let largest = range.start.abs().max(range.end.abs());
    let step = (range.end - range.start) / 10.0;
    let (unit, suffix) = match largest {
        l if !(1e-3..1e9).contains(&l) => {
            let digits = (largest / step).log10().ceil().clamp(0.0, 9.0);
            return format!("{value:.*e}", digits as usize);
        }
        l if l >= 2e6 => (1e6, "M"),
        l if l >= 2e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let decimals = (-(step / unit).log10().floor()).clamp(0.0, 9.0);
    let number = format!("{:.*}", decimals as usize, value / unit);
    // A tick at -1e-17 is a zero, and zero has no unit.
    if number.bytes().all(|b| matches!(b, b'-' | b'0' | b'.')) {
        number.trim_start_matches('-').to_owned()
    } else {
        number + suffix
    }
}

/// Ten to the power of `value`, to two digits.
fn power_label(value: f64) -> String {
    let decimals = 1.0 - value.floor();
    match decimals {
        d if !(-6.0..=6.0).contains(&d) => format!("{:.1e}", 10f64.powf(value)),
        d if d >= 0.0 => format!("{:.*}", d as usize, 10f64.powf(value)),
        d => {
            let unit = 10f64.powf(-d);
            format!("{:.0}", (10f64.powf(value) / unit).round() * unit)
        }
    }
}

#[cfg(test)]
#[path = "chart_tests.rs"]
mod tests;
