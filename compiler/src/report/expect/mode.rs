//! `expect mode at t is inside and sliding(s);`

use super::error::ExpectError;
use super::values::{Run, Words};
use super::{Subject, Verdict, as_name, relation};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::report::forms::text::significant;
use crate::report::{ModeInterval, Side, Trajectory};
use crate::syntax::{self, Arg, ExprKind};
use crate::system::Role;

/// All sides of surfaces, in the order in which messages name them.
const SIDES: [Side; 11] = [
    Side::Sliding,
    Side::Above,
    Side::Below,
    Side::On,
    Side::Off,
    Side::Open,
    Side::Closed,
    Side::Stick,
    Side::Slip,
    Side::Active,
    Side::Inactive,
];

/// Finds the mistakes in the description of a mode.
pub fn check(subject: &Subject<'_, '_>, mode: &syntax::Expr, diags: &mut Diagnostics) {
    let regions = all_regions(subject);
    let anywhere = ModeInterval {
        from: 0.0,
        to: subject.horizon,
        mode: String::new(),
        regions,
        between: Vec::new(),
        sides: vec![Side::Sliding; subject.system.switches.len()],
        contacts: Vec::new(),
    };
    if let Err(error) = holds(subject, mode, &anywhere) {
        diags.push(error);
    }
}

/// Compares the mode at an instant of a run.
pub fn evaluate(
    subject: &Subject<'_, '_>,
    at: &syntax::Expr,
    mode: &syntax::Expr,
    trajectory: &Trajectory,
) -> Verdict {
    let failed = |got: String| Verdict::Failed {
        expected: subject.sources.text(mode.span).to_owned(),
        got,
    };
    let mut diags = Diagnostics::new();
    let Some(instant) = relation::instant(subject, at, &mut diags) else {
        return relation::verdict_of(&diags);
    };
    let reached = trajectory.history.modes.last().map_or(0.0, |last| last.to);
    if instant > reached {
        return failed(format!("the run ended at {}", significant(reached, 12)));
    }
    let Some(interval) = trajectory.history.mode_at(instant) else {
        return failed("no mode".into());
    };
    match holds(subject, mode, interval) {
        Ok(true) => Verdict::Passed,
        Ok(false) => failed(interval.mode.clone()),
        Err(error) => {
            diags.push(error);
            relation::verdict_of(&diags)
        }
    }
}

/// Whether the description fits the mode; every part of it is looked at, so that all mistakes are found.
fn holds(
    subject: &Subject<'_, '_>,
    mode: &syntax::Expr,
    interval: &ModeInterval,
) -> Result<bool, ExpectError> {
    match &mode.kind {
        ExprKind::And(parts) => parts
            .iter()
            .try_fold(true, |all, part| Ok(holds(subject, part, interval)? && all)),
        ExprKind::Or(parts) => {
            parts.iter().try_fold(
                false,
                |any, part| Ok(holds(subject, part, interval)? || any),
            )
        }
        ExprKind::Not(part) => Ok(!holds(subject, part, interval)?),
        ExprKind::Call(word, args) => match as_name(word).and_then(side_of) {
            Some(wanted) if !args.is_empty() => are_on(subject, mode, args, wanted, interval),
            _ => Err(not_a_mode(subject, mode)),
        },
        // A region, `inside` or `pair[1,2]`.
        _ => {
            let name: String = subject.sources.text(mode.span).split_whitespace().collect();
            match all_regions(subject).contains(&name) {
                true => Ok(interval.regions.contains(&name)),
                false => Err(not_a_mode(subject, mode)),
            }
        }
    }
}

/// The side that a word names.
fn side_of(word: &str) -> Option<Side> {
    SIDES.into_iter().find(|side| side.as_str() == word)
}

/// Whether the surfaces in `sliding(s)`, `closed(C, D)` and the like are all on that side.
fn are_on(
    subject: &Subject<'_, '_>,
    mode: &syntax::Expr,
    surfaces: &[Arg],
    wanted: Side,
    interval: &ModeInterval,
) -> Result<bool, ExpectError> {
    if wanted == Side::Sliding
        && let Some(set) = indicated(subject, surfaces)
    {
        return Ok(interval.between.contains(&set));
    }
    let mut all = true;
    for arg in surfaces {
        let surface = match arg {
            Arg::Positional(surface, binders) if binders.is_empty() => surface,
            _ => return Err(not_a_mode(subject, mode)),
        };
        let wrong = |fitting: &str| {
            let name = subject.sources.text(surface.span).to_owned();
            ExpectError::WrongWord {
                word: wanted.as_str().to_owned(),
                help: format!("write `{fitting}({name})`, for example"),
                name,
                span: surface.span,
            }
        };
        let names = subject.system.jumps.contacts_of(&plain(subject, surface));
        let impulsive = impulsive(subject, &names);
        let is_on: Vec<bool> = match impulsive.is_empty() {
            false => {
                let contacts = impulsive.into_iter();
                let is_on = contacts.map(|k| contact_is_on(subject, k, wanted, interval));
                let is_on: Option<Vec<bool>> = is_on.collect();
                is_on.ok_or_else(|| wrong("closed"))?
            }
            true => {
                let switches = switches_of(subject, surface)?.into_iter();
                let is_on = switches.map(|k| switch_is_on(subject, k, wanted, interval));
                let is_on: Result<Vec<bool>, _> = is_on.collect();
                is_on.map_err(|words| wrong(words[0]))?
            }
        };
        // A contact is closed where one of its features is.
        all &= match names.len() > 1 && wanted != Side::Open {
            true => is_on.contains(&true),
            false => !is_on.contains(&false),
        };
    }
    Ok(all)
}

