//! One suite for all backends: every instruction set that this processor has, one lane of f32,
//! f64, and one environment with its lines side by side in the lanes.
//!
//! The cases differ in every lane, so that a lane which reads its neighbour is found, and the
//! presses are in some lanes only.

use std::sync::LazyLock;

use drape_cloth::fabric::{BlankConfig, Lamina, MassModel, Material};
use drape_cloth::math::{Isa, Lanes, Purpose, Stream};
use drape_cloth::sim::{
    Batch, Bending, Control, Cpu, Model, PhysicsConfig, Press, SelfCollision, Snapshot, Solver,
    Tension, alone_f64, batch,
};
use drape_cloth::tool::{GridConfig, Hemisphere, Shape, Source, Tool, ToolConfig};

const CONTROL: Control = Control {
    dt: 1.0 / 60.0,
    substeps: 20,
    contact_interval: 5,
};

/// As many as the widest instruction set has lanes.
const CASES: usize = 16;

static TOOL: LazyLock<Tool> = LazyLock::new(|| {
    let dome = Hemisphere {
        radius_mm: 60.0,
        ..Hemisphere::default()
    };
    Tool::new(&ToolConfig {
        source: Source::Shape(Shape::Hemisphere(dome)),
        grid: GridConfig {
            spacing_mm: 8.0,
            ..GridConfig::default()
        },
        ..ToolConfig::default()
    })
    .unwrap()
});

const BLANK: BlankConfig = BlankConfig {
    size_mm: [200.0, 160.0],
    vertices: [14, 11],
    mass: MassModel::Paper,
    outline: None,
    cell_mm: None,
    yarn_angle_deg: 0.0,
};

static LAMINA: LazyLock<Lamina> =
    LazyLock::new(|| Lamina::new(&BLANK, Material::interglas_92125()).unwrap());

/// A model and the blank that it is of.
struct Cloth {
    lamina: Lamina,
    model: Model,
}

impl Cloth {
    fn new(lamina: &Lamina, physics: &PhysicsConfig) -> Self {
        Self {
            lamina: lamina.clone(),
            model: Model::new(lamina, physics),
        }
    }
}

impl std::ops::Deref for Cloth {
    type Target = Model;

    fn deref(&self) -> &Model {
        &self.model
    }
}

/// Every combination of passes that a scene can list.
static MODELS: LazyLock<Vec<Cloth>> = LazyLock::new(|| {
    let mut models = Vec::new();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for bending in [Bending::Yarns, Bending::Dihedral] {
            models.push(Cloth::new(
                &LAMINA,
                &PhysicsConfig {
                    solver,
                    bending,
                    ..PhysicsConfig::default()
                },
            ));
        }
    }
    // Membranes all over, on the same vertices.
    let blank = BlankConfig {
        yarn_angle_deg: 30.0,
        ..BLANK
    };
    let oblique = Lamina::of_membranes(&blank, Material::interglas_92125()).unwrap();
    models.push(Cloth::new(&oblique, &PhysicsConfig::default()));
    // Halves of cells all round, beside yarns.
    let bias = BlankConfig {
        size_mm: [200.0, 200.0],
        cell_mm: Some(20.0 / 2f64.sqrt()),
        yarn_angle_deg: 45.0,
        ..BLANK
    };
    let bias = Lamina::new(&bias, Material::interglas_92125()).unwrap();
    assert!(!bias.membranes.is_empty() && bias.membranes.iter().all(|m| m.has_yarns));
    models.push(Cloth::new(&bias, &PhysicsConfig::default()));
    models.push(Cloth::new(
        &LAMINA,
        &PhysicsConfig {
            self_collision: SelfCollision::Material,
            ..PhysicsConfig::default()
        },
    ));
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let physics = PhysicsConfig {
            solver,
            adhesion: 1.0,
            strain_limit: Some(1e-3),
            ..PhysicsConfig::default()
        };
        models.push(Cloth::new(&LAMINA, &physics));
        let physics = PhysicsConfig {
            solver,
            tension: Tension::Material,
            ..PhysicsConfig::default()
        };
        models.push(Cloth::new(&LAMINA, &physics));
    }
    models
});

