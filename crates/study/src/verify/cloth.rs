//! Pieces of cloth whose answer is known, and how they are brought to rest.

use std::sync::LazyLock;

use fixedbitset::FixedBitSet;

use drape_cloth::fabric::{BlankConfig, Curve, Family, Lamina, MassModel, Material};
use drape_cloth::math::Vec3;
use drape_cloth::sim::{
    Accuracy, Batch, Bending, Compression, Control, Cpu, Model, PhysicsConfig, Snapshot, Solver,
};
use drape_cloth::tool::{GridConfig, Plate, Pose, Shape, Source, Tool, ToolConfig};

/// Gravity [m/s^2].
pub const GRAVITY: f64 = 9.81;

/// Areal mass of the fabric's data sheet, which all pieces have [kg/m^2].
pub const AREAL_MASS: f64 = 0.280;

/// The fast solver as it is asked: f64, one environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fast {
    /// How lengths are kept.
    pub solver: Solver,
    /// Duration of a substep [s].
    pub substep: f64,
    /// Substeps between two looks for the tool's tangent planes.
    pub contact_interval: usize,
}

impl Fast {
    /// The solver at a preset.
    pub fn at(solver: Solver, accuracy: Accuracy) -> Self {
        let stepping = accuracy.stepping();
        Self {
            solver,
            substep: 1.0 / stepping.substep_rate,
            contact_interval: stepping.control(1.0).contact_interval,
        }
    }

    fn advance(&self, batch: &mut Cpu<f64>, model: &Model, tool: &Tool, mut left: usize) {
        while left > 0 {
            let substeps = left.min(1000);
            let dt = substeps as f64 * self.substep;
            batch.step(
                model,
                tool,
                &Control {
                    dt,
                    substeps,
                    contact_interval: self.contact_interval,
                },
                &[],
            );
            left -= substeps;
        }
    }
}

/// What is simulated: cloth, its physics, and the tool under it.
#[derive(Clone, Copy)]
pub struct Piece<'a> {
    pub lamina: &'a Lamina,
    pub physics: &'a PhysicsConfig,
    pub tool: Option<&'a Tool>,
}

/// Whoever can be asked where a piece of cloth goes.
pub trait Solve: Sync {
    /// Yarns and gravity only, without any damping.
    fn yarns_alone(&self) -> PhysicsConfig;

    /// Where `piece` is after about `seconds`. Fixed vertices move with the velocity they have.
    fn run(&self, piece: Piece, state: &Snapshot, seconds: f64) -> Snapshot;

    /// Where it comes to rest: once its root mean square speed is below `speed` [m/s], but no
    /// later than after `seconds`.
    fn settle(&self, piece: Piece, state: &Snapshot, limits: [f64; 2]) -> Snapshot;

    /// Force with which cloth at rest pulls at its fixed `vertices` [N]; none of a solver that
    /// does not know it.
    fn pull(&self, piece: Piece, state: &Snapshot, vertices: &[u32]) -> Option<[f64; 3]>;
}

impl Solve for Fast {
    fn yarns_alone(&self) -> PhysicsConfig {
        PhysicsConfig {
            solver: self.solver,
            bending: Bending::Off,
            shear: false,
            friction: false,
            damping: 0.0,
            speed_cap: 0.0,
            ..PhysicsConfig::default()
        }
    }

    fn run(&self, piece: Piece, state: &Snapshot, seconds: f64) -> Snapshot {
        let model = Model::new(piece.lamina, piece.physics);
        let mut batch = Cpu::<f64>::new(&model);
        batch.load(0, state);
        let left = (seconds / self.substep).round().max(1.0) as usize;
        self.advance(&mut batch, &model, piece.tool.unwrap_or(&NOWHERE), left);
        batch.snapshot(0)
    }

    fn settle(&self, piece: Piece, state: &Snapshot, [speed, seconds]: [f64; 2]) -> Snapshot {
        let model = Model::new(piece.lamina, piece.physics);
        let mut batch = Cpu::<f64>::new(&model);
        batch.load(0, state);
        let tool = piece.tool.unwrap_or(&NOWHERE);
        let look = (0.05 / self.substep).round().max(1.0) as usize;
        let mut left = (seconds / self.substep).round().max(1.0) as usize;
        loop {
            let substeps = left.min(look);
            self.advance(&mut batch, &model, tool, substeps);
            left -= substeps;
            let state = batch.snapshot(0);
            if left == 0 || state.v_rms() < speed || !batch.sound()[0] {
                return state;
            }
        }
    }

