//! Which variable is what: the way from the program back to the trajectory.

mod declare;
pub(crate) mod ends;
mod given;

pub(crate) use declare::{bounds_of, declare, range};
pub(crate) use given::fixed_params;

use nsd_solver::fesd::jumps::Element;

use crate::lowering::mpcc::Span;
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
    /// The first h.
    lengths: usize,
    /// The first t, where the system depends on time.
    times: Option<usize>,
    pub(crate) decided: Decided,
    states: States,
    pub(crate) algebraics: Algebraics,
    /// What elements begin with where contacts give impulses.
    pub(crate) boundaries: Option<Boundaries>,
    /// What bounds the stability of sliding modes, and of how many switches.
    branches: (usize, usize),
}

/// First indices of what is decided besides states.
#[derive(Clone, Debug)]
pub(crate) struct Decided {
    /// T, where it is free.
    horizon: Option<usize>,
    /// The first s, where steps are not equal.
    shares: Option<usize>,
    params: usize,
    controls: usize,
    n_controls: usize,
    /// What controls are within a step.
    shape: Shape,
}

/// First indices of x and v.
#[derive(Clone, Debug)]
struct States {
    n: usize,
    initial: usize,
    behind: usize,
    slopes: Option<usize>,
    /// The first of the states that have values of their own with z that start anew, and which states these are.
    started: (usize, Vec<usize>),
}

/// First indices of z: at the start, at nodes and at right ends that are none.
#[derive(Clone, Debug)]
pub(crate) struct Algebraics {
    n: usize,
    initial: usize,
    at_nodes: usize,
    right: usize,
    /// Whether continuous z start anew in every step, because the switching functions contain what jumps there.
    pub restarts: bool,
    /// Which z are continuous, and thus there at the left end.
    pub continuous: Vec<usize>,
    /// Which of them do not jump with states or switches of time.
    pub kept: Vec<usize>,
    /// Which of them jump with switches of time.
    pub led: Option<Led>,
    /// Which z are there at a right end that is no node.
    pub at_end: Vec<usize>,
}

/// First indices of what elements begin with where contacts give impulses.
#[derive(Clone, Debug)]
pub(crate) struct Boundaries {
    states: usize,
    impulses: usize,
    n_impulses: usize,
    algebraics: usize,
    /// Which continuous z jump with states.
    jumping: Vec<usize>,
}

/// The continuous z that start anew in every element.
#[derive(Clone, Debug)]
pub(crate) struct Led {
    /// The first index.
    first: usize,
    /// Which z these are.
    algebraics: Vec<usize>,
    /// The equations that say what they are.
    pub equations: Vec<usize>,
}

/// The index of `i` in blocks of these components, one for every element.
fn index(first: usize, components: &[usize], element: usize, i: usize) -> Option<usize> {
    let place = components.binary_search(&i).ok()?;
    Some(first + element * components.len() + place)
}

impl Layout {
    /// All steps.
    pub(crate) fn each_step(&self) -> Span {
        Span::new("k", 1, self.steps)
    }

    /// All elements of a step.
    pub(crate) fn each_element(&self) -> Span {
        Span::new("j", 1, self.elements)
    }

