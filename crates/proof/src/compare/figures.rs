//! What a comparison finds: the figures of `drape compare`, with their units in their names.

use serde::Serialize;

use drape_cloth::mesh::compare::{ContourDeviation, Distances, Holes, Wrinkles};
use drape_report::{Format::Digits, Table};

/// How drape A differs from the reference B, and what each is like.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Over the whole blank.
    #[serde(flatten)]
    pub all: Parts,
    /// Outer contour of A, sampled along its length, from that of B, and the other way round [mm].
    pub contour_a_to_b_mm: Option<ContourDeviation>,
    pub contour_b_to_a_mm: Option<ContourDeviation>,
    /// Within the region and outside of it; none without a region.
    pub inside: Option<Parts>,
    pub outside: Option<Parts>,
    pub a: DrapeMeasures,
    pub b: DrapeMeasures,
    /// What is null, and why.
    pub not_applicable: Vec<Inapplicable>,
}

/// A figure of one drape for a reader: its name, its unit, and how it is got.
type Alone = (
    &'static str,
    &'static str,
    fn(&DrapeMeasures) -> Option<f64>,
);

const ALONE: [Alone; 18] = [
    ("pieces", "", |m| Some(m.pieces? as f64)),
    ("holes", "", |m| Some(m.holes_mm2?.count as f64)),
    ("their area", "mm2", |m| Some(m.holes_mm2?.area)),
    ("wrinkles", "", |m| Some(m.wrinkles_mm?.count as f64)),
    ("their amplitude", "mm", |m| Some(m.wrinkles_mm?.amplitude)),
    ("their rms", "mm", |m| Some(m.wrinkles_mm?.rms)),
    ("shear, rms", "deg", |m| Some(m.shear_deg?.spread.rms)),
    ("shear, min", "deg", |m| Some(m.shear_deg?.spread.min)),
    ("shear, max", "deg", |m| Some(m.shear_deg?.spread.max)),
    ("locked", "mm2", |m| Some(m.shear_deg?.locked_area_mm2)),
    ("yarn strain, p95", "%", |m| Some(1e2 * m.strain?.p95)),
    ("yarn strain, max", "%", |m| Some(1e2 * m.strain?.max)),
    ("yarn tension, p95", "%", |m| {
        Some(1e2 * m.strain?.tension_p95)
    }),
    ("yarn tension, max", "%", |m| {
        Some(1e2 * m.strain?.tension_max)
    }),
    ("bridged", "mm2", |m| Some(m.tool?.bridged_area_mm2)),
    ("bridged share", "%", |m| Some(1e2 * m.tool?.bridged_share)),
    ("penetration", "mm", |m| Some(m.tool?.penetration_mm)),
    ("surplus", "mm", |m| m.tool?.surplus_mm),
];

impl Comparison {
    /// For a reader: how far both deviate over each part, and what each is like.
    pub fn tables(&self) -> [Table; 2] {
        let nan = f64::NAN;
        let mut rows: Vec<(&str, &str, &str, [f64; 6])> = Vec::new();
        let mut add = |part, figure, unit, values: Option<[f64; 6]>| {
            rows.extend(values.map(|values| (part, figure, unit, values)));
        };
        let spread = |s: Distances| [s.mean, s.rms, s.p95, s.min, s.max, nan];
        let angle = |a: Angles| {
            let Distances { mean, p95, max, .. } = a.spread;
            [mean, nan, p95, nan, max, 1e2 * a.share_below]
        };
        let most = |max: f64| [nan, nan, nan, nan, max, nan];
        for (part, found) in self.parts() {
            let (a_to_b, b_to_a) = (found.topology_a_to_b_mm, found.topology_b_to_a_mm);
            let (points, farthest) = (found.material_points_mm, found.hausdorff_mm);
            let warp = found.fibre_angle_deg.map(|[warp, _]| angle(warp));
            let weft = found.fibre_angle_deg.map(|[_, weft]| angle(weft));
            add(part, "topology A to B", "mm", a_to_b.map(spread));
            add(part, "topology B to A", "mm", b_to_a.map(spread));
            add(part, "material points", "mm", points.map(spread));
            add(part, "Hausdorff", "mm", farthest.map(most));
            add(part, "warp angle", "deg", warp);
            add(part, "weft angle", "deg", weft);
        }
        let contour = |c: ContourDeviation| [c.mean, nan, nan, nan, c.max, nan];
        let (a_to_b, b_to_a) = (self.contour_a_to_b_mm, self.contour_b_to_a_mm);
        add("all", "contour A to B", "mm", a_to_b.map(contour));
        add("all", "contour B to A", "mm", b_to_a.map(contour));
        let mut deviations = Table::of("deviations", "A against the reference B", &rows)
            .text("part", |row| row.0)
            .text("figure", |row| row.1)
            .text("unit", |row| row.2);
        for (k, name) in ["mean", "rms", "p95", "min", "max"].into_iter().enumerate() {
            deviations = deviations.number(name, 3, move |row| row.3[k]);
        }
        let deviations = deviations.number("agrees [%]", 1, |row| row.3[5]);
        let alone = Table::of("alone", "Each alone", &ALONE)
            .text("figure", |row| row.0)
            .text("unit", |row| row.1)
            .number("A", Digits(4), |row| (row.2)(&self.a))
            .number("B", Digits(4), |row| (row.2)(&self.b));
        [deviations.end(), alone.end()]
    }

