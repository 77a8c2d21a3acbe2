//! Sizes that tell motion from rounding: of states and their rates, and of switching functions next to zero.

use super::mode::Mode;
use super::series;
use super::terms::{PERTURBATION, Perturbed};
use crate::hybrid::Side;
use crate::hybrid::point::Point;

/// |ψ| below this fraction of how far its states have moved is the surface; of an equation, and of a contact where a run
/// starts, below this fraction of how large they are.
pub(crate) const BAND: f64 = 1e-12;

/// Rates and distances to a bound below this fraction of their scale are ties.
pub(crate) const TIE: f64 = 1e-9;

/// Rounding of the terms of a rate.
pub(crate) const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// Magnitudes below this are zero: products of such numbers lose their digits to underflow.
pub(crate) const SMALLEST: f64 = 1e-250;

/// Roundings of the terms of a switch where a run starts: those of evaluating ψ and of the numbers of the model.
pub(crate) const AT_START: f64 = 2.0;

/// Those within which a surface that has just been left is not seen again.
pub(crate) const LEFT: f64 = 16.0;

/// The share of these that no band is narrower than: what rounding does to ψ at the start of a run.
pub(crate) const UNTOLD: f64 = AT_START / LEFT;

/// Roundings of what would move a state in a step, below which it does not move.
const HELD: f64 = 8.0;

/// Of each state x_i and its rate f_i, what their errors are relative to.
#[derive(Default)]
pub(crate) struct Scales {
    /// Largest |x_i| so far.
    pub largest: Vec<f64>,
    /// Of algebraic states, the size of what they balance; 0 of others.
    pub floor: Vec<f64>,
    /// x where the run starts, and largest |x_i - x_i(0)| so far.
    first: Vec<f64>,
    range: Vec<f64>,
    /// Size of the terms of each f_i at the expansion point, which may cancel.
    pub terms: Vec<f64>,
    /// The same now, or lately where it was larger.
    pub activity: Vec<f64>,
    /// The same of what each f_i has of states that are held at zero, as if they moved.
    pub held: Vec<f64>,
    /// ∫ activity dt, or of `held` where that is larger.
    pub work: Vec<f64>,
    /// Length of the last step that no event cut; 0 before the first step.
    pub last_step: f64,
    pub longest_step: f64,
}

impl Scales {
    /// Those of a run that starts at x.
    pub(crate) fn begin(&mut self, x: &[f64]) {
        for copy in [&mut self.largest, &mut self.first] {
            copy.clear();
            copy.extend_from_slice(x);
        }
        self.largest.iter_mut().for_each(|v| *v = v.abs());
        let zeros = [
            &mut self.floor,
            &mut self.range,
            &mut self.terms,
            &mut self.activity,
            &mut self.held,
            &mut self.work,
        ];
        zeros.into_iter().for_each(|v| refill(v, x.len(), 0.0));
        (self.last_step, self.longest_step) = (0.0, 0.0);
    }

    /// How large state i is, or would be after a step at the rate its terms have, or what it balances.
    pub(crate) fn size(&self, i: usize) -> f64 {
        self.reach(i).max(self.floor[i])
    }

    /// How large state i is, or would be after a step at the rate its terms have.
    pub(crate) fn reach(&self, i: usize) -> f64 {
        self.largest[i].max(self.activity[i] * self.last_step)
    }

    /// How far state i has moved, or would in a step at the rate its terms have.
    pub(crate) fn motion(&self, i: usize) -> f64 {
        self.range[i].max(self.activity[i] * self.last_step)
    }

    /// Measures Σ |∂f/∂(t, x, α)|·|(t, x, α)| of every rate f_i, as one perturbation of all inputs by different amounts
    /// shows it: the size of its terms, which may cancel, and with it its rounding error.
    pub(crate) fn measure(&mut self, mode: &mut Mode, bands: &mut Bands) {
        self.terms.copy_from_slice(&mode.field.f);
        bands.perturbed.change(mode);
        if mode.planes.any() {
            let turns = bands.measure_directions(mode);
            bands.perturbed.limit_turns(turns, mode);
            bands.perturbed.turn(mode);
        } else {
            bands.perturbed.turned.clone_from(&self.terms);
        }
        mode.field.eval(&bands.perturbed.first);
        let changed = mode.field.f.iter().zip(&bands.perturbed.turned);
        for (term, (perturbed, turned)) in self.terms.iter_mut().zip(changed) {
            let change = (perturbed - *term).abs().max((turned - *term).abs());
            let size = change / bands.perturbed.share;
            *term = if size.is_finite() { size } else { 0.0 };
        }
        self.forget_directions(mode);
        for (activity, &now) in self.activity.iter_mut().zip(&self.terms) {
            *activity = activity.max(now);
        }
    }

