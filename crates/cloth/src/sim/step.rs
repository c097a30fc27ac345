//! The substep of both solvers (paper, Algorithm 1), for all lanes at once. Everything here is
//! inlined into [`Substeps::run`], so that it is compiled for the instruction set in use.

use std::ops::Range;

use super::bend::bend;
use super::between::leave;
use super::cloth::Cloth;
use super::contact::{conclude, refresh};
use super::curve::shear_by_curve;
use super::frame::Frame;
use super::length::{give_way, pull_after, stretch};
use super::line::{Chain, Direction};
use super::lines::Lines;
use super::locking::lock;
use super::membrane;
use super::model::Model;
use super::press::{self, Press};
use super::shear::shear;
use super::stepping::Control;
use super::storage::Storage;
use crate::math::{Kernel, Lanes, Vec3x};
use crate::tool::Tools;

/// Consecutive substeps of a control step, between two refreshes of the tangent planes.
pub(super) struct Substeps<'a, S: Storage> {
    pub model: &'a Model,
    pub tools: &'a Tools<'a, S::V>,
    pub control: &'a Control,
    pub presses: &'a [Press],
    pub range: Range<usize>,
    pub storage: &'a mut S,
}

/// Runs a control step.
pub(super) fn step<S: Storage>(
    model: &Model,
    tools: &Tools<S::V>,
    control: &Control,
    presses: &[Press],
    storage: &mut S,
) {
    let mut interval = control.contact_interval;
    if let Some(between) = &model.between {
        let h = control.dt / control.substeps as f64;
        interval = interval.min(between.most_substeps(h, model.physics().speed_cap));
    }
    for first in (0..control.substeps).step_by(interval) {
        S::V::vectorize(Substeps {
            model,
            tools,
            control,
            presses,
            range: first..(first + interval).min(control.substeps),
            storage,
        });
    }
}

impl<S: Storage> Kernel for Substeps<'_, S> {
    #[inline(always)]
    fn run(self) {
        let (model, storage) = (self.model, self.storage);
        let (control, presses) = (self.control, self.presses);
        let scales = &storage.cloth_mut().scales;
        let frame = Frame::new(model.physics(), model.friction, scales, control);
        refresh(self.tools, storage.cloth_mut());
        if let Some(between) = &model.between {
            if self.range.start == 0 {
                // Control steps begin from what snapshots hold.
                storage.cloth_mut().touched.clear();
            }
            let slot = |lane, vertex| storage.slot(lane, vertex);
            let span = frame.h * self.range.len() as f64;
            let touched = between.look(self.tools, storage.cloth(), slot, (presses, span));
            storage.cloth_mut().touched = touched;
        }
        let touches = { &storage.cloth().touched }
            .iter()
            .any(|one| !one.touches.is_empty());
        let has_more = touches || model.layers.is_some() || !model.membranes.is_empty();
        let warps_are_last = model.lines.is_some() && !has_more;
        predict(&frame, storage);
        let end = self.range.end;
        for substep in self.range {
            let goes_on = substep + 1 < end;
            match &model.lines {
                // Yarns have the last word before the tool, and membranes that stand for them: their
                // stiffness is greatest, so what comes after them shows as strain.
                Some(lines) => {
                    warm_start_and_bend_warps(model, lines, &frame, storage);
                    grip(model, presses, storage);
                    shear_along_diagonals(lines, storage);
                    storage.project(&model.passes);
                    for sweep in 1..=control.sweeps {
                        push(model, &frame, presses, storage);
                        stretch_wefts(lines, sweep == 1, storage);
                        let is_last = sweep == control.sweeps && warps_are_last;
                        stretch_warps(lines, is_last.then_some(&frame), goes_on, storage);
                        for _ in 0..membrane::SWEEPS {
                            storage.stretch_membranes(&model.membranes);
                        }
                    }
                }
                None => {
                    fall(&frame, storage);
                    push(model, &frame, presses, storage);
                    storage.project(&model.passes);
                }
            }
            if let Some(layers) = &model.layers {
                storage.separate(layers);
            }
            if touches {
                leave(&frame, storage.cloth_mut());
            }
            if !warps_are_last {
                finish_all(&frame, goes_on, storage);
            }
        }
    }
}

/// Position at the start of a substep, and where its velocity takes every vertex.
#[inline(always)]
fn predict<S: Storage>(frame: &Frame<S::V>, storage: &mut S) {
    let cloth = storage.cloth_mut();
    for v in 0..cloth.position.len() {
        let x = cloth.position[v];
        cloth.previous[v] = x;
        cloth.predicted[v] = x + cloth.velocity[v].scale(S::V::of(frame.h));
    }
}

/// Weight, by Gauss-Seidel.
#[inline(always)]
fn fall<S: Storage>(frame: &Frame<S::V>, storage: &mut S) {
    let cloth = storage.cloth_mut();
    for v in 0..cloth.position.len() {
        let w = cloth.inverse_mass[v];
        cloth.mobility[v] = w * S::V::of(frame.h * frame.h);
        let fall = S::V::select(S::V::zero().lt(w), S::V::of(frame.fall), S::V::zero());
        let Vec3x([x, y, z]) = cloth.predicted[v];
        cloth.position[v] = Vec3x([x, y, z + fall]);
    }
}

