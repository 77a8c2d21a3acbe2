//! One step: expand, bound, cut at the first event, and check.

use super::implicit::Workspace;
use super::singular_rates;
use super::stiffness::{MOST_NODES, Stiffness};
use crate::contact::coefficients::Coefficients;
use crate::contact::friction_disc;
use crate::contact::friction_disc::{Disc, NearRest};
use crate::contact::prediction;
use crate::event::state::State;
use crate::events::grazing::Grazing;
use crate::events::roots::{Root, RootFinder};
use crate::events::unseen::Unseen;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::scales::Bands;
use crate::expansion::series;
use crate::hybrid::point::Point;
use crate::hybrid::{HybridSystem, Settings, Status};
use crate::selector::select::BAND;
use crate::selector::selection::Fold;

/// An accepted step, whose end is the point of the state.
#[derive(Default)]
pub(crate) struct Step {
    pub length: f64,
    pub reaches_end: bool,
    /// Switches whose surface is reached, or whose sliding ends, at the end of the step.
    pub triggers: Vec<usize>,
    /// ‖x' - f‖ h at the end, relative to the magnitude of the states.
    pub defect: f64,
    /// Whether its polynomials are those of the implicit method.
    pub implicit: bool,
    /// What ends the run where it ends.
    pub ends: Option<Status>,
    /// Whether it is the first one of what sets off from rest, in the mode in which that sticks.
    pub departs: bool,
}

impl Step {
    /// One that ends in a fold, where the point behind it is known.
    fn to_fold(state: &mut State, fold: Fold) -> Self {
        std::mem::swap(&mut state.point.x, &mut state.trial.x);
        for turn in &fold.turns {
            state.point.alpha[turn.switch] = turn.alpha;
        }
        let (length, switch) = (fold.after, fold.switch);
        state.selection.fold = Some(fold);
        Step {
            length,
            ..Step::at_once(switch)
        }
    }

    /// One without a length, at the end of which a switch changes.
    pub(crate) fn at_once(switch: usize) -> Self {
        Step {
            triggers: vec![switch],
            ..Step::default()
        }
    }
}

/// What is monitored for a root: ψ off the surface, α and 1 - α on it.
#[derive(Clone, Copy)]
pub(crate) enum Watch {
    Surface(usize),
    /// Switch and the bound 0 or 1.
    Bound(usize, f64),
    /// The first of two entries of a slip velocity that stick: 1 - |2α - 1|².
    Disc(usize),
}

impl Watch {
    pub(crate) fn switch(self) -> usize {
        match self {
            Watch::Surface(i) | Watch::Bound(i, ..) | Watch::Disc(i) => i,
        }
    }

    /// Whether a slip velocity with two entries stops: it has no sign behind that.
    fn stops(self, mode: &Mode) -> bool {
        matches!(self, Watch::Surface(i) if mode.system.switches[i].is_in_disc())
    }

    /// Whether a contact opens that sticks to the end: a force that is zero has no friction to be determined.
    fn lets_go(self, mode: &Mode) -> bool {
        let Watch::Bound(normal, _) = self else {
            return false;
        };
        let mut sliding = mode.sliding.iter();
        sliding.any(|&i| mode.system.slip_of(i) == Some(normal))
    }