/// A buckled sheet that falls on the dome, another in every case; in some it is clamped.
fn case(model: &Cloth, index: usize) -> Snapshot {
    let lamina = &model.lamina;
    let mut stream = Stream::new(3, Purpose::Evaluation, index as u32);
    let phase = stream.uniform();
    let height = 0.0602 + 0.002 * stream.uniform();
    let count = lamina.vertex_count();
    let mut state = Snapshot {
        position: lamina
            .rest
            .iter()
            .map(|[x, y]| [*x, *y, height + 0.004 * (40.0 * x + 6.0 * phase).sin()])
            .collect(),
        velocity: (0..count)
            .map(|_| [0.1 * stream.normal(), 0.1 * stream.normal(), -0.5])
            .collect(),
        fixed: fixedbitset::FixedBitSet::with_capacity(count),
        force_density: Vec::new(),
        sides: Vec::new(),
    };
    for _ in 0..index % 4 {
        let vertex = stream.below(count);
        state.fixed.insert(vertex);
        state.velocity[vertex] = [0.0, 0.05, 0.0];
    }
    round(&mut state);
    state
}

/// Rounds a state to f32, so that every backend starts from the same.
fn round(state: &mut Snapshot) {
    for x in state
        .position
        .iter_mut()
        .chain(&mut state.velocity)
        .flatten()
    {
        *x = f64::from(*x as f32);
    }
}

/// A stencil over a third of the sheet, in every other case.
fn press(index: usize, lane: usize) -> Option<Press> {
    let first = 40 + index as u32;
    index.is_multiple_of(2).then(|| Press {
        lane,
        vertices: vec![first, first + 1, first + 14, first + 15],
        height: 0.006,
        descent: 10,
    })
}

/// Takes `steps` control steps with `cases` in the lanes, and presses in the second.
fn run(batch: &mut dyn Batch, model: &Cloth, cases: &[usize], steps: usize) -> Vec<Snapshot> {
    for (lane, &index) in cases.iter().enumerate() {
        batch.load(lane, &case(model, index));
    }
    advance(batch, model, cases, 0..steps);
    (0..cases.len()).map(|lane| batch.snapshot(lane)).collect()
}

fn advance(batch: &mut dyn Batch, model: &Cloth, cases: &[usize], steps: std::ops::Range<usize>) {
    let presses: Vec<Press> = cases
        .iter()
        .enumerate()
        .filter_map(|(lane, &index)| press(index, lane))
        .collect();
    for step in steps {
        let presses = if step == 1 { &presses[..] } else { &[] };
        batch.step(model, &TOOL, &CONTROL, presses);
    }
}

/// The bits of a state; NaN equals itself.
fn bits(state: &Snapshot) -> Vec<u64> {
    let numbers = state.position.iter().chain(&state.velocity).flatten();
    let numbers = numbers.chain(&state.force_density);
    let fixed = state.fixed.ones().map(|v| v as u64);
    numbers.map(|x| x.to_bits()).chain(fixed).collect()
}

/// What one lane of f32 makes of every case, alone.
fn alone(model: &Cloth, steps: usize) -> Vec<Snapshot> {
    (0..CASES)
        .map(|index| run(&mut Cpu::<f32>::new(model), model, &[index], steps).remove(0))
        .collect()
}

