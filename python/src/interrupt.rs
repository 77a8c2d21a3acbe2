//! Work that Ctrl-C ends.

use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use nsdc::limit::Cancel;
use nsdc::project::clock::Instant;
use pyo3::prelude::*;

/// How long signals wait at most before somebody looks.
const LOOK: Duration = Duration::from_millis(20);

/// The work of one call: it is canceled where a handler of a signal raises, such as `KeyboardInterrupt`.
pub struct Interrupt {
    /// What cancels the work.
    pub cancel: Cancel,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Interrupt {
    /// That of a call on this thread; the interpreter handles signals on its main thread alone.
    pub fn new() -> Self {
        let raised = Arc::new(Mutex::new(None));
        let (caller, last) = (thread::current().id(), Mutex::new(Instant::now()));
        let heard = raised.clone();
        let ask = move || {
            if thread::current().id() != caller {
                return false;
            }
            let Ok(mut last) = last.try_lock() else {
                return false;
            };
            if last.elapsed() < LOOK {
                return false;
            }
            *last = Instant::now();
            let Err(error) = Python::attach(|py| py.check_signals()) else {
                return false;
            };
            if let Ok(mut heard) = heard.lock() {
                *heard = Some(error);
            }
            true
        };
        Interrupt {
            cancel: Cancel::asking(ask),
            raised,
        }
    }

    /// Tells a function of Python how many of something are done, now and then; work ends where it raises.
    pub fn telling<'i>(&'i self, heard: Option<&'i Py<PyAny>>) -> impl FnMut(usize) + 'i {
        let mut last = Instant::now();
        move |done| {
            let Some(heard) = heard.filter(|_| last.elapsed() >= LOOK) else {
                return;
            };
            last = Instant::now();
            if let Err(error) = Python::attach(|py| heard.call1(py, (done,))) {
                if let Ok(mut raised) = self.raised.lock() {
                    *raised = Some(error);
                }
                self.cancel.cancel();
            }
        }
    }

    /// Raises what a handler has raised.
    ///
    /// # Errors
    ///
    /// That.
    pub fn check(&self) -> PyResult<()> {
        let raised = self.raised.lock().ok().and_then(|mut raised| raised.take());
        raised.map_or(Ok(()), Err)
    }
}
