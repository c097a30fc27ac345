//! Learning, masks, exact resume and refusal of what is not finite, on a toy task.

use super::rollout::collect;
use super::*;
use crate::policy::{DeviceKind, NetworkConfig, PolicyConfig, UnetConfig};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::sim::{ALLOWED, DRAPED, Observations, TOUCHED};
use drape_task::cluster::{Cluster, threads};
use drape_task::env::{End, Episode, ImageShape, StepOutcome, Tasks, Terrain};
use fixedbitset::FixedBitSet;

/// Touch `ORDER` in this order, on a 6 x 5 grid. All of them are allowed until touched. The
/// only reward is the last step's: 10 for each position that was right.
struct Order {
    /// `[task]`: touched so far.
    taken: Vec<Vec<u32>>,
    now: Observations,
    last: Observations,
    /// Reward of a position: not finite to see that it is refused.
    reward: f32,
    /// How episodes end.
    end: End,
    terrain: Terrain,
}

/// Every pixel at another height: what tells places apart.
fn ramp(shape: ImageShape) -> Terrain {
    let count = shape.pixel_count();
    let mut inside = FixedBitSet::with_capacity(count);
    inside.insert_range(..);
    Terrain {
        inside,
        height: (0..count).map(|i| 0.01 * i as f32).collect(),
        slope: vec![[0.0; 2]; count],
    }
}

const SHAPE: ImageShape = ImageShape {
    rows: 6,
    columns: 5,
};
const ORDER: [u32; 6] = [13, 2, 29, 21, 7, 16];

impl Order {
    fn new(count: usize) -> Self {
        let taken = vec![Vec::new(); count];
        Self {
            now: seen(&taken),
            last: seen(&taken),
            taken,
            reward: 10.0,
            end: End::Terminated,
            terrain: ramp(SHAPE),
        }
    }
}

/// What tasks show in which these have been touched.
fn seen(taken: &[Vec<u32>]) -> Observations {
    let (mut distance, mut marks) = (Vec::new(), Vec::new());
    for taken in taken {
        let pixels = 0..SHAPE.pixel_count() as u32;
        let touched = |pixel: u32| taken.contains(&pixel);
        distance.extend(pixels.clone().map(|pixel| match touched(pixel) {
            true => 0.0,
            false => pixel as f32 * 1e-3,
        }));
        marks.extend(
            pixels.map(|pixel| match (touched(pixel), ORDER.contains(&pixel)) {
                (true, _) => TOUCHED | DRAPED,
                (false, true) => ALLOWED,
                (false, false) => 0,
            }),
        );
    }
    Observations::new(vec![0; taken.len()], distance, marks)
}

impl Tasks for Order {
    fn shape(&self) -> ImageShape {
        SHAPE
    }

    fn count(&self) -> usize {
        self.taken.len()
    }

    fn reward_scale(&self, _: usize) -> f32 {
        10.0 * ORDER.len() as f32
    }

    fn terrains(&self) -> Vec<&Terrain> {
        vec![&self.terrain]
    }

    fn observations(&self) -> &Observations {
        &self.now
    }

    fn last(&self) -> &Observations {
        &self.last
    }

    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome> {
        assert!(
            !self.now.allow(actions).contains(&false),
            "the mask was violated"
        );
        let Self { reward, end, .. } = *self;
        for (taken, &action) in self.taken.iter_mut().zip(actions) {
            taken.push(action);
        }
        self.last = seen(&self.taken);
        let step = |taken: &mut Vec<u32>| {
            if taken.len() < ORDER.len() {
                return StepOutcome {
                    reward: 0.0,
                    episode: None,
                };
            }
            let right = taken.iter().zip(ORDER).filter(|(a, b)| **a == *b).count();
            StepOutcome {
                reward: reward * right as f32,
                episode: Some(Episode {
                    end,
                    actions: std::mem::take(taken),
                    total_reward: reward * right as f32,
                    score: (end != End::Diverged).then(|| right as f64 / ORDER.len() as f64),
                }),
            }
        };
        let outcomes = self.taken.iter_mut().map(step).collect();
        self.now = seen(&self.taken);
        outcomes
    }

