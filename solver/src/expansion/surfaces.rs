//! The switching functions ψ, each compiled for the sides of the switches inside it.

use rustc_hash::FxHashMap;

use super::layout::{Memory, Registers};
use super::psi::{Compiled, Form, run};
use crate::hybrid::form::{Library, Smooth};
use crate::hybrid::{HybridSystem, Side};
use crate::tape::Ball;

pub(crate) struct Surfaces {
    /// All ψ, and behind them the derivatives of those of higher relative degree.
    surfaces: Vec<Local>,
    /// (switch, order) of these derivatives.
    derivatives: Vec<(usize, usize)>,
    /// The first derivative of every switch, and how many there are.
    of_switch: Vec<(usize, usize)>,
    /// Switches of slip velocities.
    slips: Vec<bool>,
    /// What stands for a switch at present: its ψ, or the derivative that has its α in its rate.
    slot: Vec<usize>,
    /// The functions in which the α of a switch occurs, and the switches that have any.
    around: Vec<Vec<usize>>,
    inner: Vec<usize>,
    /// Switches of higher relative degree.
    deep: Vec<usize>,
    /// The sides taken last, of the switches inside others; none before the first time.
    sides: Option<Box<[Side]>>,
    registers: Registers,
    /// The sides inside a ψ that are looked up.
    inner_sides: Vec<Side>,
    /// Functions taken up so far.
    pub n_functions: usize,
}

/// A ψ by the sides inside it.
struct Local {
    inside: Vec<usize>,
    known: Vec<Compiled>,
    index: FxHashMap<Box<[Side]>, usize>,
    now: usize,
}

impl Surfaces {
    /// All ψ, without functions yet.
    pub(crate) fn new(system: &HybridSystem) -> Self {
        let m = system.n_switches();
        let local = |inside: &[usize]| Local {
            inside: inside.to_vec(),
            known: Vec::new(),
            index: FxHashMap::default(),
            now: 0,
        };
        let mut derivatives = Vec::new();
        let mut of_switch = Vec::new();
        for i in 0..m {
            let count = system.switches[i].derivatives.len();
            of_switch.push((m + derivatives.len(), count));
            derivatives.extend((1..=count).map(|order| (i, order)));
        }
        let switches = (0..m).chain(derivatives.iter().map(|&(i, _)| i));
        let surfaces: Vec<Local> = switches
            .map(|i| local(&system.switches[i].inside))
            .collect();
        let mut around = vec![Vec::new(); m];
        for (at, surface) in surfaces.iter().enumerate() {
            for &inner in &surface.inside {
                around[inner].push(at);
            }
        }
        Surfaces {
            surfaces,
            derivatives,
            inner: (0..m).filter(|&i| !around[i].is_empty()).collect(),
            deep: (0..m).filter(|&i| of_switch[i].1 > 0).collect(),
            of_switch,
            slips: (0..m).map(|i| system.slip_of(i).is_some()).collect(),
            slot: (0..m).collect(),
            around,
            sides: None,
            registers: Registers::default(),
            inner_sides: Vec::new(),
            n_functions: 0,
        }
    }

    /// Takes the functions of these sides, compiling what is new.
    pub(crate) fn enter(&mut self, library: &mut Library, memory: &mut Memory, sides: &[Side]) {
        match self.sides.take() {
            None => {
                for i in 0..self.surfaces.len() {
                    self.enter_one(library, memory, i, sides);
                }
                self.sides = Some(sides.into());
            }
            Some(mut present) => {
                for inner in 0..self.inner.len() {
                    let i = self.inner[inner];
                    if present[i] != sides[i] {
                        present[i] = sides[i];
                        for at in 0..self.around[i].len() {
                            self.enter_one(library, memory, self.around[i][at], sides);
                        }
                    }
                }
                self.sides = Some(present);
            }
        }
    }

