//! What a sweep has come to.

use nsdc::sweep;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::arrays;
use crate::interrupt::Interrupt;

/// The rows of a sweep, as columns.
#[pyclass(frozen, module = "nsdc._core")]
pub struct Rows {
    rows: sweep::Rows,
    /// States and outputs at the end, row by row; NaN where there is none.
    ends: Vec<f64>,
    /// Whether a user has ended it before its end.
    #[pyo3(get)]
    is_interrupted: bool,
}

impl Rows {
    /// What a call has come to; Ctrl-C keeps what is finished.
    ///
    /// # Errors
    ///
    /// What a handler of another signal, or who is told of the progress, has raised.
    pub fn new(rows: sweep::Rows, interrupt: Interrupt) -> PyResult<Self> {
        let raised = interrupt.check().err();
        let is_interrupted = Python::attach(|py| match raised {
            Some(error) if !error.is_instance_of::<PyKeyboardInterrupt>(py) => Err(error),
            raised => Ok(raised.is_some()),
        })?;
        let n = rows.columns.len();
        let ends = rows.rows.iter().flat_map(|row| {
            let end = row.as_ref().map_or(&[][..], |row| &row.end);
            let missing = n - end.len().min(n);
            end.iter()
                .copied()
                .take(n)
                .chain(std::iter::repeat_n(f64::NAN, missing))
        });
        Ok(Rows {
            ends: ends.collect(),
            is_interrupted,
            rows,
        })
    }

    fn column<T: numpy::Element>(
        &self,
        py: Python<'_>,
        of: impl Fn(&nsdc::study::sweep::Row) -> T,
        missing: T,
    ) -> Py<PyArray1<T>> {
        let rows = self.rows.rows.iter();
        let values: Vec<T> = rows
            .map(|row| row.as_ref().map_or_else(|| missing.clone_ref(py), &of))
            .collect();
        PyArray1::from_vec(py, values).unbind()
    }
}

#[pymethods]
impl Rows {
    /// The names of the columns of `ends`.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.rows.columns.clone()
    }

    /// States and outputs at the end, a row for each run.
    #[getter]
    fn ends<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let rows = &this.get().rows;
        let shape = [rows.rows.len(), rows.columns.len()];
        arrays::view(this, &shape, |this| &this.ends)
    }

    /// How each ended: none where there was no run, `refused` where the experiment does not compile with its values.
    #[getter]
    fn status(&self) -> Vec<Option<&'static str>> {
        let rows = self.rows.rows.iter();
        let word = |row: &nsdc::study::sweep::Row| row.status.map_or("refused", |s| s.as_str());
        rows.map(|row| row.as_ref().map(word)).collect()
    }

    /// The code of why each did not end as it should, or of its first warning.
    #[getter]
    fn codes(&self) -> Vec<Option<&str>> {
        let rows = self.rows.rows.iter();
        rows.map(|row| row.as_ref()?.code.as_deref()).collect()
    }

    /// How many events there were; -1 where there was no run.
    #[getter]
    fn events(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.column(py, |row| row.events as i64, -1)
    }

    /// Estimates of the errors.
    #[getter]
    fn error_estimates(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.column(py, |row| row.error_estimate.unwrap_or(f64::NAN), f64::NAN)
    }

    /// Values of costs.
    #[getter]
    fn objectives(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.column(py, |row| row.objective.unwrap_or(f64::NAN), f64::NAN)
    }

    /// How many expectations of the experiment do not hold; -1 where it has none, or the run did not come to its end.
    #[getter]
    fn missed(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.column(py, |row| row.missed.map_or(-1, |missed| missed as i64), -1)
    }
}
