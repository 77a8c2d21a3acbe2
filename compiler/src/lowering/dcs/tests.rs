//! Printed forms of small systems, and both lowerings against the original.

use insta::assert_snapshot;
use proptest::prelude::*;

use super::fixtures::{self, Fixture};
use super::pointwise::{Sides, solve_pointwise, solve_with};
use super::{DcsError, Formulation, choose, dot, lower, lower_as, tex};
use crate::expr::Exprs;
use crate::system::experiment::Lowering;

fn lowered(make: fn(&Exprs) -> Fixture<'_>, formulation: Formulation) -> String {
    let exprs = Exprs::new();
    let dcs = lower_as(&make(&exprs).system, formulation).expect("the system is small");
    dcs.verify().expect("a lowering keeps the invariants");
    dcs.to_string()
}

#[test]
fn relay() {
    assert_snapshot!(lowered(fixtures::relay, Formulation::Stewart), @"
    der(x) = 3*theta[x-] + theta[x+]
    0 = x - lambda[x-] - mu
    0 = -x - lambda[x+] - mu
    0 = 1 - theta[x-] - theta[x+]
    0 <= theta[x-] perp lambda[x-] >= 0
    0 <= theta[x+] perp lambda[x+] >= 0
    ");
    assert_snapshot!(lowered(fixtures::relay, Formulation::Step), @"
    der(x) = 3 - 2*alpha[x]
    0 = x - lambda_p[x] + lambda_n[x]
    0 <= lambda_n[x] perp alpha[x] >= 0
    0 <= lambda_p[x] perp 1 - alpha[x] >= 0
    ");
}

#[test]
fn two_relays() {
    assert_snapshot!(lowered(fixtures::two_relays, Formulation::Stewart), @"
    der(x[1]) = theta[x[1]-] - theta[x[1]+] - 2*theta[x[2]-] + 2*theta[x[2]+]
    der(x[2]) = 2*theta[x[1]-] - 2*theta[x[1]+] + theta[x[2]-] - theta[x[2]+]
    0 = x[1] - lambda[x[1]-] - mu[1]
    0 = -x[1] - lambda[x[1]+] - mu[1]
    0 = 1 - theta[x[1]-] - theta[x[1]+]
    0 = x[2] - lambda[x[2]-] - mu[2]
    0 = -x[2] - lambda[x[2]+] - mu[2]
    0 = 1 - theta[x[2]-] - theta[x[2]+]
    0 <= theta[x[1]-] perp lambda[x[1]-] >= 0
    0 <= theta[x[1]+] perp lambda[x[1]+] >= 0
    0 <= theta[x[2]-] perp lambda[x[2]-] >= 0
    0 <= theta[x[2]+] perp lambda[x[2]+] >= 0
    ");
    assert_snapshot!(lowered(fixtures::two_relays, Formulation::Step), @"
    der(x[1]) = -2*alpha[x[1]] + 4*alpha[x[2]] - 1
    der(x[2]) = 3 - 4*alpha[x[1]] - 2*alpha[x[2]]
    0 = x[1] - lambda_p[x[1]] + lambda_n[x[1]]
    0 = x[2] - lambda_p[x[2]] + lambda_n[x[2]]
    0 <= lambda_n[x[1]] perp alpha[x[1]] >= 0
    0 <= lambda_p[x[1]] perp 1 - alpha[x[1]] >= 0
    0 <= lambda_n[x[2]] perp alpha[x[2]] >= 0
    0 <= lambda_p[x[2]] perp 1 - alpha[x[2]] >= 0
    ");
}

#[test]
fn product_of_signs() {
    assert_snapshot!(lowered(fixtures::product_of_signs, Formulation::Stewart), @"
    der(x[1]) = 1.5*theta[x[1]-,x[2]-] + 1.5*theta[x[1]-,x[2]+] - 0.5*theta[x[1]+,x[2]-] - 0.5*theta[x[1]+,x[2]+]
    der(x[2]) = theta[x[1]-,x[2]-] - theta[x[1]-,x[2]+] + theta[x[1]+,x[2]-] - theta[x[1]+,x[2]+]
    der(x[3]) = theta[x[1]-,x[2]-] - theta[x[1]-,x[2]+] - theta[x[1]+,x[2]-] + theta[x[1]+,x[2]+]
    0 = x[1] + x[2] - lambda[x[1]-,x[2]-] - mu
    0 = x[1] - x[2] - lambda[x[1]-,x[2]+] - mu
    0 = -x[1] + x[2] - lambda[x[1]+,x[2]-] - mu
    0 = -x[1] - x[2] - lambda[x[1]+,x[2]+] - mu
    0 = 1 - theta[x[1]-,x[2]-] - theta[x[1]-,x[2]+] - theta[x[1]+,x[2]-] - theta[x[1]+,x[2]+]
    0 <= theta[x[1]-,x[2]-] perp lambda[x[1]-,x[2]-] >= 0
    0 <= theta[x[1]-,x[2]+] perp lambda[x[1]-,x[2]+] >= 0
    0 <= theta[x[1]+,x[2]-] perp lambda[x[1]+,x[2]-] >= 0
    0 <= theta[x[1]+,x[2]+] perp lambda[x[1]+,x[2]+] >= 0
    ");
    assert_snapshot!(lowered(fixtures::product_of_signs, Formulation::Step), @"
    der(x[1]) = 1.5 - 2*alpha[x[1]]
    der(x[2]) = 1 - 2*alpha[x[2]]
    der(x[3]) = 1 - 2*alpha[x[1]] - 2*alpha[x[2]] + 4*beta[x[1],x[2]]
    0 = x[1] - lambda_p[x[1]] + lambda_n[x[1]]
    0 = x[2] - lambda_p[x[2]] + lambda_n[x[2]]
    0 = -alpha[x[1]]*alpha[x[2]] + beta[x[1],x[2]]
    0 <= lambda_n[x[1]] perp alpha[x[1]] >= 0
    0 <= lambda_p[x[1]] perp 1 - alpha[x[1]] >= 0
    0 <= lambda_n[x[2]] perp alpha[x[2]] >= 0
    0 <= lambda_p[x[2]] perp 1 - alpha[x[2]] >= 0
    ");
}

#[test]
fn open_sign() {
    assert_snapshot!(lowered(fixtures::open_sign, Formulation::Stewart), @"
    der(x) = -x*theta[below] + y*(theta[right,(y - x^2)-] + theta[right,(y - x^2)+]) + 2*theta[above]
    der(y) = 1
    0 = -x^2 - x + y - lambda[right,(y - x^2)-] - mu
    0 = x^2 - x - y - lambda[right,(y - x^2)+] - mu
    0 = x^2 + x - y - lambda[above] - mu
    0 = -x^2 + x + y - lambda[below] - mu
    0 = 1 - theta[right,(y - x^2)-] - theta[right,(y - x^2)+] - theta[above] - theta[below]
    0 <= theta[right,(y - x^2)-] perp lambda[right,(y - x^2)-] >= 0
    0 <= theta[right,(y - x^2)+] perp lambda[right,(y - x^2)+] >= 0
    0 <= theta[above] perp lambda[above] >= 0
    0 <= theta[below] perp lambda[below] >= 0
    ");
    assert_snapshot!(lowered(fixtures::open_sign, Formulation::Step), @"
    der(x) = -x*(1 - alpha[x] - alpha[y - x^2] + beta[x,(y - x^2)]) + y*alpha[x] + 2*alpha[y - x^2] - 2*beta[x,(y - x^2)]
    der(y) = 1
    0 = x - lambda_p[x] + lambda_n[x]
    0 = -x^2 + y - lambda_p[y - x^2] + lambda_n[y - x^2]
    0 = -alpha[x]*alpha[y - x^2] + beta[x,(y - x^2)]
    0 <= lambda_n[x] perp alpha[x] >= 0
    0 <= lambda_p[x] perp 1 - alpha[x] >= 0
    0 <= lambda_n[y - x^2] perp alpha[y - x^2] >= 0
    0 <= lambda_p[y - x^2] perp 1 - alpha[y - x^2] >= 0
    ");
}

#[test]
fn intervals() {
    assert_snapshot!(lowered(fixtures::intervals, Formulation::Stewart), @"
    der(x) = -x*theta[high] + theta[low] + 3*theta[middle]
    0 = 5 - 3*x - lambda[high] - mu
    0 = 3*x - lambda[low] - mu - 5
    0 = x - lambda[middle] - mu - 3
    0 = 1 - theta[high] - theta[low] - theta[middle]
    0 <= theta[high] perp lambda[high] >= 0
    0 <= theta[low] perp lambda[low] >= 0
    0 <= theta[middle] perp lambda[middle] >= 0
    ");
}

#[test]
fn kinks() {
    assert_snapshot!(lowered(fixtures::kinks, Formulation::Stewart), @"
    der(x) = (x + 1)*theta[x+] + theta[x-]
    der(y) = (x - y)*theta[(x - y)+] - x + 2*y*theta[y+] - y
    0 = x - lambda[x-] - mu[1]
    0 = -x - lambda[x+] - mu[1]
    0 = 1 - theta[x-] - theta[x+]
    0 = y - lambda[y-] - mu[2]
    0 = -y - lambda[y+] - mu[2]
    0 = 1 - theta[y-] - theta[y+]
    0 = x - y - lambda[(x - y)-] - mu[3]
    0 = -x + y - lambda[(x - y)+] - mu[3]
    0 = 1 - theta[(x - y)-] - theta[(x - y)+]
    0 <= theta[x-] perp lambda[x-] >= 0  // continuous
    0 <= theta[x+] perp lambda[x+] >= 0  // continuous
    0 <= theta[y-] perp lambda[y-] >= 0  // continuous
    0 <= theta[y+] perp lambda[y+] >= 0  // continuous
    0 <= theta[(x - y)-] perp lambda[(x - y)-] >= 0  // continuous
    0 <= theta[(x - y)+] perp lambda[(x - y)+] >= 0  // continuous
    ");
    assert_snapshot!(lowered(fixtures::kinks, Formulation::Step), @"
    der(x) = x*alpha[x] + 1
    der(y) = -(-x + y)*alpha[x - y] - x + y*(2*alpha[y] - 1)
    0 = x - lambda_p[x] + lambda_n[x]
    0 = y - lambda_p[y] + lambda_n[y]
    0 = x - y - lambda_p[x - y] + lambda_n[x - y]
    0 <= lambda_n[x] perp alpha[x] >= 0  // continuous
    0 <= lambda_p[x] perp 1 - alpha[x] >= 0  // continuous
    0 <= lambda_n[y] perp alpha[y] >= 0  // continuous
    0 <= lambda_p[y] perp 1 - alpha[y] >= 0  // continuous
    0 <= lambda_n[x - y] perp alpha[x - y] >= 0  // continuous
    0 <= lambda_p[x - y] perp 1 - alpha[x - y] >= 0  // continuous
    ");
}

#[test]
fn product_of_many() {
    assert_snapshot!(lowered(fixtures::many, Formulation::Step), @"
    der(x) = beta[5]
    der(y) = -x*(alpha[s[1]] - beta[s[1],s[2]]) + alpha[abs(x) - y]
    0 = x - lambda_p[x] + lambda_n[x]
    0 = x*(2*alpha[x] - 1) - y - lambda_p[abs(x) - y] + lambda_n[abs(x) - y]
    0 = sin(x) - y - lambda_p[s[1]] + lambda_n[s[1]]
    0 = sin(2*x) - y - lambda_p[s[2]] + lambda_n[s[2]]
    0 = sin(3*x) - y - lambda_p[s[3]] + lambda_n[s[3]]
    0 = sin(4*x) - y - lambda_p[s[4]] + lambda_n[s[4]]
    0 = sin(5*x) - y - lambda_p[s[5]] + lambda_n[s[5]]
    0 = -(2*alpha[abs(x) - y] - 1)*(2*alpha[s[1]] - 1) + beta[1]
    0 = -(2*alpha[s[2]] - 1)*beta[1] + beta[2]
    0 = -(2*alpha[s[3]] - 1)*beta[2] + beta[3]
    0 = -(2*alpha[s[4]] - 1)*beta[3] + beta[4]
    0 = -(2*alpha[s[5]] - 1)*beta[4] + beta[5]
    0 = -alpha[s[1]]*alpha[s[2]] + beta[s[1],s[2]]
    0 <= lambda_n[x] perp alpha[x] >= 0  // continuous
    0 <= lambda_p[x] perp 1 - alpha[x] >= 0  // continuous
    0 <= lambda_n[abs(x) - y] perp alpha[abs(x) - y] >= 0
    0 <= lambda_p[abs(x) - y] perp 1 - alpha[abs(x) - y] >= 0
    0 <= lambda_n[s[1]] perp alpha[s[1]] >= 0
    0 <= lambda_p[s[1]] perp 1 - alpha[s[1]] >= 0
    0 <= lambda_n[s[2]] perp alpha[s[2]] >= 0
    0 <= lambda_p[s[2]] perp 1 - alpha[s[2]] >= 0
    0 <= lambda_n[s[3]] perp alpha[s[3]] >= 0
    0 <= lambda_p[s[3]] perp 1 - alpha[s[3]] >= 0
    0 <= lambda_n[s[4]] perp alpha[s[4]] >= 0
    0 <= lambda_p[s[4]] perp 1 - alpha[s[4]] >= 0
    0 <= lambda_n[s[5]] perp alpha[s[5]] >= 0
    0 <= lambda_p[s[5]] perp 1 - alpha[s[5]] >= 0
    ");
}

#[test]
fn auto_says_why() {
    let reason = |make: fn(&Exprs) -> Fixture<'_>| {
        let exprs = Exprs::new();
        let dcs = lower(&make(&exprs).system, &[]).expect("the system is small");
        dcs.to_string()
            .lines()
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    assert_snapshot!(reason(fixtures::relay), @"// stewart: no two switches multiply each other");
    assert_snapshot!(reason(fixtures::two_relays), @"// stewart: no two switches multiply each other");
    assert_snapshot!(reason(fixtures::product_of_signs), @"// step: `x[1]` and `x[2]` multiply each other");
    assert_snapshot!(reason(fixtures::intervals), @"// stewart: regions are disjoint and named");
    assert_snapshot!(reason(fixtures::open_sign), @"// stewart: regions are disjoint and named");
}

#[test]
fn as_latex() {
    let latex = |make: fn(&Exprs) -> Fixture<'_>, formulation| {
        let exprs = Exprs::new();
        tex(&make(&exprs).system, &[formulation]).expect("the system is small")
    };
    assert_snapshot!(latex(fixtures::open_sign, Lowering::Stewart), @r"
    % stewart: asked for by `lower`
    \begin{align*}
    \dot{x} &= -x \, \theta_{\mathrm{below}} + y \, \left(\theta_{\mathrm{right}, \text{(y - x\textasciicircum{}2)-}} + \theta_{\mathrm{right}, \text{(y - x\textasciicircum{}2)+}}\right) + 2 \, \theta_{\mathrm{above}} \\
    \dot{y} &= 1 \\
    0 &= -x^{2} - x + y - \lambda_{\mathrm{right}, \text{(y - x\textasciicircum{}2)-}} - \mu \\
    0 &= x^{2} - x - y - \lambda_{\mathrm{right}, \text{(y - x\textasciicircum{}2)+}} - \mu \\
    0 &= x^{2} + x - y - \lambda_{\mathrm{above}} - \mu \\
    0 &= -x^{2} + x + y - \lambda_{\mathrm{below}} - \mu \\
    0 &= 1 - \theta_{\mathrm{right}, \text{(y - x\textasciicircum{}2)-}} - \theta_{\mathrm{right}, \text{(y - x\textasciicircum{}2)+}} - \theta_{\mathrm{above}} - \theta_{\mathrm{below}} \\
    0 &\le \theta_{\mathrm{right}, \text{(y - x\textasciicircum{}2)-}} \perp \lambda_{\mathrm{right}, \text{(y - x\textasciicircum{}2)-}} \ge 0 \\
    0 &\le \theta_{\mathrm{right}, \text{(y - x\textasciicircum{}2)+}} \perp \lambda_{\mathrm{right}, \text{(y - x\textasciicircum{}2)+}} \ge 0 \\
    0 &\le \theta_{\mathrm{above}} \perp \lambda_{\mathrm{above}} \ge 0 \\
    0 &\le \theta_{\mathrm{below}} \perp \lambda_{\mathrm{below}} \ge 0
    \end{align*}
    ");
    assert_snapshot!(latex(fixtures::product_of_signs, Lowering::Step), @r"
    % step: asked for by `lower`
    \begin{align*}
    \dot{x}_{1} &= 1.5 - 2 \, \alpha_{x_{1}} \\
    \dot{x}_{2} &= 1 - 2 \, \alpha_{x_{2}} \\
    \dot{x}_{3} &= 1 - 2 \, \alpha_{x_{1}} - 2 \, \alpha_{x_{2}} + 4 \, \beta_{x_{1}, x_{2}} \\
    0 &= x_{1} - \lambda_{p, x_{1}} + \lambda_{n, x_{1}} \\
    0 &= x_{2} - \lambda_{p, x_{2}} + \lambda_{n, x_{2}} \\
    0 &= -\alpha_{x_{1}} \, \alpha_{x_{2}} + \beta_{x_{1}, x_{2}} \\
    0 &\le \lambda_{n, x_{1}} \perp \alpha_{x_{1}} \ge 0 \\
    0 &\le \lambda_{p, x_{1}} \perp 1 - \alpha_{x_{1}} \ge 0 \\
    0 &\le \lambda_{n, x_{2}} \perp \alpha_{x_{2}} \ge 0 \\
    0 &\le \lambda_{p, x_{2}} \perp 1 - \alpha_{x_{2}} \ge 0
    \end{align*}
    ");
}

#[test]
fn as_graph() {
    let exprs = Exprs::new();
    assert_snapshot!(dot(&fixtures::open_sign(&exprs).system), @r#"
    digraph {
        0 [label = "x"]
        1 [label = "y"]
        2 [label = "x", shape = diamond]
        3 [label = "y - x^2", shape = diamond]
        0 -> 0
        1 -> 0
        2 -> 0
        3 -> 0
        0 -> 2
        0 -> 3
        1 -> 3
    }
    "#);
}

#[test]
fn stewart_refuses_too_many_regions() {
    let exprs = Exprs::new();
    let mut b = fixtures::Builder::new(&exprs, &["x"]);
    let alphas: Vec<_> = (0..11)
        .map(|i| b.switch(&format!("s{i}"), (f64::from(i + 1) * b.states[0]).sin()))
        .collect();
    let switches: Vec<usize> = (0..11).collect();
    let rate = exprs.product(alphas);
    let fixture = b.finish(&[rate], &[(&switches, None)]);
    let refused = lower_as(&fixture.system, Formulation::Stewart);
    assert!(matches!(
        refused,
        Err(DcsError::TooManyRegions { count: 11, .. })
    ));
    assert_eq!(choose(&fixture.system).formulation, Formulation::Step);
}

#[test]
fn an_open_sign_is_not_given_to_the_wrong_region() {
    // At ψ = (1, 5) the rows (+, *), (-, +), (-, -) of -Sψ would choose the second region.
    let exprs = Exprs::new();
    let fixture = fixtures::open_sign(&exprs);
    let dcs = lower_as(&fixture.system, Formulation::Stewart).expect("the system is small");
    let point = [1.0, 6.0];
    let vars: Vec<_> = fixture
        .system
        .states
        .iter()
        .map(|state| state.var.as_variable())
        .collect();
    let value = |var| {
        vars.iter()
            .position(|&v| v == Some(var))
            .map_or(0.0, |i| point[i])
    };
    let solution = solve_pointwise(&fixture.system, &dcs, &value);
    assert_eq!(solution.rates[0], 6.0);
    assert_eq!(solution.residual, 0.0);
}

/// Stewart's form, the step form and the original give one x' off all surfaces.
fn check_two_roads(fixture: &Fixture, point: &[f64]) -> Result<(), TestCaseError> {
    let Fixture { system, original } = fixture;
    let states = system.states.iter();
    let vars: Vec<_> = states.map(|state| state.var.as_variable()).collect();
    let place = |var| vars.iter().position(|&v| v == Some(var));
    let value = |var| place(var).map_or(0.0, |i| point[i]);
    let psi = Sides::at(system, &value).psi;
    prop_assume!(psi.iter().all(|psi| psi.abs() > 1e-9));
    for formulation in [Formulation::Stewart, Formulation::Step] {
        let dcs = lower_as(system, formulation).expect("the system is small");
        prop_assert_eq!(dcs.verify(), Ok(()));
        let solution = solve_pointwise(system, &dcs, &value);
        let residual = solution.residual;
        prop_assert!(residual <= 1e-13, "{formulation}: residual {residual}");
        for (rate, original) in solution.rates.iter().zip(original) {
            let expected = original.eval(&value);
            let close = (rate - expected).abs() <= 1e-13 * (1.0 + expected.abs());
            prop_assert!(close, "{formulation}: {rate}, not {expected}, in\n{dcs}");
        }
    }
    Ok(())
}

/// On surfaces too: with θ = Π α, both forms are the multi-affine rates of the system.
fn check_between_corners(
    fixture: &Fixture,
    point: &[f64],
    alpha: &[f64],
) -> Result<(), TestCaseError> {
    let system = &fixture.system;
    let states = system.states.iter().zip(point);
    let states = states.map(|(state, &value)| (state.var.as_variable(), value));
    let switches = system.switches.iter().zip(alpha);
    let switches = switches.map(|(switch, &value)| (switch.alpha.as_variable(), value));
    let known: Vec<_> = states.chain(switches).collect();
    let value = |var| {
        known
            .iter()
            .find(|known| known.0 == Some(var))
            .map_or(0.0, |known| known.1)
    };
    let sides = Sides {
        psi: vec![0.0; alpha.len()],
        alpha: alpha.to_vec(),
    };
    for formulation in [Formulation::Stewart, Formulation::Step] {
        let dcs = lower_as(system, formulation).expect("the system is small");
        let rates = solve_with(system, &dcs, &sides, &value).rates;
        for (rate, state) in rates.iter().zip(&system.states) {
            let expected = state.rate.eval(&value);
            let close = (rate - expected).abs() <= 1e-12 * (1.0 + expected.abs());
            prop_assert!(close, "{formulation}: {rate}, not {expected}, in\n{dcs}");
        }
    }
    Ok(())
}

/// A term `coefficient * Π factor`: for every switch no factor, α, 1 - α or 2α - 1.
type Term = (f64, Vec<u8>);

fn term(n: usize) -> impl Strategy<Value = Term> {
    let factors = prop::collection::vec(prop_oneof![3 => Just(0u8), 3 => 1..4u8], n);
    (-2.0..2.0f64, factors)
}

/// Switches on random lines, and rates that are random sums of products of them.
fn random<'e>(exprs: &'e Exprs, lines: &[(f64, f64, f64)], rates: &[Vec<Term>]) -> Fixture<'e> {
    let mut b = fixtures::Builder::new(exprs, &["x", "y"]);
    let (x, y) = (b.states[0], b.states[1]);
    let alphas = lines.iter().enumerate().map(|(k, &(p, q, r))| {
        let psi = p * x + q * y + r;
        b.switch(&format!("s{k}"), psi)
    });
    let alphas: Vec<_> = alphas.collect();
    let factor = |k: usize, kind: u8| match kind {
        1 => alphas[k],
        2 => 1.0 - alphas[k],
        _ => 2.0 * alphas[k] - 1.0,
    };
    let mut subsystem: Vec<usize> = (0..lines.len()).collect();
    let rate = |terms: &Vec<Term>| {
        let terms = terms.iter().enumerate().map(|(i, (coefficient, kinds))| {
            let present = || (0..kinds.len()).filter(|&k| kinds[k] > 0);
            if let Some(first) = present().next() {
                let root = subsystem[first];
                let merged: Vec<usize> = present().map(|k| subsystem[k]).collect();
                for s in &mut subsystem {
                    *s = if merged.contains(s) { root } else { *s };
                }
            }
            let smooth = if i % 2 == 0 {
                x * y
            } else {
                exprs.constant(1.0)
            };
            let product = exprs.product(present().map(|k| factor(k, kinds[k])));
            *coefficient * smooth * product
        });
        let terms: Vec<_> = terms.collect();
        exprs.sum(terms)
    };
    let rates: Vec<_> = rates.iter().map(rate).collect();
    let members =
        |s: usize| -> Vec<usize> { (0..lines.len()).filter(|&k| subsystem[k] == s).collect() };
    let members: Vec<_> = (0..lines.len())
        .map(members)
        .filter(|m| !m.is_empty())
        .collect();
    let subsystems: Vec<_> = members.iter().map(|m| (m.as_slice(), None)).collect();
    b.finish(&rates, &subsystems)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn both_lowerings_give_the_rates_of_the_original(point in prop::collection::vec(-3.0..3.0f64, 3)) {
        let all: [fn(&Exprs) -> Fixture<'_>; 7] = [
            fixtures::relay,
            fixtures::two_relays,
            fixtures::product_of_signs,
            fixtures::open_sign,
            fixtures::intervals,
            fixtures::kinks,
            fixtures::many,
        ];
        for make in all {
            check_two_roads(&make(&Exprs::new()), &point)?;
        }
    }

    #[test]
    fn both_lowerings_give_the_rates_of_random_products(
        point in prop::collection::vec(-3.0..3.0f64, 2),
        lines in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 6),
        rates in prop::collection::vec(prop::collection::vec(term(6), 1..5), 2),
        alpha in prop::collection::vec(0.0..1.0f64, 6),
    ) {
        let exprs = Exprs::new();
        let fixture = random(&exprs, &lines, &rates);
        check_two_roads(&fixture, &point)?;
        // Lines through one point, where all sides meet.
        let lines: Vec<_> = lines.iter().map(|&(p, q, _)| (p, q, 0.0)).collect();
        let exprs = Exprs::new();
        check_between_corners(&random(&exprs, &lines, &rates), &point, &alpha)?;
    }
}
