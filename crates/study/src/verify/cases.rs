//! The list of cases.

use super::bending::{Cantilever, ELASTICA, stiffness_shown};
use super::contact::{LIFT_OFF, Rope, lift_off, slip_angle};
use super::dome::{at_polar, fishnet, wrap};
use super::length::{
    SAG, UNIAXIAL, catenary_sag, elastic_stretch, force_at, hanging, one_pass_stretch,
};
use super::motion::{flight, oscillation};
use super::shear::{bias_extension, draw_out, frame_angle, picture_frame, specimen};
use super::solve::{Fast, Reference, Solve, Subject};
use drape_cloth::fabric::Family;
use drape_cloth::sim::Solver;

/// A number that is known, and what was found instead.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    pub case: String,
    /// Of both numbers; "-" for none.
    pub unit: &'static str,
    pub expected: f64,
    /// NaN where the simulation did not come to it.
    pub found: f64,
}

fn answer(case: impl Into<String>, unit: &'static str, expected: f64, found: f64) -> Answer {
    Answer {
        case: case.into(),
        unit,
        expected,
        found,
    }
}

/// What a subject finds; nothing where it cannot be asked.
type Ask = Box<dyn Fn(&Subject) -> Vec<Answer> + Send + Sync>;

/// A question whose answer is known, one simulation or a few.
pub struct ClosedForm {
    pub group: &'static str,
    /// Whether the twin is asked too.
    pub with_twin: bool,
    pub ask: Ask,
}

impl ClosedForm {
    /// One that every subject can be asked.
    fn new(
        group: &'static str,
        ask: impl Fn(&dyn Solve) -> Vec<Answer> + Send + Sync + 'static,
    ) -> Self {
        Self {
            group,
            with_twin: true,
            ask: Box::new(move |subject| match subject.fast() {
                Some(fast) => ask(&fast),
                None => ask(&Reference),
            }),
        }
    }

    /// One about the method of the fast solver.
    fn of_fast(
        group: &'static str,
        ask: impl Fn(&Fast) -> Vec<Answer> + Send + Sync + 'static,
    ) -> Self {
        Self {
            group,
            with_twin: false,
            ask: Box::new(move |subject| subject.fast().as_ref().map(&ask).unwrap_or_default()),
        }
    }

    /// The same, without the twin where the study is `quick`: it would take minutes.
    fn costly(self, quick: bool) -> Self {
        Self {
            with_twin: !quick,
            ..self
        }
    }
}

/// Every case, group by group. Where the study is `quick` the costly ones have coarser meshes.
pub fn cases(quick: bool) -> Vec<ClosedForm> {
    let groups = [
        bending(),
        length(),
        shear(quick),
        drape(quick),
        contact(quick),
        motion(),
    ];
    groups.into_iter().flatten().collect()
}

fn name(family: Family) -> &'static str {
    match family {
        Family::Warp => "warp",
        Family::Weft => "weft",
    }
}

fn bending() -> Vec<ClosedForm> {
    let cantilevers = ELASTICA.map(|[gamma, drop, reach]| {
        ClosedForm::new("bending", move |solver| {
            // The stiffer the strip, the longer its bend.
            let edges = if gamma > 10.0 { 48 } else { 24 };
            let tip = Cantilever::of(gamma, edges).sink(solver).tip;
            vec![
                answer(format!("cantilever {gamma}: drop"), "-", drop, tip[0]),
                answer(format!("cantilever {gamma}: reach"), "-", reach, tip[1]),
            ]
        })
    });
    let bimoduli = [Family::Warp, Family::Weft].map(|family| {
        ClosedForm::new("bending", move |solver| {
            // The angle at which bending length is half the length (Peirce).
            let strip = Cantilever::of_fabric(family, 8.0, 24);
            let [drop, _] = strip.sink(solver).tip;
            let found = stiffness_shown(drop, strip.length);
            let case = format!("bimodulus: stiffness of the {}", name(family));
            vec![answer(case, "N m", strip.stiffness, found)]
        })
    });
    cantilevers.into_iter().chain(bimoduli).collect()
}

fn length() -> Vec<ClosedForm> {
    let tension = UNIAXIAL.map(|(family, strain, force)| {
        ClosedForm::new("length", move |solver| {
            let case = format!("tension: {} at strain {strain}", name(family));
            let found = force_at(solver, family, strain, force);
            vec![answer(case, "N/m", force, found)]
        })
    });
    let hung = ClosedForm::new("length", |solver| {
        let expected = elastic_stretch(Family::Warp);
        let found = hanging(solver, Family::Warp);
        vec![answer(
            "hanging chain: elastic stretch",
            "-",
            expected,
            found,
        )]
    });
    let one_pass = ClosedForm::of_fast("length", |fast| {
        if fast.solver != Solver::GaussSeidel {
            return Vec::new();
        }
        let expected = one_pass_stretch(fast.substep) + elastic_stretch(Family::Warp);
        let found = hanging(fast, Family::Warp);
        let case = "hanging chain: stretch of one pass";
        vec![answer(case, "-", expected, found)]
    });
    let catenary = ClosedForm::new("length", |solver| {
        vec![answer("catenary: sag", "m", SAG, catenary_sag(solver, 64))]
    });
    let others = [hung, one_pass, catenary];
    tension.into_iter().chain(others).collect()
}

