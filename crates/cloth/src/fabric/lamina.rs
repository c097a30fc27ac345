use std::collections::{HashMap, HashSet};

use super::blank::{BlankConfig, BlankError, MassModel};
use super::cut::{Cell, Cells};
use super::grid::Grid;
use super::material::{Curve, Family, Material};
use super::membrane::Membrane;
use super::outline::Outline;
use crate::math::Vec3;
use crate::mesh::TriMesh;

/// One yarn: a chain of vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Yarn {
    pub family: Family,
    /// Vertices along the yarn.
    pub vertices: Vec<u32>,
    /// Length of each edge at rest [m].
    pub rest_length: f64,
    /// Width of fabric that this yarn stands for [m]: half a cell for each whole cell beside it,
    /// and for each half of one whose side it is. If that changes along the yarn, the harmonic
    /// mean, with which the yarn as a whole stretches as its edges would.
    pub width: f64,
}

/// Two triangles that share an edge, for bending by their dihedral angle: the ends of the
/// edge first, then the two opposite vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hinge {
    pub vertices: [u32; 4],
    /// |e|^2 / (area sum) [-]: energy = D * weight / 2 * angle^2, that of a plate of stiffness
    /// D for bending along the yarns (3 |e|^2 would be that of discrete shells, three times
    /// too stiff on this mesh).
    pub weight: f64,
}

/// A blank cut from a material, at rest in the plane.
///
/// Its vertices stand in rows along the warp and columns along the weft, except where the
/// outline has moved or removed them. They are counted row by row; in a rectangle along its
/// yarns, vertex `row * columns + column`. The flat blank has the frame of its outline, a
/// rectangle its centre at the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Lamina {
    pub material: Material,
    pub columns: usize,
    pub rows: usize,
    /// Rest positions on the flat blank [m].
    pub rest: Vec<[f64; 2]>,
    /// Counter-clockwise from above.
    pub triangles: Vec<[u32; 3]>,
    /// Mass of each vertex [kg]: a third of each adjacent triangle.
    pub mass: Vec<f64>,
    /// All warp yarns, then all weft yarns: along the sides of whole cells. A yarn that the
    /// outline interrupts is several.
    pub yarns: Vec<Yarn>,
    /// Those of whole cells, which carry their shear where yarns hardly stretch.
    pub diagonals: Vec<[u32; 2]>,
    /// Triangles that are no part of whole cells; and those of whole cells whose yarns stretch.
    pub membranes: Vec<Membrane>,
    /// Unit vector along the warp on the flat blank; the weft is that turned to the left.
    pub warp: [f64; 2],
    grid: Grid,
}

impl Lamina {
    /// Cuts a blank. Fails with the key of the value that is out of range, or with the line of
    /// the outline that is wrong.
    pub fn new(config: &BlankConfig, material: Material) -> Result<Self, BlankError> {
        config.check()?;
        let size = config.size_mm.map(|s| s * 1e-3);
        let cells = if config.is_plain() {
            Cells::rectangle(size, config.vertices, config.cell())
        } else {
            let outline = match &config.outline {
                Some(path) => Outline::read(path)?,
                None => Outline::rectangle(size),
            };
            let angle = config.yarn_angle_deg.to_radians();
            Cells::new(&outline, config.cell(), angle).map_err(|fault| config.coarse(fault))?
        };
        Ok(Self::woven(cells, config, material))
    }

    /// A rectangle whose mesh lies along its sides, whatever the angle of the yarns: all triangles
    /// are membranes. It locks where the mesh does not follow the yarns, and is there to test that.
    pub fn of_membranes(config: &BlankConfig, material: Material) -> Result<Self, BlankError> {
        config.check()?;
        let size = config.size_mm.map(|s| s * 1e-3);
        let mut cells = Cells::rectangle(size, config.vertices, config.cell());
        for (index, cell) in cells.cells.iter_mut().enumerate() {
            let [a, b, c, d] = cells.grid.corners(index).map(|node| node as u32);
            *cell = Cell::Cut(vec![[a, b, d], [a, d, c]]);
        }
        Ok(Self::woven(cells, config, material))
    }

