use super::image::PX;
use super::{Color, Image, text};
use plotters::style::text_anchor::HPos;

/// Width and height of a tile, in samples as all lengths here.
const TILE: [i32; 2] = [62 * PX, 30 * PX];
const EDGE: i32 = 18 * PX;
/// Height of a line of text.
const LINE: i32 = 22 * PX;
/// Sizes of the em.
const TITLE: f64 = (17 * PX) as f64;
const TEXT: f64 = (13 * PX) as f64;
const SMALL: f64 = (12 * PX) as f64;

const INK: Color = [45, 48, 54];

/// A cell of a heat map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    pub color: Color,
    /// Short: what does not fit the tile is drawn over its neighbours.
    pub text: String,
}

/// Values over two axes with named ticks, one coloured tile each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HeatMap {
    /// Heading.
    pub title: String,
    /// What x and y are, with their units.
    pub x_label: String,
    pub y_label: String,
    /// Names of the columns from left to right, and of the rows from bottom to top.
    pub x_ticks: Vec<String>,
    pub y_ticks: Vec<String>,
    /// Row by row from the bottom, each from left to right; missing tiles stay white.
    pub tiles: Vec<Tile>,
}

impl HeatMap {
    /// The map as a picture, as large as its tiles and texts need.
    pub fn image(&self) -> Image {
        let [columns, rows] = [self.x_ticks.len(), self.y_ticks.len()].map(|n| n as i32);
        let ticks = self.y_ticks.iter();
        let tick_width = ticks.map(|tick| text::width(tick, TEXT)).max().unwrap_or(0);
        // Tiles begin and end between pixels.
        let left = (EDGE + tick_width + 10 * PX) / PX * PX;
        let bottom = EDGE + 5 * LINE / 2 + rows * TILE[1];
        let right = [
            EDGE + text::width(&self.title, TITLE),
            EDGE + text::width(&self.y_label, TEXT),
            left + (columns * TILE[0]).max(text::width(&self.x_label, TEXT)),
        ];
        let right = right.into_iter().max().unwrap_or(0);
        let size =
            [right + EDGE, bottom + 5 * LINE / 2 + EDGE].map(|side| (side / PX * PX) as usize);
        let mut image = Image::new(size[0], size[1], [255; 3]);
        let area = image.area();
        let write = |text: &str, at: [i32; 2], em: f64, anchor: HPos| {
            text::draw(&area, text, at, em, INK, anchor);
        };
        write(&self.title, [EDGE, EDGE + LINE / 3], TITLE, HPos::Left);
        write(&self.y_label, [EDGE, EDGE + 5 * LINE / 3], TEXT, HPos::Left);
        let below = bottom + 5 * LINE / 3;
        write(&self.x_label, [left, below], TEXT, HPos::Left);
        let center = |column: i32, row: i32| {
            [
                left + column * TILE[0] + TILE[0] / 2,
                bottom - row * TILE[1] - TILE[1] / 2,
            ]
        };
        for (row, tick) in (0..).zip(&self.y_ticks) {
            write(tick, [left - 8 * PX, center(0, row)[1]], TEXT, HPos::Right);
        }
        for (column, tick) in (0..).zip(&self.x_ticks) {
            let at = [center(column, 0)[0], bottom + 2 * LINE / 3];
            write(tick, at, TEXT, HPos::Center);
        }
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| center(column, row)));
        for (tile, [x, y]) in self.tiles.iter().zip(cells) {
            let corner = (x - TILE[0] / 2, y - TILE[1] / 2);
            let opposite = (corner.0 + TILE[0] - PX, corner.1 + TILE[1] - PX);
            text::fill(&area, [corner, opposite], tile.color);
            let ink = contrast(tile.color);
            text::draw(&area, &tile.text, [x, y], SMALL, ink, HPos::Center);
        }
        drop(area);
        image.reduced(PX as usize)
    }
}

/// Black or white, whichever is read better on `color`.
fn contrast([r, g, b]: Color) -> Color {
    let lightness = 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
    if lightness > 130.0 { [0; 3] } else { [255; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Color = [220, 10, 20];
    const BLUE: Color = [20, 10, 220];

    fn map(columns: usize, rows: usize) -> HeatMap {
        HeatMap {
            title: "outcome".into(),
            x_label: "substeps".into(),
            y_label: "frame [s]".into(),
            x_ticks: (0..columns).map(|i| i.to_string()).collect(),
            y_ticks: (0..rows).map(|i| format!("1/{i}")).collect(),
            tiles: Vec::new(),
        }
    }

    fn tile(color: Color) -> Tile {
        Tile {
            color,
            text: String::new(),
        }
    }

    fn places(image: &Image, color: Color) -> Vec<[usize; 2]> {
        let pixels = image.pixels.iter().enumerate();
        let found = pixels.filter(|(_, pixel)| **pixel == color);
        found
            .map(|(i, _)| [i % image.width, i / image.width])
            .collect()
    }

    #[test]
    fn tiles_fill_their_places_from_the_lower_left() {
        let mut map = map(3, 2);
        map.tiles = vec![tile([9; 3]); 6];
        map.tiles[0] = tile(RED);
        map.tiles[5] = tile(BLUE);
        let image = map.image();
        let [red, blue] = [RED, BLUE].map(|color| places(&image, color));
        let tile = TILE.map(|side| (side / PX) as usize);
        let size = (tile[0] - 1) * (tile[1] - 1);
        assert_eq!((red.len(), blue.len()), (size, size));
        assert_eq!(blue[0][0] - red[0][0], 2 * tile[0]);
        assert_eq!(red[0][1] - blue[0][1], tile[1]);
    }

    #[test]
    fn texts_are_drawn_within_the_image_and_hostile_maps_without_panic() {
        let mut wide = map(1, 1);
        wide.title = "a title that is much wider than its only column of tiles".into();
        wide.tiles = vec![tile(RED); 9];
        let image = wide.image();
        let ink = |x: usize| {
            let column = image.pixels.iter().skip(x).step_by(image.width);
            column.filter(|&&pixel| pixel != [255; 3]).count()
        };
        assert!((image.width - EDGE as usize / PX as usize..image.width).all(|x| ink(x) == 0));
        assert!(ink(image.width - 2 * EDGE as usize / PX as usize) > 0);
        for (columns, rows) in [(0, 0), (0, 3), (3, 0)] {
            let mut empty = map(columns, rows);
            empty.tiles = vec![tile(RED); 4];
            assert!(places(&empty.image(), RED).is_empty());
        }
        HeatMap::default().image();
    }
}
