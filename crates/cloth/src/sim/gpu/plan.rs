//! A world as kernels see it: what is compiled into them, and their tables.

use std::sync::Arc;

use super::super::backend::World;
use super::super::device_error::DeviceError;
use super::super::edges::EdgeClass;
use super::super::law::{Direction, Limit};
use super::super::line::Line;
use super::super::lines::Lines;
use super::super::model::Pass;
use super::super::stencil::Stencil;
use super::super::view::{Mask, View};
use crate::fabric::Lamina;

/// Most threads of a workgroup.
pub(super) const MOST_UNITS: usize = 256;

/// Stands for no vertex.
pub(super) const NOTHING: u32 = u32::MAX;

/// What of a model is not computed.
const CURVE: &str = "shear by a curve of several slopes (`shear.positive`, `shear.negative`)";
const MEMBRANES: &str = "membranes: a blank whose outline or yarn angle cuts cells, or whose yarns \
                         stretch";
const FINE: &str = "contact between vertices: a tool finer than the cells of the blank";

/// What is compiled into the kernels of a world: sizes, which stages it has, and where the tables
/// begin among [`Tables::numbers`] and [`Tables::values`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Plan {
    /// Vertices of an environment.
    pub vertices: usize,
    /// Force densities of an environment, with room for those of lines shorter than the longest.
    pub slots: usize,
    /// Room for eliminated rows of an environment.
    pub scratch: usize,
    pub grid: GridPlan,
    /// Under the yarn solver, warps, wefts and rows of diagonals.
    pub lines: Option<[LinePlan; 3]>,
    /// Numbers: the vertex and the slot beside each vertex, before it and after it on its warp, then
    /// on its weft; [`NOTHING`] at their ends.
    pub beside: usize,
    /// Values: the greatest compression of the warp that lasts of each vertex, then of the weft.
    pub min_warm: usize,
    /// Values: the law of the diagonals.
    pub trellis: usize,
    /// Values: their locking.
    pub locking: Option<usize>,
    /// Values: tack of each vertex.
    pub tack: Option<usize>,
    pub passes: Vec<PassPlan>,
    pub has_friction: bool,
    pub has_cap: bool,
    pub press: Option<PressPlan>,
    pub look: Option<LookPlan>,
}

/// The grids of the tools, tool by tool. Values: first node and spacing [m], 1 / spacing. Numbers: nodes along
/// each axis, and the first of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct GridPlan {
    pub tools: usize,
    /// Of the first.
    pub nodes: [u32; 3],
    pub values: usize,
    pub headers: usize,
}

/// Lines that run in a direction; tables are [number along the line][line].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct LinePlan {
    pub lines: usize,
    pub longest: usize,
    /// Numbers: vertices.
    pub places: usize,
    /// Numbers: vertices of each line.
    pub sizes: usize,
    /// The first slot of their force densities.
    pub slots: usize,
    /// Values, [field][line]: rest length and its inverse, compliances in tension and compression,
    /// greatest compression that lasts, bending, and force, compliance and offset of the limit.
    pub laws: usize,
    pub is_limited: bool,
    pub is_bent: bool,
    pub answer: Answer,
    /// See [`Direction`].
    pub direction: usize,
}

/// What the edges of a line answer to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Answer {
    /// Length, with forces that last.
    Length,
    Shear,
    Locking,
}

/// Of the first vertex of a constraint these bits are its number, and those above them its direction: of an
/// edge see [`Direction`], of a triple its family.
pub(super) const DIRECTION: u32 = 30;
pub(super) const VERTEX: u32 = (1 << DIRECTION) - 1;

/// Constraints of one colour. Numbers, [end][constraint]: vertices. Values, [field][constraint]:
/// rest length and its inverse, compliances in tension and compression, and force, compliance and
/// offset of the limit; of triples the compliance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PassPlan {
    pub kind: PassKind,
    pub count: usize,
    pub places: usize,
    pub laws: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PassKind {
    Edges,
    LimitedEdges,
    Diagonals,
    LockingDiagonals,
    Triples,
}

/// How presses go. Values: rest position, along x then y, of each vertex; the force that a roller
/// presses each with; the greatest length of the warp edges beside each, then of the weft's, that
/// is slack; the threshold [m]. Numbers: the vertex before each on its warp, after it, and the same on its weft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PressPlan {
    pub rest: usize,
    pub force: usize,
    pub slack: usize,
    pub threshold: usize,
    pub neighbors: usize,
}