    fn save(&self) -> Vec<u8> {
        postcard::to_allocvec(&(&self.taken, self.reward)).unwrap()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved = postcard::from_bytes(bytes).map_err(|e| e.to_string())?;
        let (taken, reward): (Vec<Vec<u32>>, f32) = saved;
        if taken.len() != self.count() {
            return Err("another number of tasks".into());
        }
        self.now = seen(&taken);
        (self.taken, self.reward) = (taken, reward);
        Ok(())
    }
}

/// The smaller network of the compact preset: the task is small.
fn policy() -> PolicyConfig {
    let mut config = PolicyConfig::compact();
    let NetworkConfig::Compact(compact) = &mut config.network else {
        unreachable!("the compact preset has a compact network")
    };
    (compact.channels, compact.blocks) = (16, 1);
    config
}

/// Rollouts that end within episodes: 10 steps are no multiple of 6.
fn ppo() -> PpoConfig {
    PpoConfig {
        rollout_steps: 10,
        minibatch_size: 80,
        entropy_coefficient: 0.01,
        imitation: None,
        ..PpoConfig::compact()
    }
}

fn trainer(config: PpoConfig, seed: u64) -> Trainer<Order> {
    Trainer::new(config, &policy(), Order::new(16), seed, DeviceKind::Flex).unwrap()
}

/// That with observations that are encoded where the network is.
fn keeping_trainer(config: PpoConfig, seed: u64) -> Trainer<Order> {
    let mut trainer = trainer(config, seed);
    trainer.actor_critic.encodes_there = true;
    trainer
}

/// Score of the episode played greedily.
fn greedy_score(agent: &Agent) -> f64 {
    let mut task = Order::new(1);
    loop {
        let actions = agent.act(&[task.observation(0)], Sampling::Greedy);
        if let Some(episode) = task.step(&actions).pop().unwrap().episode {
            return episode.score.unwrap();
        }
    }
}

/// Whether argmax solves the task after at most so many iterations.
fn solves(mut trainer: Trainer<Order>, iterations: usize) -> bool {
    (0..iterations / 10).any(|_| {
        (0..10).for_each(|_| drop(trainer.iterate().unwrap()));
        greedy_score(&trainer.agent()) == 1.0
    })
}

#[test]
fn ppo_solves_the_order_from_three_seeds() {
    for baseline in [Baseline::Value, Baseline::Group] {
        let config = PpoConfig { baseline, ..ppo() };
        for seed in 0..3 {
            let is_solved = solves(trainer(config.clone(), seed), 300);
            assert!(is_solved, "{baseline:?}, seed {seed} did not learn");
        }
    }
}

/// Where observations are changes sums within rounding, and a training is resumed exactly from wherever its
/// episodes are.
#[test]
fn observations_may_stay_on_the_device() {
    let config = PpoConfig {
        imitation: PpoConfig::compact().imitation,
        normalise_entropy: true,
        // Episodes go on from one rollout to the next.
        rollout_steps: 10,
        ..ppo()
    };
    let (mut here, mut there) = (
        trainer(config.clone(), 1),
        keeping_trainer(config.clone(), 1),
    );
    for _ in 0..3 {
        let [a, b] = [&mut here, &mut there].map(|trainer| trainer.iterate().unwrap());
        assert_eq!(a.episodes, b.episodes);
        assert!((a.metrics.entropy - b.metrics.entropy).abs() < 1e-4);
        assert!((a.metrics.imitation_loss - b.metrics.imitation_loss).abs() < 1e-3);
    }
    let saved = there.save();
    let mut resumed = keeping_trainer(config, 2);
    resumed.load(&saved).unwrap();
    assert!(resumed.save() == saved);
    for _ in 0..2 {
        let [a, b] = [&mut there, &mut resumed].map(|trainer| trainer.iterate().unwrap());
        assert_eq!((a.metrics, a.episodes), (b.metrics, b.episodes));
    }
    assert!(there.save() == resumed.save());
}

#[test]
fn imitation_alone_solves_the_order() {
    let config = PpoConfig {
        policy_coefficient: 0.0,
        imitation: Some(ImitationConfig {
            episodes: 4,
            samples: 32,
            coefficient: 0.3,
            pretraining: 0,
            symmetries: false,
        }),
        ..ppo()
    };
    for seed in 0..3 {
        let is_solved = solves(trainer(config.clone(), seed), 600);
        assert!(is_solved, "seed {seed} did not learn");
    }
}

