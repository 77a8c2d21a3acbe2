//! Points whose class is known.

use crate::optimization::mpcc::certificate::{Certificate, Residuals, Tolerances, certify};
use crate::optimization::mpcc::{Class, Lifted};
use crate::optimization::problem::Side;
use crate::optimization::quadratic::{Function, Quadratic};

const INFINITY: f64 = f64::INFINITY;

fn linear(coefficients: &[f64]) -> Function {
    let terms = (0..).zip(coefficients);
    terms.fold(Function::default(), |f, (j, &c)| f.linear(j, c))
}

/// Σ (w_j - target_j)².
fn distance(target: &[f64]) -> Function {
    let terms = (0..).zip(target);
    terms.fold(Function::default(), |f, (j, &t)| {
        f.product(j, j, 1.0).linear(j, -2.0 * t).constant(t * t)
    })
}

/// Pairs of the variables 0 ⟂ 1, 2 ⟂ 3, ..
fn pairs(mut problem: Quadratic, n: usize) -> Quadratic {
    for pair in 0..n {
        let (a, b) = (2 * pair, 2 * pair + 1);
        problem = problem
            .bound(a, 0.0, INFINITY)
            .bound(b, 0.0, INFINITY)
            .complement(Side::Variable(a as u32), Side::Variable(b as u32));
    }
    problem
}

/// minimize x + y - z, z <= 4x, z <= 4y, 0 <= x ⟂ y >= 0: scholtes4 of MacMPEC. Each row may come several times.
fn no_s(copies: usize) -> Quadratic {
    let mut rows = Vec::new();
    for _ in 0..copies {
        rows.push((linear(&[4.0, 0.0, -1.0]), 0.0, INFINITY));
        rows.push((linear(&[0.0, 4.0, -1.0]), 0.0, INFINITY));
    }
    pairs(Quadratic::new(3, linear(&[1.0, 1.0, -1.0]), rows), 1)
}

/// The certificate at a point, from multipliers y = 0.
fn at(mut problem: Quadratic, w: &[f64]) -> Certificate {
    let mut lifted = Lifted::new(&mut problem);
    let w = lifted.extend(w);
    let y = vec![0.0; crate::optimization::problem::Nlp::n_rows(&lifted)];
    certify(&mut lifted, &w, &y, &Tolerances::default())
}

fn check(problem: Quadratic, w: &[f64], class: Class, is_b_stationary: bool) {
    let certificate = at(problem, w);
    assert_eq!(certificate.class, class, "{certificate:?}");
    assert!(certificate.is_exact);
    let b_stationary = Some(is_b_stationary);
    assert_eq!(certificate.b_stationary, b_stationary, "{certificate:?}");
}

#[test]
fn the_origin_by_the_signs_of_its_multipliers() {
    // minimize |w - t|²: the multipliers at the origin are -2t.
    let of = |target: [f64; 2]| pairs(Quadratic::new(2, distance(&target), Vec::new()), 1);
    check(of([-1.0, -1.0]), &[0.0, 0.0], Class::S, true);
    check(of([-1.0, 0.0]), &[0.0, 0.0], Class::S, true);
    check(of([0.0, 1.0]), &[0.0, 0.0], Class::M, false);
    check(of([1.0, 1.0]), &[0.0, 0.0], Class::C, false);
    check(of([-1.0, 1.0]), &[0.0, 0.0], Class::A, false);
}

#[test]
fn weak_stationarity_needs_two_pairs() {
    // One pair has both multipliers negative, which is not A, the other has two signs, which is not C.
    let objective = distance(&[1.0, 1.0, -1.0, 1.0]);
    let problem = pairs(Quadratic::new(4, objective, Vec::new()), 2);
    check(problem, &[0.0; 4], Class::W, false);
}

#[test]
fn points_that_are_not_stationary() {
    let problem = || pairs(Quadratic::new(2, distance(&[1.0, 2.0]), Vec::new()), 1);
    check(problem(), &[0.0, 2.0], Class::S, true);
    check(problem(), &[1.0, 0.0], Class::S, true);
    // Off the optimum of the branch by a thousandth, and by more.
    check(problem(), &[0.0, 2.001], Class::None, false);
    check(problem(), &[0.5, 0.0], Class::None, false);
    // Off by less than the tolerance of the multipliers.
    check(problem(), &[0.0, 2.0 + 1e-8], Class::S, true);
}

#[test]
fn an_upper_bound_pushes_down_alone() {
    // w₂ <= 1 at (0, 2, 1): the minimum where the objective asks for w₂ = 2, and none where it asks for 0.
    let problem = |target: f64| {
        let objective = distance(&[-1.0, 2.0, target]);
        pairs(Quadratic::new(3, objective, Vec::new()), 1).bound(2, -INFINITY, 1.0)
    };
    check(problem(2.0), &[0.0, 2.0, 1.0], Class::S, true);
    check(problem(0.0), &[0.0, 2.0, 1.0], Class::None, false);
}

