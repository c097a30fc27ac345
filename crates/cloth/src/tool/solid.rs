use super::config::{GridConfig, Source, ToolConfig};
use super::error::ToolError;
use super::grid::DistanceGrid;
use super::sharp::{NEAR, SharpCells};
use super::solidity::bounded;
use super::surface::{Surface, is_open};
use crate::math::{Lanes, Vec3};
use crate::mesh::{TriMesh, read_mesh};

/// A rigid tool at its place, with everything that contact and export ask of it.
#[derive(Clone, Debug)]
pub struct Tool {
    /// Where in the scene the frame lies in which the tool is and all cloth over it is computed [m]: whole
    /// metres, 0 for a tool less than one metre from there. Single precision has 4 um left at 50 m.
    pub origin: Vec3,
    /// Facing outwards (upwards if open).
    pub mesh: TriMesh,
    /// Exact distance and nearest point; slow.
    pub surface: Surface,
    /// Interpolated distance; fast.
    pub grid: DistanceGrid,
    /// Where that errs too much, so that the exact distance replaces it; nowhere if its spacing
    /// was given.
    pub(super) sharp: Option<SharpCells>,
    /// The mesh as given faced inwards (downwards if open) and was turned over.
    pub flipped: bool,
    /// Facets without area that were dropped from the file.
    pub dropped_facet_count: usize,
}

/// From this distance on [m] between the origin and the middle of a tool, everything is computed about the tool.
const FAR: f64 = 1.0;

impl Tool {
    /// Reads or makes the mesh, puts it into place and samples its distance.
    ///
    /// # Errors
    /// Values that make no sense, unreadable files, inconsistent meshes, too fine grids.
    pub fn new(config: &ToolConfig) -> Result<Self, ToolError> {
        config.check().map_err(|error| error.within("tool"))?;
        let (mut mesh, dropped_facet_count) = match &config.source {
            Source::Shape(shape) => {
                let mesh = shape.mesh();
                (mesh.map_err(|e| e.within("tool.source.shape"))?, 0)
            }
            Source::Mesh(file) => {
                let file = read_mesh(&file.path, file.scale)?;
                (file.mesh, file.dropped_facet_count)
            }
        };
        let (low, high) = mesh.bounds();
        let middle = config.pose.apply(&((low + high) * 0.5), &Vec3::zeros());
        let origin = middle.map(|x| if x.abs() < FAR { 0.0 } else { x.round() });
        for vertex in &mut mesh.vertices {
            *vertex = config.pose.apply(vertex, &origin);
        }
        let tool = Self::from_mesh(mesh, &config.grid);
        let mut tool = tool.map_err(|error| error.moved_back(&origin))?;
        tool.origin = origin;
        tool.dropped_facet_count = dropped_facet_count;
        Ok(tool)
    }

    /// Makes a tool of a mesh [m] that is already in place. A mesh that faces inwards, or
    /// downwards if it is open, is turned over.
    ///
    /// # Errors
    /// As for [`Tool::new`].
    pub fn from_mesh(mut mesh: TriMesh, grid: &GridConfig) -> Result<Self, ToolError> {
        let mut flipped = !is_open(&mesh) && mesh.signed_volume() < 0.0;
        if flipped {
            mesh.flip();
        }
        let surface = match bounded(&mesh) {
            // An open mesh that faces down: its solid shall be below it.
            Err(error @ ToolError::NoSolid { count, .. }) => {
                flipped = !flipped;
                mesh.flip();
                // What is wrong either way is told of the way in which less is wrong.
                bounded(&mesh).map_err(|turned| match turned {
                    ToolError::NoSolid { count: other, .. } if other >= count => error,
                    turned if is_open(&mesh) => ToolError::TurnedOver(turned.into()),
                    _ => error,
                })?
            }
            surface => surface?,
        };
        let (low, high) = mesh.bounds();
        let margin = Vec3::repeat(grid.margin_mm * 1e-3);
        let (low, high) = (low - margin, high + margin);
        let spacing = |mm| DistanceGrid::new(&surface, low, high, mm * 1e-3);
        let (grid, sharp) = match grid.spacing_mm {
            Some(mm) => (spacing(mm)?, None),
            None => {
                let grid = spacing(DistanceGrid::usual_spacing_mm(high - low))?;
                let sharp = SharpCells::new(&surface, &grid);
                (grid, sharp)
            }
        };
        Ok(Self {
            origin: Vec3::zeros(),
            mesh,
            surface,
            grid,
            sharp,
            flipped,
            dropped_facet_count: 0,
        })
    }

