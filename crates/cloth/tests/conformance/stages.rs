//! Every stage of a substep by itself, from one state: what a device makes of it is what the reference does,
//! after one substep to a micrometre. After a frame contact and branches amplify rounding, and a wrong
//! constant could hide behind it.

use super::*;

/// One substep of a long step: stages have much to do.
const SUBSTEP: Control = Control {
    dt: 1.0 / 300.0,
    substeps: 1,
    contact_interval: 1,
    sweeps: 1,
};

/// How far any vertex may be off the reference [m].
const TOLERANCE: f64 = 1e-6;
/// How much each stage moves some vertex at least [m].
const EFFECT: f64 = 1e-4;

/// What a substep is given.
struct Setting {
    physics: PhysicsConfig,
    own: Own,
    /// Force density of the yarns from the substep before [N/m].
    density: f64,
    pressed: bool,
}

/// A stage: adds it, on top of what it needs.
type Stage = (&'static str, fn(&mut Setting, bool));

/// No stage but the lengths of yarns, which cannot be left out, and give way easily. The second tool is
/// out of reach.
fn nothing(solver: Solver) -> Setting {
    let physics = PhysicsConfig {
        solver,
        bending: Bending::Off,
        bending_stiffness: BendingStiffness::NewtonMetre(1e-2),
        shear: false,
        friction: false,
        gravity: 0.0,
        damping: 0.0,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    };
    let own = Own {
        tool: 1,
        parameters: Parameters {
            tension: [1e-3; 2],
            compression: [1e-3; 2],
            ..Parameters::default()
        },
        ..Own::default()
    };
    Setting {
        physics,
        own,
        density: 0.0,
        pressed: false,
    }
}

/// Those of both solvers.
const STAGES: [Stage; 17] = [
    ("weight", |s, on| {
        s.physics.gravity = if on { 98.1 } else { 0.0 }
    }),
    ("damping", |s, on| {
        s.physics.damping = if on { 300.0 } else { 0.0 }
    }),
    ("speed cap", |s, on| {
        s.physics.speed_cap = if on { 0.4 } else { 0.0 }
    }),
    ("tension of warps", |s, on| {
        (s.own.parameters.tension[0], s.own.parameters.areal_mass) =
            (if on { 1.0 } else { 1e-3 }, 100.0);
    }),
    ("tension of wefts", |s, on| {
        (s.own.parameters.tension[1], s.own.parameters.areal_mass) =
            (if on { 1.0 } else { 1e-3 }, 100.0);
    }),
    // What was pushed in the substep before.
    ("compression of warps", |s, on| {
        (s.own.parameters.compression[0], s.density) = (if on { 1.0 } else { 1e-3 }, -1e-3);
    }),
    ("compression of wefts", |s, on| {
        (s.own.parameters.compression[1], s.density) = (if on { 1.0 } else { 1e-3 }, -1e-3);
    }),
    ("bending", |s, on| {
        s.physics.bending = if on { Bending::Yarns } else { Bending::Off };
    }),
    ("shear", |s, on| s.physics.shear = on),
    ("locking", |s, on| {
        s.own.parameters.shear = [0.05; 2];
        (s.physics.shear, s.physics.shear_locking) = (true, on);
    }),
    // What was pulled beyond it in the substep before.
    ("knee", |s, on| {
        (s.own.parameters.areal_mass, s.density) = (100.0, 60.0);
        s.physics.tension = on.then_some(Tension::Material);
    }),
    ("limit", |s, on| {
        (s.own.parameters.areal_mass, s.density) = (100.0, 60.0);
        s.physics.strain_limit = on.then_some(1e-3);
    }),
    ("contact", |s, on| s.own.tool = if on { 0 } else { 1 }),
    ("friction", |s, on| {
        (s.own.tool, s.physics.friction) = (0, on)
    }),
    // It holds by friction.
    ("tack", |s, on| {
        (s.own.tool, s.physics.friction) = (0, true);
        s.physics.adhesion = if on { 50.0 } else { 0.0 };
    }),
    ("roller", |s, on| (s.own.tool, s.pressed) = (0, on)),
    ("grip", |s, on| {
        (s.own.tool, s.pressed, s.physics.friction) = (0, true, on)
    }),
];

/// Of the yarn solver alone.
const LASTING: Stage = ("forces that last", |s, on| {
    (s.own.parameters.tension, s.own.parameters.compression) = ([1.0; 2], [1.0; 2]);
    s.density = if on { 60.0 } else { 0.0 };
});

/// Everything at once, as scenes have it.
const ALL: Stage = ("all", |s, on| {
    let solver = s.physics.solver;
    if on {
        s.physics = PhysicsConfig {
            solver,
            shear_locking: true,
            adhesion: 1.0,
            ..PhysicsConfig::default()
        };
        (s.own, s.density, s.pressed) = (Own::default(), 5.0, true);
    }
});

fn stages() -> impl Iterator<Item = (Solver, Stage)> {
    let yarn = STAGES.into_iter().chain([LASTING, ALL]);
    let yarn = yarn.map(|stage| (Solver::Yarn, stage));
    yarn.chain(
        STAGES
            .into_iter()
            .chain([ALL])
            .map(|stage| (Solver::GaussSeidel, stage)),
    )
}

/// What a device makes of a setting in one substep; none where it does not compute it.
fn end(make: &Make, setting: &Setting) -> Option<Snapshot> {
    let mut lamina = Lamina::new(&BLANK, Material::interglas_92125()).unwrap();
    lamina.material.shear.locking = Some(ShearLocking {
        angle_rad: 0.1,
        stiffening: 20.0,
    });
    let mut world = World::new(Model::new(&lamina, &setting.physics), TOOLS[0].clone());
    let far = ToolConfig {
        source: Source::Shape(Shape::Plate(Plate::default())),
        grid: GridConfig {
            spacing_mm: Some(20.0),
            ..GridConfig::default()
        },
        ..ToolConfig::default()
    };
    world.tools.push(Tool::new(&far).unwrap().into());
    // Stretched here and pushed together there, sheared and in waves; some of it is in the dome, and all of it
    // slides.
    let place = |&[x, y]: &[f64; 2]| {
        let wave = 0.003 * (90.0 * x).sin() * (70.0 * y).cos();
        let on_dome = (0.06f64.powi(2) - x * x - y * y).max(0.0).sqrt();
        let [x, y] = [
            x + 8e-4 * (150.0 * x).sin() + 0.15 * y,
            y + 8e-4 * (150.0 * y).sin(),
        ];
        [x, y, on_dome.max(0.052) + 2e-4 + wave]
    };
    let mut state = Snapshot::at_rest(lamina.rest.iter().map(place).collect());
    for (v, velocity) in state.velocity.iter_mut().enumerate() {
        *velocity = [0.6, 0.3, -0.4 - 0.01 * (v % 7) as f64];
    }
    let numbers = state.position.iter_mut().chain(&mut state.velocity);
    numbers.flatten().for_each(|x| *x = f64::from(*x as f32));
    if setting.physics.solver == Solver::Yarn {
        let edges = lamina
            .yarns
            .iter()
            .map(|yarn| yarn.vertices.len() - 1)
            .sum();
        state.force_density = vec![setting.density; edges];
    }
    state.own = setting.own.clone();
    let mut backend = make(&world, 1)?;
    backend.load(0, &state);
    let pressed: Vec<u32> = (40..110).collect();
    let press = ROLLER.press(0, &pressed, &[3e-4; 154]);
    let presses = if setting.pressed {
        vec![press]
    } else {
        Vec::new()
    };
    backend.step(&SUBSTEP, &presses);
    Some(backend.snapshot(0))
}

/// Greatest difference of a place, or of what a velocity makes of it in the next substep [m].
fn apart(a: &Snapshot, b: &Snapshot) -> f64 {
    let pairs = a.velocity.iter().flatten().zip(b.velocity.iter().flatten());
    let faster = pairs.map(|(a, b)| SUBSTEP.dt * (a - b).abs());
    faster.fold(furthest(a, b), f64::max)
}

fn reference(world: &World, count: usize) -> Option<Box<dyn Backend>> {
    Some(Box::new(Cpu::on(
        world,
        count,
        Precision::F32,
        Isa::Portable,
    )))
}

pub fn stages_are_those_of_the_reference(device: &Device) {
    for (solver, (name, stage)) in stages() {
        let mut setting = nothing(solver);
        stage(&mut setting, true);
        let found = end(&device.make, &setting).expect("every device has these stages");
        let off = apart(&found, &end(&reference, &setting).unwrap());
        assert!(off <= TOLERANCE, "{name} of {solver:?}: {off:e} m");
    }
}

/// A stage that did nothing here would be held against nothing.
#[test]
fn stages_are_at_work() {
    for (solver, (name, stage)) in stages() {
        let [without, with] = [false, true].map(|on| {
            let mut setting = nothing(solver);
            stage(&mut setting, on);
            end(&reference, &setting).unwrap()
        });
        let effect = apart(&with, &without);
        assert!(effect > EFFECT, "{name} of {solver:?}: {effect:e} m");
    }
}
