//! A file of models and experiments.

use std::sync::Arc;
use std::time::Duration;

use nsdc::limit::Limit;
use nsdc::study::sweep::{Axis, Grid, Row};
use nsdc::sweep::Rows;
use nsdc::syntax::Item;
use nsdc::{Options, threads};
use numpy::PyArray1;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::controller::Controller;
use crate::errors::{compiling, detached, model_error, told};
use crate::interrupt::Interrupt;
use crate::recorded::Recorded;
use crate::run::Run;
use crate::session;
use crate::sweep;

/// A file that has been read and parsed, with what it uses.
#[pyclass(frozen, module = "nsdc._core")]
pub struct Project {
    project: Arc<nsdc::Project>,
    files: Recorded,
}

/// What replaces something of an experiment.
#[derive(FromPyObject)]
pub struct Asked {
    #[pyo3(item("values"))]
    values: Vec<(String, f64)>,
    #[pyo3(item("settings"))]
    settings: Vec<(String, String)>,
    #[pyo3(item("tolerance"))]
    tolerance: Option<f64>,
    #[pyo3(item("time_limit"))]
    time_limit: Option<f64>,
}

impl Asked {
    fn replacing(self) -> Options {
        let Asked {
            values,
            settings,
            tolerance,
            ..
        } = self;
        Options {
            values,
            settings,
            tolerance,
            ..Options::default()
        }
    }

    /// How long it may take.
    fn time(&self) -> PyResult<Option<Duration>> {
        let time = self.time_limit.map(Duration::try_from_secs_f64);
        let wrong = |_| PyValueError::new_err("time_limit: it is no time in seconds");
        time.transpose().map_err(wrong)
    }
}

/// The points of a sweep.
#[derive(FromPyObject)]
pub struct Points {
    #[pyo3(item("axes"))]
    axes: Vec<(String, Vec<f64>)>,
    #[pyo3(item("zip"))]
    is_zipped: bool,
    #[pyo3(item("first"))]
    first: usize,
    #[pyo3(item("last"))]
    last: usize,
    #[pyo3(item("seed"))]
    seed: Option<u64>,
}

impl Points {
    fn grid(&self) -> PyResult<Grid> {
        let axes = self.axes.iter().map(|(name, values)| Axis {
            name: name.clone(),
            values: values.clone(),
        });
        let grid = Grid::new(axes.collect(), self.is_zipped);
        grid.map_err(|error| PyValueError::new_err(error.to_string()))
    }
}

#[pymethods]
impl Project {
    /// A file of the disk or among `files`, which come first.
    #[new]
    fn new(
        py: Python<'_>,
        path: &str,
        files: Vec<(String, Vec<u8>)>,
        disk: bool,
    ) -> PyResult<Self> {
        // The interface of NumPy is fetched here: where results become arrays, a signal that waits might raise in between.
        PyArray1::<f64>::zeros(py, 0, false);
        let files = Recorded::new(files, disk);
        let read = files.clone();
        let project = detached(py, || nsdc::Project::from_files(path, read))?;
        let project = project.map_err(|error| PyOSError::new_err(error.to_string()))?;
        Ok(Project {
            project: Arc::new(project),
            files,
        })
    }

    /// What has been read, by path.
    fn files(&self) -> Vec<(String, Vec<u8>)> {
        self.files.files()
    }

    /// What is wrong with it, as JSON and as a terminal shows it.
    fn check(&self, py: Python<'_>) -> PyResult<(String, String)> {
        detached(py, || told(&self.project.check()))
    }

    /// The names of its models.
    fn models(&self) -> Vec<String> {
        let items = self.project.items();
        let models = items.filter_map(|item| match item {
            Item::Model(model) => Some(model.name.name.clone()),
            _ => None,
        });
        models.collect()
    }

    /// The names of its experiments.
    fn experiments(&self) -> Vec<String> {
        let all = self.project.experiments();
        all.map(|experiment| experiment.name.name.clone()).collect()
    }

    /// What an experiment is about, as JSON.
    fn describe(&self, py: Python<'_>, experiment: &str) -> PyResult<String> {
        let found = compiling(py, || self.project.describe(experiment))?;
        Ok(serde_json::to_string(&found).unwrap_or_default())
    }

