use super::*;
use crate::fabric::{BlankConfig, Material};
use crate::math::{Purpose, Stream, Vec3};

const LAW: EdgeLaw = EdgeLaw {
    tension: 1e-3,
    compression: 4e-3,
};

/// A compliance next to which mobilities vanish.
const SOFT: f64 = 1e11;

/// A lamina of membranes with the warp at `angle` [degrees].
fn lamina(angle: f64) -> Lamina {
    let config = BlankConfig {
        size_mm: [30.0, 20.0],
        vertices: [4, 3],
        yarn_angle_deg: angle,
        ..BlankConfig::default()
    };
    Lamina::of_membranes(&config, Material::interglas_92125()).unwrap()
}

/// An element alone, of the three constraints those with compliance `alpha`, the rest so soft
/// that they do nothing.
fn element(angle: f64, alpha: [Option<f64>; 3]) -> Element {
    let physics = PhysicsConfig::default();
    let mut element = elements(&lamina(angle), &physics, None)[0][0];
    let law = |alpha: Option<f64>| {
        let alpha = alpha.unwrap_or(1e30);
        EdgeLaw {
            tension: alpha,
            compression: alpha,
        }
    };
    element.vertices = [0, 1, 2];
    element.yarns = Some([law(alpha[0]), law(alpha[1])]);
    element.shear = Some(law(alpha[2]));
    element
}

fn constraints(element: &Element, x: &[Vec3; 3]) -> [f64; 3] {
    let [g1, g2] = element.gradient;
    let f = |k: usize| (x[1] - x[0]) * g1[k] + (x[2] - x[0]) * g2[k];
    let (a, b) = (f(0), f(1));
    [
        a.norm() - 1.0,
        b.norm() - 1.0,
        a.dot(&b) / (a.norm() * b.norm()),
    ]
}

/// A random triangle, deformed by tens of percent.
fn corners(stream: &mut Stream) -> [Vec3; 3] {
    [[0.0, 0.0], [0.01, 0.0], [0.01, 0.01]]
        .map(|[x, y]| Vec3::new(x, y, 0.0) + Vec3::from_fn(|_, _| 0.002 * stream.normal()))
}

/// Under a large compliance each constraint moves its corners by -w C grad / compliance:
/// finite differences of C confirm the gradient, sign included. The compliance of shear falls with
/// its angle. Linear and angular momentum of each push are zero.
#[test]
fn elements_follow_the_gradients_of_their_constraints() {
    let mut stream = Stream::new(4, Purpose::Evaluation, 0);
    for trial in 0..60 {
        let which = trial % 3;
        let mut alpha = [None; 3];
        alpha[which] = Some(SOFT);
        let element = element(6.0 * f64::from(trial as u32), alpha);
        let x = corners(&mut stream);
        let w = [1.0, 2.0, 0.5];
        let mut moved = x.map(|x| Vec3x(x.into()));
        project_elements(&[element], &mut moved, &w, &mut [], None);
        let c = constraints(&element, &x)[which];
        let mut sum = [Vec3::zeros(); 2];
        for v in 0..3 {
            let gradient = Vec3::from_fn(|k, _| {
                let shifted = |by: f64| {
                    let mut x = x;
                    x[v][k] += by;
                    constraints(&element, &x)[which]
                };
                (shifted(1e-8) - shifted(-1e-8)) / 2e-8
            });
            let push = (Vec3::from(moved[v].0) - x[v]) / w[v];
            let share = if which == 2 { share_of_sine(c) } else { 1.0 };
            let off = (push * SOFT * share + gradient * c).norm();
            assert!(off < 1e-4 * gradient.norm() * c.abs() + 1e-4, "{off:e}");
            sum[0] += push;
            sum[1] += x[v].cross(&push);
        }
        assert!(sum[0].norm() < 2e-17, "{:e}", sum[0].norm());
        assert!(sum[1].norm() < 2e-19, "{:e}", sum[1].norm());
    }
}

/// One rigid constraint is met to second order after one projection; repeated, exactly.
#[test]
fn rigid_elements_come_to_their_rest_shape() {
    let mut stream = Stream::new(5, Purpose::Evaluation, 0);
    for trial in 0..30 {
        let element = element(11.0 * f64::from(trial), [Some(0.0); 3]);
        let mut x = corners(&mut stream).map(|x| Vec3x(x.into()));
        for _ in 0..200 {
            project_elements(&[element], &mut x, &[1.0, 2.0, 0.5], &mut [], None);
        }
        let c = constraints(&element, &x.map(|x| Vec3::from(x.0)));
        assert!(c.iter().all(|c| c.abs() < 1e-12), "{c:?}");
    }
}