    /// Distance to the tool [m], negative inside, and its outward unit normal: what contact,
    /// presses and observations work with. Interpolated, but for exact places: see [`GridConfig`].
    pub fn distance(&self, x: [f64; 3]) -> (f64, [f64; 3]) {
        let (phi, gradient) = self.grid.sample(x);
        let exact = self.exact(x, phi).map(|(phi, normal)| (phi, normal.into()));
        exact.unwrap_or_else(|| (phi, unit(gradient)))
    }

    /// Where in the scene what lies at `x` is [m].
    pub fn in_scene(&self, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut x = x.to_vec();
        // Not by 0, which would make -0 to 0.
        for k in (0..3).filter(|&k| self.origin[k] != 0.0) {
            x.iter_mut().for_each(|x| x[k] += self.origin[k]);
        }
        x
    }

    /// Its mesh where it is in the scene [m].
    pub fn mesh_in_scene(&self) -> TriMesh {
        let vertices: Vec<[f64; 3]> = self.mesh.vertices.iter().map(|&x| x.into()).collect();
        TriMesh::new(&self.in_scene(&vertices), &self.mesh.triangles)
    }

    /// The grid, if all distances are interpolated in it.
    #[cfg(feature = "gpu")]
    pub(crate) fn only_grid(&self) -> Option<&DistanceGrid> {
        self.sharp.is_none().then_some(&self.grid)
    }

    /// Summed distance of some vertices of a sheet at `x` [m], those inside counted as on the tool.
    pub fn summed_distance(&self, vertices: impl Iterator<Item = usize>, x: &[[f64; 3]]) -> f64 {
        vertices.map(|v| self.distance(x[v]).0.max(0.0)).sum()
    }

    /// The exact distance and normal at `x` [m], whose interpolated distance is `phi` [m]; none
    /// outside sharp cells.
    pub(super) fn exact(&self, x: [f64; 3], phi: f64) -> Option<(f64, Vec3)> {
        let near = phi.abs();
        let sharp = self.sharp.as_ref().filter(|sharp| near < sharp.reach)?;
        let facets = sharp.facets(&self.grid, x);
        let (exact, n) = match facets {
            [] => return None,
            [SharpCells::MANY] => self.surface.contact(x.into(), near + sharp.off),
            few => self.surface.contact_among(few, x.into()),
        };
        // Farther off, the nearest facet need not be among them.
        Some(match exact.abs() > NEAR {
            true => self.surface.contact(x.into(), near + sharp.off),
            false => (exact, n),
        })
    }
}

