//! Surfaces that a run by finite elements comes close to and leaves again.
//!
//! Where ψ turns back at a distance d that is smaller than the error of a run, it cannot be told whether its surface
//! is crossed: elements end where a member of a pair vanishes, and this one does not. With ψ ≈ d + c τ² around the
//! turn, a run that is wrong by more than d might be behind the surface for 2 √(·/c), or to the end, where the field
//! there leads away.

use nsd_solver::event::Segment;
use nsd_solver::fesd;
use nsd_solver::hybrid::Side;
use nsd_solver::tape::{Scratch, Tape};
use rustc_hash::FxHashMap;

use crate::expr::Expr;
use crate::lowering::hybrid::variable;
use crate::simulate::estimate::{Touch, Touches};
use crate::simulate::outcome::limits::tape_of;
use crate::system::{Role, System};

/// Points of an element at which ψ is looked at first, as parts of it.
const PARTS: usize = 8;
/// A turn above this share of the largest |ψ| is not a close one, whatever the error.
const CLOSE: f64 = 1e-2;
/// Sections of the interval that the least value is in.
const SECTIONS: usize = 60;
/// What is closer to an end of an element than this share of it is the end.
const END: f64 = 1e-6;
/// What bends by less than this share of its terms over the horizon does not turn.
const RESTS: f64 = 1e-8;
/// What estimates of errors may fall short by.
const SAFETY: f64 = 2.0;
/// Roundings that ψ and the states in it have seen.
const ROUNDINGS: f64 = 64.0;

/// A ψ that turned back.
struct Turn {
    switch: usize,
    time: f64,
    /// ψ, positive on the side of the run.
    distance: f64,
    /// ψ''/2 there.
    bend: f64,
    x: Vec<f64>,
    alpha: Vec<f64>,
}

/// The switches whose sides have different fields, and what is asked of them.
pub(crate) struct Surfaces {
    watched: Vec<usize>,
    psi: Function,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// All rates, and by switch ∂ψ/∂x, where a run has asked for them.
    rates: Option<Function>,
    gradients: FxHashMap<usize, Function>,
}

/// Looks at such switches in a run.
pub(crate) struct Turns<'s, 'e> {
    system: &'s System<'e>,
    surfaces: &'s mut Surfaces,
    /// By state.
    scale: Vec<f64>,
    /// By switch that is looked at: the largest |ψ|.
    largest: Vec<f64>,
    found: Vec<Turn>,
}

/// Functions of (t, x, α, data, open parameters).
struct Function {
    tape: Tape,
    open: Vec<usize>,
    scratch: Scratch,
    inputs: Vec<f64>,
    values: Vec<f64>,
}

impl Function {
    fn new<'e>(system: &System<'e>, open: &[usize], exprs: &[Expr<'e>]) -> Self {
        let tape = tape_of(system, open, exprs);
        Function {
            scratch: tape.scratch(),
            inputs: vec![0.0; tape.n_inputs()],
            values: vec![0.0; exprs.len()],
            open: open.to_vec(),
            tape,
        }
    }

    fn at(&mut self, system: &System, time: f64, piece: f64, x: &[f64], alpha: &[f64]) -> &[f64] {
        let (n, m) = (x.len(), alpha.len());
        self.inputs[0] = time;
        self.inputs[1..=n].copy_from_slice(x);
        self.inputs[1 + n..1 + n + m].copy_from_slice(alpha);
        let data = system.exogenous.data.iter();
        let data = data.map(|data| data.table.piece(piece).value(time));
        let params = system.exogenous.chosen(&self.open);
        let known = data.chain(params.map(|param| param.value));
        for (value, known) in self.inputs[1 + n + m..].iter_mut().zip(known) {
            *value = known;
        }
        self.tape
            .eval(&self.inputs, &mut self.values, &mut self.scratch);
        &self.values
    }
}

impl Surfaces {
    /// Those of a system with some parameters open, by their numbers.
    pub fn of(system: &System, open: &[usize]) -> Self {
        let switches = system.switches.iter().enumerate();
        let watched = switches.filter(|(_, switch)| {
            let acts = !switch.continuity.is_continuous() && !switch.unilateral;
            acts && switch.role == Role::Step && switch.relay.is_none()
        });
        let watched: Vec<usize> = watched.map(|(i, _)| i).collect();
        let psi: Vec<Expr> = watched.iter().map(|&i| system.switches[i].psi).collect();
        Surfaces {
            psi: Function::new(system, open, &psi),
            watched,
            open: open.to_vec(),
            rates: None,
            gradients: FxHashMap::default(),
        }
    }

