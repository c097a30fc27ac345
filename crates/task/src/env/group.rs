//! Which scenes one backend can compute together.

use std::ops::Range;
use std::sync::Arc;

use super::rules::Task;
use super::scatter::Worlds;
use drape_cloth::fabric::{Family, Material};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Own, Parameters, SelfCollision, Stencil, Tension, View, World};

/// Most nodes of the tools of one world: 4 GiB, and in reach of indices of 32 bits.
const MOST_NODES: usize = 1 << 30;

/// Environments of one world.
pub(super) struct Group {
    pub world: World,
    /// Numbers of the environments, which follow one another.
    pub environments: Range<usize>,
    /// What they have of their own after a reset `[environment]`.
    pub owns: Vec<Own>,
    /// Numbers of their scenes `[environment]`.
    pub scenes: Vec<usize>,
    /// Of each of its scenes the number, and those of the starts of its worlds.
    pub lies: Vec<(usize, Vec<u16>)>,
}

/// Sorts scenes into as few worlds as compute them: those of one topology, whose laws differ by factors.
/// Each has its number of environments, and perhaps worlds round it.
pub(super) fn groups(
    tasks: &[Task],
    counts: &[usize],
    worlds: &[Option<Arc<Worlds>>],
) -> Vec<Group> {
    let views: Vec<Arc<View>> = tasks.iter().map(|task| task.view.clone()).collect();
    // Of each group the first scene, whose model is that of all, and those that it has.
    let mut found: Vec<(usize, Vec<(usize, Parameters)>)> = Vec::new();
    for (number, task) in tasks.iter().enumerate() {
        let own = &task.config.parameters;
        let nodes = |number: usize| tasks[number].scene.tool.grid.node_count();
        let fits = |(first, members): &(usize, Vec<(usize, Parameters)>)| {
            let all: usize = members.iter().map(|&(number, _)| nodes(number)).sum();
            over(&tasks[*first], task, own).filter(|_| all + nodes(number) <= MOST_NODES)
        };
        let mut known = found.iter().enumerate();
        let place = known.find_map(|(group, of)| Some((group, fits(of)?)));
        match place {
            Some((group, parameters)) => found[group].1.push((number, parameters)),
            None => found.push((number, vec![(number, own.clone())])),
        }
    }
    let mut end = 0;
    let group = |(first, members): (usize, Vec<(usize, Parameters)>)| {
        let Task { scene, stencil, .. } = &tasks[first];
        let mut world = World {
            model: scene.model.clone(),
            tools: Vec::new(),
            starts: Vec::new(),
            presses: Some((scene.lamina.clone(), stencil.clone())),
            views: views.clone(),
        };
        let (mut owns, mut scenes, mut lies) = (Vec::new(), Vec::new(), Vec::new());
        for (number, parameters) in members {
            let scene = &tasks[number].scene;
            let own = Own {
                tool: place(&mut world.tools, &scene.tool),
                start: place(&mut world.starts, &scene.initial),
                view: number as u16,
                parameters,
            };
            owns.extend(vec![own; counts[number]]);
            scenes.extend(vec![number; counts[number]]);
            let lying = worlds[number].iter().flat_map(|worlds| worlds.scenes());
            let starts = lying.map(|scene| place(&mut world.starts, &scene.initial));
            lies.push((number, starts.collect()));
        }
        let start = end;
        end += owns.len();
        Group {
            world,
            environments: start..end,
            owns,
            scenes,
            lies,
        }
    };
    found.into_iter().map(group).collect()
}

/// The number of `one` among `all`, to which it is added where it is new.
fn place<T>(all: &mut Vec<Arc<T>>, one: &Arc<T>) -> u16 {
    let known = all.iter().position(|other| Arc::ptr_eq(other, one));
    known.unwrap_or_else(|| {
        all.push(one.clone());
        all.len() - 1
    }) as u16
}

/// What an environment of `task` has of its own in the world of `base`, on top of `own`; none if that
/// takes more than factors.
fn over(base: &Task, task: &Task, own: &Parameters) -> Option<Parameters> {
    let (a, b) = (&base.stencil, &task.stencil);
    let stencil = Stencil {
        side: b.side,
        ..a.clone()
    };
    let mut pressed = b.clone();
    pressed.roller.pressure = a.roller.pressure;
    let laws = laws(&base.scene, &task.scene)?;
    let laws = Parameters {
        pressure: b.roller.pressure / a.roller.pressure,
        stencil: b.side / a.side,
        ..laws
    };
    let parameters = laws.and(own);
    let on = |task: &Task| (task.config.device, task.config.precision);
    let is_alike = stencil == pressed && on(base) == on(task);
    (is_alike && parameters.check().is_ok()).then_some(parameters)
}

/// The factors that take the laws of a scene to those of another.
fn laws(base: &Scene, scene: &Scene) -> Option<Parameters> {
    let (a, b) = (&base.lamina, &scene.lamina);
    let mut physics = scene.model.physics().clone();
    physics.bending_stiffness = base.model.physics().bending_stiffness;
    let [from, to] = [&a.material, &b.material];
    let families = [Family::Warp, Family::Weft];
    let knees = |material: &Material| {
        let is_used = physics.tension == Some(Tension::Material);
        families.map(|family| is_used.then(|| material.yarn(family).tension.kinks()))
    };
    let thickness = |material: &Material| match physics.self_collision {
        SelfCollision::Material => material.thickness_mm,
        _ => 0.0,
    };
    let locking = |material: &Material| material.shear.locking.filter(|_| physics.shear_locking);
    let curves = |material: &Material| {
        let shear = &material.shear;
        let curves = shear.bends().then(|| shear.curves(physics.shear_locking));
        curves.map(|curves| curves.map(|curve| curve.kinks()))
    };
    let is_alike = physics == *base.model.physics()
        && base.model.feels_as(&scene.model)
        && a.rest == b.rest
        && a.triangles == b.triangles
        && a.membranes.len() == b.membranes.len()
        && knees(from) == knees(to)
        && curves(from) == curves(to)
        && thickness(from) == thickness(to)
        && locking(from) == locking(to);
    if !is_alike {
        return None;
    }
    let by_thickness = to.thickness_mm / from.thickness_mm;
    let factors = |of: &dyn Fn(&Material, usize) -> f64| -> Option<[f64; 2]> {
        let [first, second] = [0, 1].map(|k| factor(of(from, k), of(to, k)));
        Some([first?, second?])
    };
    let stiff = |factors: [f64; 2]| factors.map(|factor| factor * by_thickness);
    let bending = [0, 1].map(|k| {
        let of = |scene: &Scene| scene.model.bending_stiffness()[k];
        factor(of(base), of(scene))
    });
    Some(Parameters {
        tension: stiff(factors(&|m, k| m.yarn(families[k]).tension.modulus())?),
        compression: stiff(factors(&|m, k| m.yarn(families[k]).compression.modulus())?),
        shear: stiff(factors(&|m, k| {
            [&m.shear.positive, &m.shear.negative][k].modulus()
        })?),
        bending: [bending[0]?, bending[1]?],
        friction: factors(&|m, k| m.friction()[k])?,
        areal_mass: factor(a.mass.iter().sum(), b.mass.iter().sum())?,
        ..Parameters::default()
    })
}

/// What takes a number to another; none takes 0 elsewhere.
fn factor(from: f64, to: f64) -> Option<f64> {
    match from == to {
        true => Some(1.0),
        false => (from != 0.0).then(|| to / from),
    }
}
