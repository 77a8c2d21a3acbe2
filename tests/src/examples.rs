//! The models of `examples/`.

use std::fs;
use std::path::{Path, PathBuf};

use nsdc::compile;
use nsdc::diagnostics::{self, Diagnostics};
use nsdc::expr::Exprs;
use nsdc::source::SourceMap;
use nsdc::source::imports;
use nsdc::syntax::{self, DeclKind, Experiment, Item, Model, Stmt};
use nsdc::system::System;

use crate::DataFolder;

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples")
}

/// Calls `check` with every example model, in order: the file stem, and the system of a plain experiment.
///
/// # Panics
///
/// With the rendered diagnostics, when one does not compile.
pub fn for_each_example(mut check: impl FnMut(&str, &System)) {
    let folder = examples();
    let entries = fs::read_dir(&folder).expect("the examples are there");
    let mut paths: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "nsd"));
    paths.sort();
    assert!(!paths.is_empty(), "no example in {}", folder.display());
    for path in paths {
        let text = fs::read_to_string(&path).expect("an example is text");
        let stem = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        for_each_model(&stem, &text, &mut check);
    }
}

fn for_each_model(stem: &str, text: &str, check: &mut impl FnMut(&str, &System)) {
    let models = {
        let mut sources = SourceMap::new();
        let file = syntax::parse(&sources.add(stem, text), &mut Diagnostics::new());
        // What needs inputs is seen as a part of the others.
        let needs_inputs = |model: &Model| {
            let mut missing = model.body.iter().filter_map(|stmt| match stmt {
                Stmt::Decl(decl) => Some(decl),
                _ => None,
            });
            missing.any(|decl| {
                matches!(decl.kind, DeclKind::Input | DeclKind::State) && decl.value.is_none()
            })
        };
        let models = file.items.into_iter().filter_map(|item| match item {
            Item::Model(model) if !needs_inputs(&model) => Some(model.name.name),
            _ => None,
        });
        models.collect::<Vec<String>>()
    };
    for model in models {
        let name = format!("golden_{model}");
        let with_experiment = format!("{text}\nsimulate {name} of {model} {{ horizon 1; }}\n");
        let mut sources = SourceMap::new();
        let mut found = Diagnostics::new();
        let mut file = syntax::parse(&sources.add(stem, with_experiment), &mut found);
        let mut data = DataFolder(examples());
        imports::link(&mut file, stem, &mut data, &mut sources, &mut found);
        let is_it = |item: &&Item| matches!(item, Item::Experiment(experiment) if experiment.name.name == name);
        let experiment: Option<&Experiment> =
            file.items.iter().find(is_it).and_then(|item| match item {
                Item::Experiment(experiment) => Some(experiment),
                _ => None,
            });
        let exprs = Exprs::new();
        let compiled = experiment.and_then(|experiment| {
            compile(
                &exprs,
                &file,
                experiment,
                &[],
                &mut Default::default(),
                &mut found,
            )
        });
        let Some(compiled) = compiled else {
            panic!("{}", diagnostics::render(&found, &sources, false, 100));
        };
        check(stem, &compiled.system);
    }
}