    /// All rates, and the gradient of ψ of a switch.
    fn rates_and_gradient(&mut self, system: &System, switch: usize) -> [&mut Function; 2] {
        let open = &self.open;
        let rates = self.rates.get_or_insert_with(|| {
            let rates: Vec<Expr> = system.states.iter().map(|state| state.rate).collect();
            Function::new(system, open, &rates)
        });
        let gradient = self.gradients.entry(switch).or_insert_with(|| {
            let psi = system.switches[switch].psi;
            let states = system.states.iter();
            let gradient: Vec<Expr> = states.map(|state| psi.diff(variable(state.var))).collect();
            Function::new(system, open, &gradient)
        });
        [rates, gradient]
    }
}

impl<'s, 'e> Turns<'s, 'e> {
    /// For a run of the system.
    pub fn new(system: &'s System<'e>, surfaces: &'s mut Surfaces) -> Self {
        Turns {
            scale: system
                .states
                .iter()
                .map(|state| state.initial.abs())
                .collect(),
            largest: vec![0.0; surfaces.watched.len()],
            found: Vec::new(),
            surfaces,
            system,
        }
    }

    /// Looks at one element.
    pub fn segment(&mut self, segment: &Segment) {
        let n_watched = self.surfaces.watched.len();
        if n_watched == 0 {
            return;
        }
        let mut x = vec![0.0; self.scale.len()];
        let mut alpha = vec![0.0; segment.sides.len()];
        let mut values = vec![[0.0_f64; PARTS + 1]; n_watched];
        for part in 0..=PARTS {
            let tau = segment.length * part as f64 / PARTS as f64;
            segment.state(tau, &mut x);
            segment.alpha(tau, &mut alpha);
            for (scale, x) in self.scale.iter_mut().zip(&x) {
                *scale = scale.max(x.abs());
            }
            let time = segment.start + tau;
            let psi = &mut self.surfaces.psi;
            let psi = psi.at(self.system, time, segment.start, &x, &alpha);
            for (values, psi) in values.iter_mut().zip(psi) {
                values[part] = *psi;
            }
        }
        for (k, values) in values.iter_mut().enumerate() {
            let sign = match segment.sides[self.surfaces.watched[k]] {
                Side::Minus => -1.0,
                Side::Slide => continue,
                Side::Plus => 1.0,
            };
            values.iter_mut().for_each(|value| *value *= sign);
            self.largest[k] = values.iter().fold(self.largest[k], |most, v| most.max(*v));
            for part in 0..=PARTS {
                let before = part.saturating_sub(1);
                let behind = (part + 1).min(PARTS);
                if values[part] <= values[before] && values[part] <= values[behind] {
                    self.turn(segment, k, sign, (before, behind));
                }
            }
        }
    }

    /// Finds the least ψ between two parts of an element, unless it is where the element ends.
    fn turn(&mut self, segment: &Segment, k: usize, sign: f64, (from, to): (usize, usize)) {
        let system = self.system;
        let (mut x, mut alpha) = (vec![0.0; self.scale.len()], vec![0.0; segment.sides.len()]);
        let psi = &mut self.surfaces.psi;
        let mut at = |tau: f64| {
            segment.state(tau, &mut x);
            segment.alpha(tau, &mut alpha);
            sign * psi.at(system, segment.start + tau, segment.start, &x, &alpha)[k]
        };
        // A golden section.
        let part = segment.length / PARTS as f64;
        let (mut a, mut b) = (from as f64 * part, to as f64 * part);
        let share = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut c, mut d) = (b - share * (b - a), a + share * (b - a));
        let (mut at_c, mut at_d) = (at(c), at(d));
        for _ in 0..SECTIONS {
            if at_c <= at_d {
                (b, d, at_d) = (d, c, at_c);
                c = b - share * (b - a);
                at_c = at(c);
            } else {
                (a, c, at_c) = (c, d, at_d);
                d = a + share * (b - a);
                at_d = at(d);
            }
        }
        let tau = 0.5 * (a + b);
        let distance = at(tau);
        let step = tau.min(segment.length - tau).min(part);
        if distance > CLOSE * self.largest[k] || step <= END * segment.length {
            return;
        }
        let bend = (at(tau + step) + at(tau - step) - 2.0 * distance) / (2.0 * step * step);
        at(tau);
        self.found.push(Turn {
            switch: self.surfaces.watched[k],
            time: segment.start + tau,
            distance,
            bend,
            x,
            alpha,
        });
    }

    /// What was found.
    pub fn done(self) -> Turned {
        Turned {
            found: self.found,
            scale: self.scale,
        }
    }
}

