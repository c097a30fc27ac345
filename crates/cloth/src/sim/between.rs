//! Contact between the vertices: points of the cloth's triangles leave a tool that is finer than they are.
//!
//! A vertex knows nothing of a fin that stands between it and the next. So where the tool has [`Features`],
//! triangles near them are looked at on a lattice of points, and each is pushed out of the tool's tangent plane
//! as vertices are, by what its corners share of it. The lattice is as fine as the tool's thinnest wall asks
//! for. Scalars, environment by environment: few triangles are near features at a time. A tool without
//! features has no such stage.

use std::collections::HashSet;
use std::f64::consts::SQRT_2;

use rayon::prelude::*;

use super::cloth::{Cloth, Touch, Touched};
use super::frame::Frame;
use super::press::Press;
use crate::fabric::Lamina;
use crate::math::{Lanes, Vec3, Vec3x};
use crate::tool::{Features, SMOOTH, Tool, Tools};

/// How far cloth may come before planes are refreshed [m]: a few substeps at the speed of presses. It is refreshed
/// as often as that asks for.
const TRAVEL: f64 = 14e-3;

/// How far cloth may come that nothing presses and that moves slowly [m].
const CALM: f64 = 2e-3;

/// A triangle whose corners have moved less than this is not looked at again [m].
const STILL: f64 = 2e-5;

/// Fastest that cloth is expected to move without a cap on its speed [m/s].
const FASTEST: f64 = 4.0;

/// Fewest and most parts of a side of a triangle. A ridge of 90 degrees then lies in the cloth by an eleventh of
/// a cell at most, and walls of a quarter of a cell are held at both of their edges.
const PARTS: [f64; 2] = [4.0, 16.0];

/// Parts of a side over the slope of a tip, which then reaches through the cloth by no more than edges may.
const AT_TIPS: f64 = 3.6;

/// What is less deep when its corners lie on their planes, in lengths of a cell's diagonal, is held by those, if the
/// cosines between all normals are greater.
const HELD: f64 = 0.02;
const ALIKE: f64 = 0.9;

/// What contact between vertices looks at.
#[derive(Debug)]
pub(super) struct Between {
    features: Features,
    triangles: Vec<Triangle>,
    /// Barycentric coordinates of the lattice, and on which side each point lies if on any.
    lattice: Vec<([f64; 3], Option<usize>)>,
    /// Longest side at rest [m].
    length: f64,
}

#[derive(Debug)]
struct Triangle {
    corners: [u32; 3],
    /// Sides that are no other triangle's.
    owns: [bool; 3],
}

/// What contact holds over a tool that is finer than the cells of a blank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// How deep cloth may come to lie in the tool [m].
    pub depth: f64,
    /// The widest cells that hold its thinnest wall [m].
    pub cell: f64,
}

impl Between {
    /// For a blank that is laid flat at `flat` [m]; none where the tool under it is smooth at the scale of its
    /// cells. What lies more than a cell beside the flat blank is not looked at.
    pub fn new(lamina: &Lamina, tool: &Tool, flat: &[[f64; 3]]) -> Option<Self> {
        let length = lamina.cell_diagonal();
        let of = |k: usize, pick: fn(f64, f64) -> f64| flat.iter().map(|x| x[k]).reduce(pick);
        let least = [of(0, f64::min)? - length, of(1, f64::min)? - length];
        let most = [of(0, f64::max)? + length, of(1, f64::max)? + length];
        // The middle of a triangle lies no farther from any place on it.
        let reach = [CALM, TRAVEL].map(|travel| length / 1.5 + travel);
        let features = tool.features(length, [least, most], reach)?;
        let cell = length / SQRT_2;
        let parts = (2.0 * cell / features.thinnest).max(AT_TIPS * features.steepest);
        let parts = parts.ceil().clamp(PARTS[0], PARTS[1]);
        let mut sides = HashSet::new();
        let triangle = |&[a, b, c]: &[u32; 3]| Triangle {
            corners: [a, b, c],
            owns: [[b, c], [c, a], [a, b]].map(|[v, w]| sides.insert([v.min(w), v.max(w)])),
        };
        let triangles = lamina.triangles.iter().map(triangle).collect();
        let count = parts as usize;
        let mut lattice = Vec::new();
        for (i, j) in (0..=count).flat_map(|i| (0..=count - i).map(move |j| (i, j))) {
            let numbers = [i, j, count - i - j];
            if !numbers.contains(&count) {
                let side = numbers.iter().position(|&n| n == 0);
                lattice.push((numbers.map(|n| n as f64 / parts), side));
            }
        }
        Some(Self {
            features,
            triangles,
            lattice,
            length,
        })
    }

