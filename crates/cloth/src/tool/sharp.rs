use rayon::prelude::*;

use super::grid::DistanceGrid;
use super::surface::Surface;
use crate::math::Vec3;

/// What counts as near the surface [m]: the range in which cloth touches the tool.
pub(super) const NEAR: f64 = 2e-3;

/// What interpolated distances near the surface may err by at the places where a cell is probed [m]:
/// less than the 0.1 mm that are to be kept, as the worst place may lie between them.
const TOLERANCE: f64 = 5e-5;

/// Cosines of the angles between facets near a cell up to which its interpolation needs no probing
/// (2.5 degrees: a kink costs at most 0.04 of the spacing), and from which on nothing helps (26).
const SMOOTH: f64 = 0.999;
const SHARP: f64 = 0.9;

/// Most facets that are searched one by one; more are searched by their tree.
const FEW: usize = 24;

/// The cells of a distance grid in which interpolation errs by more than 0.1 mm near the surface:
/// at edges and tips, on walls thinner than a cell, at small radii.
#[derive(Clone, Debug)]
pub(super) struct SharpCells {
    /// Where the facets of a cell begin and, with the next number, end, by its first node.
    starts: Vec<u32>,
    /// Facets that may be the nearest to a point near the surface, of all sharp cells; or
    /// [`Self::MANY`].
    facets: Vec<u32>,
    /// Interpolated distances are at most this far off in a cell [m].
    pub off: f64,
    /// From this interpolated distance on [m], points are not near the surface.
    pub reach: f64,
}

impl SharpCells {
    /// Stands for facets that are many, or for walls below an open mesh.
    pub const MANY: u32 = u32::MAX;

    /// Finds the cells, in parallel; none where there are none.
    pub fn new(surface: &Surface, grid: &DistanceGrid) -> Option<Self> {
        // No point of a cell is farther from its nearest node, nor from its centre.
        let off = 0.5 * 3.0f64.sqrt() * grid.spacing;
        let reach = NEAR + off;
        let [x, y, z] = grid.dims;
        let found = |row: usize| {
            let first = (row % (y - 1)) * x + row / (y - 1) * x * y;
            (first..first + x - 1).filter_map(move |cell| {
                let corners = grid.corners(cell).map(|at| grid.samples[at].abs());
                let nearest = corners.into_iter().fold(f32::INFINITY, f32::min);
                let facets = (f64::from(nearest) <= reach)
                    .then(|| facets_if_sharp(surface, grid, cell, reach))
                    .flatten();
                facets.map(|facets| (cell, facets))
            })
        };
        let rows = (0..(y - 1) * (z - 1)).into_par_iter();
        let found: Vec<(usize, Vec<u32>)> = rows.flat_map_iter(found).collect();
        if found.is_empty() {
            return None;
        }
        let mut starts = vec![0; grid.samples.len() + 1];
        for (cell, facets) in &found {
            starts[cell + 1] = facets.len() as u32;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        Some(Self {
            starts,
            facets: found.into_iter().flat_map(|(_, facets)| facets).collect(),
            off,
            reach,
        })
    }

    /// The facets to be searched at a point of finite coordinates [m], none where interpolation is
    /// good enough.
    pub fn facets(&self, grid: &DistanceGrid, x: [f64; 3]) -> &[u32] {
        let mut node = [0; 3];
        for a in 0..3 {
            let u = (x[a] - grid.origin[a]) / grid.spacing;
            if !(u >= 0.0 && u <= (grid.dims[a] - 1) as f64) {
                return &[];
            }
            node[a] = (u as usize).min(grid.dims[a] - 2);
        }
        let [i, j, k] = node;
        let cell = i + grid.dims[0] * (j + grid.dims[1] * k);
        &self.facets[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

/// The facets of a cell that has a node within `reach` [m] of the surface, if it is sharp.
fn facets_if_sharp(
    surface: &Surface,
    grid: &DistanceGrid,
    cell: usize,
    reach: f64,
) -> Option<Vec<u32>> {
    let low = grid.position(cell);
    let centre = low + Vec3::repeat(0.5 * grid.spacing);
    // What the nodes see, beyond that which points near the surface see.
    let corners = grid.corners(cell).map(|at| grid.samples[at].abs());
    let farthest = f64::from(corners.into_iter().fold(0.0, f32::max));
    let facets = surface.near(centre, reach.max(farthest + reach - NEAR));
    let (mut is_sharp, mut is_flat) = (false, true);
    let plane = |[a, b, c]: &[Vec3; 3]| {
        let n = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        Some((n, n.dot(&(centre - a))))
    };
    let nearest = facets.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (first_n, first_height) = plane(&nearest.2)?;
    let mut numbers = Some(Vec::new());
    for (number, distance, facet) in &facets {
        let is_near = *distance <= reach;
        if is_near {
            numbers = numbers.zip(*number).map(|(mut numbers, number)| {
                numbers.push(number);
                numbers
            });
        }
        let Some((n, height)) = plane(facet) else {
            continue;
        };
        let cos = n.dot(&first_n);
        is_sharp |= is_near && cos < SHARP;
        is_flat &= cos > SMOOTH && (height - first_height).abs() < TOLERANCE;
    }
    if is_flat || !(is_sharp || probe(surface, grid, low, reach)) {
        return None;
    }
    let few = numbers.filter(|numbers| !numbers.is_empty() && numbers.len() <= FEW);
    Some(few.unwrap_or_else(|| vec![SharpCells::MANY]))
}

/// Whether interpolation errs too much in the middle of the cell from `low` [m] on, of one of its
/// faces or of its edges.
fn probe(surface: &Surface, grid: &DistanceGrid, low: Vec3, reach: f64) -> bool {
    (0..27).any(|n| {
        let halves = [n % 3, n / 3 % 3, n / 9];
        if !halves.contains(&1) {
            return false;
        }
        let x = low + Vec3::from(halves.map(f64::from)) * (0.5 * grid.spacing);
        let interpolated = grid.sample::<f64>(x.into()).0;
        let exact = surface.contact(x, interpolated.abs() + reach).0;
        // The next of these points may be near the surface and see as much.
        exact.abs() <= NEAR + 0.5 * grid.spacing && (interpolated - exact).abs() > TOLERANCE
    })
}
