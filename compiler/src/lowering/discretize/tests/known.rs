//! Solutions in closed form: every row vanishes there, and every pair is complementary.
//!
//! x is a polynomial on each piece and one switch decides, so θ, λ, μ and α are known too: with ψ and α of the piece
//! θ = (1 - α, α), λ = (|ψ| + ψ, |ψ| - ψ), μ = -|ψ|, and λᵖ = max(ψ, 0), λⁿ = max(-ψ, 0).

use super::*;
use crate::expr::Exprs;
use crate::lowering::dcs::fixtures::{Builder, Fixture};
use crate::lowering::mpcc::{Evaluator, Kind};

/// A solution between two switches.
struct Piece {
    end: f64,
    x: fn(f64) -> f64,
    rate: fn(f64) -> f64,
    psi: fn(f64) -> f64,
    alpha: fn(f64) -> f64,
}

struct Known {
    make: for<'e> fn(&'e Exprs) -> Fixture<'e>,
    pieces: Vec<Piece>,
    grid: Grid,
    /// Lengths of elements, with all switches at ends, as equal as they may be.
    lengths: Vec<Vec<f64>>,
    /// The degree of x on each piece.
    degree: usize,
}

fn one_state<'e>(
    exprs: &'e Exprs,
    initial: f64,
    psi: impl Fn(&Builder<'e>) -> Expr<'e>,
    rate: impl Fn(&Builder<'e>, Expr<'e>) -> Expr<'e>,
) -> Fixture<'e> {
    let mut b = Builder::new(exprs, &["x"]);
    let psi = psi(&b);
    let alpha = b.switch("psi", psi);
    let rates = [rate(&b, alpha)];
    let mut fixture = b.finish(&rates, &[(&[0], None)]);
    fixture.system.states[0].initial = initial;
    fixture
}

/// x' = 1 - 2 step(x): reaches 0 and stays.
fn entry() -> Known {
    Known {
        make: |e| one_state(e, -0.3, |b| b.states[0], |_, alpha| 1.0 - 2.0 * alpha),
        pieces: vec![
            Piece {
                end: 0.3,
                x: |t| t - 0.3,
                rate: |_| 1.0,
                psi: |t| t - 0.3,
                alpha: |_| 0.0,
            },
            Piece {
                end: 2.0,
                x: |_| 0.0,
                rate: |_| 0.0,
                psi: |_| 0.0,
                alpha: |_| 0.5,
            },
        ],
        grid: Grid::new(2.0, 2),
        lengths: vec![vec![0.3, 0.35, 0.35], vec![1.0 / 3.0; 3]],
        degree: 1,
    }
}

/// x' = 2 + step(x - t): a surface that moves is crossed.
fn crossing() -> Known {
    Known {
        make: |e| one_state(e, -0.6, |b| b.states[0] - b.time, |_, alpha| 2.0 + alpha),
        pieces: vec![
            Piece {
                end: 0.6,
                x: |t| 2.0 * t - 0.6,
                rate: |_| 2.0,
                psi: |t| t - 0.6,
                alpha: |_| 0.0,
            },
            Piece {
                end: 2.0,
                x: |t| 0.6 + 3.0 * (t - 0.6),
                rate: |_| 3.0,
                psi: |t| 2.0 * (t - 0.6),
                alpha: |_| 1.0,
            },
        ],
        grid: Grid::new(2.0, 1),
        lengths: vec![vec![0.6, 0.7, 0.7]],
        degree: 1,
    }
}

/// x' = 1 where x < 0, t - 1 where x > 0: reaches 0, stays while t < 1, and leaves as (t - 1)²/2.
fn entry_and_exit() -> Known {
    Known {
        make: |e| {
            one_state(
                e,
                -0.25,
                |b| b.states[0],
                |b, alpha| 1.0 - alpha + (b.time - 1.0) * alpha,
            )
        },
        pieces: vec![
            Piece {
                end: 0.25,
                x: |t| t - 0.25,
                rate: |_| 1.0,
                psi: |t| t - 0.25,
                alpha: |_| 0.0,
            },
            Piece {
                end: 1.0,
                x: |_| 0.0,
                rate: |_| 0.0,
                psi: |_| 0.0,
                alpha: |t| 1.0 / (2.0 - t),
            },
            Piece {
                end: 2.0,
                x: |t| 0.5 * (t - 1.0).powi(2),
                rate: |t| t - 1.0,
                psi: |t| 0.5 * (t - 1.0).powi(2),
                alpha: |_| 1.0,
            },
        ],
        grid: Grid::new(2.0, 1),
        lengths: vec![vec![0.25, 0.375, 0.375, 0.5, 0.5]],
        degree: 2,
    }
}

