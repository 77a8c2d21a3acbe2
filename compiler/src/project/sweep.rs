//! Sweeps: one experiment at many values of parameters, initial values or inputs.
//!
//! What can be compiled once is, on each thread, for every side of zero that values are on; other points are compiled one by
//! one. A row is that of its point, whatever the number of threads is, and whatever else is run.

use std::ops::Range;
use std::sync::OnceLock;
use std::time::Duration;

use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::expr::Exprs;
use crate::limit::{Cancel, Limit};
use crate::model::Units;
use crate::project::clock::Clock;
use crate::project::launch::launch;
use crate::project::rerun::missed;
use crate::project::reruns::Reruns;
use crate::project::run::Options;
use crate::project::{Project, bindings};
use crate::report::expect::{self, Resolved};
use crate::report::{Trajectory, Warning};
use crate::simulate::Request;
use crate::source::SourceMap;
use crate::study::sweep::{Grid, Points, Row, Table, columns, over};
use crate::syntax::{
    Bind, Expect, Experiment, ExperimentKind, ExperimentSetting, ExprKind, SettingKind,
};
use crate::system::experiment::{ExperimentError, Sampling, Settings};
use crate::{Compiled, check_names, compile};

/// An experiment with the quantities that are swept.
pub struct Sweep<'p> {
    project: &'p Project,
    experiment: Experiment,
    overrides: Vec<Bind>,
    /// A binding for each axis, whose value is replaced.
    axes: Vec<Bind>,
    /// The entries of all states.
    states: Vec<String>,
    grid: Grid,
    units: Units,
    sources: SourceMap,
    /// Of the first run, where something is random; that of run k is larger by k.
    seed: Option<u64>,
    /// Of each run.
    time_limit: Option<Duration>,
    /// Ends them all.
    cancel: Cancel,
}

/// What a sweep has come to.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// In the order of the grid; none where there was no run.
    pub rows: Vec<Option<Row>>,
    /// The names of the entries of [`Row::end`]; none where no run was begun.
    pub columns: Vec<String>,
}

impl Project {
    /// Gets an experiment ready to be run at all points of a grid, with values and settings of `options` in place of its own
    /// for what is not swept.
    ///
    /// ```
    /// use nsdc::study::sweep::{Axis, Grid};
    /// use nsdc::{Options, Project};
    ///
    /// let project = Project::from_text("decay.nsd", "
    ///     model decay { param k = 1; state x = 1; x' = -k*x; }
    ///     simulate d of decay { horizon 1; }");
    /// let axes = vec![Axis { name: "k".to_owned(), values: vec![0.5, 1.0, 2.0] }];
    /// let grid = Grid::new(axes, false).expect("there are few points");
    /// let sweep = project.sweep("d", &Options::default(), grid).expect("it compiles");
    /// let found = sweep.rows(0..3, 2, &mut |_| {});
    /// assert_eq!(found.columns, ["x"]);
    /// for (row, k) in found.rows.iter().flatten().zip([0.5, 1.0, 2.0]) {
    ///     assert!((row.end[0] - f64::exp(-k)).abs() < 1e-8);
    /// }
    /// ```
    ///
    /// # Errors
    ///
    /// Where there is no such experiment, it has mistakes that a run at the first point shows, or no value that is named.
    pub fn sweep(
        &self,
        experiment: &str,
        options: &Options,
        grid: Grid,
    ) -> Result<Sweep<'_>, Messages> {
        let asked = self.ask(experiment, &options.values, &options.words())?;
        let (mut sources, mut diags) = (asked.sources, Diagnostics::new());
        let axes = bindings((&mut sources, &mut diags), "over", &examples(&grid));
        let failed = |diags| Messages::new(diags, sources.clone());
        let Some(axes) = axes else {
            return Err(failed(diags));
        };
        let experiment = asked.experiment.into_owned();
        if options.weights.is_some() {
            let mut diags = Diagnostics::new();
            diags.push(ExperimentError::NoGradient {
                why: "rows of a sweep are not differentiated".to_owned(),
                span: experiment.name.span,
            });
            return Err(failed(diags));
        }
        let sweep = Sweep::new(self, experiment, (asked.overrides, axes), grid);
        let mut sweep = sweep.map_err(failed)?;
        sweep.sources = sources;
        Ok(sweep)
    }
}

/// `name=value` of each axis, with its first value.
pub(crate) fn examples(grid: &Grid) -> Vec<String> {
    let axes = grid.axes().iter();
    axes.map(|axis| format!("{}={:?}", axis.name, axis.values[0]))
        .collect()
}

