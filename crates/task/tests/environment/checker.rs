//! Everything a step must do, recomputed from states before and after it.

use drape_cloth::fabric::Membrane;
use drape_cloth::math::Vec3;
use drape_cloth::measure::{feet, summed_surplus};
use drape_cloth::sim::Device;
use drape_cloth::sim::Precision;
use drape_cloth::sim::{DRAPED, Mask, STENCIL, Snapshot, TOUCHED};
use drape_task::env::{End, Objective};
use fixedbitset::FixedBitSet;

use super::*;

/// Plays `count` environments until each has ended an episode, and checks every step.
pub fn check(scene: &Arc<Scene>, config: &EnvConfig, count: usize, seed: u64) {
    let mut env = Draping::new(scene.clone(), config, count).unwrap();
    let mut player = Player::new(seed, count);
    let mut ended = vec![0; count];
    let fresh = seen(&env, 0);
    while ended.contains(&0) {
        let before: Vec<View> = (0..count).map(|index| View::new(&env, index)).collect();
        let actions = player.choose(&env);
        let outcomes = env.step(&actions);
        for index in 0..count {
            let after = match &outcomes[index].episode {
                None => View::new(&env, index),
                Some(_) => View::last(&env, index),
            };
            let pressed = env.vertex(actions[index]).unwrap();
            check_step(&env, config, &before[index], &after, pressed);

            let is_touched = |v: u32| after.touched.contains(v as usize);
            let is_apart = |v: u32| {
                let mut near = scene.lamina.neighbors(v);
                config.mask == Mask::Stroke || !near.any(is_touched)
            };
            let left = env.tasks()[0]
                .region_vertices()
                .any(|v| !is_touched(v) && is_apart(v));
            let Some(episode) = &outcomes[index].episode else {
                assert!(
                    left,
                    "nothing is left to be pressed, yet the episode goes on"
                );
                assert_eq!(outcomes[index].reward, 0.0);
                check_observation(
                    &env,
                    config,
                    index,
                    &after,
                    &stencil(&env, config, &before[index], pressed),
                );
                continue;
            };
            assert!(!left, "the episode ends before all is pressed");
            assert_eq!(episode.end, End::Terminated);
            assert_eq!(episode.total_reward, outcomes[index].reward);
            assert_eq!(episode.actions.last(), Some(&actions[index]));
            let [initial, last] = [&scene.initial, &after.state].map(|s| objective(&env, s));
            let reward = f64::from(outcomes[index].reward);
            // Rewards are in single precision, and on a GPU so are the distances that are summed: within
            // 10 nm, or 20 where some cloth is left high.
            let rounding = 1e-6 * initial;
            let summed = match (config.device, config.mask) {
                (Device::Cpu, _) => 0.0,
                (Device::Gpu(_), Mask::Stroke) => 1e-8,
                (Device::Gpu(_), Mask::Free) => 2e-8,
            };
            let off = (reward - (initial - last)).abs();
            assert!(off < rounding + summed, "{off} m off of {last}");
            assert!((f64::from(env.reward_scale(0)) - initial).abs() < rounding);
            // The new episode starts as all do.
            assert_eq!(seen(&env, index), fresh);
            let pressed = env.state(index).pressed;
            assert!(pressed.touched.is_clear() && pressed.draped.is_clear());
            ended[index] += 1;
        }
    }
}

/// What can be seen of an environment from outside.
struct View {
    state: Snapshot,
    touched: FixedBitSet,
    draped: FixedBitSet,
}

impl View {
    fn new(env: &Draping, index: usize) -> Self {
        Self::of(env.state(index))
    }

    /// The end of the last episode.
    fn last(env: &Draping, index: usize) -> Self {
        Self::of(env.finished(index).unwrap().cloth().clone())
    }

    fn of(state: Snapshot) -> Self {
        Self {
            touched: state.pressed.touched.clone(),
            draped: state.pressed.draped.clone(),
            state,
        }
    }
}