    /// It knows the tension of yarns, but not what else holds a vertex.
    fn pull(&self, _: Piece, _: &Snapshot, _: &[u32]) -> Option<[f64; 3]> {
        None
    }
}

/// Resists compression as tension: closed forms of inextensible yarns mean both.
pub fn rigid(physics: PhysicsConfig) -> PhysicsConfig {
    PhysicsConfig {
        compression: Compression::AsTension,
        ..physics
    }
}

/// A tool of `shape`, its distance sampled every `spacing_mm`.
///
/// # Panics
/// If the shape is none; those of the study are.
pub fn tool(shape: Shape, pose: Pose, spacing_mm: f64) -> Tool {
    let config = ToolConfig {
        source: Source::Shape(shape),
        pose,
        grid: GridConfig {
            spacing_mm,
            ..GridConfig::default()
        },
    };
    Tool::new(&config).expect("the tools of the study are valid")
}

/// A plate so far below that nothing touches it.
static NOWHERE: LazyLock<Tool> = LazyLock::new(|| {
    let pose = Pose {
        translation_mm: [0.0, 0.0, -50_000.0],
        ..Pose::default()
    };
    tool(Shape::Plate(Plate::default()), pose, 100.0)
});

/// A rectangle of `size` [m] along its yarns.
///
/// # Panics
/// If it cannot be cut; those of the study can.
pub fn sheet(size: [f64; 2], vertices: [usize; 2], material: Material) -> Lamina {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    Lamina::new(&config, material).expect("the blanks of the study are valid")
}

/// A strip of one cell's width along the yarns of `family`, `edges` long. The yarns that are
/// tested are its two borders, half a cell wide each.
pub fn strip(family: Family, length: f64, edges: usize) -> Lamina {
    let width = length / edges as f64;
    let material = Material::interglas_92125();
    match family {
        Family::Warp => sheet([length, width], [edges + 1, 2], material),
        Family::Weft => sheet([width, length], [2, edges + 1], material),
    }
}

/// The same, with both vertices of every cross-section of the same mass, so that nothing twists
/// it.
pub fn even_strip(family: Family, length: f64, edges: usize) -> Lamina {
    let mut strip = strip(family, length, edges);
    for k in 0..=edges {
        let pair = section(&strip, k);
        let mean = 0.5 * (strip.mass[pair[0]] + strip.mass[pair[1]]);
        for v in pair {
            strip.mass[v] = mean;
        }
    }
    strip
}

/// The built-in fabric with the same shear modulus [Pa] in both directions.
pub fn shearing(modulus: f64) -> Material {
    let mut material = Material::interglas_92125();
    material.shear.positive = Curve::line(modulus);
    material.shear.negative = Curve::line(modulus);
    material
}

/// At rest, with each vertex where `at` puts its place on the flat blank.
pub fn laid(lamina: &Lamina, at: impl Fn([f64; 2]) -> [f64; 3]) -> Snapshot {
    let position: Vec<_> = lamina.rest.iter().map(|&rest| at(rest)).collect();
    Snapshot {
        velocity: vec![[0.0; 3]; position.len()],
        fixed: FixedBitSet::with_capacity(position.len()),
        force_density: Vec::new(),
        sides: Vec::new(),
        position,
    }
}

/// At rest, with each vertex placed by its coordinates along a strip (from 0) and across it.
pub fn placed(lamina: &Lamina, at: impl Fn(f64, f64) -> [f64; 3]) -> Snapshot {
    let long = usize::from(lamina.rows > lamina.columns);
    let start = lamina.rest[0][long];
    laid(lamina, |r| at(r[long] - start, r[1 - long]))
}

/// The vertices at the end of a strip's `k`-th cross-section.
pub fn section(lamina: &Lamina, k: usize) -> [usize; 2] {
    if lamina.rows > lamina.columns {
        [2 * k, 2 * k + 1]
    } else {
        [k, k + lamina.columns]
    }
}

/// Where a strip's `k`-th cross-section is [m].
pub fn mean_at(lamina: &Lamina, state: &Snapshot, k: usize) -> Vec3 {
    let [a, b] = section(lamina, k).map(|v| Vec3::from(state.position[v]));
    (a + b) * 0.5
}

/// Fixes whole cross-sections of a strip.
pub fn fix(lamina: &Lamina, state: &mut Snapshot, sections: &[usize]) {
    for &k in sections {
        state.fixed.extend(section(lamina, k));
    }
}