fn furthest(a: &Snapshot, b: &Snapshot) -> f64 {
    let pairs = a.position.iter().flatten().zip(b.position.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn every_lane_is_computed_as_if_alone(isa: Isa) {
    for model in MODELS.iter() {
        let expected = alone(model, 4);
        // Groups narrower than the number of cases take them in turn.
        for first in (0..CASES).step_by(isa.lanes()) {
            let cases: Vec<usize> = (first..first + isa.lanes()).collect();
            let mut batch = batch(model, isa);
            assert_eq!(batch.lanes(), isa.lanes());
            let found = run(&mut *batch, model, &cases, 4);
            for (&index, found) in cases.iter().zip(&found) {
                assert!(found.is_finite(), "{:?}", model.physics());
                assert!(
                    bits(found) == bits(&expected[index]),
                    "case {index} on {isa:?} is off by {:e} m with {:?}",
                    furthest(found, &expected[index]),
                    model.physics(),
                );
            }
        }
    }
}

/// NaN and infinity in one lane, a runaway in another: both say so, and no other lane
/// changes by a bit.
fn lost_lane_leaves_its_neighbours_alone(isa: Isa) {
    for model in MODELS.iter() {
        let cases: Vec<usize> = (0..isa.lanes()).collect();
        let expected = run(&mut *batch(model, isa), model, &cases, 3);
        let mut batch = batch(model, isa);
        run(&mut *batch, model, &cases, 1);
        let mut lost = case(model, 3);
        lost.position[30] = [f64::NAN, f64::INFINITY, 0.0];
        batch.load(3, &lost);
        lost = case(model, 5);
        lost.position[7][2] = 1e30;
        batch.load(5, &lost);
        assert!(!batch.sound()[3] && !batch.sound()[5]);
        advance(&mut *batch, model, &cases, 1..3);
        for lane in cases {
            let sound = lane != 3 && lane != 5;
            assert_eq!(batch.sound()[lane], sound, "lane {lane}");
            if sound {
                let found = batch.snapshot(lane);
                assert!(
                    bits(&found) == bits(&expected[lane]),
                    "lane {lane} on {isa:?}"
                );
            }
        }
    }
}

/// A state that is loaded into a batch which did something else before goes on as it does in a
/// new one.
fn loading_forgets_what_was_before(mut make: impl FnMut(&Model) -> Box<dyn Batch>, solver: Solver) {
    for model in of(solver) {
        let mut new = make(model);
        let cases: Vec<usize> = (0..new.lanes()).collect();
        let expected = run(&mut *new, model, &cases, 2);
        // Every lane holds the state of another case first.
        let others: Vec<usize> = cases.iter().map(|c| (c + 5) % CASES).collect();
        let mut used = make(model);
        run(&mut *used, model, &others, 3);
        let found = run(&mut *used, model, &cases, 2);
        all_equal(&found, &expected, model);
    }
}

/// A snapshot holds all that moves: loaded into another batch, it goes on as if it had never
/// been taken.
fn snapshot_goes_on_exactly(mut make: impl FnMut(&Model) -> Box<dyn Batch>, solver: Solver) {
    for model in of(solver) {
        let mut whole = make(model);
        let cases: Vec<usize> = (0..whole.lanes()).collect();
        let expected = run(&mut *whole, model, &cases, 4);
        let halfway = run(&mut *make(model), model, &cases, 2);
        let mut again = make(model);
        for (lane, state) in halfway.iter().enumerate() {
            again.load(lane, state);
            assert!(bits(&again.snapshot(lane)) == bits(state), "lane {lane}");
        }
        advance(&mut *again, model, &cases, 2..4);
        let found: Vec<_> = cases.iter().map(|&lane| again.snapshot(lane)).collect();
        all_equal(&found, &expected, model);
    }
}

fn of(solver: Solver) -> impl Iterator<Item = &'static Cloth> {
    MODELS.iter().filter(move |m| m.physics().solver == solver)
}

#[track_caller]
fn all_equal(found: &[Snapshot], expected: &[Snapshot], model: &Cloth) {
    for (lane, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(
            bits(found) == bits(expected),
            "lane {lane} is off by {:e} m with {:?}",
            furthest(found, expected),
            model.physics(),
        );
    }
}

/// Fixed vertices move with the velocity they have, to the rounding of the sum, and nothing
/// else moves them: neither yarns nor tool nor stencil. Vertices that are fixed on the way
/// stop for good.
fn fixed_vertices_obey_nothing(mut batch: Box<dyn Batch>, model: &Cloth, rounding: f64) {
    let cases: Vec<usize> = (0..batch.lanes()).map(|lane| lane % CASES).collect();
    run(&mut *batch, model, &cases, 2);
    for (lane, &index) in cases.iter().enumerate() {
        let start = case(model, index);
        for vertex in start.fixed.ones() {
            let found = batch.position(lane, vertex as u32);
            for (k, found) in found.into_iter().enumerate() {
                let way = start.velocity[vertex][k] * 2.0 * CONTROL.dt;
                let off = found - start.position[vertex][k] - way;
                assert!(off.abs() <= rounding, "vertex {vertex} is {off:e} m off");
            }
        }
    }
    // Under the stencil, and at a corner.
    for vertex in [0, 42, 55] {
        let before: Vec<_> = (0..cases.len())
            .map(|l| batch.position(l, vertex))
            .collect();
        for lane in 0..cases.len() {
            batch.fix(lane, vertex);
        }
        advance(&mut *batch, model, &cases, 1..3);
        for (lane, before) in before.iter().enumerate() {
            assert_eq!(batch.position(lane, vertex), *before, "lane {lane}");
            let after = batch.snapshot(lane);
            assert!(after.fixed.contains(vertex as usize));
            assert_eq!(after.velocity[vertex as usize], [0.0; 3]);
        }
    }
}

/// A press moves its own lane and no other.
fn presses_stay_in_their_lanes(isa: Isa) {
    let model = &MODELS[0];
    let step = |presses: &[Press]| {
        let mut batch = batch(model, isa);
        for lane in 0..isa.lanes() {
            batch.load(lane, &case(model, lane));
        }
        batch.step(model, &TOOL, &CONTROL, presses);
        (0..isa.lanes())
            .map(|l| batch.snapshot(l))
            .collect::<Vec<_>>()
    };
    let free = step(&[]);
    let pressed = step(&[press(6, 6).unwrap()]);
    for lane in 0..isa.lanes() {
        let same = bits(&free[lane]) == bits(&pressed[lane]);
        assert_eq!(same, lane != 6, "lane {lane} on {isa:?}");
    }
}

macro_rules! suite {
    ($($name:ident: $isa:expr;)+) => {$(
        mod $name {
            use super::*;

            #[test]
            fn every_lane_is_computed_as_if_alone() {
                super::every_lane_is_computed_as_if_alone($isa);
            }

            #[test]
            fn lost_lane_leaves_its_neighbours_alone() {
                super::lost_lane_leaves_its_neighbours_alone($isa);
            }

            #[test]
            fn snapshot_goes_on_exactly() {
                super::snapshot_goes_on_exactly(|model| batch(model, $isa), Solver::GaussSeidel);
            }

            #[test]
            fn snapshot_goes_on_exactly_with_yarns() {
                super::snapshot_goes_on_exactly(|model| batch(model, $isa), Solver::Yarn);
            }

            #[test]
            fn loading_forgets_what_was_before() {
                super::loading_forgets_what_was_before(|model| batch(model, $isa), Solver::GaussSeidel);
            }

            #[test]
            fn loading_forgets_what_was_before_with_yarns() {
                super::loading_forgets_what_was_before(|model| batch(model, $isa), Solver::Yarn);
            }

            #[test]
            fn fixed_vertices_obey_nothing() {
                for model in MODELS.iter() {
                    super::fixed_vertices_obey_nothing(batch(model, $isa), model, 1e-6);
                }
            }

            #[test]
            fn presses_stay_in_their_lanes() {
                super::presses_stay_in_their_lanes($isa);
            }
        }
    )+};
}

suite! {
    portable: Isa::Portable;
    widest: Isa::best();
}

#[test]
fn every_instruction_set_of_this_processor_gives_the_same_bits() {
    for isa in Isa::available() {
        every_lane_is_computed_as_if_alone(isa);
    }
}

/// A plain blank, in which lines fill all lanes and more, and one whose yarns end at holes.
static LARGE: LazyLock<[Cloth; 2]> = LazyLock::new(|| {
    let plain = BlankConfig {
        vertices: [38, 35],
        ..BLANK
    };
    let holed = BlankConfig {
        outline: Some(
            concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../assets/outlines/plate-with-hole.csv"
            )
            .into(),
        ),
        cell_mm: Some(8.0),
        yarn_angle_deg: 20.0,
        ..BlankConfig::default()
    };
    [plain, holed].map(|blank| {
        let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
        Cloth::new(&lamina, &PhysicsConfig::default())
    })
});