/// Whether a contact of steps of time is on a side; `None` where it never is.
fn contact_is_on(
    subject: &Subject<'_, '_>,
    contact: usize,
    wanted: Side,
    interval: &ModeInterval,
) -> Option<bool> {
    let held = interval.contacts.iter().find(|(k, _)| *k == contact);
    let side = held.map_or(Side::Open, |(_, side)| *side);
    let is_rough = subject.system.jumps.impulsive[contact].friction.is_some();
    match wanted {
        Side::Closed => Some(side != Side::Open),
        Side::Open => Some(side == Side::Open),
        Side::Stick | Side::Slip if is_rough => Some(side == wanted),
        _ => None,
    }
}

/// Whether a switch, or one that is flipped, is on a side; where it never is, what it may be.
fn switch_is_on(
    subject: &Subject<'_, '_>,
    (k, flipped): (usize, bool),
    wanted: Side,
    interval: &ModeInterval,
) -> Result<bool, &'static [&'static str]> {
    let (mut switch, mut is_closed) = (k, true);
    if matches!(wanted, Side::Stick | Side::Slip) {
        is_closed = interval.sides.get(k) != Some(&Side::Open);
        let mut slips = subject.system.switches.iter();
        switch = slips.position(|s| s.slip_of == Some(k)).unwrap_or(k);
    }
    let words = words_of(subject, switch);
    if !words.contains(&wanted.as_str()) {
        return Err(words);
    }
    let side = interval.sides.get(switch).copied().unwrap_or(Side::Sliding);
    let side = if flipped { opposite(side) } else { side };
    Ok(is_closed && side == wanted)
}

/// The contacts of steps of time with these names.
fn impulsive(subject: &Subject<'_, '_>, names: &[&str]) -> Vec<usize> {
    let contacts = subject.system.jumps.impulsive.iter().enumerate();
    let named = contacts.filter(|(_, contact)| names.contains(&contact.name.as_str()));
    named.map(|(k, _)| k).collect()
}

/// Arguments that are regions with indicators, in order of declaration.
fn indicated(subject: &Subject<'_, '_>, args: &[Arg]) -> Option<Vec<String>> {
    let partitions = subject.system.coupling.partitions.iter();
    let indicated = partitions.filter(|partition| !partition.indicators.is_empty());
    let regions = indicated.flat_map(|partition| &partition.regions);
    let known: Vec<&str> = regions.map(|region| region.name.as_str()).collect();
    let place = |arg: &Arg| {
        let Arg::Positional(name, _) = arg else {
            return None;
        };
        let name: String = subject.sources.text(name.span).split_whitespace().collect();
        known.iter().position(|known| *known == name)
    };
    let mut places = args.iter().map(place).collect::<Option<Vec<_>>>()?;
    places.sort_unstable();
    let names = places.iter().map(|&place| known[place].to_owned());
    (!places.is_empty()).then(|| names.collect())
}

/// What a switch may be.
fn words_of(subject: &Subject<'_, '_>, k: usize) -> &'static [&'static str] {
    let switch = &subject.system.switches[k];
    match switch.relay {
        Some(_) => &["on", "off"],
        None if subject.system.is_projected(k) || switch.role != Role::Step => {
            &["active", "inactive"]
        }
        None if switch.unilateral => &["closed", "open"],
        None if switch.slip_of.is_some() => &["stick", "slip"],
        None => &["above", "below", "sliding"],
    }
}

/// The text of an expression without blanks: `pair[1,2]`.
pub fn plain(subject: &Subject<'_, '_>, e: &syntax::Expr) -> String {
    subject.sources.text(e.span).split_whitespace().collect()
}

