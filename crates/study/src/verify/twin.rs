//! The finite-element twin, asked the same as the fast solver.

use super::cloth::{Piece, Solve};
use drape_cloth::fabric::{Family, Lamina};
use drape_cloth::sim::{Bending, BendingStiffness, Compression, PhysicsConfig, Snapshot};
use drape_cloth::twin::{Twin, TwinConfig};

/// The twin with its default integration.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference;

impl Reference {
    /// A twin in `state`. Its law always has shear; yarns that resist compression as tension are
    /// yarns of such a material.
    fn twin(piece: Piece, state: &Snapshot) -> Twin {
        let physics = piece.physics;
        let stiffness = match (physics.bending, physics.bending_stiffness) {
            (Bending::Off, _) => [0.0; 2],
            // Not the twin's own, as its material may get another branch below.
            (_, BendingStiffness::Material) => {
                let of = |family| piece.lamina.material.bending_stiffness(family);
                [Family::Warp, Family::Weft].map(of)
            }
            (_, BendingStiffness::NewtonMetre(d)) => [d; 2],
        };
        let config = TwinConfig {
            bending_stiffness: Some(stiffness),
            gravity: physics.gravity,
            friction: physics.friction,
            adhesion: physics.adhesion,
            damping: physics.damping,
            ..TwinConfig::default()
        };
        let rigid: Lamina;
        let lamina = match physics.compression {
            Compression::Material => piece.lamina,
            Compression::AsTension => {
                let mut lamina = piece.lamina.clone();
                for law in [&mut lamina.material.warp, &mut lamina.material.weft] {
                    law.compression = law.tension.clone();
                }
                rigid = lamina;
                &rigid
            }
        };
        let mut twin = Twin::new(lamina, &config).expect("the pieces of the study are valid");
        twin.set_positions(&state.position);
        twin.set_velocities(&state.velocity);
        for v in state.fixed.ones() {
            twin.drive(v as u32, state.velocity[v]);
        }
        twin
    }
}

/// What `twin` has come to; no numbers where it has diverged.
fn snapshot<E>(twin: &Twin, from: &Snapshot, ended: Result<(), E>) -> Snapshot {
    let mut state = Snapshot {
        position: twin.positions(),
        velocity: twin.velocities(),
        ..from.clone()
    };
    if ended.is_err() {
        state.position.fill([f64::NAN; 3]);
        state.velocity.fill([f64::NAN; 3]);
    }
    state
}

impl Solve for Reference {
    fn yarns_alone(&self) -> PhysicsConfig {
        PhysicsConfig {
            bending: Bending::Off,
            shear: false,
            friction: false,
            damping: 0.0,
            ..PhysicsConfig::default()
        }
    }

    fn run(&self, piece: Piece, state: &Snapshot, seconds: f64) -> Snapshot {
        let mut twin = Self::twin(piece, state);
        let ended = twin.advance(piece.tool, seconds);
        snapshot(&twin, state, ended)
    }

    fn settle(&self, piece: Piece, state: &Snapshot, [speed, seconds]: [f64; 2]) -> Snapshot {
        let mut twin = Self::twin(piece, state);
        // Under critical damping what is left to go shrinks to a tenth in about this time; a tenth
        // of a micrometre is less than any case can tell.
        let tolerance = (0.1 * speed).max(1e-7);
        let ended = twin.relax(piece.tool, tolerance, seconds);
        snapshot(&twin, state, ended.map(|_| ()))
    }

    fn pull(&self, piece: Piece, state: &Snapshot, vertices: &[u32]) -> Option<[f64; 3]> {
        Some(Self::twin(piece, state).pull(vertices))
    }
}
