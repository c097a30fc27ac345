//! Whoever is asked where a piece of cloth goes: the fast solver, and the finite-element twin.

use crate::cloth::NOWHERE;
use drape_cloth::fabric::Lamina;
use drape_cloth::sim::{
    Accuracy, Backend, Bending, BendingStiffness, Control, Cpu, Model, PhysicsConfig, Precision,
    Snapshot, Solver, World,
};
use drape_cloth::tool::Tool;
use drape_cloth::twin::{Twin, TwinConfig};

/// What is simulated: cloth, its physics, and the tool under it.
#[derive(Clone)]
pub struct Piece<'a> {
    lamina: &'a Lamina,
    physics: PhysicsConfig,
    tool: Option<&'a Tool>,
}

impl<'a> Piece<'a> {
    /// Without a tool.
    pub fn new(lamina: &'a Lamina, physics: PhysicsConfig) -> Self {
        Self {
            lamina,
            physics,
            tool: None,
        }
    }

    /// The same on a tool.
    pub fn on(self, tool: &'a Tool) -> Self {
        Self {
            tool: Some(tool),
            ..self
        }
    }
}

/// Whoever can be asked where a piece of cloth goes.
pub trait Solve: Sync {
    /// Where `piece` is after about `seconds`. Fixed vertices move with the velocity they have.
    fn run(&self, piece: &Piece, state: &Snapshot, seconds: f64) -> Snapshot;

    /// Where it comes to rest: once its root mean square speed is below `speed` [m/s], but no
    /// later than after `seconds`.
    fn settle(&self, piece: &Piece, state: &Snapshot, limits: [f64; 2]) -> Snapshot;

    /// Force with which cloth at rest pulls at its fixed `vertices` [N]; none of a solver that
    /// does not know it.
    fn pull(&self, piece: &Piece, state: &Snapshot, vertices: &[u32]) -> Option<[f64; 3]>;
}

/// The fast solver as it is asked: f64, one environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fast {
    /// How lengths are kept.
    pub solver: Solver,
    /// Duration of a substep [s].
    pub substep: f64,
    /// Substeps between two refreshes of the tool's tangent planes.
    pub contact_interval: usize,
}

impl Fast {
    /// The solver at an accuracy.
    pub fn at(solver: Solver, accuracy: Accuracy) -> Self {
        let stepping = accuracy.stepping();
        Self {
            solver,
            substep: 1.0 / stepping.substep_rate,
            contact_interval: stepping.control(1.0).contact_interval,
        }
    }

    fn substeps(&self, seconds: f64) -> usize {
        (seconds / self.substep).round().max(1.0) as usize
    }

    /// Steps for `seconds`, and ends earlier if `is_over` says so, which is asked every `look` [s].
    fn advance(
        &self,
        piece: &Piece,
        state: &Snapshot,
        [seconds, look]: [f64; 2],
        is_over: impl Fn(&Snapshot) -> bool,
    ) -> Snapshot {
        let physics = PhysicsConfig {
            solver: self.solver,
            ..piece.physics.clone()
        };
        let model = Model::new(piece.lamina, &physics);
        let tool = piece
            .tool
            .map_or_else(|| NOWHERE.clone(), |tool| tool.clone().into());
        let mut cloth = Cpu::new(&World::new(model, tool), 1, Precision::F64);
        cloth.load(0, state);
        let interval = self.substeps(look);
        let mut left = self.substeps(seconds);
        loop {
            let mut look = left.min(interval);
            left -= look;
            while look > 0 {
                let substeps = look.min(1000);
                let control = Control {
                    dt: substeps as f64 * self.substep,
                    substeps,
                    contact_interval: self.contact_interval,
                };
                cloth.step(&control, &[]);
                look -= substeps;
            }
            let state = cloth.snapshot(0);
            if left == 0 || is_over(&state) || !cloth.finite()[0] {
                return state;
            }
        }
    }
}

impl Solve for Fast {
    fn run(&self, piece: &Piece, state: &Snapshot, seconds: f64) -> Snapshot {
        self.advance(piece, state, [seconds; 2], |_| false)
    }

    fn settle(&self, piece: &Piece, state: &Snapshot, [speed, seconds]: [f64; 2]) -> Snapshot {
        self.advance(piece, state, [seconds, 0.05], |state| state.v_rms() < speed)
    }

    /// It knows the tension of yarns, but not what else holds a vertex.
    fn pull(&self, _: &Piece, _: &Snapshot, _: &[u32]) -> Option<[f64; 3]> {
        None
    }
}

/// The twin with its default integration.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference;

impl Reference {
    /// A twin in `state`. Its law always has shear.
    fn twin(piece: &Piece, state: &Snapshot) -> Twin {
        let physics = &piece.physics;
        let config = TwinConfig {
            bending_stiffness: twin_stiffness(physics),
            gravity: physics.gravity,
            friction: physics.friction,
            adhesion: physics.adhesion,
            damping: physics.damping,
            ..TwinConfig::default()
        };
        let mut twin = Twin::new(piece.lamina, &config).expect("the pieces are valid");
        twin.set_positions(&state.position);
        twin.set_velocities(&state.velocity);
        for v in state.fixed.ones() {
            twin.drive(v as u32, state.velocity[v]);
        }
        twin
    }
}

/// The bending stiffness of the fast solver's physics, for the twin.
pub fn twin_stiffness(physics: &PhysicsConfig) -> Option<[f64; 2]> {
    match (physics.bending, physics.bending_stiffness) {
        (Bending::Off, _) => Some([0.0; 2]),
        (_, BendingStiffness::Material) => None,
        (_, BendingStiffness::NewtonMetre(d)) => Some([d; 2]),
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
    fn run(&self, piece: &Piece, state: &Snapshot, seconds: f64) -> Snapshot {
        let mut twin = Self::twin(piece, state);
        let ended = twin.advance(piece.tool, seconds);
        snapshot(&twin, state, ended)
    }

    fn settle(&self, piece: &Piece, state: &Snapshot, [speed, seconds]: [f64; 2]) -> Snapshot {
        let mut twin = Self::twin(piece, state);
        // Under critical damping what is left to go shrinks to a tenth in about this time; a tenth
        // of a micrometre is less than any case can tell.
        let tolerance = (0.1 * speed).max(1e-7);
        let ended = twin.relax(piece.tool, tolerance, seconds);
        snapshot(&twin, state, ended.map(|_| ()))
    }

    fn pull(&self, piece: &Piece, state: &Snapshot, vertices: &[u32]) -> Option<[f64; 3]> {
        Some(Self::twin(piece, state).pull(vertices))
    }
}