    /// How deep cloth may come to lie in the tool all the same [m], and the widest cells whose lattice
    /// holds it at both edges of its thinnest wall [m].
    pub fn tolerance(&self) -> Tolerance {
        let wall = self.features.thinnest;
        Tolerance {
            depth: (0.25 * wall).min(SMOOTH * self.length),
            cell: 0.5 * PARTS[1] * wall,
        }
    }

    /// The points between the vertices of a sheet at `x` [m] that may come near features on the way down.
    pub fn points(&self, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let between = |t: &Triangle| {
            let corners = t.corners.map(|v| Vec3::from(x[v as usize]));
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            let is_near = self.features.zones[1].has_column(middle);
            let points = self.of(t).filter(|_| is_near);
            points
                .map(|weights| place(corners, weights).into())
                .collect::<Vec<_>>()
        };
        self.triangles.iter().flat_map(between).collect()
    }

    /// Most substeps of `h` [s] between two refreshes, at a speed of `cap` [m/s] at most, 0 without.
    pub fn most_substeps(&self, h: f64, cap: f64) -> usize {
        let speed = if cap > 0.0 { cap } else { FASTEST };
        ((TRAVEL / (speed * h)) as usize).max(1)
    }

    /// The lattice of a triangle, without what is another's.
    fn of<'a>(&'a self, triangle: &'a Triangle) -> impl Iterator<Item = [f64; 3]> + 'a {
        let is_own = |side: &Option<usize>| side.is_none_or(|side| triangle.owns[side]);
        let own = self.lattice.iter().filter(move |(_, side)| is_own(side));
        own.map(|(weights, _)| *weights)
    }