    fn enter_one(&mut self, library: &mut Library, memory: &mut Memory, at: usize, sides: &[Side]) {
        let local = &mut self.surfaces[at];
        self.inner_sides.clear();
        (self.inner_sides).extend(local.inside.iter().map(|&inner| sides[inner]));
        if let Some(&known) = local.index.get(&self.inner_sides[..]) {
            local.now = known;
            return;
        }
        let sides: Box<[Side]> = self.inner_sides[..].into();
        let surface = match at.checked_sub(self.slot.len()) {
            None => library.surface(at, &sides),
            Some(at) => {
                let (switch, order) = self.derivatives[at];
                library.derivative(switch, order, &sides)
            }
        };
        let compiled = Compiled::new(surface, memory);
        if let Form::Smooth(tapes) = &compiled.form {
            let Smooth {
                psi,
                gradient,
                mixed,
                ..
            } = &tapes.functions;
            let wanted = [
                psi.n_registers(),
                gradient.tape.n_registers(),
                mixed.tape.n_registers(),
            ];
            let wanted = wanted.into_iter().max().unwrap_or(0);
            self.registers.reserve(wanted);
        }
        self.n_functions += 1;
        local.known.push(compiled);
        local.now = local.known.len() - 1;
        local.index.insert(sides, local.now);
    }

    /// Takes the coefficients of affine functions that parameters make.
    pub(crate) fn take_parameters(&mut self, memory: &Memory) {
        let known = self.surfaces.iter_mut().flat_map(|local| &mut local.known);
        known.for_each(|surface| surface.take_parameters(memory));
    }

    /// Lets every switch that slides stand for its highest derivative without α, the others for
    /// their ψ.
    pub(crate) fn stand(&mut self, sides: &[Side]) {
        for &i in &self.deep {
            let (first, count) = self.of_switch[i];
            self.slot[i] = match sides[i] {
                Side::Slide => first + count - 1,
                _ => i,
            };
        }
    }

    /// Lets a switch stand for its ψ, or one of its derivatives.
    pub(crate) fn stand_for(&mut self, switch: usize, order: usize) {
        self.slot[switch] = match order {
            0 => switch,
            _ => self.of_switch[switch].0 + order - 1,
        };
    }

    /// Lets switches of higher relative degree stand for their derivative of an order, or their highest.
    pub(crate) fn stand_for_order(&mut self, switches: &[usize], order: Option<usize>) {
        for &i in switches {
            let highest = self.n_derivatives(i);
            if highest > 0 {
                self.stand_for(i, order.map_or(highest, |order| order.min(highest)));
            }
        }
    }

    /// How many derivatives of ψ contain no α.
    pub(crate) fn n_derivatives(&self, switch: usize) -> usize {
        self.of_switch[switch].1
    }

    /// Whether ψ is a slip velocity.
    pub(crate) fn is_slip(&self, switch: usize) -> bool {
        self.slips[switch]
    }

    /// Whether a switch stands for a derivative.
    pub(crate) fn is_deep(&self, switch: usize) -> bool {
        self.slot[switch] != switch
    }

    /// Whether the constraints h_a = 0 and h_b = 0 of two sliding switches are redundant: each implies the other. h is
    /// ψ, or the derivative of ψ that is constrained at relative degree above one. They are redundant if
    ///
    /// ∇h_b = r ∇h_a for two slip velocities, or c_b = r c_a, d_b = r d_a for h = Σ c_j x_j + d t + e of which one is a
    /// derivative. Both h vanish here, so the constants e need no comparison.
    pub(crate) fn are_redundant(&self, a: usize, b: usize) -> bool {
        if self.slips[a] && self.slips[b] {
            return are_parallel(self.gradient(a), self.gradient(b));
        }
        // Friction and a normal force do not replace each other.
        let is_mixed = self.slips[a] != self.slips[b];
        if is_mixed || !self.is_deep(a) && !self.is_deep(b) {
            return false;
        }
        let form = |i: usize| match &self.now(i).form {
            Form::Affine(affine) => affine.terms.first().map(|first| (affine, first.1)),
            Form::Smooth(_) => None,
        };
        let (Some((a, first)), Some((b, second))) = (form(a), form(b)) else {
            return false;
        };
        let r = second / first;
        let is_multiple = |x: f64, y: f64| (r * x - y).abs() <= 1e-14 * y.abs();
        a.terms.len() == b.terms.len()
            && is_multiple(a.time, b.time)
            && (a.terms.iter().zip(&b.terms)).all(|(x, y)| x.0 == y.0 && is_multiple(x.1, y.1))
    }