/// What the episodes are to bring down [m].
fn objective(env: &Draping, state: &Snapshot) -> f64 {
    let scene = env.scene();
    let sum: f64 = distances(env, state).sum();
    match env.config().objective {
        Objective::Distance => sum,
        Objective::Surplus => {
            let region = &env.region().vertices;
            let (surplus, yarns) =
                summed_surplus(&scene.lamina, &feet(&scene.tool, &state.position), region);
            let [surplus_out, distance_out] = pushed_out(env, state);
            (sum + distance_out) / region.count_ones(..) as f64
                + (surplus + surplus_out) / yarns as f64
        }
    }
}

/// How much more surplus and distance there is outside the region than at the start [m], summed.
fn pushed_out(env: &Draping, state: &Snapshot) -> [f64; 2] {
    let (scene, region) = (env.scene(), &env.region().vertices);
    let sums = |state: &Snapshot| {
        let x = &state.position;
        let mut sum = [0.0; 2];
        let foot = |v: usize| {
            let (phi, normal) = scene.tool.distance(x[v]);
            [0, 1, 2].map(|k| x[v][k] - phi * normal[k])
        };
        for yarn in &scene.lamina.yarns {
            for edge in yarn.vertices.windows(2) {
                let [a, b] = [edge[0] as usize, edge[1] as usize];
                if !(region.contains(a) && region.contains(b)) {
                    let (a, b) = (foot(a), foot(b));
                    let square: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
                    sum[0] += (yarn.rest_length - square.sqrt()).max(0.0);
                }
            }
        }
        let outside = (0..x.len()).filter(|&v| !region.contains(v));
        sum[1] = outside.map(|v| scene.tool.distance(x[v]).0.max(0.0)).sum();
        sum
    };
    let (now, before) = (sums(state), sums(&scene.initial));
    [0, 1].map(|k| (now[k] - before[k]).max(0.0))
}

/// Distance to the tool of every vertex of the region [m].
fn distances<'a>(env: &'a Draping, state: &'a Snapshot) -> impl Iterator<Item = f64> + 'a {
    let distance = |v: u32| env.scene().tool.distance(state.position[v as usize]).0;
    let vertices = env.tasks()[0].region_vertices();
    vertices.map(move |v| distance(v).max(0.0))
}

/// The vertices in the column over the square stencil at `pressed`, from among those within
/// one and a half sides on the flat blank.
fn stencil(env: &Draping, config: &EnvConfig, before: &View, pressed: u32) -> FixedBitSet {
    let scene = env.scene();
    let side = 1e-3 * config.stencil_mm;
    let at = |v: usize| Vec3::from(before.state.position[v]);
    let centre = at(pressed as usize);
    let normal = Vec3::from(scene.tool.distance(centre.into()).1);
    // The x axis laid down on the tool; nowhere does the rib stand upright.
    let along = (Vec3::x() - normal * normal.x).normalize();
    let across = normal.cross(&along);
    let rest = scene.lamina.rest[pressed as usize];
    (0..scene.lamina.vertex_count())
        .filter(|&v| {
            let flat = scene.lamina.rest[v];
            let near = (0..2).all(|k| (flat[k] - rest[k]).abs() <= 1.5 * side * (1.0 + 1e-9));
            let [u, w] = [along, across].map(|axis| (at(v) - centre).dot(&axis).abs());
            near && u.max(w) <= 0.5 * side * (1.0 + 1e-6)
        })
        .chain([pressed as usize])
        .collect()
}

/// Whether the yarns beside `v`, and the membranes that stand for some, are stretched by at most the
/// strain at which it may be draped.
fn slack(env: &Draping, config: &EnvConfig, state: &Snapshot, v: usize) -> bool {
    let x = |v: u32| Vec3::from(state.position[v as usize]);
    let yarns = env.scene().lamina.yarns.iter();
    let most = 1.0 + config.drape_strain;
    let mut cut = cut(env).filter(|membrane| membrane.vertices.contains(&(v as u32)));
    let is_slack = |columns: [Vec3; 2]| columns.iter().all(|column| column.norm() <= most);
    let by_membranes = cut.all(|membrane| is_slack(membrane.columns(&state.position)));
    by_membranes
        && yarns
            .flat_map(|yarn| yarn.vertices.windows(2).map(move |pair| (yarn, pair)))
            .filter(|(_, pair)| pair.contains(&(v as u32)))
            .all(|(yarn, pair)| {
                let most = yarn.rest_length * (1.0 + config.drape_strain);
                (x(pair[0]) - x(pair[1])).norm() <= most
            })
}

