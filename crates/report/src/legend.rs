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

/// How the sample in front of an entry looks.
#[derive(Clone, Copy)]
pub(super) enum Key {
    Line,
    Dashes,
}

/// What the colours of a chart mean.
pub(super) struct Entry<'a> {
    pub text: &'a str,
    pub color: Color,
    pub key: Key,
}

impl Entry<'_> {
    pub fn width(&self) -> i32 {
        KEY + SPACE + text::width(self.text, EM)
    }
}

/// Left end and top of each of the `entries`, which stand in rows between `left` and `right`
/// from y = 0, and where the last row ends [samples].
pub(super) fn places(entries: &[Entry], left: i32, right: i32) -> (Vec<[i32; 2]>, i32) {
    let (mut x, mut y) = (left, 0);
    let place = |entry: &Entry| {
        if x > left && x + entry.width() > right {
            (x, y) = (left, y + ROW);
        }
        let at = [x, y];
        x += entry.width() + GAP;
        at
    };
    let places: Vec<_> = entries.iter().map(place).collect();
    let end = places.last().map_or(0, |[_, y]| y + ROW);
    (places, end)
}

/// Draws an entry with its upper left corner at `corner`.
pub(super) fn draw(area: &Area, entry: &Entry, [x, y]: [i32; 2], ink: Color) {
    let middle = y + ROW / 2;
    let bars: &[[i32; 3]] = match entry.key {
        Key::Line => &[[0, KEY, PX]],
        Key::Dashes => &[[0, KEY / 2 - 3 * PX, PX], [KEY / 2 + 3 * PX, KEY, PX]],
    };
    for [from, to, half] in bars {
        let corners = [(x + from, middle - half), (x + to, middle + half)];
        text::fill(area, corners, entry.color);
    }
    let at = [x + KEY + SPACE, middle];
    text::draw(area, entry.text, at, EM, ink, HPos::Left);
}
