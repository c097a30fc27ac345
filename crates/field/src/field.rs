use std::f64::consts::FRAC_1_SQRT_2;

use rayon::prelude::*;
use serde::Serialize;

use drape_cloth::fabric::{Drape, Tangents};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_cloth::mesh::compare::{Sheet, SheetError};

/// Shear up to which fabric thickens as its area shrinks [degrees]. Weaves lock long before; beyond are single cells that the
/// roller has crushed, and the cosine goes to zero.
const MOST_SHEAR: f64 = 80.0;
/// Yarns shorter than this share of their length have no direction that means anything.
const SHORTEST: f64 = 1e-6;
/// Cosine of the greatest angle between the plane of an element and that of the fabric over it: 45 degrees.
const LEAST_COSINE: f64 = FRAC_1_SQRT_2;

/// Fabric in one element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fibre {
    /// Unit vector along the warp, in the element's plane.
    pub warp: Vec3,
    /// Along the weft; at a right angle to the warp only where the fabric is not sheared.
    pub weft: Vec3,
    /// By how much the angle between the yarns has closed from 90 degrees [degrees], negative where it has opened.
    pub shear_deg: f64,
    /// Thickness over that of the flat fabric: one over the cosine of the shear, as the volume of the fibres stays. Shear
    /// beyond 80 degrees counts as 80.
    pub thickness_factor: f64,
    /// By how much a warp and a weft together are longer than their traces on the tool, over one cell of the fabric [m].
    pub surplus: f64,
}

/// Fabric in every element of a triangle mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// [m]
    pub mesh: TriMesh,
    /// Of each triangle; none where there is no fabric, or where it has no directions left.
    pub fibres: Vec<Option<Fibre>>,
    /// Thickness of the flat fabric [m].
    pub thickness: f64,
}

/// What a field comes to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FieldSummary {
    pub elements: usize,
    /// Those without fabric.
    pub unmapped: usize,
    /// Greatest shear, of either sign.
    pub max_shear_deg: f64,
    /// Mean of the shear's absolute value, over the area that has fabric.
    pub mean_shear_deg: f64,
    /// Mean over that area.
    pub mean_thickness_factor: f64,
    /// Elements sheared by more than 80 degrees, whose thickness factor is that of 80.
    pub over_80_deg: usize,
}

/// Why a field could not be mapped on to a mesh.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum OntoError {
    #[error("the draped fabric: {0}")]
    Fabric(#[from] SheetError),
    #[error(
        "none of its {elements} elements has fabric within {within_mm} mm, the nearest is {nearest_mm:.1} mm away: \
         expected a mesh of the draped surface, within 45 degrees of it, in the same unit and frame"
    )]
    Nowhere {
        elements: usize,
        within_mm: f64,
        nearest_mm: f64,
    },
}

impl Field {
    /// Of a draped blank, in the frame in which its positions are. `feet` are the points of the tool nearest to the vertices,
    /// in any frame, and `cell` the sides of a cell along warp and weft [m].
    pub fn new(drape: &Drape, feet: &[Vec3], cell: [f64; 2], thickness: f64) -> Self {
        let mut traces = drape.clone();
        traces.position = feet.iter().map(|&foot| foot.into()).collect();
        let fibre = |t: usize| {
            let trace = traces.tangents(t);
            let excess = |along: Vec3, side: f64| (side * (1.0 - along.norm())).max(0.0);
            let surplus = excess(trace.warp, cell[0]) + excess(trace.weft, cell[1]);
            Fibre::new(drape.tangents(t), surplus)
        };
        Self {
            mesh: drape.mesh(),
            fibres: (0..drape.triangles.len()).map(fibre).collect(),
            thickness,
        }
    }