/// Most vertices next to another.
pub(super) const NEIGHBORS: usize = 8;

/// What is looked at and measured. Numbers: the vertex of each pixel of each view, or [`NOTHING`]; the vertices
/// next to each, [neighbor][vertex]; 1 of each vertex of a view's region; and of each yarn edge its vertices,
/// [end][edge]. Values: its length at rest [m].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct LookPlan {
    pub mask: Mask,
    pub pixels: usize,
    pub seen: usize,
    pub near: usize,
    pub inside: usize,
    pub edges: usize,
    pub rest: usize,
    pub edge_count: usize,
}

/// A plan with its tables.
#[derive(Default)]
pub(super) struct Tables {
    pub plan: Plan,
    pub numbers: Vec<u32>,
    pub values: Vec<f32>,
    /// Signed distances of the tools.
    pub samples: Vec<f32>,
    /// The slot of each force density of a snapshot.
    pub slots: Vec<usize>,
}

impl Tables {
    /// # Errors
    /// Names what of the world the GPU cannot compute.
    pub fn new(world: &World) -> Result<Self, DeviceError> {
        let model = &*world.model;
        let curve = model.lines.as_ref().and_then(|lines| lines.curve.as_ref());
        let listed = [
            (model.between.is_some(), FINE),
            (model.layers.is_some(), "`physics.self_collision`"),
            (!model.membranes.is_empty(), MEMBRANES),
            (curve.is_some(), CURVE),
        ];
        if let Some((_, what)) = listed.into_iter().find(|(is_listed, _)| *is_listed) {
            return Err(DeviceError::Missing(what));
        }
        let expected = "exact distances at sharp edges: give `tool.grid.spacing_mm`";
        let grids = world.tools.iter().map(|tool| tool.only_grid());
        let grids: Option<Vec<_>> = grids.collect();
        let grids = grids.ok_or(DeviceError::Missing(expected))?;
        let mut tables = Self {
            plan: Plan {
                vertices: model.vertex_count(),
                grid: GridPlan {
                    tools: grids.len(),
                    nodes: grids[0].parts().1.map(|count| count as u32),
                    ..GridPlan::default()
                },
                has_friction: model.friction.is_some(),
                has_cap: model.physics().speed_cap > 0.0,
                ..Plan::default()
            },
            ..Self::default()
        };
        let (mut values, mut headers) = (Vec::new(), Vec::new());
        for grid in grids {
            let ([x, y, z], nodes, samples) = grid.parts();
            let spacing = grid.spacing();
            values.extend([x, y, z, spacing, 1.0 / spacing]);
            headers.extend(nodes.map(|count| count as u32));
            headers.push(tables.samples.len() as u32);
            tables.samples.extend(samples);
        }
        tables.plan.grid.values = tables.add(values);
        tables.plan.grid.headers = tables.add_numbers(headers);
        let tack = model.tack.as_ref();
        tables.plan.tack = tack.map(|tack| tables.add(tack.iter().copied()));
        if let Some(lines) = &model.lines {
            tables.add_lines(lines);
        }
        for pass in &model.passes {
            tables.add_pass(pass)?;
        }
        if let Some((lamina, stencil)) = &world.presses {
            tables.add_press(lamina, stencil);
            tables.add_look(&world.views, lamina);
        }
        // Buffers hold something.
        tables.plan.slots = tables.plan.slots.max(1);
        tables.plan.scratch = tables.plan.scratch.max(1);
        tables.add_numbers([0]);
        Ok(tables)
    }

    /// Adds values, in single precision as the lanes of the CPU have them; returns where they begin.
    fn add(&mut self, values: impl IntoIterator<Item = f64>) -> usize {
        let first = self.values.len();
        self.values.extend(values.into_iter().map(|x| x as f32));
        first
    }

    fn add_numbers(&mut self, numbers: impl IntoIterator<Item = u32>) -> usize {
        let first = self.numbers.len();
        self.numbers.extend(numbers);
        first
    }

