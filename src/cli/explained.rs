//! The fabric that explains scans of cloth, as several commands find it and tell of it.

use std::fmt::Display;
use std::path::PathBuf;

use anyhow::anyhow;

use super::Failure;
use super::output::Progress;
use crate::run::Parameter;
use drape_calibrate::{Estimate, FACTORS, ObservedCloth, explain, prior};
use drape_task::env::{Quantity, Scatter};

/// Root mean square distance between scans and simulated cloth beyond which nothing can be believed [m]
/// (docs/CALIBRATE.md).
const MOST_LEFT: f64 = 1e-3;

/// Share of the points of a scan that have to be within a cell's diagonal of the simulated cloth: what lies elsewhere says
/// nothing, and without a word others would speak for it.
const LEAST_NEAR: f64 = 0.5;

/// Of two scans that are one: taken for several they would say too much.
pub(super) fn same_scan([one, other]: [impl Display; 2]) -> Failure {
    Failure::invalid(anyhow!(
        "{one} is the same as {other}, expected scans of several blanks"
    ))
}

/// What explains states best, with a progress bar. Refuses those that lie elsewhere, by the names of their scans.
pub(super) fn explained(
    states: &[ObservedCloth],
    scans: &[PathBuf],
    scatter: &Scatter,
) -> Result<Estimate, Failure> {
    let progress = Progress::new("calibrating");
    let told = |number: usize, share: f64| {
        let done = (number as f64 - 1.0 + share) / drape_calibrate::EVALUATIONS as f64;
        progress.tell(done, &format!("evaluation {number}"));
    };
    let (estimate, near) = explain(states, prior(scatter), told)?;
    match near.iter().zip(scans).find(|(near, _)| **near < LEAST_NEAR) {
        None => Ok(estimate),
        Some((near, scan)) => Err(Failure::invalid(anyhow!(
            "{}: {:.0} % of its points are within a cell of the simulated cloth, expected {:.0} % at least: check --scale, \
             and that it is in the scene's frame",
            scan.display(),
            1e2 * near,
            1e2 * LEAST_NEAR
        ))),
    }
}

/// The factors that were found.
pub(super) fn factors(estimate: &Estimate) -> Vec<Parameter> {
    let parameter = |(k, quantity): (usize, &Quantity)| {
        let [low, high] = estimate.interval(k).map(f64::exp);
        Parameter {
            name: quantity.name(),
            value: estimate.at[k].exp(),
            low: Some(low),
            high: Some(high),
            specimens: None,
            told: Some(estimate.is_told[k]),
        }
    };
    FACTORS.iter().enumerate().map(parameter).collect()
}

/// What scans do not tell, and what speaks against what they do, if there is anything.
pub(super) fn doubts(estimate: &Estimate) -> Vec<String> {
    let untold = FACTORS.iter().zip(&estimate.is_told);
    let untold: Vec<String> = untold
        .filter(|(_, told)| !**told)
        .map(|(quantity, _)| quantity.name())
        .collect();
    let mut notes = Vec::new();
    if !untold.is_empty() {
        notes.push(format!(
            "scans do not tell {}: intervals are nearly what was known before",
            untold.join(", ")
        ));
    }
    if estimate.rms > MOST_LEFT {
        notes.push(format!(
            "{:.1} mm are left between scans and simulated cloth, expected {} at most: the scene is another, or the \
             search has ended in a wrong place",
            1e3 * estimate.rms,
            1e3 * MOST_LEFT
        ));
    }
    notes
}

/// A line of a parameter.
pub(super) fn line(found: &Parameter) -> String {
    let interval = match (found.low, found.high) {
        (Some(low), Some(high)) => format!("{low:.4e} to {high:.4e}"),
        _ => "interval unknown".into(),
    };
    let by = match (found.specimens, found.told) {
        (Some(1), _) => "  1 specimen".into(),
        (Some(count), _) => format!("  {count} specimens"),
        (_, Some(false)) => "  not told".into(),
        _ => String::new(),
    };
    format!("{:32} {:.4e}  {interval}{by}", found.name, found.value)
}
