//! The problem of a task in its free quantities alone: controls, free parameters, free initial values and a free T.
//!
//! States follow from them by a simulation from event to event, that of the model: elements, nodes and the branches of
//! a program are not in it.

use nsd_solver::integrate::tableau::Tableau;

use super::solved;
use crate::expr::{Evaluator, Var};
use crate::limit::Limit;
use crate::lowering::discretize::Grid;
use crate::optimize::Problem;
use crate::system::experiment::At;
use crate::system::task::{Holds, Lengths, Norm, Penalty, Shape, TaskRow};
use crate::system::{System, Valuation};

/// Simulations are made as long as they take fewer steps than this, times the number of states.
const MAX_EFFORT: usize = 200_000;
/// Lengths add up where their sum is off by no more than this share of it.
const BALANCED: f64 = 1e-14;
/// What is as near to the end of an interval, as a share of its length, is at it.
const AT_END: f64 = 1e-4;
/// Lengths that are in their ranges reach their ends by this factor.
const LARGEST_FACTOR: f64 = Lengths::FREE[1] / Lengths::FREE[0];

/// What a quantity is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A control, by its number, in an interval.
    Control(usize),
    /// A parameter, by its place.
    Param(usize),
    /// An initial value, by the place of its state.
    Initial(usize),
    /// T.
    Horizon,
    /// The length of a control interval as a share of T/N.
    Length,
}

/// What is free in a task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quantity {
    /// The variable of the program.
    pub index: usize,
    /// Its bounds.
    pub lower: f64,
    /// Its bounds.
    pub upper: f64,
    /// What its changes are measured by.
    pub size: f64,
    /// What it is.
    pub kind: Kind,
}

/// What a constraint is about.
enum Asked<'e> {
    /// A function of states, controls and time.
    Value(Evaluator<'e>),
    /// The smaller one of two, which is zero where they complement each other.
    Smaller([Evaluator<'e>; 2]),
    /// Σ s_k of the lengths of control intervals as shares of T/N.
    Lengths,
}

/// lower <= value <= upper at an instant.
struct Row {
    /// The number of what is asked.
    value: usize,
    lower: f64,
    upper: f64,
    /// The number of the instant, or none for the end of the horizon.
    at: Option<usize>,
    /// The number of the penalty of a soft one, and what its place stands for: a share of its interval.
    soft: Option<(usize, f64)>,
}

/// An instant at which something is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    /// The interval that it is in or ends.
    k: usize,
    /// As a share of it.
    share: f64,
}

/// The objective and the constraints for certain values of the free quantities.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    /// J.
    pub cost: f64,
    /// What of it violations of soft constraints cost.
    pub penalty: f64,
    /// The values of the rows, in order.
    pub rows: Vec<f64>,
    /// States, then α, at the end.
    pub end: Vec<f64>,
    /// Steps of the simulation.
    pub steps: usize,
    /// Where its events are: 2k - 1 is in interval k, and 2k at its end.
    pub events: Vec<usize>,
}

/// The problem in free quantities.
pub(crate) struct Reduced<'r, 'e> {
    /// With its program.
    pub problem: &'r Problem<'e>,
    /// What is free.
    pub quantities: Vec<Quantity>,
    cost: Evaluator<'e>,
    places: Vec<Place>,
    /// What constraints are about.
    asked: Vec<Asked<'e>>,
    rows: Vec<Row>,
    /// How violations are measured, and their weights.
    penalties: Vec<(Norm, Evaluator<'e>)>,
    /// The rows at each place.
    at_place: Vec<Vec<usize>>,
    /// Initial values that follow from parameters.
    starts: Starts<'e>,
    /// When no more runs begin, and those that go on end.
    pub limit: Limit,
}

/// x(0) = x_0(p): initial values that follow from free parameters, by the place of their state, with x(0) - x_0(p).
pub(crate) struct Starts<'e>(Vec<(usize, Evaluator<'e>)>);

