//! Orders that anybody could think of, played under the rules of the task: masked random; straight sweeps, one
//! direction an episode; and outwards from a place, one place of a 7 x 7 grid an episode.

use std::sync::Arc;

use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::Scene;
use drape_cloth::sim::Mask;
use drape_task::env::{Draping, End, EnvConfig, Played, Task, Tasks, most_environments};
use drape_task::search::{Order, choose};

/// Plays `count` episodes in an order, drawn under a seed, and keeps what `of` makes of those that do not diverge.
/// `progress` is told the number of steps taken.
pub fn play<T>(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    order: Order,
    count: usize,
    seed: u64,
    mut progress: impl FnMut(usize),
    of: impl Fn(Played) -> T,
) -> Result<Vec<T>, ValueError> {
    let stream = |index| Stream::new(seed, Purpose::Evaluation, index as u32);
    let mut streams: Vec<Stream> = (0..count).map(stream).collect();
    let mut steps = 0;
    let choose = |env: &Draping, first: usize| {
        progress(steps);
        steps += 1;
        let choose = |(index, stream): (usize, &mut Stream)| {
            let share = (first + index) as f64 / count as f64;
            choose(env, index, order, share, stream)
        };
        let streams = streams[first..].iter_mut().take(env.count());
        streams.enumerate().map(choose).collect()
    };
    let of = |_: &Task, played: Played| {
        let is_whole = played.episode.end != End::Diverged;
        is_whole.then(|| of(played))
    };
    let most = most_environments(scene.lamina.vertex_count());
    let kept = Draping::play_all(scene, config, count, most, choose, of)?;
    Ok(kept.into_iter().flatten().collect())
}

/// The vertices that `count` episodes in an order press, stroke by stroke, without those that diverge.
pub fn sequences(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    order: Order,
    count: usize,
    seed: u64,
) -> Result<Vec<Vec<u32>>, ValueError> {
    let vertices = |played: Played| played.end.presses().iter().map(|&(v, _)| v).collect();
    let config = EnvConfig {
        mask: Mask::Stroke,
        ..config.clone()
    };
    let mut lists: Vec<Vec<u32>> = play(scene, &config, order, count, seed, |_| (), vertices)?;
    lists.retain(|list| !list.is_empty());
    Ok(lists)
}