    /// Moves a root of the series to the root of the function itself, by Newton's method on
    /// the length of the step.
    fn polish(
        self,
        mode: &mut Mode,
        state: &mut State,
        mut tau: f64,
        h: f64,
    ) -> Result<f64, Status> {
        for _ in 0..4 {
            Dense::Taylor(mode).states_at(tau, &mut state.trial.x);
            Dense::Taylor(mode).alphas_at(tau, &mut state.trial.alpha);
            let (value, slope) = match self {
                Watch::Surface(i) => {
                    mode.set(state.point.t + tau, &state.trial.x, &state.trial.alpha);
                    (mode.psi(i), series::slope(mode.psi_series(i), tau))
                }
                Watch::Bound(..) | Watch::Disc(_) => {
                    let singular = mode
                        .solve_alpha(state.point.t + tau, &state.trial.x, &mut state.trial.alpha)
                        .is_err();
                    if singular && self.lets_go(mode) {
                        break;
                    }
                    if singular {
                        return Err(mode.stuck());
                    }
                    match self {
                        Watch::Bound(i, limit) => (
                            state.trial.alpha[i] - limit,
                            series::slope(mode.alpha_series(i), tau),
                        ),
                        _ => {
                            let disc = Disc::of(Dense::Taylor(mode), self.switch());
                            let disc = disc.expect("it has two entries");
                            disc.margin_at(tau, &state.trial.alpha)
                        }
                    }
                }
            };
            let next = tau - value / slope;
            // A root that the function and its series do not share is a tangency: keep the series'.
            if !next.is_finite() || next < 0.0 || (next - tau).abs() > 1e-3 * h {
                break;
            }
            // Where the surface has just been left, a value that is rounding says nothing of the root.
            if let Watch::Surface(i) = self
                && state.bands.armed[i]
                && value.abs() <= 8.0 * f64::EPSILON * state.bands.terms[i]
            {
                break;
            }
            let moved = (next - tau).abs();
            tau = next.min(h);
            if moved <= f64::EPSILON * (state.point.t.abs() + tau) {
                break;
            }
        }
        Ok(tau)
    }
}

/// Halvings of a step before it counts as impossible.
const MAX_HALVINGS: usize = 60;

/// Halvings of a step for a switch that nothing but outputs looks at.
const PATIENCE: usize = 20;

/// Steps grow at most by this factor, which bounds the search for their size.
const MAX_GROWTH: f64 = 10.0;

/// Takes steps within a mode, by one method or another.
pub(crate) struct Stepper {
    /// Errors of a run and of a step, relative to the magnitude of the states.
    pub tolerance: f64,
    pub local_tolerance: f64,
    pub roots: RootFinder,
    pub stiffness: Stiffness,
    pub coefficients: Coefficients,
    pub unseen: Unseen,
    pub workspace: Workspace,
}

impl Stepper {
    /// One of a system, by series of an order.
    pub(crate) fn new(system: &HybridSystem, settings: &Settings, order: usize) -> Self {
        Stepper {
            tolerance: settings.tolerance,
            local_tolerance: settings.local_tolerance(),
            roots: RootFinder::new(order.max(MOST_NODES)),
            stiffness: Stiffness::new(settings.local_tolerance()),
            coefficients: Coefficients::of(system),
            unseen: Unseen::default(),
            workspace: Workspace::default(),
        }
    }

    /// The polynomials of the last step.
    pub(crate) fn dense<'a>(&'a self, mode: &'a Mode, implicit: bool) -> Dense<'a> {
        match self.stiffness.method() {
            Some(radau) if implicit => Dense::Collocation(mode, radau, &self.workspace.psi),
            _ => Dense::Taylor(mode),
        }
    }

    /// Takes the longest step up to `goal` that the tolerance and the next event allow; the run goes
    /// on to `t1`.
    pub(crate) fn step(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        goal: f64,
        t1: f64,
    ) -> Result<Step, Status> {
        if !state.selection.onsets.is_empty()
            && let Some(step) = self.slip_onset_step(mode, state, goal, t1)
        {
            return Ok(step);
        }
        // The implicit method solves φ_K = 0 as it stands, which lower derivatives have no part in, and sees no folds.
        let is_solved = |&i: &usize| {
            mode.surfaces.n_derivatives(i) == 0 && !mode.system.switches[i].is_nonlinear
        };
        if self.stiffness.implicit
            && mode.sliding.iter().all(is_solved)
            && let Some(step) = self.implicit_step(mode, state, goal)?
        {
            return Ok(step);
        }
        self.explicit_step(mode, state, goal, t1)
    }

