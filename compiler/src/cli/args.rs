//! The arguments of each command.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args as Arguments, ColorChoice, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;

use super::files::{Form, form_of, is_standard, misnamed};
use crate::nl;

/// Compiler for .nsd: nonsmooth dynamical systems as they stand in a paper
#[derive(Debug, Parser)]
#[command(name = "nsdc", version, max_term_width = 100)]
#[command(
    after_help = "Exit status: 0 all well, 1 the model or the input is wrong, \
    2 the numerics failed or an expectation was missed, 64 wrong usage."
)]
pub struct Args {
    /// When messages are coloured
    #[arg(
        long,
        global = true,
        value_enum,
        default_value = "auto",
        value_name = "WHEN"
    )]
    pub color: ColorChoice,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check models and experiments, and print what is wrong with them
    #[command(after_help = CHECK_HELP)]
    Check(CheckArgs),
    /// Print what the compiler makes of a model
    Emit(EmitArgs),
    /// Run experiments and report what came out
    Run(RunArgs),
    /// Run every `expect` of files and folders
    #[command(after_help = TEST_HELP)]
    Test(TestArgs),
    /// Run or solve experiments by every method and lowering that takes them, and compare
    #[command(after_help = VERIFY_HELP)]
    Verify(VerifyArgs),
    /// Measure the error of every method over step size and time
    #[command(after_help = ORDER_HELP)]
    Order(OrderArgs),
    /// Map the sliding modes of a nonlinear switch over one or two states
    #[command(after_help = MODES_HELP)]
    Modes(ModesArgs),
    /// Draw experiments, and what was measured, in one figure
    #[command(after_help = PLOT_HELP)]
    Plot(PlotArgs),
    /// Run an experiment at many values of its parameters, on all cores
    #[command(after_help = SWEEP_HELP)]
    Sweep(SweepArgs),
    /// Solve AMPL .nl files with complementarity conditions
    #[command(after_help = SOLVE_HELP)]
    Solve(SolveArgs),
    /// Lay files out in the standard way
    Fmt {
        /// Files, and folders with all .nsd files below them; `-` is standard input to output
        #[arg(required = true, value_name = "PATH")]
        files: Vec<PathBuf>,
        /// Change nothing; name the files that would change and fail
        #[arg(long)]
        check: bool,
    },
    /// Make a folder with a small model, its tests and a README
    #[command(after_help = "Example: `nsdc new slider`, then `cd slider` and `nsdc test .`.")]
    New {
        /// The folder, which must not be there yet
        #[arg(value_name = "NAME")]
        path: PathBuf,
    },
    /// Check, run and draw a file again on every save, until Ctrl-C
    #[command(after_help = WATCH_HELP)]
    Watch(WatchArgs),
    /// Serve an editor, as a language server at standard input and output
    #[command(after_help = "`editors/README.md` says how editors are set up.")]
    Lsp,
    /// Explain a diagnostic by its code, or list all codes
    Explain {
        /// The code, such as E0203
        code: Option<String>,
    },
    /// Print what a shell needs to complete commands and options
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: Shell,
    },
}

/// What `check --help` ends with.
const CHECK_HELP: &str = "\
A fix is safe where the new text means what the old one was obviously meant to, as a missing `;`, `**` for a \
power, or `ln` for `log`; other fixes are in the JSON as suggestions. A file is replaced as a whole; files that it \
imports stay as they are.";