impl<'e> Starts<'e> {
    /// Those of a problem.
    pub fn new(problem: &Problem<'e>) -> Self {
        let rows = problem.system.task.iter().flat_map(|task| &task.rows);
        let starts = rows.filter_map(|row| Some((row.starts?, Evaluator::new(row.value))));
        Starts(starts.collect())
    }

    /// Whether they are those of a state.
    fn give(&self, place: usize) -> bool {
        self.0.iter().any(|&(of, _)| of == place)
    }

    /// Sets those among x(0), with the parameters of a point.
    pub fn set(&self, problem: &Problem, w: &[f64], x: &mut [f64]) {
        if self.0.is_empty() {
            return;
        }
        let mut known = Known::new(problem, w);
        for (place, missing) in &self.0 {
            x[*place] = 0.0;
            known.set(&problem.system, [0.0, 0.0], x);
            x[*place] = -missing.eval(&|var| known.value(var));
        }
    }
}

impl Problem<'_> {
    /// Brings lengths of control intervals that are chosen to their sum, by one factor and within their ranges.
    pub(crate) fn balance(&self, w: &mut [f64]) {
        let (task, steps) = (self.system.task.as_ref(), self.layout.steps);
        if task.is_none_or(|task| task.lengths != Lengths::Free) {
            return;
        }
        let bounds = self.mpcc.bounds();
        let lengths = (1..=steps).filter_map(|k| self.layout.decided.share(k));
        let lengths: Vec<(usize, f64)> = lengths.map(|index| (index, w[index])).collect();
        let missing = |w: &[f64]| {
            let all: f64 = lengths.iter().map(|&(index, _)| w[index]).sum();
            steps as f64 - all
        };
        let [mut low, mut high] = [0.0, LARGEST_FACTOR];
        while missing(w).abs() > BALANCED * steps as f64 && high - low > f64::EPSILON * high {
            let factor = 0.5 * (low + high);
            for &(index, length) in &lengths {
                let value = factor * length;
                w[index] = value.max(bounds[index].lower).min(bounds[index].upper);
            }
            match missing(w) > 0.0 {
                true => low = factor,
                false => high = factor,
            }
        }
    }
}

impl<'r, 'e> Reduced<'r, 'e> {
    /// The problem near a point, with constraints where its nodes are. None for systems without a task.
    pub fn new(problem: &'r Problem<'e>, w: &[f64], limit: &Limit) -> Option<Self> {
        let task = problem.system.task.as_ref()?;
        problem.run_again(w);
        let starts = Starts::new(problem);
        let mut reduced = Reduced {
            problem,
            quantities: quantities(problem, w, &starts),
            cost: Evaluator::new(task.cost.value),
            places: Vec::new(),
            asked: Vec::new(),
            rows: Vec::new(),
            penalties: Vec::new(),
            at_place: Vec::new(),
            starts,
            limit: limit.clone(),
        };
        reduced.ask(w);
        Some(reduced)
    }