    fn explicit_step(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        goal: f64,
        t1: f64,
    ) -> Result<Step, Status> {
        let remaining = state.point.remaining(goal);
        if mode.may_rest
            && let Some(step) = singular_rates::arrive(mode, state, remaining)
        {
            return Ok(step);
        }
        mode.monitored.unobserved.clear();
        if mode
            .expand(state.point.t, &state.point.x, &mut state.point.alpha)
            .is_err()
        {
            return Err(mode.stuck());
        }
        mode.measure_terms(&mut state.scales, &mut state.bands);
        mode.measure_held(&state.point, &mut state.scales, &state.bands, remaining);
        state.report.stats.rhs_evaluations += mode.order;
        if let Some(fold) = Fold::ahead(mode, state, remaining) {
            return Ok(Step::to_fold(state, fold));
        }
        let longest = longest(mode, state, remaining);
        let h = self.first_size(mode, state, [remaining, longest]);
        if mode.may_rest
            && let Some(switch) = mode.wakes(&mut state.bands, h)
        {
            return Ok(Step::at_once(switch));
        }
        let tolerance = self.local_tolerance;
        let mut h = self.coefficients.expand(mode, tolerance, h);
        for attempt in 0..MAX_HALVINGS {
            let cut = self.cut(mode, state, h);
            let moves = cut.length >= remaining || cut.moves(&state.point);
            if !moves && cut.ends.is_none() && mode.is_on_root(&state.bands) {
                return self.step_off(mode, state, remaining);
            }
            let defect = match self.judge_step(mode, state, &cut, attempt) {
                Judged::Accepted(defect) => defect,
                Judged::Again => continue,
                Judged::EndsAtRoot => return self.step_off(mode, state, remaining),
                Judged::Rejected => {
                    state.report.stats.rejected += 1;
                    if attempt == PATIENCE {
                        mode.monitored.stop_monitoring();
                    }
                    h *= 0.5;
                    continue;
                }
            };
            if !moves && cut.event.is_none() && cut.ends.is_none() {
                break;
            }
            return self.accept(
                mode,
                state,
                cut,
                [h, longest],
                [remaining, t1 - state.point.t],
                defect,
            );
        }
        let rests = self.near_rest(mode).comes_to_rest(state);
        rests.ok_or_else(|| mode.stuck())
    }

