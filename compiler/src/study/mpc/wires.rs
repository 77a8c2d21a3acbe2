//! Which states of a plant a controller reads, and which controls of it it sets: those of the same names.

use super::controller::recedes;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Exprs, Var};
use crate::optimize::receding::given_states;
use crate::project::clock::Clock;
use crate::source::Span;
use crate::syntax::{Experiment, ExperimentKind, File, Item, SettingKind};
use crate::system::System;
use crate::system::experiment::{ClosedLoop, ExperimentError};
use crate::{Compiled, compile};

/// How both sides of a loop are connected.
pub(super) struct Wires {
    /// Where initial values of the controller come from, in their order.
    pub fed: Vec<Fed>,
    /// The controls of a plan that the last data of the plant are, in their order.
    pub driven: Vec<usize>,
}

/// Where an initial value comes from.
pub(super) enum Fed {
    /// The state of the plant at this place.
    State(usize),
    /// The controller's experiment.
    Own(f64),
}

/// Finds what is wrong with the controller of a plant that has been compiled.
pub(crate) fn check(file: &File, plant: &Compiled<'_>, closed_loop: &ClosedLoop) -> Diagnostics {
    let exprs = Exprs::new();
    match connect(&exprs, file, plant, closed_loop) {
        Ok(_) => Diagnostics::new(),
        Err(diags) => diags,
    }
}

/// The compiled experiment of the controller of a plant, and how they are connected.
pub(super) fn connect<'c>(
    exprs: &'c Exprs,
    file: &File,
    plant: &Compiled<'_>,
    closed_loop: &ClosedLoop,
) -> Result<(Compiled<'c>, Wires), Diagnostics> {
    let mut diags = Diagnostics::new();
    let name = &closed_loop.controller.name;
    let bad = |why: &str, help: &'static str| ExperimentError::BadController {
        name: name.clone(),
        why: why.to_owned(),
        help,
        span: closed_loop.controller.span,
    };
    let mut experiments = file.items.iter().filter_map(|item| match item {
        Item::Experiment(experiment) => Some(experiment),
        _ => None,
    });
    let Some(experiment) = experiments.find(|known| known.name.name == *name) else {
        diags.push(bad(
            "the file has no experiment of that name",
            "name an `optimize` experiment of this file",
        ));
        return Err(diags);
    };
    if experiment.kind != ExperimentKind::Optimize {
        diags.push(bad(
            &format!("it is a `{}`", experiment.kind.word()),
            "name an `optimize` experiment, which chooses controls",
        ));
        return Err(diags);
    }
    let controller = compile(
        exprs,
        file,
        experiment,
        &[],
        &mut Clock::default(),
        &mut diags,
    );
    let Some(controller) = controller.filter(|_| !diags.has_errors()) else {
        return Err(diags);
    };
    if let Err(error) = recedes(&controller.system) {
        diags.push(bad(
            &error.to_string(),
            "write time as a state of both models, `tau' = 1;`, which the plant feeds",
        ));
        return Err(diags);
    }
    let span = plant.settings.span;
    let given = given(&controller, experiment);
    let fed = fed(
        &plant.system,
        &controller.system,
        (&given, span),
        &mut diags,
    );
    let driven = driven(plant, &controller.system, span, &mut diags);
    match diags.has_errors() {
        true => Err(diags),
        false => Ok((controller, Wires { fed, driven })),
    }
}

/// The entries of states that `with` of an experiment gives.
fn given(compiled: &Compiled<'_>, experiment: &Experiment) -> Vec<Var> {
    let binds = experiment
        .settings
        .iter()
        .filter_map(|setting| match &setting.kind {
            SettingKind::With(binds) => Some(binds),
            _ => None,
        });
    let model = &compiled.model;
    let entries = binds.flatten().flat_map(|bind| {
        // What is wrong with it has been told.
        let target = model.scope.target(&bind.target, &mut Diagnostics::new());
        let quantity = target
            .as_ref()
            .and_then(|target| model.quantities.get(target.kind));
        let places = target.iter().flat_map(|target| &target.entries);
        let vars = places.filter_map(|&place| quantity?.vars.get(place)?.as_variable());
        vars.collect::<Vec<Var>>()
    });
    entries.collect()
}

fn fed(
    plant: &System<'_>,
    controller: &System<'_>,
    (given, span): (&[Var], Span),
    diags: &mut Diagnostics,
) -> Vec<Fed> {
    let feeds = given_states(controller).into_iter().map(|place| {
        let state = &controller.states[place];
        let name = &state.name;
        let in_plant = plant.states.iter().position(|known| known.name == *name);
        match in_plant {
            Some(place) => Fed::State(place),
            None => {
                if !state.var.as_variable().is_some_and(|var| given.contains(&var)) {
                    diags.push(ExperimentError::LoopMismatch {
                        name: name.clone(),
                        why: "it is a state of the controller, and none of the plant".to_owned(),
                        help: "give the plant a state of that name, or give its value by `with` in the controller's experiment",
                        span,
                    });
                }
                Fed::Own(state.initial)
            }
        }
    });
    let feeds = feeds.collect();
    let freed = controller.task.iter().flat_map(|task| &task.initial);
    for name in freed.map(|free| &controller.states[free.place].name) {
        if plant.states.iter().any(|known| known.name == *name) {
            diags.push(ExperimentError::LoopMismatch {
                name: name.clone(),
                why: "the controller chooses its initial value, and the plant has it".to_owned(),
                help: "leave it out of `initial` in the controller's experiment",
                span,
            });
        }
    }
    feeds
}

fn driven(
    plant: &Compiled<'_>,
    controller: &System<'_>,
    span: Span,
    diags: &mut Diagnostics,
) -> Vec<usize> {
    let task = controller.task.iter();
    let decided: Vec<&str> = task
        .flat_map(|task| &task.controls)
        .map(|control| control.name.as_str())
        .collect();
    let controls = &plant.model.quantities.controls;
    let controls: Vec<Expr<'_>> = controls
        .iter()
        .flat_map(|u| u.vars.iter().copied())
        .collect();
    let data = plant.system.exogenous.data.iter();
    let open: Vec<&str> = data
        .filter(|data| controls.contains(&data.var))
        .map(|data| data.name.as_str())
        .collect();
    let mut mismatch = |name: &str, why: &str, help: &'static str| {
        diags.push(ExperimentError::LoopMismatch {
            name: name.to_owned(),
            why: why.to_owned(),
            help,
            span,
        });
    };
    for name in decided.iter().filter(|name| !open.contains(name)) {
        mismatch(
            name,
            "the controller decides on it, and the plant has no control of that name that is not given",
            "declare `control` of that name in the plant, and leave it out of `with`",
        );
    }
    let places = open.iter().filter_map(|name| {
        let place = decided.iter().position(|known| known == name);
        if place.is_none() {
            mismatch(
                name,
                "it is a control of the plant, and the controller does not decide on it",
                "give it a value by `with`",
            );
        }
        place
    });
    places.collect()
}
