//! A solution in terms that no lowering of switches knows, and the way into the program of another one.
//!
//! The programs of two lowerings of switches have the same grid, states, controls and impulses, and say with other
//! multipliers what α of the switches is. So a solution of one is a point of the other: its lengths, states and
//! controls as they are, and the multipliers that belong to its α. It is feasible there, with the same objective, if
//! both programs are about the same system.

use serde::{Deserialize, Serialize};

use crate::lowering::dcs::solve_in_mode;
use crate::lowering::discretize::{Grid, Layout};
use crate::optimize::Problem;
use crate::system::task::Shape;

/// Lengths add up to the horizon but for this share of it.
const ADD_UP: f64 = 1e-3;

/// A solution on its grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Which programs it is a point of.
    kind: Kind,
    /// T.
    pub(super) horizon: f64,
    params: Vec<f64>,
    /// Lengths of intervals as shares of their mean, where these are not equal.
    pub(super) shares: Vec<f64>,
    /// Interval by interval.
    pub(super) controls: Vec<Vec<f64>>,
    pub(super) elements: Vec<Element>,
}

impl Point {
    /// Makes it one of programs on another grid.
    pub(super) fn set_grid(&mut self, layout: &Layout) {
        self.kind.grid = grid(layout);
    }

    /// Elements and nodes of its grid.
    pub(crate) fn grid(&self) -> [usize; 2] {
        let [_, elements, nodes] = self.kind.grid;
        [elements, nodes]
    }

    /// The states at its start.
    pub fn start(&self) -> &[f64] {
        &self.elements[0].before
    }
}

/// What tells apart programs that have no points in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Kind {
    is_frozen: bool,
    n_impacts: usize,
    n_states: usize,
    n_switches: usize,
    /// Steps, elements and nodes.
    grid: [usize; 3],
}

fn grid(layout: &Layout) -> [usize; 3] {
    [layout.steps, layout.elements, layout.nodes]
}

/// What happens in an element.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Element {
    pub(super) length: f64,
    /// When it begins, where the program asks for it.
    pub(super) start: Option<f64>,
    /// States at its nodes, from the left end to the right one.
    pub(super) states: Vec<Vec<f64>>,
    /// The states where it begins, before impulses.
    pub(super) before: Vec<f64>,
    /// States that have other values with the multipliers where an interval begins.
    pub(super) started: Vec<Option<f64>>,
    /// α of the switches of the discretized system at its Runge-Kutta nodes.
    pub(super) alphas: Vec<Vec<f64>>,
    /// What contacts give where it begins.
    pub(super) impulses: Vec<f64>,
}

/// Whether a point has the sizes of points of a program, and lengths that add up.
pub(crate) fn fits(problem: &Problem<'_>, point: &Point) -> bool {
    let guess: Vec<f64> = problem.mpcc.bounds().iter().map(|one| one.guess).collect();
    let own = problem.point(&guess);
    let widths = |rows: &[Vec<f64>]| rows.iter().map(Vec::len).collect::<Vec<usize>>();
    let sizes = |one: &Element| {
        let started: Vec<bool> = one.started.iter().map(Option::is_some).collect();
        let n = [one.before.len(), one.impulses.len()];
        let is_told = one.start.is_some();
        (
            n,
            is_told,
            widths(&one.states),
            widths(&one.alphas),
            started,
        )
    };
    let length: f64 = point.elements.iter().map(|one| one.length).sum();
    own.kind == point.kind
        && own.params.len() == point.params.len()
        && own.shares.len() == point.shares.len()
        && point.shares.iter().all(|&share| share > 0.0)
        && widths(&own.controls) == widths(&point.controls)
        && own
            .elements
            .iter()
            .map(sizes)
            .eq(point.elements.iter().map(sizes))
        && point.horizon > 0.0
        && (length - point.horizon).abs() <= ADD_UP * point.horizon
}