    /// Adds the rows of the task, and bounds of states.
    fn ask(&mut self, w: &[f64]) {
        let layout = &self.problem.layout;
        let Some(task) = &self.problem.system.task else {
            return;
        };
        let edges = self.problem.at(w).ends();
        // With the shares of their intervals that they stand for.
        let mut ends: Vec<(Place, f64)> = Vec::new();
        let mut nodes: Vec<(Place, f64)> = Vec::new();
        let (family, n_nodes) = self.problem.task.discretization.scheme;
        let tableau = Tableau::new(family, n_nodes).expect("the number of nodes has been checked");
        for (k, j) in layout.all_elements() {
            let before: f64 = (1..j).map(|j| w[layout.h(k, j)].max(0.0)).sum();
            let (h, length) = (w[layout.h(k, j)].max(0.0), edges[k] - edges[k - 1]);
            let place = |c: f64| Place {
                k,
                share: ((before + c * h) / length).min(1.0),
            };
            let points = layout.points[1..=layout.nodes].iter().zip(&tableau.weights);
            nodes.extend(points.map(|(&c, weight)| (place(c), weight * h / length)));
            ends.push((place(1.0), h / length));
        }
        let interval = |k: usize| (Place { k, share: 1.0 }, 1.0);
        let start = (Place { k: 1, share: 0.0 }, 0.0);
        // A clock in numerical time has no lengths of physical time.
        let is_frozen = self.problem.frozen.is_some();
        for row in task.rows.iter().filter(|row| row.starts.is_none()) {
            let places = match row.at {
                At::Start => vec![start],
                At::End => {
                    self.push_row(row, [None]);
                    continue;
                }
                At::Intervals => (1..=layout.steps).map(interval).collect(),
                At::Elements | At::Nodes if is_frozen => (1..=layout.steps).map(interval).collect(),
                At::Elements => ends.clone(),
                At::Nodes => nodes.clone(),
            };
            let initial = task.initial.iter();
            let freed = initial.map(|free| self.problem.system.states[free.place].var);
            let also = row.at != At::Start && row.is_at_start(freed);
            let places = also.then_some(start).into_iter().chain(places);
            self.push_row(row, places.map(Some));
        }
        for bound in &task.bounds {
            let state = self.problem.system.states[bound.place].var;
            let places = match is_frozen {
                true => (1..=layout.steps).map(interval).collect(),
                false => nodes.clone(),
            };
            let places = places.into_iter().map(Some);
            let value = Asked::Value(Evaluator::new(state));
            self.push(value, [bound.lower, bound.upper], None, places);
        }
        // Lengths that are chosen are shares of what they add up to.
        if task.lengths == Lengths::Free {
            let all = layout.steps as f64;
            self.push(Asked::Lengths, [all, all], None, [None]);
        }
        // Instants are met in order.
        let mut order: Vec<usize> = (0..self.places.len()).collect();
        order.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|i| self.places[i]);
            a.k.cmp(&b.k).then(a.share.total_cmp(&b.share))
        });
        let mut number = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            number[old] = new;
        }
        self.places = order.iter().map(|&old| self.places[old]).collect();
        for row in &mut self.rows {
            row.at = row.at.map(|at| number[at]);
        }
        self.at_place = vec![Vec::new(); self.places.len()];
        for (i, row) in self.rows.iter().enumerate() {
            row.at.into_iter().for_each(|at| self.at_place[at].push(i));
        }
    }

    /// Asks for the value of a constraint of the task at places.
    fn push_row(
        &mut self,
        row: &TaskRow<'e>,
        places: impl IntoIterator<Item = Option<(Place, f64)>>,
    ) {
        let (value, bounds) = (Evaluator::new(row.value), [row.lower, row.upper]);
        match row.holds {
            Holds::Strictly => self.push(Asked::Value(value), bounds, None, places),
            Holds::Softly(Penalty { norm, weight }) => {
                let penalty = self.penalties.len();
                self.penalties.push((norm, Evaluator::new(weight)));
                self.push(Asked::Value(value), bounds, Some(penalty), places);
            }
            Holds::Against(other) => {
                let both = Asked::Smaller([value, Evaluator::new(other)]);
                self.push(both, [0.0, 0.0], None, places);
            }
        }
    }

    /// Asks for a value at places; none is the end of the horizon.
    fn push(
        &mut self,
        value: Asked<'e>,
        [lower, upper]: [f64; 2],
        penalty: Option<usize>,
        places: impl IntoIterator<Item = Option<(Place, f64)>>,
    ) {
        self.asked.push(value);
        for place in places {
            let share = place.map_or(1.0, |(_, share)| share);
            let at = place.map(|(place, _)| {
                let known = self.places.iter().rposition(|known| *known == place);
                known.unwrap_or_else(|| {
                    self.places.push(place);
                    self.places.len() - 1
                })
            });
            self.rows.push(Row {
                value: self.asked.len() - 1,
                lower,
                upper,
                at,
                soft: penalty.map(|penalty| (penalty, share)),
            });
        }
    }

    /// Whether so many runs of so many steps take too long.
    pub fn is_too_much(&self, runs: usize, steps: usize) -> bool {
        runs > self.most_runs(steps)
    }

    /// How many runs of so many steps do not take too long.
    pub fn most_runs(&self, steps: usize) -> usize {
        MAX_EFFORT / (steps * self.problem.system.states.len()).max(1)
    }

    /// The rows that hold strictly, but for lengths, which can be brought to their sum.
    fn strict(&self) -> impl Iterator<Item = &Row> {
        let is_strict =
            |row: &&Row| row.soft.is_none() && !matches!(self.asked[row.value], Asked::Lengths);
        self.rows.iter().filter(is_strict)
    }

    /// Whether anything but ranges constrains.
    pub fn is_constrained(&self) -> bool {
        self.strict().next().is_some()
    }

    /// Whether equations constrain.
    pub fn is_tied(&self) -> bool {
        self.strict().any(|row| row.lower == row.upper)
    }

    /// The bounds of the rows; soft ones have none.
    pub fn bounds(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.rows.iter().map(|row| match row.soft {
            Some(_) => (f64::NEG_INFINITY, f64::INFINITY),
            None => (row.lower, row.upper),
        })
    }

    /// Whether it has other branches.
    pub fn is_switched(&self) -> bool {
        !self.problem.system.switches.is_empty()
    }

    /// A run with the free quantities of a point; none where it does not reach the end in the time that is left, or where
    /// something is not finite.
    pub fn at(&mut self, w: &[f64]) -> Option<Values> {
        let x0 = self.initial(w);
        self.run(w, x0)
    }

    /// The same with an initial value that differs by so much.
    pub fn at_from(&mut self, w: &[f64], (place, change): (usize, f64)) -> Option<Values> {
        let mut x0 = self.initial(w);
        x0[place] += change;
        self.run(w, x0)
    }

    fn initial(&self, w: &[f64]) -> Vec<f64> {
        let problem = self.problem;
        let system = &problem.system;
        let mut x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
        for free in system.task.iter().flat_map(|task| &task.initial) {
            x0[free.place] = w[problem.layout.before(1, 1) + free.place];
        }
        self.starts.set(problem, w, &mut x0);
        x0
    }

    fn run(&mut self, w: &[f64], x0: Vec<f64>) -> Option<Values> {
        let problem = self.problem;
        let limit = &self.limit;
        if limit.is_over() {
            return None;
        }
        let horizon = problem.at(w).horizon();
        let tables = solved::tables(problem, w);
        let ends = problem.at(w).ends();
        let instants = self.places.iter().map(|place| {
            let [from, to] = [place.k - 1, place.k].map(|k| ends[k]);
            match place.share {
                1.0 => to,
                share => (from + share * (to - from)).min(to),
            }
        });
        let instants: Vec<f64> = instants.collect();
        let run = problem.again(w, |runs| {
            runs.replace_data(problem.system.exogenous.data.len(), &tables);
            runs.values(&x0, horizon, &instants, limit)
        })?;
        let system = &problem.system;
        let mut known = Known::new(problem, w);
        let grid = Grid::new(horizon, problem.layout.steps);
        let around = |time: f64, k: usize| [time, grid.middle_of(k)];
        known.set(system, around(horizon, grid.steps), &run.end);
        known.decide(problem, w, problem.layout.steps, 1.0);
        let cost = self.cost.eval(&|var| known.value(var));
        let mut rows = vec![f64::NAN; self.rows.len()];
        let value = |row: &Row, known: &Known| match &self.asked[row.value] {
            Asked::Value(value) => value.eval(&|var| known.value(var)),
            Asked::Smaller(both) => {
                let [a, b] = both.each_ref().map(|e| e.eval(&|var| known.value(var)));
                // Not a number stays what it is.
                if a <= b { a } else { b }
            }
            Asked::Lengths => problem.at(w).shares().iter().flatten().sum(),
        };
        let mut penalty = 0.0;
        let missed = |row: &Row, value: f64, length: f64, known: &Known| {
            row.soft.map_or(0.0, |(penalty, share)| {
                let (norm, weight) = &self.penalties[penalty];
                let weight = weight.eval(&|var| known.value(var));
                weight * share * length * norm.of(value, [row.lower, row.upper])
            })
        };
        for (i, row) in self
            .rows
            .iter()
            .enumerate()
            .filter(|(_, row)| row.at.is_none())
        {
            rows[i] = value(row, &known);
            penalty += missed(row, rows[i], 1.0, &known);
        }
        for (at, place) in self.places.iter().enumerate() {
            known.set(system, around(instants[at], place.k), &run.at[at]);
            known.decide(problem, w, place.k, place.share);
            let length = ends[place.k] - ends[place.k - 1];
            for &i in &self.at_place[at] {
                rows[i] = value(&self.rows[i], &known);
                penalty += missed(&self.rows[i], rows[i], length, &known);
            }
        }
        let cost = cost + penalty;
        let all_finite = cost.is_finite() && rows.iter().all(|value| value.is_finite());
        all_finite.then_some(Values {
            cost,
            penalty,
            rows,
            end: run.end,
            steps: run.steps,
            events: run.events.iter().map(|&t| place_of(t, &ends)).collect(),
        })
    }
}

