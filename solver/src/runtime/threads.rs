//! The one source of threads: work that is done in any order, and told in that of its numbers.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, Thread};
use std::time::Duration;

use crate::runtime::limit::Cancel;
use crate::runtime::limit::work::is_counted;

/// Whether the target has threads: where it has none, `std` panics.
const THREADS: bool = !cfg!(all(target_family = "wasm", target_os = "unknown"));

/// How long the thread of the caller waits before it takes results, and asks whether work is canceled, which others may not
/// know. It is not woken by each result, which costs microseconds: some results take no longer.
const LOOK: Duration = Duration::from_millis(2);

/// How many go on at once: one on every core.
#[expect(
    clippy::disallowed_methods,
    reason = "this is the one source of threads"
)]
pub fn count() -> usize {
    match THREADS {
        true => thread::available_parallelism().map_or(1, usize::from),
        false => 1,
    }
}

/// What one thread does of it.
#[derive(Debug)]
pub struct Share<'s, T> {
    next: &'s AtomicUsize,
    stop: &'s Cancel,
    count: usize,
    done: &'s Done<T>,
}

/// What has come of numbers, until somebody takes it.
#[derive(Debug)]
struct Done<T>(Mutex<Vec<(usize, T)>>);

impl<T> Done<T> {
    fn add(&self, number: usize, result: T) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.push((number, result));
    }

    fn take(&self) -> Vec<(usize, T)> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *all)
    }
}

/// A thread that works; whoever waits hears when it ends, in a panic, too.
struct Worker<'w> {
    left: &'w AtomicUsize,
    waiting: Thread,
}

impl Drop for Worker<'_> {
    fn drop(&mut self) {
        self.left.fetch_sub(1, Ordering::Release);
        self.waiting.unpark();
    }
}

impl<T> Share<'_, T> {
    /// The number of what is to be done next; none where nothing is left, or work was stopped.
    pub fn next(&self) -> Option<usize> {
        if self.stop.is_canceled() {
            return None;
        }
        let next = self.next.fetch_add(1, Ordering::Relaxed);
        (next < self.count).then_some(next)
    }

    /// Hands on what has come of a number.
    pub fn finish(&self, number: usize, result: T) {
        self.done.add(number, result);
    }
}

/// Lets up to `n_threads` threads do `count` pieces of work, each as much as it gets to. What has come of them is in the
/// order of their numbers, nothing of those that were not begun when it was stopped. `heard` is told how many are done.
pub fn in_order<T: Send>(
    count: usize,
    n_threads: usize,
    stop: &Cancel,
    work: impl Fn(Share<'_, T>) + Sync,
    heard: &mut dyn FnMut(usize),
) -> Vec<Option<T>> {
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    let mut done = 0;
    share_out(count, n_threads, stop, work, &mut |number, result| {
        results[number] = Some(result);
        done += 1;
        heard(done);
    });
    results
}

/// The same, which hands what has come of each number to `heard` soon behind it.
#[expect(
    clippy::disallowed_methods,
    reason = "this is the one source of threads"
)]
pub fn share_out<T: Send>(
    count: usize,
    n_threads: usize,
    stop: &Cancel,
    work: impl Fn(Share<'_, T>) + Sync,
    heard: &mut dyn FnMut(usize, T),
) {
    let (next, done) = (AtomicUsize::new(0), Done(Mutex::default()));
    let share = || Share {
        next: &next,
        stop,
        count,
        done: &done,
    };
    if !THREADS || is_counted() {
        alone(share(), work, heard);
        return;
    }
    let n_threads = n_threads.clamp(1, count.max(1));
    let left = AtomicUsize::new(n_threads);
    thread::scope(|scope| {
        for _ in 0..n_threads {
            let worker = Worker {
                left: &left,
                waiting: thread::current(),
            };
            let (share, work) = (share(), &work);
            scope.spawn(move || {
                let _worker = worker;
                work(share);
            });
        }
        // Where one has panicked, the scope passes that on.
        loop {
            let is_over = left.load(Ordering::Acquire) == 0;
            for (number, result) in done.take() {
                heard(number, result);
            }
            if is_over {
                break;
            }
            stop.is_canceled();
            thread::park_timeout(LOOK);
        }
    });
}

/// All of it in the thread of the caller.
fn alone<T>(share: Share<'_, T>, work: impl Fn(Share<'_, T>), heard: &mut dyn FnMut(usize, T)) {
    let done = share.done;
    work(share);
    for (number, result) in done.take() {
        heard(number, result);
    }
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
            let stop = Cancel::default();
            let found = in_order(20, n_threads, &stop, work, &mut |done| heard.push(done));
            assert_eq!(found, (0..20).map(|k| Some(k * k)).collect::<Vec<_>>());
            assert_eq!(heard, (1..=20).collect::<Vec<_>>());
        }
        assert!(in_order(0, 2, &Cancel::default(), work, &mut |_| {}).is_empty());
    }

    /// Where there are no threads, the caller's does it all.
    #[test]
    fn work_needs_no_threads() {
        let (next, stop) = (AtomicUsize::new(0), Cancel::default());
        let done = Done(Mutex::default());
        let share = Share {
            next: &next,
            stop: &stop,
            count: 3,
            done: &done,
        };
        let work = |share: Share<'_, usize>| {
            while let Some(k) = share.next() {
                share.finish(k, k + 10);
            }
        };
        let mut heard = Vec::new();
        alone(share, work, &mut |k, result| heard.push((k, result)));
        assert_eq!(heard, [(0, 10), (1, 11), (2, 12)]);
    }

    /// Somebody who only knows on the thread of the caller is asked there, however soon results follow each other.
    #[test]
    fn the_caller_is_asked() {
        let caller = thread::current().id();
        let stop = Cancel::asking(move || thread::current().id() == caller);
        let work = |share: Share<'_, ()>| {
            while let Some(k) = share.next() {
                share.finish(k, ());
                thread::yield_now();
            }
        };
        let count = 10_000_000;
        let found = in_order(count, 2, &stop, work, &mut |_| {});
        assert!(found.iter().flatten().count() < count);
    }

    /// A panic of one thread is one of the caller, once all others have ended.
    #[test]
    fn a_panic_is_passed_on() {
        let work = |share: Share<'_, ()>| {
            while let Some(k) = share.next() {
                assert_ne!(k, 2);
                share.finish(k, ());
            }
        };
        let ended =
            std::panic::catch_unwind(|| in_order(10, 2, &Cancel::default(), work, &mut |_| {}));
        assert!(ended.is_err());
    }

    /// What is begun is finished, and no other is begun.
    #[test]
    fn work_is_stopped() {
        let stop = Cancel::default();
        let work = |share: Share<'_, ()>| {
            while let Some(k) = share.next() {
                if k == 4 {
                    stop.cancel();
                }
                share.finish(k, ());
            }
        };
        let found = in_order(1000, 1, &stop, work, &mut |_| {});
        assert_eq!(found.iter().flatten().count(), 5);
        assert!(found[..5].iter().all(Option::is_some));
    }
}