    fn add_lines(&mut self, lines: &Lines) {
        self.slots = vec![0; lines.edge_count];
        let of = [Direction::Warp, Direction::Weft, Direction::Diagonal];
        let of = of.map(|direction| self.add_lines_of(lines.of(direction), direction));
        let [warps, wefts, diagonals] = of;
        let diagonals = LinePlan {
            answer: Answer::Shear,
            ..diagonals
        };
        if let Some(trellis) = &lines.trellis {
            self.plan.trellis = self.add(trellis.numbers());
        }
        if let Some(locking) = &lines.locking {
            self.plan.locking = Some(self.add(locking.numbers()));
        }
        let n = self.plan.vertices;
        let mut beside = vec![NOTHING; 8 * n];
        let mut min_warm = vec![0.0; 2 * n];
        for (family, lines) in [&lines.warps, &lines.wefts].into_iter().enumerate() {
            for line in lines {
                for &v in &line.vertices {
                    min_warm[family * n + v as usize] = line.min_warm();
                }
                for (ends, edge) in line.vertices.windows(2).zip(line.edges.clone()) {
                    let slot = self.slots[edge] as u32;
                    for (v, other, after) in [(ends[1], ends[0], 0), (ends[0], ends[1], 1)] {
                        let field = 2 * (2 * family + after);
                        beside[field * n + v as usize] = other;
                        beside[(field + 1) * n + v as usize] = slot;
                    }
                }
            }
        }
        self.plan.beside = self.add_numbers(beside);
        self.plan.min_warm = self.add(min_warm);
        self.plan.lines = Some([warps, wefts, diagonals]);
    }

    fn add_lines_of(&mut self, all: &[Line], direction: Direction) -> LinePlan {
        let sizes = all.iter().map(|line| line.vertices.len());
        let longest = sizes.clone().max().unwrap_or(0);
        let lines = all.len();
        let mut places = vec![0; longest * lines];
        for (l, line) in all.iter().enumerate() {
            for (k, &v) in line.vertices.iter().enumerate() {
                places[k * lines + l] = v;
            }
            for (k, edge) in line.edges.clone().enumerate() {
                self.slots[edge] = self.plan.slots + k * lines + l;
            }
        }
        let fields: [fn(&Line) -> f64; 6] = [
            |line| line.rest_length,
            |line| 1.0 / line.rest_length,
            |line| line.law.tension,
            |line| line.law.compression,
            |line| line.min_warm(),
            |line| line.bending,
        ];
        let limits = all.iter().map(|line| line.limit.unwrap_or(Limit::NONE));
        let mut laws = by_field(all, fields);
        laws.extend(limit_laws(&limits.collect::<Vec<_>>()));
        let plan = LinePlan {
            lines,
            longest,
            places: self.add_numbers(places),
            sizes: self.add_numbers(sizes.map(|size| size as u32)),
            slots: self.plan.slots,
            laws: self.add(laws),
            is_limited: all.iter().any(|line| line.limit.is_some()),
            is_bent: all.iter().any(|line| line.bending != 0.0),
            answer: Answer::Length,
            direction: direction as usize,
        };
        if all.iter().any(|line| !line.edges.is_empty()) {
            self.plan.slots += lines * (longest - 1);
        }
        let rows = if plan.is_bent { 5 } else { 2 };
        self.plan.scratch = self.plan.scratch.max(rows * lines * longest);
        plan
    }

    fn add_pass(&mut self, pass: &Pass) -> Result<(), DeviceError> {
        let (kind, ends, laws) = match pass {
            Pass::Edges(class, limits) => {
                let mut laws = edge_laws(class);
                laws.extend(limit_laws(limits));
                let kind = match limits.is_empty() {
                    true => PassKind::Edges,
                    false => PassKind::LimitedEdges,
                };
                (kind, edge_ends(class), laws)
            }
            Pass::Diagonals(class, trellis) => {
                self.plan.trellis = self.add(trellis.numbers());
                (PassKind::Diagonals, edge_ends(class), edge_laws(class))
            }
            Pass::Triples(triples) => {
                let ends = triples.iter().map(|t| (t.vertices, t.family as u32));
                let laws = triples.iter().map(|triple| triple.compliance).collect();
                (PassKind::Triples, by_end(ends), laws)
            }
            Pass::Hinges(_) => {
                return Err(DeviceError::Missing("`physics.bending = \"dihedral\"`"));
            }
            Pass::LockingDiagonals(class, locking) => {
                self.plan.locking = Some(self.add(locking.numbers()));
                let kind = PassKind::LockingDiagonals;
                (kind, edge_ends(class), edge_laws(class))
            }
            Pass::CurvedDiagonals(..) => return Err(DeviceError::Missing(CURVE)),
            Pass::Membrane(_) | Pass::CurvedMembrane(..) | Pass::LockingMembrane(..) => {
                return Err(DeviceError::Missing(MEMBRANES));
            }
        };
        let count = match kind {
            PassKind::Triples => ends.len() / 3,
            _ => ends.len() / 2,
        };
        let pass = PassPlan {
            kind,
            count,
            places: self.add_numbers(ends),
            laws: self.add(laws),
        };
        self.plan.passes.push(pass);
        Ok(())
    }