/// Membranes that stand for yarns.
fn cut(env: &Draping) -> impl Iterator<Item = &Membrane> {
    let membranes = env.scene().lamina.membranes.iter();
    membranes.filter(|membrane| !membrane.has_yarns)
}

/// That of `v` and its neighbours on them.
fn slack_around(env: &Draping, config: &EnvConfig, state: &Snapshot, v: usize) -> bool {
    let yarns = env.scene().lamina.yarns.iter();
    let pairs = yarns.flat_map(|yarn| yarn.vertices.windows(2));
    let mut parts = pairs.chain(cut(env).map(|membrane| &membrane.vertices[..]));
    parts.all(|part| {
        let mut all = part.iter().map(|&w| slack(env, config, state, w as usize));
        !part.contains(&(v as u32)) || all.all(|is_slack| is_slack)
    })
}

fn check_step(env: &Draping, config: &EnvConfig, before: &View, after: &View, pressed: u32) {
    let scene = env.scene();
    let under = stencil(env, config, before, pressed);
    let mut touched = before.touched.clone();
    touched.extend(under.ones());
    assert_eq!(
        after.touched.ones().collect::<Vec<_>>(),
        touched.ones().collect::<Vec<_>>()
    );
    assert!(!before.touched.contains(pressed as usize));

    for v in 0..scene.lamina.vertex_count() {
        let near =
            scene.tool.distance(after.state.position[v]).0 <= 1e-3 * config.drape_threshold_mm;
        let draped = before.draped.contains(v)
            || under.contains(v) && near && slack_around(env, config, &after.state, v);
        assert_eq!(after.draped.contains(v), draped, "vertex {v}");
        if before.draped.contains(v) {
            assert_eq!(
                after.state.position[v], before.state.position[v],
                "vertex {v}"
            );
        }
        let held = scene.initial.fixed.contains(v) || draped;
        assert_eq!(after.state.fixed.contains(v), held, "vertex {v}");
    }
    assert!(after.draped.is_subset(&after.touched));
}

fn check_observation(
    env: &Draping,
    config: &EnvConfig,
    index: usize,
    after: &View,
    under: &FixedBitSet,
) {
    let (scene, region) = (env.scene(), env.region());
    let cell = |v: usize| scene.lamina.place(v as u32);
    let inside = |v: usize| {
        let [x0, y0, x1, y1] = config.region_mm.unwrap_or([-1e9, -1e9, 1e9, 1e9]);
        let [x, y] = scene.lamina.rest[v].map(|x| 1e3 * x);
        let slack = 1e-6;
        x0 - slack <= x && x <= x1 + slack && y0 - slack <= y && y <= y1 + slack
    };
    let open: Vec<usize> = (0..scene.lamina.vertex_count())
        .filter(|&v| inside(v) && !after.touched.contains(v))
        .collect();
    let beside = |v: usize| {
        under
            .ones()
            .any(|s| (0..2).all(|k| cell(s)[k].abs_diff(cell(v)[k]) <= 1))
    };
    let mut allowed: Vec<usize> = open.iter().copied().filter(|&v| beside(v)).collect();
    if allowed.is_empty() || config.mask == Mask::Free {
        allowed = open;
    }
    let observation = env.observation(index);
    let found: Vec<usize> = observation
        .allowed()
        .map(|action| env.vertex(action).unwrap() as usize)
        .collect();
    assert!(!found.is_empty());
    assert_eq!(found, allowed);

    let shape = env.shape();
    assert_eq!(observation.distance.len(), shape.rows * shape.columns);
    let corner = if config.crop {
        [region.rows.start, region.columns.start]
    } else {
        [0, 0]
    };
    for pixel in 0..shape.pixel_count() {
        let place = [pixel / shape.columns, pixel % shape.columns];
        let place = [0, 1].map(|k| place[k] + corner[k]);
        let Some(v) = env.vertex(pixel as u32) else {
            // The blank has been cut away here.
            assert_eq!(scene.lamina.vertex_at(place[0], place[1]), None);
            assert_eq!(observation.distance[pixel], 0.0);
            assert_eq!(observation.marks[pixel], 0);
            continue;
        };
        let v = v as usize;
        assert_eq!(cell(v), place);
        assert_eq!(env.action(v as u32), Some(pixel as u32));
        let distance = scene.tool.distance(after.state.position[v]).0.max(0.0) as f32;
        let expected = if inside(v) { distance } else { 0.0 };
        // Looked up in the environment's precision: a tenth of a micrometre.
        let error = (observation.distance[pixel] - expected).abs();
        assert!(error < 2e-7, "{error} m off at pixel {pixel}");
        for (bit, bits) in [
            (TOUCHED, &after.touched),
            (DRAPED, &after.draped),
            (STENCIL, under),
        ] {
            let is_marked = observation.marks[pixel] & bit != 0;
            assert_eq!(is_marked, inside(v) && bits.contains(v));
        }
    }
}

