//! How long work may go on: until its time is up, or until somebody cancels it.
//!
//! Work looks at its limit between pieces of it that are short; the cost of what lies between two looks is counted in
//! development builds ([`work`]), where tests bound it.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::runtime::clock::Instant;

/// Cancels work from elsewhere: its copies cancel the same work.
///
/// ```
/// use nsd_solver::runtime::limit::{Cancel, Limit, Over};
///
/// let cancel = Cancel::default();
/// let limit = Limit::default().canceled_by(&cancel);
/// assert_eq!(limit.over(), None);
/// cancel.clone().cancel();
/// assert_eq!(limit.over(), Some(Over::Canceled));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<Source>);

/// Where it comes from that work is canceled.
#[derive(Default)]
struct Source {
    is_canceled: AtomicBool,
    ask: Option<Box<dyn Fn() -> bool + Send + Sync>>,
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.is_canceled.fmt(f)
    }
}

/// Those are equal that cancel the same work.
impl PartialEq for Cancel {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Cancel {
    /// One that asks, too, wherever work looks at it: that is often, in the midst of steps, and on every thread that works at
    /// once, so that who is asked has to answer soon and wait for nobody.
    ///
    /// ```
    /// use std::sync::atomic::{AtomicUsize, Ordering};
    /// use nsd_solver::runtime::limit::Cancel;
    ///
    /// let looks = AtomicUsize::new(0);
    /// let cancel = Cancel::asking(move || looks.fetch_add(1, Ordering::Relaxed) == 1);
    /// assert_eq!([cancel.is_canceled(), cancel.is_canceled()], [false, true]);
    /// // It stays so.
    /// assert!(cancel.is_canceled());
    /// ```
    pub fn asking(ask: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Cancel(Arc::new(Source {
            ask: Some(Box::new(ask)),
            ..Source::default()
        }))
    }

    /// Ends the work, now and whenever it is tried again.
    pub fn cancel(&self) {
        self.0.is_canceled.store(true, Ordering::Relaxed);
    }

    /// Whether that was called, or who is asked says so.
    pub fn is_canceled(&self) -> bool {
        let Source { is_canceled, ask } = &*self.0;
        if !is_canceled.load(Ordering::Relaxed) && ask.as_ref().is_some_and(|ask| ask()) {
            self.cancel();
        }
        is_canceled.load(Ordering::Relaxed)
    }
}

/// How long work may go on; by itself, without end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limit {
    end: Option<Instant>,
    cancel: Option<Cancel>,
}

/// Why work has to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// The time is up.
    TimeLimit,
    /// Somebody has canceled it.
    Canceled,
}

impl Limit {
    /// So long from now on.
    pub fn within(time: Duration) -> Self {
        Limit::default().sooner(time)
    }

    /// The same, and no longer than so long from now on.
    pub fn sooner(&self, time: Duration) -> Self {
        let own = Instant::now().checked_add(time);
        let end = match (self.end, own) {
            (Some(end), Some(own)) if end < own => Some(end),
            (end, own) => own.or(end),
        };
        let cancel = self.cancel.clone();
        Limit { end, cancel }
    }

    /// The same, and until `cancel` is called.
    pub fn canceled_by(self, cancel: &Cancel) -> Self {
        let cancel = Some(cancel.clone());
        Limit { cancel, ..self }
    }

    /// What asks, on whatever thread waits for others, who may end the work, and ends nothing by itself: work that goes on under
    /// this limit hears of it.
    pub fn asked(&self) -> Cancel {
        let cancel = self.cancel.clone();
        Cancel::asking(move || {
            if let Some(cancel) = &cancel {
                cancel.is_canceled();
            }
            false
        })
    }

    /// The time that is left, where it is limited.
    pub fn left(&self) -> Option<Duration> {
        let end = self.end?;
        Some(end.saturating_duration_since(Instant::now()))
    }

    /// Whether work has to end here, and why.
    pub fn over(&self) -> Option<Over> {
        let is_late = || self.end.is_some_and(|end| Instant::now() >= end);
        self.canceled()
            .or_else(|| is_late().then_some(Over::TimeLimit))
    }

    /// Goes on, or says why not.
    ///
    /// # Errors
    ///
    /// Where work has to end here.
    pub fn check(&self) -> Result<(), Over> {
        self.over().map_or(Ok(()), Err)
    }

    /// Whether work has to end here.
    pub fn is_over(&self) -> bool {
        self.over().is_some()
    }

