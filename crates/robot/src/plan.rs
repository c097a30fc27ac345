//! From points to motions: every stroke in the way that costs least together with those before and behind it.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::arm::Joints;
use super::obstacles::Touch;
use super::path::{PathPoint, contacts};
use super::place::Pose;
use super::program::{Contact, Program, ProgramStroke, Station};
use super::strokes::{Candidate, Effort, Found, Turning};
use super::workcell::{Cell, Check};

/// What an arm makes of a path.
#[derive(Clone, Debug)]
pub struct Plan {
    pub home: Joints,
    pub stations: Vec<Station>,
    pub strokes: Vec<ProgramStroke>,
    /// Corners of the free way home from the last stroke, both ends left out.
    pub way_home: Vec<Joints>,
    /// Points that are in no stroke, and why.
    pub failed: Vec<FailedPoint>,
    /// Strokes of the path that had to be lifted within.
    pub lifted: usize,
}

/// A point that the arm cannot press.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FailedPoint {
    /// Of the path.
    pub index: usize,
    /// The check that failed: of all that was tried, the last one that was come to.
    pub check: Check,
    pub detail: String,
    pub tried: String,
    /// What would mend it, as far as that was found.
    pub remedy: String,
}

/// How many points can be reached, each by itself and with deviations, by what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Reached {
    pub at_once: usize,
    /// With the roller turned half around, or about the normal where it does not travel.
    pub by_flipping: usize,
    pub by_tilting: usize,
    pub by_turning_the_table: usize,
    pub by_moving_the_base: usize,
    pub not_at_all: usize,
}

/// No pose in which the arm could wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoHome {
    #[error(
        "the arm has no pose above the tool in which it hits nothing: name one by `home_deg`, or move the base"
    )]
    Found,
    #[error(
        "`home_deg` hits something or is beyond a joint's limits, expected a pose free at every angle of the table"
    )]
    Named,
}

/// Steps at which a plan is played: of joints [rad], of a contact [m] and of its turn [rad].
const FINE: [f64; 3] = [0.01, 1e-3, 0.02];

/// Contacts of a stroke, by any of its candidates.
struct Piece {
    candidates: Vec<Candidate>,
}

impl Cell {
    /// Plans a path. `watch` hears how many more of its points are done.
    ///
    /// # Errors
    /// If the arm has no pose to wait in.
    pub fn plan(&self, path: &[PathPoint], watch: impl Fn(usize) + Sync) -> Result<Plan, NoHome> {
        let home = self.find_home()?;
        let strokes: Vec<(usize, &[PathPoint])> = strokes(path);
        let tried: Vec<(Vec<Piece>, Vec<FailedPoint>)> = strokes
            .par_iter()
            .map(|(first, points)| {
                let found = self.pieces(*first, points);
                watch(points.len());
                found
            })
            .collect();
        let (mut pieces, mut failed, mut lifted) = (Vec::new(), Vec::new(), 0);
        for (own, without) in tried {
            lifted += usize::from(own.len() > 1);
            pieces.extend(own);
            failed.extend(without);
        }
        let (strokes, stations, way_home) = self.join(pieces, &home, &mut failed);
        failed.sort_by_key(|point| point.index);
        Ok(Plan {
            home,
            stations,
            strokes,
            way_home,
            failed,
            lifted,
        })
    }

    /// Where the arm waits: as named, or above the tool.
    ///
    /// # Errors
    /// If there is no such pose, or something is hit in the one that was named.
    pub fn find_home(&self) -> Result<Joints, NoHome> {
        let stations = 0..self.angles.len();
        let clear = |q: &Joints| stations.clone().all(|station| self.is_clear(q, station));
        if let Some(home) = self.home {
            let is_free = self.arm.is_within_limits(&home) && clear(&home);
            return is_free.then_some(home).ok_or(NoHome::Named);
        }
        let found = self.waiting_places().find_map(|flange| {
            let mut poses = self.poses(&flange);
            let far = |q: &Joints| q.iter().map(|q| q.abs()).fold(0.0, f64::max);
            poses.retain(|q| self.kinematic(q, 1.0).is_ok());
            poses.sort_by(|a, b| far(a).total_cmp(&far(b)));
            poses.into_iter().find(clear)
        });
        found.ok_or(NoHome::Found)
    }