    /// Forgets how large the terms of what slips in a plane were: next to rest, what rounding does to a direction is large
    /// for as long as it is next to rest.
    fn forget_directions(&mut self, mode: &mut Mode) {
        for i in 0..mode.sides.len() {
            let slips = mode
                .planes
                .slips_with(i, &mode.system, &mode.sides)
                .is_some();
            for &state in mode.planes.forgotten(i, slips) {
                self.activity[state] = 0.0;
            }
        }
    }

    /// Measures the same of what contacts hold at zero in the run up to here, or in a first step of length h: its
    /// present value says nothing of how well it is known. So does a surface, of a ψ next to zero.
    pub(crate) fn measure_held(&mut self, mode: &mut Mode, point: &Point, bands: &Bands, h: f64) {
        refill(&mut self.held, mode.n, 0.0);
        let mut sliding = mode.sliding.iter();
        let has_contacts = sliding.any(|&i| mode.system.switches[i].is_contact());
        if !has_contacts && (mode.sliding.is_empty() || !bands.waits_at_surface(mode)) {
            return;
        }
        let step = match self.last_step {
            last if last > 0.0 => last,
            _ => h,
        };
        let motion = |scales: &Scales, i: usize| scales.activity[i] * step;
        let is_held =
            |scales: &Scales, i: usize| point.x[i].abs() < HELD * f64::EPSILON * motion(scales, i);
        if !(0..mode.n).any(|i| is_held(self, i)) {
            return;
        }
        mode.field.eval(&mode.memory.values);
        self.held.copy_from_slice(&mode.field.f);
        for i in (0..mode.n).filter(|&i| is_held(self, i)) {
            mode.memory.values[1 + i] += PERTURBATION * motion(self, i);
        }
        mode.field.eval(&mode.memory.values);
        mode.memory.values[1..=mode.n].copy_from_slice(&point.x);
        for (held, f) in self.held.iter_mut().zip(&mode.field.f) {
            let size = (f - *held).abs() / PERTURBATION;
            *held = if size.is_finite() { size } else { 0.0 };
        }
    }

    /// Size of the terms of φ of a sliding switch at the expansion point.
    pub(crate) fn terms_of_rate(&self, mode: &Mode, switch: usize) -> f64 {
        mode.surfaces.weigh(switch, |state| {
            self.terms[state].max(mode.memory.rows[mode.field.rows[state]].abs())
        })
    }

    /// The magnitude an error of state i within a step h of its series c is relative to: the largest of the run or
    /// within the step, and no less than what keeps `tolerance` above the rounding errors of f. What
    /// is truncated there has the same sign in every step and in a finer run too, which would not
    /// see it: it must not be larger than rounding itself. What follows from states that are held at zero is no better
    /// known than these.
    #[inline]
    pub(crate) fn of_error(&self, i: usize, c: &[f64], h: f64, tolerance: f64) -> f64 {
        let rounding = f64::EPSILON * self.activity[i].max(self.held[i]) * h;
        let magnitude = series::magnitude(c, h, 0);
        let scale = self.largest[i].max(magnitude).max(rounding / tolerance);
        scale.max(SMALLEST)
    }