    /// All Runge-Kutta nodes of an element.
    pub(crate) fn each_node(&self) -> Span {
        Span::new("m", 1, self.nodes)
    }

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
        self.states.n
    }

    /// Steps and elements, in order of time.
    pub fn all_elements(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let elements = self.elements;
        (1..=self.steps).flat_map(move |k| (1..=elements).map(move |j| (k, j)))
    }

    /// The numbers k for which there are controls, each with its instant as a share of the horizon.
    pub fn control_instants(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let (steps, shape) = (self.steps, self.decided.shape);
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
        self.decided.horizon
    }

    /// Free parameter i.
    pub fn p(&self, i: usize) -> usize {
        self.decided.params + i
    }

    /// The first r in an element: for each nonlinear switch one that goes with α and one that goes with 1 - α, see
    /// `branch`. None where nothing is optimized.
    pub fn r(&self, k: usize, j: usize) -> Option<usize> {
        let (first, switches) = self.branches;
        (switches > 0).then(|| first + self.element(k, j) * 2 * switches)
    }

    /// The first control in a step; of linear controls, that at the end of step k, which may be 0.
    pub fn u(&self, k: usize) -> usize {
        let first = match self.decided.shape {
            Shape::Constant => 1,
            Shape::Linear => 0,
        };
        self.decided.controls + (k - first) * self.decided.n_controls
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
            (0, Some(boundaries)) => boundaries.states + element * self.states.n,
            _ => self.states.behind + (element * self.end + m - 1) * self.states.n,
        }
    }

    /// The first state where the element before ends, or the initial one: that before impulses.
    pub fn before(&self, k: usize, j: usize) -> usize {
        match self.element(k, j) {
            0 => self.states.initial,
            element => self.states.behind + (element * self.end - 1) * self.states.n,
        }
    }

    /// State i where step k starts, if it has a value of its own there.
    pub fn started(&self, k: usize, i: usize) -> Option<usize> {
        let (first, states) = &self.states.started;
        let place = states.iter().position(|&state| state == i)?;
        (k == 1 || self.algebraics.restarts).then_some(first + (k - 1) * states.len() + place)
    }

    /// The first slope at a Runge-Kutta node, in the differential form.
    pub fn v(&self, k: usize, j: usize, m: usize) -> Option<usize> {
        let node = self.element(k, j) * self.nodes + m - 1;
        self.states
            .slopes
            .map(|slopes| slopes + node * self.states.n)
    }

    /// The number of algebraic variables.
    pub fn n_algebraics(&self) -> usize {
        self.algebraics.n
    }

    /// Algebraic variable i at node m; at the ends only some are there.
    pub fn z(&self, k: usize, j: usize, m: usize, i: usize) -> Option<usize> {
        let (element, z) = (self.element(k, j), &self.algebraics);
        match m {
            0 if z.continuous.binary_search(&i).is_err() => None,
            0 => (self.boundaries.as_ref())
                .and_then(|boundaries| boundaries.z(element, i))
                .or_else(|| z.anew(element, i))
                .or_else(|| match element == 0 || j == 1 && z.restarts {
                    true => index(z.initial, &z.kept, k - 1, i),
                    false => self.z_behind(element - 1, self.end, i),
                }),
            _ => self.z_behind(element, m, i),
        }
    }

    /// z_i at a node behind the left end of an element.
    fn z_behind(&self, element: usize, m: usize, i: usize) -> Option<usize> {
        let z = &self.algebraics;
        match m <= self.nodes {
            true => Some(z.at_nodes + (element * self.nodes + m - 1) * z.n + i),
            false => index(z.right, &z.at_end, element, i),
        }
    }

    /// The elements of a step as the solver of contacts sees them.
    pub(crate) fn step(&self, k: usize) -> Vec<Element> {
        let element = |j: usize| Element {
            length: self.h(k, j),
            start: self.t(k, j),
            before: self.before(k, j),
            states: (0..=self.end).map(|m| self.x(k, j, m)).collect(),
            algebraics: (0..=self.end)
                .map(|m| {
                    let all = 0..self.n_algebraics();
                    all.map(|i| self.z(k, j, m, i)).collect()
                })
                .collect(),
            impulses: self.impulses(k, j).unwrap_or_default(),
        };
        (1..=self.elements).map(element).collect()
    }

    /// The first impulse where an element begins: Λ of every contact.
    pub fn impulses(&self, k: usize, j: usize) -> Option<usize> {
        let boundaries = self.boundaries.as_ref()?;
        Some(boundaries.impulses + self.element(k, j) * boundaries.n_impulses)
    }
}

impl Decided {
    /// s_k, the length of step k as a share of T/N, where steps are not equal.
    pub fn share(&self, k: usize) -> Option<usize> {
        self.shares.map(|first| first + k - 1)
    }
}

impl Algebraics {
    /// Whether z_i starts anew in every element.
    pub fn starts_anew(&self, i: usize) -> bool {
        self.anew(0, i).is_some()
    }

    /// The z that are given where the first element begins, with their places.
    pub fn fixed_at_start(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let kept = self.kept.iter().enumerate();
        kept.map(|(place, &i)| (self.initial + place, i))
    }

    /// z_i at the left end of an element where it starts anew there, because it jumps with switches of time.
    fn anew(&self, element: usize, i: usize) -> Option<usize> {
        let led = self.led.as_ref()?;
        index(led.first, &led.algebraics, element, i)
    }
}

impl Boundaries {
    /// z_i at the left end of an element where it jumps with states.
    fn z(&self, element: usize, i: usize) -> Option<usize> {
        index(self.algebraics, &self.jumping, element, i)
    }
}
