//! Layers of cloth on each other: a wrinkle that is pressed flat stays a fold.

use std::sync::LazyLock;

use drape_cloth::fabric::{BlankConfig, Lamina, Material};
use drape_cloth::sim::{
    Backend, Control, Cpu, Model, PhysicsConfig, Precision, Press, Roller, SelfCollision, Snapshot,
    Solver, World,
};
use drape_cloth::tool::{Plate, Shape, Source, Tool, ToolConfig};

const CONTROL: Control = Control {
    dt: 1.0 / 60.0,
    substeps: 20,
    contact_interval: 5,
    sweeps: 1,
};

static TOOL: LazyLock<Tool> = LazyLock::new(|| {
    let plate = Plate::default();
    Tool::new(&ToolConfig {
        source: Source::Shape(Shape::Plate(plate)),
        ..ToolConfig::default()
    })
    .unwrap()
});

/// A strip of 240 x 60 mm with cells of 5 mm.
static STRIP: LazyLock<Lamina> = LazyLock::new(|| {
    let blank = BlankConfig {
        size_mm: [240.0, 60.0],
        vertices: [49, 13],
        ..BlankConfig::default()
    };
    Lamina::new(&blank, Material::interglas_92125()).unwrap()
});

fn world(self_collision: SelfCollision) -> World {
    let physics = PhysicsConfig {
        self_collision,
        ..PhysicsConfig::default()
    };
    World::new(Model::new(&STRIP, &physics), TOOL.clone())
}

/// A wrinkle over the whole width that leans to +x: the strip lies flat, goes up a leg of
/// 50 mm at 60 degrees, round a half circle, down another and lies flat again.
fn wrinkle() -> Snapshot {
    let (leg, radius) = (0.050, 0.007);
    let angle = 60f64.to_radians();
    let along = [angle.cos(), angle.sin()];
    let right = [angle.sin(), -angle.cos()];
    let arc = std::f64::consts::PI * radius;
    let profile = |s: f64| -> [f64; 2] {
        let s = s - 0.060;
        let top = [leg * along[0], leg * along[1]];
        let foot = 2.0 * radius / right[0];
        let slope = foot * along[0];
        if s < 0.0 {
            [s, 0.0]
        } else if s < leg {
            [s * along[0], s * along[1]]
        } else if s < leg + arc {
            let turn = (s - leg) / radius;
            let (a, b) = (radius * turn.sin(), radius * (1.0 - turn.cos()));
            std::array::from_fn(|k| top[k] + a * along[k] + b * right[k])
        } else {
            // The right leg is longer, as it starts below the left one's foot.
            let s = s - leg - arc;
            let length = leg - slope;
            let down = s.min(length);
            let start: [f64; 2] = std::array::from_fn(|k| top[k] + 2.0 * radius * right[k]);
            let flat = (s - length).max(0.0);
            [
                start[0] - down * along[0] + flat,
                start[1] - down * along[1],
            ]
        }
    };
    let position = STRIP.rest.iter().map(|[u, v]| {
        let [x, z] = profile(u + 0.120);
        [x, *v, z.max(0.0) + 0.0005]
    });
    Snapshot::at_rest(position.collect())
}

fn crossings(state: &Snapshot) -> usize {
    STRIP.mesh(&state.position).self_intersection_count()
}

/// Frames in which a roller that sinks with 0.25 m/s presses the whole strip flat.
const FLAT: usize = 24;

/// Frames after which its legs have met.
const MET: usize = 16;

/// Some frames under such a roller.
fn press(batch: &mut dyn Backend, frames: usize) {
    let roller = Roller {
        pressure: 1e6,
        speed: 0.25,
    };
    let all: Vec<u32> = (0..STRIP.vertex_count() as u32).collect();
    let press = |environment| roller.press(environment, &all, &STRIP.vertex_areas());
    let presses: Vec<Press> = (0..batch.count()).map(press).collect();
    for _ in 0..frames {
        batch.step(&CONTROL, &presses);
    }
}

fn pressed(collision: SelfCollision, frames: usize) -> Snapshot {
    let mut batch = Cpu::new(&world(collision), 1, Precision::F32);
    batch.load(0, &wrinkle());
    press(&mut batch, frames);
    batch.snapshot(0)
}

#[test]
fn pressed_wrinkle_stays_a_fold_with_self_collision_only() {
    assert_eq!(crossings(&wrinkle()), 0);
    assert!(crossings(&pressed(SelfCollision::Off, FLAT)) > 100);
    let state = pressed(SelfCollision::Material, FLAT);
    assert_eq!(crossings(&state), 0);
    assert!(state.is_finite());
    let top = state.position.iter().map(|x| x[2]).fold(0.0, f64::max);
    assert!(top < 0.002, "the plate is down: {top}");
    // Whichever way the loop has gone, cloth lies on cloth, a thickness or two above the tool.
    let stacked = state
        .position
        .iter()
        .filter(|x| x[2] > 0.9 * 0.35e-3)
        .count();
    assert!(stacked > STRIP.vertex_count() / 10, "{stacked}");
}

/// A strip folded over itself falls on itself: its free end comes to rest one thickness over
/// the layer beneath.
#[test]
fn layers_rest_one_thickness_apart() {
    let radius = 0.005;
    let quarter = 0.5 * std::f64::consts::PI * radius;
    let mut state = wrinkle();
    for (x, [u, v]) in state.position.iter_mut().zip(&STRIP.rest) {
        let (along, up) = if u.abs() < quarter {
            let (sin, cos) = (u / radius).sin_cos();
            (radius * cos, radius * sin)
        } else {
            (quarter - u.abs(), radius * u.signum())
        };
        *x = [along, *v, radius + 0.0005 + up];
    }
    let world = world(SelfCollision::Material);
    let mut batch = Cpu::new(&world, 1, Precision::F64);
    batch.load(0, &state);
    for _ in 0..90 {
        batch.step(&CONTROL, &[]);
    }
    let state = batch.snapshot(0);
    assert_eq!(crossings(&state), 0);
    for row in 2..11 {
        let [lower, upper] = [3, 45].map(|column| state.position[row * 49 + column][2]);
        let apart = (upper - lower) / 0.35e-3;
        assert!(
            (0.8..1.2).contains(&apart),
            "row {row}: {apart} thicknesses"
        );
    }
}

