//! The list of cases.

use super::bending::{Cantilever, ELASTICA, elastica, stiffness_shown};
use super::contact::{LIFT_OFF, Rope, lift_off, slip_angle};
use super::dome::{at_polar, fishnet, wrap};
use super::length::{
    SAG, UNIAXIAL, catenary_sag, elastic_stretch, force_at, hanging, one_pass_stretch,
};
use super::motion::{flight, oscillation};
use super::shear::{bias_extension, draw_out, frame_angle, picture_frame, specimen};
use super::solve::{Fast, Solve};
use super::subject::{Findings, Picture, ProfileCurve, Subject};
use drape_cloth::fabric::{Family, Material};
use drape_cloth::sim::Solver;

/// What a subject finds; none where it cannot be asked.
type Ask = Box<dyn Fn(&Subject) -> Option<Findings> + Send + Sync>;

/// A question, one simulation or a few.
pub struct Case {
    pub group: &'static str,
    /// Whether the twin is asked too.
    pub with_twin: bool,
    pub ask: Ask,
}

impl Case {
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

    /// The same, without the twin where the study is `quick`: it would take minutes.
    fn costly(self, quick: bool) -> Self {
        Self {
            with_twin: !quick,
            ..self
        }
    }
}

/// Every case, group by group. Where the study is `quick` the costly ones have coarser meshes.
pub fn cases(quick: bool) -> Vec<Case> {
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

fn bending() -> Vec<Case> {
    let cantilevers = ELASTICA.map(|[gamma, drop, reach]| {
        Case::new("bending", move |solver| {
            // The stiffer the strip, the longer its bend.
            let edges = if gamma > 10.0 { 48 } else { 24 };
            let bent = Cantilever::of(gamma, edges).sink(solver);
            let tip = bent.tip();
            let mut found = Findings::one(format!("cantilever {gamma}: drop"), "-", drop, tip[0]);
            found.add(format!("cantilever {gamma}: reach"), "-", reach, tip[1]);
            if [1.0, 5.0, 20.0, 100.0].contains(&gamma) {
                let down = |points: Vec<[f64; 2]>| points.iter().map(|[x, z]| [*x, -z]).collect();
                let exact = down(elastica(gamma));
                let picture = Picture::Cantilever;
                found.curves = ProfileCurve::pair(picture, "", exact, down(bent.profile));
            }
            found
        })
    });
    let bimoduli = [Family::Warp, Family::Weft].map(|family| {
        Case::new("bending", move |solver| {
            // The angle at which bending length is half the length (Peirce).
            let strip = Cantilever::of_fabric(family, 8.0, 24);
            let [drop, _] = strip.sink(solver).tip();
            let expected = Material::interglas_92125().bending_stiffness(family);
            let found = stiffness_shown(drop, strip.length);
            let case = format!("bimodulus: stiffness of the {}", name(family));
            Findings::one(case, "N m", expected, found)
        })
    });
    cantilevers.into_iter().chain(bimoduli).collect()
}

fn length() -> Vec<Case> {
    let tension = UNIAXIAL.map(|(family, strain, force)| {
        Case::new("length", move |solver| {
            let case = format!("tension: {} at strain {strain}", name(family));
            let found = force_at(solver, family, strain, force);
            Findings::one(case, "N/m", force, found)
        })
    });
    let hung = Case::new("length", |solver| {
        let expected = elastic_stretch(Family::Warp);
        let found = hanging(solver, Family::Warp);
        Findings::one("hanging chain: elastic stretch", "-", expected, found)
    });
    let one_pass = Case::of_fast("length", |fast| {
        let expected = one_pass_stretch(fast.substep) + elastic_stretch(Family::Warp);
        let found = || hanging(fast, Family::Warp);
        let case = "hanging chain: stretch of one pass";
        let has_floor = fast.solver == Solver::GaussSeidel;
        has_floor.then(|| Findings::one(case, "-", expected, found()))
    });
    let catenary = Case::new("length", |solver| {
        Findings::one("catenary: sag", "m", SAG, catenary_sag(solver, 64))
    });
    let others = [hung, one_pass, catenary];
    tension.into_iter().chain(others).collect()
}

/// Extensions of the specimens [mm].
const EXTENSIONS: [f64; 3] = [10.0, 20.0, 30.0];

fn shear(quick: bool) -> Vec<Case> {
    let frame = Case::new("shear", |solver| {
        let mut found = Findings::default();
        for d in [0.02, 0.04, 0.06] {
            let case = format!("picture frame: shear at {:.0} mm", 1e3 * d);
            let expected = frame_angle(d).to_degrees();
            found.add(
                case,
                "deg",
                expected,
                picture_frame(solver, d, 20).to_degrees(),
            );
        }
        found
    });
    let cells = if quick { 5 } else { 10 };
    // The diagonals of the mesh along the pull and across it.
    let specimens = [(45.0, "across"), (-45.0, "along")].map(|(turn, diagonals)| {
        Case::new("shear", move |solver| {
            let specimen = specimen(cells, turn);
            let drawn = draw_out(solver, &specimen, &EXTENSIONS.map(|d| 1e-3 * d));
            let mut found = Findings::default();
            for state in &drawn {
                let [gamma, force] = bias_extension(state.d);
                let of = |what: &str| {
                    let d = 1e3 * state.d;
                    format!("bias extension, diagonals {diagonals}: {what} at {d:.0} mm")
                };
                let angles = [gamma, state.shear].map(f64::to_degrees);
                found.add(of("shear"), "deg", angles[0], angles[1]);
                found.add(of("force"), "N", force, state.force);
            }
            let exact = (0..=60).map(|k| 0.5 * f64::from(k));
            let exact = exact.map(|d| [d, bias_extension(1e-3 * d)[1]]).collect();
            let drawn = drawn.iter().map(|s| [1e3 * s.d, s.force]);
            let drawn = std::iter::once([0.0; 2]).chain(drawn).collect();
            let label = format!(", diagonals {diagonals}");
            found.curves = ProfileCurve::pair(Picture::BiasExtension, &label, exact, drawn);
            found
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

fn drape(quick: bool) -> Vec<Case> {
    let edges = if quick { 20 } else { 40 };
    let hemisphere = Case::new("drape", move |solver| {
        let wrapped = wrap(solver, edges);
        let mut found = Findings::default();
        for [polar, shear] in FISHNET {
            let case = format!("hemisphere: shear at {polar:.0} deg");
            let at = at_polar(&wrapped, polar.to_radians()).to_degrees();
            found.add(case, "deg", shear, at);
        }
        let degrees = |line: Vec<[f64; 2]>| line.iter().map(|p| p.map(f64::to_degrees)).collect();
        let exact = degrees(fishnet(0.95, 200));
        found.curves = ProfileCurve::pair(Picture::Hemisphere, "", exact, degrees(wrapped));
        found
    });
    vec![hemisphere.costly(quick)]
}

fn contact(quick: bool) -> Vec<Case> {
    let inclines = [0.28, 0.25].map(|mu: f64| {
        Case::new("contact", move |solver| {
            let case = format!("incline: slips with friction {mu} at");
            let found = slip_angle(solver, mu).to_degrees();
            Findings::one(case, "deg", mu.atan().to_degrees(), found)
        })
    });
    let ropes = [0.28, 0.25].map(|mu| {
        let rope = Rope {
            mu,
            edges: 32,
            load: 5.0,
        };
        let case = Case::new("contact", move |solver| {
            let case = format!("capstan: slips with friction {mu} at");
            let expected = (mu * std::f64::consts::PI).exp();
            Findings::one(case, "-", expected, rope.slips_at(solver))
        });
        case.costly(quick)
    });
    let lifts = LIFT_OFF.map(|(g_r, angle, tip)| {
        Case::new("contact", move |solver| {
            let lift = lift_off(solver, g_r, 48);
            let of = |what| format!("strip on a cylinder, {g_r}: {what}");
            let mut found = Findings::one(of("lifts off at"), "deg", angle, lift.angle);
            found.add(of("tip beside the axis"), "-", tip[0], lift.tip[0]);
            found.add(of("tip above the axis"), "-", tip[1], lift.tip[1]);
            found
        })
    });
    inclines.into_iter().chain(ropes).chain(lifts).collect()
}

fn motion() -> Vec<Case> {
    let flying = Case::of_fast("motion", |fast| {
        let flat = flight(fast, 10.0, 0.0, 0.0);
        let hard = flight(fast, 0.0, 0.064, 0.3);
        let mut found = Findings::one("flight: linear momentum kept", "-", 1.0, flat.linear);
        found.add("flight: angular momentum kept", "-", 1.0, flat.angular);
        let case = "flight: the same as implicit Euler keeps it";
        found.add(case, "-", flat.angular_expected, flat.angular);
        let case = "flight of stretched yarns: linear momentum kept";
        found.add(case, "-", 1.0, hard.linear);
        Some(found)
    });
    let swinging = Case::of_fast("motion", |fast| {
        let [found, expected] = oscillation(fast, 0.5);
        let case = "oscillation: amplitude kept in a substep";
        Some(Findings::one(case, "-", expected, found))
    });
    vec![flying, swinging]
}
