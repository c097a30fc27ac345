use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::lamina::Lamina;
use super::material::Family;
use super::membrane::Membrane;
use crate::file::{ReadError, WriteError, read_json, write_atomic};
use crate::math::Vec3;
use crate::mesh::TriMesh;

/// Where every material point of a blank lies: what a simulation leaves, whichever it was.
///
/// Complete by itself: two drapes can be compared without the configurations they came from,
/// and also if their meshes differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drape {
    /// Says what the file is, and in which version.
    format: String,
    /// Unit vector along the warp on the flat blank; the weft is that turned to the left.
    pub warp: [f64; 2],
    /// Rest positions on the flat blank [m], in the order of the lamina's vertices.
    pub rest: Vec<[f64; 2]>,
    /// Positions in the frame of the scene, into which `tool.pose` has moved the tool [m].
    pub position: Vec<[f64; 3]>,
    /// Counter-clockwise from above, on the flat blank.
    pub triangles: Vec<[u32; 3]>,
}

/// The format that this drape writes and reads.
const FORMAT: &str = "drape state 1, metres";

/// How a piece of fabric has been stretched: the images of unit vectors along the yarns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangents {
    pub warp: Vec3,
    pub weft: Vec3,
}

impl Drape {
    /// The lamina at `position` [m].
    pub fn new(lamina: &Lamina, position: &[[f64; 3]]) -> Self {
        Self {
            format: FORMAT.into(),
            warp: lamina.warp,
            rest: lamina.rest.clone(),
            position: position.to_vec(),
            triangles: lamina.triangles.clone(),
        }
    }

    /// Writes the state as JSON, atomically. Numbers are written with all their bits and read
    /// to the last but one.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_atomic(path, |file| {
            serde_json::to_writer(&mut *file, self)?;
            file.write_all(b"\n")
        })
    }

    /// Reads and checks what [`Drape::write`] wrote.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let fault = |fault: String| ReadError::fault(path, fault);
        let drape: Self = read_json(path, "a state file")?;
        drape.check().map_err(fault)?;
        Ok(drape)
    }

    /// Says what is wrong. Vertices and triangles count from 0.
    fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            let found: String = self.format.chars().take(40).collect();
            return Err(format!("`format` is {found:?}, expected {FORMAT:?}"));
        }
        let warp = self.warp;
        let length = warp[0].hypot(warp[1]);
        if length.is_nan() || (length - 1.0).abs() > 1e-6 {
            return Err(format!("`warp` is {warp:?}, expected a unit vector"));
        }
        let (found, count) = (self.position.len(), self.rest.len());
        if found != count {
            return Err(format!(
                "`position` has {found} vertices, expected {count} as `rest` has"
            ));
        }
        if self.triangles.is_empty() {
            return Err("`triangles` is empty, expected at least one".into());
        }
        for (vertex, (rest, position)) in self.rest.iter().zip(&self.position).enumerate() {
            let found: Vec<f64> = rest.iter().chain(position).copied().collect();
            if !found.iter().all(|x| x.abs() <= 1e3) {
                return Err(format!(
                    "vertex {vertex}: found {found:?}, expected numbers within +-1000 m"
                ));
            }
        }
        let mut is_used = vec![false; count];
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(found) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(format!(
                    "triangle {triangle} has vertex {found}, expected one below {count}"
                ));
            }
            let area = self.rest_area(triangle);
            if area <= 0.0 {
                return Err(format!(
                    "triangle {triangle} has area {area} m^2 on the flat blank, expected one \
                     above 0, counter-clockwise"
                ));
            }
            for &v in corners {
                is_used[v as usize] = true;
            }
        }
        // Without an area it would weigh nothing in means, and yet be the farthest of all.
        let loose = is_used.iter().position(|used| !used);
        let fault = |v| format!("vertex {v} is in no triangle, expected it in one at least");
        loose.map_or(Ok(()), |v| Err(fault(v)))
    }

    /// The draped blank.
    pub fn mesh(&self) -> TriMesh {
        TriMesh::new(&self.position, &self.triangles)
    }

    /// The flat blank, at height 0.
    pub fn flat(&self) -> TriMesh {
        let flat: Vec<_> = self.rest.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        TriMesh::new(&flat, &self.triangles)
    }

    /// Area of a triangle on the flat blank [m^2].
    pub fn rest_area(&self, triangle: usize) -> f64 {
        self.piece(triangle).area
    }

    /// Middle of a triangle on the flat blank [m].
    pub fn rest_centre(&self, triangle: usize) -> [f64; 2] {
        let corners = self.triangles[triangle].map(|v| self.rest[v as usize]);
        [0, 1].map(|k| corners.iter().map(|x| x[k]).sum::<f64>() / 3.0)
    }

    /// Where the yarns of a triangle have gone to; their lengths are the stretch.
    pub fn tangents(&self, triangle: usize) -> Tangents {
        let [warp, weft] = self.piece(triangle).columns(&self.position);
        Tangents { warp, weft }
    }

    fn piece(&self, triangle: usize) -> Membrane {
        let corners = self.triangles[triangle];
        Membrane::new(corners, corners.map(|v| self.rest[v as usize]), self.warp)
    }
}

