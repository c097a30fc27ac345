//! Pieces of cloth and tools of the studies whose answers are known.

use std::sync::{Arc, LazyLock};

use drape_cloth::fabric::{BlankConfig, Curve, Family, Lamina, MassModel, Material};
use drape_cloth::math::Vec3;
use drape_cloth::sim::{Bending, BendingStiffness, Model, PhysicsConfig, Snapshot, Solver, World};
use drape_cloth::tool::{GridConfig, Incline, Plate, Pose, Shape, Source, Tool, ToolConfig};

/// Gravity [m/s^2].
pub const GRAVITY: f64 = 9.81;

/// Areal mass of the fabric's data sheet, which all pieces have [kg/m^2].
pub const AREAL_MASS: f64 = 0.280;

/// What is simulated: cloth, its physics, the tool under it, and how it starts.
#[derive(Clone)]
pub struct Piece {
    pub lamina: Lamina,
    pub physics: PhysicsConfig,
    /// None touches nothing.
    pub tool: Option<Arc<Tool>>,
    pub start: Snapshot,
}

impl Piece {
    /// One without a tool.
    pub fn new(lamina: Lamina, physics: PhysicsConfig, start: Snapshot) -> Self {
        Self {
            lamina,
            physics,
            tool: None,
            start,
        }
    }

    /// This piece on a tool.
    pub fn on(mut self, tool: &Arc<Tool>) -> Self {
        self.tool = Some(tool.clone());
        self
    }

    /// What the fast solver steps, with lengths kept by `solver`.
    pub fn world(&self, solver: Solver) -> World {
        let mut physics = self.physics.clone();
        physics.solver = solver;
        let tool = self.tool.as_ref().unwrap_or(&NOWHERE);
        World::new(Model::new(&self.lamina, &physics), tool.clone())
    }
}

/// Yarns, gravity and `damping` [1/s] only.
pub fn yarns_alone(damping: f64) -> PhysicsConfig {
    PhysicsConfig {
        bending: Bending::Off,
        shear: false,
        friction: false,
        damping,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    }
}

/// [`yarns_alone`] and a bending `stiffness` along the yarns [N m].
pub fn bending_yarns(damping: f64, stiffness: f64) -> PhysicsConfig {
    PhysicsConfig {
        bending: Bending::Yarns,
        bending_stiffness: BendingStiffness::NewtonMetre(stiffness),
        ..yarns_alone(damping)
    }
}

/// A tool whose distance is sampled every `spacing_mm`.
pub fn tool_config(source: Source, pose: Pose, spacing_mm: f64) -> ToolConfig {
    let grid = GridConfig {
        spacing_mm: Some(spacing_mm),
        ..GridConfig::default()
    };
    ToolConfig { source, pose, grid }
}

/// The tool of a valid `shape`.
pub fn tool(shape: Shape, pose: Pose, spacing_mm: f64) -> Tool {
    let config = tool_config(Source::Shape(shape), pose, spacing_mm);
    Tool::new(&config).expect("the tools of the studies are valid")
}

/// A plate so far below that nothing touches it.
pub static NOWHERE: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let pose = Pose {
        translation_mm: [0.0, 0.0, -50_000.0],
        ..Pose::default()
    };
    tool(Shape::Plate(Plate::default()), pose, 100.0).into()
});

/// A rectangle of `size` [m] along its yarns, which can be cut.
pub fn sheet(size: [f64; 2], vertices: [usize; 2], material: Material) -> Lamina {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    Lamina::new(&config, material).expect("the blanks of the studies are valid")
}

/// A strip of one cell's width along the yarns of `family`, `edges` long: its two borders are yarns
/// of half a cell each.
pub fn strip(family: Family, length: f64, edges: usize) -> Lamina {
    let width = length / edges as f64;
    let material = Material::interglas_92125();
    match family {
        Family::Warp => sheet([length, width], [edges + 1, 2], material),
        Family::Weft => sheet([width, length], [2, edges + 1], material),
    }
}

/// A strip with both vertices of every cross-section of the same mass, so that nothing twists
/// it; else the corners at the ends of diagonals are heavier.
pub fn evened(mut strip: Lamina) -> Lamina {
    for k in 0..strip.rows.max(strip.columns) {
        let pair = section(&strip, k);
        let mean = 0.5 * (strip.mass[pair[0]] + strip.mass[pair[1]]);
        for v in pair {
            strip.mass[v] = mean;
        }
    }
    strip
}

/// A cloth, its yarns as stiff in compression as in tension.
pub fn rigid(mut lamina: Lamina) -> Lamina {
    for law in [&mut lamina.material.warp, &mut lamina.material.weft] {
        law.compression = law.tension.clone();
    }
    lamina
}

/// The built-in fabric with the same shear modulus [Pa] in both directions.
pub fn shearing(modulus: f64) -> Material {
    let mut material = Material::interglas_92125();
    material.shear.positive = Curve::line(modulus);
    material.shear.negative = Curve::line(modulus);
    material
}

/// The built-in fabric with one coefficient of friction at rest and one in motion.
pub fn rubbing([stick, slide]: [f64; 2]) -> Material {
    let mut material = Material::interglas_92125();
    for law in [&mut material.warp, &mut material.weft] {
        law.static_friction = stick;
        law.dynamic_friction = slide;
    }
    material
}

