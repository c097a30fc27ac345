use super::{Color, Image, font};

/// Width and height of a tile [px].
const TILE: [i32; 2] = [62, 30];
const EDGE: i32 = 18;
/// Sizes of the em [px].
const TITLE: f32 = 17.0;
const TEXT: f32 = 13.0;
const SMALL: f32 = 11.5;
/// Height of a line of text [px].
const LINE: i32 = 22;
/// Side of a sample in the legend [px].
const SAMPLE: i32 = 14;

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
    /// What colours mean, below the map.
    pub legend: Vec<(String, Color)>,
}

impl HeatMap {
    /// The map as a picture, as large as its tiles and texts need.
    pub fn image(&self) -> Image {
        let [columns, rows] = [self.x_ticks.len(), self.y_ticks.len()].map(|n| n as i32);
        let tick_width = self.y_ticks.iter().map(|t| width(t, TEXT)).max();
        let left = EDGE + tick_width.unwrap_or(0).max(width(&self.y_label, TEXT) / 3) + 10;
        let top = EDGE + 2 * LINE + 8;
        let bottom = top + rows * TILE[1];

        let legend_top = bottom + 2 * LINE + 12;
        let texts = [
            EDGE + width(&self.title, TITLE),
            EDGE + width(&self.y_label, TEXT),
            left + (columns * TILE[0]).max(width(&self.x_label, TEXT)),
            // Legends break into rows, but single entries do not.
            self.legend
                .iter()
                .map(|(text, _)| EDGE + entry_width(text))
                .max()
                .unwrap_or(0),
        ];
        let right = texts.into_iter().max().unwrap_or(0) + EDGE;
        let entries = self.place_legend(legend_top, right);
        let end = entries.last().map_or(legend_top, |&[_, y]| y + LINE);

        let mut image = Image::new(right as usize, (end + EDGE) as usize, [255; 3]);
        image.label([EDGE, EDGE], &self.title, TITLE, INK);
        image.label([EDGE, EDGE + LINE + 6], &self.y_label, TEXT, INK);
        for (index, tile) in self.tiles.iter().enumerate() {
            let index = index as i32;
            let (column, row) = (index % columns.max(1), index / columns.max(1));
            if columns == 0 || row >= rows {
                break;
            }
            let corner = [left + column * TILE[0], bottom - (row + 1) * TILE[1]];
            fill(&mut image, corner, [TILE[0] - 1, TILE[1] - 1], tile.color);
            let middle = [corner[0] + TILE[0] / 2, corner[1] + TILE[1] / 2];
            centred(&mut image, middle, &tile.text, SMALL, contrast(tile.color));
        }
        for (row, tick) in self.y_ticks.iter().enumerate() {
            let y = bottom - row as i32 * TILE[1] - TILE[1] / 2;
            let x = left - 8 - width(tick, TEXT);
            image.label([x, y - cap(TEXT) / 2], tick, TEXT, INK);
        }
        for (column, tick) in self.x_ticks.iter().enumerate() {
            let x = left + column as i32 * TILE[0] + TILE[0] / 2;
            centred(&mut image, [x, bottom + 12], tick, TEXT, INK);
        }
        image.label([left, bottom + 12 + LINE - 4], &self.x_label, TEXT, INK);
        for ((text, color), [x, y]) in self.legend.iter().zip(entries) {
            fill(&mut image, [x, y], [SAMPLE; 2], *color);
            image.label([x + SAMPLE + 6, y + 2], text, TEXT, INK);
        }
        image
    }

    /// Upper left corners of the entries of the legend, in rows from `top` that end before
    /// `right`.
    fn place_legend(&self, top: i32, right: i32) -> Vec<[i32; 2]> {
        let (mut x, mut y) = (EDGE, top);
        let place = |(text, _): &(String, Color)| {
            let width = entry_width(text);
            if x > EDGE && x + width > right - EDGE {
                (x, y) = (EDGE, y + LINE);
            }
            let at = [x, y];
            x += width + 18;
            at
        };
        self.legend.iter().map(place).collect()
    }
}

fn entry_width(text: &str) -> i32 {
    SAMPLE + 6 + width(text, TEXT)
}

fn width(text: &str, size: f32) -> i32 {
    font::text_width(text, size).ceil() as i32
}

fn cap(size: f32) -> i32 {
    font::cap_height(size).round() as i32
}

fn centred(image: &mut Image, [x, y]: [i32; 2], text: &str, size: f32, color: Color) {
    let corner = [x - width(text, size) / 2, y - cap(size) / 2];
    image.label(corner, text, size, color);
}

fn fill(image: &mut Image, [x, y]: [i32; 2], [width, height]: [i32; 2], color: Color) {
    for y in y..y + height {
        for x in x..x + width {
            image.blend(x, y, color, 1.0);
        }
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
            legend: vec![("good".into(), [1, 2, 3]), ("bad".into(), [4, 5, 6])],
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
        let size = ((TILE[0] - 1) * (TILE[1] - 1)) as usize;
        assert_eq!((red.len(), blue.len()), (size, size));
        assert_eq!(blue[0][0] - red[0][0], 2 * TILE[0] as usize);
        assert_eq!(red[0][1] - blue[0][1], TILE[1] as usize);
        for color in [[1, 2, 3], [4, 5, 6]] {
            assert_eq!(places(&image, color).len(), (SAMPLE * SAMPLE) as usize);
        }
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
        assert!((image.width - EDGE as usize..image.width).all(|x| ink(x) == 0));
        assert!(ink(image.width - 2 * EDGE as usize) > 0);
        for (columns, rows) in [(0, 0), (0, 3), (3, 0)] {
            let mut empty = map(columns, rows);
            empty.tiles = vec![tile(RED); 4];
            assert!(places(&empty.image(), RED).is_empty());
        }
        HeatMap::default().image();
    }
}