    /// What stands for a switch, for the sides inside it.
    pub(crate) fn now(&self, switch: usize) -> &Compiled {
        self.surfaces[self.slot[switch]].now()
    }

    /// ψ where `values` say.
    pub(crate) fn value(&mut self, switch: usize, values: &[f64]) -> f64 {
        let local = &self.surfaces[self.slot[switch]];
        match &local.known[local.now].form {
            Form::Affine(affine) => affine.value(values),
            Form::Smooth(tapes) => {
                run(
                    &tapes.functions.psi,
                    &tapes.gather,
                    values,
                    &mut self.registers.numbers,
                );
                let mut results = tapes.functions.psi.results(&self.registers.numbers);
                results.next().unwrap_or(f64::NAN)
            }
        }
    }

    /// Evaluates ∂ψ/∂x and ∂ψ/∂t where `values` say.
    pub(crate) fn linearize(&mut self, switch: usize, values: &[f64]) {
        let local = &mut self.surfaces[self.slot[switch]];
        let compiled = &mut local.known[local.now];
        let Form::Smooth(tapes) = &mut compiled.form else {
            return;
        };
        let registers = &mut self.registers.numbers;
        let gradient = &tapes.functions.gradient;
        run(&gradient.tape, &tapes.gather, values, registers);
        for (place, value) in tapes.places.iter().zip(gradient.tape.results(registers)) {
            match place {
                Some(place) => compiled.gradient[*place].1 = value,
                None => compiled.by_time = value,
            }
        }
        if !tapes.mixed.is_empty() {
            let mixed = &tapes.functions.mixed.tape;
            run(mixed, &tapes.gather, values, registers);
            for (entry, value) in tapes.mixed.iter_mut().zip(mixed.results(registers)) {
                entry.2 = value;
            }
        }
    }

    /// (j, ∂ψ/∂x_j) where it was last linearized.
    pub(crate) fn gradient(&self, switch: usize) -> &[(usize, f64)] {
        &self.now(switch).gradient
    }

    /// ∂ψ/∂t where it was last linearized.
    pub(crate) fn time_gradient(&self, switch: usize) -> f64 {
        self.now(switch).by_time
    }

    /// Σ |∂ψ/∂x_j| size(j), where it was last linearized.
    pub(crate) fn weigh(&self, switch: usize, size: impl Fn(usize) -> f64) -> f64 {
        let terms = self.gradient(switch).iter();
        terms.map(|&(j, g)| g.abs() * size(j)).sum()
    }

    /// φ = ∇ψ·f + ∂ψ/∂t for rates f, from the gradient where it was last linearized.
    pub(crate) fn rate(&self, switch: usize, f: &[f64]) -> f64 {
        let terms = self.gradient(switch).iter();
        terms.map(|&(j, g)| g * f[j]).sum::<f64>() + self.time_gradient(switch)
    }

    /// How far rounding may take what stands for ψ of a switch from what exact arithmetic gives; 0 where ψ is affine, or no
    /// bound is known.
    pub(crate) fn running_error(&mut self, switch: usize, values: &[f64]) -> f64 {
        let local = &self.surfaces[self.slot[switch]];
        local
            .now()
            .running_error(values, &mut self.registers.rounded)
    }

    /// How far rounding of the gradient of ψ may take its rate, with rates of these sizes.
    pub(crate) fn running_error_of_phi(
        &mut self,
        switch: usize,
        values: &[f64],
        size: impl Fn(usize) -> f64,
    ) -> f64 {
        let mut error = 0.0;
        let see = |state: Option<usize>, radius: f64| {
            error += radius * state.map_or(1.0, &size);
        };
        let psi = self.surfaces[self.slot[switch]].now();
        psi.running_errors_of_gradient(values, &mut self.registers.rounded, see);
        if error.is_finite() { error } else { 0.0 }
    }

