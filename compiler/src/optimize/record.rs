//! The solution of a program as a trajectory.

use nsd_solver::integrate::tableau::lagrange;

use super::Problem;
use crate::lowering::discretize::Layout;
use crate::report::Trajectory;
use crate::simulate::Elements;
use crate::system::System;
use crate::system::algebraic::following::following;

/// Elements that are so short, as a share of the horizon, have no mode of their own.
const SHORTEST: f64 = 1e-9;

/// States, α and modes of a system without integrals; nothing about how they were found.
pub(super) fn trajectory(problem: &Problem, system: &System, w: &[f64]) -> Trajectory {
    let (layout, at) = (&problem.layout, problem.at(w));
    let horizon = at.horizon();
    let n = layout.n_states();

    let ends = at.ends();
    let instant = |k: usize| ends[k];
    let follows = following(&problem.system).states;
    let kept = Kept::new(layout);
    let points: Vec<f64> = kept.points.iter().map(|&m| layout.points[m]).collect();
    let mut elements = Elements::new(system, &points, kept.nodes.len());
    // The state when the clock stopped, and the laws that have acted since.
    let mut stopped: Option<(Vec<f64>, Vec<usize>)> = None;
    let mut t = 0.0_f64;
    for (k, j) in layout.all_elements() {
        if j == 1 {
            t = t.max(instant(k - 1));
            if k > 1 && !system.recorded.controls.is_empty() {
                elements.step_controls();
            }
        }
        let instants = at.instants((k, j), t);
        // Clocks are continuous but for rounding.
        let from = instants[0].max(t).min(horizon);
        let mut to = instants[layout.end].max(from).min(horizon);
        // The lengths of the elements of an interval add up to it but for rounding, and what is shorter is an instant.
        let is_near = |instant: f64| (to - instant).abs() <= SHORTEST * horizon;
        if is_near(instant(k)) {
            to = instant(k).max(from);
        } else if is_near(from) {
            to = from;
        }
        let left = left(problem, &follows, w, (k, j));
        let x = |m: usize| match m {
            0 => &left[..],
            _ => &w[layout.x(k, j, m)..][..n],
        };
        let alphas: Vec<Vec<f64>> = (1..=layout.nodes).map(|m| at.alphas(k, j, m)).collect();
        let before = &w[layout.before(k, j)..][..n];
        let before = if follows.contains(&true) {
            x(0)
        } else {
            before
        };
        if (k, j) == (1, 1) {
            elements.point(0.0, before, &alphas[0]);
        }
        if at.stands((k, j), &instants) {
            let (_, laws) = stopped.get_or_insert_with(|| (x(0).to_vec(), Vec::new()));
            laws.extend(at.acting((k, j)));
            continue;
        }
        let struck = at.struck((k, j));
        if !struck.is_empty() {
            elements.jump(from, struck, [before, x(0)], &alphas[0]);
        }
        if let Some((before, laws)) = stopped.take().filter(|(_, laws)| !laws.is_empty()) {
            elements.jump(from, laws, [&before, x(0)], &alphas[0]);
        }
        if to - from > SHORTEST * horizon {
            let instants = [&[from], &instants[1..layout.end], &[to]].concat();
            let instants: Vec<f64> = kept.points.iter().map(|&m| instants[m]).collect();
            let x: Vec<&[f64]> = kept.points.iter().map(|&m| x(m)).collect();
            let alphas: Vec<Vec<f64>> = (kept.nodes.iter())
                .map(|&m| alphas[m - 1].clone())
                .collect();
            elements.element(&instants, &x, &alphas);
        }
        t = to;
        elements.point(t, x(layout.end), &alphas[layout.nodes - 1]);
    }
    if let Some((before, laws)) = stopped.filter(|(_, laws)| !laws.is_empty()) {
        let (k, j, m) = (layout.steps, layout.elements, layout.end);
        let x = &w[layout.x(k, j, m)..][..n];
        let alphas = at.alphas(k, j, layout.nodes);
        elements.jump(horizon, laws, [&before, x], &alphas);
    }
    elements.finish(&problem.settings, horizon, &problem.open)
}

/// The points of an element that polynomials go through: where several are at one place its ends count before its nodes,
/// and of nodes the first.
struct Kept {
    /// From its start to its end.
    points: Vec<usize>,
    /// The nodes among them that have an α; the last of all nodes, if none does.
    nodes: Vec<usize>,
}

impl Kept {
    fn new(layout: &Layout) -> Self {
        let (points, end) = (&layout.points, layout.end);
        let is_alone = |m: &usize| {
            let m = *m;
            m == end || points[m] != points[m - 1] && points[m] != points[end]
        };
        let inside: Vec<usize> = (1..=layout.nodes).filter(is_alone).collect();
        let ends = [end].into_iter().filter(|end| !inside.contains(end));
        Kept {
            points: [0]
                .into_iter()
                .chain(inside.iter().copied())
                .chain(ends)
                .collect(),
            nodes: match inside.is_empty() {
                true => vec![layout.nodes],
                false => inside,
            },
        }
    }
}

/// The state where an element begins; of algebraic states that jump there, what the program has for them, or else the
/// polynomial through the nodes.
fn left(problem: &Problem, follows: &[bool], w: &[f64], (k, j): (usize, usize)) -> Vec<f64> {
    let layout = &problem.layout;
    let mut x = w[layout.x(k, j, 0)..][..layout.n_states()].to_vec();
    let at_left = lagrange(&layout.points[1..=layout.nodes], &[0.0]);
    for (i, x) in x
        .iter_mut()
        .enumerate()
        .filter(|(i, _)| follows.get(*i) == Some(&true))
    {
        if let Some(index) = layout.started(k, i).filter(|_| j == 1) {
            *x = w[index];
            continue;
        }
        let nodes = (1..=layout.nodes).map(|m| w[layout.x(k, j, m) + i]);
        *x = nodes.zip(&at_left).map(|(x, share)| share * x).sum();
    }
    x
}
