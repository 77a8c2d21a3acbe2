//! Simulation by finite elements with switch detection (FESD)
//!
//! x' = f(t, x, z),   0 = g(t, x, z),   0 ≤ a ⟂ b ≥ 0
//!
//! Every step of the grid is cut into finite elements with a Runge-Kutta method each, whose lengths are unknowns: a
//! switch is the end of an element (Nurkanović et al. 2024). The complementarity problem that this is needs no
//! mathematical program. In each element one member of every pair is zero throughout, so the active set of the element
//! before predicts the next one: Newton's method solves what is left, the signs of the other members say whether the
//! set was right, and where one of them vanishes the element ends. There the derivatives of the members say which set
//! is next.

mod adaptive;
mod branch;
mod element;
mod emit;
mod fold;
pub mod jumps;
mod march;
mod modes;

mod run;
pub(crate) mod selection;
mod stepping;
mod system;
mod tangents;
mod uniform;
mod watch;

use crate::event::{Cause, Event};
use crate::events::chattering::Here;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::modes::Modes;
use crate::fesd::run::{NEAR, Run};
use crate::fesd::selection::{Preferences, Selection};
pub use crate::fesd::system::full::{Functions, Kinds};
pub use crate::fesd::system::library::Library;
pub use crate::fesd::system::pointwise::{Leading, Rule, Rules, Surfaces, alpha_of, alphas_of};
use crate::fesd::system::pointwise::{Point, alpha_on};
use crate::hybrid::{Outcome, Side, Status};
use crate::integrate::tableau::{Family, Tableau, TableauError};
use crate::runtime::limit::Limit;
use crate::selector::ModeSelector;
use adaptive::Control;
pub use emit::{Elements, Multipliers, Observer};
use fold::{Folds, Length, Reached};
use march::{March, Piece};
pub use run::Rungs;
pub use stepping::{Stepper, SteppingSettings};
pub use system::balanced::{Balanced, Version};
pub use system::units::Units;
pub use system::{
    ComplementaritySystem, Disc, Full, Member, NEGLIGIBLE, Pair, Reduced, Switch, Watched, Zero,
};
pub use tangents::{Recorded, Recording, Turn, differentiate};

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The family of Runge-Kutta methods.
    pub family: Family,
    /// Its number of nodes.
    pub nodes: usize,
    /// How time is divided.
    pub grid: Grid,
    /// Largest number of elements.
    pub max_elements: usize,
    /// Largest number of events.
    pub max_events: usize,
    /// When the run stops.
    pub limit: Limit,
    /// Switches that are below their surface where several sets go on that differ in them.
    pub below: Vec<usize>,
}

impl Settings {
    /// A family with a number of nodes, and defaults.
    pub fn new(family: Family, nodes: usize) -> Self {
        Settings {
            family,
            nodes,
            grid: Grid::Adaptive { tolerance: 1e-8 },
            max_elements: 10_000_000,
            max_events: 1_000_000,
            limit: Limit::default(),
            below: Vec::new(),
        }
    }
}

/// How time is divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Grid {
    /// Steps of one length, with as many elements each; at most that many switches less one fit in
    /// a step before elements are added.
    Steps {
        /// Number of steps, at least 1.
        steps: usize,
        /// Elements per step, at least 1.
        elements: usize,
    },
    /// One element after the other, as long as the aim for the global error allows.
    Adaptive {
        /// Relative to the largest magnitude of each state; in (0, 1).
        tolerance: f64,
    },
}

/// The end of a run, with what concerns elements only.
#[derive(Clone, Debug)]
pub struct Solution {
    /// As of every simulation.
    pub outcome: Outcome,
    /// Elements added to steps with more switches than elements.
    pub added_elements: usize,
    /// How active sets were found.
    pub rungs: Rungs,
    /// Least member at a node, relative to the size of its pair or its change in an element: zero or rounding.
    pub least_member: f64,
}

/// What matters to a state, relative to its magnitude, where no tolerance says.
const MATTERS: f64 = 1e-8;

/// Lengths below this part of the horizon count as none.
const SHORTEST: f64 = 1e-14;

/// Elements or events in a row without progress in time that count as the end of all progress.
const MAX_STALLED: usize = 100;

/// Whether a shorter element may be solved.
fn is_of_length(status: &Status) -> bool {
    use Status::{MissedSwitch, NotFinite, Unsolved};
    matches!(status, Unsolved | NotFinite | MissedSwitch { .. })
}

/// Runs a system, keeping the functions it has met from one run to the next.
pub struct Simulator<'s> {
    system: &'s ComplementaritySystem,
    settings: Settings,
    modes: Modes<'s>,
    selection: Selection<'s>,
    march: March,
    folds: Folds,
}

