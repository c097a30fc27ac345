use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};
use plotters::style::{FontStyle, register_font};
use std::sync::LazyLock;

/// DejaVu Sans, Basic Latin and ± · ° µ ² ³ × – − ≤ ≥; other characters show as a box.
const BYTES: &[u8] = include_bytes!("../../../assets/fonts/DejaVuSans-subset.ttf");

/// The name under which charts ask for the font, and a viewer of an SVG for its own.
pub(super) const FAMILY: &str = "sans-serif";

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    // plotters measures the texts of an SVG with this font; a second registration in the
    // same process would only replace it by itself.
    let registered = register_font(FAMILY, FontStyle::Normal, BYTES).is_ok();
    assert!(registered, "plotters reads the vendored font");
    FontRef::try_from_slice(BYTES).expect("the vendored font is a font")
});

/// Makes the font known to plotters.
pub(super) fn register() {
    LazyLock::force(&FONT);
}

/// Glyphs of `text` from x = 0 on their common baseline y = 0, and the advance width, both
/// in pixels. `size` is the height of the em square [px].
fn layout(text: &str, size: f32) -> (Vec<Glyph>, f32) {
    let em = FONT.units_per_em().expect("the vendored font has an em");
    // ab_glyph scales ascent minus descent, not the em.
    let scale = PxScale::from(size * FONT.height_unscaled() / em);
    let font = FONT.as_scaled(scale);
    let mut x = 0.0;
    let mut glyphs: Vec<Glyph> = Vec::new();
    for c in text.chars() {
        let id = font.glyph_id(c);
        if let Some(before) = glyphs.last() {
            x += font.kern(before.id, id);
        }
        glyphs.push(id.with_scale_and_position(scale, point(x, 0.0)));
        x += font.h_advance(id);
    }
    (glyphs, x)
}

/// Width of `text` at em size `size`, both [px].
pub(super) fn text_width(text: &str, size: f32) -> f32 {
    layout(text, size).1
}

/// Height of a capital letter at em size `size`, both [px].
pub(super) fn cap_height(size: f32) -> f32 {
    // DejaVu Sans: 1493 of 2048 units.
    0.729 * size
}

/// Calls `paint(x, y, coverage)` for each pixel that `text` touches; the baseline starts at
/// x = 0, y = 0, and y points down.
pub(super) fn draw_text(text: &str, size: f32, mut paint: impl FnMut(i32, i32, f32)) {
    for glyph in layout(text, size).0 {
        if let Some(outline) = FONT.outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            outline.draw(|x, y, coverage| {
                paint(
                    x as i32 + corner.x as i32,
                    y as i32 + corner.y as i32,
                    coverage,
                );
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_promised_character_has_its_own_glyph() {
        let promised = (' '..='~').chain("±·°µ²³×–−≤≥".chars());
        let missing: Vec<char> = promised.filter(|&c| FONT.glyph_id(c).0 == 0).collect();
        assert!(missing.is_empty(), "no glyph for {missing:?}");
    }

    #[test]
    fn a_capital_stands_on_the_baseline_and_is_a_cap_high() {
        let (mut top, mut bottom, mut right) = (0, i32::MIN, 0);
        draw_text("H", 100.0, |x, y, coverage| {
            if coverage > 0.5 {
                (top, bottom, right) = (top.min(y), bottom.max(y), right.max(x));
            }
        });
        assert_eq!(bottom, -1);
        assert!(
            (top as f32 + cap_height(100.0)).abs() <= 1.0,
            "top at {top}"
        );
        assert!((right as f32) < text_width("H", 100.0));
    }

    #[test]
    fn width_is_proportional_to_size_and_adds_up() {
        assert_eq!(text_width("", 20.0), 0.0);
        let [one, two] = ["0", "00"].map(|text| text_width(text, 20.0));
        assert!((two - 2.0 * one).abs() < 1e-4);
        assert!((text_width("0", 40.0) - 2.0 * one).abs() < 1e-4);
    }
}
