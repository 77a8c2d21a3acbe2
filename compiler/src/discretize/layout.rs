//! Which variable is what: the way from the program back to the trajectory.

use nsd_solver::tableau::Tableau;
use rustc_hash::FxHashSet;

use super::block::variable;
use super::impulses::{self, Boundaries};
use super::led::{self, Led};
use super::quadrature::Integral;
use super::{Detection, Form, Grid, branch, task};
use crate::dcs::{Dcs, Impact};
use crate::expr::{Expr, Var, variables_of};
use crate::mpcc::{Bounds, Mpcc, Span, n_places};
use crate::system::task::Shape;

/// Indices of the variables of a discretized system.
///
/// Steps k and elements j count from 1; node 0 is the left end of an element, and [`Layout::end`] its right end.
#[derive(Clone, Debug)]
pub struct Layout {
    /// N.
    pub steps: usize,
    /// Elements per step.
    pub elements: usize,
    /// Runge-Kutta nodes per element.
    pub nodes: usize,
    /// The number of the node that is the right end: that of the last node, or one more.
    pub end: usize,
    /// Where nodes are in an element of length 1, from node 0 to the end.
    pub points: Vec<f64>,
    n_states: usize,
    n_algebraics: usize,
    /// First indices.
    lengths: usize,
    /// T, where it is free.
    horizon: Option<usize>,
    /// Free parameters.
    params: usize,
    controls: usize,
    n_controls: usize,
    /// What controls are within a step.
    shape: Shape,
    times: Option<usize>,
    initial_states: usize,
    states: usize,
    slopes: Option<usize>,
    initial_algebraics: usize,
    /// The first of the states that have values of their own with these z, and which states these are.
    started: (usize, Vec<usize>),
    /// Whether continuous z start anew in every step.
    restarts: bool,
    algebraics: usize,
    end_algebraics: usize,
    /// Which z are continuous, and thus there at the left end.
    pub(super) continuous: Vec<usize>,
    /// Which of them do not jump with states.
    pub(super) kept: Vec<usize>,
    /// Which of them jump with switches of time.
    pub(super) led: Option<Led>,
    /// What elements begin with where contacts give impulses.
    pub(super) boundaries: Option<Boundaries>,
    /// Which z are there at a right end that is no node.
    pub(super) at_end: Vec<usize>,
    /// What bounds the stability of sliding modes, and of how many switches.
    branches: (usize, usize),
}

impl Layout {
    /// The number of an element, from 0.
    pub(super) fn element(&self, k: usize, j: usize) -> usize {
        (k - 1) * self.elements + (j - 1)
    }

    /// h_kj.
    pub fn h(&self, k: usize, j: usize) -> usize {
        self.lengths + self.element(k, j)
    }

    /// The number of scalar states.
    pub fn n_states(&self) -> usize {
        self.n_states
    }

    /// Steps and elements, in order of time.
    pub fn all_elements(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let elements = self.elements;
        (1..=self.steps).flat_map(move |k| (1..=elements).map(move |j| (k, j)))
    }

    /// The numbers k for which there are controls, each with its instant as a share of the horizon.
    pub fn control_instants(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let (steps, shape) = (self.steps, self.shape);
        let first = match shape {
            Shape::Constant => 1,
            Shape::Linear => 0,
        };
        (first..=steps).map(move |k| {
            let middle = match shape {
                Shape::Constant => k as f64 - 0.5,
                Shape::Linear => k as f64,
            };
            (k, middle / steps as f64)
        })
    }

    /// T, where it is free.
    pub fn horizon(&self) -> Option<usize> {
        self.horizon
    }

    /// Free parameter i.
    pub fn p(&self, i: usize) -> usize {
        self.params + i
    }

    /// The first r in an element: for each nonlinear switch one that goes with α and one that goes with 1 - α, see
    /// `branch`. None where nothing is optimized.
    pub fn r(&self, k: usize, j: usize) -> Option<usize> {
        let (first, switches) = self.branches;
        (switches > 0).then(|| first + self.element(k, j) * 2 * switches)
    }

    /// The first control in a step; of linear controls, that at the end of step k, which may be 0.
    pub fn u(&self, k: usize) -> usize {
        let first = match self.shape {
            Shape::Constant => 1,
            Shape::Linear => 0,
        };
        self.controls + (k - first) * self.n_controls
    }

    /// The start of an element, where the system depends on time.
    pub fn t(&self, k: usize, j: usize) -> Option<usize> {
        self.times.map(|times| times + self.element(k, j))
    }

    /// The first state at node m.
    pub fn x(&self, k: usize, j: usize, m: usize) -> usize {
        let element = self.element(k, j);
        match (m, &self.boundaries) {
            (0, None) => self.before(k, j),
            (0, Some(boundaries)) => boundaries.states + element * self.n_states,
            _ => self.states + (element * self.end + m - 1) * self.n_states,
        }
    }