    /// Adds what lies between the vertices.
    fn woven(cells: Cells, config: &BlankConfig, material: Material) -> Self {
        let Cells { grid, rest, cells } = cells;
        let (columns, rows) = (grid.columns, grid.rows);
        let at = |row: usize, column: usize| {
            grid.vertex_at(row, column)
                .expect("whole cells have their corners")
        };
        let mut triangles = Vec::new();
        let mut diagonals = Vec::new();
        let mut membranes = Vec::new();
        let (sin, cos) = config.yarn_angle_deg.to_radians().sin_cos();
        let mass = &material.areal_mass_g_m2;
        let of_paper = mass.paper.filter(|_| config.mass == MassModel::Paper);
        let areal_mass = 1e-3 * of_paper.unwrap_or(mass.datasheet);
        let is_trellis = is_trellis(&material, grid.cell);
        let third = areal_mass * grid.cell[0] * grid.cell[1] / 6.0;
        let mut mass = vec![0.0; rest.len()];
        for (index, cell) in cells.iter().enumerate() {
            let cut = match cell {
                Cell::Whole => {
                    let corners = grid.corners(index);
                    let [a, b, c, d] = corners.map(|node| at(node / columns, node % columns));
                    let halves = [[a, b, d], [a, d, c]];
                    triangles.extend(halves);
                    match is_trellis {
                        true => diagonals.push([a, d]),
                        false => membranes.extend(halves.map(|half| {
                            let corners = half.map(|v| rest[v as usize]);
                            Membrane::of_yarns(half, corners, [cos, sin])
                        })),
                    }
                    for v in [a, b, d, a, d, c] {
                        mass[v as usize] += third;
                    }
                    continue;
                }
                Cell::Half(half) => std::slice::from_ref(half),
                Cell::Cut(cut) => cut,
            };
            triangles.extend(cut);
            for &vertices in cut {
                let corners = vertices.map(|v| rest[v as usize]);
                let make = match cell {
                    Cell::Half(_) => Membrane::of_yarns,
                    _ => Membrane::new,
                };
                let membrane = make(vertices, corners, [cos, sin]);
                for v in vertices {
                    mass[v as usize] += areal_mass * membrane.area / 3.0;
                }
                membranes.push(membrane);
            }
        }

        // How many cells beside an edge of the grid have a yarn there: to the next column (warp)
        // and row (weft) from each node.
        let mut beside = [vec![0; columns * rows], vec![0; columns * rows]];
        for (index, cell) in cells.iter().enumerate() {
            let [first, right, above, _] = grid.corners(index);
            for (family, from) in [(0, first), (0, above), (1, first), (1, right)] {
                let ends = [from, from + [1, columns][family]];
                let is_in = |half: &[u32; 3]| {
                    let ends = ends.map(|node| grid.vertex_at(node / columns, node % columns));
                    ends.iter().flatten().filter(|v| half.contains(v)).count() == 2
                };
                beside[family][from] += match cell {
                    Cell::Whole => 1,
                    Cell::Half(half) => usize::from(is_in(half)),
                    Cell::Cut(_) => 0,
                };
            }
        }
        let [warps, wefts] = beside;
        let warps = (0..rows).flat_map(|row| {
            let edges = &warps[row * columns..][..columns - 1];
            yarns(Family::Warp, grid.cell, edges, |column| at(row, column))
        });
        let wefts = (0..columns).flat_map(|column| {
            let edges = (0..rows - 1).map(|row| wefts[row * columns + column]);
            let cell = [grid.cell[1], grid.cell[0]];
            let edges: Vec<usize> = edges.collect();
            yarns(Family::Weft, cell, &edges, |row| at(row, column))
        });
        let yarns = warps.chain(wefts).collect();

        Self {
            material,
            columns,
            rows,
            rest,
            triangles,
            mass,
            yarns,
            diagonals,
            membranes,
            warp: [cos, sin],
            grid,
        }
    }

