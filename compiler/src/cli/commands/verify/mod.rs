//! `nsdc verify`

mod optimum;
mod simulation;

use crate::Compiled;
use crate::cli::args::VerifyArgs;
use crate::cli::files::{Form, Sink, is_standard};
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::Diagnostics;
use crate::limit::{Cancel, Limit};
use crate::report::roads::Refusal;
use crate::simulate::Request;
use crate::syntax::{Bind, Experiment, ExperimentKind, SettingKind};
use crate::system::System;
use crate::system::experiment::MethodKind;

/// What came of an experiment.
struct Verified {
    /// For a reader.
    text: String,
    /// For a program: one object.
    json: String,
    exit: Exit,
}

/// An experiment to be verified.
struct Subject<'s> {
    experiment: &'s Experiment,
    overrides: &'s [Bind],
    args: &'s VerifyArgs,
    cancel: &'s Cancel,
}

impl Subject<'_> {
    /// What is asked of every run.
    fn request(&self) -> Request {
        Request {
            dense: false,
            estimate: true,
            multipliers: false,
            limit: Limit::within(self.args.time_limit).canceled_by(self.cancel),
        }
    }
}

/// Runs experiments in every way that takes them, and compares what comes out.
pub fn run(args: &VerifyArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    if let Some(message) = files::misnamed([(args.json.as_deref(), Form::Json)]) {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    if !files::foresee(args.json.as_deref(), streams)? {
        return Ok(Exit::Wrong);
    }
    let Some((mut project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let Some(experiments) = project::selected(&project, args.experiment.as_deref(), streams)?
    else {
        return Ok(Exit::Wrong);
    };
    let mut exit = Exit::Success;
    let mut lines = String::new();
    let reports = !args.json.as_deref().is_some_and(is_standard);
    let cancel = streams.cancel.clone();
    for (number, experiment) in experiments.iter().enumerate() {
        let subject = Subject {
            experiment,
            overrides: &overrides,
            args,
            cancel: &cancel,
        };
        let verified = match experiment.kind {
            ExperimentKind::Optimize => optimum::verify(&mut project, &subject, streams)?,
            ExperimentKind::Simulate if smooths(experiment) => {
                let reason = "smoothing changes the model, not compared";
                Some(not_compared(experiment, "simulate", reason))
            }
            ExperimentKind::Fit => {
                let reason = "a fit runs by events alone, not compared";
                Some(not_compared(experiment, "fit", reason))
            }
            ExperimentKind::Mpc => {
                let reason = "a loop is run by events alone, not compared";
                Some(not_compared(experiment, "mpc", reason))
            }
            ExperimentKind::Simulate => simulation::verify(&mut project, &subject, streams)?,
        };
        let Some(verified) = verified else {
            exit = exit.max(Exit::Wrong);
            continue;
        };
        if reports {
            if number > 0 {
                writeln!(streams.out)?;
            }
            streams.out.write_all(verified.text.as_bytes())?;
            // A long run shows where it is.
            streams.out.flush()?;
        }
        lines.push_str(&verified.json);
        lines.push('\n');
        exit = exit.max(verified.exit);
    }
    let json = args.json.as_deref();
    let sink = json.map(|path| Sink::objects(path, &lines, experiments.len() == 1));
    match sink.map_or(Ok(true), |sink| sink.finish(streams))? {
        true => Ok(exit),
        false => Ok(exit.max(Exit::Wrong)),
    }
}

/// Whether an experiment runs another model than the one that is written.
fn smooths(experiment: &Experiment) -> bool {
    let mut settings = experiment.settings.iter();
    settings.any(|setting| match &setting.kind {
        SettingKind::Method { name, .. } => name.name == MethodKind::Smoothing.word(),
        _ => false,
    })
}

/// That an experiment is not compared.
fn not_compared(experiment: &Experiment, kind: &str, reason: &str) -> Verified {
    let (name, model) = (&experiment.name.name, &experiment.model.head.name);
    Verified {
        text: format!("{name} of {model}: {reason}\n"),
        json: serde_json::json!({
            "experiment": name, "model": model, "kind": kind, "agree": null, "reason": reason,
        })
        .to_string(),
        exit: Exit::Success,
    }
}

/// Why an experiment that does not compile with a method or lowering is not for it.
fn refusal(diags: &Diagnostics) -> Refusal {
    let reasons: Vec<String> = diags.errors().map(|error| error.to_string()).collect();
    Refusal {
        codes: diags.error_codes().join(", "),
        reason: reasons.join("; "),
    }
}

/// What two runs that agree or not make of the exit status.
fn exit(agree: bool) -> Exit {
    match agree {
        true => Exit::Success,
        false => Exit::Failed,
    }
}

/// Whether a lowering of jumps and relays finds none.
fn is_idle(compiled: &Compiled<'_>) -> bool {
    let System {
        jumps, switches, ..
    } = &compiled.system;
    let settings = &compiled.settings;
    let has_relay = switches.iter().any(|switch| switch.relay.is_some());
    let has_jumps = !jumps.laws.is_empty() || !jumps.contacts.is_empty();
    settings.freezes() && !has_jumps && !has_relay
        || settings.takes_impulses() && jumps.contacts.is_empty()
}