    /// The fewest pieces of a stroke that the arm can roll over.
    fn pieces(&self, first: usize, points: &[PathPoint]) -> (Vec<Piece>, Vec<FailedPoint>) {
        let frames = contacts(points);
        let turning = Turning::of(points);
        let indices: Vec<usize> = (first..first + points.len()).collect();
        let (mut pieces, mut failed, mut at) = (Vec::new(), Vec::new(), 0);
        while at < frames.len() {
            let Found {
                candidates,
                reached,
                fault,
            } = self.along(&frames[at..], &indices[at..], turning);
            if reached > 0 {
                pieces.push(Piece { candidates });
                at += reached;
                continue;
            }
            let (fault, tried) = fault.expect("what was not reached has a fault");
            failed.push(FailedPoint {
                index: first + at,
                check: fault.check,
                detail: fault.detail,
                tried,
                remedy: String::new(),
            });
            at += 1;
        }
        (pieces, failed)
    }

    /// Chooses the candidate of each piece so that all together cost least (Viterbi), and the free ways between them.
    fn join(
        &self,
        mut pieces: Vec<Piece>,
        home: &Joints,
        failed: &mut Vec<FailedPoint>,
    ) -> (Vec<ProgramStroke>, Vec<Station>, Vec<Joints>) {
        let mut used: Vec<usize> = Vec::new();
        let mut strokes: Vec<ProgramStroke> = Vec::new();
        let mut way_home = Vec::new();
        while !pieces.is_empty() {
            let chosen = self.choose(&pieces, home);
            let k = match self.connect(&pieces, &chosen, home, &mut strokes) {
                Ok(way) => {
                    way_home = way;
                    break;
                }
                Err(k) => k,
            };
            // That one is not to be had; perhaps another.
            let out = pieces[k].candidates.remove(chosen[k]);
            if pieces[k].candidates.is_empty() {
                for contact in &out.contacts {
                    failed.push(FailedPoint {
                        index: contact.point,
                        check: Check::Transfer,
                        detail: "no free way to it, or from it home, was found".into(),
                        tried: format!(
                            "straight, and by trees of {} samples near both and anywhere",
                            super::transfer::SAMPLES
                        ),
                        remedy: String::new(),
                    });
                }
                pieces.remove(k);
            }
        }
        for stroke in &strokes {
            if !used.contains(&stroke.station) {
                used.push(stroke.station);
            }
        }
        used.sort_unstable();
        let stations = used.iter().map(|&station| Station {
            angle: self.angles[station],
            tool: self.work_object(station),
        });
        let stations = stations.collect();
        for stroke in &mut strokes {
            stroke.station = used
                .iter()
                .position(|&station| station == stroke.station)
                .expect("it is used");
        }
        (strokes, stations, way_home)
    }

    /// How long the arm takes from one pose to another, joints at their share of speed [s].
    fn seconds(&self, from: &Joints, to: &Joints) -> f64 {
        let joints = self.arm.joints.iter().enumerate();
        let each =
            joints.map(|(j, joint)| (to[j] - from[j]).abs() / (joint.speed * self.motion.free));
        each.fold(0.0, f64::max)
    }

    /// One candidate for each piece.
    fn choose(&self, pieces: &[Piece], home: &Joints) -> Vec<usize> {
        // The cheapest way to the end of each candidate, and from which it comes.
        let mut table: Vec<Vec<(f64, usize)>> = Vec::new();
        for (k, piece) in pieces.iter().enumerate() {
            let costs = piece.candidates.iter().map(|to| {
                let (before, from) = match k {
                    0 => (
                        self.turn_s(0, to.way.station) + self.seconds(home, &to.approach),
                        0,
                    ),
                    _ => {
                        let last = pieces[k - 1]
                            .candidates
                            .iter()
                            .zip(&table[k - 1])
                            .enumerate();
                        let each = last
                            .map(|(c, (from, (cost, _)))| (cost + self.between(from, to, home), c));
                        each.min_by(|a, b| a.0.total_cmp(&b.0))
                            .expect("no piece is empty")
                    }
                };
                (before + to.cost, from)
            });
            table.push(costs.collect());
        }
        let last = table.last().expect("there are pieces").iter().enumerate();
        let mut at = last
            .min_by(|a, b| a.1.0.total_cmp(&b.1.0))
            .expect("no piece is empty")
            .0;
        let mut chosen = vec![0; pieces.len()];
        for k in (0..pieces.len()).rev() {
            chosen[k] = at;
            at = table[k][at].1;
        }
        chosen
    }

    /// From the end of one candidate to the beginning of another [s]; the table turns while the arm is at home.
    fn between(&self, from: &Candidate, to: &Candidate, home: &Joints) -> f64 {
        match from.way.station == to.way.station {
            true => self.seconds(&from.retreat, &to.approach),
            false => {
                let turn = self.turn_s(from.way.station, to.way.station);
                self.seconds(&from.retreat, home) + turn + self.seconds(home, &to.approach)
            }
        }
    }

    fn turn_s(&self, from: usize, to: usize) -> f64 {
        match from == to {
            true => 0.0,
            false => self.motion.turn_s,
        }
    }

