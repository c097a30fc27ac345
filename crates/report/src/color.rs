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
    /// Distance to the tool: blue at 0, green half way, red at 1. Hue says what is flat and
    /// what is a wrinkle at a glance; equal steps do not look equal.
    Distance,
    /// Deviation: blue at 0, white half way, red at 1. Hue says the side, saturation how far
    /// (ColorBrewer, RdBu; Brewer 2003); told apart by the colour-blind too.
    Deviation,
    /// Viridis (Smith and van der Walt 2015), five points of it: lightness grows evenly, so
    /// that equal steps look equal.
    Viridis,
}

impl ColorMap {
    /// The colour of `t`; 0 and 1 hold beyond the ends, NaN is magenta.
    pub fn at(self, t: f64) -> Color {
        let stops: &[Color] = match self {
            ColorMap::Distance => &[[18, 38, 224], [70, 196, 36], [255, 26, 38]],
            ColorMap::Deviation => &[
                [5, 48, 97],
                [67, 147, 195],
                [247, 247, 247],
                [214, 96, 77],
                [103, 0, 31],
            ],
            ColorMap::Viridis => &[
                [68, 1, 84],
                [59, 82, 139],
                [33, 145, 140],
                [94, 201, 98],
                [253, 231, 37],
            ],
        };
        if t.is_nan() {
            return NOT_A_NUMBER;
        }
        let last = stops.len() - 1;
        let s = t.clamp(0.0, 1.0) * last as f64;
        let i = (s as usize).min(last - 1);
        mix(stops[i], stops[i + 1], s - i as f64)
    }

    /// One colour per value: 0 is the lower end of the map, `maximum` its upper end. A
    /// `maximum` of 0 puts everything above 0 at the upper end.
    pub fn colors(self, values: &[f64], maximum: f64) -> Vec<Color> {
        let t = |&value: &f64| match value {
            v if v <= 0.0 => 0.0,
            v => v / maximum,
        };
        values.iter().map(|value| self.at(t(value))).collect()
    }
}

/// `a` at t = 0, `b` at t = 1, straight in between.
pub(super) fn mix(a: Color, b: Color, t: f64) -> Color {
    std::array::from_fn(|i| {
        (f64::from(a[i]) + (f64::from(b[i]) - f64::from(a[i])) * t).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_goes_from_blue_over_green_to_red() {
        let strongest = |t| {
            let color = ColorMap::Distance.at(t);
            (0..3).max_by_key(|&i| color[i]).unwrap()
        };
        assert_eq!([0.0, 0.5, 1.0].map(strongest), [2, 1, 0]);
        assert_eq!(ColorMap::Distance.at(0.25), [44, 117, 130]);
    }

    #[test]
    fn ends_hold_beyond_and_nan_is_seen() {
        for map in [ColorMap::Distance, ColorMap::Deviation, ColorMap::Viridis] {
            assert_eq!(map.at(-1.0), map.at(0.0));
            assert_eq!(map.at(f64::INFINITY), map.at(1.0));
            assert_eq!(map.at(f64::NAN), NOT_A_NUMBER);
        }
        let map = ColorMap::Distance;
        let colors = map.colors(&[-0.1, 0.0, 0.02, 0.04, f64::NAN], 0.02);
        let expected = [0.0, 0.0, 1.0, 1.0, f64::NAN].map(|t| map.at(t));
        assert_eq!(colors, expected);
        assert_eq!(map.colors(&[0.0, 1e-9], 0.0), [map.at(0.0), map.at(1.0)]);
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

    #[test]
    fn viridis_grows_lighter() {
        let lightness = |i: i32| {
            let [r, g, b] = ColorMap::Viridis.at(f64::from(i) / 20.0).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((0..20).all(|i| lightness(i) < lightness(i + 1)));
    }
}