/// Arguments of `check`.
#[derive(Debug, Arguments)]
pub struct CheckArgs {
    /// Files to check; `-` is standard input
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Make all safe fixes in the files, tell them, and check again
    #[arg(long)]
    pub fix: bool,
    /// Write diagnostics with their fixes as a JSON array; to `-`, standard output, and .jsonl one object per line
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// What `watch --help` ends with.
const WATCH_HELP: &str = "\
The first run is reported as `run` does; of later ones what has changed is shown: numbers that are not within their \
tolerance of what they were. Of several experiments each has its figure, as `figure-crossing.svg`.";

/// Arguments of `watch`.
#[derive(Debug, Arguments)]
pub struct WatchArgs {
    /// The file
    pub file: PathBuf,
    /// The experiment; all of the file without it
    pub experiment: Option<String>,
    /// Draw states, outputs, modes and events as SVG
    #[arg(long, value_name = "PATH.svg")]
    pub plot: Option<PathBuf>,
}

/// Arguments of `emit`.
#[derive(Debug, Arguments)]
pub struct EmitArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiment; all of the file without it
    pub experiment: Option<String>,
    /// What to print
    #[arg(long, value_enum)]
    pub ir: Ir,
    /// How switches are lowered, instead of what the experiment says
    #[arg(long, value_enum)]
    pub lower: Option<Lower>,
    /// Write to a file; beside an AMPL file, names of its rows and variables go to .row and .col
    #[arg(
        long,
        value_name = "PATH",
        default_value = "-",
        hide_default_value = true
    )]
    pub output: PathBuf,
    /// Override a parameter, initial value or input of the experiment
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
}

/// The forms that `emit` knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Ir {
    /// Abstract syntax
    Ast,
    /// The model, names resolved and shapes known
    Model,
    /// The piecewise smooth system of an experiment, switches explicit
    System,
    /// The dynamic complementarity system
    Dcs,
    /// The discretized system with switch detection
    Fesd,
    /// The mathematical program with complementarity constraints
    Mpcc,
    /// An AMPL .nl file
    Nl,
    /// The dynamic complementarity system as LaTeX
    Tex,
    /// Which switches act on which states, as a Graphviz graph
    Dot,
}

/// Lowerings of switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lower {
    /// One multiplier per region
    Stewart,
    /// One multiplier per switch
    Step,
}

impl Lower {
    /// The word of the language.
    pub fn as_str(self) -> &'static str {
        match self {
            Lower::Stewart => "stewart",
            Lower::Step => "step",
        }
    }
}

/// Arguments of `run`.
#[derive(Debug, Arguments)]
pub struct RunArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiment; all of the file without it
    pub experiment: Option<String>,
    /// Write results as JSON, those of several experiments as an array; to `-`, standard output, and .jsonl one object per line
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Write values over time as CSV; `-` is standard output
    #[arg(long, value_name = "PATH")]
    pub csv: Option<PathBuf>,
    /// Write all events as CSV, with the modes before and after each; `-` is standard output
    #[arg(long, value_name = "PATH")]
    pub events: Option<PathBuf>,
    /// Draw states, outputs, modes and events as SVG; `-` is standard output
    #[arg(long, value_name = "PATH.svg")]
    pub plot: Option<PathBuf>,
    /// Draw the shapes of `animate { .. }` as they move, as SVG; `-` is standard output
    #[arg(long, value_name = "PATH.svg")]
    pub animate: Option<PathBuf>,
    /// Override a parameter, initial value or input
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
    /// Settings in place of those of the experiments.
    #[command(flatten)]
    pub settings: SettingArgs,
    /// Stop solving after so many seconds, all experiments together
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Add the multipliers of `method fesd` to the JSON
    #[arg(long, requires = "json")]
    pub multipliers: bool,
    /// What is told about them.
    #[command(flatten)]
    pub told: ToldArgs,
}

/// What a command tells about runs.
#[derive(Debug, Arguments)]
pub struct ToldArgs {
    /// Say where the time went
    #[arg(long)]
    pub time: bool,
    /// What is told about the run; `iterations` of an optimization, or its starts where there are several
    #[arg(long, value_enum, default_value = "summary")]
    log: Log,
    /// Print nothing but what is wrong, as `--log off`
    #[arg(short, long, conflicts_with = "log")]
    quiet: bool,
}

impl ToldArgs {
    /// How much is told.
    pub fn log(&self) -> Log {
        if self.quiet { Log::Off } else { self.log }
    }
}

