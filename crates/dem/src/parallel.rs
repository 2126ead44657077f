//! Loops of one simulation on several threads, without the difference of a bit.
//!
//! A loop is cut into shares. Nothing is summed across shares, and what they find is put together in their order: the
//! result is that of one share, whatever the number of threads.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::DemError;

/// Threads that are made at most, on a machine with fewer cores.
const MOST_THREADS: usize = 64;

/// The threads of one simulation. Small loops, and all loops of a single thread, stay on the calling thread.
#[derive(Clone, Debug, Default)]
pub(crate) struct Threads(Option<Arc<ThreadPool>>);

impl Threads {
    /// So many threads.
    pub fn new(count: usize) -> Result<Self, DemError> {
        if count == 0 {
            return Err(DemError::range("threads", 0.0, "at least 1"));
        }
        if count == 1 {
            return Ok(Self(None));
        }
        // More threads than cores gain nothing; some more are of use in tests.
        let most = std::thread::available_parallelism().map_or(1, usize::from).max(MOST_THREADS);
        let pool = ThreadPoolBuilder::new().num_threads(count.min(most)).build();
        Ok(Self(Some(Arc::new(pool.map_err(DemError::Threads)?))))
    }

    /// Runs `work` as one of the threads: loops inside it start without waking another first.
    pub fn run<V: Send>(&self, work: impl FnOnce() -> V + Send) -> V {
        match self.0.as_deref() {
            Some(pool) => install(pool, work),
            None => work(),
        }
    }

    /// The pool, if `items` are enough for two shares.
    fn pool_for(&self, items: usize, share: usize) -> Option<&ThreadPool> {
        self.0.as_deref().filter(|_| items / 2 >= share)
    }

    /// Calls `work` for shares of `items`; returns what `join` makes of the values.
    pub fn shares<T: Send, V: Send + Default>(
        &self,
        items: &mut [T],
        share: usize,
        work: impl Fn(&mut [T]) -> V + Sync,
        join: impl Fn(V, V) -> V + Sync,
    ) -> V {
        match self.pool_for(items.len(), share) {
            None => work(items),
            Some(pool) => {
                install(pool, || items.par_chunks_mut(share).map(&work).reduce(V::default, &join))
            }
        }
    }

    /// Calls `work` for `parts` of `items`, which follow each other without a gap; returns what `join` makes of the
    /// values.
    pub fn parts<T: Send, V: Send + Default>(
        &self,
        items: &mut [T],
        parts: &[Range<usize>],
        work: impl Fn(&mut [T]) -> V + Sync,
        join: impl Fn(V, V) -> V + Sync,
    ) -> V {
        let [Some(first), Some(last)] = [parts.first(), parts.last()] else {
            return V::default();
        };
        let items = &mut items[first.start..last.end];
        let Some(pool) = self.pool_for(parts.len(), 1) else {
            return work(items);
        };
        let mut rest = items;
        let mut slices = Vec::with_capacity(parts.len());
        for part in parts {
            let (slice, after) = rest.split_at_mut(part.len());
            slices.push(slice);
            rest = after;
        }
        install(pool, || slices.into_par_iter().map(&work).reduce(V::default, &join))
    }

    /// Calls `work` for shares of `items` and appends what it finds to `found`; returns what `join` makes of the
    /// values.
    pub fn gather<T: Send, U: Send, V: Send + Default>(
        &self,
        items: &mut [T],
        share: usize,
        found: &mut Vec<U>,
        work: impl Fn(&mut [T], &mut Vec<U>) -> V + Sync,
        join: impl Fn(V, V) -> V + Sync,
    ) -> V {
        let Some(pool) = self.pool_for(items.len(), share) else {
            return work(items, found);
        };
        let of_share = |items: &mut [T]| {
            let mut found = Vec::new();
            let value = work(items, &mut found);
            (found, value)
        };
        let shares: Vec<_> = install(pool, || items.par_chunks_mut(share).map(of_share).collect());
        shares.into_iter().fold(V::default(), |all, (mut of_share, value)| {
            found.append(&mut of_share);
            join(all, value)
        })
    }

    /// Calls `work` for parts of `0..count` and appends what it finds to `found`.
    pub fn gather_ranges<U: Send>(
        &self,
        count: usize,
        share: usize,
        found: &mut Vec<U>,
        work: impl Fn(Range<usize>, &mut Vec<U>) + Sync,
    ) {
        let Some(pool) = self.pool_for(count, share) else {
            return work(0..count, found);
        };
        let of_share = |number: usize| {
            let mut found = Vec::new();
            work(number * share..count.min((number + 1) * share), &mut found);
            found
        };
        let shares = 0..count.div_ceil(share);
        let shares: Vec<_> = install(pool, || shares.into_par_iter().map(of_share).collect());
        for mut of_share in shares {
            found.append(&mut of_share);
        }
    }
}

/// Lets the pool do `work` while the calling thread sleeps.
///
/// A thread of another pool, the caller's, would not sleep: it would take up the next task of its own, another
/// simulation, which waits in its turn, one on the stack of the other. A thread between the two waits in its place.
fn install<V: Send>(pool: &ThreadPool, work: impl FnOnce() -> V + Send) -> V {
    let is_of_another =
        rayon::current_thread_index().is_some() && pool.current_thread_index().is_none();
    if !is_of_another {
        return pool.install(work);
    }
    let done = std::thread::scope(|scope| scope.spawn(|| pool.install(work)).join());
    done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pool_that_waits_takes_up_no_other_simulation() {
        let threads = Threads::new(2).unwrap();
        let outer = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let deepest = outer.install(|| {
            (0..64_usize)
                .into_par_iter()
                .map(|_| {
                    let depth = DEPTH.get() + 1;
                    DEPTH.set(depth);
                    for _ in 0..10 {
                        threads.run(|| std::thread::sleep(std::time::Duration::from_micros(200)));
                    }
                    DEPTH.set(depth - 1);
                    depth
                })
                .max()
        });
        assert_eq!(deepest, Some(1));
    }

    thread_local! {
        /// How many simulations are at work on the stack of a thread.
        static DEPTH: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
    }

    #[test]
    fn shares_are_put_together_in_their_order() {
        let mut results = Vec::new();
        for count in [1, 2, 3] {
            let threads = Threads::new(count).unwrap();
            let mut items: Vec<u64> = (0..1000).map(|n| n * 7919 % 1000).collect();
            let mut found = vec![1, 2];
            let largest = threads.gather(
                &mut items,
                64,
                &mut found,
                |items, found| {
                    for item in items.iter_mut() {
                        *item += 1;
                    }
                    found.extend(items.iter().copied().filter(|item| item % 3 == 0));
                    items.iter().copied().max().unwrap_or(0)
                },
                u64::max,
            );
            let mut odd = Vec::new();
            threads.gather_ranges(items.len(), 64, &mut odd, |range, odd| {
                odd.extend(range.filter(|&n| items[n] % 2 == 1));
            });
            let again = threads.shares(
                &mut items,
                64,
                |items| items.iter().copied().max().unwrap_or(0),
                u64::max,
            );
            assert_eq!((largest, again), (1000, 1000));
            results.push((items, found, odd));
        }
        assert_eq!(results[0], results[1]);
        assert_eq!(results[0], results[2]);
    }

    #[test]
    fn no_threads_are_refused() {
        let refused = Threads::new(0).unwrap_err();
        assert_eq!(refused.to_string(), "threads must be at least 1, got 0");
    }
}
