//! How an arm gets along a stroke: every angle of the table, direction of the roller and tilt, from every pose in which
//! it can begin. Six joints leave nothing to choose on the way: a pose at the first point is followed to the last.

use std::f64::consts::{FRAC_PI_8, PI};

use nalgebra::{Rotation3, Translation3, Vector3};

use super::arm::Joints;
use super::obstacles::Touch;
use super::path::PathPoint;
use super::place::Pose;
use super::program::Contact;
use super::workcell::{Cell, Check, FAR, Fault, STEP};

/// How a stroke is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Way {
    pub station: usize,
    /// By which the roller is turned about the normal [rad].
    pub yaw: f64,
    /// By which the arm leans about the roller's axis [rad].
    pub tilt: f64,
    pub effort: Effort,
}

/// What a way takes beyond going at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Effort {
    AtOnce,
    Flip,
    Tilt,
    Turn,
}

/// Contacts one behind the other and how the arm goes along them.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub way: Way,
    pub contacts: Vec<Contact>,
    pub approach: Joints,
    pub retreat: Joints,
    /// In seconds, more or less: what it is worth to be spared of it.
    pub cost: f64,
}

/// What was found for points one behind the other.
pub(crate) struct Found {
    /// Ways along the first `reached` of them, cheapest first.
    pub candidates: Vec<Candidate>,
    pub reached: usize,
    /// Why the point behind them cannot be reached, and what was tried.
    pub fault: Option<(Fault, String)>,
}

/// How a roller may be turned about the normal of what it presses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turning {
    /// At will: it presses without rolling.
    Free,
    /// Along its way, or back to front.
    Rolling,
}

impl Turning {
    /// Of the points of a stroke.
    pub fn of(stroke: &[PathPoint]) -> Self {
        match stroke.iter().all(|point| point.travel.is_none()) {
            true => Self::Free,
            false => Self::Rolling,
        }
    }
}

/// Candidates of a station that are enough, and of all stations.
const ENOUGH: [usize; 2] = [3, 12];
/// What a tilt of 10 degrees is worth [s], a manipulability of a tenth, and a clearance of nothing.
const TILT_S: f64 = 0.5;
const SINGULAR_S: f64 = 1.0;
const NEAR_S: f64 = 2.0;
/// Tilts to each side.
const TILTS: usize = 3;

impl Cell {
    /// All ways to hold points, those that take least first.
    pub(crate) fn ways(&self, turning: Turning) -> Vec<Way> {
        let most = self.limits.tilt_deg.to_radians();
        let tilts = match most > 0.0 {
            true => TILTS as i32,
            false => 0,
        };
        let yaws: Vec<f64> = match turning {
            Turning::Free => (0..16).map(|k| f64::from(k) * FRAC_PI_8).collect(),
            Turning::Rolling => vec![0.0, PI],
        };
        let mut ways = Vec::new();
        for station in 0..self.angles.len() {
            for tilt in -tilts..=tilts {
                for &yaw in &yaws {
                    ways.push(Way {
                        station,
                        yaw,
                        tilt: most * f64::from(tilt) / TILTS as f64,
                        effort: match (station, tilt, yaw) {
                            (0, 0, 0.0) => Effort::AtOnce,
                            (0, 0, _) => Effort::Flip,
                            (0, _, _) => Effort::Tilt,
                            _ => Effort::Turn,
                        },
                    });
                }
            }
        }
        let effort = |way: &Way| (way.effort, way.station, (way.tilt.abs() * 1e6) as u64);
        ways.sort_by_key(effort);
        ways
    }