    /// Joins the chosen candidates by free ways. Gives the corners of that home, or else the first piece that the arm cannot
    /// come to, or home from.
    fn connect(
        &self,
        pieces: &[Piece],
        chosen: &[usize],
        home: &Joints,
        strokes: &mut Vec<ProgramStroke>,
    ) -> Result<Vec<Joints>, usize> {
        let mut last: Option<(Joints, usize)> = None;
        // What is joined already stays if its candidate does.
        for (k, (piece, &c)) in pieces.iter().zip(chosen).enumerate() {
            let from = last.map_or(*home, |(from, _)| from);
            let to = &self.wound(&piece.candidates[c], &from);
            let is_same = strokes.get(k).is_some_and(|stroke| {
                stroke.approach == to.approach && stroke.contacts[0].point == to.contacts[0].point
            });
            if !is_same {
                strokes.truncate(k);
                let station = to.way.station;
                let from_home = || self.transfer(home, &to.approach, station);
                let transfer = match last {
                    None => from_home(),
                    Some((from, before)) if before == station => self
                        .transfer(&from, &to.approach, station)
                        .or_else(|| self.by_home(&from, home, to)),
                    Some((from, before)) => {
                        self.transfer(&from, home, before).and_then(|mut way| {
                            way.push(*home);
                            way.extend(from_home()?);
                            Some(way)
                        })
                    }
                };
                let Some(transfer) = transfer else {
                    return Err(k);
                };
                strokes.push(ProgramStroke {
                    station,
                    tilt: to.way.tilt,
                    transfer,
                    approach: to.approach,
                    contacts: to.contacts.clone(),
                    retreat: to.retreat,
                });
            }
            last = Some((to.retreat, to.way.station));
        }
        strokes.truncate(pieces.len());
        match last {
            None => Ok(Vec::new()),
            Some((from, station)) => {
                let way = self.transfer(&from, home, station);
                way.ok_or(pieces.len() - 1)
            }
        }
    }

