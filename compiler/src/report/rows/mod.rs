//! Rows of a run: instants with the values of what is reported there.
//!
//! A run knows its points and polynomials. Rows follow from them, and are made when somebody first reads them: a run of
//! which only the end is asked for has none.

pub(crate) mod curve;

use std::fmt::Debug;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::Samples;

/// What rows follow from.
pub(crate) trait Course: Debug + Send + Sync {
    /// All rows.
    fn rows(&self) -> Samples;
    /// The last of them alone; none where it depends on all others.
    fn end(&self) -> Option<Samples>;
}

/// The samples of a run, which are made when they are first read, once for all threads.
#[derive(Debug, Default)]
pub struct Rows {
    made: OnceLock<Samples>,
    /// Until they are made.
    course: Mutex<Option<Arc<dyn Course>>>,
}

impl Rows {
    /// Those that follow from something.
    pub(crate) fn of(course: impl Course + 'static) -> Self {
        Rows {
            made: OnceLock::new(),
            course: Mutex::new(Some(Arc::new(course))),
        }
    }

    /// The last row alone, for which no other is made; none where there is none.
    pub fn end(&self) -> Samples {
        let course = self.course().clone();
        let alone = course.and_then(|course| course.end());
        alone.unwrap_or_else(|| self.last())
    }

    fn course(&self) -> MutexGuard<'_, Option<Arc<dyn Course>>> {
        self.course.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl From<Samples> for Rows {
    fn from(samples: Samples) -> Self {
        Rows {
            made: samples.into(),
            course: Mutex::default(),
        }
    }
}

impl Clone for Rows {
    fn clone(&self) -> Self {
        let course = self.course().clone();
        match course {
            None => Samples::clone(self).into(),
            Some(_) => Rows {
                made: OnceLock::new(),
                course: Mutex::new(course),
            },
        }
    }
}

impl Deref for Rows {
    type Target = Samples;

    fn deref(&self) -> &Samples {
        self.made.get_or_init(|| {
            // It is there until its rows are made: should that panic, the next who reads them tries again.
            let course = self.course().clone();
            let rows = course.map_or_else(Samples::default, |course| course.rows());
            self.course().take();
            rows
        })
    }
}

impl DerefMut for Rows {
    fn deref_mut(&mut self) -> &mut Samples {
        let _ = Rows::deref(self);
        self.made.get_mut().expect("they have been made")
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::{Course, Rows, Samples};
    use crate::limit::Cancel;
    use crate::threads::{Share, in_order};

    /// Counts how often its rows are made.
    #[derive(Debug)]
    struct Counted(Arc<AtomicUsize>);

    impl Course for Counted {
        fn rows(&self) -> Samples {
            self.0.fetch_add(1, Ordering::Relaxed);
            let time = vec![0.0, 0.5, 1.0];
            Samples {
                time,
                ..Samples::default()
            }
        }

        fn end(&self) -> Option<Samples> {
            Some(Samples {
                time: vec![1.0],
                ..Samples::default()
            })
        }
    }

    /// Panics the first time.
    #[derive(Debug)]
    struct Panics(AtomicUsize);

    impl Course for Panics {
        fn rows(&self) -> Samples {
            let before = self.0.fetch_add(1, Ordering::Relaxed);
            assert!(before > 0, "on purpose");
            Counted(Arc::default()).rows()
        }

        fn end(&self) -> Option<Samples> {
            None
        }
    }

    #[test]
    fn rows_are_there_behind_a_panic() {
        let rows = Rows::of(Panics(AtomicUsize::new(0)));
        let read = AssertUnwindSafe(|| rows.time.len());
        assert!(catch_unwind(read).is_err());
        assert_eq!((rows.time.len(), rows.end().time), (3, vec![1.0]));
    }

    #[test]
    fn rows_are_made_once_and_not_for_the_end() {
        let count = Arc::new(AtomicUsize::new(0));
        let rows = Rows::of(Counted(count.clone()));
        assert_eq!(
            (rows.end().time, count.load(Ordering::Relaxed)),
            (vec![1.0], 0)
        );
        let copy = rows.clone();
        let read = |share: Share<'_, usize>| {
            while let Some(k) = share.next() {
                share.finish(k, rows.time.len());
            }
        };
        let lengths = in_order(4, 4, &Cancel::default(), read, &mut |_| {});
        assert_eq!(lengths, [Some(3); 4]);
        assert_eq!(count.load(Ordering::Relaxed), 1);
        assert_eq!((rows.end().time, rows.clone().time.len()), (vec![1.0], 3));
        let mut copy = copy;
        copy.time.push(2.0);
        assert_eq!(
            (copy.end().time, count.load(Ordering::Relaxed)),
            (vec![2.0], 2)
        );
    }
}