impl Problem<'_> {
    fn kind(&self) -> Kind {
        let layout = &self.layout;
        Kind {
            is_frozen: self.frozen.is_some(),
            n_impacts: self.n_impulses(),
            n_states: layout.n_states(),
            n_switches: self.dcs.switches.alphas.len(),
            grid: grid(layout),
        }
    }

    /// Impulses and sides of slip where an element begins.
    fn n_impulses(&self) -> usize {
        self.dcs.boundary().len()
    }

    /// A solution of the program.
    pub(crate) fn point(&self, w: &[f64]) -> Point {
        let layout = &self.layout;
        let task = self.dcs.task.as_ref();
        let n_controls = task.map_or(0, |task| task.controls.len());
        let n_params = task.map_or(0, |task| task.params.len());
        let states = |first: usize| w[first..first + layout.n_states()].to_vec();
        let element = |(k, j): (usize, usize)| Element {
            length: w[layout.h(k, j)],
            start: layout.t(k, j).map(|t| w[t]),
            states: (0..=layout.end)
                .map(|m| states(layout.x(k, j, m)))
                .collect(),
            before: states(layout.before(k, j)),
            started: (0..layout.n_states())
                .map(|i| {
                    let started = layout.started(k, i).filter(|_| j == 1);
                    started.map(|index| w[index])
                })
                .collect(),
            alphas: (1..=layout.nodes)
                .map(|m| self.at(w).lowered_alphas(k, j, m))
                .collect(),
            impulses: layout.impulses(k, j).map_or_else(Vec::new, |first| {
                w[first..first + self.n_impulses()].to_vec()
            }),
        };
        Point {
            kind: self.kind(),
            horizon: self.at(w).horizon(),
            params: (0..n_params).map(|i| w[layout.p(i)]).collect(),
            shares: (1..=layout.steps)
                .filter_map(|k| Some(w[layout.decided.share(k)?]))
                .collect(),
            controls: layout
                .control_instants()
                .map(|(k, _)| w[layout.u(k)..layout.u(k) + n_controls].to_vec())
                .collect(),
            elements: layout.all_elements().map(element).collect(),
        }
    }

    /// The point of this program that means the same; none where it has no such point.
    pub(crate) fn lifted(&self, point: &Point) -> Option<Vec<f64>> {
        if self.kind() != point.kind {
            return None;
        }
        let layout = &self.layout;
        let bounds = self.mpcc.bounds();
        let mut w: Vec<f64> = bounds.iter().map(|bounds| bounds.guess).collect();
        let mut set = |index: usize, value: f64| {
            if value.is_finite() && !bounds[index].is_fixed() {
                w[index] = value.max(bounds[index].lower).min(bounds[index].upper);
            }
        };
        if let Some(index) = layout.horizon() {
            set(index, point.horizon);
        }
        for (i, &value) in point.params.iter().enumerate() {
            set(layout.p(i), value);
        }
        for (k, &share) in (1..).zip(&point.shares) {
            layout
                .decided
                .share(k)
                .into_iter()
                .for_each(|index| set(index, share));
        }
        for ((k, _), values) in layout.control_instants().zip(&point.controls) {
            for (i, &value) in values.iter().enumerate() {
                set(layout.u(k) + i, value);
            }
        }
        for ((k, j), element) in layout.all_elements().zip(&point.elements) {
            set(layout.h(k, j), element.length);
            if let Some((index, start)) = layout.t(k, j).zip(element.start) {
                set(index, start);
            }
            let first = layout.impulses(k, j);
            for (i, &value) in element.impulses.iter().enumerate() {
                first.into_iter().for_each(|first| set(first + i, value));
            }
            for (i, &value) in element.before.iter().enumerate() {
                set(layout.before(k, j) + i, value);
            }
            for (i, value) in element.started.iter().enumerate() {
                let started = layout.started(k, i).filter(|_| j == 1);
                if let Some((index, &value)) = started.zip(value.as_ref()) {
                    set(index, value);
                }
            }
            for (m, states) in element.states.iter().enumerate() {
                for (i, &value) in states.iter().enumerate() {
                    set(layout.x(k, j, m) + i, value);
                }
            }
        }
        let ends = self.at(&w).ends();
        let mut started = 0.0;
        for ((k, j), element) in layout.all_elements().zip(&point.elements) {
            if j == 1 && self.frozen.is_none() {
                started = ends[k - 1];
            }
            for m in 0..=layout.end {
                let time = started + layout.points[m] * element.length;
                let z = self.multipliers(point, (k, element), m, time);
                for (i, z) in z.into_iter().enumerate() {
                    if let Some(index) = layout.z(k, j, m, i) {
                        let bounds = &bounds[index];
                        if z.is_finite() && !bounds.is_fixed() {
                            w[index] = z.max(bounds.lower).min(bounds.upper);
                        }
                    }
                }
            }
            started += element.length;
        }
        self.mpcc.slacken(&mut w);
        Some(w)
    }

    /// z at a node of an element in interval k, from its states and α. At ends that are no nodes α is that of the
    /// nearest node: there is one mode in an element.
    fn multipliers(
        &self,
        point: &Point,
        (k, element): (usize, &Element),
        m: usize,
        time: f64,
    ) -> Vec<f64> {
        let (layout, system) = (&self.layout, self.lowered());
        let middle = Grid::new(point.horizon, layout.steps).middle_of(k);
        let mut known = system.valuation_around([time, middle], &[], &[]);
        for (i, state) in system.states.iter().enumerate() {
            let started = element.started.get(i).copied().flatten();
            let value = element.states[m].get(i).copied().unwrap_or(0.0);
            known.set(state.var, started.filter(|_| m == 0).unwrap_or(value));
        }
        if let Some(task) = &self.dcs.task {
            for (free, &value) in task.params.iter().zip(&point.params) {
                known.set(self.dcs.params[free.place].var, value);
            }
            // Straight lines go from the end of one interval to that of the next.
            let share = time / point.horizon * layout.steps as f64 - (k - 1) as f64;
            for (i, control) in task.controls.iter().enumerate() {
                let value = match task.shape {
                    Shape::Constant => point.controls[k - 1][i],
                    Shape::Linear => {
                        let [from, to] = [k - 1, k].map(|k| point.controls[k][i]);
                        from + share.clamp(0.0, 1.0) * (to - from)
                    }
                };
                known.set(control.var, value);
            }
        }
        let node = m.clamp(1, layout.nodes) - 1;
        let value = |var| known.number(var);
        solve_in_mode(system, &self.dcs, &element.alphas[node], &value).algebraics
    }
}
