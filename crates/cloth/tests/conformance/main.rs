//! One suite for all backends. A backend is a [`Device`]: how it is made, and how far it may be
//! off the reference, which is one environment at a time on plain code.
//!
//! The cases differ in every environment, so that one which reads its neighbour is found, and the
//! presses are in some environments only. Their number leaves a group of lanes partly empty.

mod stages;

use std::sync::{Arc, LazyLock};

use drape_cloth::fabric::{BlankConfig, Curve, Lamina, MassModel, Material, ShearLocking};
use drape_cloth::math::{Isa, Purpose, Stream};
use drape_cloth::measure::Measures;
use drape_cloth::sim::{
    ALLOWED, Backend, Bending, BendingStiffness, Control, Cpu, DRAPED, Mask, Model, Own,
    Parameters, PhysicsConfig, Precision, Press, Roller, STENCIL, SelfCollision, Snapshot, Solver,
    Stencil, TOUCHED, Tension, View, World,
};
#[cfg(feature = "gpu")]
use drape_cloth::sim::{Adapter, AdapterKind, DeviceError, Gpu};
use drape_cloth::tool::{GridConfig, Hemisphere, Plate, Pose, Shape, Source, Tool, ToolConfig};

const CONTROL: Control = Control {
    dt: 1.0 / 60.0,
    substeps: 20,
    contact_interval: 5,
    sweeps: 1,
};

/// One more than the widest instruction set has lanes.
const CASES: usize = 17;

/// Makes so many environments of a world; none of one that the device refuses.
type Make = dyn Fn(&World, usize) -> Option<Box<dyn Backend>>;

/// A backend to be held against the reference.
struct Device {
    make: Box<Make>,
    /// How far any position may be off the reference after a frame [m]; 0 for the same bits.
    tolerance: f64,
}

impl Device {
    fn cpu(precision: Precision, isa: Isa, tolerance: f64) -> Self {
        let make = move |world: &World, count: usize| -> Option<Box<dyn Backend>> {
            Some(Box::new(Cpu::on(world, count, precision, isa)))
        };
        Self {
            make: Box::new(make),
            tolerance,
        }
    }

    #[cfg(feature = "gpu")]
    fn gpu() -> Self {
        let adapter = Adapter::number(0).unwrap();
        // Software rounds as the CPU does. A GPU that fuses products may be as far off as f64 is.
        let tolerance = match adapter.kind() {
            AdapterKind::Processor => 1e-6,
            _ => 2e-3,
        };
        let make = move |world: &World, count: usize| -> Option<Box<dyn Backend>> {
            match Gpu::new(world, count, &adapter) {
                Ok(gpu) => Some(Box::new(gpu)),
                Err(DeviceError::Missing(_)) => None,
                Err(error) => panic!("{error}"),
            }
        };
        Self {
            make: Box::new(make),
            tolerance,
        }
    }

    fn make(&self, world: &World) -> Box<dyn Backend> {
        (self.make)(world, CASES).expect("a world of this device")
    }

    /// The worlds that the device computes, with their numbers.
    fn worlds(&self) -> impl Iterator<Item = (usize, &'static World)> {
        let known = |(_, world): &(usize, &World)| (self.make)(world, 1).is_some();
        WORLDS.iter().enumerate().filter(known)
    }

    /// `CASES` environments, each in a case of its own.
    fn cases(&self, world: &World) -> Box<dyn Backend> {
        let mut backend = self.make(world);
        assert_eq!(backend.count(), CASES);
        for index in 0..CASES {
            backend.load(index, &case(world, index));
        }
        backend
    }
}

/// A dome, and a smaller one on a larger plate, sampled more coarsely.
static TOOLS: LazyLock<[Arc<Tool>; 2]> = LazyLock::new(|| {
    [(60.0, 400.0, 8.0), (54.0, 420.0, 9.0)].map(|(radius_mm, plate_mm, spacing_mm)| {
        let dome = Hemisphere {
            radius_mm,
            plate_mm: [plate_mm; 2],
            ..Hemisphere::default()
        };
        let tool = Tool::new(&ToolConfig {
            source: Source::Shape(Shape::Hemisphere(dome)),
            grid: GridConfig {
                spacing_mm: Some(spacing_mm),
                ..GridConfig::default()
            },
            ..ToolConfig::default()
        });
        tool.unwrap().into()
    })
});

const BLANK: BlankConfig = BlankConfig {
    size_mm: [200.0, 160.0],
    vertices: [14, 11],
    mass: MassModel::Paper,
    outline: None,
    cell_mm: None,
    yarn_angle_deg: 0.0,
};

const ROLLER: Roller = Roller {
    pressure: 1e6,
    speed: 1.0,
};