impl<'p> Sweep<'p> {
    /// An experiment with overrides, and a binding for each axis of a grid.
    pub(crate) fn new(
        project: &'p Project,
        experiment: Experiment,
        (overrides, axes): (Vec<Bind>, Vec<Bind>),
        grid: Grid,
    ) -> Result<Self, Diagnostics> {
        let mut sweep = Sweep {
            sources: project.sources.clone(),
            units: Units::default(),
            states: Vec::new(),
            seed: None,
            time_limit: None,
            cancel: Cancel::default(),
            project,
            experiment,
            overrides,
            axes,
            grid,
        };
        let (first, mut diags) = (sweep.grid.point(0), Diagnostics::new());
        let overrides = sweep.at(&first);
        let names = check_names(&project.file, &sweep.experiment, &overrides, &mut diags);
        (sweep.states, sweep.units) = names.ok_or(diags)?;
        if matches!(
            sweep.experiment.kind,
            ExperimentKind::Fit | ExperimentKind::Mpc
        ) {
            let mut diags = Diagnostics::new();
            let name = &sweep.experiment.name;
            diags.push(ExperimentError::NotSimulated {
                name: name.name.clone(),
                what: "a sweep",
                span: name.span,
            });
            return Err(diags);
        }
        match sweep.mistakes(&first) {
            Some(diags) => Err(diags),
            None => Ok(sweep),
        }
    }

    /// The same with a limit for the time of each run.
    pub fn within(self, time_limit: Option<Duration>) -> Self {
        Sweep { time_limit, ..self }
    }

    /// The same with a seed for the first run, where something is random: that of run k is larger by k. Without one, all
    /// runs have that of the experiment.
    pub fn seeded(self, seed: Option<u64>) -> Self {
        Sweep { seed, ..self }
    }

    /// The same, until `cancel` is called: rows that are finished are kept.
    pub fn canceled_by(self, cancel: &Cancel) -> Self {
        let cancel = cancel.clone();
        Sweep { cancel, ..self }
    }

    /// What is gone through.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Runs the experiment at some points, by their numbers in the grid, on up to `n_threads` threads. `heard` is told how
    /// many are done.
    pub fn rows(
        &self,
        points: Range<usize>,
        n_threads: usize,
        heard: &mut dyn FnMut(usize),
    ) -> Rows {
        let columns = OnceLock::new();
        let work = |points: Points<'_>| self.share(points, &columns);
        let rows = over((&self.grid, points), n_threads, &self.cancel, work, heard);
        Rows {
            rows,
            columns: columns.into_inner().unwrap_or_default(),
        }
    }

    /// These rows with what they belong to.
    pub fn table<'s>(&'s self, found: &'s Rows) -> Table<'s> {
        Table {
            grid: &self.grid,
            columns: &found.columns,
            rows: &found.rows,
            has_expectations: self.expects(),
            units: &self.units,
        }
    }

    /// What is wrong with all points: what the first one does not compile for, where no point of these rows does.
    pub fn refused(&self, rows: &Rows) -> Option<Messages> {
        let mut begun = rows.rows.iter().flatten().peekable();
        begun.peek()?;
        let none = begun.all(|row| row.status.is_none());
        none.then(|| self.check().err())?
    }

    /// Compiles the experiment at the first point.
    ///
    /// # Errors
    ///
    /// Where it does not compile.
    pub fn check(&self) -> Result<(), Messages> {
        let compiled = self
            .compiled(&Exprs::new(), &self.grid.point(0))
            .map(|_| ());
        compiled.map_err(|diags| Messages::new(diags, self.sources.clone()))
    }