impl Tangents {
    /// Engineering strain along both families [-].
    pub fn strain(&self) -> [f64; 2] {
        [self.warp.norm() - 1.0, self.weft.norm() - 1.0]
    }

    /// By how much the angle between the yarns has closed: 90 degrees less the angle [rad].
    /// 0 where a yarn has no length left.
    pub fn shear(&self) -> f64 {
        let sin = self.warp.cross(&self.weft).norm();
        self.warp.dot(&self.weft).atan2(sin)
    }

    /// Angle [rad] between the yarns of one family here and in `reference`, both seen in the
    /// tangent plane of the reference. A right angle where there is no such plane or direction:
    /// the yarns then have nothing to do with each other.
    pub fn angle(&self, reference: &Self, family: Family) -> f64 {
        let pick = |tangents: &Self| [tangents.warp, tangents.weft][family as usize];
        let normal = reference.warp.cross(&reference.weft).try_normalize(0.0);
        let normal = normal.unwrap_or_default();
        let there = pick(reference);
        let here = pick(self) - normal * pick(self).dot(&normal);
        let (sin, cos) = (here.cross(&there).norm(), here.dot(&there));
        if normal == Vec3::zeros() || (sin == 0.0 && cos == 0.0) {
            return std::f64::consts::FRAC_PI_2;
        }
        sin.atan2(cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::{BlankConfig, Material};

    fn lamina(yarn_angle_deg: f64) -> Lamina {
        let config = BlankConfig {
            size_mm: [100.0, 60.0],
            vertices: [6, 4],
            yarn_angle_deg,
            cell_mm: (yarn_angle_deg != 0.0).then_some(15.0),
            ..BlankConfig::default()
        };
        Lamina::new(&config, Material::interglas_92125()).unwrap()
    }

    /// The flat blank moved to `place`(x, y).
    fn draped(lamina: &Lamina, place: impl Fn(f64, f64) -> [f64; 3]) -> Drape {
        let position: Vec<_> = lamina.rest.iter().map(|&[x, y]| place(x, y)).collect();
        Drape::new(lamina, &position)
    }

    fn all(drape: &Drape) -> impl Iterator<Item = Tangents> + '_ {
        (0..drape.triangles.len()).map(|t| drape.tangents(t))
    }

    /// The middle of the blank turns by 20 degrees about the vertical: so do all yarns, also
    /// on a steep reference plane if they turn within it.
    #[test]
    fn turned_yarns_have_the_angle_they_were_turned_by() {
        let angle = 20f64.to_radians();
        let (sin, cos) = angle.sin_cos();
        for yarns in [0.0, 30.0] {
            let lamina = lamina(yarns);
            let flat = draped(&lamina, |x, y| [x, y, 0.0]);
            let turned = draped(&lamina, |x, y| [cos * x - sin * y, sin * x + cos * y, 0.3]);
            for (a, b) in all(&turned).zip(all(&flat)) {
                for family in [Family::Warp, Family::Weft] {
                    assert!((a.angle(&b, family) - angle).abs() < 1e-12);
                }
                assert!(a.shear().abs() < 1e-12);
                assert!(a.strain().iter().all(|s| s.abs() < 1e-12));
            }
            // Lifted out of the plane, the projection turns by nothing, the slope is no angle.
            let lifted = draped(&lamina, |x, y| [x, y, 2.0 * x - y]);
            for (a, b) in all(&lifted).zip(all(&flat)) {
                assert!(a.angle(&b, Family::Warp) < 1e-12);
            }
        }
    }

    /// A trellis: both yarns keep their length, the weft leans over by the shear.
    #[test]
    fn sheared_grid_has_its_angle_and_sign() {
        for degrees in [35.0f64, -35.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let sheared = draped(&lamina(0.0), |x, y| [x + sin * y, cos * y, 0.1]);
            for tangents in all(&sheared) {
                assert!((tangents.shear().to_degrees() - degrees).abs() < 1e-9);
                assert!(tangents.strain().iter().all(|s| s.abs() < 1e-12));
            }
            let flat = draped(&lamina(0.0), |x, y| [x, y, 0.1]);
            for (a, b) in all(&sheared).zip(all(&flat)) {
                assert!(a.angle(&b, Family::Warp) < 1e-12);
                assert!((a.angle(&b, Family::Weft).to_degrees() - 35.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn stretched_yarns_have_their_strain() {
        let stretched = draped(&lamina(30.0), |x, y| [1.02 * x, 1.02 * y, 0.0]);
        for tangents in all(&stretched) {
            assert!(tangents.strain().iter().all(|s| (s - 0.02).abs() < 1e-12));
        }
        let collapsed = draped(&lamina(0.0), |_, _| [0.1; 3]);
        let flat = draped(&lamina(0.0), |x, y| [x, y, 0.0]);
        let (lost, found) = (collapsed.tangents(0), flat.tangents(0));
        assert_eq!(lost.shear(), 0.0);
        for (a, b) in [(lost, found), (found, lost), (lost, lost)] {
            assert_eq!(a.angle(&b, Family::Weft), std::f64::consts::FRAC_PI_2);
        }
    }

    #[test]
    fn state_files_round_trip_and_locate_faults() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let drape = draped(&lamina(30.0), |x, y| [x / 3.0, y.sin(), x * y]);
        drape.write(&path).unwrap();
        let again = Drape::read(&path).unwrap();
        assert_eq!(again.triangles, drape.triangles);
        for (found, expected) in again.position.iter().zip(&drape.position) {
            assert!((0..3).all(|k| (found[k] - expected[k]).abs() <= 1e-15));
        }
        for (found, expected) in again.rest.iter().zip(&drape.rest) {
            assert!((0..2).all(|k| (found[k] - expected[k]).abs() <= 1e-15));
        }
        assert!((drape.flat().area() / lamina(30.0).area() - 1.0).abs() < 1e-12);

        let message = |change: &dyn Fn(&mut Drape)| {
            let mut changed = drape.clone();
            change(&mut changed);
            changed.write(&path).unwrap();
            let error = Drape::read(&path).unwrap_err().to_string();
            error.replace(&path.display().to_string(), "a.json")
        };
        let count = drape.rest.len();
        for (change, expected) in [
            (
                (&|d: &mut Drape| d.format = "drape state 9".into()) as &dyn Fn(&mut Drape),
                format!("`format` is \"drape state 9\", expected \"{FORMAT}\""),
            ),
            (
                &|d| d.warp = [1.0, 1.0],
                "`warp` is [1.0, 1.0], expected a unit vector".into(),
            ),
            (
                &|d| d.position.truncate(3),
                format!("`position` has 3 vertices, expected {count} as `rest` has"),
            ),
            (&|d| d.position[4][1] = 2e3, "vertex 4: found [".into()),
            (
                &|d| d.triangles[2][1] = 900,
                format!("triangle 2 has vertex 900, expected one below {count}"),
            ),
            (
                &|d| d.triangles[1].swap(0, 1),
                "triangle 1 has area -".into(),
            ),
            (&|d| d.triangles.clear(), "`triangles` is empty".into()),
            (
                &|d| {
                    d.rest.push([0.0; 2]);
                    d.position.push([5.0; 3]);
                },
                format!("vertex {count} is in no triangle"),
            ),
        ] {
            let message = message(change);
            let expected = format!("a.json: {expected}");
            assert!(message.starts_with(&expected), "{message}");
        }
        std::fs::write(&path, "{").unwrap();
        let error = Drape::read(&path).unwrap_err().to_string();
        assert!(error.contains("not a state file"), "{error}");
    }
}