    /// Whether somebody has canceled the work, for what is too short to look at the clock.
    pub fn canceled(&self) -> Option<Over> {
        work::look();
        let is_canceled = self.cancel.as_ref().is_some_and(Cancel::is_canceled);
        is_canceled.then_some(Over::Canceled)
    }
}

impl From<Option<Duration>> for Limit {
    fn from(time: Option<Duration>) -> Self {
        time.map_or_else(Limit::default, Limit::within)
    }
}

pub mod work {
    //! Work in operations on numbers: what tapes, series, factorizations and solutions of linear systems do, as far as
    //! their sizes say it. Counted on each thread of development builds where somebody asks for it, and nowhere else.

    #[cfg(debug_assertions)]
    use std::cell::RefCell;
    #[cfg(debug_assertions)]
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::Cancel;

    /// Whether anything is counted: other builds of tests are to cost what they do without.
    #[cfg(debug_assertions)]
    static COUNTS_WORK: AtomicBool = AtomicBool::new(false);

    /// What is counted on a thread.
    #[derive(Clone, Debug, Default)]
    pub struct Counts {
        /// All operations.
        pub total: u64,
        /// The most between two looks at a limit, or before the first.
        pub most: u64,
        /// Looks at a limit.
        pub looks: u64,
        /// Operations when a limit was looked at last.
        #[cfg(debug_assertions)]
        last: u64,
        /// Who is canceled once there were so many operations.
        #[cfg(debug_assertions)]
        canceled: Option<(u64, Cancel)>,
    }

    #[cfg(debug_assertions)]
    thread_local! {
        static COUNTS: RefCell<Counts> = RefCell::default();
    }

    /// So many operations are done.
    #[inline]
    pub fn add(_operations: usize) {
        #[cfg(debug_assertions)]
        if COUNTS_WORK.load(Ordering::Relaxed) {
            count(_operations as u64);
        }
    }

    #[cfg(debug_assertions)]
    #[cold]
    fn count(operations: u64) {
        COUNTS.with_borrow_mut(|counts| {
            counts.total += operations;
            if let Some((_, cancel)) = counts.canceled.take_if(|(at, _)| *at <= counts.total) {
                cancel.cancel();
            }
        });
    }

    /// A limit is looked at.
    #[inline]
    pub(crate) fn look() {
        #[cfg(debug_assertions)]
        if COUNTS_WORK.load(Ordering::Relaxed) {
            COUNTS.with_borrow_mut(|counts| {
                counts.most = counts.most.max(counts.total - counts.last);
                counts.last = counts.total;
                counts.looks += 1;
            });
        }
    }

    /// Whether anything is counted, which has to be on one thread.
    pub(crate) fn is_counted() -> bool {
        #[cfg(debug_assertions)]
        return COUNTS_WORK.load(Ordering::Relaxed);
        #[cfg(not(debug_assertions))]
        false
    }

    /// The counts of this thread since the last call, where there are any. With somebody who is canceled after so many
    /// operations they begin anew, without they end.
    pub fn restart(_cancel: Option<(u64, Cancel)>) -> Option<Counts> {
        #[cfg(debug_assertions)]
        return Some(COUNTS.with_borrow_mut(|counts| {
            COUNTS_WORK.store(_cancel.is_some(), Ordering::Relaxed);
            let mut found = std::mem::take(counts);
            counts.canceled = _cancel;
            found.most = found.most.max(found.total - found.last);
            found
        }));
        #[cfg(not(debug_assertions))]
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sooner_of_two_ends_counts() {
        let hour = Duration::from_secs(3600);
        let left = |limit: &Limit| limit.left().expect("it is limited");
        let long = Limit::within(2 * hour);
        assert!(left(&long) > hour && left(&long.sooner(hour)) <= hour);
        let short = Limit::within(Duration::ZERO);
        assert_eq!(short.sooner(hour).over(), Some(Over::TimeLimit));
        assert_eq!(Limit::within(Duration::MAX).left(), None);
        assert_eq!(Limit::from(None).over(), None);
    }

    #[test]
    fn work_is_counted_between_looks() {
        let cancel = Cancel::default();
        let limit = Limit::default().canceled_by(&cancel);
        work::restart(Some((14, cancel.clone())));
        let mut over = Vec::new();
        for operations in [3, 5, 4] {
            work::add(operations);
            work::add(1);
            over.push(limit.over());
        }
        work::add(2);
        if let Some(counts) = work::restart(None) {
            assert_eq!((counts.total, counts.most, counts.looks), (17, 6, 3));
            assert_eq!(over, [None, None, Some(Over::Canceled)]);
        }
    }
}
