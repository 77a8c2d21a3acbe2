//! How a run ended, in the words of the language.

pub(crate) mod last;
pub(crate) mod limits;
pub(crate) mod overlooked;
pub(crate) mod rooted;
pub(crate) mod steepest;
use miette::LabeledSpan;
use nsd_solver::hybrid::{Coefficient, Function, Note, Outcome, Side, Status};
use nsd_solver::selector::{Candidate, MAX_NAMED};

use crate::report::{Averaged, Failure, Samples, Series, Warning};
use crate::simulate::record::modes::{ModeNames, law_of};
use crate::source::Span;
use crate::system::experiment::{Method, Settings};
use crate::system::{Role, System};

/// What ended the run before its horizon; none where it was reached.
pub(super) fn failure(
    system: &System,
    names: &ModeNames,
    outcome: &Outcome,
    settings: &Settings,
) -> Option<Failure> {
    let (time, span, ahead) = (outcome.time, settings.span, ahead(settings));
    // What is no number contradicts every sign and solves no equation.
    let cause = match &outcome.status {
        Status::Unsolved | Status::StepLimit => steepest::not_finite(system, outcome, ahead),
        Status::NoSolution { .. } => steepest::not_finite(system, outcome, 0.0),
        _ => None,
    };
    if let Some(term) = cause {
        let terms = vec![term];
        return Some(Failure::NotFinite { time, terms });
    }
    let this = || LabeledSpan::new_with_span(Some("this run".to_owned()), span);
    let limit = |what: &'static str, term: Option<LabeledSpan>| Failure::Limit {
        time,
        what,
        terms: vec![term.unwrap_or_else(this)],
    };
    Some(match &outcome.status {
        Status::Solved | Status::Stopped => return None,
        Status::StepLimit => limit("steps", steepest::turning(system, outcome, ahead)),
        Status::EventLimit => limit("events", None),
        Status::Over(over) => Failure::over(*over, time, span),
        Status::Accumulation => Failure::Accumulation { time, span },
        Status::StaysInGuard { law } => Failure::StaysInGuard {
            time,
            laws: of_laws(system, &[*law]),
        },
        Status::StopsAtStart { law } => Failure::StopsAtStart {
            time,
            laws: of_laws(system, &[*law]),
        },
        Status::EndlessJumps { laws } => Failure::EndlessJumps {
            time,
            laws: of_laws(system, laws),
        },
        Status::ConflictingJumps { laws, state } => Failure::ConflictingJumps {
            time,
            state: system.states[*state].name.clone(),
            laws: of_laws(system, laws),
        },
        Status::Inconsistent { switches } => Failure::Inconsistent {
            time,
            rows: rows(system, switches),
        },
        Status::HighIndex { switches } => Failure::HighIndex {
            time,
            rows: rows(system, switches),
        },
        Status::NotFinite => {
            let label = steepest::label(system, outcome, ahead);
            let terms = vec![label.unwrap_or_else(this)];
            Failure::NotFinite { time, terms }
        }
        Status::Unsolved => Failure::Unsolved { time, span },
        Status::Chattering { .. }
        | Status::Restless { .. }
        | Status::Painleve { .. }
        | Status::Penetrates { .. }
        | Status::Coefficient { .. }
        | Status::NonUnique(_)
        | Status::NoSolution { .. }
        | Status::Undetermined { .. }
        | Status::SingularSliding { .. }
        | Status::MissedSwitch { .. }
        | Status::Unweighted { .. }
        | Status::CannotSlide { .. } => at_surfaces(system, names, outcome, span),
    })
}

