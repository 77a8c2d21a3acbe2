//! Tangents along an element: what its equations say as its start, its length and parameters move.
//!
//! V_m = f(t_m, X_m, w_m, p),   0 = r(t_m, X_m, w_m, p),   t_m = t₀ + c_m h,   X_m = x₀ + h Σ_j a_mj V_j
//!
//! are as many equations as V and w, so that these follow from dt₀, dx₀, dh and dp by the Jacobian of Newton's method.
//! Within the element x(t) = x₀ + h ∫ V dσ up to σ = (t - t₀)/h, with σ' = -(dt₀ + σ dh)/h at an instant that stays.

use super::active::{Active, Parameters};
use crate::fesd::element::scheme::Scheme;
use crate::fesd::element::solved::Solved;
use crate::fesd::element::stages::by_node;
use crate::linalg::Singular;

/// How an end of an element moves with a direction: x at its instant, and that.
#[derive(Clone, Debug)]
pub(super) struct End {
    pub x: Vec<f64>,
    pub time: f64,
}

/// How an element starts to move with a direction, and how its length does; none where that is not known.
pub(super) type Start = Option<(End, f64)>;

/// How an element moves with a direction.
pub(super) struct Motion {
    start: End,
    /// dh.
    length: f64,
    /// dV and dw.
    unknowns: Vec<f64>,
    pub end: End,
    /// How large the terms are that the motion of the state is made of, which may cancel.
    pub terms: Vec<f64>,
}

/// What is asked of an element in a direction: right-hand sides, and how large the terms of those of V are.
struct Side {
    values: Vec<f64>,
    sizes: Vec<f64>,
}

/// Σ b_j V_j of unknowns.
fn mean(scheme: &Scheme, unknowns: &[f64], (n, per_node): (usize, usize)) -> Vec<f64> {
    let mut mean = vec![0.0; n];
    for (b, node) in scheme
        .tableau
        .weights
        .iter()
        .zip(by_node(unknowns, per_node))
    {
        mean.iter_mut().zip(node).for_each(|(sum, v)| *sum += b * v);
    }
    mean
}

/// Motions of an element from those of its start, by direction; its length is one of them.
pub(super) fn motions(
    active: &mut Active,
    scheme: &Scheme,
    solved: &Solved,
    starts: &[Start],
    parameters: &Parameters,
) -> Result<Vec<Option<Motion>>, Singular> {
    let (s, n, per_node) = (scheme.s, active.stages.n, active.stages.per_node);
    let stages = &mut active.stages;
    (stages.t, stages.h) = (solved.t, solved.h);
    stages.x0.copy_from_slice(&solved.x);
    stages.unknowns.copy_from_slice(&solved.unknowns);
    let (jacobian, reduced) = (&mut active.jacobian, &active.reduced);
    jacobian.differentiate(scheme, reduced, stages);
    let factored = jacobian.factor(scheme, reduced, stages, solved.h);
    factored.map_err(|_| Singular { column: 0 })?;
    let side = |start: &Start| {
        start.as_ref().map(|_| Side {
            values: vec![0.0; s * per_node],
            sizes: vec![0.0; n],
        })
    };
    let mut sides: Vec<Option<Side>> = starts.iter().map(side).collect();
    for (m, c) in scheme.tableau.nodes.iter().enumerate() {
        let along: Vec<f64> = (0..n)
            .map(|i| {
                let nodes = by_node(&solved.unknowns, per_node);
                let terms = scheme.tableau.a[m * s..].iter().zip(nodes);
                terms.map(|(a, node)| a * node[i]).sum()
            })
            .collect();
        let rows = active.at_node(scheme, m, parameters);
        let known = starts.iter().zip(&mut sides).enumerate();
        let known =
            known.filter_map(|(d, (start, side))| Some((d, start.as_ref()?, side.as_mut()?)));
        for (d, (start, length), side) in known {
            let time = start.time + c * length;
            for (place, row) in rows.iter().enumerate() {
                let x = start.x.iter().zip(&along).map(|(x, v)| x + length * v);
                let by_x = row[1..=n].iter().zip(x).map(|(slope, x)| slope * x);
                let terms = by_x.chain([row[0] * time, row[1 + per_node + d]]);
                let [sum, size] = terms.fold([0.0, 0.0], |[a, b], x: f64| [a + x, b + x.abs()]);
                side.values[m * per_node + place] = if place < n { sum } else { -sum };
                if let Some(sizes) = side.sizes.get_mut(place) {
                    *sizes += (solved.h * scheme.tableau.weights[m]).abs() * size;
                }
            }
        }
    }
    for side in sides.iter_mut().flatten() {
        let solved = active.jacobian.solve(&mut side.values);
        solved.map_err(|_| Singular { column: 0 })?;
    }
    ends(active, scheme, solved, (starts, sides), parameters)
}