/// Settings that a command line gives in place of those of experiments, in the words of the language.
#[derive(Debug, Arguments)]
#[command(next_help_heading = "Settings in place of the experiment's")]
pub struct SettingArgs {
    /// Use this method
    #[arg(long, value_name = "NAME")]
    method: Option<String>,
    /// Run to this time, such as `10` or `2*pi`
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    horizon: Option<String>,
    /// Solve to this tolerance
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    tolerance: Option<String>,
    /// Record at multiples of this time
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    every: Option<String>,
    /// Differentiate by these: parameters, and initial values as `x at 0`
    #[arg(long, value_name = "NAMES")]
    sensitivity: Option<String>,
    /// Start the optimization from the states and controls of a `.json` that `run` wrote, or of another experiment
    #[arg(long, value_name = "FILE|EXPERIMENT", value_parser = named)]
    guess: Option<String>,
}

impl SettingArgs {
    /// Options that are given, with what the experiment would say.
    pub fn words(&self) -> impl Iterator<Item = (&'static str, String)> {
        // A file that an experiment names is beside the model; here it is where the command runs.
        let is_file = |from: &str| from.contains(['.', '/', '\\']) || Path::new(from).is_file();
        let source = |from: &String| match std::path::absolute(from) {
            Ok(path) if is_file(from) => {
                format!("guess {{ from \"{}\"; }}", path.display())
            }
            _ => format!("guess {{ from {from}; }}"),
        };
        let written = |word: &str, given: &Option<String>| {
            given.as_ref().map(|given| format!("{word} {given}"))
        };
        let all = [
            ("--method", written("method", &self.method)),
            ("--horizon", written("horizon", &self.horizon)),
            ("--tolerance", written("tolerance", &self.tolerance)),
            ("--every", written("output every", &self.every)),
            (
                "--sensitivity",
                written("sensitivity to", &self.sensitivity),
            ),
            ("--guess", self.guess.as_ref().map(source)),
        ];
        all.into_iter()
            .filter_map(|(option, words)| Some((option, words?)))
    }
}

impl RunArgs {
    /// Where results go.
    pub fn targets(&self) -> Targets<'_> {
        Targets {
            json: self.json.as_deref(),
            csv: self.csv.as_deref(),
            events: self.events.as_deref(),
            plot: self.plot.as_deref(),
            animate: self.animate.as_deref(),
            ..Targets::default()
        }
    }
}

/// Where results go.
#[derive(Clone, Copy, Debug, Default)]
pub struct Targets<'a> {
    json: Option<&'a Path>,
    csv: Option<&'a Path>,
    events: Option<&'a Path>,
    plot: Option<&'a Path>,
    animate: Option<&'a Path>,
    parquet: Option<&'a Path>,
}

impl<'a> Targets<'a> {
    /// Those that there are.
    pub fn all(self) -> impl Iterator<Item = &'a Path> {
        let results = [self.json, self.csv, self.events];
        let figures = [self.plot, self.animate];
        results
            .into_iter()
            .chain(figures)
            .chain([self.parquet])
            .flatten()
    }

    /// Whether results take the place of the report.
    pub fn to_standard(self) -> bool {
        self.all().any(is_standard)
    }

    /// What is wrong with their combination.
    pub fn misuse(self) -> Option<String> {
        if self.all().filter(|target| is_standard(target)).count() > 1 {
            let all = match (self.animate, self.events) {
                (Some(_), _) => "`--json`, `--csv`, `--events`, `--plot`, `--animate`",
                (None, Some(_)) => "`--json`, `--csv`, `--events`, `--plot`",
                (None, None) => "`--json`, `--csv`, `--plot`",
            };
            return Some(format!("only one of {all} can write to standard output"));
        }
        let files: Vec<&Path> = self.all().filter(|target| !is_standard(target)).collect();
        let is_twice = |(k, path): &(usize, &&Path)| files[..*k].contains(*path);
        if let Some((_, path)) = files.iter().enumerate().find(is_twice) {
            return Some(format!("`{}` is named for two results", path.display()));
        }
        let figures = [("plots", self.plot), ("animations", self.animate)];
        for (what, path) in figures {
            let path = path.filter(|path| !is_standard(path) && form_of(path) != Some(Form::Svg));
            if let Some(path) = path {
                let path = path.display();
                return Some(format!(
                    "{what} are SVG: `{path}` must end in `.svg`; a browser or `rsvg-convert` makes other forms of it"
                ));
            }
        }
        misnamed([
            (self.json, Form::Json),
            (self.csv, Form::Csv),
            (self.events, Form::Csv),
            (self.parquet, Form::Parquet),
        ])
    }
}

