use serde::Serialize;

use super::fall::Scene;
use crate::fabric::Lamina;
use crate::mesh::patches;
use crate::sim::Snapshot;

/// A vertex this far from the tool belongs to a wrinkle [m].
const WRINKLE_HEIGHT: f64 = 0.015;
/// A wrinkle takes at least this share of the blank's vertices.
const WRINKLE_SHARE: f64 = 0.004;

/// Key figures of a state: how well the lamina lies, and whether the state can be believed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Sum of the distances of all vertices to the tool [m].
    pub distance_m: f64,
    /// Number of wrinkles, see [`wrinkle_count`].
    pub wrinkles: usize,
    /// 95th percentile and maximum of the absolute yarn strain [-].
    pub strain_p95: f64,
    pub strain_max: f64,
    /// Of the tensile strain alone: yarns hardly stretch, so this must be small.
    pub tension_p95: f64,
    pub tension_max: f64,
    /// Of the compressive strain alone, as positive numbers: surplus that is crushed because
    /// the mesh cannot fold it away.
    pub compression_p95: f64,
    pub compression_max: f64,
    /// How deep the sheet lies inside the tool, anywhere on its triangles, by the exact distance [mm].
    pub penetration_mm: f64,
    /// Places where an edge of the lamina passes through one of its triangles.
    pub self_intersections: usize,
    /// Root mean square speed [mm/s].
    pub v_rms_mm_s: f64,
}

impl Scene {
    /// Sum of the distances of all vertices of a state to the tool [m].
    pub fn distance(&self, state: &Snapshot) -> f64 {
        self.distances(state).iter().map(|phi| phi.max(0.0)).sum()
    }

    fn distances(&self, state: &Snapshot) -> Vec<f64> {
        let all = state.position.iter();
        all.map(|&x| self.tool.distance(x).0).collect()
    }

    /// 95th percentile and maximum of the absolute yarn strain of a state [-].
    pub fn strain(&self, state: &Snapshot) -> [f64; 2] {
        let strain = self.lamina.yarn_strain(&state.position);
        percentile_and_max(strain.into_iter().map(f64::abs).collect())
    }

    /// Key figures of a state of this scene. Its penetration takes a tenth of a second.
    pub fn summary(&self, state: &Snapshot) -> Summary {
        let Self { lamina, tool, .. } = self;
        let sheet = lamina.mesh(&state.position);
        let phi = self.distances(state);
        let strain = lamina.yarn_strain(&state.position);
        let of = |f: fn(f64) -> f64| percentile_and_max(strain.iter().map(|&s| f(s)).collect());
        let [strain_p95, strain_max] = self.strain(state);
        let [tension_p95, tension_max] = of(|s| s.max(0.0));
        let [compression_p95, compression_max] = of(|s| (-s).max(0.0));
        Summary {
            distance_m: self.distance(state),
            wrinkles: wrinkle_count(lamina, &phi),
            strain_p95,
            strain_max,
            tension_p95,
            tension_max,
            compression_p95,
            compression_max,
            penetration_mm: 1e3 * tool.surface.deepest(&sheet).depth,
            self_intersections: sheet.self_intersection_count(),
            v_rms_mm_s: 1e3 * state.v_rms(),
        }
    }
}

/// 95th percentile and maximum; NaN counts as the largest number.
fn percentile_and_max(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    [values[(0.95 * last as f64).round() as usize], values[last]]
}

/// Number of separate patches that stand more than 15 mm off the tool and reach the border of the
/// blank, each at least 0.4 % of its vertices. Patches over the inside bridge a hollow.
///
/// `phi` is the distance of each vertex to the tool [m].
pub fn wrinkle_count(lamina: &Lamina, phi: &[f64]) -> usize {
    let min = (WRINKLE_SHARE * phi.len() as f64).ceil() as usize;
    let mut open: Vec<bool> = phi.iter().map(|&phi| phi > WRINKLE_HEIGHT).collect();
    let neighbors = |v| lamina.neighbors(v as u32).map(|v| v as usize);
    let is_wrinkle =
        |patch: &&Vec<usize>| patch.len() >= min && patch.iter().any(|&v| neighbors(v).count() < 8);
    let patches = patches(&mut open, neighbors);
    patches.iter().filter(is_wrinkle).count()
}
