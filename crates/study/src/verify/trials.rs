//! The list of trials.

use super::bending::{Cantilever, ELASTICA, elastica, stiffness_shown};
use super::cloth::{Fast, Solve};
use super::contact::{LIFT_OFF, Rope, lift_off, slip_angle};
use super::dome::{at_polar, fishnet, wrap};
use super::length::{
    SAG, UNIAXIAL, catenary_sag, elastic_stretch, force_at, hanging, one_pass_stretch,
};
use super::motion::{flight, oscillation};
use super::shear::{bias_extension, draw_out, frame_angle, picture_frame, specimen};
use super::{Answer, Curve, Extent, Findings, Picture, Subject, Trial};
use drape_cloth::fabric::{Family, Material};
use drape_cloth::sim::Solver;

/// Names of the groups, in their order.
pub const GROUPS: [&str; 6] = ["bending", "length", "shear", "drape", "contact", "motion"];

/// Every trial, group by group.
pub fn trials(extent: Extent) -> Vec<Trial> {
    [
        bending_trials(),
        length_trials(),
        shear_trials(extent),
        drape_trials(extent),
        contact_trials(extent),
        motion_trials(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

impl Trial {
    /// One that every subject can be asked.
    fn new(
        group: &'static str,
        ask: impl Fn(&dyn Solve) -> Findings + Send + Sync + 'static,
    ) -> Self {
        Self {
            group,
            with_twin: true,
            ask: Box::new(move |subject| Some(ask(&*subject.solve()))),
        }
    }

    /// The same, of which the twin is asked in a full study only: it would take minutes.
    fn costly(self, extent: Extent) -> Self {
        Self {
            with_twin: extent == Extent::Full,
            ..self
        }
    }

    /// One about the method of the fast solver.
    fn of_fast(
        group: &'static str,
        ask: impl Fn(&Fast) -> Option<Findings> + Send + Sync + 'static,
    ) -> Self {
        Self {
            group,
            with_twin: false,
            ask: Box::new(move |subject: &Subject| ask(&subject.fast()?)),
        }
    }
}

fn answer(case: impl Into<String>, unit: &'static str, expected: f64, found: f64) -> Answer {
    Answer {
        case: case.into(),
        unit,
        expected,
        found,
    }
}

fn one(answer: Answer) -> Findings {
    Findings {
        answers: vec![answer],
        curves: Vec::new(),
    }
}

fn name(family: Family) -> &'static str {
    match family {
        Family::Warp => "warp",
        Family::Weft => "weft",
    }
}

fn bending_trials() -> Vec<Trial> {
    let cantilevers = ELASTICA.map(|[gamma, drop, reach]| {
        Trial::new("bending", move |solver| {
            // The stiffer the strip, the longer its bend.
            let edges = if gamma > 10.0 { 48 } else { 24 };
            let bent = Cantilever::of(gamma, edges).sink(solver);
            let [found_drop, found_reach] = bent.tip();
            let mut findings = Findings {
                answers: vec![
                    answer(format!("cantilever {gamma}: drop"), "-", drop, found_drop),
                    answer(
                        format!("cantilever {gamma}: reach"),
                        "-",
                        reach,
                        found_reach,
                    ),
                ],
                curves: Vec::new(),
            };
            if [1.0, 5.0, 20.0, 100.0].contains(&gamma) {
                let label = format!("{gamma}");
                let down = |points: Vec<[f64; 2]>| points.iter().map(|[x, z]| [*x, -z]).collect();
                findings.curves = vec![
                    Curve {
                        picture: Picture::Cantilever,
                        exact: true,
                        label: label.clone(),
                        points: down(elastica(gamma)),
                    },
                    Curve {
                        picture: Picture::Cantilever,
                        exact: false,
                        label,
                        points: down(bent.profile),
                    },
                ];
            }
            findings
        })
    });
    let bimoduli = [Family::Warp, Family::Weft].map(|family| {
        Trial::new("bending", move |solver| {
            // The angle at which bending length is half the length (Peirce).
            let strip = Cantilever::of_fabric(family, 8.0, 24);
            let [drop, _] = strip.sink(solver).tip();
            let expected = Material::interglas_92125().bending_stiffness(family);
            let found = stiffness_shown(drop, strip.length);
            let case = format!("bimodulus: stiffness of the {}", name(family));
            one(answer(case, "N m", expected, found))
        })
    });
    cantilevers.into_iter().chain(bimoduli).collect()
}

fn length_trials() -> Vec<Trial> {
    let mut trials: Vec<Trial> = UNIAXIAL
        .iter()
        .map(|&(family, strain, force)| {
            Trial::new("length", move |solver| {
                let case = format!("tension: {} at strain {strain}", name(family));
                let found = force_at(solver, family, strain, force);
                one(answer(case, "N/m", force, found))
            })
        })
        .collect();
    trials.push(Trial::new("length", |solver| {
        let expected = elastic_stretch(Family::Warp);
        let found = hanging(solver, Family::Warp);
        one(answer(
            "hanging chain: elastic stretch",
            "-",
            expected,
            found,
        ))
    }));
    trials.push(Trial::of_fast("length", |fast| {
        let expected = one_pass_stretch(fast.substep) + elastic_stretch(Family::Warp);
        let found = || hanging(fast, Family::Warp);
        let case = "hanging chain: stretch of one pass";
        (fast.solver == Solver::GaussSeidel).then(|| one(answer(case, "-", expected, found())))
    }));
    trials.push(Trial::new("length", |solver| {
        one(answer("catenary: sag", "m", SAG, catenary_sag(solver, 64)))
    }));
    trials
}

/// Extensions of the specimens [mm].
const EXTENSIONS: [f64; 3] = [10.0, 20.0, 30.0];

fn shear_trials(extent: Extent) -> Vec<Trial> {
    let frame = Trial::new("shear", |solver| {
        let answers = [0.02, 0.04, 0.06].map(|d| {
            let case = format!("picture frame: shear at {:.0} mm", 1e3 * d);
            let found = picture_frame(solver, d, 20).to_degrees();
            answer(case, "deg", frame_angle(d).to_degrees(), found)
        });
        Findings {
            answers: answers.into(),
            curves: Vec::new(),
        }
    });
    let cells = match extent {
        Extent::Quick => 5,
        Extent::Full => 10,
    };
    // The diagonals of the mesh along the pull and across it.
    let specimens = [(45.0, "across"), (-45.0, "along")].map(|(turn, diagonals)| {
        Trial::new("shear", move |solver| {
            let found = draw_out(
                solver,
                &specimen(cells, turn),
                &EXTENSIONS.map(|d| 1e-3 * d),
            );
            let mut findings = Findings::default();
            for state in &found {
                let [gamma, force] = bias_extension(state.d);
                let of = |what: &str| {
                    let d = 1e3 * state.d;
                    format!("bias extension, diagonals {diagonals}: {what} at {d:.0} mm")
                };
                let angles = [gamma, state.shear].map(f64::to_degrees);
                let shear = answer(of("shear"), "deg", angles[0], angles[1]);
                findings.answers.push(shear);
                let force = answer(of("force"), "N", force, state.force);
                findings.answers.push(force);
            }
            let exact = (0..=60).map(|k| 0.5 * f64::from(k));
            findings.curves = vec![
                Curve {
                    picture: Picture::BiasExtension,
                    exact: true,
                    label: String::new(),
                    points: exact.map(|d| [d, bias_extension(1e-3 * d)[1]]).collect(),
                },
                Curve {
                    picture: Picture::BiasExtension,
                    exact: false,
                    label: format!("diagonals {diagonals}"),
                    points: std::iter::once([0.0; 2])
                        .chain(found.iter().map(|s| [1e3 * s.d, s.force]))
                        .collect(),
                },
            ];
            findings
        })
    });
    std::iter::once(frame).chain(specimens).collect()
}

/// Polar angle and shear on the bias line of a fishnet on a sphere [degrees].
pub const FISHNET: [[f64; 2]; 5] = [
    [30.0, 7.521],
    [45.0, 16.113],
    [60.0, 26.946],
    [70.0, 35.039],
    [80.0, 43.592],
];

fn drape_trials(extent: Extent) -> Vec<Trial> {
    let edges = match extent {
        Extent::Quick => 20,
        Extent::Full => 40,
    };
    let degrees = |line: &[[f64; 2]]| -> Vec<[f64; 2]> {
        line.iter().map(|p| p.map(f64::to_degrees)).collect()
    };
    vec![
        Trial::new("drape", move |solver| {
            let wrapped = wrap(solver, edges);
            let answers = FISHNET.map(|[polar, shear]| {
                let found = at_polar(&wrapped.shear, polar.to_radians()).to_degrees();
                let case = format!("hemisphere: shear at {polar:.0} deg");
                answer(case, "deg", shear, found)
            });
            let line = |exact, line: &[[f64; 2]]| Curve {
                picture: Picture::Hemisphere,
                exact,
                label: String::new(),
                points: degrees(line),
            };
            Findings {
                answers: answers.into(),
                curves: vec![line(true, &fishnet(0.95, 200)), line(false, &wrapped.shear)],
            }
        })
        .costly(extent),
    ]
}

fn contact_trials(extent: Extent) -> Vec<Trial> {
    let inclines = [0.28, 0.25].map(|mu: f64| {
        Trial::new("contact", move |solver| {
            let case = format!("incline: slips with friction {mu} at");
            let found = slip_angle(solver, mu).to_degrees();
            one(answer(case, "deg", mu.atan().to_degrees(), found))
        })
    });
    let ropes = [0.28, 0.25].map(|mu| {
        Trial::new("contact", move |solver| {
            let case = format!("capstan: slips with friction {mu} at");
            let expected = (mu * std::f64::consts::PI).exp();
            let rope = Rope {
                mu,
                edges: 32,
                load: 5.0,
            };
            one(answer(case, "-", expected, rope.slips_at(solver)))
        })
        .costly(extent)
    });
    let lifts = LIFT_OFF.map(|(g_r, angle, tip)| {
        Trial::new("contact", move |solver| {
            let found = lift_off(solver, g_r, 48);
            let of = |what| format!("strip on a cylinder, {g_r}: {what}");
            Findings {
                answers: vec![
                    answer(of("lifts off at"), "deg", angle, found.angle),
                    answer(of("tip beside the axis"), "-", tip[0], found.tip[0]),
                    answer(of("tip above the axis"), "-", tip[1], found.tip[1]),
                ],
                curves: Vec::new(),
            }
        })
    });
    inclines.into_iter().chain(ropes).chain(lifts).collect()
}

fn motion_trials() -> Vec<Trial> {
    vec![
        Trial::of_fast("motion", |fast| {
            let flat = flight(fast, 10.0, 0.0, 0.0);
            let hard = flight(fast, 0.0, 0.064, 0.3);
            Some(Findings {
                answers: vec![
                    answer("flight: linear momentum kept", "-", 1.0, flat.linear),
                    answer("flight: angular momentum kept", "-", 1.0, flat.angular),
                    answer(
                        "flight: the same as implicit Euler keeps it",
                        "-",
                        flat.angular_expected,
                        flat.angular,
                    ),
                    answer(
                        "flight of stretched yarns: linear momentum kept",
                        "-",
                        1.0,
                        hard.linear,
                    ),
                ],
                curves: Vec::new(),
            })
        }),
        Trial::of_fast("motion", |fast| {
            let [found, expected] = oscillation(fast, 0.5);
            let case = "oscillation: amplitude kept in a substep";
            Some(one(answer(case, "-", expected, found)))
        }),
    ]
}