/// The name of a file or an experiment, as the language can write it.
fn named(text: &str) -> Result<String, String> {
    match text.is_empty() || text.contains(['"', '\n']) {
        true => Err("a name of a file without quotes, or of an experiment, is wanted".to_owned()),
        false => Ok(text.to_owned()),
    }
}

/// What `verify --help` ends with.
const VERIFY_HELP: &str = "\
A simulation as it is written, by `event`, and by `fesd` with every lowering: all estimate their \
errors, so their last states and the instants of their events have to agree up to the tolerance and \
ten times these estimates, a tenth at most. An optimum is solved with every lowering, and again from the best one of \
all, where each lowering has to have the same objective. The exit status is 2 where two of them do \
not agree, or where the experiment as it is written has no end.

Example: `nsdc verify oscillator.nsd crossing`.";

/// Arguments of `verify`.
#[derive(Debug, Arguments)]
pub struct VerifyArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiment; all of the file without it
    pub experiment: Option<String>,
    /// Differences up to this need no explanation, relative to the size of each state
    #[arg(long, value_name = "NUMBER", value_parser = tolerance, default_value = "1e-6")]
    pub tolerance: f64,
    /// Write results as JSON, those of several experiments as an array; to `-`, standard output, and .jsonl one object per line, instead of the tables
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Override a parameter, initial value or input
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
    /// Stop each run after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "60")]
    pub time_limit: Duration,
}

/// What `order --help` ends with.
const ORDER_HELP: &str = "\
The error is the distance of the last state from the one that the experiment expects at its end, \
where `expect x at end ~ ..` gives all states, and else from a run that is more accurate than all \
others; the output says which. A grid is refined until its error is that of the reference. Times \
are medians of solves with compiled functions.

Example: `nsdc order oscillator.nsd crossing --csv errors.csv` prints a table and writes \
errors.csv, crossing.error-step.svg and crossing.error-time.svg.";

/// Arguments of `modes`.
#[derive(Debug, Arguments)]
pub struct ModesArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiment; without it the first one that reads a switch nonlinearly
    pub experiment: Option<String>,
    /// A state and its range, `x=-1:4`, once or twice; the other states are those of the start
    #[arg(
        long,
        required = true,
        value_name = "STATE=FROM:TO",
        allow_hyphen_values = true
    )]
    pub over: Vec<String>,
    /// The switch; without it the first one that is read nonlinearly
    #[arg(long, value_name = "NAME")]
    pub switch: Option<String>,
    /// Override a parameter, initial value or input
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
    /// Write the branches as SVG; `-` is standard output
    #[arg(long, value_name = "PATH")]
    pub plot: Option<PathBuf>,
}

const MODES_HELP: &str = "Example: `nsdc modes hidden.nsd --over x=-1:4 --plot modes.svg`.";

/// Arguments of `plot`.
#[derive(Debug, Arguments)]
pub struct PlotArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiments; all of the file without one
    pub experiments: Vec<String>,
    /// Draw the columns of this CSV file as points, over the first one, which is time; may stand several times
    #[arg(long, value_name = "PATH.csv")]
    pub data: Vec<PathBuf>,
    /// Draw these quantities alone, as in `--only x,v`
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Override a parameter, initial value or input of all of them
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
    /// Stop solving after so many seconds, all experiments together
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Where the SVG goes
    #[arg(
        long,
        value_name = "PATH.svg",
        default_value = "-",
        hide_default_value = true
    )]
    pub output: PathBuf,
}