fn shear(quick: bool) -> Vec<ClosedForm> {
    let frame = ClosedForm::new("shear", |solver| {
        let at = |d: f64| {
            let case = format!("picture frame: shear at {:.0} mm", 1e3 * d);
            let found = picture_frame(solver, d, 20).to_degrees();
            answer(case, "deg", frame_angle(d).to_degrees(), found)
        };
        [0.02, 0.04, 0.06].map(at).into()
    });
    let cells = if quick { 5 } else { 10 };
    // The diagonals of the mesh along the pull and across it.
    let specimens = [(45.0, "across"), (-45.0, "along")].map(|(turn, diagonals)| {
        ClosedForm::new("shear", move |solver| {
            let drawn = draw_out(solver, specimen(cells, turn), &[0.01, 0.02, 0.03]);
            let answers = drawn.iter().flat_map(|state| {
                let [gamma, force] = bias_extension(state.d);
                let of = |what: &str| {
                    let d = 1e3 * state.d;
                    format!("bias extension, diagonals {diagonals}: {what} at {d:.0} mm")
                };
                let angles = [gamma, state.shear].map(f64::to_degrees);
                [
                    answer(of("shear"), "deg", angles[0], angles[1]),
                    answer(of("force"), "N", force, state.force),
                ]
            });
            answers.collect()
        })
    });
    std::iter::once(frame).chain(specimens).collect()
}

fn drape(quick: bool) -> Vec<ClosedForm> {
    let edges = if quick { 20 } else { 40 };
    let hemisphere = ClosedForm::new("drape", move |solver| {
        let lines = [fishnet(0.95, 400), wrap(solver, edges)];
        let at = |polar: f64| {
            let [expected, found] =
                (lines.each_ref()).map(|line| at_polar(line, polar.to_radians()).to_degrees());
            let case = format!("hemisphere: shear at {polar:.0} deg");
            answer(case, "deg", expected, found)
        };
        [30.0, 45.0, 60.0, 70.0, 80.0].map(at).into()
    });
    vec![hemisphere.costly(quick)]
}

fn contact(quick: bool) -> Vec<ClosedForm> {
    let inclines = [0.28, 0.25].map(|mu: f64| {
        ClosedForm::new("contact", move |solver| {
            let case = format!("incline: slips with friction {mu} at");
            let found = slip_angle(solver, mu).to_degrees();
            vec![answer(case, "deg", mu.atan().to_degrees(), found)]
        })
    });
    let ropes = [0.28, 0.25].map(|mu| {
        let rope = Rope {
            mu,
            edges: 32,
            load: 5.0,
        };
        let case = ClosedForm::new("contact", move |solver| {
            let case = format!("capstan: slips with friction {mu} at");
            let expected = (mu * std::f64::consts::PI).exp();
            vec![answer(case, "-", expected, rope.slips_at(solver))]
        });
        case.costly(quick)
    });
    let lifts = LIFT_OFF.map(|(g_r, angle, tip)| {
        ClosedForm::new("contact", move |solver| {
            let lift = lift_off(solver, g_r, 48);
            let of = |what| format!("strip on a cylinder, {g_r}: {what}");
            vec![
                answer(of("lifts off at"), "deg", angle, lift.angle),
                answer(of("tip beside the axis"), "-", tip[0], lift.tip[0]),
                answer(of("tip above the axis"), "-", tip[1], lift.tip[1]),
            ]
        })
    });
    inclines.into_iter().chain(ropes).chain(lifts).collect()
}

fn motion() -> Vec<ClosedForm> {
    let flying = ClosedForm::of_fast("motion", |fast| {
        let flat = flight(fast, 10.0, 0.0, 0.0);
        let hard = flight(fast, 0.0, 0.064, 0.3);
        let euler = "flight: the same as implicit Euler keeps it";
        let stretched = "flight of stretched yarns: linear momentum kept";
        vec![
            answer("flight: linear momentum kept", "-", 1.0, flat.linear),
            answer("flight: angular momentum kept", "-", 1.0, flat.angular),
            answer(euler, "-", flat.angular_expected, flat.angular),
            answer(stretched, "-", 1.0, hard.linear),
        ]
    });
    let swinging = ClosedForm::of_fast("motion", |fast| {
        let [found, expected] = oscillation(fast, 0.5);
        let case = "oscillation: amplitude kept in a substep";
        vec![answer(case, "-", expected, found)]
    });
    vec![flying, swinging]
}