#[test]
fn cropped_region_of_a_coarse_blank() {
    for seed in 0..3 {
        check(&COARSE, &small_region(), 3, seed);
    }
}

#[test]
fn region_without_crop() {
    let config = EnvConfig {
        crop: false,
        ..small_region()
    };
    check(&COARSE, &config, 2, 7);
}

/// Presses may jump, and what is beside others need not be pressed.
#[test]
fn free_presses_end_where_all_is_near_one() {
    let config = EnvConfig {
        mask: Mask::Free,
        ..small_region()
    };
    check(&COARSE, &config, 3, 8);
    let presses = |config: &EnvConfig| {
        let mut env = Draping::new(COARSE.clone(), config, 1).unwrap();
        let first = |env: &Draping| {
            let mut allowed = env.observation(0).allowed();
            vec![allowed.next().unwrap()]
        };
        env.play(first)[0].episode.actions.len()
    };
    assert!(presses(&config) < presses(&small_region()));
}

#[test]
fn one_environment_alone_and_in_f64() {
    check(&COARSE, &small_region(), 1, 11);
    let config = EnvConfig {
        precision: Precision::F64,
        objective: Objective::Distance,
        ..small_region()
    };
    check(&COARSE, &config, 2, 12);
}

/// With so little strain allowed, many vertices that a press brings to the tool stay free.
#[test]
fn stretched_vertices_are_not_draped() {
    let config = EnvConfig {
        drape_strain: 1e-4,
        ..small_region()
    };
    check(&COARSE, &config, 2, 9);
}

/// A wide stencil covers several vertices of a wrinkle, some of them touched before.
#[test]
fn whole_coarse_blank_under_a_wide_stencil() {
    let config = EnvConfig {
        stencil_mm: 40.0,
        drape_threshold_mm: 0.5,
        ..EnvConfig::default()
    };
    check(&COARSE, &config, 2, 3);
}

#[test]
fn whole_coarse_blank_by_gauss_seidel() {
    check(&GAUSS_SEIDEL, &EnvConfig::default(), 2, 4);
}

#[test]
fn region_of_the_standard_blank() {
    let standard = Arc::new(rib(65, Solver::Yarn));
    check(&standard, &small_region(), 2, 5);
}

/// Rows and columns run obliquely to the region, which reaches over the hole and the border.
#[test]
fn region_of_a_blank_with_a_hole() {
    for crop in [true, false] {
        let config = EnvConfig {
            region_mm: Some([-40.0, -60.0, 90.0, 120.0]),
            crop,
            ..EnvConfig::default()
        };
        let env = Draping::new(HOLED.clone(), &config, 1).unwrap();
        let shape = env.shape();
        let absent = |action: &u32| env.vertex(*action).is_none();
        assert!((0..shape.pixel_count() as u32).any(|action| absent(&action)));
        check(&HOLED, &config, 2, 6);
    }
}

#[test]
fn whole_blank_with_a_hole() {
    check(&HOLED, &EnvConfig::default(), 2, 8);
}