/// Motions of the end from those of V and w.
fn ends(
    active: &mut Active,
    scheme: &Scheme,
    solved: &Solved,
    (starts, sides): (&[Start], Vec<Option<Side>>),
    parameters: &Parameters,
) -> Result<Vec<Option<Motion>>, Singular> {
    let shape = (active.stages.n, active.stages.per_node);
    let h = solved.h;
    let plain = mean(scheme, &solved.unknowns, shape);
    let moved = |mean: &[f64]| -> Vec<f64> {
        let both = solved.x.iter().zip(mean);
        both.map(|(x, mean)| x + h * mean).collect()
    };
    let w = active.stages.w(scheme.s - 1).to_vec();
    let places = (moved(&plain), moved(&solved.mean));
    let projected = active.projected(solved.t + h, (&places.0, &places.1), &w, parameters)?;
    let motion = |(d, (start, side)): (usize, (&Start, Option<Side>))| {
        let (start, length) = start.clone()?;
        let Side {
            values: unknowns,
            sizes: mut terms,
        } = side?;
        let slopes = mean(scheme, &unknowns, shape);
        let by = slopes.iter().zip(&plain);
        let by: Vec<f64> = by.map(|(slope, mean)| h * slope + length * mean).collect();
        for (i, term) in terms.iter_mut().enumerate() {
            *term += start.x[i].abs() + (h * slopes[i]).abs() + (length * plain[i]).abs();
        }
        let mut end = End {
            x: start.x.iter().zip(&by).map(|(x, by)| x + by).collect(),
            time: start.time + length,
        };
        if let Some(projected) = &projected {
            let dw = &unknowns[(scheme.s - 1) * shape.1 + shape.0..];
            end.x = projected.tangent(end.time, (&end.x, dw), d);
        }
        Some(Motion {
            start,
            length,
            unknowns,
            end,
            terms,
        })
    };
    Ok(starts.iter().zip(sides).enumerate().map(motion).collect())
}

/// Weights of V at the nodes in the integral of its polynomial up to σ, and in its value.
fn weights(scheme: &Scheme, sigma: f64) -> Vec<[f64; 2]> {
    let of_node = |powers: &[f64]| {
        let (mut integral, mut value, mut power) = (0.0, 0.0, 1.0);
        for (k, c) in powers.iter().enumerate() {
            value += (k + 1) as f64 * c * power;
            power *= sigma;
            integral += c * power;
        }
        [integral, value]
    };
    scheme
        .integrals
        .chunks_exact(scheme.s)
        .map(of_node)
        .collect()
}

/// The tangent at an instant that stays, at a share of an element.
pub(super) fn within(scheme: &Scheme, solved: &Solved, motion: &Motion, sigma: f64) -> Vec<f64> {
    let n = solved.x.len();
    let (h, per_node) = (solved.h, solved.unknowns.len() / scheme.s);
    let (start, length) = (&motion.start, motion.length);
    let shift = -(start.time + sigma * length);
    let mut tangent = start.x.clone();
    let [own, moved] = [&solved.unknowns, &motion.unknowns].map(|all| by_node(all, per_node));
    for (([integral, value], own), moved) in weights(scheme, sigma).into_iter().zip(own).zip(moved)
    {
        for i in 0..n {
            tangent[i] += integral * (h * moved[i] + length * own[i]) + value * own[i] * shift;
        }
    }
    // What moves the end onto its surfaces does so evenly.
    let plain = mean(scheme, &solved.unknowns, (n, per_node));
    let slopes = mean(scheme, &motion.unknowns, (n, per_node));
    for i in 0..n {
        let moved = h * slopes[i] + length * plain[i];
        let by = motion.end.x[i] - start.x[i] - moved;
        tangent[i] += sigma * by + shift * (solved.mean[i] - plain[i]);
    }
    tangent
}

/// x at a share of an element.
pub(super) fn state(scheme: &Scheme, solved: &Solved, sigma: f64) -> Vec<f64> {
    let (n, per_node) = (solved.x.len(), solved.unknowns.len() / scheme.s);
    let plain = mean(scheme, &solved.unknowns, (n, per_node));
    let shift = solved
        .mean
        .iter()
        .zip(&plain)
        .map(|(mean, plain)| mean - plain);
    let start = solved.x.iter().zip(shift);
    let mut x: Vec<f64> = start
        .map(|(x, shift)| x + sigma * solved.h * shift)
        .collect();
    let nodes = by_node(&solved.unknowns, per_node);
    for ([integral, _], node) in weights(scheme, sigma).into_iter().zip(nodes) {
        x.iter_mut()
            .zip(node)
            .for_each(|(x, v)| *x += solved.h * integral * v);
    }
    x
}
