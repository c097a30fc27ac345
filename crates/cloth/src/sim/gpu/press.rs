//! Who is under the stencil, and what a press leaves on the tool: see [`super::super::stencil`]
//! and [`super::super::cpu`].

use cubecl::prelude::*;

use super::super::state::{DRAPED, STENCIL, TOUCHED};
use super::cloth::{ClothBuffers, SheetBuffers};
use super::own::{FIELDS, HALF, PRESSURE, REACH, tool_of};
use super::plan::{NOTHING, Plan, PressPlan};
use super::tool::distance;
use super::vector::Vec3g;

/// Puts a roller on the vertices under the stencil around `pressed[environment]`, which is shifted along its
/// sides and turned about them as its aim says, and tells where this vertex is.
#[cube(launch_unchecked)]
pub(super) fn lay_stencil(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    marks: &mut [u32],
    pressed: &[u32],
    aims: &[f32],
    places: &mut [f32],
    #[comptime] plan: Plan,
) {
    let environment = CUBE_POS_X as usize;
    let n = comptime!(plan.vertices);
    let press = comptime!(plan.press.expect("a world with presses"));
    let vectors = 3 * environment * n;
    let own = environment * FIELDS;
    let centre_vertex = pressed[environment];
    if centre_vertex == NOTHING {
        if UNIT_POS_X == 0 {
            Vec3g::zero().store(places, 3 * environment, 1usize, 0usize);
        }
        for v in range_stepped(UNIT_POS_X as usize, n, CUBE_DIM_X as usize) {
            cloth.force[environment * n + v] = 0.0f32;
        }
    } else {
        let p = centre_vertex as usize;
        let mut centre = Vec3g::load(&cloth.position, vectors, n, p);
        if UNIT_POS_X == 0 {
            centre.store(places, 3 * environment, 1usize, 0usize);
        }
        let tool = tool_of(&cloth.own, environment, comptime!(plan.grid));
        let (_phi, mut normal) = distance(sheet, centre, tool, comptime!(plan.grid));
        let mut along = first_side(normal);
        let mut across = normal.cross(along);
        let aim = 4 * environment;
        let (right_off, up_off) = (aims[aim], aims[aim + 1]);
        let (about_along, about_across) = (aims[aim + 2], aims[aim + 3]);
        if right_off != 0.0f32
            || up_off != 0.0f32
            || about_along != 0.0f32
            || about_across != 0.0f32
        {
            centre = centre
                .plus(along.scale(right_off))
                .plus(across.scale(up_off));
            let turned = normal
                .minus(across.scale(about_along))
                .plus(along.scale(about_across));
            normal = turned.scale(1.0f32 / turned.dot(turned).sqrt());
            along = first_side(normal);
            across = normal.cross(along);
        }
        let half = cloth.own[own + HALF];
        // As `Stencil::reach`.
        let off = (right_off * right_off + up_off * up_off).sqrt();
        let mut reach = cloth.own[own + REACH];
        if off > half {
            reach += off;
        }
        let pressure = cloth.own[own + PRESSURE];
        let rest = comptime!(press.rest);
        for v in range_stepped(UNIT_POS_X as usize, n, CUBE_DIM_X as usize) {
            let right = (sheet.values[rest + v] - sheet.values[rest + p]).abs();
            let up = (sheet.values[rest + n + v] - sheet.values[rest + n + p]).abs();
            let x = Vec3g::load(&cloth.position, vectors, n, v);
            let offset = x.minus(centre);
            let below = offset.dot(along).abs() <= half && offset.dot(across).abs() <= half;
            let is_under = (v == p && right_off.abs() <= half && up_off.abs() <= half)
                || (right <= reach && up <= reach && below);
            let mut mark = marks[environment * n + v] & comptime!(!(STENCIL as u32));
            let mut force = 0.0f32;
            if is_under {
                mark |= comptime!(STENCIL as u32);
                force = sheet.values[comptime!(press.force) + v] * pressure;
            }
            marks[environment * n + v] = mark;
            cloth.force[environment * n + v] = force;
        }
    }
}

