use super::Color;
use super::image::PX;
use super::text::{self, Area};
use plotters::style::text_anchor::HPos;

/// Height of a row, size of the sample in front of an entry, gaps behind it and behind the
/// entry, in samples, and size of the em.
const ROW: i32 = 24 * PX;
const KEY: i32 = 24 * PX;
const SPACE: i32 = 8 * PX;
const GAP: i32 = 26 * PX;
const EM: f64 = (14 * PX) as f64;

/// What a colour of a chart means, and whether its line is dashed.
pub(super) type Entry<'a> = (&'a str, Color, bool);

/// Left end and top of each of the `entries`, which stand in rows between `left` and `right`
/// from y = 0, and where the last row ends [samples].
pub(super) fn places(entries: &[Entry], left: i32, right: i32) -> (Vec<[i32; 2]>, i32) {
    let (mut x, mut y) = (left, 0);
    let place = |(text, ..): &Entry| {
        let width = KEY + SPACE + text::width(text, EM);
        if x > left && x + width > right {
            (x, y) = (left, y + ROW);
        }
        let at = [x, y];
        x += width + GAP;
        at
    };
    let places: Vec<_> = entries.iter().map(place).collect();
    let end = places.last().map_or(0, |[_, y]| y + ROW);
    (places, end)
}

/// Draws an entry with its upper left corner at `x` and `y`.
pub(super) fn draw(area: &Area, &(text, color, is_dashed): &Entry, [x, y]: [i32; 2], ink: Color) {
    let middle = y + ROW / 2;
    let bars: &[[i32; 2]] = match is_dashed {
        false => &[[0, KEY]],
        true => &[[0, KEY / 2 - 3 * PX], [KEY / 2 + 3 * PX, KEY]],
    };
    for [from, to] in bars {
        let corners = [(x + from, middle - PX), (x + to, middle + PX)];
        text::fill(area, corners, color);
    }
    text::draw(area, text, [x + KEY + SPACE, middle], EM, ink, HPos::Left);
}