    /// Takes note of the sizes at the end x of a step.
    pub(crate) fn record(&mut self, x: &[f64], length: f64) {
        let moved = x.iter().zip(&self.first);
        let moved = moved.map(|(x, first)| (x - first).abs());
        for (range, moved) in self.range.iter_mut().zip(moved) {
            *range = range.max(moved);
        }
        for (largest, x) in self.largest.iter_mut().zip(x) {
            *largest = largest.max(x.abs());
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
}

/// Of each switching function ψ_i, what is zero and what is rounding.
#[derive(Default)]
pub(crate) struct Bands {
    /// Size of the terms of ψ_i, which may cancel.
    pub terms: Vec<f64>,
    /// Below this |ψ_i| is zero, and below that it is rounding.
    pub width: Vec<f64>,
    pub rounding: Vec<f64>,
    /// Below this the speed of a contact without a gap is rounding.
    pub still: Vec<f64>,
    /// Whether ψ_i or α_i starts a step at the value that would be an event.
    pub armed: Vec<bool>,
    /// Whether the switch is on its surface, and its sides have meant the same motion so far.
    pub open: Vec<bool>,
    /// Above this a gap where the run starts is none of rounding of the numbers that it starts from.
    pub most_at_start: f64,
    /// |ψ'| where each switch with roots was last crossed downwards and upwards.
    pub crossed: Vec<[f64; 2]>,
    /// What shows the sizes of terms.
    pub perturbed: Perturbed,
}

impl Bands {
    /// Those of n switches of which nothing is known.
    pub(crate) fn begin(&mut self, n: usize) {
        let zeros = [
            &mut self.terms,
            &mut self.width,
            &mut self.rounding,
            &mut self.still,
        ];
        zeros.into_iter().for_each(|v| refill(v, n, 0.0));
        self.most_at_start = f64::INFINITY;
        refill(&mut self.armed, n, false);
        refill(&mut self.open, n, false);
        refill(&mut self.crossed, n, [f64::INFINITY; 2]);
    }

    /// Measures the size of the terms of ψ of a switch where the point is.
    pub(crate) fn measure(&mut self, mode: &mut Mode, switch: usize) {
        let (surfaces, values) = (&mut mode.surfaces, &mode.memory.values);
        let terms = self.perturbed.terms_of_psi(surfaces, switch, values);
        // No change of its inputs shows what cancels within a ψ that is zero.
        self.terms[switch] = match self.armed[switch] && mode.system.switches[switch].is_plain() {
            true => terms.max(surfaces.running_error(switch, values) / f64::EPSILON),
            false => terms,
        };
    }

    /// What rounding does to w is so many times as large in w/|w| where the point is, of all that slips in a plane: close
    /// to w = 0 forces are not known better.
    pub(crate) fn roundings_of_direction(&self, mode: &mut Mode) -> f64 {
        let mut most = 0.0_f64;
        for i in 0..mode.sides.len() {
            if let Some(other) = mode.planes.slips_with(i, &mode.system, &mode.sides) {
                let terms = self.terms[i].max(self.terms[other]);
                most = most.max(terms / mode.psi(i).hypot(mode.psi(other)));
            }
        }
        most
    }

    /// The same, once the terms of all such w have been measured.
    fn measure_directions(&mut self, mode: &mut Mode) -> f64 {
        for i in 0..mode.sides.len() {
            if let Some(other) = mode.planes.slips_with(i, &mode.system, &mode.sides) {
                self.measure(mode, i);
                self.measure(mode, other);
            }
        }
        self.roundings_of_direction(mode)
    }

    /// Whether something off its surface has just left it, or waits there.
    fn waits_at_surface(&self, mode: &Mode) -> bool {
        let is_off = |i: usize| mode.sides[i] != Side::Slide;
        (0..mode.sides.len())
            .any(|i| self.armed[i] && is_off(i) && mode.system.switches[i].is_plain())
    }

    /// A share of the band of ψ, or what of it rounding does not tell from zero where that is more.
    pub(crate) fn within(&self, switch: usize, share: f64) -> f64 {
        let width = self.width[switch];
        (share * width).max(width.min(UNTOLD * self.rounding[switch]))
    }

    /// Whether |ψ| where the point is is below its band, of two entries both.
    pub(crate) fn is_near(&self, mode: &mut Mode, switch: usize) -> bool {
        let other = mode.system.second(switch);
        let mut is_near = |i: usize| mode.psi(i).abs() <= self.width[i];
        is_near(switch) && other.is_none_or(is_near)
    }

    /// True when the last evaluation, at the end of the step, has left a surface behind that the
    /// series did not see.
    pub(crate) fn leave_behind(&self, mode: &mut Mode) -> bool {
        for at in 0..mode.monitored.switches.len() {
            let i = mode.monitored.switches[at];
            if !self.armed[i] && mode.monitored_psi(i) * mode.sides[i].sign() < -self.width[i] {
                return true;
            }
        }
        false
    }

    /// Within what a ψ that starts at zero stays for `h` if it does not move: its band, or how far rounding of a speed
    /// takes a contact, which is no farther than to where its series `c` says that it turns back.
    pub(crate) fn level(&self, switch: usize, c: &[f64], h: f64) -> f64 {
        let h = match *c {
            [_, speed, bend, ..] if speed > 0.0 && bend < 0.0 => h.min(-speed / bend),
            _ => h,
        };
        self.width[switch].max(self.still[switch] * h)
    }
}

/// Gives a vector n entries of one value, in the memory that it has.
pub(crate) fn refill<T: Clone>(memory: &mut Vec<T>, n: usize, value: T) {
    memory.clear();
    memory.resize(n, value);
}