    /// This fabric in the elements of another mesh in the same frame: what the triangle nearest to the middle of an
    /// element has, turned into the element's plane. There is none where that triangle is farther away than `within` [m] or
    /// steeper than 45 degrees against the element, or where the middle lies beside the fabric. Which side of the element is
    /// up does not count.
    pub fn onto(&self, mesh: TriMesh, within: f64) -> Result<Self, OntoError> {
        let sheet = Sheet::new(&self.mesh)?;
        let found = (0..mesh.triangles.len()).into_par_iter().map(|t| {
            let foot = sheet.foot(middle(&mesh, t));
            let normal = normal(&mesh, t)?;
            let over = self::normal(&self.mesh, foot.triangle)?;
            let is_over = foot.distance <= within
                && !foot.is_beyond
                && normal.dot(&over).abs() >= LEAST_COSINE;
            let fibre = self.fibres[foot.triangle].filter(|_| is_over)?;
            let laid = |along: Vec3| (along - normal * normal.dot(&along)).try_normalize(SHORTEST);
            Some(Fibre {
                warp: laid(fibre.warp)?,
                weft: laid(fibre.weft)?,
                ..fibre
            })
        });
        let fibres: Vec<_> = found.collect();
        if fibres.iter().all(Option::is_none) {
            let away = |t| sheet.foot(middle(&mesh, t)).distance;
            let all = (0..fibres.len()).into_par_iter().map(away);
            return Err(OntoError::Nowhere {
                elements: fibres.len(),
                within_mm: (1e6 * within).round() / 1e3,
                nearest_mm: 1e3 * all.reduce(|| f64::INFINITY, f64::min),
            });
        }
        Ok(Self {
            mesh,
            fibres,
            thickness: self.thickness,
        })
    }

    /// Elements with fabric, and their numbers from 0.
    pub fn elements(&self) -> impl Iterator<Item = (usize, &Fibre)> {
        let all = self.fibres.iter().enumerate();
        all.filter_map(|(t, fibre)| Some((t, fibre.as_ref()?)))
    }

    /// What the field comes to; zeros where there is no fabric.
    pub fn summary(&self) -> FieldSummary {
        let area = |t: usize| {
            let [a, b, c] = self.mesh.corners(t);
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        let total: f64 = self.elements().map(|(t, _)| area(t)).sum();
        let mean = |of: fn(&Fibre) -> f64| {
            let sum: f64 = self.elements().map(|(t, fibre)| area(t) * of(fibre)).sum();
            if total > 0.0 { sum / total } else { 0.0 }
        };
        let shear = || self.elements().map(|(_, fibre)| fibre.shear_deg.abs());
        FieldSummary {
            elements: self.fibres.len(),
            unmapped: self.fibres.len() - self.elements().count(),
            max_shear_deg: shear().fold(0.0, f64::max),
            mean_shear_deg: mean(|fibre| fibre.shear_deg.abs()),
            mean_thickness_factor: mean(|fibre| fibre.thickness_factor),
            over_80_deg: shear().filter(|shear| *shear > MOST_SHEAR).count(),
        }
    }

    /// Middle of an element [m].
    pub(crate) fn middle(&self, element: usize) -> Vec3 {
        middle(&self.mesh, element)
    }

    /// Unit vector from the first corner of an element to its second, and its unit normal; of an element that has fabric.
    pub(crate) fn axes(&self, element: usize) -> [Vec3; 2] {
        let [a, b, c] = self.mesh.corners(element);
        let side = (b - a).try_normalize(0.0).unwrap_or(Vec3::x());
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
        [side, normal.unwrap_or(Vec3::z())]
    }

    /// Angle from the first side of an element to a direction in its plane, counter-clockwise seen from its upper side
    /// [degrees].
    pub(crate) fn angle_deg(&self, element: usize, along: &Vec3) -> f64 {
        let [side, normal] = self.axes(element);
        let (x, y) = (side.dot(along), normal.cross(&side).dot(along));
        y.atan2(x).to_degrees()
    }
}

impl Fibre {
    /// None if a yarn has no length left, or none that is a number.
    fn new(tangents: Tangents, surplus: f64) -> Option<Self> {
        let unit = |along: Vec3| along.try_normalize(SHORTEST);
        let shear_deg = tangents.shear().to_degrees();
        let fibre = Self {
            warp: unit(tangents.warp)?,
            weft: unit(tangents.weft)?,
            shear_deg,
            thickness_factor: 1.0 / shear_deg.abs().min(MOST_SHEAR).to_radians().cos(),
            surplus,
        };
        let numbers = [fibre.shear_deg, fibre.surplus];
        let directions = fibre.warp.iter().chain(&fibre.weft);
        let is_finite = directions.chain(&numbers).all(|x| x.is_finite());
        is_finite.then_some(fibre)
    }
}

fn middle(mesh: &TriMesh, triangle: usize) -> Vec3 {
    let [a, b, c] = mesh.corners(triangle);
    (a + b + c) / 3.0
}

/// None of a triangle without area.
fn normal(mesh: &TriMesh, triangle: usize) -> Option<Vec3> {
    let [a, b, c] = mesh.corners(triangle);
    (b - a).cross(&(c - a)).try_normalize(0.0)
}
