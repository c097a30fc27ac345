use super::cloth::Cloth;
use super::collision::{Around, Layers, SelfContact};
use super::length::{Held, pull_of};
use super::line::{Along, Direction, Line};
use super::lines::Lines;
use super::membrane::{Element, project_elements, warm_start_elements};
use super::model::{Model, Pass};
use super::parameters::Own;
use super::storage::Storage;
use crate::math::{Kernel, Lanes, Vec3x};
use crate::tool::Tools;

/// A group of environments, one in every lane: a place is a vertex.
pub(super) struct InLanes<V: Lanes> {
    cloth: Cloth<V>,
    self_contact: Option<Box<SelfContact<V>>>,
    /// What membranes do to their corners; empty without any whose forces last.
    held: Held<V>,
}

impl<V: Lanes> InLanes<V> {
    /// A group for `model`, of which so many environments are used, with every vertex free and at rest
    /// in the origin.
    pub fn new(model: &Model, used: usize) -> Self {
        let count = model.vertex_count();
        let of_lines = |lines: &Lines| (lines.edge_count, lines.longest);
        let (yarn_edges, longest) = model.lines.as_ref().map_or((0, 0), of_lines);
        let has_lasting = model.edge_count > yarn_edges;
        let mut cloth = Cloth::new(count, model.edge_count, longest);
        cloth.inverse_mass = model.inverse_mass.iter().map(|&w| V::of(w)).collect();
        cloth.own = vec![Own::default(); used];
        cloth.tack = model.tack.iter().flatten().map(|&t| V::of(t)).collect();
        Self {
            cloth,
            self_contact: (model.layers.is_some()).then(|| Box::new(SelfContact::new(count))),
            held: Held::new(if has_lasting { count } else { 0 }),
        }
    }
}

impl<V: Lanes> Storage for InLanes<V> {
    type V = V;
    type Line = Line;

    fn lanes(&self) -> usize {
        V::COUNT
    }

    fn slot(&self, lane: usize, vertex: usize) -> [usize; 2] {
        [vertex, lane]
    }

    fn edge_slot(&self, lane: usize, edge: usize) -> [usize; 2] {
        [edge, lane]
    }

    fn cloth(&self) -> &Cloth<V> {
        &self.cloth
    }

    #[inline(always)]
    fn cloth_mut(&mut self) -> &mut Cloth<V> {
        &mut self.cloth
    }

    fn clear(&mut self, lane: usize, sides: &[u64]) {
        if let Some(contact) = &mut self.self_contact {
            contact.load(lane, sides);
        }
    }

    fn sides(&self, lane: usize) -> Vec<u64> {
        (self.self_contact.as_ref()).map_or(Vec::new(), |contact| contact.sides(lane))
    }

    fn start(&mut self) {
        if let Some(contact) = &mut self.self_contact {
            contact.start();
        }
    }

    fn distances(&self, tools: &Tools<V>, vertices: &[&[u32]]) -> Vec<Vec<f64>> {
        let found = self.cloth.distances(tools, vertices);
        let of = |lane: usize| {
            let own = vertices[lane.min(vertices.len() - 1)];
            found[..own.len()].iter().map(|phi| phi.get(lane)).collect()
        };
        (0..self.cloth.own.len()).map(of).collect()
    }

    #[inline(always)]
    fn count(&self, lines: &Lines, direction: Direction) -> usize {
        lines.of(direction).len()
    }

    #[inline(always)]
    fn warp<'a>(&'a mut self, lines: &'a Lines, i: usize) -> (&'a Line, &'a mut Cloth<V>) {
        (&lines.warps[i], &mut self.cloth)
    }

    #[inline(always)]
    fn take<'a>(
        &'a mut self,
        lines: &'a Lines,
        direction: Direction,
        i: usize,
    ) -> Along<'a, V, Line> {
        self.cloth.along(&lines.of(direction)[i], direction)
    }

    #[inline(always)]
    fn weft_pull(&self, lines: &Lines, place: usize) -> (Vec3x<V>, V) {
        let beside = &lines.beside[place];
        let (at, density) = (&self.cloth.predicted, &self.cloth.density);
        let min_warm = V::of(beside.min_warm) * self.cloth.scales.bending[1];
        let none = (Vec3x::zero(), V::zero());
        // No closures: they would be compiled without the instruction set.
        let before = match beside.before {
            Some([from, edge]) => {
                let along = at[place] - at[from as usize];
                pull_of(along, density[edge as usize], min_warm)
            }
            None => none,
        };
        let after = match beside.after {
            Some([to, edge]) => {
                let along = at[to as usize] - at[place];
                pull_of(along, density[edge as usize], min_warm)
            }
            None => none,
        };
        let (pull, stress, held) = (after.0 - before.0, before.1 + after.1, &self.held);
        match held.stress.is_empty() {
            true => (pull, stress),
            false => (pull + held.pull[place], stress + held.stress[place]),
        }
    }

    #[inline(always)]
    fn warm_start(&mut self, membranes: &[Vec<Element>]) {
        let Held { pull, stress } = &mut self.held;
        if stress.is_empty() {
            return;
        }
        pull.fill(Vec3x::zero());
        stress.fill(V::zero());
        for class in membranes {
            let (x, density) = (&self.cloth.predicted, &self.cloth.density);
            let scales = Some(&self.cloth.scales);
            warm_start_elements(class, x, density, pull, stress, scales);
        }
    }

    #[inline(always)]
    fn project(&mut self, passes: &[Pass]) {
        // Apart, so that factors cost nothing where there are none.
        match self.cloth.scales.vary {
            true => V::vectorize(Differing(passes, &mut self.cloth)),
            false => {
                for pass in passes {
                    pass.project(&mut self.cloth, false);
                }
            }
        }
    }

    #[inline(always)]
    fn stretch_membranes(&mut self, membranes: &[Vec<Element>]) {
        let cloth = &mut self.cloth;
        for class in membranes {
            let (x, w, s) = (&mut cloth.position, &cloth.mobility, Some(&cloth.scales));
            project_elements(class, x, w, &mut cloth.density, s);
        }
    }

    #[inline(always)]
    fn beneath(&self, layers: &Layers, lane: usize, vertex: usize) -> f64 {
        let contact = self.self_contact.as_ref();
        contact.map_or(0.0, |contact| contact.beneath(layers, lane, vertex))
    }

    #[inline(always)]
    fn separate(&mut self, layers: &Layers) {
        if let Some(contact) = &mut self.self_contact {
            let around = Around {
                previous: &self.cloth.previous,
                w: &self.cloth.inverse_mass,
                planes: &self.cloth.plane,
                friction: &self.cloth.scales.friction,
            };
            contact.separate(layers, &mut self.cloth.position, &around);
        }
    }
}

/// Passes in which environments differ.
struct Differing<'a, V: Lanes>(&'a [Pass], &'a mut Cloth<V>);

impl<V: Lanes> Kernel for Differing<'_, V> {
    #[inline(always)]
    fn run(self) {
        for pass in self.0 {
            pass.project(self.1, true);
        }
    }
}