fn world(lamina: &Lamina, physics: PhysicsConfig) -> World {
    let stencil = Stencil {
        side: 0.035,
        threshold: 1e-3,
        max_strain: 0.01,
        roller: ROLLER,
        press: CONTROL,
        settle: Some(CONTROL),
    };
    let count = lamina.vertex_count() as u32;
    // All vertices, and some of them elsewhere in the image.
    let all = View::new(
        count as usize + 3,
        (0..count).map(|v| (v, v)),
        count as usize,
        match physics.solver {
            Solver::GaussSeidel => Mask::Free,
            _ => Mask::Stroke,
        },
    );
    let some = (0..count).filter(|v| v % 3 != 0).map(|v| (v + 2, v));
    let some = View::new(all.pixel_count, some, count as usize, all.mask);
    let mut world = World {
        tools: TOOLS.to_vec(),
        presses: Some((lamina.clone().into(), stencil)),
        views: vec![all.into(), some.into()],
        ..World::new(Model::new(lamina, &physics), TOOLS[0].clone())
    };
    world.starts = [1, 2].map(|index| case(&world, index).into()).to_vec();
    world
}

/// What environments can differ by, one parameter each and then all of them.
static PARAMETERS: LazyLock<Vec<(&str, Own)>> = LazyLock::new(|| {
    let law = |change: fn(&mut Parameters)| {
        let mut own = Own::default();
        change(&mut own.parameters);
        own
    };
    let (tool, view) = (
        Own {
            tool: 1,
            ..Own::default()
        },
        Own {
            view: 1,
            ..Own::default()
        },
    );
    let all = Own {
        tool: 1,
        start: 1,
        view: 1,
        parameters: Parameters {
            tension: [0.7, 1.3],
            compression: [1.6, 0.6],
            bending: [1.4, 0.7],
            shear: [0.5, 1.5],
            friction: [1.2, 0.8],
            areal_mass: 1.2,
            pressure: 0.8,
            stencil: 1.1,
            offset_mm: [-2.0, 3.0],
            tilt_deviation_deg: 6.0,
            ..Parameters::default()
        },
    };
    vec![
        ("none", Own::default()),
        ("tool", tool),
        ("view", view),
        ("tension of warps", law(|own| own.tension[0] = 0.1)),
        ("tension of wefts", law(|own| own.tension[1] = 0.1)),
        ("compression of warps", law(|own| own.compression[0] = 0.3)),
        ("compression of wefts", law(|own| own.compression[1] = 3.0)),
        ("bending of warps", law(|own| own.bending[0] = 2.0)),
        ("bending of wefts", law(|own| own.bending[1] = 0.5)),
        ("positive shear", law(|own| own.shear[0] = 3.0)),
        ("negative shear", law(|own| own.shear[1] = 0.3)),
        ("static friction", law(|own| own.friction[0] = 0.2)),
        ("dynamic friction", law(|own| own.friction[1] = 0.2)),
        ("areal mass", law(|own| own.areal_mass = 0.32)),
        ("pressure", law(|own| own.pressure = 0.01)),
        ("stencil", law(|own| own.stencil = 1.6)),
        ("offset", law(|own| own.offset_mm = [6.0, -9.0])),
        ("tilt", law(|own| own.tilt_deg = [23.0, -29.0])),
        (
            "deviation of offsets",
            law(|own| own.offset_deviation_mm = 8.0),
        ),
        (
            "deviation of tilts",
            law(|own| own.tilt_deviation_deg = 11.0),
        ),
        ("misses", law(|own| (own.misses, own.seed) = (0.5, 2))),
        ("all", all),
    ]
});

