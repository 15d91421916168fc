//! Threads that come and go while a run is under way.

use plyflow_mechanics::team;
use rayon::ThreadPool;

/// Who does the steps: the threads with which the run began, or more of them while the host has processors that nothing else can use. The
/// bits of a run do not depend on it.
#[derive(Default)]
pub struct Crew {
    more: Option<ThreadPool>,
}

impl Crew {
    /// Goes on with so many threads, but no fewer than those that the run began with.
    pub fn change(&mut self, threads: usize) {
        let own = rayon::current_num_threads();
        let present = self
            .more
            .as_ref()
            .map_or(own, ThreadPool::current_num_threads);
        if threads.max(own) == present {
            return;
        }
        self.more = None;
        if threads > own {
            // Where the system has no more threads, the run goes on with its own.
            self.more = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .ok();
        }
    }

    /// Does a piece of work with all of them.
    pub fn work<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.more {
            Some(pool) => pool.install(|| team::awake(work)),
            None => work(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many threads share what a crew does.
    fn at_work(crew: &Crew) -> usize {
        crew.work(rayon::current_num_threads)
    }

    #[test]
    fn a_crew_grows_and_shrinks_but_not_below_what_it_began_with() {
        let own = rayon::ThreadPoolBuilder::new().num_threads(2);
        let own = own.build().expect("a pool");
        own.install(|| {
            let mut crew = Crew::default();
            let mut seen = vec![at_work(&crew)];
            for threads in [2, 4, 4, 3, 1, 2] {
                crew.change(threads);
                seen.push(at_work(&crew));
            }
            assert_eq!(seen, [2, 2, 4, 4, 3, 2, 2]);
        });
    }
}