    /// Steps of what slips in two directions, close to rest.
    fn near_rest<'m>(&self, mode: &'m mut Mode) -> NearRest<'m> {
        NearRest {
            mode,
            tolerance: self.local_tolerance,
        }
    }

    /// How long it may be by the series of states, directions and ψ.
    fn first_size(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        [remaining, longest]: [f64; 2],
    ) -> f64 {
        let (explicit, tolerance) = (self.stiffness.explicit_tolerance(), self.local_tolerance);
        let h = mode.step_size_above_rounding(explicit, &mut state.scales, [remaining, longest]);
        let h = self.near_rest(mode).keeps_directions(&mut state.bands, h);
        let h = mode.monitor(tolerance, &state.scales, &mut state.bands, h);
        self.near_rest(mode).leaves_rest(&state.bands, h)
    }

    /// Where the first of what is monitored cuts a step h.
    fn cut(&mut self, mode: &mut Mode, state: &mut State, h: f64) -> Cut {
        let closeness = self.tolerance;
        let event = first_event(&mut self.roots, Dense::Taylor(mode), state, h, closeness);
        let length = event.as_ref().map_or(h, |(root, _)| root.tau);
        // What slips in two directions stops once it is all but at rest.
        let short = event.as_ref().and_then(|(root, watch)| match watch {
            Watch::Surface(i) => {
                let near_rest = self.near_rest(mode);
                near_rest.stops_short(&state.point, &state.bands, *i, root.tau)
            }
            _ => None,
        });
        let (event, length) = match short {
            Some(length) => (None, length),
            None => (event, length),
        };
        match self.coefficients.leave(&mut self.roots, mode, length) {
            Some((length, status)) => Cut {
                event: None,
                length,
                ends: Some(status),
            },
            None => Cut {
                event,
                length,
                ends: None,
            },
        }
    }

    /// The defect of a step: the last term of the series, differentiated, is what it shows of the error.
    pub(crate) fn allowed_defect(&self, mode: &Mode) -> f64 {
        let tolerance = self.local_tolerance;
        10.0 * (mode.order as f64) * tolerance.max(4.0 * f64::EPSILON)
    }

    /// Whether the series of a step that is cut are the solution.
    fn judge_step(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        cut: &Cut,
        attempt: usize,
    ) -> Judged {
        let (tolerance, allowed) = (self.local_tolerance, self.allowed_defect(mode));
        // Where it is, the direction of its friction is rounding, or its share of a force that is zero.
        let is_blurred = |watch: Watch| watch.stops(mode) || watch.lets_go(mode);
        let stops = (cut.event.as_ref()).is_some_and(|(_, watch)| is_blurred(*watch));
        let seen = if stops {
            friction_disc::DIRECTED * cut.length
        } else {
            cut.length
        };
        let defect = mode.defect(
            &state.point,
            &state.scales,
            &state.bands,
            seen,
            tolerance,
            allowed,
        );
        if attempt == 0 && !defect.rate.is_finite() && mode.ends_at_root() {
            return Judged::EndsAtRoot;
        }
        let inaccurate = defect.rate.is_nan() || defect.rate > allowed;
        if inaccurate && mode.differs_by_rounding(&mut state.scales, seen, allowed) {
            return Judged::Again;
        }
        let unseen = cut.event.is_none() && cut.ends.is_none() && mode.on_wrong_side(&state.bands);
        let looked = (self.coefficients).agree(mode, state, cut.length, allowed);
        // Without friction nothing determines a force that sticks.
        let turned = cut.ends.is_none() && mode.turned_over();
        let differs = inaccurate || !defect.switches_agree || unseen || !looked || turned;
        if differs {
            return Judged::Rejected;
        }
        self.unseen.suspect(mode, cut.length);
        match self.unseen.vouches(mode, state, cut.length, allowed) {
            true => Judged::Accepted(defect.rate),
            false => Judged::Rejected,
        }
    }

    /// Moves to the end of a step of size h, at most `longest`, that is cut.
    fn accept(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        cut: Cut,
        [h, longest]: [f64; 2],
        left: [f64; 2],
        defect: f64,
    ) -> Result<Step, Status> {
        let Cut { event, ends, .. } = cut;
        let (length, triggers) = match event {
            Some((root, watch)) => self.polish_event(mode, state, root, watch, h)?,
            None => (cut.length, Vec::new()),
        };
        if triggers.is_empty() && h < longest && ends.is_none() {
            let motion = mode.motion(&state.scales, &state.bands, h);
            self.stiffness.after_explicit(mode, h, motion, left);
        }
        let dense = Dense::Taylor(mode);
        let met = met(event).filter(|(i, _)| !mode.system.switches[*i].is_in_disc());
        Grazing::new(dense, self.tolerance).note(state, length, met);
        dense.states_at(length, &mut state.trial.x);
        std::mem::swap(&mut state.point.x, &mut state.trial.x);
        if !state.point.x.iter().all(|x| x.is_finite()) {
            std::mem::swap(&mut state.point.x, &mut state.trial.x);
            return Err(Status::NotFinite);
        }
        dense.alphas_at(length, &mut state.point.alpha);
        let reaches_end = length >= left[0];
        let is_cut = reaches_end || ends.is_some() || !triggers.is_empty();
        state.scales.last_step = if is_cut && state.scales.last_step > 0.0 {
            state.scales.last_step.max(length)
        } else {
            h
        };
        Ok(Step {
            length,
            reaches_end,
            triggers,
            defect,
            ends,
            ..Step::default()
        })
    }

    /// When an event is exactly, and all switches that it is of.
    fn polish_event(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        root: Root,
        watch: Watch,
        h: f64,
    ) -> Result<(f64, Vec<usize>), Status> {
        verify_start(Dense::Taylor(mode), &state.bands, root.tau, watch, h)?;
        // A double root of ψ is no better known from ψ than from its series.
        let tau = if is_at_end(Dense::Taylor(mode), root.tau, h, watch) {
            h
        } else if root.crosses && !watch.stops(mode) {
            watch.polish(mode, state, root.tau, h)?
        } else {
            root.tau
        };
        let triggers = simultaneous(Dense::Taylor(mode), &state.bands, tau, h, watch.switch());
        Ok((tau, triggers))
    }
}

