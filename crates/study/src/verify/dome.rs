//! Draping a sphere: a net of inextensible yarns.

use std::sync::{Arc, LazyLock};

use super::shear::shear_at;
use super::solve::{Answer, Ask, Solve};
use crate::cloth::{GRAVITY, Piece, bending_yarns, laid, shearing, sheet, tool};
use crate::study::Effort;
use drape_cloth::math::Vec3;
use drape_cloth::tool::{Hemisphere, Pose, Shape, Tool};

/// Polar angle and shear [deg] on the bias line of a fishnet on a sphere: inextensible yarns of 400
/// edges over the length of [`ARM`].
pub const FISHNET: [[f64; 2]; 5] = [
    [30.0, 7.520445268980763],
    [45.0, 16.112878218306406],
    [60.0, 26.9457071972607],
    [70.0, 35.03861168551643],
    [80.0, 43.592147832836964],
];

/// Radius of the hemisphere [m].
const RADIUS: f64 = 0.1;

/// Length of the sheet along its middle yarns, from the pole, over the radius: the bias then
/// reaches a polar angle of 86 degrees.
const ARM: f64 = 0.95;

static DOME: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let dome = Hemisphere {
        radius_mm: 1e3 * RADIUS,
        segment_count: 256,
        ring_count: 64,
        ..Hemisphere::default()
    };
    tool(Shape::Hemisphere(dome), Pose::default(), 3.0).into()
});

/// The fishnet; where it has to be quick on a coarser mesh and without the twin.
pub(super) fn asks(effort: Effort) -> Vec<Ask> {
    vec![Box::new(move |solver| {
        if effort == Effort::Quick && solver.fast().is_none() {
            return Vec::new();
        }
        let line = wrap(solver, effort.pick(20, 40));
        let at = |[polar, shear]: [f64; 2]| {
            let found = at_polar(&line, polar.to_radians()).to_degrees();
            let case = format!("hemisphere: shear at {polar:.0} deg");
            Answer::new(case, "deg", [shear, found])
        };
        FISHNET.map(at).into()
    })]
}

/// Lays a sheet with arms of `edges` edges flat on the pole of a hemisphere without friction and
/// lets it sink under ten times its weight, held at the pole.
///
/// The fabric has a thousandth of glass fabric's shear stiffness and hardly any in bending, so that
/// the weight stretches no yarn, overcomes shear, and leaves the net of inextensible yarns. Gives
/// the shear on the four bias lines, their mean: [polar angle, shear] [rad], from the pole on.
pub fn wrap(solver: &dyn Solve, edges: usize) -> Vec<[f64; 2]> {
    let side = 2.0 * ARM * RADIUS;
    let lamina = sheet([side; 2], [2 * edges + 1; 2], shearing(50.0));
    let mut start = laid(&lamina, |[x, y]| [x, y, RADIUS]);
    let pole = lamina.vertex_at(edges, edges).expect("inside the sheet");
    start.fixed.insert(pole as usize);
    let mut physics = bending_yarns(50.0, 1e-5);
    (physics.shear, physics.gravity) = (true, 10.0 * GRAVITY);
    // What touches the tool stays on it.
    physics.adhesion = 1.0;
    let piece = Piece::new(lamina, physics, start).on(&DOME);
    let end = solver.settle(&piece, [1e-5, 2.5]);
    let lamina = &piece.lamina;
    let polar = |v: u32| {
        let x = Vec3::from(end.position[v as usize]);
        (x.z / x.norm()).clamp(-1.0, 1.0).acos()
    };
    let mut shear = vec![[0.0, 0.0]];
    for k in 1..edges {
        let corners = [(1, 1), (1, -1), (-1, 1), (-1, -1)];
        let of = corners.map(|(p, q): (isize, isize)| {
            let at = |sign: isize| edges.wrapping_add_signed(sign * k as isize);
            let v = lamina.vertex_at(at(p), at(q)).expect("inside the sheet");
            let angle = shear_at(lamina, &end, v).expect("has four neighbours");
            [polar(v), angle.abs()]
        });
        shear.push([0, 1].map(|i| of.iter().map(|one| one[i]).sum::<f64>() / 4.0));
    }
    shear
}

/// The shear at a polar angle [rad], between the nodes of a bias line; NaN beyond its last.
pub fn at_polar(line: &[[f64; 2]], polar: f64) -> f64 {
    let mut pairs = line.windows(2);
    let pair = pairs.find(|p| p[0][0] <= polar && polar <= p[1][0]);
    pair.map_or(f64::NAN, |p| {
        let part = (polar - p[0][0]) / (p[1][0] - p[0][0]);
        p[0][1] + part * (p[1][1] - p[0][1])
    })
}
