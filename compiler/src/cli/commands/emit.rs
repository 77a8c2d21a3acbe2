//! `nsdc emit`

use crate::cli::args::{EmitArgs, Ir};
use crate::cli::files::{Sink, is_standard};
use crate::cli::project::Project;
use crate::cli::{Exit, Streams, io, project};
use crate::diagnostics::Diagnostics;
use crate::expr::{Exprs, Function};
use crate::limit::{Cancel, Limit};
use crate::lowering::discretize::{DiscretizeError, Grid, discretize};
use crate::lowering::{dcs, discretize};
use crate::project::clock::Clock;
use crate::project::launch;
use crate::simulate::Request;
use crate::syntax::{Bind, Experiment, Item};
use crate::system::experiment::{ExperimentError, FesdOptions, Method, Settings};
use crate::{Compiled, compile, model, optimize};

/// Steps of a grid that the experiment does not say.
const STEPS: usize = 10;

/// More rows than this are not printed one by one.
const MOST_ROWS: usize = 10_000;

/// More rows than this are not written to an AMPL file: they are expanded in memory first.
const MOST_NL_ROWS: usize = 1_000_000;

/// Prints a form of the models or experiments of a file.
pub fn run(args: &EmitArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let Some((mut project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let mut printed = Printed::default();
    let mut exit = match args.ir {
        Ir::Ast => ast(&project, args, &mut printed, streams)?,
        Ir::Model if args.experiment.is_none() => models(&project, &mut printed, streams)?,
        _ => experiments(&mut project, args, &overrides, &mut printed, streams)?,
    };
    // What could not be made replaces no file.
    if exit != Exit::Success && !is_standard(&args.output) {
        return Ok(exit);
    }
    let mut sinks = vec![Sink::with(&args.output, printed.text)];
    if !is_standard(&args.output) {
        let names = [("row", printed.row_names), ("col", printed.column_names)];
        sinks.extend(
            names
                .into_iter()
                .filter(|(_, names)| !names.is_empty())
                .map(|(extension, names)| {
                    let lines: String = names.iter().map(|name| format!("{name}\n")).collect();
                    Sink::with(&args.output.with_extension(extension), lines)
                }),
        );
    }
    for sink in sinks {
        if !sink.finish(streams)? {
            exit = Exit::Wrong;
        }
    }
    Ok(exit)
}

/// What is printed.
#[derive(Default)]
struct Printed {
    text: String,
    /// Names of rows and variables, where the text has numbers for them.
    row_names: Vec<String>,
    column_names: Vec<String>,
}

impl Printed {
    /// One form.
    fn of(text: impl ToString) -> Self {
        Printed {
            text: text.to_string(),
            ..Printed::default()
        }
    }

    fn add(&mut self, other: Printed) {
        self.text.push_str(other.text.trim_end());
        self.text.push('\n');
        (self.row_names, self.column_names) = (other.row_names, other.column_names);
    }
}

/// Prints the syntax of the file, or of one experiment.
fn ast(
    project: &Project,
    args: &EmitArgs,
    printed: &mut Printed,
    streams: &mut Streams<'_>,
) -> io::Result<Exit> {
    let mut file = project.file.clone();
    if args.experiment.is_some() {
        let Some(selected) = project::selected(project, args.experiment.as_deref(), streams)?
        else {
            return Ok(Exit::Wrong);
        };
        file.items = selected.into_iter().map(Item::Experiment).collect();
    }
    printed.add(Printed::of(file));
    Ok(Exit::Success)
}

/// Prints a form that depends on an experiment, for one or all of them.
fn experiments(
    project: &mut Project,
    args: &EmitArgs,
    overrides: &[Bind],
    printed: &mut Printed,
    streams: &mut Streams<'_>,
) -> io::Result<Exit> {
    // A file of models alone is shown as if each was run with its defaults.
    let has_experiments = project.experiments().next().is_some();
    let selected = match has_experiments || args.experiment.is_some() {
        true => project::selected(project, args.experiment.as_deref(), streams)?,
        false => Some(defaults(project)),
    };
    let Some(mut experiments) = selected else {
        return Ok(Exit::Wrong);
    };
    if let Some(lower) = args.lower {
        let words = format!("lower {}", lower.as_str());
        for experiment in &mut experiments {
            // The words are fixed and parse.
            let _ = project.replace_setting(experiment, "--lower", &words);
        }
    }

    let mut exit = Exit::Success;
    let several = experiments.len() > 1;
    if several && args.ir == Ir::Nl {
        writeln!(streams.err, "error: an AMPL file holds one program")?;
        writeln!(streams.err, "  help: name the experiment behind the file")?;
        return Ok(Exit::Wrong);
    }
    let cancel = streams.cancel.clone();
    for experiment in experiments.iter().take_while(|_| !cancel.is_canceled()) {
        let exprs = Exprs::new();
        let mut diags = Diagnostics::new();
        let mut clock = Clock::default();
        let compiled = compile(
            &exprs,
            &project.file,
            experiment,
            overrides,
            &mut clock,
            &mut diags,
        );
        let text = compiled.and_then(|compiled| match args.ir {
            Ir::Model => Some(Ok(Printed::of(&compiled.model))),
            Ir::System => Some(Ok(Printed::of(compiled.lowered()))),
            Ir::Dot => Some(Ok(Printed::of(dcs::dot(&compiled.lowered())))),
            _ => lowered(project, &compiled, (args.ir, &cancel), &mut diags),
        });
        project::print(&diags, &project.sources, streams)?;
        match text {
            Some(Err(Refused { fact, help })) => {
                writeln!(streams.err, "error: {fact}\n  help: {help}")?;
                exit = Exit::Wrong;
            }
            Some(Ok(form)) => {
                if several {
                    printed.add(Printed::of(format!("// {}", experiment.name.name)));
                }
                printed.add(form);
                if several {
                    printed.text.push('\n');
                }
            }
            None => exit = Exit::Wrong,
        }
    }
    Ok(exit)
}

/// Why a form is not printed, and what to do.
struct Refused {
    fact: String,
    help: &'static str,
}

impl From<DiscretizeError> for Refused {
    fn from(error: DiscretizeError) -> Self {
        let help = match error {
            DiscretizeError::TooLarge { .. } => {
                "take fewer steps or elements, or add up pairs with `cross = sum_both`"
            }
            DiscretizeError::NoValue { .. } => {
                "take a scheme whose last node is the end, such as `radau_iia`, or state it `at nodes`"
            }
            DiscretizeError::Plain { .. } => "`elements` with a number finds the instants",
            DiscretizeError::Start { .. } => "start where all functions have values",
        };
        let fact = error.to_string();
        Refused { fact, help }
    }
}

/// The grid of an experiment, and how its program is made on it.
fn discretization(settings: &Settings<'_>) -> (Grid, discretize::Options) {
    let (steps, options) = match (&settings.optimize, &settings.numerics.method) {
        (Some(task), _) => (
            Some(task.discretization.intervals),
            discretize::Options::optimize(task),
        ),
        (None, Method::Fesd(options)) => (options.steps, discretize::Options::fesd(options)),
        (None, Method::Timestepping(options)) => {
            (Some(options.steps), discretize::Options::stepping(options))
        }
        _ => (None, discretize::Options::fesd(&FesdOptions::default())),
    };
    let grid = Grid::new(settings.horizon, steps.unwrap_or(STEPS));
    (grid, options)
}

/// A form behind the lowering of switches; `None` after an error.
fn lowered(
    project: &Project,
    compiled: &Compiled,
    (ir, cancel): (Ir, &Cancel),
    diags: &mut Diagnostics,
) -> Option<Result<Printed, Refused>> {
    let (system, settings) = (&compiled.lowered(), &compiled.settings);
    if ir == Ir::Tex {
        let text = dcs::tex(system, &settings.numerics.lowerings);
        let text = text.map_err(|error| diags.push(error)).ok()?;
        return Some(Ok(Printed::of(text)));
    }
    let dcs = dcs::lower(system, &settings.numerics.lowerings);
    let dcs = dcs.map_err(|error| diags.push(error)).ok()?;
    if ir == Ir::Dcs {
        return Some(Ok(Printed::of(dcs)));
    }
    // Of an optimization it is known that a step needs one piece of them.
    let data = system.exogenous.data.first();
    if let Some(data) = data.filter(|_| settings.optimize.is_none()) {
        diags.push(ExperimentError::DataInProgram {
            name: data.name.clone(),
            span: settings.span,
        });
        return None;
    }
    let (grid, options) = discretization(settings);
    let program = match discretize(&dcs, grid, &options) {
        Ok((program, _)) => program,
        Err(error) => return Some(Err(error.into())),
    };
    if ir == Ir::Fesd {
        return Some(Ok(Printed::of(program)));
    }
    let (most, reason) = match ir {
        Ir::Nl => (MOST_NL_ROWS, "for one file"),
        _ => (MOST_ROWS, "to be read"),
    };
    let sizes = program.sizes();
    let rows = sizes.equations + sizes.pairs + sizes.terms;
    if rows > most {
        return Some(Err(Refused {
            fact: format!("the program has {rows} rows, too many {reason}"),
            help: "`--ir fesd` prints one line for all rows of a kind",
        }));
    }
    if ir == Ir::Mpcc {
        return Some(Ok(Printed::of(program.flat())));
    }
    // The file says where to start from.
    let program = match &settings.optimize {
        None => program,
        Some(task) => {
            let request = Request {
                limit: Limit::default().canceled_by(cancel),
                ..Request::default()
            };
            let sampled = launch::sampled(project, task, &request);
            let sampled = sampled.map_err(|found| diags.append(found)).ok()?;
            optimize::program(&compiled.system, settings, task, &sampled).ok()?
        }
    };
    if let Some(refused) = without_operator(compiled) {
        return Some(Err(refused));
    }
    let ampl = program.nl();
    Some(Ok(Printed {
        text: ampl.text,
        row_names: ampl.row_names,
        column_names: ampl.column_names,
    }))
}

/// An error where a function of the model has no operator in AMPL files.
fn without_operator(compiled: &Compiled) -> Option<Refused> {
    let is_unknown =
        |function: &&Function| !function.is_nonsmooth() && function.definition().opcode.is_none();
    let mut unknown = Function::ALL.iter().filter(is_unknown);
    let function = unknown.find(|function| compiled.model.exprs.applies(**function))?;
    Some(Refused {
        fact: format!("AMPL files have no operator for `{}`", function.name()),
        help: "`--ir mpcc` prints the program with it",
    })
}

/// Prints all models of the file, as they are before any experiment.
fn models(project: &Project, printed: &mut Printed, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let mut diags = Diagnostics::new();
    for item in &project.file.items {
        let Item::Model(definition) = item else {
            continue;
        };
        let exprs = Exprs::new();
        let mut found = Diagnostics::new();
        let model = model::resolve(
            &exprs,
            &project.file,
            &definition.name.name,
            &[],
            &mut found,
        );
        if let Some(model) = model {
            printed.add(Printed::of(model));
            printed.text.push('\n');
        }
        found.remove_known(&diags);
        diags.append(found);
    }
    project::print(&diags, &project.sources, streams)?;
    Ok(if diags.has_errors() {
        Exit::Wrong
    } else {
        Exit::Success
    })
}

/// An experiment without settings for every model.
fn defaults(project: &mut Project) -> Vec<Experiment> {
    let names = project.file.items.iter().filter_map(|item| match item {
        Item::Model(model) => Some(model.name.name.clone()),
        _ => None,
    });
    let names: Vec<String> = names.collect();
    names
        .iter()
        .filter_map(|name| project.default_experiment(name))
        .collect()
}