/// The switches that a name or a switching function means, and whether each is flipped.
pub fn switches_of(
    subject: &Subject<'_, '_>,
    surface: &syntax::Expr,
) -> Result<Vec<(usize, bool)>, ExpectError> {
    let unknown = || ExpectError::UnknownSurface {
        name: subject.sources.text(surface.span).to_owned(),
        span: surface.span,
        help: surfaces(subject),
    };
    let text = plain(subject, surface);
    let features = subject.system.jumps.contacts_of(&text);
    let is_meant = |name: &str| name == text || features.contains(&name);
    let switches = subject.system.switches.iter().enumerate();
    let contacts = switches.filter(|(_, switch)| switch.unilateral && is_meant(&switch.name));
    let contacts: Vec<(usize, bool)> = contacts.map(|(k, _)| (k, false)).collect();
    if !contacts.is_empty() {
        return Ok(contacts);
    }
    let mut diags = Diagnostics::new();
    let value = Words::new(subject, &Run::Unknown)
        .value(surface, &mut diags)
        .ok_or_else(unknown)?;
    // Where indicators cross that are not the smallest, nobody looks.
    let is_hidden = |k: usize| {
        let mut partitions = subject.system.coupling.partitions.iter();
        partitions.any(|p| !p.indicators.is_empty() && p.switches.contains(&k))
    };
    let switches = value.data.iter().map(|&entry| {
        let named = subject.system.named_switch(entry);
        if let Some((k, _)) = named
            && subject.system.switches[k].relay.is_some()
        {
            return Ok((k, false));
        }
        let psi = psi_of_named(subject, entry).unwrap_or(entry);
        let found = subject
            .system
            .switch_of(psi)
            .filter(|&(k, _)| !is_hidden(k));
        let found = found.or_else(|| Some((member(subject, entry)?, false)));
        found.or(named).ok_or_else(unknown)
    });
    switches.collect()
}

/// The member of a complementarity that an expression is.
fn member<'e>(subject: &Subject<'_, 'e>, entry: Expr<'e>) -> Option<usize> {
    let value = subject.system.read(entry);
    let mut switches = subject.system.switches.iter();
    switches.position(|k| matches!(k.role, Role::Member(_)) && -k.psi == value)
}

/// The switching function of an entry of a named switch.
fn psi_of_named<'e>(subject: &Subject<'_, 'e>, entry: Expr<'e>) -> Option<Expr<'e>> {
    let mut named = subject
        .model
        .switches
        .iter()
        .flat_map(|switch| switch.vars.iter().zip(&switch.psi));
    named.find(|(var, _)| **var == entry).map(|(_, psi)| *psi)
}

fn opposite(side: Side) -> Side {
    match side {
        Side::Below => Side::Above,
        Side::Above => Side::Below,
        other => other,
    }
}

fn all_regions(subject: &Subject<'_, '_>) -> Vec<String> {
    subject
        .model
        .statements
        .regions
        .iter()
        .map(|region| region.name.clone())
        .collect()
}

fn not_a_mode(subject: &Subject<'_, '_>, mode: &syntax::Expr) -> ExpectError {
    let mut known: Vec<String> = all_regions(subject)
        .iter()
        .map(|name| format!("`{name}`"))
        .collect();
    let sides = SIDES.iter();
    let sides = sides.filter(|side| !matches!(side, Side::Active | Side::Inactive));
    known.extend(sides.map(|side| format!("`{}(..)`", side.as_str())));
    ExpectError::NotAMode {
        text: subject.sources.text(mode.span).to_owned(),
        span: mode.span,
        help: format!("combine {} with `and`, `or`, `not`", list(&known)),
    }
}

fn surfaces(subject: &Subject<'_, '_>) -> String {
    let switches = subject.system.switches.iter().enumerate();
    let indicated = |k: &usize| {
        let mut partitions = subject.system.coupling.partitions.iter();
        partitions.any(|p| !p.indicators.is_empty() && p.switches.contains(k))
    };
    // A contact that is the smallest of several stands before them.
    let mut names: Vec<String> = Vec::new();
    for (_, switch) in switches.filter(|(k, _)| !indicated(k)) {
        let mut features = subject.system.jumps.features();
        let feature = features.find(|(own, _)| *own == switch.name);
        let owner = feature.and_then(|(_, owner)| owner);
        let owner = owner.map(|name| format!("`{name}`"));
        names.extend(owner.filter(|owner| !names.contains(owner)));
        names.push(format!("`{}`", switch.name));
    }
    match names.is_empty() {
        true => "the experiment has no switches".into(),
        false => format!("the surfaces are {}", list(&names)),
    }
}

/// The first few of many.
fn list(names: &[String]) -> String {
    const MAX: usize = 8;
    match names.len() {
        n if n > MAX => format!("{}, ...", names[..MAX].join(", ")),
        _ => names.join(", "),
    }
}
