//! Declares all variables of a program, with bounds and guesses.

use nsd_solver::integrate::tableau::Tableau;
use rustc_hash::FxHashSet;

use super::ends::{End, Start, jumping_with_states, jumping_with_time};
use super::{Algebraics, Boundaries, Decided, Layout, Led, States};
use crate::expr::{Expr, Var, variables_of};
use crate::lowering::dcs::{Algebraic, Branch, Dcs, Friction, Impact, SlipLaw};
use crate::lowering::discretize::formals::block::variable;
use crate::lowering::discretize::{Detection, Elements, Grid};
use crate::lowering::mpcc::{Bounds, Mpcc, Span, n_places};
use crate::system::Allowed;
use crate::system::experiment::Form;
use crate::system::task::{Control, Shape};

/// Steps in numerical time are at most so many times as long as in physical time.
const SLOWEST: f64 = 10.0;

/// Elements are no shorter than this share of their mean length where α is inside of (0, 1) in a sliding mode of a
/// nonlinear switch: without any length, rates do not say what α is, and the mode might end in it anywhere.
const SHORTEST: f64 = 1e-3;

/// Declares all variables; `rates` are those of the integrals of the cost.
pub(crate) fn declare(
    mpcc: &mut Mpcc,
    dcs: &Dcs,
    grid: Grid,
    tableau: &Tableau,
    form: Form,
    elements: Elements,
    rates: &[Expr],
) -> Layout {
    let frame = Frame::new(dcs, grid, tableau, elements);
    let Frame {
        elements,
        nodes,
        end,
        ..
    } = frame;
    let lengths = frame.lengths(mpcc);
    let times = frame.times(mpcc, rates);
    let decided = frame.decided(mpcc);
    let free = frame.free_states();
    let mut states = frame.states(mpcc, form, &free);
    let bounds = algebraic_bounds(dcs);
    let boundaries = frame.boundaries(mpcc, &free, &bounds);
    let led = frame.led(mpcc, &bounds);
    let jumping = boundaries.as_ref().map(|boundaries| &boundaries.jumping);
    let algebraics = frame.algebraics(mpcc, &bounds, jumping, led, &mut states);
    Layout {
        steps: grid.steps,
        elements,
        nodes,
        end,
        points: tableau.points(),
        lengths,
        times,
        decided,
        states,
        algebraics,
        boundaries,
        branches: frame.branches(mpcc),
    }
}

/// What all declarations look at.
struct Frame<'d, 'e> {
    dcs: &'d Dcs<'e>,
    grid: Grid,
    detection: Option<Detection>,
    elements: usize,
    nodes: usize,
    end: usize,
}

/// The same bounds at all places.
fn everywhere(places: &[Span], bounds: &[Bounds]) -> Vec<Bounds> {
    bounds.repeat(n_places(places))
}

/// As they are printed.
fn names<'e>(vars: impl IntoIterator<Item = Expr<'e>>) -> Vec<String> {
    vars.into_iter().map(|var| var.to_string()).collect()
}

impl<'d, 'e> Frame<'d, 'e> {
    fn new(dcs: &'d Dcs<'e>, grid: Grid, tableau: &Tableau, elements: Elements) -> Self {
        let nodes = tableau.n_nodes();
        Frame {
            dcs,
            grid,
            detection: elements.detection(),
            elements: elements.count(),
            nodes,
            end: match tableau.ends_at_node() {
                true => nodes,
                false => nodes + 1,
            },
        }
    }

    fn per_element(&self) -> [Span; 2] {
        let step = Span::new("k", 1, self.grid.steps);
        [step, Span::new("j", 1, self.elements)]
    }

    /// Points of all elements, by their numbers.
    fn points(&self, first: usize, last: usize) -> [Span; 3] {
        let [step, element] = self.per_element();
        [step, element, Span::new("m", first, last)]
    }

    /// Where the first of so many steps begin.
    fn starts(steps: usize) -> [Span; 3] {
        let [step, element] = [("k", steps), ("j", 1)].map(|(name, last)| Span::new(name, 1, last));
        [step, element, Span::new("m", 0, 0)]
    }

    fn n_elements(&self) -> usize {
        self.grid.steps * self.elements
    }

    /// The length of an element where all are equal.
    fn mean(&self) -> f64 {
        self.grid.horizon / self.n_elements() as f64
    }

    fn free_horizon(&self) -> Option<(f64, f64)> {
        self.dcs.task.as_ref()?.horizon
    }

    /// Bounds and guesses of the lengths of steps as shares of T/N; nothing where all are equal.
    fn shares(&self) -> Vec<[f64; 3]> {
        let task = self.dcs.task.as_ref();
        task.map_or_else(Vec::new, |task| task.lengths.shares(self.grid.steps))
    }

