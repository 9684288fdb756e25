//! Parallel execution of independent work.
//!
//! Results are in the order of the items, so that nothing depends on the number of cores. A panic in a worker becomes a panic of the
//! caller, so that no result is lost.

use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Applies `work` to every item on rayon's pool: one thread per core, unless the program or `RAYON_NUM_THREADS` sets another number.
/// Calls may be nested.
///
/// A worker that waits for a nested call may start another item. Use [`try_map_on`] for long work with a limited number of concurrent
/// items.
pub fn map<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    items.par_iter().with_max_len(1).map(&work).collect()
}

/// Like [`map`], with work that may fail. After a failure no later item is started. Earlier items are still finished, so that the returned error
/// is that of the first failing item for any number of cores.
pub fn try_map<T, R, E>(items: &[T], work: impl Fn(&T) -> Result<R, E> + Sync) -> Result<Vec<R>, E>
where
    T: Sync,
    R: Send,
    E: Send,
{
    let failed = AtomicUsize::new(items.len());
    let run = |(index, item)| {
        if index > failed.load(Ordering::Relaxed) {
            return None;
        }
        let result = work(item);
        if result.is_err() {
            failed.fetch_min(index, Ordering::Relaxed);
        }
        Some(result)
    };
    // Items without a result come after a failure.
    let results: Vec<Option<Result<R, E>>> = items.par_iter().enumerate().with_max_len(1).map(run).collect();
    results.into_iter().flatten().collect()
}

/// Like [`try_map`], with at most `threads` items at a time (at least 1) on dedicated threads: for work that takes long, needs much
/// memory or is itself parallel. `work` also gets the index of the item.
pub fn try_map_on<T, R, E>(
    threads: usize,
    items: &[T],
    work: impl Fn(usize, &T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E>
where
    T: Sync,
    R: Send,
    E: Send,
{
    let next = AtomicUsize::new(0);
    let failed = AtomicUsize::new(items.len());
    let results: Mutex<Vec<(usize, Result<R, E>)>> = Mutex::new(Vec::with_capacity(items.len()));
    let run = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { return };
            if index > failed.load(Ordering::Relaxed) {
                return;
            }
            let result = catch_unwind(AssertUnwindSafe(|| work(index, item))).unwrap_or_else(|panic| {
                // Start no other item.
                next.store(items.len(), Ordering::Relaxed);
                resume_unwind(panic)
            });
            if result.is_err() {
                failed.fetch_min(index, Ordering::Relaxed);
            }
            results.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
        }
    };
    // Not rayon: one of its workers that waits for nested work would start another item and hold two.
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.clamp(1, items.len().max(1))).map(|_| scope.spawn(run)).collect();
        for worker in workers {
            if let Err(panic) = worker.join() {
                resume_unwind(panic);
            }
        }
    });
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Runs `work` with at most `threads` threads for all its calls of [`map`] and [`try_map`], for long tasks that share the cores. If no
/// threads can be started, `work` uses those of the whole program.
pub fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Never more at a time than allowed, and the results are those of any number.
    #[test]
    fn work_with_threads_uses_only_these() {
        let items: Vec<u64> = (0..200).collect();
        let (at_once, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let one = |i: &u64| {
            most.fetch_max(at_once.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            let result = (0..20_000).fold(*i, |sum, x| sum ^ (x * x));
            at_once.fetch_sub(1, Ordering::SeqCst);
            result
        };
        let found = with_threads(1, || map(&items, one));
        assert_eq!(most.load(Ordering::SeqCst), 1);
        assert_eq!(found, map(&items, one));
    }

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..1000).collect();
        // Early items take longest.
        let slow = |i: &u64| (0..(1000 - i) * 50).fold(*i, |sum, x| sum ^ (x * x)) ^ i;
        let expected: Vec<u64> = items.iter().map(slow).collect();
        assert_eq!(map(&items, slow), expected);
        assert_eq!(try_map(&items, |i| Ok::<_, ()>(slow(i))).unwrap(), expected);
        assert_eq!(try_map_on(3, &items, |_, i| Ok::<_, ()>(slow(i))).unwrap(), expected);
        assert!(map(&[], |_: &u64| 0).is_empty());
        assert!(try_map_on(0, &[], |_, _: &u64| Ok::<u64, ()>(0)).unwrap().is_empty());
    }

    #[test]
    fn calls_may_be_nested() {
        let inner = |i: &u64| map(&[1, 2, 3], |j| i * j).into_iter().sum::<u64>();
        assert_eq!(map(&[1, 10, 100], inner), [6, 60, 600]);
        assert_eq!(try_map_on(2, &[1, 10, 100], |_, i| Ok::<_, ()>(inner(i))).unwrap(), [6, 60, 600]);
    }

    #[test]
    fn the_first_error_in_the_order_of_the_items_is_reported() {
        let items: Vec<usize> = (0..500).collect();
        let work = |i: &usize| if i % 100 == 37 { Err(*i) } else { Ok(*i) };
        for _ in 0..20 {
            assert_eq!(try_map(&items, work), Err(37));
            assert_eq!(try_map_on(4, &items, |_, i| work(i)), Err(37));
        }
    }

    #[test]
    fn nothing_is_begun_after_a_failure() {
        let begun = AtomicUsize::new(0);
        let items = [0; 100];
        let found: Result<Vec<()>, &str> = try_map_on(1, &items, |index, _| {
            begun.fetch_add(1, Ordering::Relaxed);
            if index == 4 { Err("stopped") } else { Ok(()) }
        });
        assert_eq!((found, begun.into_inner()), (Err("stopped"), 5));
    }

    #[test]
    fn a_panic_of_a_worker_is_a_panic_of_the_caller() {
        let items: Vec<u32> = (0..64).collect();
        let work = |i: &u32| {
            assert_ne!(*i, 40, "the fortieth");
            *i
        };
        for panicked in [
            catch_unwind(AssertUnwindSafe(|| map(&items, work).len())),
            catch_unwind(AssertUnwindSafe(|| try_map(&items, |i| Ok::<_, ()>(work(i))).unwrap().len())),
            catch_unwind(AssertUnwindSafe(|| {
                try_map_on(3, &items, |_, i| Ok::<_, ()>(work(i))).unwrap().len()
            })),
        ] {
            let message = panicked.unwrap_err();
            assert!(message.downcast_ref::<String>().unwrap().contains("the fortieth"));
        }
    }
}