/// Where the first side of a stencil with this normal runs: the x axis laid down there, or the y axis where it
/// stands upright.
#[cube]
fn first_side(normal: Vec3g) -> Vec3g {
    let mut axis = Vec3g::new(
        1.0f32 - normal.x * normal.x,
        -(normal.y * normal.x),
        -(normal.z * normal.x),
    );
    if axis.dot(axis).sqrt() <= 0.1f32 {
        axis = Vec3g::new(
            -(normal.x * normal.y),
            1.0f32 - normal.y * normal.y,
            -(normal.z * normal.y),
        );
    }
    axis.scale(1.0f32 / axis.dot(axis).sqrt())
}

/// Whether no yarn of a vertex is stretched so much that it would pull it off the tool.
#[cube]
fn is_slack(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    v: usize,
    #[comptime] n: usize,
    #[comptime] press: PressPlan,
) -> bool {
    let vectors = 3 * environment * n;
    let x = Vec3g::load(&cloth.position, vectors, n, v);
    let mut slack = true;
    #[unroll]
    for field in 0..4usize {
        let other = sheet.numbers[comptime!(press.neighbors + field * n) + v];
        if other != NOTHING {
            let d = Vec3g::load(&cloth.position, vectors, n, other as usize).minus(x);
            let most = sheet.values[comptime!(press.slack + field / 2 * n) + v];
            slack = slack && d.dot(d).sqrt() <= most;
        }
    }
    slack
}

/// Touches what was under the stencil, pushes it out of the tool, and fixes what stays there.
#[cube(launch_unchecked)]
pub(super) fn drape(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    marks: &mut [u32],
    pressed: &[u32],
    #[comptime] plan: Plan,
) {
    let environment = CUBE_POS_X as usize;
    let n = comptime!(plan.vertices);
    let press = comptime!(plan.press.expect("a world with presses"));
    let vectors = 3 * environment * n;
    let is_pressed = pressed[environment] != NOTHING;
    let tool = tool_of(&cloth.own, environment, comptime!(plan.grid));
    for v in range_stepped(UNIT_POS_X as usize, n, CUBE_DIM_X as usize) {
        let mark = marks[environment * n + v];
        if is_pressed && mark & comptime!((STENCIL | DRAPED) as u32) == comptime!(STENCIL as u32) {
            marks[environment * n + v] = mark | comptime!(TOUCHED as u32);
            let x = Vec3g::load(&cloth.position, vectors, n, v);
            let (phi, normal) = distance(sheet, x, tool, comptime!(plan.grid));
            // Tangent planes are a few substeps old: what they let in goes out again.
            if phi < 0.0f32 && cloth.inverse_mass[environment * n + v] > 0.0f32 {
                x.minus(normal.scale(phi))
                    .store(&mut cloth.position, vectors, n, v);
            }
        }
    }
    sync_storage();
    for v in range_stepped(UNIT_POS_X as usize, n, CUBE_DIM_X as usize) {
        let mark = marks[environment * n + v];
        if is_pressed && mark & comptime!((STENCIL | DRAPED) as u32) == comptime!(STENCIL as u32) {
            let mut held = is_slack(cloth, sheet, environment, v, n, press);
            #[unroll]
            for field in 0..4usize {
                let other = sheet.numbers[comptime!(press.neighbors + field * n) + v];
                if other != NOTHING {
                    held = held && is_slack(cloth, sheet, environment, other as usize, n, press);
                }
            }
            let x = Vec3g::load(&cloth.position, vectors, n, v);
            let (phi, _normal) = distance(sheet, x, tool, comptime!(plan.grid));
            if held && phi <= sheet.values[comptime!(press.threshold)] {
                marks[environment * n + v] = mark | comptime!(DRAPED as u32);
                cloth.inverse_mass[environment * n + v] = 0.0f32;
                Vec3g::zero().store(&mut cloth.velocity, vectors, n, v);
            }
        }
    }
}