/// What the yarns' forces of the last substep and weight do, and the warps' bending.
#[inline(always)]
fn warm_start_and_bend_warps<S: Storage>(
    model: &Model,
    lines: &Lines,
    frame: &Frame<S::V>,
    storage: &mut S,
) {
    storage.warm_start(&model.membranes);
    for i in 0..storage.count(lines, Direction::Warp) {
        let mut before = (Vec3x::zero(), S::V::zero());
        let (warp, cloth) = storage.warp(lines, i);
        let law = cloth.scales.of_line(Direction::Warp, warp.law());
        for k in 0..storage.warp(lines, i).0.vertices().len() {
            let v = storage.warp(lines, i).0.vertices()[k] as usize;
            let weft = storage.weft_pull(lines, v);
            let (warp, cloth) = storage.warp(lines, i);
            let density = &cloth.density[warp.edges()];
            let after = pull_after(warp, law.min_warm, k, &cloth.predicted, density);
            let pull = weft.0 - before.0 + after.0;
            let stress = weft.1 + before.1 + after.1;
            before = after;
            let x = [cloth.previous[v], cloth.predicted[v], pull];
            let moved = give_way(frame, cloth.inverse_mass[v], x, stress);
            (cloth.mobility[v], cloth.position[v]) = moved;
        }
        let (warp, cloth) = storage.warp(lines, i);
        bend(cloth.along(warp, Direction::Warp));
    }
}

#[inline(always)]
fn shear_along_diagonals<S: Storage>(lines: &Lines, storage: &mut S) {
    if let Some(trellis) = &lines.trellis {
        for i in 0..storage.count(lines, Direction::Diagonal) {
            let mut row = storage.take(lines, Direction::Diagonal, i);
            match &lines.curve {
                Some(curve) => shear_by_curve(row.again(), curve),
                None => shear(row.again(), trellis),
            }
            if let Some(locking) = &lines.locking {
                lock(row, locking);
            }
            storage.put(Direction::Diagonal, i);
        }
    }
}

#[inline(always)]
fn stretch_wefts<S: Storage>(lines: &Lines, and_bend: bool, storage: &mut S) {
    for i in 0..storage.count(lines, Direction::Weft) {
        let mut weft = storage.take(lines, Direction::Weft, i);
        if and_bend {
            bend(weft.again());
        }
        stretch(weft);
        storage.put(Direction::Weft, i);
    }
}

/// Length of each warp and, where a frame is given, the end of its vertices' substep while they are
/// at hand.
#[inline(always)]
fn stretch_warps<S: Storage>(
    lines: &Lines,
    frame: Option<&Frame<S::V>>,
    goes_on: bool,
    storage: &mut S,
) {
    for i in 0..storage.count(lines, Direction::Warp) {
        let (warp, cloth) = storage.warp(lines, i);
        stretch(cloth.along(warp, Direction::Warp));
        if let Some(frame) = frame {
            let vertices = warp.vertices().iter().map(|&v| v as usize);
            finish(vertices, frame, goes_on, cloth);
        }
    }
}

#[inline(always)]
fn grip<S: Storage>(model: &Model, presses: &[Press], storage: &mut S) {
    let Some(friction) = model.friction else {
        return;
    };
    for press in presses {
        for &(vertex, force) in &press.forces {
            let slot = storage.slot(press.environment, vertex as usize);
            press::grip(slot, force, friction, storage.cloth_mut());
        }
    }
}

#[inline(always)]
fn push<S: Storage>(model: &Model, frame: &Frame<S::V>, presses: &[Press], storage: &mut S) {
    for press in presses {
        let reach = frame.h * press.speed;
        for &(vertex, force) in &press.forces {
            let slot = storage.slot(press.environment, vertex as usize);
            let beneath = match &model.layers {
                Some(layers) => storage.beneath(layers, press.environment, vertex as usize),
                None => 0.0,
            };
            press::push(slot, force, reach, beneath, storage.cloth_mut());
        }
    }
}

#[inline(always)]
fn finish_all<S: Storage>(frame: &Frame<S::V>, goes_on: bool, storage: &mut S) {
    let cloth = storage.cloth_mut();
    finish(0..cloth.position.len(), frame, goes_on, cloth);
}

/// Contact, friction and velocity of some vertices; and the prediction of the next substep, if one
/// `goes_on`.
#[inline(always)]
fn finish<V: Lanes>(
    vertices: impl Iterator<Item = usize>,
    frame: &Frame<V>,
    goes_on: bool,
    cloth: &mut Cloth<V>,
) {
    // A constant where this is inlined, so that tack costs nothing where there is none.
    if cloth.tack.is_empty() {
        for v in vertices {
            conclude(v, frame, None, goes_on, cloth);
        }
    } else {
        for v in vertices {
            conclude(v, frame, Some(cloth.tack[v]), goes_on, cloth);
        }
    }
}