    /// The experiment at a point, with the warnings of its compilation.
    fn compiled<'e>(
        &self,
        exprs: &'e Exprs,
        point: &[f64],
    ) -> Result<(Compiled<'e>, Diagnostics), Diagnostics> {
        let (overrides, mut diags) = (self.at(point), Diagnostics::new());
        let (file, clock) = (&self.project.file, &mut Clock::default());
        let compiled = compile(exprs, file, &self.experiment, &overrides, clock, &mut diags);
        match compiled.filter(|_| !diags.has_errors()) {
            Some(compiled) => Ok((compiled, diags)),
            None => Err(diags),
        }
    }

    /// The overrides of a point.
    fn at(&self, point: &[f64]) -> Vec<Bind> {
        let axes = self.axes.iter().zip(point).map(|(bind, &value)| {
            let mut bind = bind.clone();
            bind.value.kind = ExprKind::Number(value);
            bind
        });
        self.overrides.iter().cloned().chain(axes).collect()
    }

    /// Runs what one thread gets to. What can be compiled once is, for every side of zero that values are on; other points
    /// are compiled one by one.
    fn share(&self, points: Points<'_>, names: &OnceLock<Vec<String>>) {
        let (exprs, project) = (Exprs::new(), self.project);
        let binds = [self.overrides.clone(), self.axes.clone()];
        let (experiment, states) = (self.experiment.clone(), self.states.clone());
        let mut reruns = Reruns::new(&exprs, project, experiment, binds, states);
        points.each(|(k, point)| {
            let rerun = reruns.of(point, |new| Some(new.adapted(|one| self.adapt(one))));
            let found = rerun.and_then(|rerun| {
                rerun.seed(self.seed_of(k));
                let run = rerun.run(point, &self.request(rerun.compiled()), &mut ())?;
                let missed = rerun.missed(&self.sources, &run);
                Some((run, missed))
            });
            let row = match found.map_or_else(|| self.trajectory((k, point)), Ok) {
                Ok((run, missed)) => {
                    names.get_or_init(|| columns(&run));
                    Row::of(&run, missed)
                }
                Err(diags) => Row::refused(diags.error_codes().into_iter().next()),
            };
            // What was cut short anywhere is no row.
            (!self.cancel.is_canceled()).then_some(row)
        });
    }

    fn seed_of(&self, k: usize) -> Option<u64> {
        Some(self.seed?.wrapping_add(k as u64))
    }

    /// What is asked of a run; its time begins now.
    fn request(&self, compiled: &Compiled<'_>) -> Request {
        Request {
            // Expectations may be about any instant.
            dense: !compiled.settings.expects.is_empty(),
            estimate: true,
            multipliers: false,
            limit: Limit::from(self.time_limit).canceled_by(&self.cancel),
        }
    }

    /// Lets runs tell what rows have, and keeps the expectations that are about any of them.
    fn adapt(&self, compiled: &mut Compiled<'_>) {
        let subject = compiled.subject(&self.sources);
        let expects = expect::of_any_run(&subject, &compiled.settings.expects);
        compiled.settings.expects = expects;
        if compiled.settings.optimize.is_none() {
            compiled.settings.recording.sampling = self.sampling(&compiled.settings);
        }
    }

    /// When a run is told: at its end, and where there are expectations at all instants of the experiment, since they may
    /// be about these.
    fn sampling(&self, settings: &Settings<'_>) -> Sampling {
        let horizon = settings.horizon;
        match (self.expects(), &settings.recording.sampling) {
            (false, _) => Sampling::At(vec![horizon]),
            (true, Sampling::At(instants)) if instants.last() != Some(&horizon) => {
                Sampling::At([&instants[..], &[horizon]].concat())
            }
            (true, sampling) => sampling.clone(),
        }
    }

    /// Mistakes in expectations, as far as a point shows them.
    fn mistakes(&self, point: &[f64]) -> Option<Diagnostics> {
        let exprs = Exprs::new();
        let (compiled, _) = self.compiled(&exprs, point).ok()?;
        let mut found = Diagnostics::new();
        let subject = compiled.subject(&self.sources);
        expect::check(&subject, &compiled.settings.expects, &mut found);
        found.has_errors().then_some(found)
    }

    /// Whether the experiment has expectations that are about any run.
    fn expects(&self) -> bool {
        let is_open = |setting: &ExperimentSetting| match &setting.kind {
            SettingKind::Expect(expect) => {
                !matches!(expect, Expect::LoweringGolden | Expect::NumbersGolden)
            }
            _ => false,
        };
        self.experiment.settings.iter().any(is_open)
    }

    /// The run of a point, with the warnings of its compilation, and how many expectations it misses.
    fn trajectory(
        &self,
        (k, point): (usize, &[f64]),
    ) -> Result<(Trajectory, Option<usize>), Diagnostics> {
        let exprs = Exprs::new();
        let (mut compiled, diags) = self.compiled(&exprs, point)?;
        self.adapt(&mut compiled);
        let settings = &mut compiled.settings;
        if let (Some(kicks), Some(seed)) = (&mut settings.kicks, self.seed_of(k)) {
            kicks.seed = seed;
        }
        let request = self.request(&compiled);
        let mut run = launch(self.project, &mut compiled, &request, &mut ())?;
        run.warnings.splice(0..0, Warning::all(&diags));
        let missed = missed(&compiled, &self.sources, &mut Resolved::default(), &run);
        Ok((run, missed))
    }
}