impl PlotArgs {
    /// Where the figure goes.
    pub fn targets(&self) -> Targets<'_> {
        Targets {
            plot: Some(&self.output),
            ..Targets::default()
        }
    }
}

const PLOT_HELP: &str = "\
Example: `nsdc plot slider.nsd swings damped --data measured.csv --only x --output slider.svg`.";

/// Arguments of `order`.
#[derive(Debug, Arguments)]
pub struct OrderArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiment; may be left out where the file has one
    pub experiment: Option<String>,
    /// Write all runs as CSV; `-` is standard output, instead of the table
    #[arg(long, value_name = "PATH")]
    pub csv: Option<PathBuf>,
    /// Write the figures to PREFIX.error-step.svg and PREFIX.error-time.svg, instead of beginning
    /// their names with that of the experiment
    #[arg(long, value_name = "PREFIX")]
    pub plot: Option<PathBuf>,
    /// Override a parameter, initial value or input
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
    /// Begin no more runs after so many seconds; finer grids take longer
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "8")]
    pub time_limit: Duration,
}

/// What `sweep --help` ends with.
const SWEEP_HELP: &str = "\
Several axes give all combinations of their values, the last one fastest, or with `--zip` their values \
side by side. Every run is a row: its values, how it ended, states and outputs at the end, objective, \
number of events, error estimate, and the code of its failure or first warning. Ctrl-C keeps what is \
finished. The exit status is 2 where a run is not solved.

Example: `nsdc sweep belt.nsd stick_slip --over mu=0.1:0.5:41 --csv belt.csv`.";

/// Arguments of `sweep`.
#[derive(Debug, Arguments)]
pub struct SweepArgs {
    /// The file; `-` is standard input
    pub file: PathBuf,
    /// The experiment; may be left out where the file has one
    pub experiment: Option<String>,
    /// A parameter, initial value or input with its values, `k=0.1:0.5:41` or `k=[1,2,4]`
    #[arg(
        long,
        required = true,
        value_name = "NAME=VALUES",
        allow_hyphen_values = true
    )]
    pub over: Vec<String>,
    /// Take the values of all axes side by side
    #[arg(long)]
    pub zip: bool,
    /// Write the rows as CSV; `-` is standard output, instead of the table
    #[arg(long, value_name = "PATH")]
    pub csv: Option<PathBuf>,
    /// Write the rows as a JSON array; to `-`, standard output, and .jsonl one object per line, instead of the table
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Write the rows as Apache Parquet, where nsdc was built with the feature `parquet`
    #[arg(long, value_name = "PATH.parquet")]
    pub parquet: Option<PathBuf>,
    /// Draw values at the end as SVG: lines over one axis, maps over two
    #[arg(long, value_name = "PATH.svg")]
    pub plot: Option<PathBuf>,
    /// Override a parameter, initial value or input
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<String>,
    /// Run so many at once; on all cores without it
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Stop each run after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
}

impl SweepArgs {
    /// Where rows and the figure go.
    pub fn targets(&self) -> Targets<'_> {
        Targets {
            json: self.json.as_deref(),
            csv: self.csv.as_deref(),
            plot: self.plot.as_deref(),
            parquet: self.parquet.as_deref(),
            ..Targets::default()
        }
    }
}

/// What `solve --help` ends with.
const SOLVE_HELP: &str = "\
A folder gives a table of all .nl files below it: a problem counts as solved when its violation and \
every |min(G, H)| are at most 1e-6. Where a file results.csv with the column `problem` stands beside \
them, its columns `best_known` and `peer_..` are compared with.

