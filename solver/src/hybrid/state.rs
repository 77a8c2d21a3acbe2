//! What changes from step to step.

use super::Side;
use crate::contact::slip_onset::Departure;
use crate::events::Approach;
use crate::events::grazing::Pending;
use crate::hybrid::status::{Note, Stats};
use crate::integrate::radau::{Radau, Start};
use crate::runtime::limit::Limit;
use crate::selector::Decision;
use crate::selector::fold::Fold;

/// From which α a nonlinear switch goes on where it is on its surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Entry {
    /// The one it has.
    #[default]
    Present,
    /// One that it had before all sides were looked at again.
    From(f64),
    /// None: the run starts on the surface.
    Unknown,
}

/// Time, state and mode, with the sizes that tell motion from rounding.
#[derive(Default)]
pub(crate) struct State {
    pub t: f64,
    /// What rounding has kept out of `t`.
    pub t_low: f64,
    pub x: Vec<f64>,
    pub sides: Box<[Side]>,
    pub alpha: Vec<f64>,
    /// Largest |x_i| so far.
    pub scale: Vec<f64>,
    /// Of algebraic states, the size of what they balance; 0 of others.
    pub floor: Vec<f64>,
    /// x where the run starts, and largest |x_i - x_i(0)| so far.
    pub first: Vec<f64>,
    pub range: Vec<f64>,
    /// Size of the terms of each f_i, which may cancel: now, or lately where it was larger.
    pub activity: Vec<f64>,
    /// The same of what each f_i has of states that are held at zero, as if they moved.
    pub held: Vec<f64>,
    /// ∫ activity dt, or of `held` where that is larger.
    pub work: Vec<f64>,
    /// Size of the terms of each ψ_i, which may cancel.
    pub terms: Vec<f64>,
    /// Switches whose ψ or α starts a step at the value that would be an event.
    pub armed: Vec<bool>,
    /// Switches on their surface whose sides mean the same motion, so far.
    pub open: Vec<bool>,
    /// Below this |ψ| is zero, and below that it is rounding.
    pub band: Vec<f64>,
    pub rounding: Vec<f64>,
    /// Below this the speed of a contact without a gap is rounding.
    pub still: Vec<f64>,
    /// |ψ'| where each switch with roots was last crossed downwards and upwards.
    pub crossed: Vec<[f64; 2]>,
    /// Length of the last step that no event cut; 0 before the first step.
    pub last_step: f64,
    pub longest_step: f64,
    /// Largest residual of complementarity problems so far.
    pub complementarity: f64,
    pub stats: Stats,
    /// When the run has to stop.
    pub limit: Limit,
    /// Functions taken up when the clock was looked at.
    pub functions: usize,
    /// What the caller should know, up to a number of them.
    pub notes: Vec<Note>,
    /// Switches whose ψ turns back close to zero in a step, and when after its start.
    pub close: Vec<(usize, f64)>,
    /// Those in the last step, and all that came close in the run.
    pub pending: Vec<Pending>,
    pub approaches: Vec<Approach>,
    /// Events in a row without progress in time.
    pub stalled: usize,
    /// How long the last event is uncertain; 0 once that is accounted for.
    pub window: f64,
    /// f before that event.
    pub before: Vec<f64>,
    /// Squares of what uncertain events may have moved the states by.
    pub moved: Vec<f64>,
    pub next: Vec<f64>,
    pub next_alpha: Vec<f64>,
    /// Where an implicit step starts.
    pub start: Start,
    /// Where nonlinear switches come from.
    pub entry: Vec<Entry>,
    /// The fold that the last step has ended in.
    pub fold: Option<Fold>,
    /// What decided about nonlinear switches at the last event.
    pub decisions: Vec<Decision>,
    /// Slip velocities with two entries that start from rest at the last event.
    pub departures: Vec<Departure>,
    /// The series of what bounds the α of two of these.
    pub margin: Vec<f64>,
    /// The mode at the start is known.
    pub begun: bool,
}