    /// The triangles near features, with those of their points that planes at their corners do not hold off the tool;
    /// `slot` tells place and lane of a vertex of an environment, `presses` who is pressed, and `span` how long
    /// planes stay [s].
    #[inline(never)]
    pub fn look<V: Lanes>(
        &self,
        tools: &Tools<V>,
        cloth: &Cloth<V>,
        slot: impl Fn(usize, usize) -> [usize; 2] + Sync,
        (presses, span): (&[Press], f64),
    ) -> Vec<Touched> {
        let in_triangle = |lane: usize, number: usize| -> Option<Touched> {
            let triangle = &self.triangles[number];
            let corners = triangle.corners.map(|v| slot(lane, v as usize));
            let of =
                |all: &[Vec3x<V>]| corners.map(|[place, lane]| Vec3::from(all[place].get(lane)));
            let (x, velocity) = (of(&cloth.position), of(&cloth.velocity));
            let is_pressed = presses.iter().any(|press| press.environment == lane);
            let is_calm = |v: &Vec3| 2.0 * v.norm() * span < CALM;
            let (zone, travel) = match !is_pressed && velocity.iter().all(is_calm) {
                true => (&self.features.zones[0], CALM),
                false => (&self.features.zones[1], TRAVEL),
            };
            if !zone.has((x[0] + x[1] + x[2]) / 3.0) {
                return None;
            }
            let name = [lane, number];
            let known = cloth
                .touched
                .binary_search_by_key(&name, |one| one.triangle);
            let known = known.ok().map(|k| &cloth.touched[k]);
            let is_still = |one: &&Touched| {
                (0..3).all(|k| (x[k] - one.x[k]).norm() < STILL) && one.travel >= travel
            };
            if let Some(known) = known.filter(is_still) {
                return Some(known.clone());
            }
            let planes = corners.map(|[place, lane]| {
                let plane = &cloth.plane[place];
                (Vec3::from(plane.normal.get(lane)), plane.offset.get(lane))
            });
            let heights = [0, 1, 2].map(|k| planes[k].0.dot(&x[k]) - planes[k].1);
            let lying = [0, 1, 2].map(|k| x[k] - planes[k].0 * heights[k]);
            let tool = tools.of(lane);
            let touch = |weights: [f64; 3]| {
                let at = place(x, weights);
                // Distances change by no more than one moves.
                if (0..3).any(|k| heights[k] - (at - x[k]).norm() > travel) {
                    return None;
                }
                let (phi, normal) = tool.distance(at.into());
                let normal = Vec3::from(normal);
                let offset = normal.dot(&at) - phi;
                let depth = offset - normal.dot(&place(lying, weights));
                let is_alike = planes.iter().all(|(other, _)| normal.dot(other) > ALIKE);
                let is_held = is_alike && depth < HELD * self.length;
                (phi < travel && !is_held).then_some(Touch {
                    corners,
                    weights,
                    normal,
                    offset,
                })
            };
            let touches = self.of(triangle).filter_map(touch).collect();
            Some(Touched {
                triangle: name,
                x,
                travel,
                touches,
            })
        };
        let lanes = 0..cloth.own.len();
        let of_lane = |lane: usize| {
            let all = (0..self.triangles.len()).into_par_iter().with_min_len(256);
            all.filter_map(move |number| in_triangle(lane, number))
                .collect::<Vec<_>>()
        };
        lanes.flat_map(of_lane).collect()
    }
}

fn place(corners: [Vec3; 3], weights: [f64; 3]) -> Vec3 {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

/// Pushes points out of the tool, one after the other, and holds or slows what slides on it, as contact
/// does with vertices: a corner of weight w moves by w m⁻¹ / (sum of w² m⁻¹) of what the point has to.
#[inline(never)]
pub(super) fn leave<V: Lanes>(frame: &Frame<V>, cloth: &mut Cloth<V>) {
    let touched = std::mem::take(&mut cloth.touched);
    for Touch {
        corners,
        weights,
        normal,
        offset,
    } in touched.iter().flat_map(|one| &one.touches)
    {
        let of = |all: &[Vec3x<V>]| {
            place(
                corners.map(|[place, lane]| all[place].get(lane).into()),
                *weights,
            )
        };
        let x = of(&cloth.position);
        let depth = offset - normal.dot(&x);
        if depth <= 0.0 || depth.is_nan() {
            continue;
        }
        let mobile = [0, 1, 2].map(|k| {
            let [place, lane] = corners[k];
            weights[k] * cloth.inverse_mass[place].get(lane)
        });
        let sum: f64 = (0..3).map(|k| weights[k] * mobile[k]).sum();
        if sum <= 0.0 {
            continue;
        }
        let mut push = normal * depth;
        if let Some(friction) = frame.friction {
            let [stick, slide] = friction.map(|mu| mu.get(corners[0][1]) * depth);
            let moved = x + push - of(&cloth.previous);
            let along = moved - normal * normal.dot(&moved);
            let slip = along.norm();
            push -= match slip <= stick {
                true => along,
                false => along * (slide / slip).min(1.0),
            };
        }
        for ([place, lane], mobile) in corners.iter().zip(mobile) {
            let at = Vec3::from(cloth.position[*place].get(*lane)) + push * (mobile / sum);
            cloth.position[*place].set(*lane, at.into());
        }
    }
    cloth.touched = touched;
}