    /// The lengths of elements.
    fn lengths(&self, mpcc: &mut Mpcc) -> usize {
        let (task, mean) = (self.dcs.task.as_ref(), self.mean());
        let n_elements = self.n_elements() as f64;
        let horizon = self.free_horizon();
        let (shortest, longest) = horizon.map_or((mean, mean), |(lower, upper)| {
            (lower / n_elements, upper / n_elements)
        });
        let spread = match self.detection {
            Some(detection) if self.elements > 1 => detection.spread,
            _ => 0.0,
        };
        let least = match task.is_some() && !self.dcs.switches.branches.is_empty() {
            true => SHORTEST,
            false => 0.0,
        };
        let shares = self.shares();
        let is_fixed = spread == 0.0 && horizon.is_none() && shares.is_empty();
        let length = |[low, high, guess]: [f64; 3]| {
            let (shortest, longest, mean) = (low * shortest, high * longest, guess * mean);
            if task.is_some_and(|task| task.clock.is_some()) {
                Bounds::between(0.0, SLOWEST * self.elements as f64 * longest, mean)
            } else if is_fixed {
                Bounds::fixed(mean)
            } else {
                let lower = (1.0 - spread).max(least) * shortest;
                Bounds::between(lower, (1.0 + spread) * longest, mean)
            }
        };
        let shares = match shares.is_empty() {
            true => vec![[1.0; 3]; self.grid.steps],
            false => shares,
        };
        let lengths = (shares.into_iter()).flat_map(|share| vec![length(share); self.elements]);
        let lengths = lengths.collect();
        mpcc.declare("h", vec!["h".to_owned()], &self.per_element(), lengths)
    }

    /// The starts of elements, where the system depends on time.
    fn times(&self, mpcc: &mut Mpcc, rates: &[Expr]) -> Option<usize> {
        let Frame { dcs, grid, .. } = *self;
        let rows = dcs.rows.rates.iter().chain(&dcs.rows.equations).copied();
        let rows = rows.chain(dcs.impacts.iter().flat_map(Impact::exprs));
        let rows: Vec<Expr> = rows.chain(rates.iter().copied()).collect();
        let occurring = variables_of(&rows);
        let is_timed = occurring.contains(&variable(dcs.time)) || is_timed(dcs, &occurring);
        let is_fixed = self.free_horizon().is_none() && self.shares().is_empty();
        let start = |e: usize| {
            let step = (e / self.elements) as f64;
            let start = grid.start + grid.horizon * step / grid.steps as f64;
            let is_given = is_fixed && self.detection.is_none();
            match e % self.elements {
                0 if e == 0 || is_fixed => Bounds::fixed(start),
                j if is_given => Bounds::fixed(start + j as f64 * self.mean()),
                j => Bounds::free(start + j as f64 * self.mean()),
            }
        };
        is_timed.then(|| {
            let bounds = (0..self.n_elements()).map(start).collect();
            mpcc.declare("t", vec!["t".to_owned()], &self.per_element(), bounds)
        })
    }

    /// T, free parameters and controls.
    fn decided(&self, mpcc: &mut Mpcc) -> Decided {
        let Some(task) = &self.dcs.task else {
            return Decided {
                horizon: None,
                shares: None,
                params: 0,
                controls: 0,
                n_controls: 0,
                shape: Shape::Constant,
            };
        };
        let horizon = task.horizon.map(|(lower, upper)| {
            let bounds = Bounds::between(lower, upper, self.grid.horizon);
            mpcc.declare("T", vec!["T".to_owned()], &[], vec![bounds])
        });
        let shares = self.shares();
        let shares = (!shares.is_empty()).then(|| {
            let bounds = shares.iter();
            let bounds = bounds.map(|&[lower, upper, guess]| Bounds::between(lower, upper, guess));
            let step = Span::new("k", 1, self.grid.steps);
            mpcc.declare("s", vec!["s".to_owned()], &[step], bounds.collect())
        });
        let params = task.params.iter().map(|free| {
            let param = &self.dcs.params[free.place];
            let bounds = Bounds::between(free.lower, free.upper, param.value);
            (param.name.clone(), bounds)
        });
        let (names, bounds) = params.unzip();
        let params = mpcc.declare("p", names, &[], bounds);
        let (names, bounds): (Vec<String>, Vec<Bounds>) = (task.controls.iter())
            .map(|control| (control.name.clone(), bounds_of(control)))
            .unzip();
        let first = match task.shape {
            Shape::Constant => 1,
            Shape::Linear => 0,
        };
        let step = Span::new("k", first, self.grid.steps);
        let bounds = bounds.repeat(step.len());
        Decided {
            horizon,
            shares,
            params,
            controls: mpcc.declare("u", names, &[step], bounds),
            n_controls: task.controls.len(),
            shape: task.shape,
        }
    }