#[test]
fn residuals_are_those_of_the_point() {
    // 0 <= x ⟂ y >= 0 and x + 2y <= 1 at (0.5, 2).
    let rows = vec![(linear(&[1.0, 2.0]), -INFINITY, 1.0)];
    let mut problem = pairs(Quadratic::new(2, linear(&[1.0, 1.0]), rows), 1);
    let mut lifted = Lifted::new(&mut problem);
    let expected = Residuals {
        violation: 3.5,
        complementarity: 0.5,
        product: 1.0,
    };
    assert_eq!(Residuals::new(&mut lifted, &[0.5, 2.0]), expected);
}

#[test]
fn an_optimum_that_is_m_and_not_s() {
    // r = (1 + 4y₁, 1 + 4y₂) with y₁ + y₂ = -1: the sum is -2, so that both are never positive; (0, -2) is M. Both
    // branches have z <= 0, so the origin is the minimum.
    check(no_s(1), &[0.0; 3], Class::M, true);
}

#[test]
fn multipliers_that_are_not_unique() {
    // Rows that are repeated leave a polyhedron of multipliers, in which some show M and some only C, A or W.
    check(no_s(3), &[0.0; 3], Class::M, true);
    let certificate = at(no_s(3), &[0.0; 3]);
    let nu = &certificate.reduced[..2];
    assert!(nu[0].abs().min(nu[1].abs()) < 1e-6, "{nu:?}");
    assert!((nu[0] + nu[1] + 2.0).abs() < 1e-6, "{nu:?}");
}

#[test]
fn ralph1_is_m_stationary() {
    // minimize 2x - y, x >= 0, 0 <= y ⟂ y - x >= 0 (MacMPEC). With η for y - x = s: r_y = η - 1, r_s = -η, and
    // r_x = 2 - η >= 0: not S for any η, M with η = 0 or 1. On the branch y = x it is x, on y = 0 it is 2x.
    let rows = vec![(linear(&[-1.0, 1.0]), 0.0, INFINITY)];
    let problem = Quadratic::new(2, linear(&[2.0, -1.0]), rows)
        .bound(0, 0.0, INFINITY)
        .bound(1, 0.0, INFINITY)
        .complement(Side::Variable(1), Side::Row(0));
    check(problem, &[0.0, 0.0], Class::M, true);
}

#[test]
fn a_constraint_without_qualification() {
    // minimize (x - 1)² + (y + 1)², y² <= 0, 0 <= x ⟂ y >= 0: the gradient of the row vanishes at (1, 0).
    let rows = vec![(Function::default().product(1, 1, 1.0), -INFINITY, 0.0)];
    let problem = pairs(Quadratic::new(2, distance(&[1.0, -1.0]), rows), 1);
    check(problem, &[1.0, 0.0], Class::S, true);
}

#[test]
fn a_side_that_another_pair_keeps_at_zero_is_not_biactive() {
    // 0 ⟂ 1 and 0 ⟂ 2 at w = (0, 1, 0): w₀ has a multiplier of any sign, and w₂ one that is not negative.
    let problem = |target: [f64; 3]| {
        let mut problem = Quadratic::new(3, distance(&target), Vec::new());
        for j in 0..3 {
            problem = problem.bound(j, 0.0, INFINITY);
        }
        problem
            .complement(Side::Variable(0), Side::Variable(1))
            .complement(Side::Variable(0), Side::Variable(2))
    };
    check(problem([5.0, 1.0, -1.0]), &[0.0, 1.0, 0.0], Class::S, true);
    check(
        problem([5.0, 1.0, 1.0]),
        &[0.0, 1.0, 0.0],
        Class::None,
        false,
    );
}

#[test]
fn descent_keeps_the_pairs() {
    let problem = pairs(Quadratic::new(2, distance(&[1.0, 2.0]), Vec::new()), 1);
    let certificate = at(problem, &[0.0, 0.0]);
    assert_eq!(certificate.class, Class::C);
    let step = certificate.descent.expect("both branches descend");
    assert_eq!(step[0].min(step[1]), 0.0);
    assert!(step[0].max(step[1]) > 0.5e-4);
}

#[test]
fn many_pairs_in_few_nodes() {
    // Descent along every pair of thirty: the first rounding finds it.
    let problem = pairs(Quadratic::new(60, distance(&[1.0; 60]), Vec::new()), 30);
    check(problem, &[0.0; 60], Class::C, false);
}