As a solver of AMPL: `option solver nsdc;`, options in `nsdc_options` (tolerance=1e-9 time_limit=60 \
starts=1 outlev=0); `nsdc stub -AMPL` reads stub.nl and writes stub.sol.";

/// Arguments of `solve`.
#[derive(Debug, Arguments)]
pub struct SolveArgs {
    /// The file, or a folder with .nl files; `-` is standard input
    pub path: PathBuf,
    /// Options in the way of AMPL
    #[arg(hide = true, requires = "ampl", value_name = "NAME=VALUE")]
    pub options: Vec<String>,
    /// Write the solution file for AMPL; also `-AMPL`
    #[arg(long)]
    pub ampl: bool,
    /// Write results as JSON, those of a folder as an array; to `-`, standard output, and .jsonl one object per line
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Write the table of a folder as CSV; `-` is standard output
    #[arg(long, value_name = "PATH", conflicts_with = "ampl")]
    pub csv: Option<PathBuf>,
    /// Draw the performance profile of a folder as SVG; `-` is standard output
    #[arg(long, value_name = "PATH.svg", conflicts_with = "ampl")]
    pub plot: Option<PathBuf>,
    /// What the optimality error has to reach
    #[arg(long, value_name = "NUMBER", value_parser = tolerance)]
    pub tolerance: Option<f64>,
    /// Stop solving a problem after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Solve a problem with pairs from so many starts, that of the file first; as many as a small problem has time for without it
    #[arg(long, value_name = "N")]
    pub starts: Option<NonZeroUsize>,
    /// Solve so many problems of a folder at once; all cores without it
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// What is told about the run
    #[arg(long, value_enum, default_value = "summary")]
    pub log: Log,
}

/// How much `run` and `solve` tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Log {
    /// Nothing but what is wrong
    Off,
    /// The result
    Summary,
    /// Every iteration of the solver, too
    Iterations,
}

/// What `test --help` ends with.
const TEST_HELP: &str = "\
The exit status is 0 where all tests pass, 1 where a file does not compile, 2 where an expectation is \
missed, in one test or more, and 64 where the filter takes none.

Example: `nsdc test models --junit results.xml`.";

/// Arguments of `test`.
#[derive(Debug, Arguments)]
pub struct TestArgs {
    /// Files, and folders with all .nsd files below them
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Show how goldens differ, and write them as they are now
    #[arg(long)]
    pub accept: bool,
    /// Only tests with this text in their names, `FILE: EXPERIMENT`
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
    /// Only this experiment; of editors, which know its name
    #[arg(skip)]
    pub experiment: Option<String>,
    /// Write results as a JSON array; to `-`, standard output, and .jsonl one object per line, instead of the report
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Write results as JUnit XML; `-` is standard output, instead of the report
    #[arg(long, value_name = "PATH")]
    pub junit: Option<PathBuf>,
    /// Test so many files at once; all cores without it
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Stop solving an experiment after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
}

impl TestArgs {
    /// Tests of a file, or of one of its experiments.
    pub fn of(file: PathBuf, experiment: Option<String>) -> Self {
        TestArgs {
            paths: vec![file],
            accept: false,
            filter: None,
            experiment,
            json: None,
            junit: None,
            jobs: None,
            time_limit: None,
        }
    }
}

/// A name and its value; what they are is for the compiler to say.
fn assignment(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
            Ok(text.into())
        }
        _ => Err("expected NAME=VALUE, as in `omega=3`".into()),
    }
}

/// A positive number of seconds, no more than a duration holds.
fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds| *seconds > 0.0);
    seconds
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "expected a positive number of seconds".into())
}

/// A number between 0 and 1.
fn tolerance(text: &str) -> Result<f64, String> {
    nl::tolerance(text).ok_or_else(|| "expected a number between 0 and 1".into())
}

#[cfg(test)]
mod tests {
    use super::Args;

    #[test]
    fn the_arguments_are_consistent() {
        use clap::CommandFactory;
        Args::command().debug_assert();
    }
}