/// Saved and loaded halfway, in wide lanes and alone: the same bits, and each lane its own.
#[test]
fn contacts_are_remembered_exactly_and_lane_by_lane() {
    let world = world(SelfCollision::Material);
    let mut wide = Cpu::new(
        &world,
        drape_cloth::math::Isa::best().lanes(),
        Precision::F32,
    );
    let start = |lane: usize| {
        let mut state = wrinkle();
        for x in &mut state.position {
            x[0] += 0.001 * lane as f64;
            x[2] *= 1.0 - 0.01 * lane as f64;
            *x = x.map(|x| f64::from(x as f32));
        }
        state
    };
    for lane in 0..wide.count() {
        wide.load(lane, &start(lane));
    }
    // Until the legs have met: without contact they would have crossed.
    assert!(crossings(&pressed(SelfCollision::Off, MET)) > 0);
    press(&mut wide, MET);
    let halfway: Vec<Snapshot> = (0..wide.count()).map(|l| wide.snapshot(l)).collect();
    press(&mut wide, 4);
    for lane in [0, wide.count() - 1] {
        let mut alone = Cpu::new(&world, 1, Precision::F32);
        alone.load(0, &start(lane));
        press(&mut alone, MET);
        assert!(!halfway[lane].sides.is_empty());
        assert!(alone.snapshot(0) == halfway[lane], "lane {lane}");
        let mut again = Cpu::new(&world, 1, Precision::F32);
        again.load(0, &halfway[lane]);
        press(&mut again, 4);
        assert!(again.snapshot(0) == wide.snapshot(lane), "lane {lane}");
    }
}

/// Fixed layers keep their place, and nothing becomes NaN where all is one point, or random.
#[test]
fn fixed_collapsed_and_random_cloth_stays_finite() {
    let world = world(SelfCollision::Material);
    let mut fixed = pressed(SelfCollision::Material, FLAT);
    fixed.fixed.insert_range(..);
    fixed.velocity.fill([0.0; 3]);
    let mut point = wrinkle();
    point.position.fill([0.0, 0.0, 0.01]);
    let mut random = wrinkle();
    let mut stream = drape_cloth::math::Stream::new(1, drape_cloth::math::Purpose::Evaluation, 0);
    for x in &mut random.position {
        *x = [0.05 * stream.normal(), 0.05 * stream.normal(), 0.05];
    }
    for state in [&fixed, &point, &random] {
        let mut batch = Cpu::new(&world, 1, Precision::F64);
        batch.load(0, state);
        batch.step(&CONTROL, &[]);
        let after = batch.snapshot(0);
        assert!(after.is_finite());
        if state.fixed.count_ones(..) > 0 {
            assert!(after.position == state.position);
        }
    }
}

/// Without gravity, tool and friction a wrinkle that is driven together keeps its momentum.
#[test]
fn contact_keeps_the_momentum() {
    // By Gauss-Seidel, which keeps it too; yarns that pull hard do not, when solved along lines.
    let physics = PhysicsConfig {
        solver: Solver::GaussSeidel,
        self_collision: SelfCollision::Material,
        gravity: 0.0,
        damping: 0.0,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    };
    let world = World::new(Model::new(&STRIP, &physics), TOOL.clone());
    let mut state = wrinkle();
    for (index, x) in state.position.iter_mut().enumerate() {
        x[2] += 0.2;
        // The legs clap together.
        let speed = match index % STRIP.columns {
            12..=21 => 1.0,
            23..=31 => -1.0,
            _ => 0.0,
        };
        state.velocity[index][0] = speed;
    }
    let momentum = |state: &Snapshot| -> [f64; 3] {
        std::array::from_fn(|k| {
            let of = STRIP.mass.iter().zip(&state.velocity);
            of.map(|(m, v)| m * v[k]).sum()
        })
    };
    let mut batch = Cpu::new(&world, 1, Precision::F64);
    batch.load(0, &state);
    let before = momentum(&state);
    let mut met = 0;
    for _ in 0..6 {
        batch.step(&CONTROL, &[]);
        met = met.max(batch.snapshot(0).sides.len());
    }
    let after = momentum(&batch.snapshot(0));
    assert!(met > 0, "the legs meet");
    let total: f64 = STRIP.mass.iter().sum();
    for k in 0..3 {
        assert!(
            (after[k] - before[k]).abs() < 1e-9 * total,
            "{before:?} {after:?}"
        );
    }
}

#[test]
fn thickness_that_does_not_fit_the_cells_is_refused() {
    let error = SelfCollision::ThicknessMm(8.0).check(&STRIP).unwrap_err();
    assert_eq!(
        error.to_string(),
        "`physics.self_collision` is a thickness of 8 mm on cells of 5.000 mm, \
         expected a thickness of at most half a cell"
    );
    let negative = PhysicsConfig {
        self_collision: SelfCollision::ThicknessMm(-1.0),
        ..PhysicsConfig::default()
    };
    assert_eq!(
        negative.check().unwrap_err().to_string(),
        "`physics.self_collision.thickness_mm` is -1, expected a number > 0"
    );
    assert!(SelfCollision::Material.check(&STRIP).is_ok());
}
