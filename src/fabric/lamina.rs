use serde::{Deserialize, Serialize};

use super::material::{Family, Material};
use crate::math::Vec3;
use crate::mesh::TriMesh;

/// Which areal mass a blank has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MassModel {
    /// The paper's particle masses.
    #[default]
    Paper,
    /// The fabric's data sheet.
    Datasheet,
}

/// A rectangular blank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BlankConfig {
    /// Sides along warp (x) and weft (y) [mm].
    pub size_mm: [f64; 2],
    /// Vertices along x and y.
    pub vertices: [usize; 2],
    pub mass: MassModel,
}

impl Default for BlankConfig {
    fn default() -> Self {
        Self {
            size_mm: [370.0, 370.0],
            vertices: [65, 65],
            mass: MassModel::Paper,
        }
    }
}

/// A blank that cannot be cut.
#[derive(Debug, thiserror::Error)]
#[error("`blank.{key}` is {found}, expected {expected}")]
pub struct BlankError {
    key: &'static str,
    found: String,
    expected: &'static str,
}

/// One yarn: a chain of vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Yarn {
    pub family: Family,
    /// Vertices along the yarn.
    pub vertices: Vec<u32>,
    /// Length of each edge at rest [m].
    pub rest_length: f64,
    /// Width of fabric that this yarn stands for [m]: one cell, at the border half a cell.
    pub width: f64,
}

/// The diagonal of a cell, which carries its shear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diagonal {
    pub vertices: [u32; 2],
    /// Length at rest [m].
    pub rest_length: f64,
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
/// Vertex `row * columns + column`; columns run along x (warp), rows along y (weft), the
/// centre of the blank at the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Lamina {
    pub material: Material,
    pub columns: usize,
    pub rows: usize,
    /// Rest positions in the plane [m].
    pub rest: Vec<[f64; 2]>,
    /// Counter-clockwise from above.
    pub triangles: Vec<[u32; 3]>,
    /// Mass of each vertex [kg]: a third of each adjacent triangle.
    pub mass: Vec<f64>,
    /// All warp yarns, then all weft yarns.
    pub yarns: Vec<Yarn>,
    pub diagonals: Vec<Diagonal>,
}

