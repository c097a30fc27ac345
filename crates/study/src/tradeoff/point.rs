//! A point of the study: what is measured on it, and what all points come to.

use super::settings::Variation;
use crate::table::Table;
use drape_report::{Chart, Color, Level, SERIES, Scale, Series};

/// A measured point. Errors are distances between the same material points; summed distances
/// count as many points as the default mesh has, whatever the mesh. What diverges, or whose
/// reference does, has no figures.
#[derive(Clone, Debug)]
pub struct MeasuredPoint {
    pub variation: Variation,
    /// Of the blank.
    pub vertices: usize,
    /// CPU time of an environment step in a group of lanes; in f64 of one alone [us].
    pub microseconds: Option<f64>,
    /// After the fall, mean and greatest.
    pub fall_mm: Option<[f64; 2]>,
    /// Summed distance to the tool then, and its error.
    pub fall_m: Option<[f64; 2]>,
    /// In the focus region after the first row of the sweep.
    pub row_mm: Option<f64>,
    /// There after the whole sweep, mean and greatest.
    pub sweep_mm: Option<[f64; 2]>,
    /// Of the distance that the sweep has removed from the region, over that distance.
    pub removed: Option<f64>,
    /// Tension of the yarns after it [-].
    pub tension_p95: Option<f64>,
    /// Mean over all sequences.
    pub eight_mm: Option<f64>,
    /// Summed distance of the region after them: mean and standard deviation.
    pub left_m: Option<[f64; 2]>,
    /// Its difference from the reference, sequence by sequence: mean and root mean square.
    pub bias_m: Option<f64>,
    pub rms_m: Option<f64>,
}

impl MeasuredPoint {
    /// One that nothing has been measured of.
    pub fn of(variation: &Variation) -> Self {
        Self {
            variation: variation.clone(),
            vertices: 0,
            microseconds: None,
            fall_mm: None,
            fall_m: None,
            row_mm: None,
            sweep_mm: None,
            removed: None,
            tension_p95: None,
            eight_mm: None,
            left_m: None,
            bias_m: None,
            rms_m: None,
        }
    }
}

/// What a push of the start by a micrometre does to what `accurate` ends with.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// Change of the region's summed distance, root mean square over the sequences [m].
    pub distance_rms_m: f64,
    /// Mean change of place in the region [mm].
    pub mean_mm: f64,
}

impl Noise {
    /// Where a pushed start diverges.
    pub const UNKNOWN: Self = Self {
        distance_rms_m: f64::NAN,
        mean_mm: f64::NAN,
    };
}

pub fn point_table(title: String, points: &[MeasuredPoint]) -> Table {
    let contact_interval = |p: &MeasuredPoint| p.variation.stepping().control(1.0).contact_interval;
    Table::of("points", title, points)
        .text("axis", |p| p.variation.axis)
        .text("value", |p| p.variation.value.clone())
        .hidden("solver", "", |p| p.variation.solver())
        .hidden("precision", "", |p| p.variation.precision())
        .hidden("substep rate", "1/s", |p| {
            p.variation.stepping().substep_rate
        })
        .hidden("contact interval", "", contact_interval)
        .hidden("vertices", "", |p| p.vertices)
        .number("step", "us", 1, |p| p.microseconds)
        .number("fall", "mm", 3, |p| p.fall_mm.map(|e| e[0]))
        .hidden("fall max", "mm", |p| p.fall_mm.map(|e| e[1]))
        .hidden("fall distance", "m", |p| p.fall_m.map(|e| e[0]))
        .hidden("fall distance error", "m", |p| p.fall_m.map(|e| e[1]))
        .number("row", "mm", 3, |p| p.row_mm)
        .number("sweep", "mm", 3, |p| p.sweep_mm.map(|e| e[0]))
        .hidden("sweep max", "mm", |p| p.sweep_mm.map(|e| e[1]))
        .hidden("removed error", "", |p| p.removed)
        .hidden("tension p95", "", |p| p.tension_p95)
        .number("eight", "mm", 3, |p| p.eight_mm)
        .number("left", "m", 4, |p| p.left_m.map(|left| left[0]))
        .hidden("left deviation", "m", |p| p.left_m.map(|left| left[1]))
        .number("bias", "m", 4, |p| p.bias_m)
        .number("rms", "m", 4, |p| p.rms_m)
        .end()
}

