//! Whoever is asked where a piece of cloth goes, the fast solver and the finite-element twin, and
//! the numbers that are got of them.

use crate::cloth::Piece;
use drape_cloth::sim::{Accuracy, Backend, Control, Cpu, Precision, Snapshot, Solver};
use drape_cloth::twin::Twin;
use drape_proof::twin::twin_physics;

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

impl Answer {
    pub(super) fn new(
        case: impl Into<String>,
        unit: &'static str,
        [expected, found]: [f64; 2],
    ) -> Self {
        let case = case.into();
        Self {
            case,
            unit,
            expected,
            found,
        }
    }
}

/// A question whose answer is known, one simulation or a few: what a solver finds; nothing where it
/// cannot be asked.
pub type Ask = Box<dyn Fn(&dyn Solve) -> Vec<Answer> + Send + Sync>;

/// Who is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The fast solver: how it keeps lengths, and how finely it steps.
    Fast { solver: Solver, preset: Accuracy },
    /// The finite-element twin.
    Twin,
}

impl Subject {
    /// Every one, the fastest first.
    pub fn all() -> Vec<Self> {
        let fast = Solver::ALL.into_iter().flat_map(|solver| {
            let presets = Accuracy::ALL.into_iter();
            presets.map(move |preset| Self::Fast { solver, preset })
        });
        fast.chain([Self::Twin]).collect()
    }

    /// Solver and preset, as in tables.
    pub fn names(&self) -> [&'static str; 2] {
        match self {
            Self::Fast { solver, preset } => [solver.name(), preset.name()],
            Self::Twin => ["twin", "reference"],
        }
    }

    pub(super) fn solver(&self) -> Box<dyn Solve> {
        let Self::Fast { solver, preset } = *self else {
            return Box::new(Reference);
        };
        let stepping = preset.stepping();
        Box::new(Fast {
            solver,
            substep: 1.0 / stepping.substep_rate,
            contact_interval: stepping.control(1.0).contact_interval,
        })
    }
}

/// Whoever can be asked where a piece of cloth goes.
pub trait Solve: Sync {
    /// Where `piece` is after about `seconds`. Fixed vertices move with the velocity they have.
    fn run(&self, piece: &Piece, seconds: f64) -> Snapshot;

    /// Where it comes to rest: once its root mean square speed is below `speed` [m/s], but no
    /// later than after `seconds`.
    fn settle(&self, piece: &Piece, limits: [f64; 2]) -> Snapshot;

    /// Force with which cloth at rest pulls at its fixed `vertices` [N]. None of the fast solver,
    /// which knows the tension of yarns, but not what else holds a vertex.
    fn pull(&self, _: &Piece, _: &[u32]) -> Option<[f64; 3]> {
        None
    }

    /// The fast solver, where this is one.
    fn fast(&self) -> Option<&Fast> {
        None
    }
}

/// The fast solver as it is asked: f64, one environment.
pub struct Fast {
    /// How lengths are kept.
    pub solver: Solver,
    /// Duration of a substep [s].
    pub substep: f64,
    /// Substeps between two refreshes of the tool's tangent planes.
    pub contact_interval: usize,
}

impl Fast {
    /// Steps for `seconds`, and ends earlier if `is_over` says so, which is asked every `refresh`
    /// [s].
    fn advance(
        &self,
        piece: &Piece,
        [seconds, refresh]: [f64; 2],
        is_over: impl Fn(&Snapshot) -> bool,
    ) -> Snapshot {
        let mut cloth = Cpu::new(&piece.world(self.solver), 1, Precision::F64);
        cloth.load(0, &piece.start);
        let substeps = |seconds: f64| (seconds / self.substep).round().max(1.0) as usize;
        let [mut left, interval] = [seconds, refresh].map(substeps);
        loop {
            let mut until_asked = left.min(interval);
            left -= until_asked;
            while until_asked > 0 {
                let substeps = until_asked.min(1000);
                let dt = substeps as f64 * self.substep;
                cloth.step(&Control::new(dt, substeps, self.contact_interval), &[]);
                until_asked -= substeps;
            }
            let state = cloth.snapshot(0);
            if left == 0 || is_over(&state) || !cloth.finite()[0] {
                return state;
            }
        }
    }
}

impl Solve for Fast {
    fn run(&self, piece: &Piece, seconds: f64) -> Snapshot {
        self.advance(piece, [seconds; 2], |_| false)
    }

    fn settle(&self, piece: &Piece, [speed, seconds]: [f64; 2]) -> Snapshot {
        self.advance(piece, [seconds, 0.05], |state| state.v_rms() < speed)
    }

    fn fast(&self) -> Option<&Fast> {
        Some(self)
    }
}

/// The twin with its default integration.
pub struct Reference;

impl Reference {
    /// A twin in the state that `piece` starts from. Its law always has shear.
    fn twin(piece: &Piece) -> Twin {
        let config = twin_physics(&piece.physics);
        let mut twin = Twin::new(&piece.lamina, &config).expect("the pieces are valid");
        twin.set_positions(&piece.start.position);
        twin.set_velocities(&piece.start.velocity);
        for v in piece.start.fixed.ones() {
            twin.drive(v as u32, piece.start.velocity[v]);
        }
        twin
    }

    /// What the twin has come to; no numbers where it has diverged.
    fn end<T, E>(piece: &Piece, advance: impl FnOnce(&mut Twin) -> Result<T, E>) -> Snapshot {
        let mut twin = Self::twin(piece);
        let ended = advance(&mut twin);
        let mut state = piece.start.clone();
        (state.position, state.velocity) = (twin.positions(), twin.velocities());
        if ended.is_err() {
            state.position.fill([f64::NAN; 3]);
            state.velocity.fill([f64::NAN; 3]);
        }
        state
    }
}

impl Solve for Reference {
    fn run(&self, piece: &Piece, seconds: f64) -> Snapshot {
        Self::end(piece, |twin| twin.advance(piece.tool.as_deref(), seconds))
    }

    fn settle(&self, piece: &Piece, [speed, seconds]: [f64; 2]) -> Snapshot {
        // Under critical damping what is left to go shrinks to a tenth in about this time; a tenth
        // of a micrometre is less than any case can tell.
        let tolerance = (0.1 * speed).max(1e-7);
        let tool = piece.tool.as_deref();
        Self::end(piece, |twin| twin.relax(tool, tolerance, seconds))
    }

    fn pull(&self, piece: &Piece, vertices: &[u32]) -> Option<[f64; 3]> {
        Some(Self::twin(piece).pull(vertices))
    }
}