/// The direction of a gradient; up where there is none.
#[inline(always)]
pub(super) fn unit<V: Lanes>([a, b, c]: [V; 3]) -> [V; 3] {
    let norm = (a * a + b * b + c * c).sqrt();
    let flat = norm.lt(V::of(1e-9));
    let inverse = V::of(1.0) / V::select(flat, V::of(1.0), norm);
    let unit = |g: V, up: f64| V::select(flat, V::of(up), g * inverse);
    [unit(a, 0.0), unit(b, 0.0), unit(c, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::write_stl;
    use crate::tool::{MeshSource, Plate, Pose, Shape};

    #[test]
    fn config_reads_as_documented() {
        let config: ToolConfig = toml::from_str(
            r#"
            [source.stl]
            path = "punch.stl"
            [pose]
            rotation_deg = [0, 0, 90]
            [grid]
            spacing_mm = 3
            "#,
        )
        .unwrap();
        assert_eq!(
            config,
            ToolConfig {
                source: Source::Mesh(MeshSource {
                    path: "punch.stl".into(),
                    scale: 1e-3,
                }),
                pose: Pose {
                    translation_mm: [0.0; 3],
                    rotation_deg: [0.0, 0.0, 90.0],
                },
                grid: GridConfig {
                    spacing_mm: Some(3.0),
                    margin_mm: 40.0,
                },
            }
        );
        let config: ToolConfig = toml::from_str("").unwrap();
        assert_eq!(config, ToolConfig::default());
        let again = toml::from_str(&toml::to_string(&config).unwrap()).unwrap();
        assert_eq!(config, again);
        let error = toml::from_str::<ToolConfig>("[grid]\nspacing = 3").unwrap_err();
        assert!(error.message().contains("unknown field `spacing`"));
    }

    #[test]
    fn senseless_config_names_its_key() {
        let mut config = ToolConfig::default();
        config.pose.rotation_deg[1] = f64::INFINITY;
        assert_eq!(
            config.check().unwrap_err().to_string(),
            "`pose.rotation_deg` is inf, expected numbers within +-100000"
        );
        config = ToolConfig::default();
        config.grid.spacing_mm = Some(0.0);
        assert_eq!(config.check().unwrap_err().key, "grid.spacing_mm");
        config = ToolConfig::default();
        config.source = Source::Mesh(MeshSource {
            path: "punch.stl".into(),
            scale: -1.0,
        });
        assert_eq!(config.check().unwrap_err().key, "source.mesh.scale");
    }

    #[test]
    fn pose_turns_about_x_then_y_then_z_and_moves() {
        let pose = Pose {
            translation_mm: [0.0, 0.0, 10.0],
            rotation_deg: [90.0, 90.0, 0.0],
        };
        // About x: y → z. About y: z → x.
        let moved = pose.apply(&Vec3::y(), &Vec3::zeros());
        assert!((moved - Vec3::new(1.0, 0.0, 0.01)).norm() < 1e-15);
        let pose = Pose {
            translation_mm: [0.0; 3],
            rotation_deg: [90.0, 0.0, 90.0],
        };
        // About x: z → −y. About z: −y → x.
        assert!((pose.apply(&Vec3::z(), &Vec3::y()) - Vec3::new(1.0, -1.0, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn posed_tool_measures_distance_at_its_place() {
        let config = ToolConfig {
            source: Source::Shape(Shape::Plate(Plate::default())),
            pose: Pose {
                translation_mm: [0.0, 0.0, 100.0],
                rotation_deg: [0.0, 20.0, 0.0],
            },
            ..ToolConfig::default()
        };
        let tool = Tool::new(&config).unwrap();
        let n = Vec3::new(
            20.0_f64.to_radians().sin(),
            0.0,
            20.0_f64.to_radians().cos(),
        );
        let x = Vec3::new(0.0, 0.01, 0.1) + n * 0.0137;
        let (phi, grad) = tool.grid.sample(x.into());
        assert!((phi - 0.0137).abs() < 1e-7);
        assert!((Vec3::from(grad) - n).norm() < 1e-5);
    }

    #[test]
    fn file_gives_the_same_tool_as_the_shape_it_was_written_from() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rib.stl");
        let grid = GridConfig {
            spacing_mm: Some(10.0),
            ..GridConfig::default()
        };
        let rib = Tool::from_mesh(Shape::default().mesh().unwrap(), &grid).unwrap();
        write_stl(&path, &rib.mesh, "rib").unwrap();
        let source = Source::Mesh(MeshSource { path, scale: 1e-3 });
        let read = Tool::new(&ToolConfig {
            source,
            grid,
            ..ToolConfig::default()
        })
        .unwrap();
        assert_eq!((read.flipped, read.dropped_facet_count), (false, 0));
        assert_eq!(read.mesh.vertices.len(), 4575);
        assert_eq!(read.grid.dims, rib.grid.dims);
        for (a, b) in read.grid.samples.iter().zip(&rib.grid.samples) {
            assert!((a - b).abs() < 1e-7);
        }
    }

    #[test]
    fn tools_turned_inside_out_are_flipped() {
        let grid = GridConfig {
            spacing_mm: Some(20.0),
            ..GridConfig::default()
        };
        let mut closed = Shape::default().mesh().unwrap();
        let mut open = closed.clone();
        // Without skirt and bottom.
        open.triangles.truncate(8360);
        for mesh in [&mut closed, &mut open] {
            let right = Tool::from_mesh(mesh.clone(), &grid).unwrap();
            mesh.flip();
            let turned = Tool::from_mesh(mesh.clone(), &grid).unwrap();
            assert!(turned.flipped && !right.flipped);
            assert!(turned.grid.sample([0.0, 0.0, 0.03]).0 < 0.0);
            assert_eq!(turned.grid.dims, right.grid.dims);
            assert!(turned.grid.samples == right.grid.samples);
        }
    }
}
