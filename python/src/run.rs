//! What came of a run.

use nsdc::report::{Samples, Sensitivity, Series};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{detached, told};

/// What came of a run: numbers that Python sees where they are.
#[pyclass(frozen, module = "nsdc._core")]
pub struct Run {
    run: nsdc::Run,
}

impl From<nsdc::Run> for Run {
    fn from(run: nsdc::Run) -> Self {
        Run { run }
    }
}

impl Run {
    /// The trajectory.
    pub fn trajectory(&self) -> &nsdc::report::Trajectory {
        &self.run.trajectory
    }

    /// The rows, which are made where nobody has read them yet.
    fn rows(&self) -> &Samples {
        &self.run.trajectory.samples
    }

    /// The derivatives of what stands at this place among states, outputs and controls.
    fn derivative(&self, direction: usize, place: usize) -> Option<&Series> {
        let Sensitivity {
            states, outputs, ..
        } = self.rows().sensitivities.get(direction)?;
        states.iter().chain(outputs).nth(place)
    }
}

#[pymethods]
impl Run {
    /// All but what has a value at each instant, as JSON.
    fn summary(&self, py: Python<'_>) -> PyResult<String> {
        detached(py, || self.run.summary())
    }

    /// As `nsdc run --json` writes it.
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        detached(py, || self.run.json())
    }

    /// As `nsdc run --csv` writes it.
    fn csv(&self, py: Python<'_>) -> PyResult<String> {
        detached(py, || self.run.csv())
    }

    /// As `nsdc run` prints it.
    fn text(&self, py: Python<'_>) -> PyResult<String> {
        detached(py, || self.run.text())
    }

    /// How it ended.
    #[getter]
    fn status(&self) -> &'static str {
        self.run.trajectory.status.as_str()
    }

    /// What there is to say about it, as JSON and as a terminal shows it.
    fn messages(&self, py: Python<'_>) -> PyResult<(String, String)> {
        detached(py, || told(&self.run.messages()))
    }

    /// The kind, name and shape of each state, output and control, and its entries at the last instant.
    #[expect(
        clippy::type_complexity,
        reason = "a kind, a name, a shape and entries"
    )]
    fn end(&self, py: Python<'_>) -> PyResult<Vec<(&'static str, String, Vec<usize>, Vec<f64>)>> {
        let Samples {
            states,
            outputs,
            controls,
            ..
        } = detached(py, || self.run.trajectory.samples.end())?;
        let kinds = [
            ("states", states),
            ("outputs", outputs),
            ("controls", controls),
        ];
        let told = kinds.into_iter().flat_map(|(kind, all)| {
            let all = all.into_iter();
            all.map(move |one| (kind, one.name, one.shape, one.values))
        });
        Ok(told.collect())
    }

    /// The instants.
    #[getter]
    fn time<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let run = this.get();
        let length = detached(this.py(), || run.rows().time.len())?;
        arrays::view(this, &[length], |run| &run.rows().time)
    }

    /// The values of what stands at this place among states, outputs and controls.
    fn values<'py>(this: &Bound<'py, Self>, place: usize) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let run = this.get();
        let rows = detached(this.py(), || run.rows())?;
        let series = rows.series().nth(place);
        let series = series.ok_or_else(|| PyKeyError::new_err(place))?;
        let shape = [&[rows.time.len()], &series.shape[..]].concat();
        arrays::view(this, &shape, |run| {
            let series = run.rows().series().nth(place);
            series.map_or(&[], |series| &series.values)
        })
    }

    /// By what the run is differentiated, with the instants from which on its derivatives are not known.
    fn directions(&self, py: Python<'_>) -> PyResult<Vec<(String, Option<f64>)>> {
        let rows = detached(py, || self.rows())?;
        let told = rows.sensitivities.iter();
        Ok(told.map(|by| (by.to.clone(), by.until)).collect())
    }

    /// The derivatives of what stands at this place, by direction.
    fn derivatives<'py>(
        this: &Bound<'py, Self>,
        direction: usize,
        place: usize,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let run = this.get();
        let found = run.derivative(direction, place);
        let series = found.ok_or_else(|| PyKeyError::new_err((direction, place)))?;
        let shape = [&[run.rows().time.len()], &series.shape[..]].concat();
        arrays::view(this, &shape, |run| {
            let series = run.derivative(direction, place);
            series.map_or(&[], |series| &series.values)
        })
    }

    /// The instants of events, and their derivatives by direction.
    fn moves<'py>(
        &self,
        py: Python<'py>,
        direction: usize,
    ) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
        let by = self.rows().sensitivities.get(direction);
        let by = by.ok_or_else(|| PyKeyError::new_err(direction))?;
        let time = by.events.iter().map(|event| event.time);
        let derivative = by.events.iter().map(|event| event.derivative);
        let columns = [time.collect::<Vec<f64>>(), derivative.collect()];
        Ok(columns.map(|column| PyArray1::from_vec(py, column)))
    }

    /// The gradient of what was weighed, by direction.
    fn gradient<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let gradient = self.rows().gradient.as_ref()?;
        Some(PyArray1::from_slice(py, gradient))
    }

    /// The entries of states, the first and last instants of pieces, their numbers of coefficients, and all coefficients: of
    /// a piece those of the first state, of the second, and so on, constant terms first.
    #[expect(clippy::type_complexity, reason = "four arrays")]
    fn pieces<'py>(
        &self,
        py: Python<'py>,
    ) -> (
        Vec<String>,
        [Bound<'py, PyArray1<f64>>; 2],
        Bound<'py, PyArray1<i64>>,
        Bound<'py, PyArray1<f64>>,
    ) {
        let names = &self.run.states;
        let pieces = &self.run.trajectory.dense.pieces;
        let ends = [
            pieces.iter().map(|piece| piece.from).collect(),
            pieces.iter().map(|piece| piece.to).collect(),
        ];
        let counts: Vec<i64> = pieces
            .iter()
            .map(|piece| piece.n_coefficients as i64)
            .collect();
        let of_states = pieces.iter().flat_map(|piece| {
            let count = names.len() * piece.n_coefficients;
            piece.coefficients.iter().take(count).copied()
        });
        let coefficients: Vec<f64> = of_states.collect();
        (
            names.clone(),
            ends.map(|ends| PyArray1::from_vec(py, ends)),
            PyArray1::from_vec(py, counts),
            PyArray1::from_vec(py, coefficients),
        )
    }

    /// What it looks like, where it was drawn.
    #[getter]
    fn figure(&self) -> Option<&str> {
        self.run.figure.as_deref()
    }
}
