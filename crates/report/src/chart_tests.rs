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
        assert!(chart.svg().ends_with("</svg>\n"));
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
    let third = (SIZE.0 as usize - 150) / 3;
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
}

#[test]
fn ticks_have_the_decimals_they_need() {
    let label = |value, start, end| tick_label(value, &(start..end));
    assert_eq!(label(0.25, 0.0, 0.9), "0.25");
    assert_eq!(label(-1e-17, -1.0, 1.0), "0.0");
    assert_eq!(label(40.0, 0.0, 100.0), "40");
    assert_eq!(label(150_000.0, 0.0, 400_000.0), "150k");
    assert_eq!(label(0.0, 0.0, 400_000.0), "0");
    assert_eq!(label(2.5e6, 0.0, 4e6), "2.5M");
    assert_eq!(label(2e-5, 0.0, 9e-5), "2.0e-5");
}

#[test]
fn legend_breaks_into_rows_and_leaves_the_plot_below() {
    let mut chart = chart(&[[0.0, 0.0], [1.0, 1.0]]);
    let rows = |chart: &Chart| {
        font::register();
        let mut image = Image::new(SIZE.0 as usize, SIZE.1 as usize, [255; 3]);
        let area = Canvas(&mut image).into_drawing_area();
        chart.draw_legend(&area, 0).unwrap() / LEGEND_HEIGHT
    };
    assert_eq!(rows(&chart), 1);
    chart.series = vec![chart.series[0].clone(); 20];
    assert!((2..=4).contains(&rows(&chart)), "{} rows", rows(&chart));
    chart.series.iter_mut().for_each(|s| s.label.clear());
    assert_eq!(rows(&chart), 0);
}

#[test]
fn extension_chooses_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let chart = chart(&[[0.0, 1.0], [1.0, 2.0]]);
    let save = |name: &str| chart.save(&folder.path().join(name));
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    save("curve.PNG").unwrap();
    assert!(read("curve.PNG").starts_with(b"\x89PNG"));
    save("curve.svg").unwrap();
    let svg = String::from_utf8(read("curve.svg")).unwrap();
    for text in ["Learning", "return [m]", "step"] {
        assert!(svg.contains(text), "no {text}");
    }
    for name in ["curve.pdf", "curve"] {
        let error = save(name).unwrap_err();
        assert!(matches!(error, ReportError::ChartFormat { .. }));
        assert!(error.to_string().contains(name));
    }
    let error = save("missing/curve.svg").unwrap_err();
    assert!(matches!(error, ReportError::Write(_)));
}

#[test]
fn powers_are_labelled_by_what_they_stand_for() {
    for (value, label) in [
        (0.0, "1.0"),
        (1.0, "10"),
        (2.5, "320"),
        (-1.5, "0.032"),
        (-9.0, "1.0e-9"),
        (12.0, "1.0e12"),
    ] {
        assert_eq!(power_label(value), label);
    }
    let logarithmic = Chart {
        scale: Scale::Log10,
        ..chart(&[[1.0, -2.0], [3.0, 1.0]])
    };
    assert!(logarithmic.svg().contains("1000"));
}
