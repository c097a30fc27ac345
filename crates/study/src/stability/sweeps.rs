//! The list of sweeps.

use super::hanging::{EDGES, heavy};
use super::trial::{FRAME, Knobs, Tried};
use super::{free, hanging, lying};
use crate::study::Effort;
use drape_cloth::sim::Solver;

/// What is varied along a side of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// With its unit.
    pub name: &'static str,
    /// Values, and how they are written.
    pub ticks: Vec<(f64, String)>,
}

/// Two quantities that are varied together.
#[derive(Clone, Debug)]
pub struct Sweep {
    pub name: &'static str,
    /// x, then y.
    pub axes: [Axis; 2],
    pub trial: fn(&Knobs) -> Tried,
}

/// Axes that set how a trial is stepped, whatever it is about: the former x, the latter y.
const SUBSTEPS_AXIS: &str = "substeps a frame";
const FRAME_AXIS: &str = "frame [s]";

impl Sweep {
    /// What the cell at these ticks sets.
    pub fn knobs(&self, at: [usize; 2], solver: Solver) -> Knobs {
        let [x, y] = [0, 1].map(|k| self.axes[k].ticks[at[k]].0);
        let by_substeps = self.axes[0].name == SUBSTEPS_AXIS;
        let by_frame = self.axes[1].name == FRAME_AXIS;
        Knobs {
            x,
            y,
            solver,
            frame: if by_frame { y } else { FRAME },
            substeps: if by_substeps { x as usize } else { 20 },
        }
    }
}

/// All sweeps; a quick one is the ends and what lies between them coarsely.
pub fn sweeps(effort: Effort) -> Vec<Sweep> {
    // Coarse values and fine ones.
    let list = |name, coarse: &[f64], fine: &[f64]| axis(name, effort.pick(coarse, fine), label);
    // From 10^low to 10^high, coarsely by as many decades at a time.
    let decades = |name, low: i32, high: i32, coarse: usize| {
        let step = effort.pick(coarse, 1);
        let values: Vec<f64> = (low..=high).step_by(step).map(|e| 10f64.powi(e)).collect();
        axis(name, &values, label)
    };
    let zero_and = |mut decades: Axis| {
        decades.ticks.splice(0..0, axis("", &[0.0], label).ticks);
        decades
    };
    let labels = |name, labels: &[&str]| {
        let values: Vec<f64> = (0..labels.len()).map(|index| index as f64).collect();
        axis(name, &values, |index| labels[index as usize].into())
    };
    let substeps = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];
    let substeps = list(SUBSTEPS_AXIS, &[1.0, 5.0, 20.0, 80.0], &substeps);
    // 1/60 s is what training and scenes use.
    let rates = [600.0, 300.0, 120.0, 60.0, 30.0, 15.0];
    let mut frames = list(FRAME_AXIS, &[600.0, 120.0, 60.0, 15.0], &rates);
    for (value, label) in &mut frames.ticks {
        (*label, *value) = (format!("1/{value}"), 1.0 / *value);
    }
    let factors = [
        1.0, 1e1, 1e2, 1e3, 1e4, 1e6, 1e10, 1e20, 1e38, 1e40, 1e150, 1e300,
    ];
    let factor = "factor on speeds of 0.5 m/s";
    let factors = list(factor, &[1.0, 1e2, 1e4, 1e38], &factors);
    let compliances = zero_and(decades("compliance of an edge [m/N]", -9, 0, 3));
    let stiffnesses = decades("bending stiffness [N m]", -5, 2, 2);
    let ratios = decades("warp over built-in stiffness", -6, 6, 3);
    let neighbours = decades("mass over its neighbour's", -6, 6, 3);
    let borders = decades("mass of border over inside", -6, 6, 3);
    let gravities = [0.0, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0];
    let gravities = list("gravity [g]", &[0.0, 1.0, 10.0, 100.0], &gravities);
    let along = "vertices along it";
    let long = [3.0, 9.0, 17.0, 33.0, 65.0, 129.0, 257.0];
    let rows = list(along, &[9.0, 33.0, 129.0], &long[1..]);
    let needles = list(along, &[3.0, 17.0, 65.0, 257.0], &long);
    let widths = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];
    let widths = list("width [mm]", &[1.0, 30.0, 1000.0], &widths);
    let dampings = zero_and(decades("damping [1/s]", 0, 12, 4));
    let depths = [0.01, 0.1, 1.0, 5.0, 20.0, 50.0, 90.0];
    let depths = list("depth at the start [mm]", &[0.1, 5.0, 90.0], &depths);
    let pressures = decades("pressure [N/mm²]", -6, 0, 2);
    let speeds = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
    let speeds = list("speed [m/s]", &[1.0, 10.0, 100.0], &speeds);
    let sides = list("vertices a side", &[9.0, 33.0], &long[1..]);
    let facets = zero_and(decades("thickness of the facet [m]", -10, -2, 2));
    let slopes = [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0];
    let slopes = list("slope [degrees]", &[0.0, 10.0, 25.0, 40.0, 60.0], &slopes);
    let frictions = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0];
    let frictions = list("friction", &[0.0, 0.2, 0.7, 2.0], &frictions);
    let slivers = labels("facet", &lying::SLIVERS);

    let by_substeps = |name, y, trial| sweep(name, substeps.clone(), y, trial);
    vec![
        by_substeps("time_step", frames.clone(), hanging::time_step),
        by_substeps("catenary", frames.clone(), hanging::catenary),
        by_substeps("free_flight", frames, |_| free::fly(1.0)),
        by_substeps("speed", factors, |k| free::fly(k.y)),
        by_substeps("compliance", compliances, hanging::compliance),
        by_substeps("warp_ratio", ratios, hanging::warp_ratio),
        by_substeps("bending", stiffnesses, hanging::bending),
        by_substeps("neighbour_mass", neighbours, |k| {
            heavy(k, |row| row % 2 == 1)
        }),
        by_substeps("border_mass", borders, |k| heavy(k, |row| row == EDGES)),
        by_substeps("gravity", gravities, hanging::gravity),
        by_substeps("strip_grid", rows, hanging::strip_grid),
        sweep("needle", needles, widths, hanging::needle),
        by_substeps("damping", dampings, free::damping),
        by_substeps("start", labels("start", &free::STARTS), free::start),
        by_substeps("overlap", depths, lying::overlap),
        by_substeps("pressure", pressures, lying::pressure),
        by_substeps("impact", speeds.clone(), |k| lying::hit(k, true)),
        by_substeps("uncapped_impact", speeds, |k| lying::hit(k, false)),
        by_substeps("sheet_grid", sides, lying::sheet_grid),
        sweep("sliver", slivers, facets, lying::sliver),
        sweep("friction", slopes, frictions.clone(), |k| {
            lying::slide(k, k.x)
        }),
        by_substeps("friction_step", frictions, |k| lying::slide(k, 25.0)),
    ]
}

fn sweep(name: &'static str, x: Axis, y: Axis, trial: fn(&Knobs) -> Tried) -> Sweep {
    let axes = [x, y];
    Sweep { name, axes, trial }
}

fn axis(name: &'static str, values: &[f64], label: impl Fn(f64) -> String) -> Axis {
    let ticks = values.iter().map(|&value| (value, label(value))).collect();
    Axis { name, ticks }
}

/// A number as short as it can be read back.
fn label(value: f64) -> String {
    if value == 0.0 || (1e-2..1e4).contains(&value) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}
