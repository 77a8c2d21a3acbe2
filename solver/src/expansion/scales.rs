//! Sizes that tell motion from rounding: of states and their rates, and of switching functions next to zero.

/// |ψ| below this fraction of how far its states have moved is the surface; of a contact, a slip velocity or an
/// equation below this fraction of how large they are.
pub(crate) const BAND: f64 = 1e-12;

/// Rates and distances to a bound below this fraction of their scale are ties.
pub(crate) const TIE: f64 = 1e-9;

/// Rounding of the terms of a rate.
pub(crate) const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

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
    /// Size of the terms of each f_i, which may cancel: now, or lately where it was larger.
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
            &mut self.activity,
            &mut self.held,
            &mut self.work,
        ];
        zeros.into_iter().for_each(|v| refill(v, x.len(), 0.0));
        (self.last_step, self.longest_step) = (0.0, 0.0);
    }

    /// How large state i is, or would be after a step at the rate its terms have, or what it balances.
    pub(crate) fn size(&self, i: usize) -> f64 {
        let moved = self.largest[i].max(self.activity[i] * self.last_step);
        moved.max(self.floor[i])
    }

    /// How far state i has moved, or would in a step at the rate its terms have.
    pub(crate) fn motion(&self, i: usize) -> f64 {
        self.range[i].max(self.activity[i] * self.last_step)
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
    /// |ψ'| where each switch with roots was last crossed downwards and upwards.
    pub crossed: Vec<[f64; 2]>,
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
        refill(&mut self.armed, n, false);
        refill(&mut self.open, n, false);
        refill(&mut self.crossed, n, [f64::INFINITY; 2]);
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
