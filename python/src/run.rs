//! What came of a run.

use std::collections::HashMap;

use nsdc::report::{Piece, Series};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;

use crate::{arrays, errors};

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

    /// The states before a jump at the first instant, as a piece of no length.
    fn before_start(&self) -> Option<Piece> {
        let (samples, dense) = (&self.run.trajectory.samples, &self.run.trajectory.dense);
        let start = dense.pieces.first()?.from;
        if !samples.time.starts_with(&[start, start]) {
            return None;
        }
        let first = samples.states.iter();
        let first = first.flat_map(|series| series.entry_names().into_iter().zip(series.at(0)));
        let first: HashMap<String, f64> = first.map(|(name, &value)| (name, value)).collect();
        let values = self.run.states.iter().map(|name| first.get(name).copied());
        Some(Piece {
            from: start,
            to: start,
            n_coefficients: 1,
            coefficients: values.collect::<Option<_>>()?,
        })
    }

    fn named(&self, kind: &str) -> PyResult<&[Series]> {
        let trajectory = &self.run.trajectory;
        match kind {
            "states" => Ok(&trajectory.samples.states),
            "outputs" => Ok(&trajectory.samples.outputs),
            "controls" => Ok(&trajectory.samples.controls),
            _ => Err(PyKeyError::new_err(kind.to_owned())),
        }
    }
}

#[pymethods]
impl Run {
    /// All but what has a value at each instant, as JSON.
    fn summary(&self, py: Python<'_>) -> String {
        py.detach(|| self.run.summary())
    }

    /// As `nsdc run --json` writes it.
    fn json(&self, py: Python<'_>) -> String {
        py.detach(|| self.run.json())
    }

    /// As `nsdc run --csv` writes it.
    fn csv(&self, py: Python<'_>) -> String {
        py.detach(|| self.run.csv())
    }

    /// As `nsdc run` prints it.
    fn text(&self) -> String {
        self.run.text()
    }

    /// How it ended.
    #[getter]
    fn status(&self) -> &'static str {
        self.run.trajectory.status.as_str()
    }

    /// What there is to say about it, as JSON and as a terminal shows it.
    fn messages(&self) -> (String, String) {
        let messages = self.run.messages();
        (errors::json(&messages), messages.render(false, 100))
    }

    /// The names and shapes of `states`, `outputs` or `controls`.
    fn names(&self, kind: &str) -> PyResult<Vec<(String, Vec<usize>)>> {
        let series = self.named(kind)?.iter();
        Ok(series
            .map(|series| (series.name.clone(), series.shape.clone()))
            .collect())
    }

    /// The instants.
    #[getter]
    fn time<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let length = this.get().run.trajectory.samples.time.len();
        arrays::view(this, &[length], |this| &this.run.trajectory.samples.time)
    }

    /// The values of one of `states`, `outputs` or `controls` by its place.
    fn values<'py>(
        this: &Bound<'py, Self>,
        kind: &str,
        place: usize,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let series = this.get().named(kind)?.get(place);
        let series = series.ok_or_else(|| PyKeyError::new_err(place))?;
        let mut shape = vec![this.get().run.trajectory.samples.time.len()];
        shape.extend(&series.shape);
        arrays::view(this, &shape, |this| match this.named(kind) {
            Ok(all) => &all[place].values,
            Err(_) => &[],
        })
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
        let before = self.before_start();
        let pieces: Vec<&Piece> = before
            .iter()
            .chain(&self.run.trajectory.dense.pieces)
            .collect();
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
