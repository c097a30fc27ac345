//! What a substep moves and computes, counted from the kernels.

use super::super::stepping::Control;
use super::plan::{LinePlan, PassKind, PassPlan, Plan};

/// Of one environment and substep without a press, refreshes of tangent planes shared out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traffic {
    /// Read from and written to buffers, as if nothing stayed in a cache [bytes].
    pub bytes: f64,
    /// Additions, multiplications, divisions and roots, each as one.
    pub operations: f64,
}

impl Traffic {
    pub(super) fn new(plan: &Plan, control: &Control) -> Self {
        // Words of 4 bytes and operations of a stage for each vertex, edge or constraint.
        let n = plan.vertices as f64;
        let mut sum = [0.0, 0.0];
        let mut add = |count: f64, words: f64, operations: f64| {
            sum[0] += count * words;
            sum[1] += count * operations;
        };
        let refreshed = n / control.contact_interval.min(control.substeps) as f64;
        add(refreshed, 23.0, 120.0);
        add(n, 17.0, 55.0);
        let edges = |line: &LinePlan| (line.lines * line.longest.saturating_sub(1)) as f64;
        match &plan.lines {
            Some([warps, wefts, diagonals]) => {
                add(n, 36.0, 75.0);
                for yarns in [warps, wefts] {
                    let bent = if yarns.is_bent { n } else { 0.0 };
                    add(bent, 23.0, 85.0);
                    add(control.sweeps as f64 * edges(yarns), 20.0, 55.0);
                }
                // Rows of diagonals are of all lengths up to the longest; half of the room is empty.
                add(0.5 * edges(diagonals), 17.0, 75.0);
            }
            None => {
                add(n, 8.0, 5.0);
                for PassPlan { kind, count, .. } in &plan.passes {
                    let (words, operations) = match kind {
                        PassKind::Edges => (19.0, 33.0),
                        PassKind::LimitedEdges => (22.0, 36.0),
                        PassKind::Diagonals | PassKind::LockingDiagonals => (20.0, 50.0),
                        PassKind::Triples => (25.0, 37.0),
                    };
                    add(*count as f64, words, operations);
                }
            }
        }
        Self {
            bytes: 4.0 * sum[0],
            operations: sum[1],
        }
    }
}
