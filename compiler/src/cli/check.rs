//! `nsdc check`

use std::path::PathBuf;

use super::project::{self, Project};
use super::{Exit, Streams, io};
use crate::clock::Clock;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::report::expect::{self, Subject};
use crate::syntax::Item;
use crate::{compile, model};

/// Checks files and prints what is wrong with them.
pub fn run(files: &[PathBuf], streams: &mut Streams<'_>) -> io::Result<Exit> {
    let mut exit = Exit::Success;
    for path in files {
        match Project::load(path) {
            Ok(mut project) => {
                let diags = all(&mut project);
                project::print(&diags, &project.sources, streams)?;
                if diags.has_errors() {
                    exit = Exit::Wrong;
                }
            }
            Err(error) => {
                writeln!(streams.err, "error: {error}")?;
                exit = Exit::Wrong;
            }
        }
    }
    Ok(exit)
}

/// All diagnostics of a file: of its syntax, its models and its experiments.
pub fn all(project: &mut Project) -> Diagnostics {
    let mut diags = std::mem::take(&mut project.diags);
    if diags.has_errors() {
        return diags;
    }
    let mut broken: Vec<&str> = Vec::new();
    for item in &project.file.items {
        let Item::Model(definition) = item else {
            continue;
        };
        let exprs = Exprs::new();
        let mut found = Diagnostics::new();
        let name = &definition.name.name;
        model::resolve(&exprs, &project.file, name, &[], &mut found);
        if found.has_errors() {
            broken.push(name);
        }
        found.remove_known(&diags);
        diags.append(found);
    }
    for experiment in project.experiments() {
        // What is wrong with its model has been said.
        if broken.contains(&experiment.model.head.name.as_str()) {
            continue;
        }
        let exprs = Exprs::new();
        let mut found = Diagnostics::new();
        let compiled = compile(
            &exprs,
            &project.file,
            experiment,
            &[],
            &mut Clock::default(),
            &mut found,
        );
        if let Some(compiled) = &compiled {
            let subject = Subject {
                model: &compiled.model,
                system: &compiled.system,
                horizon: compiled.settings.horizon,
                sources: &project.sources,
            };
            expect::check(&subject, &compiled.settings.expects, &mut found);
        }
        found.remove_known(&diags);
        diags.append(found);
    }
    diags
}