/// The state of a case on `lamina` after some control steps, the second under a stencil.
fn end(mut batch: Box<dyn Batch>, model: &Cloth, index: usize) -> Snapshot {
    batch.load(0, &case(model, index));
    advance(&mut *batch, model, &[index], 0..4);
    batch.snapshot(0)
}

/// One environment whose lines are solved side by side is computed as one lane, whatever the
/// width of the lanes and the shape of the blank.
#[test]
fn lines_side_by_side_give_the_same_bits() {
    for model in MODELS.iter().chain(&*LARGE) {
        for index in [1, 2, 6] {
            let single = end(Box::new(Cpu::<f32>::new(model)), model, index);
            let double = end(Box::new(Cpu::<f64>::new(model)), model, index);
            assert!(single.is_finite() && double.is_finite());
            for isa in Isa::available() {
                for (found, expected) in [
                    (drape_cloth::sim::alone(model, isa), &single),
                    (alone_f64(model, isa), &double),
                ] {
                    let found = end(found, model, index);
                    assert!(
                        bits(&found) == bits(expected),
                        "case {index} on {isa:?} is off by {:e} m with {:?}",
                        furthest(&found, expected),
                        model.physics(),
                    );
                }
            }
        }
    }
}

/// What was lost before leaves no trace in a state that is loaded after it.
#[test]
fn lines_side_by_side_forget_a_lost_state() {
    for model in LARGE.iter() {
        for isa in Isa::available() {
            let expected = end(drape_cloth::sim::alone(model, isa), model, 2);
            let mut used = drape_cloth::sim::alone(model, isa);
            let mut lost = case(model, 1);
            lost.position[30] = [f64::NAN, f64::INFINITY, 0.0];
            used.load(0, &lost);
            advance(&mut *used, model, &[1], 0..1);
            assert!(!used.sound()[0]);
            assert!(bits(&end(used, model, 2)) == bits(&expected));
        }
    }
}