/// What the variables of costs and constraints are at an instant.
struct Known {
    values: Valuation,
}

impl Known {
    fn new(problem: &Problem, w: &[f64]) -> Self {
        let system = &problem.system;
        let mut values = system.parameters();
        for (i, free) in system
            .task
            .iter()
            .flat_map(|task| task.params.iter().enumerate())
        {
            let param = &system.exogenous.params[free.place];
            values.set(param.var, w[problem.layout.p(i)]);
        }
        Known { values }
    }

    /// Time, states, α and data, whose pieces are those of an instant inside of the interval.
    fn set(&mut self, system: &System, [time, inside]: [f64; 2], row: &[f64]) {
        let vars = (system.states.iter().map(|state| state.var))
            .chain(system.switches.iter().map(|switch| switch.alpha));
        let data = system.exogenous.data.iter();
        let data = data.map(|data| (data.var, data.table.piece(inside).value(time)));
        let all = vars.zip(row.iter().copied()).chain(data);
        self.values.extend(all.chain([(system.time, time)]));
    }

    /// Controls in interval k, at a share of it.
    fn decide(&mut self, problem: &Problem, w: &[f64], k: usize, share: f64) {
        let layout = &problem.layout;
        for task in problem.system.task.iter() {
            for (i, control) in task.controls.iter().enumerate() {
                let value = match task.shape {
                    Shape::Constant => w[layout.u(k) + i],
                    Shape::Linear => {
                        let [from, to] = [k - 1, k].map(|k| w[layout.u(k) + i]);
                        from + share.clamp(0.0, 1.0) * (to - from)
                    }
                };
                self.values.set(control.var, value);
            }
        }
    }