    /// Runs an experiment, and finds the gradient of a sum of what it reports where that has weights.
    fn run(
        &self,
        py: Python<'_>,
        experiment: &str,
        asked: Asked,
        weights: Option<Vec<(String, Vec<f64>)>>,
        kept: (bool, bool),
    ) -> PyResult<Run> {
        let (multipliers, figure) = kept;
        let (interrupt, time) = (Interrupt::new(), asked.time()?);
        let options = Options {
            limit: Limit::from(time).canceled_by(&interrupt.cancel),
            dense: true,
            weights,
            multipliers,
            figure,
            ..asked.replacing()
        };
        let project = &self.project;
        let found = detached(py, || session::run(project, experiment, &options, &mut ()))?;
        interrupt.check()?;
        found
            .map(Run::from)
            .map_err(|messages| model_error(&messages))
    }

    /// An `optimize` experiment as a controller, with parameters that have their values at each step.
    fn controller(
        &self,
        experiment: String,
        open: Vec<String>,
        values: Vec<(String, f64)>,
        deadline: Option<f64>,
    ) -> PyResult<Controller> {
        let deadline = deadline.map(Duration::try_from_secs_f64);
        let wrong = |_| PyValueError::new_err("deadline: it is no time in seconds");
        let deadline = deadline.transpose().map_err(wrong)?;
        Controller::new(self.project.clone(), experiment, open, values, deadline)
    }

    /// The figure of a run, as SVG.
    fn draw(&self, py: Python<'_>, experiment: &str, asked: Asked, run: &Run) -> PyResult<String> {
        let options = asked.replacing();
        let trajectory = run.trajectory();
        compiling(py, || self.project.draw(experiment, &options, trajectory))
    }

    /// Raises what is wrong with the first point of a grid, where it does not compile.
    fn refuse(
        &self,
        py: Python<'_>,
        experiment: &str,
        asked: Asked,
        points: Points,
    ) -> PyResult<()> {
        let (grid, options) = (points.grid()?, asked.replacing());
        compiling(py, || {
            self.project.sweep(experiment, &options, grid)?.check()
        })
    }

    /// The figure of a sweep with these columns, as SVG.
    fn draw_sweep(
        &self,
        py: Python<'_>,
        experiment: &str,
        asked: Asked,
        points: Points,
        ends: (Vec<String>, Vec<f64>, Vec<f64>),
    ) -> PyResult<String> {
        let (grid, options) = (points.grid()?, asked.replacing());
        let (columns, ends, objectives) = ends;
        compiling(py, || {
            let sweep = self.project.sweep(experiment, &options, grid)?;
            let row = |k: usize| Row {
                end: ends[k * columns.len()..][..columns.len()].to_vec(),
                objective: objectives.get(k).copied().filter(|value| !value.is_nan()),
                ..Row::default()
            };
            let rows = (0..sweep.grid().len()).map(|k| Some(row(k))).collect();
            Ok(sweep.table(&Rows { rows, columns }).figure())
        })
    }

    /// Runs an experiment at points of a grid, on some threads or on all cores; `heard` is told how many runs are done.
    #[pyo3(signature = (experiment, asked, points, threads, heard))]
    fn sweep(
        &self,
        py: Python<'_>,
        experiment: &str,
        asked: Asked,
        points: Points,
        threads: Option<usize>,
        heard: Option<Py<PyAny>>,
    ) -> PyResult<sweep::Rows> {
        let (interrupt, grid) = (Interrupt::new(), points.grid()?);
        let (time, threads) = (asked.time()?, threads.unwrap_or_else(threads::count));
        let options = asked.replacing();
        let rows = compiling(py, || {
            let sweep = self.project.sweep(experiment, &options, grid)?;
            let sweep = sweep.within(time).canceled_by(&interrupt.cancel);
            let sweep = sweep.seeded(points.seed);
            let mut tell = interrupt.telling(heard.as_ref());
            Ok(sweep.rows(points.first..points.last, threads, &mut tell))
        })?;
        sweep::Rows::new(rows, interrupt)
    }
}
