use super::trial::{Refusal, Setting, Trial};
use super::{Axis, Sweep, Tick, free, hanging, lying};

/// How finely the sweeps are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// The ends and what lies between them coarsely: about a minute on two cores.
    Quick,
    /// Every decade or step: some ten minutes.
    Full,
}

/// All sweeps.
pub fn sweeps(extent: Extent) -> Vec<Sweep> {
    let pick = |quick: &[f64], full: &[f64]| match extent {
        Extent::Quick => quick.to_vec(),
        Extent::Full => full.to_vec(),
    };
    let substeps = || {
        let counts = pick(
            &[1.0, 5.0, 20.0, 80.0],
            &[1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0],
        );
        numbers("substeps a frame", &counts)
    };
    // 1/60 s is what training and scenes use.
    let frames = || Axis {
        name: "frame [s]",
        ticks: pick(
            &[600.0, 120.0, 60.0, 15.0],
            &[600.0, 300.0, 120.0, 60.0, 30.0, 15.0],
        )
        .iter()
        .map(|rate| Tick {
            value: 1.0 / rate,
            label: format!("1/{rate}"),
        })
        .collect(),
    };
    // From 10^low to 10^high, by as many decades at a time.
    let decades = |low: i32, high: i32, quick: usize| -> Vec<f64> {
        let step = match extent {
            Extent::Quick => quick,
            Extent::Full => 1,
        };
        (low..=high).step_by(step).map(|e| 10f64.powi(e)).collect()
    };
    let with_zero = |values: Vec<f64>| [vec![0.0], values].concat();
    let by_substeps = |name, answer, axis, trial: fn(&Setting) -> Result<Trial, Refusal>| Sweep {
        name,
        answer,
        axes: [substeps(), axis],
        trial,
    };

    vec![
        by_substeps(
            "time_step",
            "hanging strip, against the weight each edge carries",
            frames(),
            hanging::time_step,
        ),
        by_substeps(
            "catenary",
            "strip held by both ends, against the catenary",
            frames(),
            hanging::catenary,
        ),
        by_substeps(
            "free_flight",
            "free sheet with random velocities: momentum stays, kinetic energy does not grow",
            frames(),
            free::flight,
        ),
        by_substeps(
            "speed",
            "the same, at speeds that leave the space of 100 m: diverged, not garbage",
            numbers(
                "factor on speeds of 0.5 m/s",
                &pick(
                    &[1.0, 1e2, 1e4, 1e38],
                    &[
                        1.0, 1e1, 1e2, 1e3, 1e4, 1e6, 1e10, 1e20, 1e38, 1e40, 1e150, 1e300,
                    ],
                ),
            ),
            free::speed,
        ),
        by_substeps(
            "compliance",
            "hanging strip, against the stretch of springs under their load",
            numbers("compliance of an edge [m/N]", &with_zero(decades(-9, 0, 3))),
            hanging::compliance,
        ),
        by_substeps(
            "warp_ratio",
            "crumpled sheet hung by a border, against its flat shape",
            numbers("warp over built-in stiffness", &decades(-6, 6, 3)),
            hanging::warp_ratio,
        ),
        by_substeps(
            "bending",
            "strip clamped level, against the heavy elastica",
            numbers("bending stiffness [N m]", &decades(-5, 2, 2)),
            hanging::bending,
        ),
        by_substeps(
            "neighbour_mass",
            "hanging strip, every other row of another mass, against its springs",
            numbers("mass over its neighbour's", &decades(-6, 6, 3)),
            hanging::neighbour_mass,
        ),
        by_substeps(
            "border_mass",
            "hanging strip, its lower border of another mass, against its springs",
            numbers("mass of border over inside", &decades(-6, 6, 3)),
            hanging::border_mass,
        ),
        by_substeps(
            "gravity",
            "hanging strip, against its springs; without gravity it stays",
            numbers(
                "gravity [g]",
                &pick(
                    &[0.0, 1.0, 10.0, 100.0],
                    &[0.0, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0],
                ),
            ),
            hanging::gravity,
        ),
        by_substeps(
            "strip_grid",
            "hanging strip of 370 mm, against its springs",
            numbers(
                "vertices along it",
                &pick(&[9.0, 33.0, 129.0], &[9.0, 17.0, 33.0, 65.0, 129.0, 257.0]),
            ),
            hanging::strip_grid,
        ),
        Sweep {
            name: "needle",
            answer: "hanging strip of 1 m, two vertices wide, 20 substeps a frame, against its springs",
            axes: [
                numbers(
                    "vertices along it",
                    &pick(
                        &[3.0, 17.0, 65.0, 257.0],
                        &[3.0, 9.0, 17.0, 33.0, 65.0, 129.0, 257.0],
                    ),
                ),
                numbers(
                    "width [mm]",
                    &pick(
                        &[1.0, 30.0, 1000.0],
                        &[1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0],
                    ),
                ),
            ],
            trial: hanging::needle,
        },
        by_substeps(
            "damping",
            "sheet thrown level, against the closed form of fall with drag",
            numbers("damping [1/s]", &with_zero(decades(0, 12, 4))),
            free::damping,
        ),
        by_substeps(
            "start",
            "sheet in free space: yarns find back their length",
            Axis {
                name: "start",
                ticks: labels(&free::STARTS),
            },
            free::start,
        ),
        by_substeps(
            "overlap",
            "sheet that starts inside a plate 200 mm thick: comes to lie on it flat",
            numbers(
                "depth at the start [mm]",
                &pick(&[0.1, 5.0, 90.0], &[0.01, 0.1, 1.0, 5.0, 20.0, 50.0, 90.0]),
            ),
            lying::overlap,
        ),
        by_substeps(
            "pressure",
            "sheet pushed on to a plate: lies on it flat",
            numbers("pressure [N/mm²]", &decades(-6, 0, 2)),
            lying::pressure,
        ),
        by_substeps(
            "impact",
            "sheet shot at a plate, speeds capped at 4 m/s: comes to lie on it flat",
            numbers(
                "speed [m/s]",
                &pick(&[1.0, 10.0, 100.0], &[1.0, 3.0, 10.0, 30.0, 100.0, 300.0]),
            ),
            lying::impact,
        ),
        by_substeps(
            "uncapped_impact",
            "sheet shot at a plate, without speed cap: comes to lie on it flat",
            numbers(
                "speed [m/s]",
                &pick(&[1.0, 10.0, 100.0], &[1.0, 3.0, 10.0, 30.0, 100.0, 300.0]),
            ),
            lying::uncapped_impact,
        ),
        by_substeps(
            "sheet_grid",
            "sheet of 370 mm dropped on a plate: lies on it flat",
            numbers(
                "vertices a side",
                &pick(&[9.0, 33.0], &[9.0, 17.0, 33.0, 65.0, 129.0, 257.0]),
            ),
            lying::sheet_grid,
        ),
        Sweep {
            name: "sliver",
            answer: "sheet dropped on a plate with bad facets, from STL: lies on it flat",
            axes: [
                Axis {
                    name: "facet",
                    ticks: labels(&lying::SLIVERS),
                },
                numbers(
                    "thickness of the facet [m]",
                    &with_zero(decades(-10, -2, 2)),
                ),
            ],
            trial: lying::sliver,
        },
        Sweep {
            name: "friction",
            answer: "sheet on a slope, 20 substeps a frame, against Coulomb's law",
            axes: [
                numbers(
                    "slope [degrees]",
                    &pick(
                        &[0.0, 10.0, 25.0, 40.0, 60.0],
                        &[0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0],
                    ),
                ),
                numbers(
                    "friction",
                    &pick(
                        &[0.0, 0.2, 0.7, 2.0],
                        &[0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0],
                    ),
                ),
            ],
            trial: lying::friction,
        },
        by_substeps(
            "friction_step",
            "sheet on a slope of 25 degrees, against Coulomb's law",
            numbers(
                "friction",
                &pick(
                    &[0.0, 0.2, 0.7, 2.0],
                    &[0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0],
                ),
            ),
            lying::friction_step,
        ),
    ]
}

fn numbers(name: &'static str, values: &[f64]) -> Axis {
    let ticks = values.iter().map(|&value| Tick {
        value,
        label: label(value),
    });
    Axis {
        name,
        ticks: ticks.collect(),
    }
}

/// Ticks that count their `labels`.
fn labels(labels: &[&str]) -> Vec<Tick> {
    let ticks = labels.iter().enumerate().map(|(index, label)| Tick {
        value: index as f64,
        label: (*label).into(),
    });
    ticks.collect()
}

/// A number as short as it can be read back.
fn label(value: f64) -> String {
    if value == 0.0 || (1e-2..1e4).contains(&value) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}
