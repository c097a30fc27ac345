//! Friction and tack on an incline.

use super::*;
use drape_cloth::tool::Incline;

/// How far a sheet slides down an incline in `seconds` [m].
fn slide(angle: f64, adhesion: f64, seconds: f64) -> f64 {
    let incline = Incline {
        angle_deg: angle.to_degrees(),
        plate_mm: [2000.0, 400.0],
        ..Incline::default()
    };
    let incline = tool(Shape::Incline(incline), 50.0);
    let sheet = lamina([0.1, 0.08], [6, 5]);
    let config = TwinConfig {
        adhesion,
        damping: 0.0,
        ..TwinConfig::default()
    };
    let mut twin = Twin::new(&sheet, &config).unwrap();
    let down = [angle.cos(), 0.0, -angle.sin()];
    let laid: Vec<[f64; 3]> = (twin.positions().iter())
        .map(|x| [down[0] * x[0], x[1], down[2] * x[0]])
        .collect();
    twin.set_positions(&laid);
    twin.advance(Some(&incline), seconds).unwrap();
    let way = (twin.positions().into_iter().zip(&laid))
        .map(|(x, y)| (0..3).map(|k| (x[k] - y[k]) * down[k]).sum::<f64>());
    way.sum::<f64>() / laid.len() as f64
}

#[test]
fn sheet_sticks_below_the_angle_of_friction_and_slips_above() {
    let [stick, slip] = Material::interglas_92125().friction();
    let margin = 0.2f64.to_radians();
    let creep = slide(stick.atan() - margin, 0.0, 0.2);
    assert!(creep.abs() < 1e-8, "creeps {creep} m");
    let angle = stick.atan() + margin;
    let acceleration = GRAVITY * (angle.sin() - slip * angle.cos());
    close(slide(angle, 0.0, 0.2), 0.5 * acceleration * 0.2 * 0.2, 0.02);
}

/// Tack presses like weight: tan(angle) = mu (1 + tack / (weight cos(angle))).
#[test]
fn tack_holds_on_a_steeper_incline() {
    let [stick, _] = Material::interglas_92125().friction();
    let weight = 1e-3 * AREAL_MASS * GRAVITY;
    let angle = 45f64.to_radians();
    let needed = weight * angle.cos() * (angle.tan() / stick - 1.0);
    assert!(slide(angle, 1.02 * needed, 0.1).abs() < 1e-8);
    assert!(slide(angle, 0.98 * needed, 0.1) > 1e-5);
}
