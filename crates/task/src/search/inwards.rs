//! Orders from the border inwards.

use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use super::judge::{DIVERGED, Judge};
use crate::env::Task;

/// An order that presses first about a place, which then holds the cloth, and then sectors about it: those on the
/// bias first, where cloth has to shear, those along the yarns last.
///
/// Held on top of a dome, cloth that is too long is so brought in from the border while the bias is still free to shear,
/// and not pushed in front of the roller (docs/SCATTER.md).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inwards {
    /// On the flat blank [m].
    pub place: [f64; 2],
    /// How far from it is pressed first [stencil sides].
    pub hold: f64,
    /// How wide a sector is where it is farthest from the place [stencil sides].
    pub width: f64,
    pub way: Way,
    /// Presses are no nearer to each other along either yarn [stencil sides].
    pub spacing: f64,
}

/// How sectors are pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Those that are equally far from a yarn at once, from the border inwards,
    Together,
    /// one after the other,
    Apart,
    /// and every second outwards, so that the roller goes on where it has come to.
    Snaking,
}

/// Places along either side of a region that a search looks at, the finer with the coarser among them; and how many of
/// all have more tried about them.
const GRIDS: [usize; 2] = [3, 5];
const BETTER: usize = 4;
/// What is tried there, and nearer presses with the best of all.
const HOLDS: [f64; 2] = [0.8, 1.5];
const WIDTHS: [f64; 4] = [0.7, 1.0, 1.4, 2.0];
const WAYS: [Way; 3] = [Way::Together, Way::Apart, Way::Snaking];
const DENSE: f64 = 0.5;
const BEST: usize = 8;

impl Inwards {
    /// One about each place of a grid over the region, that many along either side.
    pub fn over(task: &Task, places: usize) -> Vec<Self> {
        let rest = &task.scene.lamina.rest;
        let ends = [0, 1].map(|k| {
            let all = || task.region_vertices().map(|v| rest[v as usize][k]);
            [
                all().fold(f64::INFINITY, f64::min),
                all().fold(f64::NEG_INFINITY, f64::max),
            ]
        });
        // Regions often end where a tool is highest, so the border has places, too.
        let along = |[low, high]: [f64; 2], k: usize| {
            low + (high - low) * k as f64 / (places.max(2) - 1) as f64
        };
        let at = |k: usize| Self {
            place: [along(ends[0], k % places), along(ends[1], k / places)],
            hold: 1.5,
            width: 1.0,
            way: Way::Snaking,
            spacing: 0.75,
        };
        (0..places * places).map(at).collect()
    }

    /// All that are tried about its place.
    fn kinds(self) -> Vec<Self> {
        let ways = WAYS.map(|way| Self { way, ..self });
        let held = |one: Self| HOLDS.map(|hold| Self { hold, ..one });
        let wide = |one: Self| WIDTHS.map(|width| Self { width, ..one });
        ways.into_iter().flat_map(held).flat_map(wide).collect()
    }