#[test]
fn scalar_backends_go_on_from_a_snapshot() {
    snapshot_goes_on_exactly(
        |model| Box::new(Cpu::<f32>::new(model)),
        Solver::GaussSeidel,
    );
    snapshot_goes_on_exactly(
        |model| Box::new(Cpu::<f64>::new(model)),
        Solver::GaussSeidel,
    );
}

#[test]
fn scalar_backends_go_on_from_a_snapshot_with_yarns() {
    snapshot_goes_on_exactly(|model| Box::new(Cpu::<f32>::new(model)), Solver::Yarn);
    snapshot_goes_on_exactly(|model| Box::new(Cpu::<f64>::new(model)), Solver::Yarn);
}

#[test]
fn lines_side_by_side_go_on_from_a_snapshot() {
    for isa in Isa::available() {
        snapshot_goes_on_exactly(|model| drape_cloth::sim::alone(model, isa), Solver::Yarn);
        snapshot_goes_on_exactly(|model| alone_f64(model, isa), Solver::Yarn);
    }
}

#[test]
fn fixed_vertices_obey_nothing_in_f64() {
    for model in MODELS.iter() {
        fixed_vertices_obey_nothing(alone_f64(model, Isa::best()), model, 1e-15);
        fixed_vertices_obey_nothing(Box::new(Cpu::<f64>::new(model)), model, 1e-15);
    }
}

/// What rounding may do in a frame [m].
const AIR: f64 = 2e-5;

/// Off the tool, where no contact decides: after one frame the two differ by rounding.
#[test]
fn f32_follows_f64_in_the_air() {
    fn flown<V: Lanes>(model: &Cloth, index: usize) -> Snapshot {
        let mut state = case(model, index);
        for x in &mut state.position {
            x[2] += 0.3;
        }
        let mut batch = Cpu::<V>::new(model);
        batch.load(0, &state);
        batch.step(model, &TOOL, &CONTROL, &[]);
        batch.snapshot(0)
    }
    for model in MODELS.iter() {
        for index in 0..CASES {
            let off = furthest(&flown::<f32>(model, index), &flown::<f64>(model, index));
            assert!(off <= AIR, "case {index}: {off:e} m, {:?}", model.physics());
        }
    }
}

/// After one frame the two differ by rounding, enlarged where it decides: on which side of a
/// cell's border a vertex looks up the tool's normal, whether it sticks, which branch an edge
/// takes. The yarns' forces carry it on: after some frames a buckled sheet may have fallen
/// another way, so they are compared after one.
#[test]
fn f32_follows_f64() {
    for model in MODELS.iter() {
        let tolerances: &[(usize, f64)] = match model.physics().solver {
            Solver::GaussSeidel if model.physics().adhesion == 0.0 => &[(1, 2e-4), (4, 1e-3)],
            _ => &[(1, 2e-3)],
        };
        for index in 0..CASES {
            for &(steps, tolerance) in tolerances {
                let single = &run(&mut Cpu::<f32>::new(model), model, &[index], steps)[0];
                let double = &run(&mut Cpu::<f64>::new(model), model, &[index], steps)[0];
                let off = furthest(single, double);
                assert!(
                    off <= tolerance,
                    "case {index} is {off:e} m off after {steps} frames: {:?}",
                    model.physics()
                );
            }
        }
    }
}
