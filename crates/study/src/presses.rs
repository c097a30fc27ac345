//! Lists of presses, played in the fast solver and in the twin.

use drape_cloth::math::Stream;
use drape_cloth::scene::Scene;
use drape_cloth::twin::{PressConfig, Twin};
use drape_task::env::Draping;

/// Where every vertex is [m].
pub type Positions = Vec<[f64; 3]>;

/// Plays lists of presses in the fast solver, side by side in the lanes; none where it diverges.
/// `observe` is told the number of presses made, after each of every list.
pub fn replay(
    draping: &mut Draping,
    lists: &[&[u32]],
    mut observe: impl FnMut(usize),
) -> Vec<Option<Positions>> {
    let mut ends = vec![None; lists.len()];
    draping.replay(lists, |draping, index, presses| {
        observe(presses);
        if presses == lists[index].len() {
            ends[index] = Some(draping.state(index).position);
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
) -> Option<Positions> {
    let ended = twin.replay(&scene.lamina, &scene.tool, press, (list, side), |_| ());
    ended.diverged.is_none().then(|| twin.positions())
}

/// Pushes every vertex of a scene that is not clamped, normally distributed with `size` [m].
pub fn push(scene: &Scene, positions: &mut Positions, size: f64, stream: &mut Stream) {
    for (v, x) in positions.iter_mut().enumerate() {
        if !scene.initial.fixed.contains(v) {
            *x = x.map(|x| x + size * stream.normal());
        }
    }
}
