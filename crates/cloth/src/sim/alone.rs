use super::cloth::Cloth;
use super::fold::{Bundle, Fold, Places};
use super::length::{Held, warm_start};
use super::line::{Along, Chain, Direction};
use super::lines::Lines;
use super::membrane::Element;
use super::model::Model;
use super::storage::Storage;
use crate::math::{Lanes, Vec3x};
use crate::tool::Tools;

/// One environment by itself with the solve along yarns, its lines side by side in the lanes: a
/// place is a number of the [`Fold`]. The same bits as one lane of a group of the same precision:
/// lines of a family share no vertex, so it does not matter which is solved first.
pub(super) struct Alone<V: Lanes> {
    cloth: Cloth<V>,
    fold: Fold<V>,
    held: Held<V>,
    /// Room for the vertices of a bundle that crosses the warps.
    crossing: Crossing<V>,
}

struct Crossing<V> {
    position: Vec<Vec3x<V>>,
    previous: Vec<Vec3x<V>>,
    mobility: Vec<V>,
    held: Held<V>,
}

impl<V: Lanes> Alone<V> {
    /// For `model` with every vertex free and at rest in the origin; none if anything of it is not
    /// solved along lines: edges by Gauss-Seidel, membranes, hinges, layers that touch.
    pub fn new(model: &Model) -> Option<Self> {
        let by_itself = model.passes.is_empty() && model.membranes.is_empty();
        let is_of_lines = model.layers.is_none() && by_itself;
        let lines = model.lines.as_ref().filter(|_| is_of_lines)?;
        let fold = Fold::new(lines);
        let mut cloth = Cloth::<V>::new(fold.count, fold.edge_count, fold.longest);
        for (&[number, lane], &w) in fold.vertices.iter().zip(&model.inverse_mass) {
            cloth.inverse_mass[number as usize].set(lane as usize, w);
        }
        if let Some(tack) = &model.tack {
            cloth.tack.resize(fold.count, V::zero());
            for (&[number, lane], &tack) in fold.vertices.iter().zip(tack) {
                cloth.tack[number as usize].set(lane as usize, tack);
            }
        }
        Some(Self {
            crossing: Crossing {
                position: vec![Vec3x::zero(); fold.longest],
                previous: vec![Vec3x::zero(); fold.longest],
                mobility: vec![V::zero(); fold.longest],
                held: Held::new(fold.longest),
            },
            held: Held::new(fold.count),
            cloth,
            fold,
        })
    }
}

impl<V: Lanes> Fold<V> {
    /// The bundles that run across the warps, and where their vertices are.
    #[inline(always)]
    fn crossing(&self, direction: Direction) -> &[(Bundle<V>, Places)] {
        match direction {
            Direction::Weft => &self.wefts,
            Direction::Diagonal => &self.diagonals,
            Direction::Warp => &[],
        }
    }
}

impl<V: Lanes> Storage for Alone<V> {
    type V = V;
    type Line = Bundle<V>;

    fn lanes(&self) -> usize {
        1
    }

    fn slot(&self, _: usize, vertex: usize) -> [usize; 2] {
        self.fold.vertices[vertex].map(|i| i as usize)
    }

    fn edge_slot(&self, _: usize, edge: usize) -> [usize; 2] {
        self.fold.edges[edge].map(|i| i as usize)
    }

    fn cloth(&self) -> &Cloth<V> {
        &self.cloth
    }

    #[inline(always)]
    fn cloth_mut(&mut self) -> &mut Cloth<V> {
        &mut self.cloth
    }

    /// Also where no vertex or edge is: a state that diverged may have left anything there.
    fn clear(&mut self, _: usize, _: &[u64]) {
        self.cloth.position.fill(Vec3x::zero());
        self.cloth.velocity.fill(Vec3x::zero());
        self.held.pull.fill(Vec3x::zero());
        self.held.stress.fill(V::zero());
        self.cloth.density.fill(V::zero());
    }

    fn distances(&self, tools: &Tools<V>, vertices: &[&[u32]]) -> Vec<Vec<f64>> {
        let all: Vec<u32> = (0..self.fold.count as u32).collect();
        let distances = self.cloth.distances(tools, &[&all]);
        let of = |&vertex: &u32| {
            let [number, lane] = self.slot(0, vertex as usize);
            distances[number].get(lane)
        };
        vec![vertices[0].iter().map(of).collect()]
    }

    #[inline(always)]
    fn count(&self, _: &Lines, direction: Direction) -> usize {
        match direction {
            Direction::Warp => self.fold.warps.len(),
            _ => self.fold.crossing(direction).len(),
        }
    }

    #[inline(always)]
    fn warp<'a>(&'a mut self, _: &'a Lines, i: usize) -> (&'a Bundle<V>, &'a mut Cloth<V>) {
        (&self.fold.warps[i], &mut self.cloth)
    }

    #[inline(always)]
    fn take<'a>(
        &'a mut self,
        lines: &'a Lines,
        direction: Direction,
        i: usize,
    ) -> Along<'a, V, Bundle<V>> {
        let (cloth, crossing) = (&mut self.cloth, &mut self.crossing);
        let (line, places) = &self.fold.crossing(direction)[i];
        let x = Vec3x::components_mut(&mut crossing.position);
        places.copy::<V, 3, false>(Vec3x::components_mut(&mut cloth.position), x);
        places.copy::<V, 1, false>(&mut cloth.mobility, &mut crossing.mobility);
        if direction == Direction::Diagonal && lines.curve.is_some() {
            let previous = Vec3x::components_mut(&mut crossing.previous);
            places.copy::<V, 3, false>(Vec3x::components_mut(&mut cloth.previous), previous);
        }
        Along {
            line,
            law: cloth.scales.of_line(direction, line.law()),
            x: &mut crossing.position,
            previous: &crossing.previous,
            mobility: &crossing.mobility,
            density: &mut cloth.density[line.edges()],
            scratch: &mut cloth.scratch,
        }
    }

    #[inline(always)]
    fn put(&mut self, direction: Direction, i: usize) {
        let (_, places) = &self.fold.crossing(direction)[i];
        let x = Vec3x::components_mut(&mut self.cloth.position);
        places.copy::<V, 3, true>(x, Vec3x::components_mut(&mut self.crossing.position));
    }

    #[inline(always)]
    fn warm_start(&mut self, _: &[Vec<Element>]) {
        let (cloth, crossing, held) = (&mut self.cloth, &mut self.crossing, &mut self.held);
        for (weft, places) in &self.fold.wefts {
            let x = Vec3x::components_mut(&mut crossing.position);
            places.copy::<V, 3, false>(Vec3x::components_mut(&mut cloth.predicted), x);
            let density = &cloth.density[weft.edges()];
            let Held { pull, stress } = &mut crossing.held;
            let law = cloth.scales.of_line(Direction::Weft, weft.law());
            let x = &crossing.position;
            warm_start(weft, law.min_warm, x, density, pull, stress);
            let all = Vec3x::components_mut(&mut held.pull);
            places.copy::<V, 3, true>(all, Vec3x::components_mut(pull));
            places.copy::<V, 1, true>(&mut held.stress, stress);
        }
    }

    #[inline(always)]
    fn weft_pull(&self, _: &Lines, place: usize) -> (Vec3x<V>, V) {
        (self.held.pull[place], self.held.stress[place])
    }
}
