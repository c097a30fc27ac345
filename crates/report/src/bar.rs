use super::font::{cap_height, text_width};
use super::{BACKGROUND, Color, ColorMap, Image};

const INK: Color = [232, 232, 228];
/// Sizes of the em [px].
const TEXT: f32 = 15.0;
/// Heights of the bar, and of the strip that holds title, bar and ticks [px].
const BAR: i32 = 14;
const STRIP: usize = 66;
const EDGE: i32 = 14;
/// Ticks, at even steps from end to end.
const TICKS: i32 = 5;

/// What the colours of a picture mean: a bar with numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorBar {
    pub map: ColorMap,
    /// Values at the ends of the map.
    pub low: f64,
    pub high: f64,
    /// Some values lie below the low end, or above the high one, and have its colour.
    pub exceeded: [bool; 2],
    /// What is shown, with its unit.
    pub title: String,
}

impl ColorBar {
    /// The image with a strip below that holds the bar.
    pub fn below(&self, image: &Image) -> Image {
        let mut all = Image::new(image.width, image.height + STRIP, BACKGROUND);
        all.pixels[..image.pixels.len()].copy_from_slice(&image.pixels);
        let top = image.height as i32 + 8;
        all.label([EDGE, top], &self.title, TEXT, INK);

        // Ticks at the ends stick out by half of their width.
        let ticks: Vec<String> = (0..TICKS).map(|k| self.tick(k)).collect();
        let widths = ticks.iter().map(|t| text_width(t, TEXT));
        let margin = EDGE + (widths.fold(0.0, f32::max) / 2.0).ceil() as i32;
        let (left, right) = (margin, image.width as i32 - margin);
        let bar = top + 20;
        for x in left..right {
            let t = f64::from(x - left) / f64::from((right - left - 1).max(1));
            for y in bar..bar + BAR {
                all.blend(x, y, self.map.at(t), 1.0);
            }
        }
        for (k, tick) in (0..TICKS).zip(&ticks) {
            let x = left + (right - left) * k / (TICKS - 1);
            let start = x - (text_width(tick, TEXT) / 2.0) as i32;
            let below = bar + BAR + 6;
            all.label([start, below], tick, TEXT, INK);
            debug_assert!(below + cap_height(TEXT) as i32 <= all.height as i32);
        }
        all
    }

    fn tick(&self, k: i32) -> String {
        let value = self.low + (self.high - self.low) * f64::from(k) / f64::from(TICKS - 1);
        // As many decimals as tell neighbouring ticks apart.
        let step = (self.high - self.low).abs() / f64::from(TICKS - 1);
        let decimals = if step > 0.0 && step.is_finite() {
            (1.0 - step.log10().floor()).clamp(0.0, 9.0) as usize
        } else {
            0
        };
        let text = format!("{value:.decimals$}");
        let text = if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            &text
        };
        let text = match text {
            "-0" => "0".into(),
            text => text.replace('-', "−"),
        };
        match k {
            0 if self.exceeded[0] => format!("≤ {text}"),
            k if k + 1 == TICKS && self.exceeded[1] => format!("≥ {text}"),
            _ => text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(low: f64, high: f64) -> ColorBar {
        ColorBar {
            map: ColorMap::Deviation,
            low,
            high,
            exceeded: [false, true],
            title: "deviation [mm]".into(),
        }
    }

    fn ticks(bar: &ColorBar) -> Vec<String> {
        (0..TICKS).map(|k| bar.tick(k)).collect()
    }

    #[test]
    fn ticks_are_even_and_short() {
        assert_eq!(ticks(&bar(-5.0, 5.0)), ["−5", "−2.5", "0", "2.5", "≥ 5"]);
        assert_eq!(
            ticks(&bar(-0.02, 0.02)),
            ["−0.02", "−0.01", "0", "0.01", "≥ 0.02"]
        );
        assert_eq!(ticks(&bar(0.0, 400.0)), ["0", "100", "200", "300", "≥ 400"]);
        assert_eq!(ticks(&bar(1.0, 1.0))[0], "1");
    }

    #[test]
    fn bar_has_all_colours_below_an_unchanged_picture() {
        let image = Image::new(400, 50, [1, 2, 3]);
        let all = bar(-1.0, 1.0).below(&image);
        assert_eq!((all.width, all.height), (400, 50 + STRIP));
        assert_eq!(all.pixels[..image.pixels.len()], image.pixels);
        for t in [0.0, 0.5, 1.0] {
            let color = ColorMap::Deviation.at(t);
            let near = |p: &&Color| (0..3).all(|c| p[c].abs_diff(color[c]) < 3);
            assert!(
                all.pixels.iter().filter(near).count() >= BAR as usize,
                "{t}"
            );
        }
        // Too narrow for a bar: no panic.
        assert_eq!(bar(-1.0, 1.0).below(&Image::new(9, 3, [0; 3])).width, 9);
    }
}