/// At rest, with each vertex where `at` puts its place on the flat blank.
pub fn laid(lamina: &Lamina, at: impl FnMut([f64; 2]) -> [f64; 3]) -> Snapshot {
    let position = lamina.rest.iter().copied().map(at).collect();
    Snapshot::at_rest(position)
}

/// At rest, with each vertex placed by its coordinates along a strip (from 0) and across it.
pub fn placed(lamina: &Lamina, at: impl Fn(f64, f64) -> [f64; 3]) -> Snapshot {
    let long = usize::from(lamina.rows > lamina.columns);
    let start = lamina.rest[0][long];
    laid(lamina, |r| at(r[long] - start, r[1 - long]))
}

/// A strip that starts straight, `tilt` degrees off the vertical, and hangs by its first row.
pub fn hung(strip: &Lamina, tilt: f64) -> Snapshot {
    let (sin, cos) = tilt.to_radians().sin_cos();
    let mut state = placed(strip, |s, t| [t, s * sin, -s * cos]);
    fix(strip, &mut state, &[0]);
    state
}

/// A heavy strip of edges of length `edge` that starts level, clamped by the first.
///
/// Bending begins where the curvature of the second vertex does, half an edge from either end, so
/// the free length counts from the middle of that edge, where the origin is. Yarns resist
/// compression as tension: the elastica keeps its length.
pub fn clamped(strip: Lamina, edge: f64, stiffness: f64, damping: f64) -> Piece {
    let strip = rigid(strip);
    let mut start = placed(&strip, |s, t| [s - 0.5 * edge, t, 0.0]);
    fix(&strip, &mut start, &[0, 1]);
    Piece::new(strip, bending_yarns(damping, stiffness), start)
}

/// A sheet on a slope of `angle` [rad], up where x is less, so that it slides about the origin as
/// on a tool.
pub fn on_slope(sheet: Lamina, physics: PhysicsConfig, angle: f64) -> Piece {
    let (sin, cos) = angle.sin_cos();
    let incline = Incline {
        angle_deg: angle.to_degrees(),
        plate_mm: [4000.0, 400.0],
        ..Incline::default()
    };
    let tool = tool(Shape::Incline(incline), Pose::default(), 100.0);
    let start = laid(&sheet, |[x, y]| [cos * (x - 0.2), y, -sin * (x - 0.2)]);
    Piece::new(sheet, physics, start).on(&tool.into())
}

/// How far cloth has slid down a slope of `angle` [rad] on average [m].
pub fn slid(from: &Snapshot, to: &Snapshot, angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let sum =
        |state: &Snapshot| -> f64 { state.position.iter().map(|x| x[0] * cos - x[2] * sin).sum() };
    (sum(to) - sum(from)) / from.position.len() as f64
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

/// Linear and angular momentum [kg m/s, kg m^2/s].
pub fn momenta(lamina: &Lamina, state: &Snapshot) -> [Vec3; 2] {
    let mut sum = [Vec3::zeros(); 2];
    for ((x, v), m) in state.position.iter().zip(&state.velocity).zip(&lamina.mass) {
        let p = Vec3::from(*v) * *m;
        sum[0] += p;
        sum[1] += Vec3::from(*x).cross(&p);
    }
    sum
}

/// Elastic energy of a state by the laws of the fast solver (docs/PHYSICS.md), of lengths and of shear [J].
pub fn elastic_energy(lamina: &Lamina, state: &Snapshot) -> f64 {
    let material = &lamina.material;
    let thickness = material.thickness();
    let along = |family| {
        let law = material.yarn(family);
        [&law.tension, &law.compression].map(Curve::modulus)
    };
    let shear = [&material.shear.positive, &material.shear.negative].map(Curve::modulus);
    let branch = |c: f64, [more, less]: [f64; 2]| 0.5 * c * c * if c < 0.0 { less } else { more };
    let at = |v: u32| Vec3::from(state.position[v as usize]);
    let length = |a: u32, b: u32| (at(a) - at(b)).norm();
    let (mut of_lengths, mut of_shear) = (0.0, 0.0);
    for yarn in &lamina.yarns {
        let volume = thickness * yarn.width * yarn.rest_length;
        for pair in yarn.vertices.windows(2) {
            let c = length(pair[0], pair[1]) / yarn.rest_length - 1.0;
            of_lengths += volume * branch(c, along(yarn.family));
        }
    }
    let [a, b] = lamina.cell();
    for &[from, to] in &lamina.diagonals {
        let growth = length(from, to).powi(2) - lamina.cell_diagonal().powi(2);
        let gamma = (growth / (2.0 * a * b)).clamp(-1.0, 1.0).asin();
        of_shear += thickness * a * b * branch(gamma, shear);
    }
    for membrane in &lamina.membranes {
        let volume = thickness * membrane.area;
        let f = [0, 1].map(|k| -> Vec3 {
            let corners = membrane.vertices.iter().zip(&membrane.gradient);
            corners.map(|(v, g)| at(*v) * g[k]).sum()
        });
        let yarns = [Family::Warp, Family::Weft].into_iter();
        for (f, family) in f.iter().zip(yarns.filter(|_| !membrane.has_yarns)) {
            of_lengths += volume * branch(f.norm() - 1.0, along(family));
        }
        let sine = (f[0].dot(&f[1]) / (f[0].norm() * f[1].norm())).clamp(-1.0, 1.0);
        of_shear += volume * branch(sine.asin(), shear);
    }
    of_lengths + of_shear
}