    fn add_press(&mut self, lamina: &Lamina, stencil: &Stencil) {
        let n = self.plan.vertices;
        let pressure = stencil.roller.pressure;
        let areas = lamina.vertex_areas().into_iter();
        let mut slack = vec![0.0; 2 * n];
        let mut neighbors = vec![NOTHING; 4 * n];
        for (yarn, ends @ [from, to]) in lamina.yarn_edges() {
            let family = yarn.family as usize * n;
            neighbors[2 * family + to as usize] = from;
            neighbors[2 * family + n + from as usize] = to;
            for v in ends {
                slack[family + v as usize] = yarn.rest_length * (1.0 + stencil.max_strain);
            }
        }
        let along = |k: usize| lamina.rest.iter().map(move |at| at[k]);
        self.plan.press = Some(PressPlan {
            rest: self.add(along(0).chain(along(1))),
            force: self.add(areas.map(|area| pressure * area)),
            slack: self.add(slack),
            threshold: self.add([stencil.threshold]),
            neighbors: self.add_numbers(neighbors),
        });
    }

    fn add_look(&mut self, views: &[Arc<View>], lamina: &Lamina) {
        let Some(&View {
            pixel_count: pixels,
            mask,
            ..
        }) = views.first().map(|view| &**view)
        else {
            return;
        };
        let n = self.plan.vertices;
        let mut seen = vec![NOTHING; views.len() * pixels];
        for (view, seen) in views.iter().zip(seen.chunks_mut(pixels)) {
            for (&pixel, &vertex) in view.pixels.iter().zip(&view.vertices) {
                seen[pixel as usize] = vertex;
            }
        }
        let mut near = vec![NOTHING; NEIGHBORS * n];
        for v in 0..n {
            for (i, other) in lamina.neighbors(v as u32).enumerate() {
                near[i * n + v] = other;
            }
        }
        let inside = views.iter().flat_map(|view| {
            let is_inside = |v| u32::from(view.region.contains(v));
            (0..n).map(is_inside)
        });
        let edges = || lamina.yarn_edges();
        let ends = [0, 1].map(|k| edges().map(move |(_, ends)| ends[k]).collect::<Vec<_>>());
        let rest: Vec<f64> = edges().map(|(yarn, _)| yarn.rest_length).collect();
        self.plan.look = Some(LookPlan {
            mask,
            pixels,
            seen: self.add_numbers(seen),
            near: self.add_numbers(near),
            inside: self.add_numbers(inside.collect::<Vec<_>>()),
            edges: self.add_numbers(ends.concat()),
            edge_count: rest.len(),
            rest: self.add(rest),
        });
    }
}

/// The vertices of edges, with their directions.
fn edge_ends(class: &EdgeClass) -> Vec<u32> {
    let directions = class.direction.iter().map(|&direction| direction as u32);
    by_end(class.vertices.iter().copied().zip(directions))
}

/// Rest lengths and their inverses, compliances in tension and in compression.
fn edge_laws(class: &EdgeClass) -> Vec<f64> {
    let mut laws = by_field(&class.rest_length, [|rest| *rest, |rest| 1.0 / rest]);
    laws.extend(by_field(
        &class.law,
        [|law| law.tension, |law| law.compression],
    ));
    laws
}

/// Force, compliance and offset of limits.
fn limit_laws(limits: &[Limit]) -> Vec<f64> {
    by_field(limits, [|l| l.force, |l| l.compliance, |l| l.offset])
}

/// [field][of all].
fn by_field<T, const N: usize>(all: &[T], fields: [fn(&T) -> f64; N]) -> Vec<f64> {
    let of = |field: fn(&T) -> f64| all.iter().map(field);
    fields.into_iter().flat_map(of).collect()
}

/// [end][constraint], the direction of each above its first vertex.
fn by_end<const N: usize>(all: impl Iterator<Item = ([u32; N], u32)>) -> Vec<u32> {
    let mut ends = [const { Vec::new() }; N];
    for (mut vertices, direction) in all {
        vertices[0] |= direction << DIRECTION;
        for (end, v) in ends.iter_mut().zip(vertices) {
            end.push(v);
        }
    }
    ends.concat()
}