fn detection(options: &mut Options) -> &mut Detection {
    match &mut options.elements {
        Elements::Detected(detection) => detection,
        Elements::Plain(_) => unreachable!("switches are detected"),
    }
}

impl Known {
    fn options(&self, scheme: (Family, usize)) -> Options {
        let detection = Detection {
            elements: self.lengths[0].len(),
            ..Detection::default()
        };
        options(scheme, detection)
    }

    /// w of the solution, with elements of these lengths.
    fn point(&self, mpcc: &Mpcc, layout: &Layout, nodes: &[f64], lengths: &[Vec<f64>]) -> Vec<f64> {
        let names = mpcc.names();
        let mut w: Vec<f64> = mpcc.bounds().iter().map(|bounds| bounds.guess).collect();
        for (k, lengths) in (1..).zip(lengths) {
            let mut start = self.grid.horizon / self.grid.steps as f64 * (k as f64 - 1.0);
            for (j, &h) in (1..).zip(lengths) {
                w[layout.h(k, j)] = h;
                if let Some(t) = layout.t(k, j) {
                    w[t] = start;
                }
                // At a switch that is an end of the element, the piece is that of the element.
                let at = |t: f64| {
                    let inside = t + 1e-9 * (start + 0.5 * h - t);
                    let piece = self.pieces.iter().find(|piece| inside < piece.end);
                    piece.unwrap()
                };
                for m in 0..=layout.end {
                    let c = match m {
                        0 => 0.0,
                        m if m <= nodes.len() => nodes[m - 1],
                        _ => 1.0,
                    };
                    let t = start + c * h;
                    w[layout.x(k, j, m)] = (at(t).x)(t);
                    if let Some(v) = layout.v(k, j, m.clamp(1, layout.nodes)) {
                        let t = start + nodes[m.clamp(1, layout.nodes) - 1] * h;
                        w[v] = (at(t).rate)(t);
                    }
                    for z in 0..layout.n_algebraics() {
                        if let Some(z) = layout.z(k, j, m, z) {
                            w[z] = at(t).algebraic(&names[z], t);
                        }
                    }
                }
                start += h;
            }
        }
        w
    }

    /// The largest |c| and |min(a, b)|, and how far variables are out of bounds.
    fn residuals(&self, mpcc: &Mpcc, w: &[f64]) -> [f64; 3] {
        let mut values = vec![0.0; mpcc.n_rows()];
        Evaluator::new(mpcc).unwrap().values(w, &mut values);
        let mut found = [0.0f64; 3];
        for (block, rows) in mpcc.rows() {
            let values = &values[rows];
            let (a, b) = values.split_at(values.len() / 2);
            match block.kind {
                Kind::Pair => {
                    let smaller = a.iter().zip(b).map(|(a, b)| a.min(*b).abs());
                    found[1] = smaller.fold(found[1], larger);
                }
                _ => {
                    found[0] = values.iter().map(|c| c.abs()).fold(found[0], larger);
                }
            }
        }
        for (w, bounds) in w.iter().zip(mpcc.bounds()) {
            found[2] = larger(found[2], (bounds.lower - w).max(w - bounds.upper));
        }
        found
    }
}

impl Piece {
    fn algebraic(&self, name: &str, t: f64) -> f64 {
        let (psi, alpha) = ((self.psi)(t), (self.alpha)(t));
        let family = name.split('[').next().unwrap();
        match (family, name.contains("-]")) {
            ("theta", true) => 1.0 - alpha,
            ("theta", false) | ("alpha", _) => alpha,
            ("lambda", true) => psi.abs() + psi,
            ("lambda", false) => psi.abs() - psi,
            ("lambda_p", _) => psi.max(0.0),
            ("lambda_n", _) => (-psi).max(0.0),
            ("mu", _) => -psi.abs(),
            _ => panic!("{name} has no closed form"),
        }
    }
}

/// The larger number; unlike `f64::max`, it keeps what is no number.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

fn all() -> [Known; 3] {
    [entry(), crossing(), entry_and_exit()]
}

/// Calls `check` with every known solution in both formulations and both forms, for methods that are exact on it.
fn for_each(mut check: impl FnMut(&Known, &System, Formulation, Options)) {
    let collocation = [1, 2, 3, 5].map(|n| (Family::RadauIia, n)).into_iter();
    let collocation = collocation.chain([1, 2, 4].map(|n| (Family::GaussLegendre, n)));
    let others = [
        (Family::RadauIa, 2),
        (Family::LobattoIiia, 3),
        (Family::LobattoIiic, 3),
        (Family::Explicit, 3),
    ];
    for known in all() {
        let exprs = Exprs::new();
        let system = (known.make)(&exprs).system;
        for scheme in collocation.clone().chain(others) {
            let forms = match Form::Integral.is_of(scheme.0) {
                true => vec![Form::Integral, Form::Differential],
                false => vec![Form::Differential],
            };
            let is_collocation = forms.len() == 2;
            if known.degree > 1 && (!is_collocation || scheme.1 < known.degree) {
                continue;
            }
            for (form, formulation) in forms.iter().flat_map(|&f| FORMULATIONS.map(|g| (f, g))) {
                let mut options = known.options(scheme);
                options.form = Some(form);
                check(&known, &system, formulation, options);
            }
        }
    }
}