/// The turns of a run, and the largest magnitudes of its states.
#[derive(Default)]
pub(crate) struct Turned {
    found: Vec<Turn>,
    scale: Vec<f64>,
}

impl Turned {
    /// How large the terms of ψ with this gradient have been.
    fn reach(&self, gradient: &[f64]) -> f64 {
        let terms = gradient.iter().zip(&self.scale);
        terms.map(|(g, s)| g.abs() * s).sum()
    }

    /// The turns of a run over a horizon, as derivatives ask for them: not those of ψ that rests.
    pub fn told(&self, system: &System, surfaces: &mut Surfaces, horizon: f64) -> Vec<fesd::Turn> {
        let told = |turn: &Turn| {
            let [_, gradient] = surfaces.rates_and_gradient(system, turn.switch);
            let gradient = gradient.at(system, turn.time, turn.time, &turn.x, &turn.alpha);
            let size = self.reach(gradient);
            let turns = turn.bend * horizon.powi(2) > RESTS * size;
            turns.then_some(fesd::Turn {
                switch: turn.switch,
                time: turn.time,
                distance: turn.distance,
                size,
            })
        };
        let mut all: Vec<fesd::Turn> = self.found.iter().filter_map(told).collect();
        all.sort_by(|a, b| a.time.total_cmp(&b.time));
        all
    }

    /// What a run with errors of this share of every state cannot tell, until its end.
    pub fn judge(&self, system: &System, surfaces: &mut Surfaces, error: f64, end: f64) -> Touches {
        let mut touches = Touches::default();
        for turn in &self.found {
            let [rates, gradient] = surfaces.rates_and_gradient(system, turn.switch);
            let gradient = gradient.at(system, turn.time, turn.time, &turn.x, &turn.alpha);
            let reach = self.reach(gradient);
            let floor = ROUNDINGS * f64::EPSILON * (reach + turn.distance.abs());
            let known_to = floor + SAFETY * error * reach;
            let depth = known_to - turn.distance;
            if depth <= 0.0 {
                continue;
            }
            let mut beyond = turn.alpha.clone();
            let was = beyond[turn.switch];
            let here = rates
                .at(system, turn.time, turn.time, &turn.x, &turn.alpha)
                .to_vec();
            beyond[turn.switch] = 1.0 - was;
            let there = rates.at(system, turn.time, turn.time, &turn.x, &beyond);
            let jump: Vec<f64> = there.iter().zip(&here).map(|(a, b)| a - b).collect();
            let sign = if was > 0.5 { 1.0 } else { -1.0 };
            let back: f64 = sign * gradient.iter().zip(&jump).map(|(g, j)| g * j).sum::<f64>();
            let half = (depth / turn.bend).sqrt();
            let left = end - turn.time;
            let returns = back * half >= -depth && half.is_finite();
            let lasts = match returns {
                true if back * half > depth => 4.0 * depth / back,
                true => 4.0 * half,
                false => left,
            };
            let lasts = lasts.min(left);
            let mut matters = 0.0_f64;
            for (jump, scale) in jump.iter().zip(&self.scale) {
                let change = jump.abs() * lasts;
                // A state that has not moved would be as large as its change.
                let scale = scale.max(change);
                if scale > 0.0 {
                    matters = matters.max(change / scale);
                }
            }
            let distance = turn.distance.abs();
            touches.add(
                Touch {
                    switch: turn.switch,
                    time: turn.time,
                    known_to,
                    matters,
                    share_to_tell: (distance > 2.0 * floor).then_some(0.1 * distance / known_to),
                },
                returns,
            );
        }
        touches
    }
}
