//! Ctrl-C while the interpreter is released.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How long a signal waits at most. Asking takes the interpreter's lock, so not at every call.
const PERIOD: Duration = Duration::from_millis(50);

/// Asks Python for signals now and then, and keeps the exception that one raised.
pub(crate) struct Watch {
    last: Cell<Option<Instant>>,
    raised: RefCell<Option<PyErr>>,
}

impl Watch {
    /// A watch that has not asked yet.
    pub(crate) fn new() -> Self {
        Self { last: Cell::new(None), raised: RefCell::new(None) }
    }

    /// Whether to go on. `report` runs with the interpreter's lock each time that signals are asked for.
    pub(crate) fn keep_going(&self, report: impl FnOnce(Python<'_>) -> PyResult<()>) -> bool {
        if self.raised.borrow().is_some() {
            return false;
        }
        let now = Instant::now();
        if self.last.get().is_some_and(|last| now.duration_since(last) < PERIOD) {
            return true;
        }
        self.last.set(Some(now));
        let asked = Python::attach(|py| {
            py.check_signals()?;
            report(py)
        });
        let fine = asked.is_ok();
        *self.raised.borrow_mut() = asked.err();
        fine
    }

    /// The exception of a signal or of `report`, if there was one.
    pub(crate) fn finish(self) -> PyResult<()> {
        self.raised.into_inner().map_or(Ok(()), Err)
    }
}
