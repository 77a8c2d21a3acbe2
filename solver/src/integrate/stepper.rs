//! One step: expand, bound, cut at the first event, and check.

use super::implicit::Workspace;
use super::order::ShortOrder;
use super::probes::Probes;
use super::rounding::Rounding;
use super::singular::{ends_at_root, is_on_root};
use super::singular_rates::{self, Roots};
use super::step::{Step, step_failure};
use super::stiffness::{MOST_NODES, Stiffness, motion};
use super::watch::{Watch, first_event, is_at_end, met, simultaneous, verify_start};
use crate::contact::coefficients::Coefficients;
use crate::contact::friction_disc;
use crate::contact::friction_disc::NearRest;
use crate::contact::prediction;
use crate::event::state::State;
use crate::events::grazing::Grazing;
use crate::events::roots::{Root, RootFinder};
use crate::events::unseen::Unseen;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::series;
use crate::expansion::taylor::Expansion;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, HybridSystem, Settings, Status, Switch};
use crate::selector::selection::Fold;

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
    pub order: ShortOrder,
    pub coefficients: Coefficients,
    pub probes: Probes,
    rounding: Rounding,
    pub unseen: Unseen,
    pub workspace: Workspace,
    /// Whether some switch may rest on its surface.
    may_rest: bool,
}

impl Stepper {
    /// One of a system, by series of an order.
    pub(crate) fn new(system: &HybridSystem, settings: &Settings, order: usize) -> Self {
        Stepper {
            tolerance: settings.tolerance,
            local_tolerance: settings.local_tolerance(),
            roots: RootFinder::new(order.max(MOST_NODES)),
            stiffness: Stiffness::new(settings.local_tolerance()),
            order: ShortOrder::new(system, order, settings.local_tolerance()),
            coefficients: Coefficients::of(system),
            probes: Probes::new(system.n_states()),
            rounding: Rounding::default(),
            unseen: Unseen::default(),
            workspace: Workspace::default(),
            may_rest: system.switches.iter().any(Switch::rests),
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
        let sets_off = !state.selection.onsets.is_empty();
        self.order.take(mode, goal < t1, sets_off);
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
        if self.may_rest
            && let Some(step) = singular_rates::arrive(mode, state, remaining)
        {
            return Ok(step);
        }
        mode.monitored.unobserved.clear();
        let (t, x) = (state.point.t, &state.point.x);
        let expanded = Expansion { mode }.around(t, x, &mut state.point.alpha);
        if expanded.is_err() {
            return Err(step_failure(mode));
        }
        state.scales.measure(mode, &mut state.bands);
        (state.scales).measure_held(mode, &state.point, &state.bands, remaining);
        state.report.stats.rhs_evaluations += mode.memory.order;
        if let Some(fold) = Fold::ahead(mode, state, remaining) {
            return Ok(Step::to_fold(state, fold));
        }
        let longest = longest(mode, state, remaining);
        let h = self.first_size(mode, state, [remaining, longest]);
        if self.may_rest
            && let Some(switch) = (Roots { mode }).wakes(&mut state.bands, h)
        {
            return Ok(Step::at_once(switch));
        }
        if goal < t1 && !self.order.suffices(mode, &state.scales, [h, remaining]) {
            return self.explicit_step(mode, state, goal, t1);
        }
        let tolerance = self.local_tolerance;
        let mut h = self.coefficients.expand(mode, tolerance, h);
        for attempt in 0..MAX_HALVINGS {
            let cut = self.cut(mode, state, h);
            let moves = cut.length >= remaining || cut.moves(&state.point);
            if !moves && cut.ends.is_none() && is_on_root(mode, &state.bands) {
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
        rests.ok_or_else(|| step_failure(mode))
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
        let h = self
            .rounding
            .step_size(mode, explicit, &mut state.scales, [remaining, longest]);
        let h = (self.near_rest(mode)).limit_direction_error(&mut state.bands, h);
        let bands = &mut state.bands;
        let h = Monitor { mode, bands }.watch(tolerance, &state.scales, h);
        let h = match self.may_rest {
            true => singular_rates::within_root(mode, state, tolerance, h),
            false => h,
        };
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
        10.0 * (mode.memory.order as f64) * tolerance.max(4.0 * f64::EPSILON)
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
        let defect = self.probes.defect(mode, state, seen, tolerance, allowed);
        if attempt == 0 && !defect.rate.is_finite() && ends_at_root(mode) {
            return Judged::EndsAtRoot;
        }
        let inaccurate = defect.rate.is_nan() || defect.rate > allowed;
        if inaccurate
            && self
                .rounding
                .differs(mode, &self.probes, &mut state.scales, seen, allowed)
        {
            return Judged::Again;
        }
        let unseen = cut.event.is_none() && cut.ends.is_none() && state.bands.leave_behind(mode);
        let looked = (self.coefficients).agree(mode, state, cut.length, allowed);
        // Without friction nothing determines a force that sticks.
        let turned = cut.ends.is_none() && mode.turned_over();
        let differs = inaccurate || !defect.switches_agree || unseen || !looked || turned;
        if differs {
            return Judged::Rejected;
        }
        self.unseen.suspect(mode, cut.length);
        match (self.unseen).vouches(mode, state, cut.length, allowed, &self.probes.scales) {
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
            None => (cut.length, Few::new()),
        };
        if triggers.is_empty() && h < longest && ends.is_none() {
            let motion = motion(mode, state, h);
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
    ) -> Result<(f64, Few<usize>), Status> {
        verify_start(Dense::Taylor(mode), &state.bands, root.tau, watch, h)?;
        // A double root of ψ is no better known from ψ than from its series.
        let tau = if is_at_end(Dense::Taylor(mode), root.tau, h, watch) {
            h
        } else if root.crosses && !watch.stops(mode) {
            watch.polish(mode, state, root.tau, h)?
        } else {
            root.tau
        };
        let dense = Dense::Taylor(mode);
        let triggers = simultaneous(dense, &state.bands, tau, h, watch.switch());
        state.selection.leaving = match (watch, &triggers[..]) {
            (Watch::Bound(i, _), [_]) if root.crosses => {
                Some((i, series::slope(dense.alpha(i), tau)))
            }
            _ => None,
        };
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
