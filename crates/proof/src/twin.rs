//! A twin that falls and lies as a scene says.

use crate::ProofError;
use drape_cloth::file::ValueError;
use drape_cloth::scene::{Misplacement, Scene, SceneConfig, SceneError};
use drape_cloth::sim::{Bending, BendingStiffness, PhysicsConfig, SelfCollision};
use drape_cloth::twin::{Hold, PressConfig, Twin, TwinConfig};
use drape_task::env::EnvConfig;

/// The twin's configuration for the physics of a scene; the error names the first key whose value
/// the twin has nothing for.
pub fn twin_config(scene: &SceneConfig) -> Result<TwinConfig, SceneError> {
    let physics = &scene.physics;
    let is_alone = physics.self_collision == SelfCollision::Off;
    let found = format!("{:?}", physics.self_collision).to_lowercase();
    let expected = "off: the twin's cloth does not touch itself";
    ValueError::unless(is_alone, "physics.self_collision", found, expected)?;
    let bends_along_yarns = physics.bending != Bending::Dihedral;
    let expected = "yarns or off: the twin bends along its yarns";
    ValueError::unless(bends_along_yarns, "physics.bending", "dihedral", expected)?;
    let expected = "true: the twin's fabric resists shear";
    ValueError::unless(physics.shear, "physics.shear", "false", expected)?;
    let is_free = physics.strain_limit.is_none();
    let found = physics.strain_limit.unwrap_or_default();
    let expected = "none: the twin's yarns go on with their slope";
    ValueError::unless(is_free, "physics.strain_limit", found, expected)?;
    let config = twin_physics(physics);
    config.check().map_err(|error| error.within("physics"))?;
    Ok(config)
}

/// The fast solver's physics for the twin.
pub fn twin_physics(physics: &PhysicsConfig) -> TwinConfig {
    TwinConfig {
        bending_stiffness: match (physics.bending, physics.bending_stiffness) {
            (Bending::Off, _) => Some([0.0; 2]),
            (_, BendingStiffness::Material) => None,
            (_, BendingStiffness::NewtonMetre(d)) => Some([d; 2]),
        },
        gravity: physics.gravity,
        shear_locking: physics.shear_locking,
        friction: physics.friction,
        adhesion: physics.adhesion,
        damping: physics.damping,
        ..TwinConfig::default()
    }
}

/// [`twin_config`] of a scene that is set up: its tool must not be finer than cells either.
pub fn twin_of(scene: &Scene) -> Result<TwinConfig, SceneError> {
    let expected = "a tool that is smooth at the scale of a cell: the twin feels vertices alone";
    let is_smooth = !scene.model.feels_between();
    ValueError::unless(
        is_smooth,
        "tool",
        "finer than the cells of the blank",
        expected,
    )?;
    twin_config(&scene.config)
}

/// How the twin presses: as the environment does.
pub fn press_config(env: &EnvConfig, hold: Hold) -> PressConfig {
    PressConfig {
        roller: env.roller(),
        press_s: env.press_s,
        settle_s: env.settle_s,
        drape_threshold_mm: env.drape_threshold_mm,
        hold,
    }
}

/// A twin that has fallen as the scene says, from so far off its place, or has settled from where a scan has it. Clamps move evenly during the fall, then stay;
/// settling has the scene's own damping unless the twin has none at all.
pub fn fallen(scene: &Scene, config: &TwinConfig, off: &Misplacement) -> Result<Twin, ProofError> {
    let [_, settle_s] = scene.config.fall.durations();
    let (start, fall_s) = scene.begun(off)?;
    let mut twin = Twin::new(&scene.lamina, config)?;
    twin.set_positions(&start.position);
    for v in start.fixed.ones() {
        twin.drive(v as u32, start.velocity[v]);
    }
    let tool = Some(&*scene.tool);
    twin.advance(tool, fall_s)?;
    for v in start.fixed.ones() {
        twin.fix(v as u32);
    }
    if config.damping > 0.0 {
        twin.set_damping(scene.config.fall.settle_damping);
    }
    twin.advance(tool, settle_s)?;
    twin.set_damping(config.damping);
    Ok(twin)
}

/// A scene before its fall, with the durations of the fall, for [`fallen`].
pub fn unfallen(config: &SceneConfig) -> Result<Scene, SceneError> {
    let mut hung = config.clone();
    (hung.fall.fall_s, hung.fall.settle_s) = (0.0, 0.0);
    hung.clamps.iter_mut().for_each(|c| c.move_mm = [0.0; 3]);
    let mut hung = Scene::new(&hung, |_| ())?;
    hung.config = config.clone();
    Ok(hung)
}

/// A twin at rest at `positions` [m], its clamps where they are there.
pub fn lying(
    scene: &Scene,
    config: &TwinConfig,
    positions: &[[f64; 3]],
) -> Result<Twin, ValueError> {
    let mut twin = Twin::new(&scene.lamina, config)?;
    twin.set_positions(positions);
    for v in scene.initial.fixed.ones() {
        twin.fix(v as u32);
    }
    Ok(twin)
}

#[cfg(test)]
pub(crate) mod tests;