/// Every combination of stages that a scene can list.
static WORLDS: LazyLock<Vec<World>> = LazyLock::new(|| {
    let plain = Lamina::new(&BLANK, Material::interglas_92125()).unwrap();
    let physics = PhysicsConfig::default;
    let mut worlds = Vec::new();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for bending in [Bending::Yarns, Bending::Dihedral] {
            let listed = PhysicsConfig {
                solver,
                bending,
                ..physics()
            };
            worlds.push(world(&plain, listed));
        }
        let held = PhysicsConfig {
            solver,
            adhesion: 1.0,
            strain_limit: Some(1e-3),
            ..physics()
        };
        worlds.push(world(&plain, held));
        let knee = PhysicsConfig {
            solver,
            tension: Some(Tension::Material),
            ..physics()
        };
        worlds.push(world(&plain, knee));
    }
    // Membranes all over, on the same vertices.
    let oblique = BlankConfig {
        yarn_angle_deg: 30.0,
        ..BLANK
    };
    let oblique = Lamina::of_membranes(&oblique, Material::interglas_92125()).unwrap();
    worlds.push(world(&oblique, physics()));
    // Halves of cells all round, beside yarns.
    let bias = BlankConfig {
        size_mm: [200.0, 200.0],
        cell_mm: Some(20.0 / 2f64.sqrt()),
        yarn_angle_deg: 45.0,
        ..BLANK
    };
    let bias = Lamina::new(&bias, Material::interglas_92125()).unwrap();
    assert!(!bias.membranes.is_empty() && bias.membranes.iter().all(|m| m.has_yarns));
    worlds.push(world(&bias, physics()));
    let layers = PhysicsConfig {
        self_collision: SelfCollision::Material,
        ..physics()
    };
    worlds.push(world(&plain, layers));
    // Lines that fill all lanes and more.
    let large = BlankConfig {
        vertices: [21, 18],
        ..BLANK
    };
    let large = Lamina::new(&large, Material::interglas_92125()).unwrap();
    worlds.push(world(&large, physics()));
    // Yarns that end at holes.
    let outline = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../assets/outlines/plate-with-hole.csv"
    );
    let holed = BlankConfig {
        outline: Some(outline.into()),
        cell_mm: Some(16.0),
        yarn_angle_deg: 20.0,
        ..BlankConfig::default()
    };
    let holed = Lamina::new(&holed, Material::interglas_92125()).unwrap();
    assert!(!holed.membranes.is_empty());
    worlds.push(world(&holed, physics()));
    // Sheared beyond locking soon, along rows, edge by edge, and in membranes.
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let listed = PhysicsConfig {
            solver,
            shear_locking: true,
            ..physics()
        };
        for lamina in [&plain, &bias, &holed] {
            let mut lamina = lamina.clone();
            lamina.material.shear.locking = Some(ShearLocking {
                angle_rad: 0.1,
                stiffening: 20.0,
            });
            worlds.push(world(&lamina, listed.clone()));
            // Shear by a curve that bends, stiffer one way and softer the other.
            let shear = &mut lamina.material.shear;
            shear.positive = curve([[0.05, 0.0025], [0.2, 0.03], [0.9, 1.0]]);
            shear.negative = curve([[0.02, 0.002], [0.1, 0.004], [0.9, 0.02]]);
            worlds.push(world(&lamina, listed.clone()));
        }
    }
    // A fin of 3 mm, which stands between vertices.
    let plate = Plate {
        plate_mm: [60.0, 150.0],
        base_mm: 3.0,
    };
    let fin = Tool::new(&ToolConfig {
        source: Source::Shape(Shape::Plate(plate)),
        pose: Pose {
            translation_mm: [6.0, 0.0, 30.0],
            rotation_deg: [0.0, 90.0, 0.0],
        },
        ..ToolConfig::default()
    });
    let fin = Arc::new(fin.unwrap());
    for lamina in [&plain, &bias] {
        let mut finned = world(lamina, physics());
        let model = Model::new(lamina, &physics());
        let flat: Vec<_> = lamina.rest.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        finned.model = model.over(lamina, &fin, &flat).into();
        assert!(finned.model.feels_between());
        finned.tools = vec![fin.clone(), fin.clone()];
        worlds.push(finned);
    }
    // By the angle, as wefts stretch.
    let mut soft = Material::interglas_92125();
    soft.weft.tension = Curve::line(1e6);
    let soft = Lamina::new(&BLANK, soft).unwrap();
    assert!(soft.diagonals.is_empty());
    worlds.push(world(&soft, physics()));
    worlds
});

/// A law of three points beside [0, 0].
fn curve(points: [[f64; 2]; 3]) -> Curve {
    Curve::new(std::iter::once([0.0; 2]).chain(points).collect())
}

/// A buckled sheet that falls on the dome, another in every case; in some it is clamped.
fn case(world: &World, index: usize) -> Snapshot {
    let (lamina, _) = world.presses.as_ref().unwrap();
    let mut stream = Stream::new(3, Purpose::Evaluation, index as u32);
    let phase = stream.uniform();
    let height = 0.0602 + 0.002 * stream.uniform();
    let place = |[x, y]: &[f64; 2]| [*x, *y, height + 0.004 * (40.0 * x + 6.0 * phase).sin()];
    let mut state = Snapshot::at_rest(lamina.rest.iter().map(place).collect());
    for velocity in &mut state.velocity {
        *velocity = [0.1 * stream.normal(), 0.1 * stream.normal(), -0.5];
    }
    for _ in 0..index % 4 {
        let vertex = stream.below(lamina.vertex_count());
        state.fixed.insert(vertex);
        state.velocity[vertex] = [0.0, 0.05, 0.0];
    }
    state.pressed.touched.grow(lamina.vertex_count());
    state.pressed.draped.grow(lamina.vertex_count());
    // Every parameter in some cases of some worlds.
    state.own = PARAMETERS[(7 * index + lamina.vertex_count()) % PARAMETERS.len()]
        .1
        .clone();
    // Rounded to f32, so that every backend starts from the same.
    let numbers = state.position.iter_mut().chain(&mut state.velocity);
    for x in numbers.flatten() {
        *x = f64::from(*x as f32);
    }
    state
}

/// A frame of free motion, one under a roller in every other case, one more, and two presses in
/// two of three cases.
fn advance(
    backend: &mut dyn Backend,
    index: impl Fn(usize) -> usize,
    steps: std::ops::Range<usize>,
) {
    let environments = || (0..backend.count()).map(&index);
    let press = |(environment, index): (usize, usize)| {
        let first = 40 + index as u32;
        let vertices = [first, first + 1, first + 14, first + 15];
        let press = || ROLLER.press(environment, &vertices, &[3e-4; 154]);
        index.is_multiple_of(2).then(press)
    };
    let pressed: Vec<Press> = environments().enumerate().filter_map(press).collect();
    let vertices = |press: u32| -> Vec<Option<u32>> {
        let vertex =
            |index: usize| (!index.is_multiple_of(3)).then_some(60 + index as u32 + 5 * press);
        environments().map(vertex).collect()
    };
    let presses = [vertices(0), vertices(1)];
    for step in steps {
        match step {
            1 => backend.step(&CONTROL, &pressed),
            3 | 4 => drop(backend.press(&presses[step - 3])),
            _ => backend.step(&CONTROL, &[]),
        }
    }
}