    /// Bounds of states that are not given.
    fn free_states(&self) -> Vec<Bounds> {
        let states = self.dcs.states.iter();
        let mut free: Vec<Bounds> = states.map(|state| Bounds::free(state.initial)).collect();
        for bound in self.dcs.task.iter().flat_map(|task| &task.bounds) {
            free[bound.place] = free[bound.place].within(bound.lower, bound.upper);
        }
        free
    }

    /// States and slopes.
    fn states(&self, mpcc: &mut Mpcc, form: Form, free: &[Bounds]) -> States {
        let dcs = self.dcs;
        let names = || dcs.states.iter().map(|state| state.var.to_string());
        let initial = dcs.states.iter().map(|state| state.initial);
        let mut known: Vec<Bounds> = initial.map(Bounds::fixed).collect();
        for freed in dcs.task.iter().flat_map(|task| &task.initial) {
            let guess = dcs.states[freed.place].initial;
            known[freed.place] = Bounds::between(freed.lower, freed.upper, guess);
        }
        let (behind, nodes) = (self.points(1, self.end), self.points(1, self.nodes));
        States {
            n: dcs.states.len(),
            initial: mpcc.declare("x", names().collect(), &Self::starts(1), known),
            behind: mpcc.declare("x", names().collect(), &behind, everywhere(&behind, free)),
            slopes: (form == Form::Differential).then(|| {
                let slopes = names().map(|name| format!("der({name})")).collect();
                let bounds = vec![Bounds::free(0.0); dcs.states.len()];
                mpcc.declare("v", slopes, &nodes, everywhere(&nodes, &bounds))
            }),
            started: (0, Vec::new()),
        }
    }

    /// x⁺, y and the z that jump, for every element, with bounds of all states and z.
    fn boundaries(
        &self,
        mpcc: &mut Mpcc,
        states: &[Bounds],
        algebraics: &[Bounds],
    ) -> Option<Boundaries> {
        let dcs = self.dcs;
        if dcs.impacts.is_empty() {
            return None;
        }
        let (elements, left) = (self.per_element(), self.points(0, 0));
        let all = dcs.states.iter().map(|state| state.var);
        let first_state = mpcc.declare("x", names(all), &left, everywhere(&left, states));
        let impulse = Bounds::between(0.0, f64::INFINITY, 0.0);
        let frictions = dcs.impacts.iter().flat_map(|impact| &impact.friction);
        let of_friction = |friction: &Friction| match friction.law {
            SlipLaw::Interval(_) => vec![Bounds::between(0.0, 1.0, 0.5)],
            // |u⁺| ≤ 1 says more than bounds of α⁺.
            SlipLaw::Disc { .. } => vec![
                Bounds::free(0.5),
                Bounds::free(0.5),
                Bounds::between(0.0, f64::INFINITY, 1.0),
            ],
        };
        let bounds: Vec<Bounds> = (dcs.impacts.iter().map(|_| impulse))
            .chain(frictions.flat_map(of_friction))
            .collect();
        let impulses = everywhere(&elements, &bounds);
        let impulses = mpcc.declare("y", names(dcs.boundary()), &elements, impulses);
        let (jumping, _) = jumping_with_states(dcs);
        Some(Boundaries {
            states: first_state,
            impulses,
            n_impulses: bounds.len(),
            algebraics: self.declare_z(mpcc, &jumping, &left, algebraics),
            jumping,
        })
    }

    /// What jumps with switches of time, for every element.
    fn led(&self, mpcc: &mut Mpcc, bounds: &[Bounds]) -> Option<Led> {
        let dcs = self.dcs;
        if self.detection.is_none() || dcs.switches.leading.is_empty() || !dcs.impacts.is_empty() {
            return None;
        }
        let (algebraics, equations) = jumping_with_time(dcs);
        (!algebraics.is_empty()).then(|| Led {
            first: self.declare_z(mpcc, &algebraics, &self.points(0, 0), bounds),
            algebraics,
            equations,
        })
    }

    /// Some z at some places, of the bounds of all.
    fn declare_z(&self, mpcc: &mut Mpcc, z: &[usize], places: &[Span], bounds: &[Bounds]) -> usize {
        let vars = z.iter().map(|&i| self.dcs.algebraics[i].var);
        let own: Vec<Bounds> = z.iter().map(|&i| bounds[i]).collect();
        mpcc.declare("z", names(vars), places, everywhere(places, &own))
    }