impl Lamina {
    /// Cuts a blank. Fails with the key of the value that is out of range.
    pub fn new(config: &BlankConfig, material: Material) -> Result<Self, BlankError> {
        let [columns, rows] = config.vertices;
        if !(2..=1025).contains(&columns) || !(2..=1025).contains(&rows) {
            return Err(BlankError {
                key: "vertices",
                found: format!("{:?}", config.vertices),
                expected: "two numbers from 2 to 1025",
            });
        }
        let range = 1.0..=100_000.0;
        if !config.size_mm.iter().all(|s| range.contains(s)) {
            return Err(BlankError {
                key: "size_mm",
                found: format!("{:?}", config.size_mm),
                expected: "two lengths from 1 to 100000 mm",
            });
        }
        let size = config.size_mm.map(|s| s * 1e-3);
        let cell = [size[0] / (columns - 1) as f64, size[1] / (rows - 1) as f64];
        let at = |row: usize, column: usize| (row * columns + column) as u32;

        let rest = (0..rows * columns)
            .map(|v| {
                [
                    (v % columns) as f64 * cell[0] - 0.5 * size[0],
                    (v / columns) as f64 * cell[1] - 0.5 * size[1],
                ]
            })
            .collect();

        let mut triangles = Vec::with_capacity(2 * (rows - 1) * (columns - 1));
        let mut diagonals = Vec::with_capacity((rows - 1) * (columns - 1));
        let rest_length = cell[0].hypot(cell[1]);
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let [a, b] = [at(row, column), at(row, column + 1)];
                let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
                triangles.extend([[a, b, d], [a, d, c]]);
                diagonals.push(Diagonal {
                    vertices: [a, d],
                    rest_length,
                });
            }
        }

        let areal_mass = 1e-3
            * match config.mass {
                MassModel::Paper => material.areal_mass_g_m2.paper,
                MassModel::Datasheet => material.areal_mass_g_m2.datasheet,
            };
        let third = areal_mass * cell[0] * cell[1] / 6.0;
        let mut mass = vec![0.0; rows * columns];
        for &v in triangles.iter().flatten() {
            mass[v as usize] += third;
        }

        let border = |i: usize, count: usize| if i == 0 || i + 1 == count { 0.5 } else { 1.0 };
        let warps = (0..rows).map(|row| Yarn {
            family: Family::Warp,
            vertices: (0..columns).map(|column| at(row, column)).collect(),
            rest_length: cell[0],
            width: cell[1] * border(row, rows),
        });
        let wefts = (0..columns).map(|column| Yarn {
            family: Family::Weft,
            vertices: (0..rows).map(|row| at(row, column)).collect(),
            rest_length: cell[1],
            width: cell[0] * border(column, columns),
        });
        let yarns = warps.chain(wefts).collect();

        Ok(Self {
            material,
            columns,
            rows,
            rest,
            triangles,
            mass,
            yarns,
            diagonals,
        })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    /// Pairs of triangles over every inner edge, for dihedral bending.
    pub fn hinges(&self) -> Vec<Hinge> {
        let mut open = std::collections::BTreeMap::new();
        let mut hinges = Vec::new();
        for (index, triangle) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| triangle[(k + i) % 3]);
                // A neighbour runs through the shared edge the other way round.
                if let Some((other, opposite)) = open.remove(&(b, a)) {
                    let [p, q] = [a, b].map(|v: u32| self.rest[v as usize]);
                    let square = (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
                    let area = self.rest_area(index) + self.rest_area(other);
                    hinges.push(Hinge {
                        vertices: [a, b, c, opposite],
                        weight: square / area,
                    });
                } else {
                    open.insert((a, b), (index, c));
                }
            }
        }
        hinges
    }

    fn rest_area(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.triangles[triangle].map(|v| self.rest[v as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    }

    /// Vertices whose rest position lies within `radius` [m] of that of `vertex` along both
    /// axes, itself included, ascending.
    pub fn within(&self, vertex: u32, radius: f64) -> impl Iterator<Item = u32> + '_ {
        let centre = self.rest[vertex as usize];
        let reach = |k: usize, stride: usize| {
            let cell = self.rest[stride][k] - self.rest[0][k];
            // A hair more than the radius, so that a vertex exactly on it counts.
            (radius / cell * (1.0 + 1e-9)) as usize
        };
        let (across, along) = (reach(0, 1), reach(1, self.columns));
        let (row, column) = (
            vertex as usize / self.columns,
            vertex as usize % self.columns,
        );
        debug_assert!(self.rest[row * self.columns + column] == centre);
        let columns = column.saturating_sub(across)..=(column + across).min(self.columns - 1);
        (row.saturating_sub(along)..=(row + along).min(self.rows - 1)).flat_map(move |row| {
            columns
                .clone()
                .map(move |column| (row * self.columns + column) as u32)
        })
    }

    /// The vertices next to `vertex`, diagonals included (up to 8).
    pub fn neighbors(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let (row, column) = (
            vertex as usize / self.columns,
            vertex as usize % self.columns,
        );
        let rows = row.saturating_sub(1)..=(row + 1).min(self.rows - 1);
        rows.flat_map(move |r| {
            let columns = column.saturating_sub(1)..=(column + 1).min(self.columns - 1);
            columns.map(move |c| (r * self.columns + c) as u32)
        })
        .filter(move |&v| v != vertex)
    }

    /// The lamina as a mesh, with its vertices at `position` [m].
    pub fn mesh(&self, position: &[[f64; 3]]) -> TriMesh {
        TriMesh {
            vertices: position.iter().map(|&x| Vec3::from(x)).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Engineering strain of every yarn edge at `position`: (length - rest) / rest, yarn by
    /// yarn.
    pub fn yarn_strain(&self, position: &[[f64; 3]]) -> Vec<f64> {
        let mut strain = Vec::new();
        for yarn in &self.yarns {
            for pair in yarn.vertices.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|v| Vec3::from(position[v as usize]));
                strain.push((b - a).norm() / yarn.rest_length - 1.0);
            }
        }
        strain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standard() -> Lamina {
        Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap()
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
}