/// The same of what is told at the surfaces of switches.
fn at_surfaces(system: &System, names: &ModeNames, outcome: &Outcome, span: Span) -> Failure {
    let time = outcome.time;
    let at = |switches: &[usize]| labels(system, switches);
    let name = |switch: usize| system.switches[switch].name.clone();
    match &outcome.status {
        Status::Chattering {
            switches,
            spacing,
            events,
        } => Failure::Chattering {
            time,
            spacing: *spacing,
            events: many(*events),
            surfaces: at(switches),
        },
        Status::Restless { switches } => Failure::Restless {
            time,
            surfaces: at(switches),
        },
        Status::Painleve { switch } => Failure::Painleve {
            time,
            name: name(*switch),
            surfaces: at(&[*switch]),
        },
        Status::Penetrates { switch } => Failure::Penetrates {
            time,
            name: name(*switch),
            surfaces: at(&[*switch]),
        },
        Status::Coefficient {
            switch,
            coefficient,
            value,
        } => outside(
            (*coefficient, *value),
            (time, name(*switch)),
            at(&[*switch]),
        ),
        Status::NonUnique(candidates) => non_unique(system, names, candidates, time),
        Status::NoSolution { switches } => Failure::NoSolution {
            time,
            contacts: are_contacts(system, switches),
            surfaces: at(switches),
        },
        Status::Undetermined { switches } => Failure::Undetermined {
            time,
            contacts: are_contacts(system, switches),
            surfaces: at(switches),
        },
        Status::SingularSliding { switches } => Failure::SingularSliding {
            time,
            contacts: are_contacts(system, switches),
            surfaces: at(switches),
        },
        Status::MissedSwitch { switch } => Failure::MissedSwitch {
            time,
            surfaces: at(&[*switch]),
        },
        Status::Unweighted { switches } => Failure::Unweighted {
            time,
            surfaces: at(switches),
        },
        Status::CannotSlide { switches } => Failure::CannotSlide {
            time,
            surfaces: at(switches),
        },
        _ => Failure::Unsolved { time, span },
    }
}

/// That an output is no number at instants that are reported.
pub(super) fn without_value(system: &System, samples: &Samples) -> Option<Warning> {
    let find = |series: &Series| {
        let is_missing = |k: &usize| series.at(*k).iter().any(|value| !value.is_finite());
        let mut missing = (0..samples.time.len()).filter(is_missing);
        let first = samples.time[missing.next()?];
        Some((series.name.clone(), first, missing.count()))
    };
    let (name, time, more) = samples.outputs.iter().find_map(find)?;
    let others = match more {
        0 => String::new(),
        _ => format!(", and at {more} more instants that are reported"),
    };
    let mut outputs = system.recorded.outputs.iter();
    let output = outputs.find(|output| output.name == name);
    Some(Warning {
        code: "W0739".into(),
        message: format!("the output `{name}` has no finite value at time = {time:.6}{others}"),
        span: output.map(|output| output.span),
    })
}

/// A number of events in words.
fn many(events: f64) -> String {
    const MOST: f64 = 1e99;
    if events > MOST {
        format!("more than {MOST:e}")
    } else {
        format!("{events:.0e}")
    }
}

/// How far ahead of where it ended a run looked: a step of its grid, or what is left of those that became ever shorter.
fn ahead(settings: &Settings) -> f64 {
    let steps = match &settings.numerics.method {
        Method::Fesd(options) => options.steps,
        Method::Timestepping(options) => Some(options.steps),
        _ => None,
    };
    settings.horizon * steps.map_or(SHORTEST, |steps| 1.0 / steps as f64)
}

/// Steps that become ever shorter have come at least so close to where they lead, as a share of the horizon.
const SHORTEST: f64 = 1e-6;

/// A coefficient so close to a bound of its range is just leaving it.
const AT_BOUND: f64 = 1e-9;

/// A contact with a coefficient that no contact has.
pub(super) fn outside(
    (coefficient, value): (Coefficient, f64),
    (time, name): (f64, String),
    surfaces: Vec<LabeledSpan>,
) -> Failure {
    let (what, range) = match coefficient {
        Coefficient::Restitution => ("restitution", "between 0 and 1"),
        Coefficient::Friction => ("friction", "0 or more"),
    };
    // While a contact lasts, a coefficient leaves its range where it has the value of a bound.
    let at = |bound: f64| (value - bound).abs() <= AT_BOUND;
    let how = match coefficient {
        _ if at(0.0) => "falls below 0".to_owned(),
        Coefficient::Restitution if at(1.0) => "rises above 1".to_owned(),
        _ => format!("is {value}, which is not {range}"),
    };
    Failure::Coefficient {
        time,
        what,
        name,
        how,
        surfaces,
    }
}