const STEPS: usize = 5;

/// The bits of a state; NaN equals itself.
fn bits(state: &Snapshot) -> Vec<u64> {
    let numbers = state.position.iter().chain(&state.velocity).flatten();
    let numbers = numbers.chain(&state.force_density);
    let pressed = &state.pressed;
    let sets = [&state.fixed, &pressed.touched, &pressed.draped];
    let ones = sets
        .into_iter()
        .flat_map(|set| set.ones().map(|v| v as u64).chain([u64::MAX]));
    let stencil = pressed.stencil.iter().map(|&v| u64::from(v));
    let stencil = stencil.chain([pressed.count.into()]);
    numbers
        .map(|x| x.to_bits())
        .chain(ones)
        .chain(stencil)
        .collect()
}

fn furthest(a: &Snapshot, b: &Snapshot) -> f64 {
    let pairs = a.position.iter().flatten().zip(b.position.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn snapshots(backend: &dyn Backend) -> Vec<Snapshot> {
    (0..backend.count())
        .map(|index| backend.snapshot(index))
        .collect()
}

#[track_caller]
fn same_bits(found: &[Snapshot], expected: &[Snapshot], world: &World) {
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(
            bits(found) == bits(expected),
            "environment {index} is off by {:e} m with {:?}",
            furthest(found, expected),
            world.model.physics(),
        );
    }
}

/// What the reference makes of every case after `steps`, one environment at a time.
fn reference(world: &World, steps: usize) -> Vec<Snapshot> {
    let one = |index| {
        let mut backend = Cpu::on(world, 1, Precision::F32, Isa::Portable);
        backend.load(0, &case(world, index));
        advance(&mut backend, |_| index, 0..steps);
        backend.snapshot(0)
    };
    (0..CASES).map(one).collect()
}

/// That of every world at the end.
static ENDS: LazyLock<Vec<Vec<Snapshot>>> = LazyLock::new(|| {
    let worlds = WORLDS.iter();
    worlds.map(|world| reference(world, STEPS)).collect()
});

/// Every environment is computed as if alone: the same bits to the end, or after a frame within
/// the tolerance, beyond which contact and branches amplify what rounding does.
fn follows_the_reference(device: &Device) {
    for (index, world) in device.worlds() {
        let (steps, expected) = match device.tolerance {
            0.0 => (STEPS, &ENDS[index]),
            _ => (1, &reference(world, 1)),
        };
        let mut backend = device.cases(world);
        advance(&mut *backend, |index| index, 0..steps);
        let found = snapshots(&*backend);
        assert!(found.iter().all(Snapshot::is_finite));
        if device.tolerance == 0.0 {
            same_bits(&found, expected, world);
        }
        for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
            let off = furthest(found, expected);
            let physics = world.model.physics();
            assert!(
                off <= device.tolerance,
                "case {index}: {off:e} m, {physics:?}"
            );
        }
    }
}

/// With every parameter an environment alone is the same as among fifteen with others, to the bit.
fn company_changes_nothing(device: &Device) {
    for world in [&WORLDS[0], &WORLDS[4]] {
        let end = |numbers: &[usize]| {
            let mut backend = (device.make)(world, numbers.len()).expect("a world of this device");
            for (environment, &number) in numbers.iter().enumerate() {
                let mut state = case(world, 2);
                state.own = PARAMETERS[number].1.clone();
                backend.load(environment, &state);
            }
            advance(&mut *backend, |_| 2, 0..STEPS);
            snapshots(&*backend)
        };
        let alone: Vec<Snapshot> = (0..PARAMETERS.len()).map(|k| end(&[k]).remove(0)).collect();
        for first in [0, PARAMETERS.len() - 16] {
            let numbers: Vec<usize> = (first..first + 16).collect();
            same_bits(&end(&numbers), &alone[first..], world);
        }
    }
}