    /// What is compared over all, and inside and outside of the region if there is one.
    pub fn parts(&self) -> impl Iterator<Item = (&'static str, &Parts)> {
        let inside = self.inside.iter().map(|parts| ("inside", parts));
        let outside = self.outside.iter().map(|parts| ("outside", parts));
        [("all", &self.all)]
            .into_iter()
            .chain(inside)
            .chain(outside)
    }
}

/// What two drapes are compared by over a part of the blank.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parts {
    /// Signed distance of A's vertices from B [mm], positive on B's upper side, weighed with
    /// their areas; and the other way round.
    pub topology_a_to_b_mm: Option<Distances>,
    pub topology_b_to_a_mm: Option<Distances>,
    /// Greatest distance of any vertex of one from the other [mm].
    pub hausdorff_mm: Option<f64>,
    /// Shares of A's and of B's area that lie sideways of the other's border [-].
    pub beyond_border_share: [f64; 2],
    /// Distance between the same material points [mm].
    pub material_points_mm: Option<Distances>,
    /// Warp and weft [deg].
    pub fibre_angle_deg: Option<[Angles; 2]>,
}

/// Angle between the yarns of one family in two drapes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Angles {
    /// Share of the area in which the yarns agree [-].
    pub share_below: f64,
    /// Over the area [deg].
    #[serde(flatten)]
    pub spread: Distances,
}

/// What one drape is measured by alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DrapeMeasures {
    pub vertices: usize,
    pub triangles: usize,
    /// Area as it lies [mm^2].
    pub area_mm2: f64,
    /// Pieces that do not hang together; the contour is that of the largest. None without a border.
    pub pieces: Option<usize>,
    /// Holes in it, which are no contour, and their area [mm^2]; none without a border.
    pub holes_mm2: Option<Holes>,
    /// Heights [mm]; see [`Wrinkles`].
    pub wrinkles_mm: Option<Wrinkles>,
    /// None for a scan, as `strain`.
    pub shear_deg: Option<Shear>,
    pub strain: Option<Strain>,
    /// None without a tool.
    pub tool: Option<Tooling>,
}

/// 90 degrees less the angle between the yarns [deg].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shear {
    #[serde(flatten)]
    pub spread: Distances,
    /// Area on the flat blank that is sheared beyond locking [mm^2].
    pub locked_area_mm2: f64,
}

/// Engineering strain along the yarns of both families [-], weighed with the area.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Strain {
    pub p95: f64,
    pub max: f64,
    pub tension_p95: f64,
    pub tension_max: f64,
    /// Positive numbers.
    pub compression_p95: f64,
    pub compression_max: f64,
}

/// How a drape lies on the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tooling {
    /// Area of the vertices with a gap [mm^2].
    pub bridged_area_mm2: f64,
    /// That as a share of the whole area [-].
    pub bridged_share: f64,
    /// How deep the surface lies inside the tool, anywhere, by the exact distance [mm].
    pub penetration_mm: f64,
    /// Length that yarns have too much, in the mean over those of the region if there is one
    /// [mm]; none for a scan.
    pub surplus_mm: Option<f64>,
}

/// Figures that could not be found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Inapplicable {
    pub metrics: Vec<&'static str>,
    pub why: String,
}