/// Why algebraic states have no values at the start.
pub(super) fn of_start(system: &System, status: &Status) -> Failure {
    let time = 0.0;
    match status {
        Status::NonUnique(candidates) => {
            non_unique(system, &ModeNames::new(system), candidates, time)
        }
        Status::HighIndex { switches } => Failure::HighIndex {
            time,
            rows: rows(system, switches),
        },
        _ => {
            let kept = system.switches.iter().enumerate();
            let kept = kept.filter(|(_, switch)| switch.role != Role::Step);
            let kept: Vec<usize> = kept.map(|(i, _)| i).collect();
            Failure::Inconsistent {
                time,
                rows: rows(system, &kept),
            }
        }
    }
}

/// Programs whose convexity is not proven.
pub fn sampled(system: &System) -> impl Iterator<Item = Warning> {
    system.provenance.sampled.iter().map(|&span| Warning {
        code: "W0714".into(),
        message: "a program was found convex at sample points only".into(),
        span: Some(span),
    })
}

/// What the run went on from although it could not be sure.
pub(super) fn warnings(system: &System, outcome: &Outcome) -> Vec<Warning> {
    let notes = outcome.notes.iter().map(|note| warning(system, note));
    let root = rooted::warning(system, outcome);
    sampled(system).chain(notes).chain(root).collect()
}

/// That no condition has ended a run which was to end at one.
pub(super) fn unstopped(outcome: &Outcome, settings: &Settings) -> Option<Warning> {
    let is_whole = outcome.status == Status::Solved && outcome.stats.stopped_by.is_none();
    let first = settings.numerics.stops.first().filter(|_| is_whole)?;
    Some(Warning {
        code: "W0736".into(),
        message: format!(
            "no condition of `stop when` became true: the run goes to its horizon, t = {}",
            settings.horizon
        ),
        span: Some(first.span),
    })
}

/// What a run has noted, in words.
pub(super) fn warning(system: &System, note: &Note) -> Warning {
    let names_of = |switches: &[usize]| {
        let names = (switches.iter().take(MAX_SHOWN))
            .map(|&i| format!("`{}`", system.switches[i].name))
            .collect::<Vec<_>>();
        let more = match switches.len() {
            n if n > MAX_SHOWN => ", ..",
            _ => "",
        };
        format!("{}{more}", names.join(", "))
    };
    let about = |code: &str, switches: &[usize], message: String| Warning {
        code: code.into(),
        message,
        span: switches
            .first()
            .and_then(|&i| system.switches[i].spans.first().copied()),
    };
    match note {
        Note::Unsearched { time, switches } => about(
            "W0706",
            switches,
            format!(
                "at t = {time}, {} surfaces meet: {}; a solution was found, others were not ruled out",
                switches.len(),
                names_of(switches)
            ),
        ),
        Note::EnergyGained { time, switches } => about(
            "W0712",
            switches,
            format!(
                "at t = {time}, an impact of {} has added energy",
                names_of(switches)
            ),
        ),
        Note::Faint { time, switches } => about(
            "W0737",
            switches,
            format!(
                "at t = {time}, what keeps {} is so small in the units of the model, next to 1, that rounding may decide when it lets go",
                names_of(switches)
            ),
        ),
        Note::Together { time, switches } => about(
            "W0710",
            switches,
            format!(
                "at t = {time}, {} are met at once, as far as can be told; which one is met first matters",
                names_of(switches)
            ),
        ),
        Note::Averaged {
            time,
            switches,
            heights,
        } => {
            let heights: Vec<String> = heights.iter().map(|h| format!("{h:.1e}")).collect();
            about(
                "W0722",
                switches,
                format!(
                    "from t = {time} on, chattering around {} is averaged: the state slides there, without an oscillation \
                     that is still up to {} and fades",
                    names_of(switches),
                    heights.join(", ")
                ),
            )
        }
        Note::Unseen { time, function } => unseen(system, *time, *function),
    }
}

/// Chattering that goes on as sliding.
pub(super) fn averaged(system: &System, outcome: &Outcome) -> Vec<Averaged> {
    let told = |note: &Note| match note {
        Note::Averaged {
            time,
            switches,
            heights,
        } => Some(Averaged {
            time: *time,
            surfaces: (switches.iter())
                .map(|&i| system.switches[i].name.clone())
                .collect(),
            heights: heights.clone(),
        }),
        _ => None,
    };
    outcome.notes.iter().filter_map(told).collect()
}