    /// The first state where the element before ends, or the initial one: that before impulses.
    pub fn before(&self, k: usize, j: usize) -> usize {
        match self.element(k, j) {
            0 => self.initial_states,
            element => self.states + (element * self.end - 1) * self.n_states,
        }
    }

    /// State i where step k starts, with the z that start anew there.
    pub(super) fn x_start(&self, k: usize, i: usize) -> usize {
        self.started(k, i).unwrap_or(self.before(k, 1) + i)
    }

    /// State i where step k starts, if it has a value of its own there.
    pub fn started(&self, k: usize, i: usize) -> Option<usize> {
        let (first, states) = &self.started;
        let place = states.iter().position(|&state| state == i)?;
        (k == 1 || self.restarts).then_some(first + (k - 1) * states.len() + place)
    }

    /// The first slope at a Runge-Kutta node, in the differential form.
    pub fn v(&self, k: usize, j: usize, m: usize) -> Option<usize> {
        let node = self.element(k, j) * self.nodes + m - 1;
        self.slopes.map(|slopes| slopes + node * self.n_states)
    }

    /// Whether continuous z start anew in every step, because the switching functions contain what jumps there.
    pub fn restarts(&self) -> bool {
        self.restarts
    }

    /// The number of algebraic variables.
    pub fn n_algebraics(&self) -> usize {
        self.n_algebraics
    }

    /// Algebraic variable i at node m; at the ends only some are there.
    pub fn z(&self, k: usize, j: usize, m: usize, i: usize) -> Option<usize> {
        let place = |list: &[usize]| list.iter().position(|&known| known == i);
        let jumping = self.boundaries.as_ref().and_then(|boundaries| {
            let place = place(&boundaries.jumping)?;
            let first = boundaries.algebraics + self.element(k, j) * boundaries.jumping.len();
            Some(first + place)
        });
        let anew = self.anew(self.element(k, j), i);
        match (self.element(k, j), m) {
            (_, 0) if place(&self.continuous).is_none() => None,
            (_, 0) if jumping.is_some() => jumping,
            (_, 0) if anew.is_some() => anew,
            (0, 0) => Some(self.initial_algebraics + place(&self.kept)?),
            (_, 0) if j == 1 && self.restarts => {
                let start = (k - 1) * self.kept.len();
                Some(self.initial_algebraics + start + place(&self.kept)?)
            }
            (element, 0) => self.z_behind(element - 1, self.end, i),
            (element, _) => self.z_behind(element, m, i),
        }
    }

    /// z_i at the left end of an element where it starts anew there, because it jumps with switches of time.
    fn anew(&self, element: usize, i: usize) -> Option<usize> {
        self.led.as_ref()?.index(element, i)
    }

    /// Whether z_i starts anew in every element.
    pub fn starts_anew(&self, i: usize) -> bool {
        self.anew(0, i).is_some()
    }

    /// The z that are given where the first element begins, with their places.
    pub fn fixed_at_start(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let kept = self.kept.iter().enumerate();
        kept.map(|(place, &i)| (self.initial_algebraics + place, i))
    }

    fn z_behind(&self, element: usize, m: usize, i: usize) -> Option<usize> {
        if m <= self.nodes {
            let node = element * self.nodes + m - 1;
            return Some(self.algebraics + node * self.n_algebraics + i);
        }
        let place = self.at_end.iter().position(|&known| known == i)?;
        Some(self.end_algebraics + element * self.at_end.len() + place)
    }
}

/// Steps in numerical time are at most so many times as long as in physical time.
const SLOWEST: f64 = 10.0;

