//! Several processes that compute one training together.
//!
//! All of them do the same things in the same order and hold the same state, to the bit. Only what costs
//! time is shared: each process simulates and judges its part of the environments and takes its part of
//! every minibatch. So results do not depend on who computed what, beyond the order in which gradients
//! are summed, and a checkpoint does not tell how many there were.

mod shared;
mod threads;

use std::ops::Range;
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;

pub(crate) use shared::Shared;
pub use threads::threads;

/// One of several processes that can send each other bytes.
pub trait Communicator: Send + Sync {
    /// Its number, from 0.
    fn rank(&self) -> usize;

    /// How many there are, > 0.
    fn size(&self) -> usize;

    /// Sends `parts[k]` to process k and gives what each has sent to this one, in the order of ranks. All
    /// processes call it equally often. One that is lost ends the others.
    fn exchange(&self, parts: Vec<Vec<u8>>) -> Vec<Vec<u8>>;
}

/// The processes that this one computes with; none by default.
#[derive(Clone, Default)]
pub struct Cluster(Option<Arc<dyn Communicator>>);

impl Cluster {
    /// The processes that `communicator` reaches.
    pub fn new(communicator: impl Communicator + 'static) -> Self {
        Self(Some(Arc::new(communicator)))
    }

    /// Number of this process, from 0.
    pub fn rank(&self) -> usize {
        self.0.as_ref().map_or(0, |all| all.rank())
    }

    /// Number of processes.
    pub fn size(&self) -> usize {
        self.0.as_ref().map_or(1, |all| all.size())
    }

    /// Whether this process writes files and reports.
    pub fn is_first(&self) -> bool {
        self.rank() == 0
    }

    /// Those of `count` things that fall to this process: nearly as many as to every other.
    pub fn share(&self, count: usize) -> Range<usize> {
        let (rank, size) = (self.rank(), self.size());
        rank * count / size..(rank + 1) * count / size
    }

    /// What every process gives, in the order of ranks. All call it.
    ///
    /// # Panics
    /// If the processes give different kinds of things: they are not of one build.
    pub fn gather<T: Serialize + DeserializeOwned>(&self, own: T) -> Vec<T> {
        let Some(all) = &self.0 else {
            return vec![own];
        };
        let bytes = postcard::to_allocvec(&own).expect("plain data is serialisable");
        let found = all.exchange(vec![bytes; all.size()]);
        let decoded = found.iter().map(|bytes| postcard::from_bytes(bytes));
        decoded
            .collect::<Result<_, _>>()
            .expect("all processes are of one build")
    }

    /// What `compute` gives for each of `count` things, each computed by one process. All call it.
    pub fn split<T: Serialize + DeserializeOwned>(
        &self,
        count: usize,
        compute: impl FnOnce(Range<usize>) -> Vec<T>,
    ) -> Vec<T> {
        let own = self.share(count);
        let own = match own.is_empty() {
            true => Vec::new(),
            false => compute(own),
        };
        self.gather(own).into_iter().flatten().collect()
    }

    /// Whether any process says so. All call it.
    pub fn any(&self, says: bool) -> bool {
        self.gather(says).contains(&true)
    }

    /// Sums `numbers` over all processes, each number in the order of ranks, so that all have the same bits
    /// every time. All call it with equally many.
    pub fn sum(&self, numbers: &mut [f32]) {
        let Some(all) = &self.0 else { return };
        let (size, count) = (all.size(), numbers.len());
        let segment = |rank: usize| rank * count / size..(rank + 1) * count / size;
        let bytes = |numbers: &[f32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let parts = (0..size).map(|rank| bytes(&numbers[segment(rank)]));
        let mut sum = vec![0.0; self.share(count).len()];
        for part in all.exchange(parts.collect()) {
            sum.iter_mut()
                .zip(floats(&part))
                .for_each(|(sum, x)| *sum += x);
        }
        let sums = all.exchange(vec![bytes(&sum); size]);
        for (number, sum) in numbers.iter_mut().zip(sums.iter().flat_map(|s| floats(s))) {
            *number = sum;
        }
    }
}

fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> {
    let words = bytes.as_chunks().0.iter();
    words.map(|&word| f32::from_le_bytes(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What every process finds, in the order of ranks.
    fn on<T: Send>(size: usize, find: impl Fn(Cluster) -> T + Sync) -> Vec<T> {
        let find = &find;
        std::thread::scope(|scope| {
            let all = threads(size).into_iter();
            let all: Vec<_> = all
                .map(|one| scope.spawn(move || find(Cluster::new(one))))
                .collect();
            all.into_iter().map(|one| one.join().unwrap()).collect()
        })
    }

    #[test]
    fn everything_is_computed_once_and_known_to_all() {
        for size in [1, 2, 3, 4] {
            for count in [0, 1, 2, 7, 64] {
                let found = on(size, |cluster| {
                    let squares =
                        |own: Range<usize>| own.map(|k| (cluster.rank(), k * k)).collect();
                    cluster.split(count, squares)
                });
                assert!(found.iter().all(|one| *one == found[0]));
                let squares = found[0].iter().map(|&(_, square)| square);
                assert!(squares.eq((0..count).map(|k| k * k)));
                let mut parts = vec![0; size];
                found[0].iter().for_each(|&(rank, _)| parts[rank] += 1);
                let [least, most] = [parts.iter().min(), parts.iter().max()].map(|n| *n.unwrap());
                assert!(most - least <= 1, "{parts:?}");
            }
        }
    }

    /// 1 + 1e8 - 1e8 is 0 in this order and 1 in another.
    #[test]
    fn sums_are_in_the_order_of_ranks_whatever_the_segment() {
        let found = on(3, |cluster| {
            let mut numbers = vec![[1.0, 1e8, -1e8][cluster.rank()]; 5];
            cluster.sum(&mut numbers);
            numbers
        });
        assert_eq!(found, vec![vec![0.0; 5]; 3]);
    }

    #[test]
    fn one_says_stop_for_all() {
        let found = on(4, |cluster| {
            [cluster.any(cluster.rank() == 2), cluster.any(false)]
        });
        assert_eq!(found, vec![[true, false]; 4]);
        assert!(!Cluster::default().any(false));
    }
}
