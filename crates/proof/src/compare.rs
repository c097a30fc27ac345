//! Two drapes compared: topology, contour, fibre angles, shear and faults, after the paper's
//! Section 5 and Table 3.

mod figures;
pub mod picture;

pub use figures::{Angles, Comparison, DrapeMeasures, Inapplicable, Parts, Shear, Strain, Tooling};

use std::collections::BTreeSet;

use drape_cloth::fabric::{Drape, Family, Tangents};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_cloth::mesh::compare::{
    Contour, Distances, Foot, Sheet, SheetError, WrinkleFilter, wrinkles,
};
use drape_cloth::tool::Surface;

const MM: f64 = 1e3;

/// One of the surfaces that are compared.
#[derive(Clone, Debug)]
pub struct Surveyed {
    /// The surface, its upper side up [m].
    pub mesh: TriMesh,
    /// Its material coordinates; a scan has none.
    pub drape: Option<Drape>,
    sheet: Sheet,
}

/// What is measured beside the drapes themselves.
#[derive(Clone, Debug, Default)]
pub struct Criteria<'a> {
    pub tool: Option<&'a Surface>,
    /// Least x, least y, greatest x, greatest y on the flat blank [m].
    pub region: Option<[f64; 4]>,
}

/// Shear beyond which fabric counts as locked, as of the built-in material [degrees].
const LOCKING: f64 = 40.0;
/// Yarns closer in direction than this agree [degrees].
const FIBRE: f64 = 5.0;
/// A gap to the tool above this is bridged [m].
const GAP: f64 = 0.5e-3;
const WRINKLE: WrinkleFilter = WrinkleFilter {
    cutoff: 50e-3,
    height: 0.5e-3,
};

impl Surveyed {
    /// A surface without material coordinates. One whose upper side looks down is turned over.
    pub fn scan(mut mesh: TriMesh) -> Result<Self, SheetError> {
        if mesh.area_vector().z < 0.0 {
            mesh.flip();
        }
        Self::new(mesh, None)
    }

    /// A draped blank.
    pub fn draped(drape: Drape) -> Result<Self, SheetError> {
        Self::new(drape.mesh(), Some(drape))
    }

    fn new(mesh: TriMesh, drape: Option<Drape>) -> Result<Self, SheetError> {
        let sheet = Sheet::new(&mesh)?;
        Ok(Self { mesh, drape, sheet })
    }

    fn feet(&self, other: &Self) -> Vec<Foot> {
        let vertices = self.mesh.vertices.iter();
        vertices.map(|&x| other.sheet.foot(x)).collect()
    }
}

/// The part of the blank that is looked at: inside of a region if true, or else outside of it; all
/// without one.
type Part = Option<([f64; 4], bool)>;

/// With the slack of a nanometre that a training's region has.
fn is_inside([x0, y0, x1, y1]: [f64; 4], [x, y]: [f64; 2]) -> bool {
    let inside = |low: f64, at: f64, high: f64| low - 1e-9 <= at && at <= high + 1e-9;
    inside(x0, x, x1) && inside(y0, y, y1)
}

fn has(part: Part, rest: [f64; 2]) -> bool {
    part.is_none_or(|(region, inside)| is_inside(region, rest) == inside)
}

/// Compares `a` with the reference `b`.
pub fn compare(a: &Surveyed, b: &Surveyed, criteria: &Criteria) -> Comparison {
    let mut not_applicable = Vec::new();
    let mut missing = |metrics: &[&'static str], why: &str| {
        let (metrics, why) = (metrics.to_vec(), why.into());
        not_applicable.push(Inapplicable { metrics, why });
    };
    let scans = match (&a.drape, &b.drape) {
        (Some(_), Some(_)) => None,
        (None, Some(_)) => Some("A is"),
        (Some(_), None) => Some("B is"),
        (None, None) => Some("A and B are"),
    };
    if let Some(scans) = scans {
        let why = format!("no material coordinates: {scans} a mesh only");
        missing(&["material_points_mm", "fibre_angle_deg"], &why);
        missing(&["shear_deg", "strain"], &why);
        if criteria.region.is_some() {
            missing(&["inside", "outside"], &why);
        }
    }
    if criteria.tool.is_none() {
        missing(&["tool"], "no tool: give a configuration, or a run");
    }
    let [of_a, of_b] = [a, b].map(|surface| Contour::new(&surface.mesh));
    let contours = [(&of_a, &of_b), (&of_b, &of_a)].map(|(a, b)| {
        let mut deviation = a.as_ref()?.deviation(b.as_ref()?)?;
        deviation.mean *= MM;
        deviation.max *= MM;
        Some(deviation)
    });
    if contours[0].is_none() {
        let metrics = ["contour_a_to_b_mm", "contour_b_to_a_mm"];
        missing(&metrics, "a surface has no border");
    }

    let [a_alone, b_alone] =
        [(a, of_a), (b, of_b)].map(|(surface, contour)| measures(surface, contour, criteria));
    let tools = [&a_alone, &b_alone].map(|alone| alone.tool.as_ref());
    if tools.iter().flatten().any(|tool| tool.surplus_mm.is_none()) {
        missing(
            &["surplus_mm"],
            "no edges along yarns: a mesh only, or none in the region",
        );
    }

    let feet = [a.feet(b), b.feet(a)];
    let parts = |part| parts(a, b, &feet, part);
    let split = criteria.region.filter(|_| scans.is_none());
    Comparison {
        all: parts(None),
        inside: split.map(|region| parts(Some((region, true)))),
        outside: split.map(|region| parts(Some((region, false)))),
        contour_a_to_b_mm: contours[0],
        contour_b_to_a_mm: contours[1],
        a: a_alone,
        b: b_alone,
        not_applicable,
    }
}