    /// Ways along the contacts `frames`, or as many of them as some way has.
    pub(crate) fn along(&self, frames: &[Pose], points: &[usize], turning: Turning) -> Found {
        let ways = self.ways(turning);
        let mut open: Vec<(f64, Way, Joints)> = Vec::new();
        let (mut faults, mut poses) = (Vec::new(), 0);
        let mut fitting = Vec::new();
        for way in &ways {
            let first = turned(&frames[0], way.yaw);
            if let Err(fault) = self.fits_in(&first, way, &mut fitting) {
                faults.push((0, fault));
                continue;
            }
            let starts = self.poses(&self.flange(way.station, &first, way.tilt));
            poses += starts.len();
            for start in starts {
                match self.kinematic(&start, 1.0) {
                    Ok(sigma) => open.push((self.wish(way, sigma), *way, start)),
                    Err(fault) => faults.push((0, fault)),
                }
            }
        }
        if faults.is_empty() && poses == 0 {
            let detail = "no pose of the arm puts the roller there".into();
            let check = Check::Reach;
            faults.push((0, Fault { check, detail }));
        }
        open.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut candidates: Vec<Candidate> = Vec::new();
        let mut reached = 0;
        let mut of_station = vec![0; self.angles.len()];
        for (_, way, start) in open {
            let is_whole = reached == frames.len();
            if is_whole && (of_station[way.station] >= ENOUGH[0] || candidates.len() >= ENOUGH[1]) {
                continue;
            }
            let (mut contacts, fault) = self.roll(frames, points, way, start);
            faults.extend(fault.map(|fault| (contacts.len(), fault)));
            let Some(first) = contacts.first() else {
                continue;
            };
            let approach = match self.above(first, way) {
                Ok(joints) => joints,
                Err(fault) => {
                    faults.push((0, fault));
                    continue;
                }
            };
            // Back to where the roller can lift off.
            while contacts.len() >= reached.max(1) {
                match self.above(&contacts[contacts.len() - 1], way) {
                    Ok(retreat) => {
                        if contacts.len() > reached {
                            reached = contacts.len();
                            candidates.clear();
                            of_station.fill(0);
                        }
                        for contact in &mut contacts {
                            contact.clearance = self.clearance(&contact.joints, way.station);
                        }
                        of_station[way.station] += 1;
                        candidates.push(Candidate {
                            cost: self.cost(&way, &contacts),
                            way,
                            contacts,
                            approach,
                            retreat,
                        });
                        break;
                    }
                    Err(fault) => {
                        contacts.pop();
                        faults.push((contacts.len(), fault));
                    }
                }
            }
        }
        candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        // The check that most nearly passed at the point that was not reached.
        let there = faults.into_iter().filter(|(at, _)| *at == reached);
        let fault = there
            .map(|(_, fault)| fault)
            .max_by_key(|fault| fault.check);
        let tried = self.tried(&ways, poses);
        Found {
            fault: fault
                .filter(|_| reached < frames.len())
                .map(|fault| (fault, tried)),
            candidates,
            reached,
        }
    }

    /// Whether the roller fits on a contact in a way; asked once for all angles of the table.
    fn fits_in(
        &self,
        contact: &Pose,
        way: &Way,
        known: &mut Vec<(f64, f64, Result<(), Fault>)>,
    ) -> Result<(), Fault> {
        if let Some((.., fits)) = known
            .iter()
            .find(|(yaw, tilt, _)| (*yaw, *tilt) == (way.yaw, way.tilt))
        {
            return fits.clone();
        }
        let fits = self.fits(contact, way.tilt);
        known.push((way.yaw, way.tilt, fits.clone()));
        fits
    }

    fn tried(&self, ways: &[Way], poses: usize) -> String {
        let count = |key: &dyn Fn(&Way) -> u64| {
            let mut all: Vec<u64> = ways.iter().map(key).collect();
            all.sort_unstable();
            all.dedup();
            all.len()
        };
        let (yaws, tilts) = (
            count(&|way| way.yaw.to_bits()),
            count(&|way| way.tilt.to_bits()),
        );
        let angles = match self.angles.len() {
            1 => "one angle of the tool".into(),
            many => format!("{many} angles of the turntable"),
        };
        format!(
            "{angles}, {yaws} directions of the roller, {tilts} tilts: {poses} poses of the arm"
        )
    }

    /// Rolls from contact to contact as far as it goes, and why no farther.
    fn roll(
        &self,
        frames: &[Pose],
        points: &[usize],
        way: Way,
        start: Joints,
    ) -> (Vec<Contact>, Option<Fault>) {
        let mut contacts: Vec<Contact> = Vec::with_capacity(frames.len());
        let press = |joints: &Joints| self.judge(joints, way.station, Touch::Pressing, 1.0);
        for (frame, &point) in frames.iter().zip(points) {
            let frame = turned(frame, way.yaw);
            let joints = match contacts.last() {
                None => Ok(start),
                Some(last) => {
                    let ends = [&last.frame, &frame];
                    let between = |joints: &Joints| {
                        press(joints).map(drop).map_err(|fault| Fault {
                            check: Check::Between,
                            detail: format!("on the way from the last point: {}", fault.detail),
                        })
                    };
                    self.follow(&last.joints, ends, way.station, way.tilt, STEP, between)
                }
            };
            let passed = joints.and_then(|joints| {
                let sigma_min = press(&joints)?;
                self.deviates(&joints, &frame, way.station, way.tilt)?;
                Ok((joints, sigma_min))
            });
            match passed {
                Ok((joints, sigma_min)) => contacts.push(Contact {
                    point,
                    frame,
                    joints,
                    sigma_min,
                    clearance: f64::NAN,
                }),
                Err(fault) => return (contacts, Some(fault)),
            }
        }
        (contacts, None)
    }

