//! Lists of presses, played in the fast solver and in the twin.

use drape_cloth::math::Stream;
use drape_cloth::scene::Scene;
use drape_cloth::twin::{PressConfig, Twin};
use drape_task::env::Draping;

/// Where every vertex is [m].
pub type Positions = Vec<[f64; 3]>;

/// Where a list of presses has led to, after some of the presses and after all.
pub type Replayed = [Positions; 2];

/// Plays lists of presses in the fast solver, side by side in the lanes; none where it diverges.
/// Of a list of some length `midway` says after how many presses it is looked at. `observe` is
/// told the number of presses made, after each of every list.
pub fn replay(
    draping: &mut Draping,
    lists: &[&[u32]],
    midway: fn(usize) -> usize,
    mut observe: impl FnMut(usize),
) -> Vec<Option<Replayed>> {
    let mut midways = vec![Vec::new(); lists.len()];
    let mut ends = vec![None; lists.len()];
    draping.replay(lists, |draping, index, presses| {
        observe(presses);
        let count = lists[index].len();
        if presses == midway(count) {
            midways[index] = draping.state(index).position;
        }
        if presses == count {
            let midway = std::mem::take(&mut midways[index]);
            ends[index] = Some([midway, draping.state(index).position]);
        }
    });
    ends
}

/// Plays one list in the twin, with a roller of `side` [m]; none where it diverges.
pub fn replay_in_twin(
    twin: &mut Twin,
    scene: &Scene,
    press: &PressConfig,
    (list, side): (&[u32], f64),
    midway: fn(usize) -> usize,
) -> Option<Replayed> {
    let (mut presses, mut middle) = (0, twin.positions());
    let ended = twin.replay(&scene.lamina, &scene.tool, press, (list, side), |twin| {
        presses += 1;
        if presses == midway(list.len()) {
            middle = twin.positions();
        }
    });
    let at = [middle, twin.positions()];
    ended.diverged.is_none().then_some(at)
}

/// Pushes every vertex of a scene that is not clamped, normally distributed with `size` [m].
pub fn push(scene: &Scene, positions: &mut Positions, size: f64, stream: &mut Stream) {
    for (v, x) in positions.iter_mut().enumerate() {
        if !scene.initial.fixed.contains(v) {
            *x = x.map(|x| x + size * stream.normal());
        }
    }
}