impl State {
    /// Starts a run, in the memory of the one before.
    pub(crate) fn begin(&mut self, t: f64, x: &[f64], n_switches: usize) {
        for copy in [
            &mut self.x,
            &mut self.next,
            &mut self.scale,
            &mut self.first,
        ] {
            copy.clear();
            copy.extend_from_slice(x);
        }
        self.scale.iter_mut().for_each(|v| *v = v.abs());
        let of_states = [
            &mut self.floor,
            &mut self.activity,
            &mut self.work,
            &mut self.held,
            &mut self.range,
            &mut self.before,
            &mut self.moved,
        ];
        for zeros in of_states {
            refill(zeros, x.len(), 0.0);
        }
        let of_switches = [
            &mut self.terms,
            &mut self.band,
            &mut self.rounding,
            &mut self.still,
            &mut self.next_alpha,
        ];
        for zeros in of_switches {
            refill(zeros, n_switches, 0.0);
        }
        refill(&mut self.alpha, n_switches, 1.0);
        refill(&mut self.crossed, n_switches, [f64::INFINITY; 2]);
        refill(&mut self.armed, n_switches, false);
        refill(&mut self.open, n_switches, false);
        refill(&mut self.entry, n_switches, Entry::Present);
        (self.fold, self.begun) = (None, false);
        self.decisions.clear();
        self.departures.clear();
        if self.sides.len() == n_switches {
            self.sides.fill(Side::Plus);
        } else {
            self.sides = vec![Side::Plus; n_switches].into();
        }
        (self.t, self.t_low) = (t, 0.0);
        (self.last_step, self.longest_step) = (0.0, 0.0);
        (self.functions, self.stalled, self.window) = (0, 0, 0.0);
        self.complementarity = 0.0;
        self.stats = Stats::default();
        self.notes.clear();
        self.pending.clear();
        self.approaches.clear();
        self.start = Start::default();
    }

    /// Moves time on. Rounding of a sum of many steps would be a drift of phase: it is kept.
    pub(crate) fn advance(&mut self, length: f64) {
        let start = self.t;
        let step = length + self.t_low;
        self.t = start + step;
        self.t_low = step - (self.t - start);
    }

    /// Within what a ψ that starts at zero stays for `h` if it does not move: its band, or how far rounding of a speed
    /// takes a contact, which is no farther than to where its series `c` says that it turns back.
    pub(crate) fn level(&self, switch: usize, c: &[f64], h: f64) -> f64 {
        let h = match *c {
            [_, speed, bend, ..] if speed > 0.0 && bend < 0.0 => h.min(-speed / bend),
            _ => h,
        };
        self.band[switch].max(self.still[switch] * h)
    }

    /// How large state i is, or would be after a step at the rate its terms have, or what it balances.
    pub(crate) fn size(&self, i: usize) -> f64 {
        let moved = self.scale[i].max(self.activity[i] * self.last_step);
        moved.max(self.floor[i])
    }

    /// How far state i has moved, or would in a step at the rate its terms have.
    pub(crate) fn motion(&self, i: usize) -> f64 {
        self.range[i].max(self.activity[i] * self.last_step)
    }

    /// Takes note of the sizes at the end of a step.
    pub(crate) fn record(&mut self, length: f64) {
        let moved = self
            .x
            .iter()
            .zip(&self.first)
            .map(|(x, first)| (x - first).abs());
        for (range, moved) in self.range.iter_mut().zip(moved) {
            *range = range.max(moved);
        }
        for (scale, x) in self.scale.iter_mut().zip(&self.x) {
            *scale = scale.max(x.abs());
        }
        // Terms of f may vanish for an instant, so their size is forgotten no faster than by half
        // in the longest step.
        self.longest_step = self.longest_step.max(length);
        let kept = match length / self.longest_step {
            share if share > 0.0 => 1.0 - 0.5 * share,
            _ => 1.0,
        };
        let rates = self.activity.iter_mut().zip(&self.held);
        for (work, (activity, held)) in self.work.iter_mut().zip(rates) {
            *work += activity.max(*held) * length;
            *activity *= kept;
        }
    }

    /// Moves to the end of an implicit step; `length` is what it would have been without an event.
    pub(crate) fn accept(&mut self, radau: &Radau, length: f64) {
        std::mem::swap(&mut self.x, &mut self.next);
        std::mem::swap(&mut self.alpha, &mut self.next_alpha);
        // The terms of stiff rates are large, but what rounding does to them is damped.
        for (i, activity) in self.activity.iter_mut().enumerate() {
            *activity = radau.noise(i) / radau.reach();
        }
        self.last_step = length;
        self.stats.implicit_steps += 1;
    }

    /// Takes note of something the caller should know, once for the same switches.
    pub(crate) fn note(&mut self, note: Note) {
        const MAX_NOTES: usize = 8;
        if self.notes.len() < MAX_NOTES && self.notes.iter().all(|known| !known.is_like(&note)) {
            self.notes.push(note);
        }
    }

    pub(crate) fn count_event(&mut self, length: f64, horizon: f64) {
        let progress = length > 1e-14 * horizon;
        self.stalled = if progress { 0 } else { self.stalled + 1 };
    }

    /// Sets the mode, with α where it is constant.
    pub(crate) fn set_sides(&mut self, sides: Box<[Side]>) {
        for (alpha, side) in self.alpha.iter_mut().zip(&sides) {
            match side {
                Side::Minus => *alpha = 0.0,
                Side::Plus => *alpha = 1.0,
                Side::Slide => {}
            }
        }
        self.sides = sides;
    }
}

fn refill<T: Clone>(memory: &mut Vec<T>, n: usize, value: T) {
    memory.clear();
    memory.resize(n, value);
}
