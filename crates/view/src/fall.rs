//! A blank that falls, for all to see.

use std::sync::Arc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use drape_cloth::scene::Scene;
use drape_task::env::Draping;

use super::host::{Host, Spec};
use super::moment::{Moment, Shared, Status};
use super::stage::Stage;

/// Duration of a frame of the fall, which is shown no faster than it would be [s].
const FRAME: f64 = 1.0 / 60.0;
/// Frames of a fall that are kept; of longer ones every second, fourth, ...
const MOST_FRAMES: usize = 240;

/// What is set up of a task: what is shown of it, how its blank fell, and the cloth.
pub type Fallen = (Arc<Stage>, Vec<Vec<[f32; 3]>>, Draping);

/// Lets the blank of a task fall, no faster than it would, while all look on.
pub fn fallen<H: Host>(
    host: &mut H,
    spec: &Spec,
    shared: &Shared,
    status: &mut Status,
    number: u64,
) -> Result<Fallen, H::Error> {
    let (mut stage, mut frames) = (None, Vec::new());
    let (mut due, mut stride, mut seen) = (Instant::now(), 1, 0);
    let told = status.clone();
    let (scene, oddities): (Arc<Scene>, _) = host.set_up(spec, &mut |scene, share, cloth| {
        seen += 1;
        if (seen - 1) % stride != 0 {
            return;
        }
        let position = cloth().position;
        let stage = stage.get_or_insert_with(|| Stage::new(number, scene, spec, &position));
        let short = position.iter().map(|x| x.map(|x| x as f32));
        frames.push(short.collect::<Vec<_>>());
        if frames.len() > MOST_FRAMES {
            stride *= 2;
            frames = std::mem::take(&mut frames).into_iter().step_by(2).collect();
        }
        shared.publish(Moment {
            stage: Some(stage.clone()),
            marks: stage.marks.clone(),
            status: Status {
                phase: "falling",
                share,
                at: frames.len() - 1,
                count: frames.len(),
                fall: frames.len(),
                ..told.clone()
            },
            position,
            ..Moment::default()
        });
        due += Duration::from_secs_f64(FRAME * stride as f64);
        let now = Instant::now();
        sleep(due.saturating_duration_since(now));
        due = due.max(now);
    })?;
    let draping = Draping::new(scene, &spec.env, 1);
    let draping = draping.map_err(|error| host.refuse(error))?;
    status.oddities = oddities;
    Ok((stage.expect("the start was seen"), frames, draping))
}