/// Declares all variables with bounds and guesses.
pub(super) fn declare(
    mpcc: &mut Mpcc,
    dcs: &Dcs,
    grid: Grid,
    tableau: &Tableau,
    form: Form,
    detection: Option<Detection>,
    integrals: &[Integral],
) -> Layout {
    let elements = detection.map_or(1, |detection| detection.elements);
    let nodes = tableau.n_nodes();
    let end = if tableau.ends_at_node() {
        nodes
    } else {
        nodes + 1
    };
    let (step, element) = (Span::new("k", 1, grid.steps), Span::new("j", 1, elements));
    let first = [
        Span::new("k", 1, 1),
        Span::new("j", 1, 1),
        Span::new("m", 0, 0),
    ];
    let to = |last: usize| [step, element, Span::new("m", 1, last)];
    let names = |vars: Vec<Expr>| vars.iter().map(Expr::to_string).collect::<Vec<_>>();

    // Lengths and times.
    let task = dcs.task.as_ref();
    let n_elements = grid.steps * elements;
    let mean = grid.horizon / n_elements as f64;
    let free_horizon = task.and_then(|task| task.horizon);
    let (shortest, longest) = free_horizon.map_or((mean, mean), |(lower, upper)| {
        (lower / n_elements as f64, upper / n_elements as f64)
    });
    let spread = match detection {
        Some(detection) if elements > 1 => detection.spread,
        _ => 0.0,
    };
    // Without any length, rates do not say what α is, and a sliding mode might end in it anywhere.
    let least = match task.is_some() && !dcs.branches.is_empty() {
        true => branch::SHORTEST,
        false => 0.0,
    };
    let length = Bounds::between(
        (1.0 - spread).max(least) * shortest,
        (1.0 + spread) * longest,
        mean,
    );
    let is_frozen = task.is_some_and(|task| task.clock.is_some());
    let length = if is_frozen {
        Bounds::between(0.0, SLOWEST * elements as f64 * longest, mean)
    } else if spread == 0.0 && free_horizon.is_none() {
        Bounds::fixed(mean)
    } else {
        length
    };
    let per_element = [step, element];
    let all_lengths = vec![length; n_elements];
    let lengths = mpcc.declare("h", vec!["h".to_owned()], &per_element, all_lengths);
    let rows = dcs.rates.iter().chain(&dcs.equations).copied();
    let rows = rows.chain(dcs.impacts.iter().flat_map(Impact::exprs));
    let rows: Vec<Expr> = rows.chain(integrals.iter().map(|i| i.rate)).collect();
    let occurring = variables_of(&rows);
    let is_timed = occurring.contains(&variable(dcs.time)) || task::is_timed(dcs, &occurring);
    let times = is_timed.then(|| {
        let start = |e: usize| {
            let start = grid.start + grid.horizon * (e / elements) as f64 / grid.steps as f64;
            match e % elements {
                0 if e == 0 || free_horizon.is_none() => Bounds::fixed(start),
                j => Bounds::free(start + j as f64 * mean),
            }
        };
        let bounds = (0..n_elements).map(start).collect();
        mpcc.declare("t", vec!["t".to_owned()], &per_element, bounds)
    });

    let decided = task
        .map(|_| task::declare(mpcc, dcs, grid))
        .unwrap_or_default();

    // States and slopes.
    let states = || names(dcs.states.iter().map(|state| state.var).collect());
    let initial = || dcs.states.iter().map(|state| state.initial);
    let mut known: Vec<Bounds> = initial().map(Bounds::fixed).collect();
    for freed in task.iter().flat_map(|task| &task.initial) {
        let guess = dcs.states[freed.place].initial;
        known[freed.place] = Bounds::between(freed.lower, freed.upper, guess);
    }
    let initial_states = mpcc.declare("x", states(), &first, known);
    let everywhere = |places: &[Span], bounds: Vec<Bounds>| bounds.repeat(n_places(places));
    let mut free: Vec<Bounds> = initial().map(Bounds::free).collect();
    for bound in task.iter().flat_map(|task| &task.bounds) {
        free[bound.place] = free[bound.place].within(bound.lower, bound.upper);
    }
    let state_block = mpcc.declare("x", states(), &to(end), everywhere(&to(end), free.clone()));
    let slopes = (form == Form::Differential).then(|| {
        let slopes = states().iter().map(|name| format!("der({name})")).collect();
        let bounds = vec![Bounds::free(0.0); dcs.states.len()];
        mpcc.declare("v", slopes, &to(nodes), everywhere(&to(nodes), bounds))
    });

    // Algebraic variables.
    let algebraic_bounds = algebraic_bounds(dcs);
    let chosen = |list: &[usize]| {
        let names = names(list.iter().map(|&i| dcs.algebraics[i].var).collect());
        let bounds = list.iter().map(|&i| algebraic_bounds[i]).collect();
        (names, bounds)
    };
    let all: Vec<usize> = (0..dcs.algebraics.len()).collect();
    let continuous: Vec<usize> = match detection {
        Some(_) => (all.iter().copied())
            .filter(|&i| dcs.algebraics[i].continuous)
            .collect(),
        None => Vec::new(),
    };
    let at_end = match detection {
        Some(_) if end > nodes => End::new(dcs).algebraics,
        _ => Vec::new(),
    };
    let boundaries = impulses::declare(mpcc, dcs, per_element, &free, &algebraic_bounds);
    let jumps = |i: &usize| boundaries.as_ref().is_some_and(|b| b.jumping.contains(i));
    let led = match detection {
        Some(_) => led::declare(mpcc, dcs, per_element, &algebraic_bounds),
        None => None,
    };
    let is_led = |i: &usize| led.as_ref().is_some_and(|led| led.index(0, *i).is_some());
    let kept: Vec<usize> = (continuous.iter().copied())
        .filter(|i| !jumps(i) && !is_led(i))
        .collect();
    let (components, bounds) = chosen(&kept);
    let start = task::Start::of(dcs);
    let known = || kept.iter().map(|&i| Bounds::fixed(dcs.algebraics[i].guess));
    let starts = [
        Span::new("k", 1, if start.restarts { grid.steps } else { 1 }),
        Span::new("j", 1, 1),
        Span::new("m", 0, 0),
    ];
    let bounds = match start.is_free {
        false => known().collect(),
        true => everywhere(&starts, bounds),
    };
    let initial_algebraics = mpcc.declare("z", components, &starts, bounds);
    let started = match detection {
        Some(_) => start.states,
        None => Vec::new(),
    };
    let first = (!started.is_empty()).then(|| {
        let components = started
            .iter()
            .map(|&i| format!("start({})", dcs.states[i].var));
        let bounds = started.iter().map(|&i| Bounds::free(dcs.states[i].initial));
        let bounds = everywhere(&starts, bounds.collect());
        mpcc.declare("x_start", components.collect(), &starts, bounds)
    });
    let started = (first.unwrap_or(0), started);
    let (components, bounds) = chosen(&all);
    let algebraics = mpcc.declare("z", components, &to(nodes), everywhere(&to(nodes), bounds));
    let right = [step, element, Span::new("m", end, end)];
    let (components, bounds) = chosen(&at_end);
    let end_algebraics = mpcc.declare("z", components, &right, everywhere(&right, bounds));
    let branches = branch::declare(mpcc, dcs, per_element);
    Layout {
        steps: grid.steps,
        elements,
        nodes,
        end,
        points: ([0.0].into_iter())
            .chain(tableau.nodes.iter().copied())
            .chain((end > nodes).then_some(1.0))
            .collect(),
        n_states: dcs.states.len(),
        n_algebraics: dcs.algebraics.len(),
        lengths,
        horizon: decided.horizon,
        params: decided.params,
        controls: decided.controls,
        n_controls: task.map_or(0, |task| task.controls.len()),
        shape: task.map_or(Shape::Constant, |task| task.shape),
        times,
        initial_states,
        states: state_block,
        slopes,
        initial_algebraics,
        started,
        restarts: start.restarts,
        algebraics,
        end_algebraics,
        continuous,
        kept,
        led,
        boundaries,
        at_end,
        branches,
    }
}

