use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::surplus::{foot, summed_surplus};
use crate::fabric::Lamina;
use crate::tool::Tool;

/// Sums and extremes of a sheet: what episodes are judged by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Summed distance to the tool of the vertices above it, of a region and of the sheet [m].
    pub distance: [f64; 2],
    /// Summed surplus of yarn edges, of the region and of the sheet [m]: see
    /// [`summed_surplus`].
    pub surplus: [f64; 2],
    /// Greatest strain of a yarn edge or a membrane [-]; no number where one is none.
    pub strain: f64,
    /// How deep the deepest vertex is in the tool [m], negative above it; no number where one is none.
    pub depth: f64,
}

impl Measures {
    /// Of a sheet whose vertices are `at` these places [m].
    pub fn new(lamina: &Lamina, tool: &Tool, region: &FixedBitSet, at: &[[f64; 3]]) -> Self {
        let nearest: Vec<_> = at.iter().map(|&x| tool.distance(x)).collect();
        let feet = at.iter().zip(&nearest);
        let feet = feet.map(|(&x, &(phi, normal))| foot(x, phi, normal));
        let feet: Vec<_> = feet.collect();
        let mut sheet = region.clone();
        sheet.insert_range(..);
        let of = [region, &sheet];
        Self {
            distance: of.map(|of| of.ones().map(|v| nearest[v].0.max(0.0)).sum()),
            surplus: of.map(|of| summed_surplus(lamina, &feet, of).0),
            strain: greatest(lamina.yarn_strain(at)),
            depth: greatest(nearest.iter().map(|(phi, _)| -phi)),
        }
    }
}

/// The greatest of some numbers, unless one is none.
fn greatest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let numbers = numbers.into_iter();
    // Not `max`, which would pass over what is no number.
    numbers.fold(
        f64::NEG_INFINITY,
        |a, b| if b > a || b.is_nan() { b } else { a },
    )
}