/// Shown the solution once, a learner that imitates and does nothing else plays it soon; its tasks
/// stand where they stood. One that imitates nothing is shown nothing.
#[test]
fn what_is_shown_is_imitated() {
    let config = PpoConfig {
        policy_coefficient: 0.0,
        ..everything()
    };
    let solution = |tasks: &Order, task: usize| ORDER[tasks.taken[task].len()];
    for seed in 0..3 {
        let mut learner = trainer(config.clone(), seed);
        let before = learner.save()["tasks"].clone();
        let shown = learner.show(solution);
        assert_eq!(shown.len(), 16);
        assert!(shown.iter().all(|episode| episode.score == Some(1.0)));
        assert_eq!(learner.save()["tasks"], before);
        assert_eq!(learner.env_steps(), 0);
        let solved = (0..100).any(|_| {
            learner.iterate().unwrap();
            greedy_score(&learner.agent()) == 1.0
        });
        assert!(solved, "seed {seed}");
    }
    assert!(trainer(ppo(), 0).show(solution).is_empty());
}

/// What is imitated at first is played before anything else has been learned.
#[test]
fn pretraining_plays_what_was_shown() {
    let mut config = everything();
    let imitation = config.imitation.as_mut().unwrap();
    (imitation.episodes, imitation.pretraining) = (1, 200);
    let mut learner = trainer(config, 0);
    learner.show(|tasks, task| ORDER[tasks.taken[task].len()]);
    let mut told = Vec::new();
    let watch = |share, loss| {
        told.push((share, loss));
        true
    };
    learner.pretrain(watch).unwrap();
    assert_eq!((told.len(), told[199].0), (200, 1.0));
    assert!(told[199].1 < 0.05 * told[0].1, "{:?}", (told[0], told[199]));
    assert_eq!(greedy_score(&learner.agent()), 1.0);
    assert_eq!(learner.env_steps(), 0);
}

/// A short training with everything on: imitation, limits.
fn everything() -> PpoConfig {
    PpoConfig {
        imitation: PpoConfig::compact().imitation,
        ..ppo()
    }
}

/// What must repeat of an iteration: all but the time it took.
fn timeless(iteration: Iteration) -> Iteration {
    Iteration {
        seconds: Seconds::default(),
        ..iteration
    }
}

#[test]
fn rollout_notes_ends_scaled_rewards_and_the_values_behind_truncations() {
    let agent = trainer(ppo(), 5).agent();
    for end in [End::Terminated, End::Truncated, End::Diverged] {
        let mut tasks = Order::new(1);
        tasks.end = end;
        let streams = &mut [Stream::new(5, Purpose::Actions, 0)];
        let cluster = Cluster::default();
        let rollout = collect(&agent, &cluster, &mut tasks, streams, None, 6, &[0.5]);
        let value = agent.value(&[seen(&[ORDER.to_vec()]).row(0)])[0];
        let expected = match end {
            End::Terminated | End::Diverged => Next::Terminated,
            End::Truncated => Next::Truncated { value },
        };
        assert!(rollout.next[..5].iter().all(|next| *next == Next::Step));
        assert_eq!(rollout.next[5], expected);
        assert_eq!(rollout.rewards[5], 0.5 * rollout.episodes[0].total_reward);
        assert_eq!(rollout.actions, rollout.episodes[0].actions);
        // The task has been reset: what follows the rollout is the start again.
        assert_eq!(
            rollout.last_values,
            agent.value(&[Order::new(1).observation(0)])
        );
    }
}

#[test]
fn resumed_training_is_the_uninterrupted_one() {
    let mut whole = trainer(everything(), 5);
    (0..3).for_each(|_| drop(whole.iterate().unwrap()));
    let saved = whole.save();
    let mut resumed = trainer(everything(), 99);
    resumed.load(&saved).unwrap();
    assert!(resumed.save() == saved);
    for _ in 0..3 {
        let (a, b) = (whole.iterate().unwrap(), resumed.iterate().unwrap());
        assert_eq!(timeless(a), timeless(b));
    }
    assert!(whole.save() == resumed.save());
}