/// Members of pairs are not negative.
fn algebraic_bounds(dcs: &Dcs) -> Vec<Bounds> {
    let members: FxHashSet<Expr> = (dcs.pairs.iter())
        .flat_map(|pair| [pair.left, pair.right])
        .collect();
    let bounds = |z: &crate::dcs::Algebraic| {
        let lower = if members.contains(&z.var) {
            0.0
        } else {
            f64::NEG_INFINITY
        };
        let upper = if members.contains(&(1.0 - z.var)) {
            1.0
        } else {
            f64::INFINITY
        };
        Bounds::between(lower, upper, z.guess)
    };
    dcs.algebraics.iter().map(bounds).collect()
}

/// What holds at a right end that is no node: the continuous z, the equations that contain them, what else these
/// contain, the equations of that, and so on. Of a disc these are its own equations: what contains its α besides is a
/// force, which acts at nodes alone.
#[derive(Clone, Debug)]
pub(super) struct End {
    pub algebraics: Vec<usize>,
    pub equations: Vec<usize>,
}

impl End {
    pub fn new(dcs: &Dcs) -> Self {
        let occurring = |row: &Expr<'_>| variables_of(&[*row]);
        let occurring: Vec<Vec<Var>> = dcs.equations.iter().map(occurring).collect();
        let declared: FxHashSet<Var> = dcs.algebraics.iter().map(|z| variable(z.var)).collect();
        let continuous = dcs.algebraics.iter().filter(|z| z.continuous);
        let place = |i: usize| variable(dcs.algebraics[i].var);
        let sticks = dcs.discs.iter().map(|disc| place(disc.stick));
        let mut known: FxHashSet<Var> = continuous.map(|z| variable(z.var)).chain(sticks).collect();
        let directions = dcs.discs.iter().flat_map(|disc| disc.alphas);
        let directions: FxHashSet<Var> = directions.map(place).collect();
        let spreads = |var: &&Var| !directions.contains(var);
        loop {
            let before = known.len();
            for row in &occurring {
                if row.iter().filter(spreads).any(|var| known.contains(var)) {
                    known.extend(row.iter().filter(|var| declared.contains(var)));
                }
            }
            if known.len() == before {
                break;
            }
        }
        let contains = |row: &Vec<Var>| row.iter().filter(spreads).any(|var| known.contains(var));
        End {
            algebraics: (0..dcs.algebraics.len())
                .filter(|&i| known.contains(&variable(dcs.algebraics[i].var)))
                .collect(),
            equations: (0..occurring.len())
                .filter(|&row| contains(&occurring[row]))
                .collect(),
        }
    }
}