/// A function that may be narrower than could be looked at.
fn unseen(system: &System, time: f64, function: Function) -> Warning {
    let (what, span) = match function {
        Function::Rate(i) => {
            let state = &system.states[i];
            (format!("the rate of `{}`", state.name), Some(state.span))
        }
        Function::Surface(i) => {
            let switch = &system.switches[i];
            let span = switch.spans.first().copied();
            (format!("the switching function `{}`", switch.name), span)
        }
    };
    Warning {
        code: "W0719".into(),
        message: format!("the step from t = {time} may pass over narrow features of {what}"),
        span,
    }
}

/// Branches in a message before the rest is left out.
const MAX_SHOWN: usize = 9;

/// Ways to go on, in words.
fn branches(names: &ModeNames, candidates: &[Candidate]) -> String {
    let shown = candidates.iter().take(MAX_SHOWN);
    let mut branches: Vec<String> = shown.map(|candidate| names.branch(candidate)).collect();
    if candidates.len() > MAX_SHOWN {
        branches.push("..".to_owned());
    }
    branches.join(" | ")
}

/// That a method has taken one of several solutions.
pub(super) fn several(system: &System, candidates: &[Candidate], time: f64) -> Warning {
    let first = candidates.first().and_then(|candidate| candidate.first());
    let spans = first.and_then(|&(switch, _)| system.switches[switch].spans.first());
    Warning {
        code: "W0705".into(),
        message: format!(
            "at t = {time}, several solutions go on, of which the method takes one: {}",
            branches(&ModeNames::new(system), candidates)
        ),
        span: spans.copied(),
    }
}

fn non_unique(system: &System, names: &ModeNames, candidates: &[Candidate], time: f64) -> Failure {
    let branches = branches(names, candidates);
    let first = candidates.first().map_or(&[][..], Vec::as_slice);
    let switches: Vec<usize> = first.iter().map(|&(switch, _)| switch).collect();
    let is_member = |&i: &usize| matches!(system.switches[i].role, Role::Member(_));
    if switches.iter().any(is_member) {
        return Failure::SeveralSolutions {
            time,
            count: candidates.len(),
            branches,
            rows: rows(system, &switches),
        };
    }
    let example = match first {
        [(_, Side::Minus)] => "minus",
        [(_, Side::Slide)] => "slide",
        [(_, Side::Plus)] => "plus",
        _ => "[plus, slide]",
    };
    Failure::NonUnique {
        time,
        count: match candidates.len() {
            MAX_NAMED => format!("at least {MAX_NAMED}"),
            count => count.to_string(),
        },
        branches,
        example,
        surfaces: labels(system, &switches),
    }
}

/// One label per law.
fn of_laws(system: &System, laws: &[usize]) -> Vec<LabeledSpan> {
    let label = |&l: &usize| {
        let (name, span) = law_of(system, l);
        let laws = &system.jumps.laws;
        let stops = laws.get(l).is_some_and(|law| law.stops);
        let label = match stops {
            true => "holds here".to_owned(),
            false => format!("jump `{name}`"),
        };
        LabeledSpan::new_with_span(Some(label), span)
    };
    laws.iter().map(label).collect()
}

/// One label per equation or member of a pair.
fn rows(system: &System, switches: &[usize]) -> Vec<LabeledSpan> {
    let spans = switches.iter().map(|&i| system.switches[i].spans[0]);
    spans
        .map(|span| LabeledSpan::new_with_span(None, span))
        .collect()
}

/// One label per surface, where it is first written.
pub(super) fn labels(system: &System, switches: &[usize]) -> Vec<LabeledSpan> {
    let label = |&i: &usize| {
        let switch = &system.switches[i];
        let span = switch.spans.first()?;
        let text = match switch.relay {
            Some(_) => format!("relay `{}`", switch.name),
            None => format!("on the surface of `{}`", switch.name),
        };
        Some(LabeledSpan::new_with_span(Some(text), *span))
    };
    // A contact with friction has several surfaces at one place.
    let mut found: Vec<LabeledSpan> = Vec::new();
    for label in switches.iter().filter_map(label) {
        if !found.contains(&label) {
            found.push(label);
        }
    }
    found
}

/// Whether one of these is the gap or a slip velocity of a contact.
fn are_contacts(system: &System, switches: &[usize]) -> bool {
    let is_gap = |i: usize| system.jumps.touches(i);
    let mut switches = switches.iter();
    switches.any(|&i| is_gap(i) || system.switches[i].slip_of.is_some())
}