/// What is compared over a part of the blank.
fn parts(a: &Surveyed, b: &Surveyed, feet: &[Vec<Foot>; 2], part: Part) -> Parts {
    let is_in_part = |surface: &Surveyed, v: usize| {
        let rest = surface.drape.as_ref().map(|drape| drape.rest[v]);
        part.is_none() || rest.is_some_and(|rest| has(part, rest))
    };
    let mut hausdorff = 0.0f64;
    let mut beyond = [0.0; 2];
    let mut topology = [None; 2];
    for (k, surface) in [a, b].into_iter().enumerate() {
        let areas = surface.mesh.vertex_areas();
        let chosen = || {
            let all = feet[k].iter().zip(&areas).enumerate();
            all.filter(|(v, _)| is_in_part(surface, *v))
                .map(|(_, pair)| pair)
        };
        topology[k] = Distances::new(chosen().map(|(foot, &area)| (MM * foot.deviation, area)));
        hausdorff = chosen().fold(hausdorff, |most, (foot, _)| most.max(MM * foot.distance));
        let total: f64 = chosen().map(|(_, area)| area).sum();
        let outside = chosen().filter(|(foot, _)| foot.is_beyond);
        beyond[k] = outside.fold(0.0, |sum, (_, area)| sum + area) / total.max(f64::MIN_POSITIVE);
    }
    let (mut points, mut angles) = (None, None);
    if let (Some(a), Some(b)) = (&a.drape, &b.drape) {
        // The flat blank of a drape has the same sides as its triangles: never refused.
        if let Ok(flat) = Sheet::new(&b.flat()) {
            points = Distances::new(point_distances(a, b, &flat, part));
            angles = fibre_angles(a, b, &flat, part);
        }
    }
    Parts {
        topology_a_to_b_mm: topology[0],
        topology_b_to_a_mm: topology[1],
        hausdorff_mm: topology[0].map(|_| hausdorff),
        beyond_border_share: beyond,
        material_points_mm: points,
        fibre_angle_deg: angles,
    }
}

/// The foot of a place of the flat blank on that of the other drape; none a micrometre off it.
fn counterpart(flat: &Sheet, [x, y]: [f64; 2]) -> Option<Foot> {
    let foot = flat.foot(Vec3::new(x, y, 0.0));
    (foot.distance <= 1e-6).then_some(foot)
}

/// Distance [mm] between the places of the same material points, with their rest areas.
fn point_distances(a: &Drape, b: &Drape, flat: &Sheet, part: Part) -> Vec<(f64, f64)> {
    let areas = a.flat().vertex_areas();
    let vertices = (0..a.rest.len()).filter(|&v| has(part, a.rest[v]));
    let distances = vertices.filter_map(|v| {
        let foot = counterpart(flat, a.rest[v])?;
        let corners = b.triangles[foot.triangle].iter().zip(foot.weights);
        let corners = corners.map(|(&w, weight)| Vec3::from(b.position[w as usize]) * weight);
        let distance = (Vec3::from(a.position[v]) - corners.sum::<Vec3>()).norm();
        Some((MM * distance, areas[v]))
    });
    distances.collect()
}

/// Angles between the yarns of both drapes in the middles of A's triangles.
fn fibre_angles(a: &Drape, b: &Drape, flat: &Sheet, part: Part) -> Option<[Angles; 2]> {
    let mut pairs = Vec::new();
    for t in 0..a.triangles.len() {
        let centre = a.rest_centre(t);
        if let Some(foot) = counterpart(flat, centre).filter(|_| has(part, centre)) {
            let (here, there) = (a.tangents(t), b.tangents(foot.triangle));
            let angle = |family| here.angle(&there, family);
            let angles = [Family::Warp, Family::Weft].map(angle);
            pairs.push((angles, a.rest_area(t)));
        }
    }
    let of = |family: usize| {
        let angles = || pairs.iter().map(|(angles, area)| (angles[family], *area));
        let spread = Distances::new(angles().map(|(angle, area)| (angle.to_degrees(), area)))?;
        let agrees = |angle: f64| f64::from(u8::from(angle.to_degrees() < FIBRE));
        let agree = Distances::new(angles().map(|(angle, area)| (agrees(angle), area)))?;
        Some(Angles {
            share_below: agree.mean,
            spread,
        })
    };
    Some([of(0)?, of(1)?])
}

