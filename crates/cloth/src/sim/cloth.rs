use super::line::{Along, Chain, Direction, Scratch};
use super::parameters::Own;
use super::scales::Scales;
use crate::math::{Kernel, Lanes, Real, Vec3, Vec3x};
use crate::tool::Tools;

/// n . x - offset is the distance to the tool [m].
#[derive(Clone, Copy)]
pub(super) struct Plane<V> {
    pub normal: Vec3x<V>,
    pub offset: V,
}

/// A triangle near what is finer than it, as last looked at.
#[derive(Clone)]
pub(super) struct Touched {
    /// Its environment and its number.
    pub triangle: [usize; 2],
    /// Its corners then, and how far it was expected to move [m].
    pub x: [Vec3; 3],
    pub travel: f64,
    pub touches: Vec<Touch>,
}

/// A point of a triangle near the tool, and its tangent plane as last refreshed.
#[derive(Clone)]
pub(super) struct Touch {
    /// Place and lane of each corner.
    pub corners: [[usize; 2]; 3],
    /// Barycentric coordinates.
    pub weights: [f64; 3],
    pub normal: Vec3,
    /// [m]
    pub offset: f64,
}

/// All that moves, in plain arrays: those of vertices by place, those of yarn edges by edge. What
/// place a vertex has, and what its lanes hold, is up to the storage.
pub(super) struct Cloth<V: Lanes> {
    /// [m]
    pub position: Vec<Vec3x<V>>,
    /// [m/s]
    pub velocity: Vec<Vec3x<V>>,
    /// [1/kg], 0 of a fixed vertex.
    pub inverse_mass: Vec<V>,
    /// Positions at the start of the substep [m].
    pub previous: Vec<Vec3x<V>>,
    /// Where their velocities take the vertices in the substep [m].
    pub predicted: Vec<Vec3x<V>>,
    /// How far a vertex gives way within a substep [m/N]: h^2/m, less where its yarns pull hard.
    pub mobility: Vec<V>,
    /// Tangent plane of the tool under each vertex, as last refreshed.
    pub plane: Vec<Plane<V>>,
    /// Force density of each yarn edge [N/m], > 0 in tension; empty without a solve along lines.
    pub density: Vec<V>,
    pub scratch: Scratch<V>,
    /// Greatest pull of the tool's tack on each vertex [N]; empty without.
    pub tack: Vec<V>,
    /// Triangles that may touch the tool between their vertices, in order.
    pub touched: Vec<Touched>,
    /// Of each environment that is used.
    pub own: Vec<Own>,
    pub scales: Scales<V>,
}

impl<V: Lanes> Cloth<V> {
    /// Room for so many places, yarn edges and vertices of the longest line, 0 of these two
    /// without a solve along lines. Everything is fixed in the origin.
    pub fn new(places: usize, edges: usize, longest: usize) -> Self {
        let plane = Plane {
            normal: Vec3x::zero(),
            offset: V::zero(),
        };
        Self {
            position: vec![Vec3x::zero(); places],
            velocity: vec![Vec3x::zero(); places],
            inverse_mass: vec![V::zero(); places],
            previous: vec![Vec3x::zero(); places],
            predicted: vec![Vec3x::zero(); places],
            mobility: vec![V::zero(); places],
            plane: vec![plane; places],
            density: vec![V::zero(); edges],
            scratch: Scratch::new(longest),
            tack: Vec::new(),
            touched: Vec::new(),
            own: vec![Own::default()],
            scales: Scales::new(),
        }
    }

    /// A line that lies in these arrays as it is.
    #[inline(always)]
    pub fn along<'a, C: Chain<V>>(
        &'a mut self,
        line: &'a C,
        direction: Direction,
    ) -> Along<'a, V, C> {
        Along {
            line,
            law: self.scales.of_line(direction, line.law()),
            x: &mut self.position,
            previous: &self.previous,
            mobility: &self.mobility,
            density: &mut self.density[line.edges()],
            scratch: &mut self.scratch,
        }
    }

    /// Whether every position of a lane is a number within 100 m of the origin, lane by lane.
    pub fn finite(&self) -> Vec<bool> {
        let mut diverged = V::zero();
        V::vectorize(Diverged {
            position: &self.position,
            diverged: &mut diverged,
        });
        let is_zero = |diverged: &V::Scalar| diverged.to_f64() == 0.0;
        diverged.as_slice().iter().map(is_zero).collect()
    }

    /// Distance to the tool [m], negative inside, of places that are listed for each lane; or of the
    /// same in all, if there is one list.
    pub fn distances(&self, tools: &Tools<V>, places: &[&[u32]]) -> Vec<V> {
        let longest = places.iter().map(|places| places.len()).max();
        let mut distances = vec![V::zero(); longest.unwrap_or(0)];
        V::vectorize(Distances {
            tools,
            position: &self.position,
            places,
            distances: &mut distances,
        });
        distances
    }
}

/// Marks the lanes in which a position is no number or out of reach by 1.
struct Diverged<'a, V> {
    position: &'a [Vec3x<V>],
    diverged: &'a mut V,
}

impl<V: Lanes> Kernel for Diverged<'_, V> {
    #[inline(always)]
    fn run(self) {
        let mut diverged = V::zero();
        for &x in self.position.iter().flat_map(|x| &x.0) {
            let inside = x.max(-x).lt(V::of(100.0));
            diverged = V::select(inside, diverged, V::of(1.0));
        }
        *self.diverged = diverged;
    }
}

/// Looks up the distance of places to the tool.
struct Distances<'a, V> {
    tools: &'a Tools<'a, V>,
    position: &'a [Vec3x<V>],
    places: &'a [&'a [u32]],
    distances: &'a mut [V],
}

impl<V: Lanes> Kernel for Distances<'_, V> {
    #[inline(always)]
    fn run(self) {
        for (k, distance) in self.distances.iter_mut().enumerate() {
            let x = match self.places {
                [same] => self.position[same[k] as usize],
                each => {
                    let mut x = Vec3x::zero();
                    for (lane, own) in each.iter().enumerate() {
                        if let Some(&v) = own.get(k) {
                            x.set(lane, self.position[v as usize].get(lane));
                        }
                    }
                    x
                }
            };
            *distance = self.tools.distance(x.0).0;
        }
    }
}