/// How long a step may be at most.
fn longest(mode: &mut Mode, state: &State, remaining: f64) -> f64 {
    let longest = if state.scales.last_step > 0.0 {
        remaining.min(MAX_GROWTH * state.scales.last_step)
    } else {
        remaining
    };
    match prediction::has_idle_contact(mode, state) {
        true => longest.min(prediction::horizon(mode)),
        false => longest,
    }
}

/// What cuts a step: an event, or what ends the run.
struct Cut {
    event: Option<(Root, Watch)>,
    length: f64,
    ends: Option<Status>,
}

impl Cut {
    /// Whether time has digits for its length.
    fn moves(&self, point: &Point) -> bool {
        point.t + (self.length + point.t_low) > point.t
    }
}

/// Whether the series of a step are the solution.
enum Judged {
    /// They are, with this defect.
    Accepted(f64),
    /// They differ from it by rounding, whose size is known now.
    Again,
    /// They are none, at a root.
    EndsAtRoot,
    Rejected,
}

/// The surface that an event meets, and how.
pub(crate) fn met(event: Option<(Root, Watch)>) -> Option<(usize, Root)> {
    match event {
        Some((root, Watch::Surface(switch))) => Some((switch, root)),
        _ => None,
    }
}

/// The least root of everything monitored in (0, h]. Takes note of each ψ that turns back before as close
/// to zero as a run of this tolerance may be on either side.
pub(crate) fn first_event(
    roots: &mut RootFinder,
    dense: Dense,
    state: &mut State,
    h: f64,
    tolerance: f64,
) -> Option<(Root, Watch)> {
    let mut first: Option<(Root, Watch)> = None;
    let mode = dense.mode();
    let grazing = Grazing::new(dense, tolerance);
    state.approaches.close.clear();
    for &i in &mode.sliding {
        if mode.planes.onsets.contains(&i) {
            continue;
        }
        let alpha = dense.alpha(i);
        let reach = first.map_or(h, |(root, _)| root.tau);
        let mut margin = std::mem::take(&mut roots.margin);
        let disc = Disc::of(dense, i);
        if let Some(root) = disc.and_then(|disc| disc.leaves(roots, &mut margin, reach)) {
            first = Some((root, Watch::Disc(i)));
        }
        roots.margin = margin;
        for &limit in mode.system.switches[i].limits() {
            let reach = first.map_or(h, |(root, _)| root.tau);
            let inside = if limit == 0.0 { 1.0 } else { -1.0 };
            let start = alpha[0] - limit;
            let band =
                (start.abs() <= crate::selector::judge::TIE).then_some(crate::selector::judge::TIE);
            if let Some(root) = first_root(roots, start, alpha, reach, inside, band, 0.0) {
                first = Some((root, Watch::Bound(i, limit)));
            }
        }
    }
    for &i in &mode.monitored.switches {
        let reach = first.map_or(h, |(root, _)| root.tau);
        let c = dense.psi(i);
        // Contacts close where they open by less than their band.
        let band = state.bands.armed[i].then(|| match mode.system.switches[i].is_plain() {
            true => mode.rounding_of_motion(i, state, h),
            false if mode.system.switches[i].is_contact() => state.bands.level(i, c, h),
            false => SEEN * state.bands.level(i, c, h),
        });
        let level = match mode.system.switches[i].is_in_disc() {
            true => 0.0,
            false => grazing.closeness(i, &state.scales, &state.bands, h),
        };
        let root = first_root(roots, c[0], c, reach, mode.sides[i].sign(), band, level);
        state
            .approaches
            .close
            .extend(roots.close.iter().map(|&tau| (i, tau)));
        if let Some(root) = root {
            first = Some((root, Watch::Surface(i)));
        }
    }
    first
}

/// The fraction of its band that ψ must leave between two events to have been there: sixteen roundings of
/// its terms.
const SEEN: f64 = 16.0 * f64::EPSILON / BAND;