/// What one drape is measured by alone.
fn measures(surface: &Surveyed, contour: Option<Contour>, criteria: &Criteria) -> DrapeMeasures {
    let mesh = &surface.mesh;
    let wrinkles = wrinkles(mesh, WRINKLE).map(|mut found| {
        found.amplitude *= MM;
        found.rms *= MM;
        found
    });
    // None of a scan.
    let all: Vec<(Tangents, f64)> = (surface.drape.iter())
        .flat_map(|drape| (0..drape.triangles.len()).map(move |t| (drape, t)))
        .map(|(drape, t)| (drape.tangents(t), drape.rest_area(t)))
        .collect();
    let is_locked = |t: &Tangents| t.shear().abs().to_degrees() > LOCKING;
    let locked = all.iter().filter(|(t, _)| is_locked(t));
    let locked = locked.fold(0.0, |sum, (_, area)| sum + area);
    let shear = Distances::new(all.iter().map(|(t, area)| (t.shear().to_degrees(), *area)));
    let of = |f: fn(f64) -> f64| {
        let both = |(t, area): &(Tangents, f64)| t.strain().map(|strain| (f(strain), *area));
        Distances::new(all.iter().flat_map(both))
    };
    let parts = (of(f64::abs).zip(of(|s| s.max(0.0)))).zip(of(|s| (-s).max(0.0)));
    let strain = parts.map(|((all, tension), compression)| Strain {
        p95: all.p95,
        max: all.max,
        tension_p95: tension.p95,
        tension_max: tension.max,
        compression_p95: compression.p95,
        compression_max: compression.max,
    });
    DrapeMeasures {
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        area_mm2: MM * MM * mesh.area(),
        pieces: contour.as_ref().map(|contour| contour.piece_count),
        holes_mm2: contour.map(|Contour { mut holes, .. }| {
            holes.area *= MM * MM;
            holes
        }),
        wrinkles_mm: wrinkles,
        shear_deg: shear.map(|spread| Shear {
            spread,
            locked_area_mm2: MM * MM * locked,
        }),
        strain,
        tool: (criteria.tool).map(|tool| tooling(surface, tool, criteria.region)),
    }
}

/// What [`drape_cloth::scene::surplus`] is, by the exact nearest points of the tool [mm], of the
/// edges that run along a yarn on the flat blank, those of cut cells as well; in the region if
/// there is one. None without such an edge.
fn surplus_mm(drape: &Drape, tool: &Surface, region: Option<[f64; 4]>) -> Option<f64> {
    // Files may round: a thousandth is far from any other direction of a mesh along its yarns.
    const ALONG: f64 = 1e-3;
    let [c, s] = drape.warp;
    let edge = |v: u32, w: u32| {
        let [p, q] = [v, w].map(|v| drape.rest[v as usize]);
        let [x, y] = [q[0] - p[0], q[1] - p[1]];
        (p, q, x.hypot(y), [c * y - s * x, c * x + s * y])
    };
    let mut families = [BTreeSet::new(), BTreeSet::new()];
    let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    for [v, w] in drape.triangles.iter().flat_map(sides) {
        let (p, q, length, across) = edge(v, w);
        if region.is_none_or(|r| is_inside(r, p) && is_inside(r, q)) {
            for (edges, across) in families.iter_mut().zip(across) {
                if across.abs() < ALONG * length {
                    edges.insert([v.min(w), v.max(w)]);
                }
            }
        }
    }
    let foot = |v: u32| tool.nearest(drape.position[v as usize].into(), f64::MAX).1;
    let (mut sum, mut yarns) = (0.0, 0);
    for edges in &families {
        // A chain has one vertex more than edges; a file may have meshes that are none.
        let vertices: BTreeSet<u32> = edges.iter().flatten().copied().collect();
        yarns += vertices.len().saturating_sub(edges.len());
        for &[v, w] in edges {
            sum += (edge(v, w).2 - (foot(w) - foot(v)).norm()).max(0.0);
        }
    }
    (yarns > 0).then(|| MM * sum / yarns as f64)
}

/// Gaps to the tool and penetration, by the exact distance, and surplus.
fn tooling(surface: &Surveyed, tool: &Surface, region: Option<[f64; 4]>) -> Tooling {
    let (mesh, drape) = (&surface.mesh, surface.drape.as_ref());
    let phi = mesh.vertices.iter().map(|&x| tool.signed_distance(x));
    let phi: Vec<f64> = phi.collect();
    let areas = mesh.vertex_areas();
    let open = phi.iter().zip(&areas).filter(|(phi, _)| **phi > GAP);
    let bridged = open.fold(0.0, |sum, (_, area)| sum + area);
    let total: f64 = areas.iter().sum();
    Tooling {
        bridged_area_mm2: MM * MM * bridged,
        bridged_share: bridged / total.max(f64::MIN_POSITIVE),
        surplus_mm: drape.and_then(|drape| surplus_mm(drape, tool, region)),
        penetration_mm: MM * tool.deepest(mesh).depth,
    }
}

#[cfg(test)]
mod tests;