/// The cheapest point that differs from the converged solution by no more than twice the noise.
#[derive(Clone, Debug)]
pub struct Recommendation {
    /// Its number in the points; none if every setting diverges.
    pub point: Option<usize>,
    /// Whether there was one; else it is the one that differs least.
    pub is_within: bool,
    /// All of it in one line.
    pub text: String,
}

pub fn recommend(points: &[MeasuredPoint], noise: Noise) -> Recommendation {
    // Where a pushed start diverges there is no tolerance, and nothing is within it.
    let tolerance = Some(2.0 * noise.distance_rms_m).filter(|tolerance| tolerance.is_finite());
    let methods: Vec<(usize, &MeasuredPoint, f64, f64)> = (points.iter().enumerate())
        .filter(|(_, point)| point.variation.is_method)
        .filter_map(|(k, p)| Some((k, p, p.microseconds?, p.rms_m?)))
        .collect();
    let within = (methods.iter())
        .filter(|(.., rms_m)| tolerance.is_some_and(|tolerance| *rms_m <= tolerance))
        .min_by(|a, b| a.2.total_cmp(&b.2));
    let best = || methods.iter().min_by(|a, b| a.3.total_cmp(&b.3));
    let Some(&(index, point, microseconds, rms_m)) = within.or_else(best) else {
        return Recommendation {
            point: None,
            is_within: false,
            text: "every setting diverges: raise the substep rate".into(),
        };
    };
    let reason = match tolerance {
        None => "the least error; the noise is unknown, a pushed start diverged".to_owned(),
        Some(tolerance) if within.is_some() => {
            format!("the cheapest within twice the noise, {tolerance:.4} m")
        }
        Some(tolerance) => {
            format!("the least error, none is within twice the noise, {tolerance:.4} m")
        }
    };
    let (variation, stepping) = (&point.variation, point.variation.stepping());
    let text = format!(
        "{}, {} substeps/s, planes every {}, {}: {microseconds:.0} us a step, {rms_m:.4} m from the \
         converged distance; {reason}",
        variation.solver(),
        stepping.substep_rate,
        stepping.control(1.0).contact_interval,
        variation.precision(),
    );
    Recommendation {
        point: Some(index),
        is_within: within.is_some(),
        text,
    }
}

/// Cost against error, both as logarithms. What has no error has no place on it.
pub fn chart(points: &[MeasuredPoint], noise: Noise) -> Chart {
    // NaN where there is none: such points are not drawn.
    let logarithm = |value: f64| if value > 0.0 { value.log10() } else { f64::NAN };
    let place = |point: &MeasuredPoint| {
        [point.microseconds, point.eight_mm].map(|value| logarithm(value.unwrap_or(f64::NAN)))
    };
    let on = |axis: &'static str| points.iter().filter(move |p| p.variation.axis == axis);
    let curve = |label: String, points: Vec<[f64; 2]>, color: Color| Series {
        label,
        points,
        color,
    };
    let axes = [
        ("yarn", "yarn, 60 to 6000/s"),
        ("gauss_seidel", "Gauss-Seidel, 60 to 6000/s"),
        ("contact_interval", "contact interval 1 to 20"),
        ("precision", "f32, f64"),
    ];
    let mut series = Vec::new();
    for ((axis, label), color) in axes.into_iter().zip(SERIES) {
        // A dot for every point, under one name.
        series.extend(on(axis).map(|point| curve(String::new(), vec![place(point)], color)));
        series.push(curve(label.into(), on(axis).map(place).collect(), color));
    }
    let colors = [[20, 20, 24], [200, 20, 60], [20, 110, 230]];
    for (preset, color) in on("preset").zip(colors) {
        let label = format!("preset {}", preset.variation.value);
        series.push(curve(label, vec![place(preset)], color));
    }
    Chart {
        title: "Cost and error of the pressing sequences".into(),
        x_label: "CPU time of an environment step [us]".into(),
        y_label: "mean error of place in the region [mm]".into(),
        series,
        levels: vec![Level {
            label: "noise: start pushed by 1 um".into(),
            value: logarithm(noise.mean_mm),
            deviation: 0.0,
            color: [120, 120, 125],
        }],
        scale: Scale::Log10,
    }
}