/// Parameters, moments, counters and what is imitated stay; tasks begin anew.
#[test]
fn other_numbers_of_tasks_go_on_with_what_was_learned() {
    let mut whole = trainer(everything(), 5);
    whole.iterate().unwrap();
    for count in [3, 20] {
        let tasks = Order::new(count);
        let other = Trainer::new(everything(), &policy(), tasks, 99, DeviceKind::Flex);
        let mut other = other.unwrap();
        other.load(&whole.save()).unwrap();
        assert!(other.agent().save() == whole.agent().save());
        let next = other.iterate().unwrap();
        assert_eq!((next.number, next.env_steps), (2, 160 + 10 * count as u64));
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut trainer = trainer(everything(), 5);
            (0..3).for_each(|_| drop(trainer.iterate().unwrap()));
            trainer.save()
        })
    };
    let one = run(1);
    assert!(run(2) == one);
    assert!(run(3) == one);
}

#[test]
fn foreign_or_damaged_sections_are_refused_and_change_nothing() {
    let mut trainer = trainer(everything(), 5);
    trainer.iterate().unwrap();
    let saved = trainer.save();
    for name in saved.keys() {
        let mut missing = saved.clone();
        missing.remove(name);
        let error = trainer.load(&missing).unwrap_err();
        assert_eq!(error.to_string(), format!("section `{name}`: missing"));
        for other in saved.keys().filter(|other| *other != name) {
            let mut swapped = saved.clone();
            swapped.insert(name.clone(), saved[other].clone());
            assert!(trainer.load(&swapped).is_err(), "{other} taken as {name}");
        }
    }
    assert!(trainer.save() == saved);
}

#[test]
fn reward_that_is_not_finite_stops_the_training_and_leaves_the_network() {
    let mut trainer = trainer(ppo(), 5);
    trainer.iterate().unwrap();
    let before = trainer.agent().save();
    let mut sections = trainer.save();
    let mut tasks = Order::new(16);
    tasks.reward = f32::NAN;
    sections.insert("tasks".to_owned(), tasks.save());
    trainer.load(&sections).unwrap();
    let error = trainer.iterate().unwrap_err();
    let cause = std::error::Error::source(&error).unwrap().to_string();
    assert!(error.to_string().starts_with("iteration 2 failed"));
    assert_eq!(cause, "policy loss is not finite");
    assert!(trainer.agent().save() == before);
}

#[test]
fn papers_network_learns_and_survives_its_file() {
    let (config, mut policy) = (PpoConfig::paper(), PolicyConfig::paper());
    let NetworkConfig::Paper(paper) = &mut policy.network else {
        unreachable!("the paper's preset has its network")
    };
    paper.channels.truncate(2);
    let mut trainer = Trainer::new(config, &policy, Order::new(2), 0, DeviceKind::Flex).unwrap();
    let before = trainer.agent().save();
    let iteration = trainer.iterate().unwrap();
    assert_eq!(iteration.env_steps, 200);
    assert_eq!(iteration.episodes.len(), 2 * (100 / ORDER.len()));
    assert!(trainer.agent().save() != before);

    let mut agent = Agent::new(&policy, SHAPE, &[&ramp(SHAPE)], 77, DeviceKind::Flex).unwrap();
    let task = Order::new(1);
    agent.load(&trainer.agent().save()).unwrap();
    let seen = [task.observation(0)];
    assert_eq!(agent.value(&seen), trainer.agent().value(&seen));
    let other = Agent::new(&self::policy(), SHAPE, &[&ramp(SHAPE)], 0, DeviceKind::Flex).unwrap();
    assert!(agent.load(&other.save()).is_err());
}

fn unet() -> PolicyConfig {
    PolicyConfig {
        network: NetworkConfig::Unet(UnetConfig {
            channels: 8,
            levels: 2,
            value_hidden: 16,
        }),
        ..policy()
    }
}

/// No weight of a U-net belongs to a place, so it finds the order from what is seen of the terrain.
#[test]
fn unet_solves_the_order_from_three_seeds() {
    for seed in 0..3 {
        let tasks = Order::new(16);
        let trainer = Trainer::new(everything(), &unet(), tasks, seed, DeviceKind::Flex);
        let is_solved = solves(trainer.unwrap(), 600);
        assert!(is_solved, "seed {seed} did not learn");
    }
}

