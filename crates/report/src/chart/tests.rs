use super::*;
use crate::SERIES;

const NAN: f64 = f64::NAN;

fn series(points: &[[f64; 2]]) -> Series {
    Series {
        label: "return".into(),
        points: points.to_vec(),
        color: SERIES[0],
    }
}

fn chart(points: &[[f64; 2]]) -> Chart {
    Chart {
        title: "Learning".into(),
        x_label: "step".into(),
        y_label: "return [m]".into(),
        series: vec![series(points)],
        ..Chart::default()
    }
}

/// Pixels of exactly this colour.
fn count(image: &Image, color: Color) -> usize {
    image.pixels.iter().filter(|&&p| p == color).count()
}

#[test]
fn hostile_numbers_are_drawn_without_panic() {
    let inf = f64::INFINITY;
    let hostile: &[&[[f64; 2]]] = &[
        &[],
        &[[1.0, 2.0]],
        &[[0.0, 0.0]],
        &[[NAN, NAN], [NAN, 1.0], [1.0, NAN]],
        &[[0.0, 1.0], [1.0, NAN], [2.0, 3.0], [3.0, inf], [-inf, 2.0]],
        &[[0.0, 3.0], [1.0, 3.0], [2.0, 3.0]],
        &[[5.0, 0.0], [5.0, 1.0]],
        &[[0.0, 1e-300], [1.0, 2e-300]],
        &[[0.0, -f64::MAX], [1.0, f64::MAX]],
        &[[0.0, -1e100], [1.0, 1e100]],
        &[[1e9, 1.0], [1e9 + 1e-6, 1.0 + 1e-15]],
        &[[3.0, 1.0], [1.0, 2.0], [2.0, -1.0]],
    ];
    for points in hostile {
        let mut chart = chart(points);
        for value in [0.5, NAN, inf] {
            for deviation in [0.0, 0.1, -1.0, NAN, inf] {
                chart.levels.push(Level {
                    label: String::new(),
                    value,
                    deviation,
                    color: SERIES[1],
                });
            }
        }
        assert!(count(&chart.image(), [255; 3]) > 100_000);
        for range in chart.ranges() {
            assert!(range.start < range.end && range.start.is_finite() && range.end.is_finite());
        }
    }
    assert_eq!(Chart::default().ranges(), [0.0..1.0, 0.0..1.0]);
}

#[test]
fn curve_is_interrupted_where_there_is_no_number() {
    // The middle third is level at 0.5, or nothing.
    let pixels = |gap: f64| {
        let y = |i: i32| {
            if (34..67).contains(&i) {
                gap
            } else {
                f64::from(i % 2)
            }
        };
        let points: Vec<_> = (0..=100).map(|i| [f64::from(i), y(i)]).collect();
        let mut chart = chart(&points);
        chart.series[0].label.clear();
        count(&chart.image(), SERIES[0])
    };
    let third = (SIZE[0] - 150) / 3;
    // The stroke is two pixels wide, but not exactly on pixels.
    assert!(pixels(0.5) > pixels(NAN) + third / 2);
    assert_eq!(runs(&[[0.0], [NAN], [NAN], [1.0], [2.0]]).count(), 2);
}

#[test]
fn one_point_is_a_dot() {
    let mut chart = chart(&[[1.0, 2.0]]);
    chart.series[0].label.clear();
    let dot = count(&chart.image(), SERIES[0]);
    // π 4² = 50 pixels, less those at the rim.
    assert!((35..=55).contains(&dot), "{dot} pixels");
}

#[test]
fn everything_drawn_lies_within_the_axes() {
    let mut chart = chart(&[[0.0, 1.0], [10.0, 2.0]]);
    assert_eq!(chart.ranges(), [0.0..10.0, 0.95..2.05]);
    chart.levels.push(Level {
        label: "random".into(),
        value: 4.0,
        deviation: 1.0,
        color: SERIES[1],
    });
    assert_eq!(chart.ranges()[1], 0.8..5.2);
    chart.bands.push(Band {
        points: vec![[0.0, 0.0, 1.0], [20.0, 5.0, 10.0], [30.0, NAN, 99.0]],
        color: SERIES[0],
    });
    assert_eq!(chart.ranges(), [0.0..20.0, -0.5..10.5]);
}

#[test]
fn band_tints_what_lies_between_its_ends() {
    let image = |points: &[[f64; 3]]| {
        let mut chart = chart(&[[0.0, 0.0], [1.0, 1.0]]);
        chart.bands.push(Band {
            points: points.to_vec(),
            color: SERIES[1],
        });
        chart.image()
    };
    let none = image(&[]);
    let tinted = |points: &[[f64; 3]]| {
        let image = image(points);
        let pairs = image.pixels.iter().zip(&none.pixels);
        pairs.filter(|(tinted, plain)| tinted != plain).count() as f64
    };
    let whole = tinted(&[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]);
    let half = tinted(&[[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]);
    assert!(whole > 200_000.0, "{whole} pixels");
    let share = half / whole;
    assert!((0.45..0.55).contains(&share), "{half} of {whole}");
}

#[test]
fn legend_breaks_into_rows_and_leaves_the_plot_below() {
    let mut chart = chart(&[[0.0, 0.0], [1.0, 1.0]]);
    let end = |chart: &Chart| {
        let mut image = Image::new(9, 9, [255; 3]);
        (chart.draw_legend(&image.area()) - TITLE_HEIGHT) / PX
    };
    let row = end(&chart);
    assert!(row > 14);
    chart.series = vec![chart.series[0].clone(); 20];
    assert!((2 * row..=4 * row).contains(&end(&chart)));
    chart.series.iter_mut().for_each(|s| s.label.clear());
    assert_eq!(end(&chart), 0);
}

#[test]
fn ticks_have_the_digits_they_need() {
    for (number, digits, text) in [
        (0.1 + 0.2, 6, "0.3"),
        (200_000.0, 6, "200000"),
        (-2.5, 6, "-2.5"),
        (10f64.powf(2.5), 2, "320"),
        (10f64.powf(-1.5), 2, "0.032"),
    ] {
        assert_eq!(label(number, digits), text);
    }
}