    /// The pose straight above a contact.
    fn above(&self, contact: &Contact, way: Way) -> Result<Joints, Fault> {
        let ends = [&contact.frame, &self.lifted(&contact.frame)];
        let clear = |joints: &Joints| {
            let judged = self.judge(joints, way.station, Touch::Pressing, 0.0);
            judged.map(drop)
        };
        let joints = self.follow(&contact.joints, ends, way.station, way.tilt, STEP, clear);
        let judged = joints.and_then(|joints| {
            self.judge(&joints, way.station, Touch::Free, 1.0)?;
            Ok(joints)
        });
        judged.map_err(|fault| Fault {
            check: Check::Collision,
            detail: format!("coming down or lifting: {}", fault.detail),
        })
    }

    /// What is known of a candidate's cost before it is followed.
    fn wish(&self, way: &Way, sigma: f64) -> f64 {
        let tilt = way.tilt.abs().to_degrees() / 10.0 * TILT_S;
        let turn = match way.station {
            0 => 0.0,
            _ => self.motion.turn_s,
        };
        tilt + turn + SINGULAR_S * (0.1 / sigma.max(1e-3)).min(10.0)
    }

    fn cost(&self, way: &Way, contacts: &[Contact]) -> f64 {
        let least = |of: fn(&Contact) -> f64| contacts.iter().map(of).fold(f64::INFINITY, f64::min);
        let near = 1.0 - (least(|contact| contact.clearance) / FAR).min(1.0);
        let turn = match way.station {
            0 => 0.0,
            _ => self.motion.turn_s,
        };
        self.wish(way, least(|contact| contact.sigma_min)) - turn + NEAR_S * near
    }

    /// Angles of the table and tilts at which the roller can be put on a contact, one bit each for the first 64 that take least;
    /// stricter than a plan by the deviation that is allowed, which is not tried here.
    pub fn reach(&self, contact: &Pose) -> u64 {
        let margin = 1e3 * FAR.min(1e-3 * (self.limits.clearance_mm + self.limits.deviation_mm));
        let share = margin / self.limits.clearance_mm.max(0.1);
        let mut bits = 0;
        let ways = self
            .ways(Turning::Rolling)
            .into_iter()
            .filter(|way| way.yaw == 0.0);
        let mut fitting = Vec::new();
        for (k, way) in ways.enumerate().take(64) {
            if self.fits_in(contact, &way, &mut fitting).is_err() {
                continue;
            }
            let poses = self.poses(&self.flange(way.station, contact, way.tilt));
            let holds = |joints: &Joints| {
                self.kinematic(joints, 1.0).is_ok()
                    && self
                        .judge(joints, way.station, Touch::Pressing, share)
                        .is_ok()
            };
            bits |= u64::from(poses.iter().any(holds)) << k;
        }
        bits
    }

    /// The least that a point takes by itself, if it can be reached at all.
    pub(crate) fn effort(&self, frame: &Pose, turning: Turning) -> Result<Effort, Fault> {
        let (mut worst, mut fitting) = (None::<Fault>, Vec::new());
        for way in self.ways(turning) {
            let fits = self.fits_in(&turned(frame, way.yaw), &way, &mut fitting);
            match fits.and_then(|()| self.reaches(frame, &way, true)) {
                Ok(_) => return Ok(way.effort),
                Err(fault) if worst.as_ref().is_none_or(|worst| worst.check < fault.check) => {
                    worst = Some(fault)
                }
                Err(_) => {}
            }
        }
        Err(worst.expect("there is a way"))
    }

    /// Whether some pose holds a contact in a way, deviations included if they are `strict`.
    pub(crate) fn reaches(&self, frame: &Pose, way: &Way, strict: bool) -> Result<(), Fault> {
        let frame = turned(frame, way.yaw);
        let mut worst = Fault {
            check: Check::Reach,
            detail: "no pose of the arm puts the roller there".into(),
        };
        for joints in self.poses(&self.flange(way.station, &frame, way.tilt)) {
            let passed = self
                .judge(&joints, way.station, Touch::Pressing, 1.0)
                .and_then(|_| match strict {
                    true => self.deviates(&joints, &frame, way.station, way.tilt),
                    false => Ok(()),
                });
            match passed {
                Ok(()) => return Ok(()),
                Err(fault) if fault.check > worst.check => worst = fault,
                Err(_) => {}
            }
        }
        Err(worst)
    }
}

/// A contact with its roller turned about the normal.
pub(crate) fn turned(frame: &Pose, yaw: f64) -> Pose {
    match yaw {
        0.0 => *frame,
        _ => {
            frame
                * Pose::from_parts(
                    Translation3::identity(),
                    Rotation3::from_axis_angle(&Vector3::z_axis(), yaw),
                )
        }
    }
}