    /// The vertices that it presses: every other one that can be pressed is nearer to one of them than the spacing, along both
    /// yarns, so that in between some may stay untouched.
    pub fn list(&self, task: &Task) -> Vec<u32> {
        let lamina = &task.scene.lamina;
        let side = 1e-3 * task.config.stencil_mm;
        let [x, y] = lamina.warp;
        // Along warp and weft.
        let from = |v: u32| {
            let at = lamina.rest[v as usize];
            let [a, b] = [at[0] - self.place[0], at[1] - self.place[1]];
            [a * x + b * y, b * x - a * y]
        };
        let vertices = task.pressable_vertices();
        let mut vertices: Vec<(u32, [f64; 2])> = vertices
            .filter(|&v| task.action(v).is_some())
            .map(|v| (v, from(v)))
            .collect();
        let radius = |[a, b]: [f64; 2]| a.hypot(b);
        let farthest = vertices.iter().map(|one| radius(one.1)).fold(0.0, f64::max);
        let sectors = (FRAC_PI_4 * farthest / (self.width * side))
            .round()
            .max(1.0);
        let rank = |at: [f64; 2]| {
            let radius = radius(at);
            if radius < self.hold * side {
                return [-1.0, 0.0, radius];
            }
            let angle = at[1].atan2(at[0]).rem_euclid(TAU);
            // -1 and 1 on the yarns, 0 on the bias.
            let off = (angle % FRAC_PI_2) / FRAC_PI_4 - 1.0;
            let sector = (sectors * off.abs()).floor().min(sectors - 1.0);
            let part = match self.way {
                Way::Together => 0.0,
                _ => 2.0 * (angle / FRAC_PI_2).floor() + f64::from(off > 0.0),
            };
            let is_outwards = self.way == Way::Snaking && (sector + part) % 2.0 == 1.0;
            [sector, part, if is_outwards { radius } else { -radius }]
        };
        vertices.sort_by(|a, b| {
            let ranks = rank(a.1).into_iter().zip(rank(b.1));
            let mut differ = ranks.map(|(a, b)| a.total_cmp(&b)).filter(|by| by.is_ne());
            differ.next().unwrap_or(a.0.cmp(&b.0))
        });
        let is_near = |a: [f64; 2], b: [f64; 2]| {
            (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < self.spacing * side
        };
        let mut pressed: Vec<(u32, [f64; 2])> = Vec::new();
        for one in vertices {
            if !pressed.iter().any(|other| is_near(one.1, other.1)) {
                pressed.push(one);
            }
        }
        pressed.into_iter().map(|(v, _)| v).collect()
    }
}

/// The best orders inwards by one world, at most so many, best first: one about each place of a coarse and a finer
/// grid, then all kinds about the better places. `go_on` is told the presses made so far, and whether to try more is
/// what it says.
pub fn inwards(
    judge: &mut Judge,
    world: u64,
    most: usize,
    mut go_on: impl FnMut(u64) -> bool,
) -> Vec<Vec<u32>> {
    let before = judge.spent();
    let mut found: Vec<(f64, Inwards, Vec<u32>)> = Vec::new();
    let mut more: VecDeque<Vec<Inwards>> =
        GRIDS.map(|grid| Inwards::over(judge.task(), grid)).into();
    let mut stage = 0;
    while go_on(judge.spent() - before) {
        if more.is_empty() {
            stage += 1;
            let orders = found.iter().map(|one| one.1);
            let dense = |one: Inwards| Inwards {
                spacing: DENSE,
                ..one
            };
            match stage {
                1 => more.extend(orders.take(BETTER).map(Inwards::kinds)),
                2 => more.push_back(orders.take(BEST).map(dense).collect()),
                _ => break,
            }
        }
        let Some(orders) = more.pop_front() else {
            break;
        };
        let lists = orders.into_iter().map(|one| (one, one.list(judge.task())));
        let mut new: Vec<(Inwards, Vec<u32>)> = Vec::new();
        for (one, list) in lists {
            let is_known = found.iter().any(|(_, _, known)| *known == list)
                || new.iter().any(|(_, known)| *known == list);
            if !is_known {
                new.push((one, list));
            }
        }
        let lists: Vec<&[u32]> = new.iter().map(|(_, list)| &list[..]).collect();
        let worth = judge.scores(0, &lists, &[world]);
        let worth = worth.into_iter().zip(new);
        found.extend(worth.map(|(worth, (one, list))| (worth[0], one, list)));
        found.retain(|(worth, ..)| *worth > DIVERGED);
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
    }
    found.truncate(most);
    found.into_iter().map(|(_, _, list)| list).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::EnvConfig;
    use drape_cloth::scene::{Scene, SceneConfig};
    use std::path::Path;

    /// A blank of 17 x 17 vertices, 10 mm apart, whose yarns run along its sides; the stencil is three cells wide.
    fn task() -> Task {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../configs/scenes/hemisphere.toml"
        );
        let mut config = SceneConfig::read(Path::new(path)).unwrap();
        (config.blank.size_mm, config.blank.vertices) = ([160.0, 160.0], [17, 17]);
        (config.fall.fall_s, config.fall.settle_s) = (0.01, 0.01);
        let env = EnvConfig {
            stencil_mm: 31.0,
            ..EnvConfig::default()
        };
        Task::new(Scene::new(&config, |_| ()).unwrap().into(), &env).unwrap()
    }

    fn about(place: [f64; 2], way: Way) -> Inwards {
        Inwards {
            place,
            hold: 0.5,
            width: 0.5,
            way,
            spacing: 0.75,
        }
    }

    /// It begins at its place, goes on in a corner, ends nearer to a yarn than to a bias, and comes over every vertex.
    #[test]
    fn the_bias_is_pressed_before_the_yarns_from_the_border_inwards() {
        let task = task();
        let rest = &task.scene.lamina.rest;
        let at = |v: u32| rest[v as usize].map(|x| (1e3 * x).round());
        for way in WAYS {
            let list = about([0.0, 0.0], way).list(&task);
            assert_eq!(at(list[0]), [0.0, 0.0]);
            let [x, y] = at(list[1]);
            assert_eq!([x.abs(), y.abs()], [80.0, 80.0], "{way:?}");
            let [x, y] = at(list[list.len() - 1]);
            let tangent = x.abs().min(y.abs()) / x.abs().max(y.abs());
            assert!(tangent < 22.5f64.to_radians().tan(), "{way:?}: {x}, {y}");
            for v in task.pressable_vertices() {
                let [x, y] = at(v);
                let is_over = |&w: &u32| (at(w)[0] - x).abs().max((at(w)[1] - y).abs()) <= 20.0;
                assert!(list.iter().any(is_over), "{way:?}: {x}, {y}");
            }
        }
        // All four corners at once, or from one of them inwards.
        let order = |way| about([0.0, 0.0], way).list(&task);
        let radius = |&v: &u32| at(v)[0].hypot(at(v)[1]);
        let [together, apart] = [Way::Together, Way::Apart].map(order);
        assert!(together[1..5].iter().all(|v| radius(v) > 113.0));
        assert!(apart[1..4].is_sorted_by(|a, b| radius(a) > radius(b)));
        assert_ne!(order(Way::Snaking), apart);
        let dense = Inwards {
            spacing: 0.5,
            ..about([0.0, 0.0], Way::Apart)
        };
        assert!(dense.list(&task).len() > apart.len());
    }
}
