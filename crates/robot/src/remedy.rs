//! What would mend a point that the arm cannot press: another place for the base, more tilt, less deviation.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Translation3, Vector3};
use rayon::prelude::*;

use super::path::PathPoint;
use super::place::Pose;
use super::plan::{Plan, frames};
use super::strokes::{Turning, Way, turned};
use super::workcell::{Cell, Check};

/// A place for the arm's base.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct BaseProposal {
    /// In the scene [m].
    pub at: [f64; 3],
    /// Points that can be reached from there, each by itself, of so many.
    pub points: usize,
    pub of: usize,
}

/// Moves of the base that are tried [m]: along x and y, and z.
const ACROSS: [f64; 5] = [0.0, -0.1, 0.1, -0.2, 0.2];
const UP: [f64; 5] = [0.0, 0.1, -0.1, 0.2, -0.2];
/// Places that are tried side by side.
const CHUNK: usize = 16;
/// Tilts that are tried where the limit does not suffice [degrees].
const TILTS: [f64; 3] = [45.0, 60.0, 75.0];
/// Shares of the deviation.
const SHARES: [f64; 3] = [0.75, 0.5, 0.25];

impl Cell {
    /// This cell with its arm elsewhere.
    pub fn moved(&self, base: Pose) -> Self {
        let mut cell = self.clone();
        cell.base = base;
        cell
    }

    /// Where the base would reach most points of a path, with that many; among equals the nearest to where it stands.
    pub fn best_base(&self, path: &[PathPoint]) -> Option<(Pose, BaseProposal)> {
        let frames = frames(path);
        // Where the roller itself does not fit no arm helps.
        let fits = |(frame, turning): &&(Pose, Turning)| self.fits_somehow(frame, *turning);
        let of = frames.len();
        let frames: Vec<&(Pose, Turning)> = frames.iter().filter(fits).collect();
        let mut moves: Vec<Vector3<f64>> = Vec::new();
        for x in ACROSS {
            for y in ACROSS {
                moves.extend(UP.map(|z| Vector3::new(x, y, z)));
            }
        }
        moves.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        let count = |by: &Vector3<f64>| {
            let cell = self.moved(Translation3::from(*by) * self.base);
            let reaches = |(frame, turning): &&&(Pose, Turning)| cell.can_reach(frame, *turning);
            match cell.base_in() {
                Some(_) => None,
                None => Some(frames.iter().filter(reaches).count()),
            }
        };
        // From near to far; the first that reaches all ends the search.
        let mut best: Option<(usize, usize)> = None;
        for (chunk, some) in moves.chunks(CHUNK).enumerate() {
            let counts: Vec<Option<usize>> = some.par_iter().map(count).collect();
            for (k, count) in counts.into_iter().enumerate() {
                if let Some(count) = count
                    && best.is_none_or(|(_, most)| count > most)
                {
                    best = Some((CHUNK * chunk + k, count));
                }
            }
            if best.is_some_and(|(_, most)| most == frames.len()) {
                break;
            }
        }
        let (k, best) = best?;
        let base = Translation3::from(moves[k]) * self.base;
        let proposal = BaseProposal {
            at: base.translation.vector.into(),
            points: best,
            of,
        };
        Some((base, proposal))
    }

    /// Which points of a path the arm reaches, each by itself and without deviations.
    pub fn reachable(&self, path: &[PathPoint]) -> Vec<bool> {
        let reach = |(frame, turning): &(Pose, Turning)| self.can_reach(frame, *turning);
        frames(path).par_iter().map(reach).collect()
    }

    /// Whether the roller fits on a contact in any direction and at any tilt.
    fn fits_somehow(&self, frame: &Pose, turning: Turning) -> bool {
        let ways = self
            .ways(turning)
            .into_iter()
            .filter(|way| way.station == 0);
        ways.into_iter()
            .any(|way| self.fits(&turned(frame, way.yaw), way.tilt).is_ok())
    }

    fn can_reach(&self, frame: &Pose, turning: Turning) -> bool {
        // No deviations: they cost a dozen times as much, and this ranks places only.
        let tilts = |way: &&Way| {
            way.tilt == 0.0 || way.tilt.abs() > 0.9 * self.limits.tilt_deg.to_radians()
        };
        let ways = self.ways(turning);
        let turned = |way: &&Way| turning == Turning::Rolling || way.yaw % FRAC_PI_2 < 0.1;
        ways.iter()
            .filter(tilts)
            .filter(turned)
            .any(|way| self.reaches(frame, way, false).is_ok())
    }

    /// Says for each point that failed what would mend it, and gives this cell with the arm where it reaches most, if that is
    /// elsewhere.
    pub fn find_remedies(
        &self,
        path: &[PathPoint],
        plan: &mut Plan,
    ) -> Option<(Self, BaseProposal)> {
        if plan.failed.is_empty() {
            return None;
        }
        let frames = frames(path);
        let best = self.best_base(path).filter(|(base, _)| *base != self.base);
        let best = best.map(|(base, proposal)| (self.moved(base), proposal));
        plan.failed.par_iter_mut().for_each(|failed| {
            let (frame, turning) = &frames[failed.index];
            let holds = |cell: &Self| cell.effort(frame, *turning).is_ok();
            let with = |change: &dyn Fn(&mut Self)| {
                let mut cell = self.clone();
                change(&mut cell);
                holds(&cell)
            };
            failed.remedy = if failed.check == Check::Transfer {
                "name a home_deg from which the arm gets there, or move what stands between".into()
            } else if holds(self) {
                "it can be pressed by itself: end the stroke before it".into()
            } else if let Some((_, base)) = best.as_ref().filter(|(cell, _)| holds(cell)) {
                let [x, y, z] = base.at.map(|x| (1e3 * x).round() + 0.0);
                format!("move the base to {x}, {y}, {z} mm, which reaches {} of {} points", base.points, base.of)
            } else if let Some(most) = TILTS.iter().find(|&&most| {
                most > self.limits.tilt_deg && with(&|cell| cell.limits.tilt_deg = most)
            }) {
                format!("let the arm lean by {most} degrees (limits.tilt_deg)")
            } else if let Some(share) = SHARES.iter().find(|&&share| {
                with(&|cell| {
                    cell.limits.deviation_mm *= share;
                    cell.limits.deviation_deg *= share;
                })
            }) {
                let [way, angle] = [self.limits.deviation_mm, self.limits.deviation_deg].map(|most| share * most);
                format!("hold the roller to {way} mm and {angle} degrees (limits.deviation_mm, deviation_deg)")
            } else if !self.fits_somehow(frame, *turning) {
                "none but a smaller roller or holder: they do not fit there, whatever arm holds them".into()
            } else {
                "none found: another base, more tilt and less deviation do not reach it".into()
            };
        });
        best
    }
}