    /// The edges of all yarns, yarn by yarn: whose they are, and their ends.
    pub fn yarn_edges(&self) -> impl Iterator<Item = (&Yarn, [u32; 2])> {
        self.yarns.iter().flat_map(|yarn| {
            let pairs = yarn.vertices.windows(2);
            pairs.map(move |pair| (yarn, [pair[0], pair[1]]))
        })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    /// Pairs of triangles over every inner edge, for dihedral bending.
    pub(crate) fn hinges(&self) -> Vec<Hinge> {
        self.hinges_beside(|_| true)
    }

    /// Those of [`Lamina::hinges`] with a membrane without yarns on at least one side.
    pub(crate) fn membrane_hinges(&self) -> Vec<Hinge> {
        let membranes = self.membranes.iter().filter(|m| !m.has_yarns);
        let membranes: HashSet<_> = membranes.map(|m| m.vertices).collect();
        self.hinges_beside(|triangle| membranes.contains(&self.triangles[triangle]))
    }

    /// Hinges with a triangle that is wanted on at least one side.
    fn hinges_beside(&self, is_wanted: impl Fn(usize) -> bool) -> Vec<Hinge> {
        let mut open = HashMap::new();
        let mut hinges = Vec::new();
        for (index, triangle) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| triangle[(k + i) % 3]);
                // A neighbour runs through the shared edge the other way round.
                let Some((other, opposite)) = open.remove(&(b, a)) else {
                    open.insert((a, b), (index, c));
                    continue;
                };
                if is_wanted(index) || is_wanted(other) {
                    let [p, q] = [a, b].map(|v: u32| self.rest[v as usize]);
                    let square = (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
                    hinges.push(Hinge {
                        vertices: [a, b, c, opposite],
                        weight: square / (self.rest_area(index) + self.rest_area(other)),
                    });
                }
            }
        }
        hinges
    }

    fn rest_area(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.triangles[triangle].map(|v| self.rest[v as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    }

    /// Area of the blank [m^2].
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| self.rest_area(t)).sum()
    }

    /// Area of each vertex [m^2]: a third of each adjacent triangle.
    pub fn vertex_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.vertex_count()];
        for (index, triangle) in self.triangles.iter().enumerate() {
            for &v in triangle {
                areas[v as usize] += self.rest_area(index) / 3.0;
            }
        }
        areas
    }

    /// Sides of a whole cell along warp and weft [m].
    pub fn cell(&self) -> [f64; 2] {
        self.grid.cell
    }

    /// Diagonal of a whole cell [m].
    pub fn cell_diagonal(&self) -> f64 {
        self.grid.cell[0].hypot(self.grid.cell[1])
    }

    /// The vertex in a row and column; none where the blank has been cut away.
    pub fn vertex_at(&self, row: usize, column: usize) -> Option<u32> {
        self.grid.vertex_at(row, column)
    }

    /// Row and column of a vertex.
    pub fn place(&self, vertex: u32) -> [usize; 2] {
        self.grid.place(vertex)
    }

    /// Vertices whose rest position lies within `radius` [m] of that of `vertex` along both
    /// axes, itself included, ascending.
    pub fn within(&self, vertex: u32, radius: f64) -> impl Iterator<Item = u32> + '_ {
        let centre = self.rest[vertex as usize];
        let [cos, sin] = self.warp.map(f64::abs);
        // Two more than the square's reach: the outline moves vertices by less than a cell.
        let reach = |cell: f64| (radius * (cos + sin) / cell) as usize + 3;
        let [across, along] = self.grid.cell.map(reach);
        // A hair more than the radius, so that a vertex exactly on it counts.
        let near = move |v: &u32| {
            let at = self.rest[*v as usize];
            (0..2).all(|k| (at[k] - centre[k]).abs() <= radius * (1.0 + 1e-9))
        };
        self.grid
            .window(vertex, [along, across])
            .filter(move |v| *v == vertex || near(v))
    }

    /// The vertices next to `vertex`, diagonals included (up to 8).
    pub fn neighbors(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        self.grid
            .window(vertex, [1, 1])
            .filter(move |&v| v != vertex)
    }

    /// The lamina as a mesh, with its vertices at `position` [m].
    pub fn mesh(&self, position: &[[f64; 3]]) -> TriMesh {
        TriMesh::new(position, &self.triangles)
    }

    /// Engineering strain along the yarns at `position`: (length - rest) / rest of every yarn
    /// edge, yarn by yarn, then that along warp and weft of every membrane without yarns.
    pub fn yarn_strain(&self, position: &[[f64; 3]]) -> Vec<f64> {
        let mut strain = Vec::new();
        for (yarn, ends) in self.yarn_edges() {
            let [a, b] = ends.map(|v| Vec3::from(position[v as usize]));
            strain.push((b - a).norm() / yarn.rest_length - 1.0);
        }
        for membrane in self.membranes.iter().filter(|m| !m.has_yarns) {
            strain.extend(membrane.columns(position).map(|column| column.norm() - 1.0));
        }
        strain
    }
}

