//! The lines of a lamina, built from what their stages say.

use super::bend::along_yarn;
use super::curve::{ShearCurve, shear_curve};
use super::law::{EdgeLaw, Limit};
use super::length::yarn_law;
use super::line::{Direction, Line};
use super::locking::{Locking, locking};
use super::physics::PhysicsConfig;
use super::shear::{self, Trellis};
use crate::fabric::Lamina;

/// The lines of a lamina. Of the warps and of the wefts each holds every vertex once: where
/// no yarn runs, a line of one vertex stands in.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    pub warps: Vec<Line>,
    pub wefts: Vec<Line>,
    pub diagonals: Vec<Line>,
    /// Law of the diagonals; none without shear.
    pub trellis: Option<Trellis>,
    /// That of a curve with several slopes.
    pub curve: Option<ShearCurve>,
    /// What they gain at large shear, where listed.
    pub locking: Option<Locking>,
    /// The edges of wefts beside each vertex.
    pub beside: Vec<Beside>,
    /// Edges of all yarns.
    pub edge_count: usize,
    /// Vertices of the longest line.
    pub longest: usize,
}

/// The edges of a weft beside a vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Beside {
    /// Vertex and edge before it, and after it.
    pub before: Option<[u32; 2]>,
    pub after: Option<[u32; 2]>,
    /// See [`Line::min_warm`].
    pub min_warm: f64,
}

fn beside(wefts: &[Line], vertex_count: usize) -> Vec<Beside> {
    let mut beside = vec![Beside::default(); vertex_count];
    for weft in wefts {
        for (ends, edge) in weft.vertices.windows(2).zip(weft.edges.clone()) {
            let [from, to] = [ends[0], ends[1]];
            beside[from as usize].after = Some([to, edge as u32]);
            beside[to as usize].before = Some([from, edge as u32]);
        }
        for &v in &weft.vertices {
            beside[v as usize].min_warm = weft.min_warm();
        }
    }
    beside
}

impl Lines {
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig, trellis: Option<Trellis>) -> Self {
        let mut edge_count = 0;
        let mut families = [Vec::new(), Vec::new()];
        for yarn in &lamina.yarns {
            let first = edge_count;
            edge_count += yarn.vertices.len() - 1;
            let law = yarn_law(lamina, yarn);
            families[yarn.family as usize].push(Line {
                vertices: yarn.vertices.clone(),
                edges: first..edge_count,
                rest_length: yarn.rest_length,
                law,
                limit: Limit::of_yarn(law, lamina, physics, yarn),
                bending: along_yarn(lamina, physics, yarn.family, [yarn.width, yarn.rest_length]),
            });
        }
        let [warps, wefts] = families.map(|lines| with_lone_vertices(lines, lamina));
        let diagonals = (trellis.as_ref()).map_or(Vec::new(), |t| shear::rows(lamina, t.at_rest));
        let all = warps.iter().chain(&wefts).chain(&diagonals);
        Self {
            longest: all.map(|line| line.vertices.len()).max().unwrap_or(0),
            beside: beside(&wefts, lamina.vertex_count()),
            warps,
            wefts,
            diagonals,
            trellis,
            curve: shear_curve(lamina, physics),
            locking: locking(lamina, physics),
            edge_count,
        }
    }

    /// The lines that run in a direction.
    #[inline(always)]
    pub fn of(&self, direction: Direction) -> &[Line] {
        match direction {
            Direction::Warp => &self.warps,
            Direction::Weft => &self.wefts,
            Direction::Diagonal => &self.diagonals,
        }
    }
}

fn with_lone_vertices(mut lines: Vec<Line>, lamina: &Lamina) -> Vec<Line> {
    let mut held = vec![false; lamina.vertex_count()];
    for &v in lines.iter().flat_map(|line| &line.vertices) {
        held[v as usize] = true;
    }
    for v in (0..held.len()).filter(|&v| !held[v]) {
        lines.push(Line {
            vertices: vec![v as u32],
            edges: 0..0,
            rest_length: 1.0,
            law: EdgeLaw {
                tension: 1.0,
                compression: 1.0,
            },
            limit: None,
            bending: 0.0,
        });
    }
    lines
}

#[cfg(test)]
mod tests;