impl<'s> Simulator<'s> {
    /// A simulator that has met no active set yet.
    pub fn new(
        system: &'s ComplementaritySystem,
        settings: Settings,
    ) -> Result<Self, TableauError> {
        let scheme = Scheme::new(Tableau::new(settings.family, settings.nodes)?);
        let modes = Modes::new(system, scheme);
        let preferences = Preferences {
            below: settings.below.clone(),
            limit: settings.limit.clone(),
            tolerance: match settings.grid {
                Grid::Adaptive { tolerance } => tolerance,
                Grid::Steps { .. } => MATTERS,
            },
        };
        Ok(Simulator {
            system,
            settings,
            selection: Selection::new(&modes, preferences),
            march: March::new(&modes.scheme),
            folds: Folds::new(&modes.scheme),
            modes,
        })
    }

    /// Lets a selector choose the modes of a system with nonlinear switches.
    pub fn with_mode_selector(mut self, mode_selector: impl ModeSelector + 's) -> Self {
        self.selection.guide(Box::new(mode_selector));
        self
    }

    /// Takes the functions of active sets that other runs of the system have compiled, in place of its own.
    pub fn knowing(mut self, library: Library) -> Self {
        self.modes.library = library;
        self
    }

    /// The functions of the active sets that runs have met, compiled.
    pub fn library(&self) -> &Library {
        &self.modes.library
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Order of the method where nothing switches.
    pub fn order(&self) -> usize {
        self.modes.scheme.tableau.order
    }

    /// What elements may miss their equations by between the nodes; none on a grid of steps.
    pub fn allowed_defect(&self) -> Option<f64> {
        match self.settings.grid {
            Grid::Steps { .. } => None,
            Grid::Adaptive { tolerance } => {
                Some(Control::new(&self.modes.scheme, tolerance).target)
            }
        }
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut dyn Observer) -> Solution {
        let known = self.n_functions();
        let mut run = Run::new(self.system, t0, t1, x0);
        let status = match self.integrate(&mut run, t0, t1, observer) {
            Ok(()) => Status::Solved,
            Err(status) => status,
        };
        run.record.stats.functions = self.n_functions() - known;
        let elapsed = if run.place.t > t0 {
            run.place.t - t0
        } else {
            1.0
        };
        let has_begun = !run.place.zeros.is_empty() || self.system.pairs.is_empty();
        let (sides, alpha) = if has_begun && !self.modes.all.is_empty() {
            self.modes.switches(&run)
        } else {
            let n_switches = self.system.n_switches();
            (vec![Side::Plus; n_switches].into(), vec![1.0; n_switches])
        };
        let record = run.record;
        Solution {
            outcome: Outcome {
                status,
                time: run.place.t,
                x: run.place.x,
                sides: sides.into_vec(),
                alpha,
                activity: record.work.iter().map(|work| work / elapsed).collect(),
                moved: run.history.moved.iter().map(|moved| moved.sqrt()).collect(),
                violation: record.defect,
                complementarity: 0.0,
                notes: record.notes,
                approaches: Vec::new(),
                stats: record.stats,
            },
            added_elements: record.added,
            rungs: record.rungs,
            least_member: record.least_member,
        }
    }

    /// Active sets and branches that have functions.
    fn n_functions(&self) -> usize {
        self.modes.all.len() + self.folds.n_branches()
    }

    fn integrate(
        &mut self,
        run: &mut Run,
        t0: f64,
        t1: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        self.load(run, t0);
        run.place.z = run.place.point(&self.modes.numbers).start(self.system);
        if let Some(switch) = self.system.below(run.place.point(&self.modes.numbers)) {
            return Err(Status::Penetrates { switch });
        }
        self.selection.begin(&mut self.modes, run, t1 - t0)?;
        match self.settings.grid {
            Grid::Steps { steps, elements } => {
                for k in 1..=steps {
                    let end = if k == steps {
                        t1
                    } else {
                        t0 + (t1 - t0) * (k as f64 / steps as f64)
                    };
                    self.pieces(run, end, observer, |simulator, run, end, observer| {
                        simulator.interval(run, end, elements, observer)
                    })?;
                }
                Ok(())
            }
            Grid::Adaptive { tolerance } => {
                let mut end = t0;
                while end < t1 {
                    end = self.system.stop(end).min(t1);
                    self.pieces(run, end, observer, |simulator, run, end, observer| {
                        simulator.adapt(run, end, tolerance, observer)
                    })?;
                }
                Ok(())
            }
        }
    }

    /// Integrates to `end` from breakpoint to breakpoint.
    fn pieces(
        &mut self,
        run: &mut Run,
        end: f64,
        observer: &mut dyn Observer,
        integrate: impl Fn(&mut Self, &mut Run, f64, &mut dyn Observer) -> Result<(), Status>,
    ) -> Result<(), Status> {
        let (length, near) = (end - run.place.t, NEAR * end.abs());
        while run.until < end - near {
            if !run.is_at_breakpoint() {
                let until = run.until;
                integrate(self, run, until, observer)?;
            }
            self.pass_breakpoint(run, length, observer)?;
        }
        if run.place.t < end {
            integrate(self, run, end, observer)?;
        }
        Ok(())
    }

    /// Whether a run has to stop.
    fn limit(&self, run: &Run) -> Result<(), Status> {
        if run.record.stats.steps >= self.settings.max_elements {
            return Err(Status::StepLimit);
        }
        if run.record.stats.events >= self.settings.max_events {
            return Err(run.history.chatter.at_limit(run.place.left(run.t1)));
        }
        Ok(self.settings.limit.check()?)
    }

    /// Whether the limit of elements lets a run come to t₁.
    fn gets_on(&self, run: &mut Run, t1: f64) -> Result<(), Status> {
        let (time, stats) = (run.place.t, &run.record.stats);
        let most = self.settings.max_elements;
        let falls_short = run.history.pace.falls_short(time, stats, most, t1);
        (!falls_short).then_some(()).ok_or(Status::StepLimit)
    }

    /// Takes the numbers that hold from an instant on, up to the next breakpoint.
    fn load(&mut self, run: &mut Run, from: f64) {
        run.until = self.modes.load(from);
        self.selection.set_numbers(&self.modes.numbers);
    }

    /// Integrates over one step of the grid: elements of equal length from switch to switch.
    fn interval(
        &mut self,
        run: &mut Run,
        end: f64,
        elements: usize,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let step = run.place.left(end);
        let mut left = elements;
        while run.place.t < end {
            self.limit(run)?;
            let length = Length {
                h: step / elements as f64,
                end,
                control: None,
            };
            if self.approach(run, length, observer)? {
                run.record.added += usize::from(left == 1);
                left = left.saturating_sub(1).max(1);
                continue;
            }
            let piece = self.march.piece(&mut self.modes, run, end, left, step)?;
            self.march.know_rounding(&mut self.modes, run);
            // A step with more switches than elements less one has elements added.
            let needed = piece.elements + usize::from(piece.event.is_some());
            run.record.added += needed.saturating_sub(left);
            left = left.saturating_sub(piece.elements).max(1);
            self.march
                .report(&mut self.modes, run, &piece, end, observer)?;
            // What comes after a breakpoint is decided there.
            if piece.event.is_some() && !run.is_at_breakpoint() {
                self.change(run, piece.event, step, observer)?;
            }
        }
        Ok(())
    }

    /// Integrates to `t1` with a global error of about `tolerance`.
    fn adapt(
        &mut self,
        run: &mut Run,
        t1: f64,
        tolerance: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let control = Control::new(&self.modes.scheme, tolerance);
        let target = control.target;
        let horizon = run.place.left(t1);
        let mut h = match run.lengths.next {
            0.0 => 0.01 * horizon,
            next => next,
        };
        let mut stalled = 0;
        while run.place.t < t1 {
            self.limit(run)?;
            self.gets_on(run, t1)?;
            let length = Length {
                h,
                end: t1,
                control: Some(control),
            };
            if self.approach(run, length, observer)? {
                continue;
            }
            let left = run.place.left(t1);
            // No sliver is left at the end.
            let length = match h {
                h if h >= left => left,
                h if h >= 0.5 * left => 0.5 * left,
                h => h,
            };
            let least_member = run.record.least_member;
            let (march, modes) = (&mut self.march, &mut self.modes);
            let event = match march.element(modes, run, 0, length) {
                Ok(event) => event,
                Err(status) if length > SHORTEST * horizon && is_of_length(&status) => {
                    run.lengths.last = 0.0;
                    h = 0.25 * length;
                    continue;
                }
                Err(status) => return Err(status),
            };
            let mut error = march.defect(modes, run, target);
            if error > target && march.misses_by_rounding(modes, run) {
                error = march.defect(modes, run, target);
            }
            let taken = march.solved[0].h;
            let next = control.next(taken, error);
            if error > target && taken > SHORTEST * horizon {
                run.record.stats.rejected += 1;
                (run.lengths.last, run.record.least_member) = (0.0, least_member);
                h = next.min(0.9 * taken);
                continue;
            }
            run.record.defect = run.record.defect.max(error);
            stalled = if taken <= SHORTEST * horizon {
                stalled + 1
            } else {
                0
            };
            if stalled > MAX_STALLED {
                return Err(Status::Unsolved);
            }
            let piece = Piece::single(event, event.is_none() && length == left);
            march.report(modes, run, &piece, t1, observer)?;
            // What was cut off by a switch or the end says less than what was tried.
            h = if event.is_some() || length == left {
                next.max(h)
            } else {
                next
            };
            run.lengths.next = h;
            if event.is_some() && !run.is_at_breakpoint() {
                self.change(run, event, h, observer)?;
            }
        }
        Ok(())
    }

    /// Goes on by an element whose independent variable is α, if a fold is near and has one.
    fn approach(
        &mut self,
        run: &mut Run,
        length: Length,
        observer: &mut dyn Observer,
    ) -> Result<bool, Status> {
        let (folds, modes) = (&mut self.folds, &mut self.modes);
        let Some(ahead) = folds.ahead(modes, run) else {
            return Ok(false);
        };
        match folds.approach(modes, run, ahead, length, observer)? {
            Reached::Nothing => return Ok(false),
            Reached::EndAtOnce => return Ok(true),
            Reached::Inside => {}
            Reached::Boundary => self.change(run, None, length.h, observer)?,
        }
        run.lengths.last = 0.0;
        Ok(true)
    }

    /// Goes on from a breakpoint.
    fn pass_breakpoint(
        &mut self,
        run: &mut Run,
        length: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let before = self.modes.sides(run.place.mode).into();
        let switches = self.selection.before_breakpoint(&mut self.modes, run);
        // The instant may be just ahead, by rounding.
        let from = run.place.t.max(run.until);
        self.load(run, from);
        run.place.go_to(from);
        self.selection
            .pass_breakpoint(switches, &mut self.modes, run, length)?;
        run.lengths.last = 0.0;
        self.tell_change(run, before, observer)
    }

    /// Chooses the next active set where the last element ended, with a member that has vanished, and reports the change;
    /// steps are about as long as `length`.
    fn change(
        &mut self,
        run: &mut Run,
        event: Option<usize>,
        length: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        run.history.stalled = if run.lengths.last <= 1e-13 * length {
            run.history.stalled + 1
        } else {
            0
        };
        if run.history.stalled > MAX_STALLED {
            return Err(Status::Accumulation);
        }
        let before = self.modes.sides(run.place.mode).into();
        let uncertain = event.map_or(0.0, |member| self.march.uncertain(&self.modes, run, member));
        self.selection.select(&mut self.modes, run, length)?;
        run.note_uncertain(uncertain);
        run.lengths.last = 0.0;
        self.tell_change(run, before, observer)
    }

    /// Reports a change of sides.
    fn tell_change(
        &mut self,
        run: &mut Run,
        before: Box<[Side]>,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let after = self.modes.sides(run.place.mode);
        if *before != *after || run.decisions.iter().any(|decision| decision.folds) {
            run.record.stats.events += 1;
            run.history.events.record(run.place.t, &before);
            let slides = |sides: &[Side]| sides.iter().filter(|s| **s == Side::Slide).count();
            // Elements as short as rounding do not show what infinitely many would do.
            if slides(after) > slides(&before) && run.history.events.limit(after).is_some() {
                return Err(Status::Accumulation);
            }
            observer.event(&Event {
                time: run.place.t,
                x: &run.place.x,
                before: &run.place.x,
                jumps: &[],
                decisions: &run.decisions,
                from: &before,
                to: after,
                accumulates: false,
                cause: Cause::default(),
            });
            run.history
                .chatter
                .record(run.place.t, &run.place.x, &before);
            self.chatters(run)?;
        }
        Ok(())
    }

    /// Whether switching goes on without end, up to the next breakpoint.
    fn chatters(&self, run: &Run) -> Result<(), Status> {
        let (place, numbers) = (&run.place, &self.modes.numbers);
        let here = Here {
            t: place.t,
            x: &place.x,
            sides: self.modes.sides(place.mode),
        };
        let psi = |t: f64, x: &[f64]| {
            let alpha: Vec<f64> = here.sides.iter().copied().map(alpha_on).collect();
            self.system.psi_at(Point { t, x, numbers }, &alpha)
        };
        let most = self.settings.max_events;
        let ends = run
            .history
            .chatter
            .chatters(most, here, run.t1.min(run.until), psi);
        ends.map_or(Ok(()), Err)
    }
}
