//! Which variable is what: the way from the program back to the trajectory.

use nsd_solver::integrate::tableau::Tableau;
use rustc_hash::FxHashSet;

use super::block::variable;
use super::impulses::{self, Boundaries};
use super::led::{self, Led};
use super::{Detection, Grid, branch, task};
use crate::expr::{Expr, Var, variables_of};
use crate::lowering::dcs::{Dcs, Impact};
use crate::lowering::discretize::task::quadrature::Integral;
use crate::lowering::mpcc::{Bounds, Mpcc, Span, n_places};
use crate::system::experiment::Form;
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
    pub(crate) continuous: Vec<usize>,
    /// Which of them do not jump with states.
    pub(crate) kept: Vec<usize>,
    /// Which of them jump with switches of time.
    pub(crate) led: Option<Led>,
    /// What elements begin with where contacts give impulses.
    pub(crate) boundaries: Option<Boundaries>,
    /// Which z are there at a right end that is no node.
    pub(crate) at_end: Vec<usize>,
    /// What bounds the stability of sliding modes, and of how many switches.
    branches: (usize, usize),
}

impl Layout {
    /// The number of an element, from 0.
    pub(crate) fn element(&self, k: usize, j: usize) -> usize {
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
    pub(crate) fn x_start(&self, k: usize, i: usize) -> usize {
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
pub(crate) fn declare(
    mpcc: &mut Mpcc,
    dcs: &Dcs,
    grid: Grid,
    tableau: &Tableau,
    form: Form,
    detection: Option<Detection>,
    integrals: &[Integral],
) -> Layout {
    let frame = Frame::new(dcs, grid, tableau, detection);
    let Frame {
        elements,
        nodes,
        end,
        ..
    } = frame;
    let lengths = frame.lengths(mpcc);
    let times = frame.times(mpcc, integrals);
    let task = dcs.task.as_ref();
    let decided = task.map(|_| task::declare(mpcc, dcs, grid));
    let decided = decided.unwrap_or_default();
    let states = frame.states(mpcc, form);
    let algebraics = frame.algebraics(mpcc, &states.free);
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
        initial_states: states.initial,
        states: states.behind,
        slopes: states.slopes,
        initial_algebraics: algebraics.initial,
        started: algebraics.started,
        restarts: algebraics.restarts,
        algebraics: algebraics.at_nodes,
        end_algebraics: algebraics.right,
        continuous: algebraics.continuous,
        kept: algebraics.kept,
        led: algebraics.led,
        boundaries: algebraics.boundaries,
        at_end: algebraics.at_end,
        branches: branch::declare(mpcc, dcs, frame.per_element()),
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

/// The first states at the start and behind it, the first slope, and the bounds of states that are not given.
struct States {
    initial: usize,
    behind: usize,
    slopes: Option<usize>,
    free: Vec<Bounds>,
}

/// The first algebraic variables at the start, at nodes and at right ends that are none; the others as in [`Layout`].
struct Algebraics {
    initial: usize,
    at_nodes: usize,
    right: usize,
    started: (usize, Vec<usize>),
    restarts: bool,
    continuous: Vec<usize>,
    kept: Vec<usize>,
    led: Option<Led>,
    boundaries: Option<Boundaries>,
    at_end: Vec<usize>,
}

/// The same bounds at all places.
fn everywhere(places: &[Span], bounds: &[Bounds]) -> Vec<Bounds> {
    bounds.repeat(n_places(places))
}

impl<'d, 'e> Frame<'d, 'e> {
    fn new(dcs: &'d Dcs<'e>, grid: Grid, tableau: &Tableau, detection: Option<Detection>) -> Self {
        let nodes = tableau.n_nodes();
        Frame {
            dcs,
            grid,
            detection,
            elements: detection.map_or(1, |detection| detection.elements),
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
        // Without any length, rates do not say what α is, and a sliding mode might end in it anywhere.
        let least = match task.is_some() && !self.dcs.branches.is_empty() {
            true => branch::SHORTEST,
            false => 0.0,
        };
        let length = if task.is_some_and(|task| task.clock.is_some()) {
            Bounds::between(0.0, SLOWEST * self.elements as f64 * longest, mean)
        } else if spread == 0.0 && horizon.is_none() {
            Bounds::fixed(mean)
        } else {
            let lower = (1.0 - spread).max(least) * shortest;
            Bounds::between(lower, (1.0 + spread) * longest, mean)
        };
        let lengths = vec![length; self.n_elements()];
        mpcc.declare("h", vec!["h".to_owned()], &self.per_element(), lengths)
    }

    /// The starts of elements, where the system depends on time.
    fn times(&self, mpcc: &mut Mpcc, integrals: &[Integral]) -> Option<usize> {
        let Frame { dcs, grid, .. } = *self;
        let rows = dcs.rates.iter().chain(&dcs.equations).copied();
        let rows = rows.chain(dcs.impacts.iter().flat_map(Impact::exprs));
        let rows: Vec<Expr> = rows.chain(integrals.iter().map(|i| i.rate)).collect();
        let occurring = variables_of(&rows);
        let is_timed = occurring.contains(&variable(dcs.time)) || task::is_timed(dcs, &occurring);
        let start = |e: usize| {
            let step = (e / self.elements) as f64;
            let start = grid.start + grid.horizon * step / grid.steps as f64;
            match e % self.elements {
                0 if e == 0 || self.free_horizon().is_none() => Bounds::fixed(start),
                j => Bounds::free(start + j as f64 * self.mean()),
            }
        };
        is_timed.then(|| {
            let bounds = (0..self.n_elements()).map(start).collect();
            mpcc.declare("t", vec!["t".to_owned()], &self.per_element(), bounds)
        })
    }

    /// States and slopes.
    fn states(&self, mpcc: &mut Mpcc, form: Form) -> States {
        let dcs = self.dcs;
        let task = dcs.task.as_ref();
        let names = || dcs.states.iter().map(|state| state.var.to_string());
        let initial = || dcs.states.iter().map(|state| state.initial);
        let mut known: Vec<Bounds> = initial().map(Bounds::fixed).collect();
        for freed in task.iter().flat_map(|task| &task.initial) {
            let guess = dcs.states[freed.place].initial;
            known[freed.place] = Bounds::between(freed.lower, freed.upper, guess);
        }
        let mut free: Vec<Bounds> = initial().map(Bounds::free).collect();
        for bound in task.iter().flat_map(|task| &task.bounds) {
            free[bound.place] = free[bound.place].within(bound.lower, bound.upper);
        }
        let (behind, nodes) = (self.points(1, self.end), self.points(1, self.nodes));
        States {
            initial: mpcc.declare("x", names().collect(), &Self::starts(1), known),
            behind: mpcc.declare("x", names().collect(), &behind, everywhere(&behind, &free)),
            slopes: (form == Form::Differential).then(|| {
                let slopes = names().map(|name| format!("der({name})")).collect();
                let bounds = vec![Bounds::free(0.0); dcs.states.len()];
                mpcc.declare("v", slopes, &nodes, everywhere(&nodes, &bounds))
            }),
            free,
        }
    }

    /// Algebraic variables, of which some are there at left ends, and some at right ends that are no nodes.
    fn algebraics(&self, mpcc: &mut Mpcc, states: &[Bounds]) -> Algebraics {
        let dcs = self.dcs;
        let bounds = algebraic_bounds(dcs);
        let names = |list: &[usize]| {
            let vars = list.iter().map(|&i| dcs.algebraics[i].var.to_string());
            vars.collect::<Vec<_>>()
        };
        let chosen = |list: &[usize]| list.iter().map(|&i| bounds[i]).collect::<Vec<Bounds>>();
        let all: Vec<usize> = (0..dcs.algebraics.len()).collect();
        let is_continuous = |i: &usize| self.detection.is_some() && dcs.algebraics[*i].continuous;
        let continuous: Vec<usize> = all.iter().copied().filter(is_continuous).collect();
        let at_end = match self.detection {
            Some(_) if self.end > self.nodes => End::new(dcs).algebraics,
            _ => Vec::new(),
        };
        let boundaries = impulses::declare(mpcc, dcs, self.per_element(), states, &bounds);
        let jumps = |i: &usize| boundaries.as_ref().is_some_and(|b| b.jumping.contains(i));
        let led =
            (self.detection).and_then(|_| led::declare(mpcc, dcs, self.per_element(), &bounds));
        let is_led = |i: &usize| led.as_ref().is_some_and(|led| led.index(0, *i).is_some());
        let kept: Vec<usize> = (continuous.iter().copied())
            .filter(|i| !jumps(i) && !is_led(i))
            .collect();
        let start = task::Start::of(dcs);
        let starts = Self::starts(if start.restarts { self.grid.steps } else { 1 });
        let given = kept.iter().map(|&i| Bounds::fixed(dcs.algebraics[i].guess));
        let given = match start.is_free {
            false => given.collect(),
            true => everywhere(&starts, &chosen(&kept)),
        };
        let initial = mpcc.declare("z", names(&kept), &starts, given);
        let started = match self.detection {
            Some(_) => start.states,
            None => Vec::new(),
        };
        let first = (!started.is_empty()).then(|| {
            let states = || started.iter().map(|&i| &dcs.states[i]);
            let components = states().map(|state| format!("start({})", state.var));
            let bounds: Vec<Bounds> = states().map(|state| Bounds::free(state.initial)).collect();
            let bounds = everywhere(&starts, &bounds);
            mpcc.declare("x_start", components.collect(), &starts, bounds)
        });
        let (nodes, right) = (self.points(1, self.nodes), self.points(self.end, self.end));
        let mut declare = |list: &[usize], places: &[Span]| {
            let bounds = everywhere(places, &chosen(list));
            mpcc.declare("z", names(list), places, bounds)
        };
        Algebraics {
            initial,
            at_nodes: declare(&all, &nodes),
            right: declare(&at_end, &right),
            started: (first.unwrap_or(0), started),
            restarts: start.restarts,
            continuous,
            kept,
            led,
            boundaries,
            at_end,
        }
    }
}

/// Members of pairs are not negative.
fn algebraic_bounds(dcs: &Dcs) -> Vec<Bounds> {
    let members: FxHashSet<Expr> = (dcs.pairs.iter())
        .flat_map(|pair| [pair.left, pair.right])
        .collect();
    let bounds = |z: &crate::lowering::dcs::Algebraic| {
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
pub(crate) struct End {
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