/// The least root of a series that should have sign `side`; its constant term is `start` instead of
/// `c[0]`. One that starts at zero, within `band`, is divided by its leading power first, as is `level`;
/// one that starts on the wrong side has its root at once.
pub(crate) fn first_root(
    roots: &mut RootFinder,
    start: f64,
    c: &[f64],
    h: f64,
    side: f64,
    band: Option<f64>,
    level: f64,
) -> Option<Root> {
    roots.close.clear();
    let (start, c, level) = match band {
        Some(band) => {
            let leading = series::leading(c, h, band)?;
            (c[leading], &c[leading..], level / h.powi(leading as i32))
        }
        None => (start, c, level),
    };
    if start * side <= 0.0 {
        return Some(Root {
            tau: 0.0,
            crosses: true,
        });
    }
    roots.first(start, &c[1..], h, level)
}

/// A root at the very start is rounding, or a switch that was missed.
pub(crate) fn verify_start(
    dense: Dense,
    bands: &Bands,
    tau: f64,
    watch: Watch,
    h: f64,
) -> Result<(), Status> {
    if let (Watch::Surface(switch), 0.0) = (watch, tau) {
        let c = dense.psi(switch);
        let rounding = bands.width[switch].max(64.0 * f64::EPSILON * bands.terms[switch]);
        if c[0].abs() > rounding.max(1e-9 * series::magnitude(c, h, 0)) {
            return Err(Status::MissedSwitch { switch });
        }
    }
    Ok(())
}

/// `trigger` and every other switch whose own event is not told apart from it.
pub(crate) fn simultaneous(
    dense: Dense,
    bands: &Bands,
    tau: f64,
    h: f64,
    trigger: usize,
) -> Vec<usize> {
    let mode = dense.mode();
    let together = |&i: &usize| {
        let alpha = series::value(dense.alpha(i), tau);
        Disc::of(dense, i).is_some_and(|disc| disc.is_at_rim(tau))
            || (mode.system.switches[i].limits().iter())
                .any(|limit| (alpha - limit).abs() <= TOGETHER)
    };
    let mut triggers: Vec<usize> = mode.sliding.iter().copied().filter(together).collect();
    let reached = |&i: &usize| {
        let c = dense.psi(i);
        let size = match mode.system.switches[i].is_in_disc() {
            true => friction_disc::STOPS * bands.width[i],
            false => TOGETHER * series::magnitude(c, h, 0),
        };
        !bands.armed[i] && series::value(c, tau).abs() <= size
    };
    triggers.extend(mode.monitored.switches.iter().copied().filter(reached));
    triggers.push(trigger);
    triggers.sort_unstable();
    triggers.dedup();
    triggers
}

/// Events closer than this, relative to the size of ψ in the step, are one.
pub(crate) const TOGETHER: f64 = 1e-12;

impl Mode {
    /// True when the last evaluation, at the end of the step, has left a surface behind that the
    /// series did not see.
    pub(crate) fn on_wrong_side(&mut self, bands: &Bands) -> bool {
        for at in 0..self.monitored.switches.len() {
            let i = self.monitored.switches[at];
            if !bands.armed[i] && self.monitored_psi(i) * self.sides[i].sign() < -bands.width[i] {
                return true;
            }
        }
        false
    }
}

/// An event that is closer to the end of a step, as a fraction of the step, may be there.
const NEAR: f64 = 1e-6;

/// True when an event at `tau` is not told apart from the end of its step `h`.
pub(crate) fn is_at_end(dense: Dense, tau: f64, h: f64, watch: Watch) -> bool {
    let at_end = match watch {
        Watch::Surface(i) => {
            let c = dense.psi(i);
            series::value(c, h).abs() <= TOGETHER * series::magnitude(c, h, 0)
        }
        Watch::Bound(i, limit) => (series::value(dense.alpha(i), h) - limit).abs() <= TOGETHER,
        Watch::Disc(_) => false,
    };
    at_end && h - tau <= NEAR * h
}