/// What is seen and measured is what the host finds in the same states.
fn columns_are_those_of_the_snapshots(device: &Device) {
    for (_, world) in device.worlds() {
        let mut backend = device.cases(world);
        // Away from the nodes of the tool's grid, where normals jump.
        advance(&mut *backend, |index| index, 0..STEPS);
        let (lamina, _) = world.presses.as_ref().unwrap();
        let observed = backend.observe();
        assert_eq!(observed.finite, [true; CASES]);
        let measured = backend.measure(&(0..CASES).collect::<Vec<_>>());
        let close = |found: f64, expected: f64, share: f64| {
            let off = (found - expected).abs();
            assert!(
                off <= 1e-6 + share * expected.abs(),
                "{found}, expected {expected}"
            );
        };
        for (index, found) in measured.iter().enumerate() {
            let state = backend.snapshot(index);
            let view = &world.views[usize::from(state.own.view)];
            let tool = &world.tools[usize::from(state.own.tool)];
            let seen = observed.seen.row(index);
            assert_eq!(seen.view, state.own.view);
            let (mut distance, mut marks) =
                (vec![0.0; view.pixel_count], vec![0; view.pixel_count]);
            let pressed = &state.pressed;
            let is_touched = |v: u32| pressed.touched.contains(v as usize);
            let beside = |v: u32| lamina.neighbors(v).any(|w| pressed.stencil.contains(&w));
            let is_stroke = view.mask == Mask::Stroke;
            let goes_on =
                { view.vertices.iter() }.any(|&v| !is_touched(v) && beside(v)) && is_stroke;
            for (&pixel, &v) in view.pixels.iter().zip(&view.vertices) {
                let x = state.position[v as usize];
                distance[pixel as usize] = tool.distance(x).0.max(0.0);
                let is_allowed = !is_touched(v) && (beside(v) || !goes_on);
                for (bit, is_set) in [
                    (TOUCHED, is_touched(v)),
                    (DRAPED, pressed.draped.contains(v as usize)),
                    (STENCIL, pressed.stencil.contains(&v)),
                    (ALLOWED, is_allowed),
                ] {
                    marks[pixel as usize] |= if is_set { bit } else { 0 };
                }
            }
            assert_eq!(seen.marks, marks);
            for (&found, expected) in seen.distance.iter().zip(distance) {
                close(found.into(), expected, 0.0);
            }
            let is_apart = |v: u32| is_stroke || !lamina.neighbors(v).any(is_touched);
            let left = { view.vertices.iter() }.filter(|&&v| !is_touched(v) && is_apart(v));
            assert_eq!(observed.left[index], left.count());
            let expected = Measures::new(lamina, tool, &view.region, &state.position);
            for k in 0..2 {
                close(found.distance[k], expected.distance[k], 1e-5);
                // High up, feet jump where rounding takes a vertex into another cell of the grid.
                close(found.surplus[k], expected.surplus[k], 1e-3);
            }
            close(found.strain, expected.strain, 1e-5);
            close(found.depth, expected.depth, 1e-5);
        }
    }
}

/// Presses tell where their vertices were when the roller came.
fn presses_tell_their_places(device: &Device) {
    let mut backend = device.cases(&WORLDS[0]);
    let before = snapshots(&*backend);
    let vertex = |index: usize| (!index.is_multiple_of(3)).then_some(60 + index as u32);
    let places = backend.press(&(0..CASES).map(vertex).collect::<Vec<_>>());
    for (index, place) in places.host().chunks(3).enumerate() {
        let expected = vertex(index).map_or([0.0; 3], |v| before[index].position[v as usize]);
        assert_eq!(place, expected, "environment {index}");
    }
}

/// A reset begins at the start that the parameters name, whatever was before.
fn resets_set_the_parameters(device: &Device) {
    for (_, world) in device.worlds() {
        let mut backend = device.cases(world);
        for (index, (_, own)) in PARAMETERS.iter().enumerate().take(CASES) {
            let own = Own {
                start: (index % 2) as u16,
                ..own.clone()
            };
            backend.reset(index, &own);
            let expected = Snapshot {
                own,
                force_density: backend.snapshot(index).force_density,
                ..Snapshot::clone(&world.starts[index % 2])
            };
            assert_eq!(backend.snapshot(index), expected);
        }
    }
}

/// A factor is what another fabric, roller or stencil would be: cloth ends in the same places, to rounding.
#[test]
fn factors_are_those_of_another_world() {
    type Change = fn(&mut Own, &mut Lamina, &mut PhysicsConfig, &mut Stencil);
    let changes: [(&str, Change); 9] = [
        ("tension", |own, lamina, _, _| {
            own.parameters.tension = [0.5, 2.0];
            let Material { warp, weft, .. } = &mut lamina.material;
            warp.tension = warp.tension.scaled(0.5);
            weft.tension = weft.tension.scaled(2.0);
        }),
        ("compression", |own, lamina, _, _| {
            own.parameters.compression = [2.0, 0.5];
            let Material { warp, weft, .. } = &mut lamina.material;
            warp.compression = warp.compression.scaled(2.0);
            weft.compression = weft.compression.scaled(0.5);
        }),
        ("shear", |own, lamina, _, _| {
            own.parameters.shear = [3.0, 0.4];
            let shear = &mut lamina.material.shear;
            shear.positive = shear.positive.scaled(3.0);
            shear.negative = shear.negative.scaled(0.4);
        }),
        ("bending", |own, _, physics, _| {
            own.parameters.bending = [1.5; 2];
            physics.bending_stiffness = BendingStiffness::NewtonMetre(3e-4);
        }),
        ("friction", |own, lamina, _, _| {
            own.parameters.friction = [1.3, 0.7];
            let Material { warp, weft, .. } = &mut lamina.material;
            for law in [warp, weft] {
                law.static_friction *= 1.3;
                law.dynamic_friction *= 0.7;
            }
        }),
        ("mass", |own, lamina, _, _| {
            own.parameters.areal_mass = 0.32;
            lamina.mass.iter_mut().for_each(|mass| *mass *= 0.32);
        }),
        ("pressure", |own, _, _, stencil| {
            own.parameters.pressure = 0.1;
            stencil.roller.pressure *= 0.1;
        }),
        ("side", |own, _, _, stencil| {
            own.parameters.stencil = 1.5;
            stencil.side *= 1.5;
        }),
        ("tool", |own, _, _, _| own.tool = 1),
    ];
    for of in WORLDS.iter() {
        for (name, change) in &changes {
            let (mut lamina, mut stencil) =
                of.presses.clone().map(|(a, b)| ((*a).clone(), b)).unwrap();
            let (mut own, mut physics) = (Own::default(), of.model.physics().clone());
            change(&mut own, &mut lamina, &mut physics, &mut stencil);
            let model = Model::new(&lamina, &physics).over_that_of(&of.model);
            let mut other = world(&lamina, physics);
            other.model = model.into();
            other.tools.clone_from(&of.tools);
            other.presses.as_mut().unwrap().1 = stencil;
            other.tools.swap(0, usize::from(own.tool));
            let end = |world: &World, own: Own| {
                let mut backend = Cpu::new(world, 1, Precision::F64);
                let mut state = case(world, 2);
                state.own = own;
                backend.load(0, &state);
                advance(&mut backend, |_| 2, 0..STEPS);
                backend.snapshot(0)
            };
            let off = furthest(&end(of, own), &end(&other, Own::default()));
            // Presses amplify rounding.
            assert!(off < 1e-8, "{name}: {off:e} m, {:?}", of.model.physics());
        }
    }
}