/// Equal weights play on an image of any size, and there is the same logit wherever the same is
/// seen: here beside a draped pixel in the middle of two flat images.
#[test]
fn unet_plays_at_any_size() {
    let middle = |side: usize| (side / 2) * side + side / 2;
    let flat = |shape: ImageShape| Terrain {
        height: vec![0.0; shape.pixel_count()],
        ..ramp(shape)
    };
    let seen = |shape: ImageShape| {
        let mut marks = vec![ALLOWED; shape.pixel_count()];
        marks[middle(shape.rows)] |= DRAPED;
        Observations::new(vec![0], vec![0.01; shape.pixel_count()], marks)
    };
    let agent = |side, seed| {
        let shape = ImageShape {
            rows: side,
            columns: side,
        };
        let terrain = flat(shape);
        let agent = Agent::new(&unet(), shape, &[&terrain], seed, DeviceKind::Flex);
        (agent.unwrap(), seen(shape))
    };
    let ((small, small_seen), (mut large, large_seen)) = (agent(32, 1), agent(64, 2));
    large.load(&small.save()).unwrap();
    let [(a, _), (b, _)] = [
        small.evaluate(&[small_seen.row(0)]),
        large.evaluate(&[large_seen.row(0)]),
    ];
    // Log-probabilities of neighbours, since the sums over all pixels differ.
    let difference = |all: &[f32], side: usize| all[middle(side)] - all[middle(side) + 1];
    assert!(difference(&a, 32).abs() > 1e-4);
    assert!((difference(&a, 32) - difference(&b, 64)).abs() < 1e-5);
}

#[test]
fn drawn_actions_repeat_and_obey_the_mask() {
    let agent = trainer(ppo(), 1).agent();
    let task = Order::new(1);
    let observations = vec![task.observation(0); 50];
    let draw = || {
        let mut stream = Stream::new(3, Purpose::Evaluation, 0);
        agent.act(&observations, Sampling::Drawn(&mut stream))
    };
    let actions = draw();
    assert_eq!(actions, draw());
    assert!(actions.iter().all(|a| ORDER.contains(a)));
    // Nearly uniform at first: fifty draws show all six.
    assert!(ORDER.iter().all(|a| actions.contains(a)));
}

/// Processes hold the same bits, the same ones every time, and learn what one does by itself within the order
/// of sums: also where minibatches do not divide evenly.
#[test]
fn processes_learn_what_one_does() {
    let learn = |size: usize| -> Vec<(Sections, Vec<Iteration>)> {
        std::thread::scope(|scope| {
            let all: Vec<_> = threads(size)
                .into_iter()
                .map(|one| {
                    scope.spawn(move || {
                        let mut trainer =
                            trainer(everything(), 3).among(&Cluster::new(one)).unwrap();
                        trainer
                            .show(|tasks, task| tasks.observation(task).allowed().next().unwrap());
                        trainer.pretrain(|_, _| true).unwrap();
                        let iterate = |_| timeless(trainer.iterate().unwrap());
                        let iterations = (0..3).map(iterate).collect();
                        (trainer.save(), iterations)
                    })
                })
                .collect();
            all.into_iter().map(|one| one.join().unwrap()).collect()
        })
    };
    let alone = learn(1).swap_remove(0).1;
    for size in [2, 3] {
        let found = learn(size);
        assert!(found.iter().all(|one| *one == found[0]), "{size}");
        assert!(learn(size) == found, "{size}");
        for (one, several) in alone.iter().zip(&found[0].1) {
            assert_eq!(one.episodes, several.episodes);
            let [one, several] = [one, several].map(|i| i.metrics);
            let [a, b] = [one.gradient_norm, several.gradient_norm];
            assert!((a - b).abs() < 1e-3 * a, "{size}: {a} {b}");
            let [a, b] = [one.entropy, several.entropy];
            assert!((a - b).abs() < 1e-4, "{size}: {a} {b}");
            let [a, b] = [one.imitation_loss, several.imitation_loss];
            assert!((a - b).abs() < 1e-3, "{size}: {a} {b}");
        }
    }
}

#[test]
fn too_many_processes_for_a_minibatch_are_refused() {
    let config = PpoConfig {
        minibatch_size: 2,
        ..ppo()
    };
    let one = threads(3).pop().unwrap();
    let refused = trainer(config, 0).among(&Cluster::new(one));
    let error = refused.map(drop).unwrap_err();
    let error = std::error::Error::source(&error).unwrap();
    let expected = "`minibatch_size` is 2, expected at least 3, one sample a process";
    assert_eq!(error.to_string(), expected);
}
