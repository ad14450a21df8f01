//! The threads of a tracker.

use std::{mem, process};

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::config::Config;
use crate::error::Unexpected;

/// Threads that share the work of a step.
#[derive(Debug, Default)]
pub(crate) struct Threads {
    /// `None`: the calling thread does everything.
    pool: Option<ThreadPool>,
    /// The process in which they run.
    process: u32,
}

impl Threads {
    /// Starts the threads of a configuration.
    pub(crate) fn new(config: &Config) -> Result<Self, Unexpected> {
        let refused = |error| Unexpected::new("threads", "a number of threads the system can start", error);
        let pool = started(config.threads).map_err(refused)?;
        Ok(Self { pool, process: process::id() })
    }

    /// Does `work` on every item, with its index. Each is processed by one thread, so the result does not depend on their number.
    pub(crate) fn each<T: Send>(&mut self, items: &mut [T], work: impl Fn((usize, &mut T)) + Send + Sync) {
        match self.pool() {
            Some(pool) => pool.install(|| items.par_iter_mut().enumerate().for_each(work)),
            None => items.iter_mut().enumerate().for_each(work),
        }
    }

    /// The threads, `None` for a single one. A forked process has none of its parent's threads, and waiting for them would never
    /// end: it starts its own; if the system cannot, the calling thread does everything, with the same result.
    fn pool(&mut self) -> Option<&ThreadPool> {
        if self.process != process::id() {
            if let Some(pool) = self.pool.take() {
                self.pool = started(pool.current_num_threads()).ok().flatten();
                mem::forget(pool);
            }
            self.process = process::id();
        }
        self.pool.as_ref()
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        if self.process != process::id() {
            mem::forget(self.pool.take());
        }
    }
}

fn started(count: usize) -> Result<Option<ThreadPool>, ThreadPoolBuildError> {
    match count {
        1 => Ok(None),
        count => ThreadPoolBuilder::new().num_threads(count).build().map(Some),
    }
}
