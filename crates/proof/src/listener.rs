use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

/// Is told the share of long work that is done, 0 to 1, and what is being done.
#[derive(Clone, Copy)]
pub struct Listener<'a>(pub &'a (dyn Fn(f64, &str) + Sync));

impl Listener<'static> {
    /// Tells nobody.
    pub const QUIET: Self = Self(&|_, _| ());
}

impl Listener<'_> {
    pub fn tell(&self, share: f64, doing: &str) {
        (self.0)(share, doing);
    }

    /// Tells of `done` of `all`.
    pub fn count(&self, done: usize, all: usize, doing: &str) {
        self.tell(done as f64 / all as f64, doing);
    }

    /// Runs every case in parallel, one by one as threads get free: they may differ in cost a
    /// thousandfold. Results are in the order of the cases.
    pub fn each<C: Sync, R: Send>(&self, cases: &[C], run: impl Fn(&C) -> R + Sync) -> Vec<R> {
        let (done, all) = (AtomicUsize::new(0), cases.len());
        let run = |case: &C| {
            let result = run(case);
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            self.count(done, all, &format!("{done} of {all}"));
            result
        };
        cases.par_iter().with_max_len(1).map(run).collect()
    }
}