/// A triangle that is only moved and turned feels nothing.
#[test]
fn rigid_motion_moves_nothing() {
    let lamina = lamina(30.0);
    let turn = nalgebra::Rotation3::from_euler_angles(0.7, -1.1, 2.3);
    let start: Vec<Vec3> = lamina
        .rest
        .iter()
        .map(|[x, y]| turn * Vec3::new(*x, *y, 0.0) + Vec3::new(0.3, -0.2, 0.1))
        .collect();
    let mut x: Vec<_> = start.iter().map(|x| Vec3x((*x).into())).collect();
    let mobility: Vec<f64> = lamina.mass.iter().map(|m| 1e-8 / m).collect();
    for class in elements(&lamina, &PhysicsConfig::default(), None) {
        project_elements(&class, &mut x, &mobility, &mut [], None);
    }
    for (x, start) in x.iter().zip(&start) {
        assert!((Vec3::from(x.0) - start).norm() < 1e-16);
    }
}

/// The branch follows the sign of each strain, and collapsed triangles stay finite.
#[test]
fn branches_follow_the_sign_and_collapse_is_survived() {
    assert_eq!(branch(LAW.in_lanes(None), 0.1), 1e-3);
    assert_eq!(branch(LAW.in_lanes(None), -0.1), 4e-3);
    let element = element(20.0, [Some(0.0); 3]);
    for w in [[0.0; 3], [1.0, 0.0, 2.0]] {
        let start = [Vec3x([0.5; 3]); 3];
        let mut x = start;
        project_elements(&[element], &mut x, &w, &mut [], None);
        assert!(x.iter().flat_map(|x| x.0).all(f64::is_finite));
    }
}

/// Energies of a homogeneous strain are those of the law times the area of the sheet.
#[test]
fn compliances_carry_modulus_thickness_and_area() {
    let lamina = lamina(45.0);
    let all = elements(&lamina, &PhysicsConfig::default(), None).concat();
    assert_eq!(all.len(), lamina.triangles.len());
    let stiffness = |f: fn(&Element) -> f64| all.iter().map(|e| 1.0 / f(e)).sum::<f64>();
    let volume = 0.03 * 0.02 * 0.35e-3;
    for (found, modulus) in [
        (stiffness(|e| e.yarns.unwrap()[0].tension), 600e6),
        (stiffness(|e| e.yarns.unwrap()[0].compression), 6e6),
        (stiffness(|e| e.yarns.unwrap()[1].tension), 5e6 / 0.006),
        (stiffness(|e| e.shear.unwrap().tension), 50e3),
        (stiffness(|e| e.shear.unwrap().compression), 36e3),
    ] {
        assert!((found / (modulus * volume) - 1.0).abs() < 1e-12);
    }
    let limp = PhysicsConfig {
        shear: false,
        ..PhysicsConfig::default()
    };
    assert!(
        elements(&lamina, &limp, None)
            .concat()
            .iter()
            .all(|e| e.shear.is_none())
    );
}

/// A load that would stretch what one pass a substep bears by thousands of percent comes to rest
/// where the law says. Momentum is kept.
#[test]
fn lasting_forces_bear_a_load() {
    for (load, gain) in [(2.0, GAIN), (20.0, GAIN), (20.0, GAIN_WITHOUT_SHEAR)] {
        let mut element = element(45.0, [None; 3]);
        element.yarns = Some([LAW; 2]);
        element.shear = None;
        element.lasting = Some(Lasting {
            first: 0,
            min_warm: [-30.0; 2],
            gain,
        });
        let slope = element.gradient[1][0];
        let push = Vec3::new(1.0, 1.0, 0.0).normalize() * (load * slope);
        let corners = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.01, 0.01, 0.0]];
        let mut x = corners.map(Vec3x);
        let mut density = [0.0; 2];
        for _ in 0..500 {
            let (mut pull, mut stress) = ([Vec3x([0.0; 3]); 3], [0.0; 3]);
            warm_start_elements(&[element], &x, &density, &mut pull, &mut stress, None);
            let sum: Vec3 = pull.iter().map(|pull| Vec3::from(pull.0)).sum();
            let size: f64 = pull.iter().map(|pull| Vec3::from(pull.0).norm()).sum();
            assert!(sum.norm() <= 1e-12 * size);
            // As a substep has it: under hard stress a vertex has inertia.
            let w = [0.0, 0.0, 1e-3 / (2.5e-3 * stress[2]).max(1.0)];
            x[2] = x[2] + (Vec3x(push.into()) + pull[2]).scale(w[2]);
            project_elements(&[element], &mut x, &w, &mut density, None);
        }
        let [strain, ..] = constraints(&element, &x.map(|x| Vec3::from(x.0)));
        let off = strain / (LAW.tension * load) - 1.0;
        assert!(off.abs() < 0.02, "{strain} under {load}");
    }
}

/// As for yarns, only so much compression lasts.
#[test]
fn only_compression_that_bending_holds_lasts() {
    let lasting = Lasting {
        first: 1,
        min_warm: [-0.5, -0.25],
        gain: 1.0,
    };
    let density = [9.0, -2.0, -0.1];
    assert_eq!(lasting.warm(0, &density, None), (1, -0.5));
    assert_eq!(lasting.warm(1, &density, None), (2, -0.1));
}
