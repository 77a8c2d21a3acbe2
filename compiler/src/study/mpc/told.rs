//! What has been planned, beside what has happened.

use miette::Diagnostic;

use super::{Controller, Step};
use crate::diagnostics::counted;
use crate::report::{self, Decision, Failure, Planned, Sampled, Times, Trajectory, Warning};
use crate::source::Span;
use crate::system::experiment::ClosedLoop;

/// Adds to a trajectory what its samples were.
pub(super) fn tell(
    controller: &Controller<'_>,
    steps: Vec<Step>,
    closed_loop: &ClosedLoop,
    trajectory: &mut Trajectory,
) {
    if let [only] = &steps[..]
        && only.plan.is_none()
    {
        let failure = only.why.clone();
        failure.into_iter().for_each(|why| trajectory.fails(why));
    } else {
        trajectory.warnings.extend(warnings(&steps));
    }
    let (states, controls) = (controller.planned_states(), controller.controls());
    let seconds: Vec<f64> = steps.iter().map(|step| step.seconds).collect();
    let samples = steps.into_iter().map(|step| Sampled {
        time: step.time,
        decision: step.decision,
        objective: step.plan.as_ref().map(|plan| plan.objective),
        iterations: step.iterations,
        seconds: step.seconds,
        why: step.why.as_ref().map(|why| Warning::of(why)),
        plan: step.plan.map(|plan| Planned {
            time: plan.ends.iter().map(|end| step.time + end).collect(),
            states: by_name(&states, &plan.states),
            controls: by_name(&controls, &plan.controls),
        }),
    });
    trajectory.several.closed_loop = Some(report::ClosedLoop {
        controller: closed_loop.controller.name.clone(),
        sample: closed_loop.sample,
        deadline: closed_loop.deadline,
        samples: samples.collect(),
        times: Times::of(seconds),
    });
}

/// The first line that a failure is about.
fn place(failure: &Failure) -> Option<Span> {
    let label = failure.labels()?.next()?;
    Some(Span::new(label.offset()..label.offset() + label.len()))
}

/// Columns of rows by their names.
fn by_name(names: &[String], rows: &[Vec<f64>]) -> Vec<(String, Vec<f64>)> {
    let column = |i: usize| rows.iter().map(|row| row[i]).collect();
    let names = names.iter().cloned().enumerate();
    names.map(|(i, name)| (name, column(i))).collect()
}

/// What was done where a solve has not led to a solution, once for each reason.
fn warnings(steps: &[Step]) -> Vec<Warning> {
    let mut found: Vec<(&Step, &Failure, usize)> = Vec::new();
    for step in steps {
        let Some(why) = &step.why else { continue };
        let is_same = |(first, known, _): &&mut (&Step, &Failure, usize)| {
            let is_alike = std::mem::discriminant(*known) == std::mem::discriminant(why);
            first.decision == step.decision && is_alike
        };
        match found.iter_mut().find(is_same) {
            Some((_, _, count)) => *count += 1,
            None => found.push((step, why, 1)),
        }
    }
    let warning = |(step, failure, count): (&Step, &Failure, usize)| {
        let why = Warning::of(failure);
        let (code, done) = match step.decision {
            Decision::Kept => ("W0745", "the plan before went on"),
            _ => ("W0746", "the plan is followed all the same"),
        };
        Warning {
            code: code.into(),
            message: format!(
                "at {} of {}, first at t = {:.6}, {done}: {}, {}",
                counted(count, "sample"),
                steps.len(),
                step.time,
                why.code,
                why.message
            ),
            span: place(failure),
        }
    };
    found.into_iter().map(warning).collect()
}