#[test]
fn rows_vanish_and_pairs_are_complementary() {
    let weight = 1.0;
    let equilibrations = [
        Equilibration::None,
        Equilibration::Tanh { weight, scale: 0.1 },
        Equilibration::Exact,
    ];
    let all = CROSS.into_iter();
    let all = all.flat_map(|c| equilibrations.map(|e| (c, e)));
    let mut turn = 0;
    for_each(|known, system, formulation, mut options| {
        // Every fifth combination, from another one on each time.
        turn += 1;
        for (cross, equilibration) in all.clone().skip(turn % 5).step_by(5) {
            let detection = detection(&mut options);
            (detection.cross, detection.equilibration) = (cross, equilibration);
            let (mpcc, layout) = discretized(system, formulation, known.grid, &options);
            let nodes = Tableau::new(options.scheme.0, options.scheme.1)
                .unwrap()
                .nodes;
            let w = known.point(&mpcc, &layout, &nodes, &known.lengths);
            let residuals = known.residuals(&mpcc, &w);
            assert!(
                residuals.iter().all(|&residual| residual < 1e-13),
                "{formulation}, {options:?}: {residuals:?}"
            );
        }
    });
}

/// With the end of the first element off the switch, the values of the true solution are none of the rows.
#[test]
fn switches_inside_elements_are_no_solution() {
    for_each(|known, system, formulation, mut options| {
        if options.scheme.1 == 1 {
            // One node sees one side only.
            return;
        }
        for (cross, shift) in CROSS.into_iter().flat_map(|c| [(c, 0.05), (c, -0.05)]) {
            detection(&mut options).cross = cross;
            let (mpcc, layout) = discretized(system, formulation, known.grid, &options);
            let nodes = Tableau::new(options.scheme.0, options.scheme.1)
                .unwrap()
                .nodes;
            let mut lengths = known.lengths.clone();
            lengths[0][0] += shift;
            lengths[0][1] -= shift;
            let w = known.point(&mpcc, &layout, &nodes, &lengths);
            let [rows, pairs, _] = known.residuals(&mpcc, &w);
            assert!(
                rows.max(pairs) > 1e-3,
                "{formulation}, {options:?}: {rows:e}, {pairs:e}"
            );
        }
    });
}

/// Without elements to choose, a switch inside a step violates the rows of the method.
#[test]
fn time_stepping_misses_switches() {
    for_each(|known, system, formulation, mut options| {
        if options.scheme.1 == 1 {
            return;
        }
        options.elements = Elements::Plain(1);
        let (mpcc, layout) = discretized(system, formulation, known.grid, &options);
        let nodes = Tableau::new(options.scheme.0, options.scheme.1)
            .unwrap()
            .nodes;
        let step = known.grid.horizon / known.grid.steps as f64;
        let lengths = vec![vec![step]; known.grid.steps];
        let w = known.point(&mpcc, &layout, &nodes, &lengths);
        let [rows, ..] = known.residuals(&mpcc, &w);
        assert!(rows > 1e-2, "{formulation}, {options:?}: {rows:e}");
    });
}

/// Lengths between two switches are free without equilibration, and equal with it.
#[test]
fn equilibration_sees_unequal_lengths() {
    for known in all() {
        let exprs = Exprs::new();
        let system = (known.make)(&exprs).system;
        for formulation in FORMULATIONS {
            let residual = |equilibration| {
                let mut options = known.options((Family::RadauIia, 2));
                detection(&mut options).equilibration = equilibration;
                let (mpcc, layout) = discretized(&system, formulation, known.grid, &options);
                let nodes = Tableau::new(Family::RadauIia, 2).unwrap().nodes;
                let mut lengths = known.lengths.clone();
                let last = lengths[0].len() - 1;
                lengths[0][last] -= 0.1;
                lengths[0][last - 1] += 0.1;
                let w = known.point(&mpcc, &layout, &nodes, &lengths);
                let [rows, pairs, _] = known.residuals(&mpcc, &w);
                rows.max(pairs)
            };
            assert!(residual(Equilibration::None) < 1e-13);
            assert!(residual(Equilibration::Exact) > 1e-4);
            let cost = Equilibration::Tanh {
                weight: 1.0,
                scale: 0.1,
            };
            assert!(residual(cost) > 1e-4);
        }
    }
}