/// Shear stiffness over that of yarns up to which a diagonal tells of shear. Yarns of length b that are
/// strained by e lengthen the diagonal of a cell as a shear of e b / a would, so it holds the cloth as
/// if these were G b^2 / (E a^2) stiffer, and pulls it sideways; less than the hundredth to which
/// closed forms are met.
const STRETCH: f64 = 0.01;

/// Whether the yarns of a cell stretch so little that its diagonal knows its shear, by the steepest slope of
/// shear, locked if it locks, and the flattest of tension. Compression does not count: cloth buckles.
fn is_trellis(material: &Material, [a, b]: [f64; 2]) -> bool {
    let shear = material.shear.curves(true);
    let shear = shear.iter().flat_map(Curve::moduli).fold(0.0, f64::max);
    let [warp, weft] = [&material.warp, &material.weft]
        .map(|yarn| yarn.tension.moduli().fold(f64::INFINITY, f64::min));
    shear * (a / b).powi(2) <= STRETCH * warp && shear * (b / a).powi(2) <= STRETCH * weft
}

/// The yarns along one line of the grid, `edges` saying how many cells lie beside each
/// edge; those beside none are none. `cell` has the side along the yarn first.
fn yarns(
    family: Family,
    cell: [f64; 2],
    edges: &[usize],
    vertex: impl Fn(usize) -> u32,
) -> Vec<Yarn> {
    let mut yarns = Vec::new();
    let mut first = 0;
    for run in edges.chunk_by(|a, b| (*a > 0) == (*b > 0)) {
        if run[0] > 0 {
            // In half widths: whole numbers, so that a yarn of one width has it exactly.
            let inverse: f64 = run.iter().map(|&halves| 2.0 / halves as f64).sum();
            yarns.push(Yarn {
                family,
                vertices: (first..=first + run.len()).map(&vertex).collect(),
                rest_length: cell[0],
                width: cell[1] * (run.len() as f64 / inverse),
            });
        }
        first += run.len();
    }
    yarns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standard() -> Lamina {
        Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap()
    }

    #[test]
    fn a_material_without_the_papers_mass_weighs_what_its_data_sheet_says() {
        let weighs = |paper| {
            let mut material = Material::interglas_92125();
            material.areal_mass_g_m2.paper = paper;
            let lamina = Lamina::new(&BlankConfig::default(), material).unwrap();
            1e3 * lamina.mass.iter().sum::<f64>() / lamina.area()
        };
        assert!((weighs(None) - 280.0).abs() < 1e-9);
        assert!((weighs(Some(875.0)) - 875.0).abs() < 1e-9);
    }

    #[test]
    fn standard_lamina_is_that_of_the_paper() {
        let lamina = standard();
        assert_eq!(lamina.vertex_count(), 4225);
        assert_eq!(lamina.triangles.len(), 8192);
        let edges: usize = lamina.yarns.iter().map(|y| y.vertices.len() - 1).sum();
        assert_eq!(edges + lamina.diagonals.len(), 12_416);
        assert!((lamina.rest_area(77) - 16.711e-6).abs() < 1e-9);
        let total: f64 = lamina.mass.iter().sum();
        assert!((total - 0.875 * 0.37 * 0.37).abs() < 1e-12);
        // 0.0049 g to 0.029 g in the paper's rounding.
        let (low, high) = lamina
            .mass
            .iter()
            .fold((f64::MAX, 0.0f64), |(l, h), &m| (l.min(m), h.max(m)));
        assert!((low - 0.0049e-3).abs() < 0.0001e-3 && (high - 0.029e-3).abs() < 0.0005e-3);
        let corners = lamina.mass.iter().filter(|&&m| m < 1.5 * low).count();
        assert_eq!(corners, 2);
    }

    #[test]
    fn hinges_lie_over_every_inner_edge() {
        let lamina = standard();
        // Each triangle has 3 edges, inner ones are shared, 4 * 64 lie on the border.
        assert_eq!(lamina.hinges().len(), (3 * 8192 - 4 * 64) / 2);
    }

    #[test]
    fn neighbourhoods_are_cut_at_the_border() {
        let lamina = standard();
        assert_eq!(lamina.neighbors(0).collect::<Vec<_>>(), [1, 65, 66]);
        assert_eq!(lamina.neighbors(33 * 65 + 7).count(), 8);
        let cell = 0.37 / 64.0;
        assert_eq!(lamina.within(0, 2.0 * cell).count(), 9);
        assert_eq!(lamina.within(33 * 65 + 7, 2.0 * cell).count(), 25);
        assert_eq!(lamina.within(33 * 65 + 7, 0.9 * cell).count(), 1);
    }

    #[test]
    fn impossible_blanks_are_refused() {
        let cut = |size_mm, vertices| {
            let config = BlankConfig {
                size_mm,
                vertices,
                ..BlankConfig::default()
            };
            Lamina::new(&config, Material::interglas_92125())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            cut([370.0, f64::NAN], [65, 65]),
            "`blank.size_mm` is [370.0, NaN], expected two lengths from 1 to 100000 mm"
        );
        assert_eq!(
            cut([370.0, 370.0], [1, 65]),
            "`blank.vertices` is [1, 65], expected two numbers from 2 to 1025"
        );
    }

    fn holed(angle: f64) -> Lamina {
        let config = BlankConfig {
            outline: Some(
                concat!(
                    env!("CARGO_MANIFEST_DIR"),
                    "/../../assets/outlines/plate-with-hole.csv"
                )
                .into(),
            ),
            cell_mm: Some(8.0),
            yarn_angle_deg: angle,
            ..BlankConfig::default()
        };
        Lamina::new(&config, Material::interglas_92125()).unwrap()
    }

    /// Mass is that of the triangles, these fill the outline, and every vertex is found where
    /// the grid says.
    #[test]
    fn cut_blank_has_its_mass_area_and_places() {
        // Area of the outline by its coordinates: border less hole.
        let enclosed = 0.063_168_576 - 0.003_823_747;
        for angle in [0.0, 20.0, 45.0, 90.0, -130.0] {
            let lamina = holed(angle);
            let mass: f64 = lamina.mass.iter().sum();
            assert!((mass / (0.875 * lamina.area()) - 1.0).abs() < 1e-12);
            assert!(lamina.mass.iter().all(|&m| m > 0.0));
            let off = lamina.area() / enclosed - 1.0;
            assert!(off.abs() < 0.01, "{off} at {angle}");
            let mut count = 0;
            for row in 0..lamina.rows {
                for column in 0..lamina.columns {
                    let Some(v) = lamina.vertex_at(row, column) else {
                        continue;
                    };
                    assert_eq!((v, lamina.place(v)), (count, [row, column]));
                    count += 1;
                }
            }
            assert_eq!(count as usize, lamina.vertex_count());
        }
    }

    /// Yarns lie on whole cells and keep one length; a row over the hole has two.
    #[test]
    fn hole_interrupts_yarns() {
        let lamina = holed(20.0);
        let mut starts = std::collections::BTreeMap::new();
        for yarn in &lamina.yarns {
            for pair in yarn.vertices.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|v| lamina.rest[v as usize]);
                let length = (a[0] - b[0]).hypot(a[1] - b[1]);
                assert!((length - yarn.rest_length).abs() < 1e-12);
            }
            assert!((0.5..=1.0).contains(&(yarn.width / 0.008)));
            if yarn.family == Family::Warp {
                *starts.entry(lamina.place(yarn.vertices[0])[0]).or_insert(0) += 1;
            }
        }
        assert!(starts.values().any(|&count| count == 2));
        assert_eq!(
            lamina.membranes.len() + 2 * lamina.diagonals.len(),
            lamina.triangles.len()
        );
    }

    /// A rectangle at 45 degrees, cut along the diagonals of its cells: halves of cells all round,
    /// which yarns carry as they do whole ones, so that all are of one width but where they end.
    #[test]
    fn halves_of_cells_lie_beside_yarns() {
        let config = BlankConfig {
            size_mm: [80.0, 40.0],
            cell_mm: Some(5.0 * std::f64::consts::SQRT_2),
            yarn_angle_deg: 45.0,
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
        assert_eq!(lamina.membranes.len(), 2 * (16 + 8) / 2);
        assert!(lamina.membranes.iter().all(|m| m.has_yarns));
        assert!(lamina.membrane_hinges().is_empty());
        // Width times length of all yarns of a family cover the blank once.
        for family in [Family::Warp, Family::Weft] {
            let all = lamina.yarns.iter().filter(|y| y.family == family);
            let covered: f64 = all
                .map(|y| y.width * y.rest_length * (y.vertices.len() - 1) as f64)
                .sum();
            assert!((covered / lamina.area() - 1.0).abs() < 1e-12, "{covered}");
        }
        let strains = lamina.yarn_strain(&vec![[0.0; 3]; lamina.vertex_count()]);
        let edges = lamina.yarns.iter().map(|y| y.vertices.len() - 1);
        assert_eq!(strains.len(), edges.sum::<usize>());
    }

    /// [`Lamina::within`] against every vertex, at an angle at which rows run obliquely.
    #[test]
    fn neighbourhoods_of_a_cut_blank_are_complete() {
        let lamina = holed(33.0);
        for vertex in (0..lamina.vertex_count() as u32).step_by(7) {
            let at = lamina.rest[vertex as usize];
            let expected: Vec<u32> = (0..lamina.vertex_count() as u32)
                .filter(|&v| (0..2).all(|k| (lamina.rest[v as usize][k] - at[k]).abs() <= 0.027))
                .collect();
            assert_eq!(lamina.within(vertex, 0.027).collect::<Vec<_>>(), expected);
        }
    }

    /// A rectangle that is cut where it would be anyway has the same mesh and law.
    #[test]
    fn cutting_along_the_yarns_changes_nothing() {
        let plain = BlankConfig {
            size_mm: [100.0, 80.0],
            vertices: [21, 17],
            ..BlankConfig::default()
        };
        let cut = BlankConfig {
            cell_mm: Some(5.0),
            ..plain.clone()
        };
        let [plain, cut] =
            [plain, cut].map(|c| Lamina::new(&c, Material::interglas_92125()).unwrap());
        assert_eq!(cut.triangles, plain.triangles);
        assert!(cut.membranes.is_empty());
        assert_eq!(cut.yarns.len(), plain.yarns.len());
        for (a, b) in cut.yarns.iter().zip(&plain.yarns) {
            assert_eq!(a.vertices, b.vertices);
            assert!((a.width - b.width).abs() < 1e-15);
        }
    }
}