/// Every parameter changes where cloth ends, or nothing here would tell of it.
#[test]
fn parameters_are_at_work() {
    let world = &WORLDS[0];
    let end = |own: &Own, index: usize| {
        let mut backend = Cpu::new(world, 1, Precision::F32);
        let mut state = case(world, index);
        state.own = own.clone();
        backend.load(0, &state);
        advance(&mut backend, |_| index, 0..STEPS);
        backend.snapshot(0)
    };
    for (name, own) in &PARAMETERS[1..] {
        let off = (0..6).map(|index| {
            let plain = end(&Own::default(), index);
            furthest(&end(own, index), &plain)
        });
        let off = off.fold(0.0, f64::max);
        assert_eq!(off > 1e-5, *name != "view", "{name}: {off:e} m");
    }
}

/// What a press leaves: the vertices under it are touched, those that stay are fixed on the tool.
fn draped_vertices_lie_on_the_tool(device: &Device) {
    let mut draped = 0;
    for (_, world) in device.worlds() {
        let mut backend = device.cases(world);
        advance(&mut *backend, |index| index, 0..STEPS);
        for (index, state) in snapshots(&*backend).iter().enumerate() {
            let pressed = &state.pressed;
            assert_eq!(pressed.touched.is_clear(), index % 3 == 0);
            assert!(pressed.draped.is_subset(&pressed.touched));
            for v in pressed.draped.ones() {
                assert!(state.fixed.contains(v) && state.velocity[v] == [0.0; 3]);
                let tool = &world.tools[usize::from(state.own.tool)];
                assert!(tool.distance(state.position[v]).0 <= 1e-3);
            }
            draped += pressed.draped.count_ones(..);
        }
    }
    assert!(draped > 100, "{draped}");
}

/// NaN and infinity in one environment, a runaway in another: both say so, and no other changes
/// by a bit.
fn diverged_environment_leaves_its_neighbours_alone(device: &Device) {
    for (_, world) in device.worlds() {
        let mut alone = device.cases(world);
        advance(&mut *alone, |index| index, 0..3);
        let expected = snapshots(&*alone);
        let mut backend = device.cases(world);
        advance(&mut *backend, |index| index, 0..1);
        let mut diverged = case(world, 3);
        diverged.position[30] = [f64::NAN, f64::INFINITY, 0.0];
        backend.load(3, &diverged);
        diverged = case(world, 5);
        diverged.position[7][2] = 1e30;
        backend.load(5, &diverged);
        assert!(!backend.finite()[3] && !backend.finite()[5]);
        advance(&mut *backend, |index| index, 1..3);
        for (index, expected) in expected.iter().enumerate() {
            let finite = index != 3 && index != 5;
            assert_eq!(backend.finite()[index], finite, "environment {index}");
            if finite {
                let found = backend.snapshot(index);
                assert!(bits(&found) == bits(expected), "environment {index}");
            }
        }
    }
}

/// A state that is loaded into a backend which did something else before, diverged even, goes on
/// as it does in a new one; and a reset environment as the start of the world.
fn loading_forgets_what_was_before(device: &Device) {
    for (_, world) in device.worlds() {
        let mut new = device.cases(world);
        advance(&mut *new, |index| index, 0..2);
        let mut used = device.cases(world);
        let mut diverged = case(world, 2);
        diverged.position[30] = [f64::NAN, f64::INFINITY, 0.0];
        used.load(2, &diverged);
        advance(&mut *used, |index| (index + 5) % CASES, 0..STEPS);
        for index in 0..CASES {
            used.load(index, &case(world, index));
        }
        advance(&mut *used, |index| index, 0..2);
        same_bits(&snapshots(&*used), &snapshots(&*new), world);
        used.reset(4, &Own::default());
        let fresh = device.make(world);
        assert!(bits(&used.snapshot(4)) == bits(&fresh.snapshot(4)));
        assert!(bits(&used.snapshot(5)) == bits(&new.snapshot(5)));
    }
}