    fn value(&self, var: Var) -> f64 {
        self.values.number(var)
    }
}

/// Where an instant is among the ends of intervals.
fn place_of(instant: f64, ends: &[f64]) -> usize {
    let near = |k: usize| {
        let length = ends[k] - ends[k - 1];
        (instant - ends[k]).abs() <= AT_END * length
    };
    let k = ends[1..].partition_point(|&end| end < instant) + 1;
    let last = ends.len() - 1;
    match k {
        k if k > last || near(k) => 2 * k.min(last),
        k if k > 1 && near(k - 1) => 2 * (k - 1),
        k => 2 * k - 1,
    }
}

/// What is free, with bounds and sizes; controls with finite sets of values and initial values that follow from parameters
/// are not.
fn quantities(problem: &Problem, w: &[f64], starts: &Starts) -> Vec<Quantity> {
    let layout = &problem.layout;
    let bounds = problem.mpcc.bounds();
    let Some(task) = &problem.system.task else {
        return Vec::new();
    };
    let mut found: Vec<(Kind, usize, f64)> = Vec::new();
    let controls = task.controls.iter().enumerate();
    for (i, _) in controls.filter(|(_, control)| control.values().is_none()) {
        let all = || layout.control_instants().map(|(k, _)| layout.u(k) + i);
        let largest = all().fold(0.0, |m: f64, index| m.max(w[index].abs()));
        found.extend(all().map(|index| (Kind::Control(i), index, largest)));
    }
    let params = task.params.iter().enumerate();
    let params = params.map(|(i, free)| (Kind::Param(free.place), layout.p(i)));
    let initial = task.initial.iter();
    let initial = initial.filter(|free| !starts.give(free.place)).map(|free| {
        let index = layout.before(1, 1) + free.place;
        (Kind::Initial(free.place), index)
    });
    let horizon = layout.horizon().map(|index| (Kind::Horizon, index));
    let lengths = (1..=layout.steps).filter_map(|k| layout.decided.share(k));
    let lengths = lengths.map(|index| (Kind::Length, index));
    let others = params.chain(initial).chain(horizon).chain(lengths);
    found.extend(others.map(|(kind, index)| (kind, index, w[index].abs())));
    let quantity = |(kind, index, largest): (Kind, usize, f64)| {
        let range = bounds[index].upper - bounds[index].lower;
        let size = problem.sizes.variables[index];
        let largest = if largest > 0.0 { largest } else { size };
        Quantity {
            index,
            lower: bounds[index].lower,
            upper: bounds[index].upper,
            size: match range.is_finite() {
                true => 0.5 * range,
                false => largest,
            },
            kind,
        }
    };
    let quantities = found.into_iter().map(quantity);
    quantities.filter(|q| q.lower < q.upper).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Problem, Reduced};
    use crate::limit::Limit;
    use crate::optimize::Given;
    use crate::testing::with_last;

    #[test]
    fn no_run_begins_when_the_time_is_over() {
        let text = "model m { state x = 1; control u in [-1, 1] = 0.5; x' = u*abs(x); }
                    optimize o of m { horizon 1; intervals 2; minimize final(x); }";
        with_last(text, |compiled| {
            let task = (compiled.settings.optimize.as_ref()).expect("it is an optimization");
            let problem = Problem::new(&compiled.system, &compiled.settings, task, Given::Numbers);
            let problem = problem.expect("it has a program");
            let (w, _) = problem.start(&[], &Limit::default());
            let hour = Duration::from_secs(3600);
            let mut reduced =
                Reduced::new(&problem, &w, &Limit::within(hour)).expect("it has a task");
            let run = reduced.at(&w).expect("it reaches its end");
            assert!((run.cost - 0.5_f64.exp()).abs() < 1e-9, "{}", run.cost);
            // Once the time is over, it is for all runs that follow.
            reduced.limit = reduced.limit.sooner(Duration::ZERO);
            assert!(reduced.at(&w).is_none());
        });
    }

    /// 0.1, 0.1 and 3 are 3 together when the last one is 2.8, as none is below 0.1; and nothing but ranges constrains them.
    #[test]
    fn lengths_are_brought_to_their_sum() {
        let text = "model m { state x = 1; control u in [-1, 1] = 0.5; x' = u*abs(x); }
                    optimize o of m { horizon 1; intervals 3 free; minimize final(x); }";
        with_last(text, |compiled| {
            let task = (compiled.settings.optimize.as_ref()).expect("it is an optimization");
            let problem = Problem::new(&compiled.system, &compiled.settings, task, Given::Numbers);
            let problem = problem.expect("it has a program");
            let (mut w, _) = problem.start(&[], &Limit::default());
            let places = [1, 2, 3].map(|k| problem.layout.decided.share(k).expect("it is free"));
            for (place, length) in places.into_iter().zip([0.1, 0.1, 3.0]) {
                w[place] = length;
            }
            problem.balance(&mut w);
            for (place, length) in places.into_iter().zip([0.1, 0.1, 2.8]) {
                assert!((w[place] - length).abs() < 1e-12, "{}", w[place]);
            }
            let reduced = Reduced::new(&problem, &w, &Limit::default()).expect("it has a task");
            assert!(!reduced.is_tied());
            assert_eq!(reduced.bounds().count(), 1);
        });
    }
}