    /// A candidate whose joints are wound by whole turns, as far as limits allow for all of it, so that it begins nearest to
    /// a pose.
    fn wound(&self, candidate: &Candidate, from: &Joints) -> Candidate {
        let mut wound = candidate.clone();
        for (j, joint) in self.arm.joints.iter().enumerate() {
            let margin = self.limits.joint_deg.to_radians();
            let all = wound.contacts.iter().map(|contact| contact.joints[j]);
            let all = all.chain([wound.approach[j], wound.retreat[j]]);
            let [min, max] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], q| {
                [q.min(min), q.max(max)]
            });
            let fits = |turn: &f64| {
                min + turn >= joint.limits[0] + margin && max + turn <= joint.limits[1] - margin
            };
            let far = |turn: &f64| (wound.approach[j] + turn - from[j]).abs();
            let turns = [0.0, TAU, -TAU]
                .into_iter()
                .filter(|turn| *turn == 0.0 || fits(turn));
            let turn = turns
                .min_by(|a, b| far(a).total_cmp(&far(b)))
                .unwrap_or(0.0);
            wound
                .contacts
                .iter_mut()
                .for_each(|contact| contact.joints[j] += turn);
            wound.approach[j] += turn;
            wound.retreat[j] += turn;
        }
        wound
    }

    fn by_home(&self, from: &Joints, home: &Joints, to: &Candidate) -> Option<Vec<Joints>> {
        let mut way = self.transfer(from, home, to.way.station)?;
        way.push(*home);
        way.extend(self.transfer(home, &to.approach, to.way.station)?);
        Some(way)
    }

    /// What each point takes by itself; `moved` is the same arm on another base.
    pub fn reached(&self, path: &[PathPoint], moved: Option<&Self>) -> Reached {
        let frames = frames(path);
        let effort = |(frame, turning): &(Pose, Turning)| {
            let own = self.effort(frame, *turning);
            let elsewhere = || moved.is_some_and(|cell| cell.effort(frame, *turning).is_ok());
            own.map_err(|_| elsewhere())
        };
        let efforts: Vec<Result<Effort, bool>> = frames.par_iter().map(effort).collect();
        let count = |effort| efforts.iter().filter(|one| **one == effort).count();
        Reached {
            at_once: count(Ok(Effort::AtOnce)),
            by_flipping: count(Ok(Effort::Flip)),
            by_tilting: count(Ok(Effort::Tilt)),
            by_turning_the_table: count(Ok(Effort::Turn)),
            by_moving_the_base: count(Err(true)),
            not_at_all: count(Err(false)),
        }
    }

    /// Plays a plan at steps finer than it was planned with: places where anything is hit.
    pub fn collisions(&self, plan: &Plan) -> Vec<String> {
        let mut hits = Vec::new();
        let mut at = plan.home;
        // Before the first stroke the table turns first.
        let mut was = plan
            .strokes
            .first()
            .map_or(0, |first| self.station(&plan.stations[first.station]));
        for (k, stroke) in plan.strokes.iter().enumerate() {
            let station = self.station(&plan.stations[stroke.station]);
            let mut free = |from: &Joints, to: &Joints, station: usize| {
                if !self.is_free(from, to, station, FINE[0]) {
                    hits.push(format!("on the way to stroke {}", k + 1));
                }
            };
            // On the way home the tool still stands as it did, behind it as it will.
            let mut turned = was == station;
            for corner in stroke.transfer.iter().chain([&stroke.approach]) {
                free(&at, corner, if turned { station } else { was });
                turned |= *corner == plan.home;
                at = *corner;
            }
            was = station;
            // Whether the contact goes straight from one frame to another, and the arm ends in a pose.
            let rolls = |from: &Contact, to: &Pose, end: &Joints| {
                let step = [FINE[1], FINE[2]];
                let hit = |q: &Joints| self.judge(q, station, Touch::Pressing, 0.0).map(drop);
                let ends = [&from.frame, to];
                let found = self.follow(&from.joints, ends, station, stroke.tilt, step, hit);
                found.is_ok_and(|q| (0..6).all(|j| (q[j] - end[j]).abs() < 1e-6))
            };
            for pair in stroke.contacts.windows(2) {
                let [from, to] = [&pair[0], &pair[1]];
                if !rolls(from, &to.frame, &to.joints) {
                    hits.push(format!("between points {} and {}", from.point, to.point));
                }
            }
            let last = stroke.contacts.len() - 1;
            for (k, end) in [(0, stroke.approach), (last, stroke.retreat)] {
                let contact = &stroke.contacts[k];
                if !rolls(contact, &self.lifted(&contact.frame), &end) {
                    hits.push(format!("above point {}", contact.point));
                }
            }
            for contact in &stroke.contacts {
                if let Err(fault) = self.judge(&contact.joints, station, Touch::Pressing, 0.0) {
                    hits.push(format!("at point {}: {}", contact.point, fault.detail));
                }
            }
            at = stroke.retreat;
        }
        for corner in plan.way_home.iter().chain([&plan.home]) {
            if !self.is_free(&at, corner, was, FINE[0]) {
                hits.push("on the way home".into());
            }
            at = *corner;
        }
        hits
    }

    /// How many points would see a collision if each were gone to at once, in the first pose that the arm has for it.
    pub fn collisions_at_once(&self, path: &[PathPoint]) -> usize {
        let hits = frames(path).into_iter().filter(|(frame, _)| {
            let poses = self.poses(&self.flange(0, frame, 0.0));
            let first = poses
                .first()
                .map(|joints| self.judge(joints, 0, Touch::Pressing, 0.0));
            matches!(first, Some(Err(fault)) if fault.check == Check::Collision)
        });
        hits.count()
    }

    /// The number in this cell of a station of one of its plans.
    pub fn station(&self, station: &Station) -> usize {
        let same = |angle: &f64| *angle == station.angle;
        self.angles
            .iter()
            .position(same)
            .expect("plans are of their cell")
    }

    /// The program of a plan.
    pub fn program<'a>(&'a self, plan: &Plan, name: &str) -> Program<'a> {
        Program {
            name: name.into(),
            arm: &self.arm,
            roller: self.roller,
            speeds: self.motion.speeds(),
            home: plan.home,
            stations: plan.stations.clone(),
            strokes: plan.strokes.clone(),
            way_home: plan.way_home.clone(),
        }
    }
}

impl Plan {
    /// All contacts, in the order of the program.
    pub fn contacts(&self) -> impl Iterator<Item = (&ProgramStroke, &Contact)> {
        let each = self.strokes.iter();
        each.flat_map(|stroke| stroke.contacts.iter().map(move |contact| (stroke, contact)))
    }
}

/// Points that are rolled over without lifting, and where each begins.
fn strokes(path: &[PathPoint]) -> Vec<(usize, &[PathPoint])> {
    let mut first = 0;
    let chunks = path.chunk_by(|a, b| a.stroke == b.stroke);
    let each = chunks.map(|chunk| {
        let begin = first;
        first += chunk.len();
        (begin, chunk)
    });
    each.collect()
}

/// The contact frame of each point, and how the roller may be turned there.
pub(crate) fn frames(path: &[PathPoint]) -> Vec<(Pose, Turning)> {
    let each = strokes(path).into_iter().flat_map(|(_, points)| {
        let turning = Turning::of(points);
        contacts(points)
            .into_iter()
            .map(move |frame| (frame, turning))
    });
    each.collect()
}
