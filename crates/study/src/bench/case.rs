//! One variant of the simulation to be timed.

use cpu_time::ThreadTime;

use super::limits::Limits;
use super::{Effort, Samples};
use drape_cloth::fabric::Lamina;
#[cfg(target_arch = "x86_64")]
use drape_cloth::math::{F32x8, F32x16, F64x4, F64x8};
use drape_cloth::math::{Isa, Lanes, Portable};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Batch, Control, Model, PhysicsConfig, Solver, alone, alone_f64, batch};

/// The control step of an episode: a frame.
pub const CONTROL: Control = Control {
    dt: 1.0 / 60.0,
    substeps: 20,
    contact_interval: 5,
};

/// What computes the environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    /// One environment in f64, as scenes are set up.
    AloneF64,
    /// One environment in f32, as sequences are evaluated.
    AloneF32,
    /// As many environments as an instruction set has lanes, as training steps them.
    Group(Isa),
}

impl Backend {
    /// All that this processor can run, widest last.
    pub fn all() -> Vec<Self> {
        let groups = Isa::available().into_iter().map(Self::Group);
        [Self::AloneF64, Self::AloneF32]
            .into_iter()
            .chain(groups)
            .collect()
    }

    /// A batch for `model`.
    pub fn batch(self, model: &Model) -> Box<dyn Batch> {
        match self {
            Self::AloneF64 => alone_f64(model, Isa::best()),
            Self::AloneF32 => alone(model, Isa::best()),
            Self::Group(isa) => batch(model, isa),
        }
    }

    /// Number of environments.
    pub fn lanes(self) -> usize {
        match self {
            Self::AloneF64 | Self::AloneF32 => 1,
            Self::Group(isa) => isa.lanes(),
        }
    }

    /// Name of the instruction set whose limits hold. One environment has its lines in these
    /// lanes, as far as its solver works along lines.
    pub fn isa(self) -> &'static str {
        match self {
            Self::AloneF64 | Self::AloneF32 => Self::Group(Isa::best()).isa(),
            Self::Group(Isa::Portable) => Portable::ISA,
            #[cfg(target_arch = "x86_64")]
            Self::Group(Isa::Avx2) => F32x8::ISA,
            #[cfg(target_arch = "x86_64")]
            Self::Group(Isa::Avx512) => F32x16::ISA,
        }
    }

    /// Bytes of a number.
    pub fn number_size(self) -> usize {
        match self {
            Self::AloneF64 => size_of::<f64>(),
            Self::AloneF32 | Self::Group(_) => size_of::<f32>(),
        }
    }

    /// Measures the machine's limits for these lanes, once.
    pub(super) fn limits(self, numbers: usize) -> Limits {
        match self {
            Self::AloneF64 => match Isa::best() {
                Isa::Portable => Limits::measure::<f64>(numbers),
                #[cfg(target_arch = "x86_64")]
                Isa::Avx2 => Limits::measure::<F64x4>(numbers),
                #[cfg(target_arch = "x86_64")]
                Isa::Avx512 => Limits::measure::<F64x8>(numbers),
            },
            Self::AloneF32 => Self::Group(Isa::best()).limits(numbers),
            Self::Group(Isa::Portable) => Limits::measure::<Portable>(numbers),
            #[cfg(target_arch = "x86_64")]
            Self::Group(Isa::Avx2) => Limits::measure::<F32x8>(numbers),
            #[cfg(target_arch = "x86_64")]
            Self::Group(Isa::Avx512) => Limits::measure::<F32x16>(numbers),
        }
    }
}

/// Every solver on every backend: the rows of the table `core`.
pub fn variants() -> Vec<(Solver, Backend)> {
    [Solver::Yarn, Solver::GaussSeidel]
        .into_iter()
        .flat_map(|solver| Backend::all().into_iter().map(move |b| (solver, b)))
        .collect()
}

/// The features of `[physics]`, each as a scene file would change it. A feature is one line.
pub const FEATURES: [&str; 10] = [
    "bending = \"dihedral\"",
    "bending = \"off\"",
    "friction = false",
    "shear = false",
    "speed_cap = 0",
    "compression = \"as_tension\"",
    "self_collision = \"material\"",
    "adhesion = 1",
    "strain_limit = 0.02",
    "tension = \"material\"",
];

/// The default physics with the lines of a scene file's `[physics]` in `change`.
pub fn physics(change: &str) -> PhysicsConfig {
    toml::from_str(change).expect("the features are keys of `[physics]`")
}

/// Environments on the sheet of a scene.
pub struct Case {
    model: Model,
    batch: Box<dyn Batch>,
}

impl Case {
    /// `lamina` under `physics` on `backend`.
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig, backend: Backend) -> Self {
        let model = Model::new(lamina, physics);
        let batch = backend.batch(&model);
        Self { model, batch }
    }

    /// Puts every environment into the settled state of `scene`, and steps once: then memory is
    /// in the caches, and edges have found their branch.
    pub fn start(&mut self, scene: &Scene) {
        for lane in 0..self.batch.lanes() {
            self.batch.load(lane, &scene.initial);
        }
        self.step(scene);
    }

    /// One control step.
    pub fn step(&mut self, scene: &Scene) {
        self.batch.step(&self.model, &scene.tool, &CONTROL, &[]);
    }

    /// Number of environments.
    pub fn lanes(&self) -> usize {
        self.batch.lanes()
    }

    /// The state of the first environment.
    #[cfg(test)]
    pub(super) fn state(&self) -> drape_cloth::sim::Snapshot {
        self.batch.snapshot(0)
    }

    /// CPU time of this thread for an environment and substep [us].
    fn time(&mut self, scene: &Scene, control_steps: usize) -> f64 {
        self.start(scene);
        let start = ThreadTime::now();
        for _ in 0..control_steps {
            self.step(scene);
        }
        let substeps = control_steps * CONTROL.substeps * self.lanes();
        1e6 * start.elapsed().as_secs_f64() / substeps as f64
    }
}

/// Times all cases [us for an environment and substep], in turns: noise of the machine that
/// lasts hits all alike.
pub(super) fn sample(
    cases: &mut [Case],
    scene: &Scene,
    effort: &Effort,
    mut progress: impl FnMut(f64),
) -> Vec<Samples> {
    let mut samples = vec![Samples::default(); cases.len()];
    for repeat in 0..effort.repeats {
        for (case, samples) in cases.iter_mut().zip(&mut samples) {
            samples.0.push(case.time(scene, effort.control_steps));
        }
        progress((repeat + 1) as f64 / effort.repeats as f64);
    }
    samples
}
