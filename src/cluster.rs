//! The processes that `mpirun` or SLURM has started: cargo feature `cluster`.

use drape_task::cluster::Cluster;

/// A process that cannot be one of those that it was started with.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct StartError(String);

/// This process among those that were started together, until the command ends.
pub struct ClusterSession {
    pub cluster: Cluster,
    /// Number of this process among those on the same machine.
    pub local_rank: usize,
    #[cfg(feature = "cluster")]
    universe: mpi::environment::Universe,
}

/// Refuses to be one of several processes that would all do the same work and write the same files.
///
/// # Errors
/// `mpirun` or SLURM has started several.
pub fn check_alone() -> Result<(), StartError> {
    refuse_several("only `drape train` shares its work")
}

fn refuse_several(advice: &str) -> Result<(), StartError> {
    // Open MPI, MPICH and those derived from it, SLURM.
    for name in ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"] {
        let size = std::env::var(name).ok().and_then(|size| size.parse().ok());
        if let Some(size @ 2_usize..) = size {
            return Err(StartError(format!(
                "started as one of {size} processes, expected one: {advice}"
            )));
        }
    }
    Ok(())
}

#[cfg(not(feature = "cluster"))]
impl ClusterSession {
    /// This process alone.
    ///
    /// # Errors
    /// It is one of several, which this build cannot be.
    pub fn start() -> Result<Self, StartError> {
        refuse_several("rebuild with `--features cluster`")?;
        Ok(Self {
            cluster: Cluster::default(),
            local_rank: 0,
        })
    }

    /// Gives the result of the command.
    pub fn end<T, E>(self, result: Result<T, E>, _: impl FnOnce(&E) -> i32) -> Result<T, E> {
        result
    }
}

#[cfg(feature = "cluster")]
mod processes {
    use mpi::Threading;
    use mpi::datatype::{Partition, PartitionMut};
    use mpi::topology::SimpleCommunicator;
    use mpi::traits::{Communicator as _, CommunicatorCollectives as _};

    use super::{Cluster, ClusterSession, StartError};
    use drape_task::cluster::Communicator;

    impl ClusterSession {
        /// Meets all processes.
        ///
        /// # Errors
        /// The MPI library does not start.
        pub fn start() -> Result<Self, StartError> {
            let started = mpi::initialize_with_threading(Threading::Serialized);
            let (universe, _) =
                started.ok_or_else(|| StartError("MPI has been started before".into()))?;
            let world = universe.world();
            let (rank, size) = (world.rank() as usize, world.size() as usize);
            let local_rank = world.split_shared(world.rank()).rank() as usize;
            let mut cluster = Cluster::default();
            if size > 1 {
                cluster = Cluster::new(Processes { rank, size });
                // Whoever waits for a process that has panicked waits for ever.
                let told = std::panic::take_hook();
                std::panic::set_hook(Box::new(move |panic| {
                    told(panic);
                    SimpleCommunicator::world().abort(101)
                }));
            }
            Ok(Self {
                cluster,
                local_rank,
                universe,
            })
        }

        /// Gives the result of the command; where it has failed, `report` says so and gives the exit code
        /// with which all processes end.
        pub fn end<T, E>(
            self,
            result: Result<T, E>,
            report: impl FnOnce(&E) -> i32,
        ) -> Result<T, E> {
            match result {
                Err(error) if self.cluster.size() > 1 => {
                    self.universe.world().abort(report(&error))
                }
                result => result,
            }
        }
    }

    /// All that MPI has started, this one being number `rank`.
    struct Processes {
        rank: usize,
        size: usize,
    }

    impl Communicator for Processes {
        fn rank(&self) -> usize {
            self.rank
        }

        fn size(&self) -> usize {
            self.size
        }

        fn exchange(&self, parts: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
            let world = SimpleCommunicator::world();
            // MPI counts by 32 bits.
            let count = |bytes: usize| i32::try_from(bytes).expect("2 GiB at most at a time");
            let starts = |counts: &[i32]| -> Vec<i32> {
                let sums = counts.iter().scan(0usize, |sum, &count| {
                    let start = *sum;
                    *sum += count as usize;
                    Some(start)
                });
                sums.map(count).collect()
            };
            let sent: Vec<i32> = parts.iter().map(|part| count(part.len())).collect();
            let mut received = vec![0i32; self.size];
            world.all_to_all_into(&sent[..], &mut received[..]);
            let bytes = parts.concat();
            let mut found = vec![0u8; received.iter().map(|&count| count as usize).sum()];
            let [from, to] = [starts(&sent), starts(&received)];
            let bytes = Partition::new(&bytes[..], sent, from);
            let mut into = PartitionMut::new(&mut found[..], &received[..], &to[..]);
            world.all_to_all_varcount_into(&bytes, &mut into);
            let parts = to.iter().zip(&received);
            parts
                .map(|(&to, &count)| found[to as usize..][..count as usize].to_vec())
                .collect()
        }
    }
}