    /// Computes the coefficient of order k of ψ along the series of the states, from all lower ones.
    pub(crate) fn advance(&mut self, switch: usize, memory: &mut Memory, k: usize) {
        let local = &mut self.surfaces[self.slot[switch]];
        local.known[local.now].advance(memory, k);
    }

    /// Computes the coefficients of all orders below `n` of ψ.
    pub(crate) fn expand(&mut self, switch: usize, memory: &mut Memory, n: usize) {
        let local = &mut self.surfaces[self.slot[switch]];
        local.known[local.now].expand(memory, n);
    }

    /// Where the series of ψ starts, after `advance`.
    pub(crate) fn row(&self, switch: usize) -> usize {
        self.now(switch).row.unwrap_or(0)
    }

    /// Whether ψ is affine in the present mode.
    pub(crate) fn is_affine(&self, switch: usize) -> bool {
        matches!(self.now(switch).form, Form::Affine(_))
    }

    /// Whether ψ has no root within a step h over which state j moves by at most its `reach` R_j:
    /// |ψ| > Σ |c_j| R_j + |d| h if ψ is affine, else 0 ∉ ψ(t ± h, x ± R) in ball arithmetic.
    pub(crate) fn excludes_root(
        &mut self,
        switch: usize,
        values: &[f64],
        reach: &[f64],
        h: f64,
    ) -> bool {
        let local = &self.surfaces[self.slot[switch]];
        match &local.known[local.now].form {
            Form::Affine(affine) => {
                let terms = affine.terms.iter();
                let moves = terms.map(|&(state, c)| c.abs() * reach[state]);
                affine.value(values).abs() > moves.sum::<f64>() + affine.time.abs() * h
            }
            Form::Smooth(tapes) => {
                let n = reach.len();
                // `values` are t, x, α and numbers. Numbers are constant in a step; the α of a switch that slides does
                // not change ψ, which is continuous there.
                for (ball, &slot) in self.registers.balls.iter_mut().zip(&tapes.gather) {
                    let radius = match slot {
                        0 => h,
                        slot if slot <= n => reach[slot - 1],
                        _ => 0.0,
                    };
                    *ball = Ball::new(values[slot], radius);
                }
                let psi = &tapes.functions.psi;
                psi.run(&mut self.registers.balls);
                psi.results(&self.registers.balls).all(Ball::excludes_zero)
            }
        }
    }
}

/// True where one gradient is a multiple of the other.
fn are_parallel(a: &[(usize, f64)], b: &[(usize, f64)]) -> bool {
    const SAME: f64 = 1e-9;
    let largest = |a: &(usize, f64), b: &(usize, f64)| a.1.abs().total_cmp(&b.1.abs());
    let Some(&(at, first)) = a.iter().max_by(|x, y| largest(x, y)) else {
        return false;
    };
    let of = |list: &[(usize, f64)], state: usize| {
        let entry = list.iter().find(|entry| entry.0 == state);
        entry.map_or(0.0, |entry| entry.1)
    };
    let ratio = of(b, at) / first;
    let size = SAME * (ratio * first).abs();
    let states = a.iter().chain(b).map(|entry| entry.0);
    size > 0.0
        && states
            .into_iter()
            .all(|state| (of(a, state) * ratio - of(b, state)).abs() <= size)
}

/// The sign of r in ∇h_b = r ∇h_a, of gradients by states.
pub(crate) fn orientation(a: &[(usize, f64)], b: &[(usize, f64)]) -> f64 {
    let products = a.iter().flat_map(|&(state, first)| {
        let same = b.iter().filter(move |entry| entry.0 == state);
        same.map(move |entry| first * entry.1)
    });
    1.0_f64.copysign(products.sum())
}

impl Local {
    fn now(&self) -> &Compiled {
        &self.known[self.now]
    }
}