/// A snapshot holds all that moves: loaded into another backend, it goes on as if it had never
/// been taken.
fn snapshot_goes_on_exactly(device: &Device) {
    for (_, world) in device.worlds() {
        let mut whole = device.cases(world);
        advance(&mut *whole, |index| index, 0..4);
        let halfway = snapshots(&*whole);
        advance(&mut *whole, |index| index, 4..STEPS);
        let mut again = device.make(world);
        for (index, state) in halfway.iter().enumerate() {
            again.load(index, state);
        }
        same_bits(&snapshots(&*again), &halfway, world);
        advance(&mut *again, |index| index, 4..STEPS);
        same_bits(&snapshots(&*again), &snapshots(&*whole), world);
    }
}

/// Fixed vertices move with the velocity they have, to the rounding of the sum, and nothing
/// else moves them: neither yarns nor tool nor plate.
fn fixed_vertices_obey_nothing(device: &Device, rounding: f64) {
    for (_, world) in device.worlds() {
        let mut backend = device.cases(world);
        // Under the plate, and at a corner: stopped.
        let mut starts: Vec<_> = (0..CASES).map(|index| case(world, index)).collect();
        for (index, start) in starts.iter_mut().enumerate() {
            for vertex in [0, 42, 55] {
                start.fixed.insert(vertex);
                start.velocity[vertex] = [0.0; 3];
            }
            backend.load(index, start);
        }
        advance(&mut *backend, |index| index, 0..2);
        for (start, found) in starts.iter().zip(snapshots(&*backend)) {
            assert_eq!(found.fixed, start.fixed);
            for vertex in start.fixed.ones() {
                assert_eq!(found.velocity[vertex], start.velocity[vertex]);
                for k in 0..3 {
                    let moved = start.velocity[vertex][k] * 2.0 * CONTROL.dt;
                    let off = found.position[vertex][k] - start.position[vertex][k] - moved;
                    assert!(off.abs() <= rounding, "vertex {vertex} is {off:e} m off");
                }
            }
        }
    }
}

/// A long control step is that of its parts, to the bit: no device leaves out a substep. Only what contact between
/// vertices knows of triangles that have moved by less than 20 um ends with a control step, so that over a fine tool
/// both may differ by less than that.
fn long_steps_are_the_sum_of_their_parts(device: &Device) {
    for (_, world) in device.worlds() {
        let end = |parts: usize| {
            let mut backend = (device.make)(world, 2).expect("a world of this device");
            backend.load(1, &case(world, 1));
            let control = Control {
                // A power of two, so that substeps last as long in every part.
                dt: 0.5 / parts as f64,
                substeps: 640 / parts,
                ..CONTROL
            };
            (0..parts).for_each(|_| backend.step(&control, &[]));
            [backend.snapshot(0), backend.snapshot(1)]
        };
        let (whole, parts) = (end(1), end(8));
        if world.model.feels_between() {
            let off = whole.iter().zip(&parts).map(|(a, b)| furthest(a, b));
            assert!(off.fold(0.0, f64::max) < 5e-6);
        } else {
            same_bits(&whole, &parts, world);
        }
    }
}

/// Most cases shear beyond locking where it is listed, or nothing here would tell of it.
#[test]
fn locking_is_at_work() {
    let worlds = WORLDS.iter().zip(ENDS.iter());
    for (world, locked) in worlds.filter(|(w, _)| w.model.physics().shear_locking) {
        let (lamina, _) = world.presses.as_ref().unwrap();
        let free = PhysicsConfig {
            shear_locking: false,
            ..world.model.physics().clone()
        };
        let free = self::world(lamina, free);
        let free = reference(&free, STEPS);
        let pairs = locked.iter().zip(&free);
        let at_work = pairs.filter(|(locked, free)| bits(locked) != bits(free));
        let (count, physics) = (at_work.count(), world.model.physics());
        assert!(2 * count > CASES, "{count} cases, {physics:?}");
    }
}

/// A roller moves its own environment and no other.
fn presses_stay_in_their_environments(device: &Device) {
    let world = &WORLDS[0];
    let step = |presses: &[Press]| {
        let mut backend = device.cases(world);
        backend.step(&CONTROL, presses);
        snapshots(&*backend)
    };
    let press = ROLLER.press(6, &[46, 47, 60, 61], &[3e-4; 154]);
    let (free, pressed) = (step(&[]), step(&[press]));
    for (index, (free, pressed)) in free.iter().zip(&pressed).enumerate() {
        assert_eq!(
            bits(free) == bits(pressed),
            index != 6,
            "environment {index}"
        );
    }
}

macro_rules! suite {
    ($($name:ident: $device:expr, $rounding:expr;)+) => {$(
        mod $name {
            use super::*;

            suite! { @ $device,
                follows_the_reference company_changes_nothing columns_are_those_of_the_snapshots
                presses_tell_their_places resets_set_the_parameters
                draped_vertices_lie_on_the_tool diverged_environment_leaves_its_neighbours_alone
                loading_forgets_what_was_before snapshot_goes_on_exactly
                presses_stay_in_their_environments long_steps_are_the_sum_of_their_parts
            }

            #[test]
            fn stages_are_those_of_the_reference() {
                stages::stages_are_those_of_the_reference(&$device);
            }

            #[test]
            fn fixed_vertices_obey_nothing() {
                super::fixed_vertices_obey_nothing(&$device, $rounding);
            }
        }
    )+};
    (@ $device:expr, $($test:ident)+) => {$(
        #[test]
        fn $test() {
            super::$test(&$device);
        }
    )+};
}

