use super::Color;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};
use std::sync::Once;

/// DejaVu Sans, Basic Latin and ± · ° µ ² ³ × – − ≤ ≥; other characters show as a box.
const BYTES: &[u8] = include_bytes!("../../../assets/fonts/DejaVuSans-subset.ttf");
const FAMILY: &str = "sans-serif";

/// What plotters calls the size of this font, and the height of its capitals, per em.
const SIZE_PER_EM: f64 = 1.164;
const CAPITAL_PER_EM: f64 = 0.729;

pub(super) type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// A colour as plotters has it.
pub(super) fn rgb([r, g, b]: Color) -> RGBColor {
    RGBColor(r, g, b)
}

/// Fills a rectangle; what does not fit the area is cut off.
pub(super) fn fill(area: &Area, corners: [(i32, i32); 2], color: Color) {
    let drawn = area.draw(&Rectangle::new(corners, rgb(color).filled()));
    drawn.expect("memory takes all pixels");
}

/// Text of em size `em` [px] whose anchor is `h_pos` and `v_pos` of the box that plotters
/// thinks it fills: see [`middle`].
pub(super) fn style(em: f64, color: Color, h_pos: HPos, v_pos: VPos) -> TextStyle<'static> {
    static REGISTERED: Once = Once::new();
    REGISTERED.call_once(|| {
        let registered = register_font(FAMILY, FontStyle::Normal, BYTES).is_ok();
        assert!(registered, "plotters reads the vendored font");
    });
    let mut style = TextStyle::from((FAMILY, em * SIZE_PER_EM).into_font());
    style.color = rgb(color).to_backend_color();
    style.pos(Pos::new(h_pos, v_pos))
}

/// How far below the centre of its text plotters must be told to draw, so that the middle of
/// the capitals is there [px]: it draws the baseline half a size below the top of a box that
/// is size / 1.24 high.
pub(super) fn middle(em: f64) -> i32 {
    let size = em * SIZE_PER_EM;
    (size / 2.48 - size / 2.0 + CAPITAL_PER_EM * em / 2.0).round() as i32
}

/// Draws `text` beside, around or left of x, with the middle of its capitals at y [px]. What
/// does not fit the area is cut off.
pub(super) fn draw(area: &Area, text: &str, [x, y]: [i32; 2], em: f64, color: Color, anchor: HPos) {
    let drawn = area.draw_text(
        text,
        &style(em, color, anchor, VPos::Center),
        (x, y + middle(em)),
    );
    drawn.expect("memory takes all pixels, and the font is part of the program");
}

/// Height of a capital letter [px].
pub(super) fn capital(em: f64) -> i32 {
    (CAPITAL_PER_EM * em).round() as i32
}

/// Width of `text` [px].
pub(super) fn width(text: &str, em: f64) -> i32 {
    let size = style(em, [0; 3], HPos::Left, VPos::Top).font.box_size(text);
    size.expect("the font is part of the program").0 as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    #[test]
    fn every_promised_character_has_its_own_glyph() {
        let drawn = |c: char| {
            let mut image = Image::new(60, 60, [255; 3]);
            let place = [5, 30];
            draw(
                &image.area(),
                &c.to_string(),
                place,
                40.0,
                [0; 3],
                HPos::Left,
            );
            image
        };
        let missing = drawn('\u{4e00}');
        for c in ('!'..='~').chain("±·°µ²³×–−≤≥".chars()) {
            assert!(drawn(c) != missing, "no glyph for {c:?}");
        }
    }

    #[test]
    fn width_is_proportional_to_size_and_adds_up() {
        assert_eq!(width("", 20.0), 0);
        let [one, two] = ["0", "00"].map(|text| width(text, 200.0));
        assert!((two - 2 * one).abs() <= 1 && (width("0", 400.0) - 2 * one).abs() <= 1);
    }
}
