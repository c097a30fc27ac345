/// Red, green and blue, 8-bit sRGB.
pub type Color = [u8; 3];

/// What lies behind a scene.
pub const BACKGROUND: Color = [30, 30, 32];
/// The tool, below the cloth.
pub const TOOL: Color = [150, 150, 152];
/// Cloth that nobody pressed.
pub const CLOTH: Color = [214, 206, 190];
/// Cloth that is fixed to the tool.
pub const DRAPED: Color = [38, 92, 224];
/// Cloth that was pressed but did not reach the tool.
pub const TOUCHED: Color = [240, 150, 30];
/// The path of the stencil over the cloth.
pub const PATH: Color = [250, 240, 80];

/// Colours of the curves of one chart: told apart by lightness too, so that the order
/// survives colour blindness and a grey printer (after Okabe and Ito 2008, darkened).
pub const SERIES: [Color; 6] = [
    [0, 90, 170],
    [205, 80, 0],
    [0, 140, 105],
    [185, 70, 140],
    [70, 150, 205],
    [100, 100, 100],
];

/// Colour of values which are no number: in no map, so that they are noticed.
const NOT_A_NUMBER: Color = [255, 0, 255];

/// A colour for each number from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorMap {
    /// Distance to the tool, and what else grows from 0: dark violet at 0, green, yellow at 1. Its lightness grows
    /// evenly (viridis; van der Walt and Smith 2015), so the colour-blind see the same order.
    Distance,
    /// Deviation: blue at 0, white half way, red at 1. Hue says the side, saturation how far
    /// (ColorBrewer, RdBu; Brewer 2003); told apart by the colour-blind too.
    Deviation,
}

impl ColorMap {
    /// The colour of `t`; 0 and 1 hold beyond the ends, NaN is magenta.
    pub fn at(self, t: f64) -> Color {
        let stops: &[Color] = match self {
            ColorMap::Distance => &[
                [68, 1, 84],
                [71, 45, 123],
                [59, 82, 139],
                [44, 114, 142],
                [33, 145, 140],
                [40, 174, 128],
                [94, 201, 98],
                [173, 220, 48],
                [253, 231, 37],
            ],
            ColorMap::Deviation => &[
                [5, 48, 97],
                [67, 147, 195],
                [247, 247, 247],
                [214, 96, 77],
                [103, 0, 31],
            ],
        };
        if t.is_nan() {
            return NOT_A_NUMBER;
        }
        let last = stops.len() - 1;
        let s = t.clamp(0.0, 1.0) * last as f64;
        let i = (s as usize).min(last - 1);
        let mix = |a: u8, b: u8| f64::from(a) + (f64::from(b) - f64::from(a)) * (s - i as f64);
        std::array::from_fn(|c| mix(stops[i][c], stops[i + 1][c]).round() as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_grows_lighter_from_end_to_end() {
        let lightness = |k: usize| {
            let [r, g, b] = ColorMap::Distance.at(k as f64 / 40.0).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let all: Vec<f64> = (0..=40).map(lightness).collect();
        assert!(all.is_sorted_by(|a, b| a < b), "{all:?}");
        assert!(all[40] - all[0] > 190.0);
    }

    #[test]
    fn ends_hold_beyond_and_nan_is_seen() {
        for map in [ColorMap::Distance, ColorMap::Deviation] {
            assert_eq!(map.at(-1.0), map.at(0.0));
            assert_eq!(map.at(f64::INFINITY), map.at(1.0));
            assert_eq!(map.at(f64::NAN), NOT_A_NUMBER);
        }
    }

    #[test]
    fn deviation_is_white_in_the_middle_and_darkens_to_both_sides() {
        let at = |t| ColorMap::Deviation.at(t);
        assert_eq!(at(0.5), [247; 3]);
        for t in [0.1, 0.3, 0.45] {
            assert!(at(t)[2] > at(t)[0] && at(1.0 - t)[0] > at(1.0 - t)[2]);
            assert!(at(t)[1] > at(t - 0.1)[1] && at(1.0 - t)[1] > at(1.1 - t)[1]);
        }
    }
}