suite! {
    portable: Device::cpu(Precision::F32, Isa::Portable, 0.0), 1e-6;
    widest: Device::cpu(Precision::F32, Isa::best(), 0.0), 1e-6;
    double: Device::cpu(Precision::F64, Isa::best(), 2e-3), 1e-15;
}

#[cfg(feature = "gpu")]
suite! {
    gpu: Device::gpu(), 1e-6;
}

/// What a scene lists and no kernel computes is refused by the key that lists it, all else computed.
#[cfg(feature = "gpu")]
#[test]
fn gpu_names_what_it_lacks() {
    let adapter = Adapter::number(0).unwrap();
    let mut computed = 0;
    for world in WORLDS.iter() {
        let (physics, (lamina, _)) = (world.model.physics(), world.presses.as_ref().unwrap());
        let lacks = [
            ("membranes", !lamina.membranes.is_empty()),
            ("between vertices", world.model.feels_between()),
            ("curve", lamina.material.shear.bends()),
            ("dihedral", physics.bending == Bending::Dihedral),
            (
                "self_collision",
                physics.self_collision != SelfCollision::Off,
            ),
        ];
        let lacks = lacks.iter().filter(|(_, is_listed)| *is_listed);
        let lacks: Vec<&str> = lacks.map(|(name, _)| *name).collect();
        match Gpu::new(world, 1, &adapter) {
            Ok(_) => assert_eq!(lacks, [""; 0]),
            Err(DeviceError::Missing(what)) => {
                assert!(
                    lacks.iter().any(|name| what.contains(name)),
                    "{what}, {lacks:?}"
                );
            }
            Err(error) => panic!("{error}"),
        }
        computed += usize::from(lacks.is_empty());
    }
    assert_eq!(computed, 9);
    let sharp = Tool::new(&ToolConfig {
        source: Source::Shape(Shape::Hemisphere(Hemisphere::default())),
        ..ToolConfig::default()
    });
    let world = World::new(WORLDS[0].model.clone(), sharp.unwrap());
    let error = Gpu::new(&world, 1, &adapter).err().unwrap();
    assert!(
        error.to_string().contains("`tool.grid.spacing_mm`"),
        "{error}"
    );
    let many = Gpu::new(&WORLDS[0], 10_000_000, &adapter).err().unwrap();
    assert!(
        many.to_string().starts_with("10000000 environments need"),
        "{many}"
    );
}

/// Groups of lanes, and one environment with its lines in the lanes, in both precisions.
#[test]
fn every_instruction_set_of_this_processor_gives_the_same_bits() {
    for isa in Isa::available() {
        // Those have suites of their own.
        if ![Isa::Portable, Isa::best()].contains(&isa) {
            let device = Device::cpu(Precision::F32, isa, 0.0);
            follows_the_reference(&device);
            company_changes_nothing(&device);
        }
        for world in WORLDS.iter() {
            for (precision, index) in [(Precision::F32, 2), (Precision::F64, 7)] {
                let alone = |isa| {
                    let mut backend = Cpu::on(world, 1, precision, isa);
                    backend.load(0, &case(world, index));
                    advance(&mut backend, |_| index, 0..STEPS);
                    [backend.snapshot(0)]
                };
                same_bits(&alone(isa), &alone(Isa::Portable), world);
            }
        }
    }
}

/// Off the tool, where no contact decides: after one frame the two differ by rounding.
#[test]
fn f32_follows_f64_in_the_air() {
    for world in WORLDS.iter() {
        let (lamina, _) = world.presses.as_ref().unwrap();
        let is_cut = lamina.membranes.iter().any(|m| !m.has_yarns);
        for index in 0..CASES {
            let mut state = case(world, index);
            for x in &mut state.position {
                x[2] += 0.3;
            }
            let flown = |precision| {
                let mut backend = Cpu::new(world, 1, precision);
                backend.load(0, &state);
                backend.step(&CONTROL, &[]);
                backend.snapshot(0)
            };
            let off = furthest(&flown(Precision::F32), &flown(Precision::F64));
            let physics = world.model.physics();
            // At a cut border stiff membranes are solved one after the other, which magnifies rounding.
            let most = if is_cut { 5e-5 } else { 2e-5 };
            assert!(off <= most, "case {index}: {off:e} m, {physics:?}");
        }
    }
}

/// Over the fin nearly all cases end elsewhere than without contact between the vertices.
#[test]
fn contact_between_vertices_is_at_work() {
    let worlds = WORLDS.iter().zip(ENDS.iter());
    for (world, held) in worlds.filter(|(world, _)| world.model.feels_between()) {
        let (lamina, _) = world.presses.as_ref().unwrap();
        let mut blind = world.clone();
        blind.model = Model::new(lamina, world.model.physics()).into();
        let blind = reference(&blind, STEPS);
        let pairs = held.iter().zip(&blind);
        let count = pairs.filter(|(a, b)| furthest(a, b) > 1e-5).count();
        assert!(2 * count > CASES, "{count} cases");
    }
}
