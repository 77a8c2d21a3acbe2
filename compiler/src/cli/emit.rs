//! `nsdc emit`

use super::args::{EmitArgs, Ir};
use super::project::{self, Project};
use super::{Exit, Streams, io};
use crate::clock::Clock;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::syntax::{Bind, Experiment, Item};
use crate::{compile, dcs, model};

/// Prints a form of the models or experiments of a file.
pub fn run(args: &EmitArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let Some((mut project, overrides)) = Project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    match args.ir {
        Ir::Ast => ast(&project, args, streams),
        Ir::Model if args.experiment.is_none() => models(&project, streams),
        Ir::Fesd | Ir::Mpcc | Ir::Nl => {
            writeln!(
                streams.err,
                "error: discretized forms are not yet supported (E0921)"
            )?;
            writeln!(
                streams.err,
                "  help: `--ir dcs` prints the last form in continuous time"
            )?;
            Ok(Exit::Wrong)
        }
        Ir::Model | Ir::System | Ir::Dcs | Ir::Tex | Ir::Dot => {
            experiments(&mut project, args, &overrides, streams)
        }
    }
}

/// Prints the syntax of the file, or of one experiment.
fn ast(project: &Project, args: &EmitArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let mut file = project.file.clone();
    if args.experiment.is_some() {
        let Some(selected) = project.selected(args.experiment.as_deref(), streams)? else {
            return Ok(Exit::Wrong);
        };
        file.items = selected.into_iter().map(Item::Experiment).collect();
    }
    write!(streams.out, "{file}")?;
    Ok(Exit::Success)
}

/// Prints a form that depends on an experiment, for one or all of them.
fn experiments(
    project: &mut Project,
    args: &EmitArgs,
    overrides: &[Bind],
    streams: &mut Streams<'_>,
) -> io::Result<Exit> {
    // A file of models alone is shown as if each was run with its defaults.
    let has_experiments = project.experiments().next().is_some();
    let selected = match has_experiments || args.experiment.is_some() {
        true => project.selected(args.experiment.as_deref(), streams)?,
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
    for experiment in &experiments {
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
        let text = compiled.and_then(|compiled| {
            let dcs = |diags: &mut Diagnostics| {
                let result = dcs::lower(&compiled.system, &compiled.settings.lowerings);
                result.map_err(|error| diags.push(error)).ok()
            };
            match args.ir {
                Ir::Model => Some(compiled.model.to_string()),
                Ir::System => Some(compiled.system.to_string()),
                Ir::Dcs => dcs(&mut diags).map(|dcs| dcs.to_string()),
                Ir::Tex => dcs(&mut diags).map(|form| dcs::tex(&form)),
                Ir::Dot => Some(dcs::dot(&compiled.system)),
                Ir::Ast | Ir::Fesd | Ir::Mpcc | Ir::Nl => None,
            }
        });
        project::print(&diags, &project.sources, streams)?;
        match text {
            Some(text) => {
                if several {
                    writeln!(streams.out, "// {}", experiment.name.name)?;
                }
                writeln!(streams.out, "{}", text.trim_end())?;
                if several {
                    writeln!(streams.out)?;
                }
            }
            None => exit = Exit::Wrong,
        }
    }
    Ok(exit)
}

/// Prints all models of the file, as they are before any experiment.
fn models(project: &Project, streams: &mut Streams<'_>) -> io::Result<Exit> {
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
            writeln!(streams.out, "{}\n", model.to_string().trim_end())?;
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
