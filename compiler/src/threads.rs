//! The one source of threads: work that is done in any order, and told in that of its numbers.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

/// How many go on at once: one on every core.
pub fn count() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// What one thread does of it.
pub struct Share<'s, T> {
    next: &'s AtomicUsize,
    stop: &'s AtomicBool,
    count: usize,
    done: mpsc::Sender<(usize, T)>,
}

impl<T> Share<'_, T> {
    /// The number of what is to be done next; none where nothing is left, or work was stopped.
    pub fn next(&self) -> Option<usize> {
        if self.stop.load(Ordering::Relaxed) {
            return None;
        }
        let next = self.next.fetch_add(1, Ordering::Relaxed);
        (next < self.count).then_some(next)
    }

    /// Hands on what has come of a number.
    pub fn finish(&self, number: usize, result: T) {
        // Somebody listens until all threads have ended.
        let _ = self.done.send((number, result));
    }
}

/// Lets up to `n_threads` threads do `count` pieces of work, each as much as it gets to. What has come of them is in the
/// order of their numbers, nothing of those that were not begun when it was stopped. `heard` is told how many are done.
pub fn in_order<T: Send>(
    count: usize,
    n_threads: usize,
    stop: &AtomicBool,
    work: impl Fn(Share<'_, T>) + Sync,
    heard: &mut dyn FnMut(usize),
) -> Vec<Option<T>> {
    let next = AtomicUsize::new(0);
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    thread::scope(|scope| {
        let (sender, found) = mpsc::channel();
        for _ in 0..n_threads.clamp(1, count.max(1)) {
            let share = Share {
                next: &next,
                stop,
                count,
                done: sender.clone(),
            };
            let work = &work;
            scope.spawn(move || work(share));
        }
        drop(sender);
        for (done, (number, result)) in found.into_iter().enumerate() {
            results[number] = Some(result);
            heard(done + 1);
        }
    });
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_have_the_order_of_their_numbers() {
        let work = |share: Share<'_, usize>| {
            while let Some(k) = share.next() {
                share.finish(k, k * k);
            }
        };
        for n_threads in [1, 3, 100] {
            let mut heard = Vec::new();
            let stop = AtomicBool::new(false);
            let found = in_order(20, n_threads, &stop, work, &mut |done| heard.push(done));
            assert_eq!(found, (0..20).map(|k| Some(k * k)).collect::<Vec<_>>());
            assert_eq!(heard, (1..=20).collect::<Vec<_>>());
        }
        assert!(in_order(0, 2, &AtomicBool::new(false), work, &mut |_| {}).is_empty());
    }

    /// What is begun is finished, and no other is begun.
    #[test]
    fn work_is_stopped() {
        let stop = AtomicBool::new(false);
        let work = |share: Share<'_, ()>| {
            while let Some(k) = share.next() {
                stop.store(k == 4, Ordering::Relaxed);
                share.finish(k, ());
            }
        };
        let found = in_order(1000, 1, &stop, work, &mut |_| {});
        assert_eq!(found.iter().flatten().count(), 5);
        assert!(found[..5].iter().all(Option::is_some));
    }
}
