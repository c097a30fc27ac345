//! The list of cases.

use std::f64::consts::PI;

use super::bending::{Cantilever, ELASTICA, stiffness_shown};
use super::contact::{LIFT_OFF, lift_off, slip_angle, slip_ratio};
use super::dome::{FISHNET, at_polar, wrap};
use super::length::{
    SAG, UNIAXIAL, catenary_sag, elastic_stretch, force_at, hanging, one_pass_stretch,
};
use super::motion::{flight, oscillation};
use super::shear::{bias_extension, draw_out, frame_angle, picture_frame, specimen};
use super::solve::Solve;
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

fn answer(case: impl Into<String>, unit: &'static str, [expected, found]: [f64; 2]) -> Answer {
    Answer {
        case: case.into(),
        unit,
        expected,
        found,
    }
}

/// What a solver finds; nothing where it cannot be asked.
type Ask = dyn Fn(&dyn Solve) -> Option<Vec<Answer>> + Send + Sync;

/// A question whose answer is known, one simulation or a few.
pub struct ClosedForm {
    pub group: &'static str,
    pub(super) ask: Box<Ask>,
}

/// Every case, group by group. Where the study is `quick` the costly ones have coarser meshes, or
/// are without the twin, which would take minutes.
pub fn cases(quick: bool) -> Vec<ClosedForm> {
    let mut cases = Cases(Vec::new());
    cases.bending();
    cases.length();
    cases.shear(quick);
    cases.drape(quick);
    cases.contact(quick);
    cases.motion();
    cases.0
}

fn name(family: Family) -> String {
    format!("{family:?}").to_lowercase()
}

struct Cases(Vec<ClosedForm>);

impl Cases {
    fn add(
        &mut self,
        group: &'static str,
        ask: impl Fn(&dyn Solve) -> Option<Vec<Answer>> + Send + Sync + 'static,
    ) {
        let ask = Box::new(ask);
        self.0.push(ClosedForm { group, ask });
    }

    fn bending(&mut self) {
        for [gamma, drop, reach] in ELASTICA {
            self.add("bending", move |solver| {
                // The stiffer the strip, the longer its bend.
                let edges = if gamma > 10.0 { 48 } else { 24 };
                let tip = Cantilever::of(gamma, edges).sink(solver).tip;
                let of = |what| format!("cantilever {gamma}: {what}");
                Some(vec![
                    answer(of("drop"), "-", [drop, tip[0]]),
                    answer(of("reach"), "-", [reach, tip[1]]),
                ])
            });
        }
        for family in [Family::Warp, Family::Weft] {
            self.add("bending", move |solver| {
                // The angle at which bending length is half the length (Peirce).
                let strip = Cantilever::of_fabric(family, 8.0, 24);
                let [drop, _] = strip.sink(solver).tip;
                let found = stiffness_shown(drop, strip.length);
                let case = format!("bimodulus: stiffness of the {}", name(family));
                Some(vec![answer(case, "N m", [strip.stiffness, found])])
            });
        }
    }

    fn length(&mut self) {
        for (family, strain, force) in UNIAXIAL {
            self.add("length", move |solver| {
                let case = format!("tension: {} at strain {strain}", name(family));
                let found = force_at(solver, family, strain, force);
                Some(vec![answer(case, "N/m", [force, found])])
            });
        }
        let elastic = elastic_stretch(Family::Warp);
        self.add("length", move |solver| {
            let found = hanging(solver, Family::Warp);
            let case = "hanging chain: elastic stretch";
            Some(vec![answer(case, "-", [elastic, found])])
        });
        self.add("length", move |solver| {
            let fast = solver.fast()?;
            if fast.solver != Solver::GaussSeidel {
                return None;
            }
            let expected = one_pass_stretch(fast.substep) + elastic;
            let found = hanging(fast, Family::Warp);
            let case = "hanging chain: stretch of one pass";
            Some(vec![answer(case, "-", [expected, found])])
        });
        self.add("length", |solver| {
            let found = catenary_sag(solver, 64);
            Some(vec![answer("catenary: sag", "m", [SAG, found])])
        });
    }