    /// Algebraic variables, of which some are there at left ends, and some at right ends that are no nodes; and the states
    /// that start anew with them.
    fn algebraics(
        &self,
        mpcc: &mut Mpcc,
        bounds: &[Bounds],
        jumping: Option<&Vec<usize>>,
        led: Option<Led>,
        states: &mut States,
    ) -> Algebraics {
        let dcs = self.dcs;
        let all: Vec<usize> = (0..dcs.algebraics.len()).collect();
        let is_continuous = |i: &usize| self.detection.is_some() && dcs.algebraics[*i].continuous;
        let continuous: Vec<usize> = all.iter().copied().filter(is_continuous).collect();
        let at_end = match self.detection {
            Some(_) if self.end > self.nodes => End::new(dcs).algebraics,
            _ => Vec::new(),
        };
        let jumps = |i: &usize| jumping.is_some_and(|jumping| jumping.contains(i));
        let is_led = |i: &usize| led.as_ref().is_some_and(|led| led.algebraics.contains(i));
        let kept: Vec<usize> = (continuous.iter().copied())
            .filter(|i| !jumps(i) && !is_led(i))
            .collect();
        let start = Start::of(dcs);
        let starts = Self::starts(if start.restarts { self.grid.steps } else { 1 });
        let given = |z: &Algebraic| Bounds::fixed(z.guess);
        let given: Vec<Bounds> = dcs.algebraics.iter().map(given).collect();
        let at_start = if start.is_free { bounds } else { &given };
        let initial = self.declare_z(mpcc, &kept, &starts, at_start);
        if self.detection.is_some() && !start.states.is_empty() {
            let own = || start.states.iter().map(|&i| &dcs.states[i]);
            let components = own().map(|state| format!("start({})", state.var));
            let bounds: Vec<Bounds> = own().map(|state| Bounds::free(state.initial)).collect();
            let bounds = everywhere(&starts, &bounds);
            let first = mpcc.declare("x_start", components.collect(), &starts, bounds);
            states.started = (first, start.states);
        }
        let (nodes, right) = (self.points(1, self.nodes), self.points(self.end, self.end));
        Algebraics {
            n: all.len(),
            initial,
            at_nodes: self.declare_z(mpcc, &all, &nodes, bounds),
            right: self.declare_z(mpcc, &at_end, &right, bounds),
            restarts: start.restarts,
            continuous,
            kept,
            led,
            at_end,
        }
    }

    /// r: the index of the first one, and how many switches have them.
    fn branches(&self, mpcc: &mut Mpcc) -> (usize, usize) {
        let dcs = self.dcs;
        if dcs.task.is_none() {
            return (0, 0);
        }
        let names = |branch: &Branch| {
            let alpha = branch.alpha.to_string();
            [format!("S({alpha}=0)"), format!("S({alpha}=1)")]
        };
        let names: Vec<String> = dcs.switches.branches.iter().flat_map(names).collect();
        let bounds = vec![Bounds::between(0.0, f64::INFINITY, 0.0); names.len()];
        let elements = self.per_element();
        let first = mpcc.declare("r", names, &elements, everywhere(&elements, &bounds));
        (first, dcs.switches.branches.len())
    }
}

/// Members of pairs are not negative.
fn algebraic_bounds(dcs: &Dcs) -> Vec<Bounds> {
    let members: FxHashSet<Expr> = dcs.rows.members().collect();
    let bounds = |z: &Algebraic| {
        let lower = match members.contains(&z.var) {
            true => 0.0,
            false => f64::NEG_INFINITY,
        };
        let upper = match members.contains(&(1.0 - z.var)) {
            true => 1.0,
            false => f64::INFINITY,
        };
        Bounds::between(lower, upper, z.guess)
    };
    dcs.algebraics.iter().map(bounds).collect()
}

/// Whether instants occur in more than the rates and equations, in which `occurring` do.
fn is_timed(dcs: &Dcs, occurring: &[Var]) -> bool {
    let Some(task) = dcs.task.as_ref().filter(|task| task.clock.is_none()) else {
        return false;
    };
    let rows: Vec<Expr> = task.in_rows().collect();
    let in_rows = variables_of(&rows);
    let occurs = |e: Expr| {
        let var = variable(e);
        occurring.contains(&var) || in_rows.contains(&var)
    };
    let lines = task.shape == Shape::Linear;
    occurs(dcs.time)
        || dcs.data.iter().any(|data| occurs(data.var))
        || lines && task.controls.iter().any(|control| occurs(control.var))
}

/// The range of a control.
pub(crate) fn bounds_of(control: &Control) -> Bounds {
    match &control.allowed {
        None => Bounds::free(control.guess()),
        Some(Allowed::Between(lower, upper)) => Bounds::between(*lower, *upper, control.guess()),
        Some(Allowed::OneOf(values)) => {
            let [lower, upper] = range(values);
            Bounds::between(lower, upper, control.guess())
        }
    }
}

/// The ends of a finite set.
pub(crate) fn range(values: &[f64]) -> [f64; 2] {
    let lower = values.iter().copied().fold(f64::INFINITY, f64::min);
    let upper = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [lower, upper]
}
