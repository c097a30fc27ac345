use super::draping::Draping;
use super::task::Tasks;

/// A list of presses that could not be pressed to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the simulation diverged after {presses} presses")]
pub struct ReplayDiverged {
    /// Presses until then, the one included in which it happened.
    pub presses: usize,
}

impl Draping {
    /// Presses list `k` of vertices in environment `k`, each from the start, all at once in the
    /// SIMD lanes. Every press is made, whatever the masks allow; a list ends early only where
    /// its simulation diverges, which the result tells.
    ///
    /// `observe` is called with the environments, the index of one of them and the number of its
    /// presses so far: at its start and after each of its presses. Where a list is over, time
    /// passes until all are.
    ///
    /// # Panics
    /// If there is not one list an environment.
    pub fn replay(
        &mut self,
        lists: &[&[u32]],
        mut observe: impl FnMut(&Self, usize, usize),
    ) -> Vec<Result<(), ReplayDiverged>> {
        assert_eq!(lists.len(), self.count(), "one list an environment");
        for index in 0..lists.len() {
            self.reset(index);
            observe(self, index, 0);
        }
        let mut ends = vec![Ok(()); lists.len()];
        let longest = lists.iter().map(|list| list.len()).max().unwrap_or(0);
        for press in 0..longest {
            let next = |(list, end): (&&[u32], &Result<_, _>)| {
                list.get(press).copied().filter(|_| end.is_ok())
            };
            let vertices: Vec<Option<u32>> = lists.iter().zip(&ends).map(next).collect();
            let finite = self.press(&vertices);
            let presses = press + 1;
            for (index, vertex) in vertices.iter().enumerate() {
                match (vertex, finite[index]) {
                    (None, _) => {}
                    (Some(_), true) => observe(self, index, presses),
                    (Some(_), false) => ends[index] = Err(ReplayDiverged { presses }),
                }
            }
        }
        ends
    }
}