    fn shear(&mut self, quick: bool) {
        self.add("shear", |solver| {
            let at = |d: f64| {
                let case = format!("picture frame: shear at {:.0} mm", 1e3 * d);
                let angles = [frame_angle(d), picture_frame(solver, d, 20)];
                answer(case, "deg", angles.map(f64::to_degrees))
            };
            Some([0.02, 0.04, 0.06].map(at).into())
        });
        let cells = if quick { 5 } else { 10 };
        // The diagonals of the mesh along the pull and across it.
        for (turn, diagonals) in [(45.0, "across"), (-45.0, "along")] {
            self.add("shear", move |solver| {
                let drawn = draw_out(solver, specimen(cells, turn), &[0.01, 0.02, 0.03]);
                let answers = drawn.iter().flat_map(|&[d, shear, pull]| {
                    let [gamma, force] = bias_extension(d);
                    let d = 1e3 * d;
                    let of = |what: &str| {
                        format!("bias extension, diagonals {diagonals}: {what} at {d:.0} mm")
                    };
                    let angles = [gamma, shear].map(f64::to_degrees);
                    [
                        answer(of("shear"), "deg", angles),
                        answer(of("force"), "N", [force, pull]),
                    ]
                });
                Some(answers.collect())
            });
        }
    }

    fn drape(&mut self, quick: bool) {
        let edges = if quick { 20 } else { 40 };
        self.add("drape", move |solver| {
            if quick && solver.fast().is_none() {
                return None;
            }
            let line = wrap(solver, edges);
            let at = |[polar, shear]: [f64; 2]| {
                let found = at_polar(&line, polar.to_radians()).to_degrees();
                let case = format!("hemisphere: shear at {polar:.0} deg");
                answer(case, "deg", [shear, found])
            };
            Some(FISHNET.map(at).into())
        });
    }

    fn contact(&mut self, quick: bool) {
        for mu in [0.28f64, 0.25] {
            self.add("contact", move |solver| {
                let case = format!("incline: slips with friction {mu} at");
                let angles = [mu.atan(), slip_angle(solver, mu)];
                Some(vec![answer(case, "deg", angles.map(f64::to_degrees))])
            });
        }
        for mu in [0.28f64, 0.25] {
            self.add("contact", move |solver| {
                if quick && solver.fast().is_none() {
                    return None;
                }
                let found = slip_ratio(solver, mu);
                let case = format!("capstan: slips with friction {mu} at");
                Some(vec![answer(case, "-", [(mu * PI).exp(), found])])
            });
        }
        for (g_r, angle, tip) in LIFT_OFF {
            self.add("contact", move |solver| {
                let lift = lift_off(solver, g_r, 48);
                let of = |what| format!("strip on a cylinder, {g_r}: {what}");
                Some(vec![
                    answer(of("lifts off at"), "deg", [angle, lift.angle]),
                    answer(of("tip beside the axis"), "-", [tip[0], lift.tip[0]]),
                    answer(of("tip above the axis"), "-", [tip[1], lift.tip[1]]),
                ])
            });
        }
    }

    fn motion(&mut self) {
        self.add("motion", |solver| {
            let fast = solver.fast()?;
            let flat = flight(fast, 10.0, 0.0, 0.0);
            let hard = flight(fast, 0.0, 0.064, 0.3);
            let euler = "flight: the same as implicit Euler keeps it";
            let stretched = "flight of stretched yarns: linear momentum kept";
            Some(vec![
                answer("flight: linear momentum kept", "-", [1.0, flat.linear]),
                answer("flight: angular momentum kept", "-", [1.0, flat.angular]),
                answer(euler, "-", [flat.angular_expected, flat.angular]),
                answer(stretched, "-", [1.0, hard.linear]),
            ])
        });
        self.add("motion", |solver| {
            let fast = solver.fast()?;
            let case = "oscillation: amplitude kept in a substep";
            Some(vec![answer(case, "-", oscillation(fast, 0.5))])
        });
    }
}
