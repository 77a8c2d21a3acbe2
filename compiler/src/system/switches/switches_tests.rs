//! Tests of [`crate::system::switches`].

use super::affine::multi_affine;
use super::known::Known;
use crate::expr::{Expr, Exprs, Var};
use crate::source::Span;
use crate::system::switches::Switches;
use crate::system::switches::entries::Entry;
use insta::assert_snapshot;
use proptest::prelude::*;
use rustc_hash::FxHashMap;

/// The expression in α, then every ψ.
fn replaced<'e>(exprs: &'e Exprs, e: Expr<'e>) -> String {
    let mut switches = Switches::new(exprs, [exprs.variable("time")], Known::default());
    let e = switches.replace(e, Span::default());
    let e = switches.entries.merged(e);
    for (k, switch) in switches.list.iter().enumerate() {
        exprs.rename(switch.alpha, &format!("a{}", k + 1));
    }
    let psi: Vec<String> = switches
        .list
        .iter()
        .map(|switch| switch.psi.to_string())
        .collect();
    let refused = switches
        .refused
        .iter()
        .map(|refused| format!(" refused {}", refused.psi));
    format!("{e} | {}{}", psi.join(", "), refused.collect::<String>())
}

#[test]
fn each_nonsmooth_term() {
    let exprs = Exprs::new();
    let [x, y] = ["x", "y"].map(|name| exprs.variable(name));
    assert_snapshot!(replaced(&exprs, x.step()), @"a1 | x");
    assert_snapshot!(replaced(&exprs, 2.0 - x.sign()), @"3 - 2*a1 | x");
    assert_snapshot!(replaced(&exprs, x.abs()), @"x*(2*a1 - 1) | x");
    assert_snapshot!(replaced(&exprs, x.max(y)), @"x*a1 + y*(1 - a1) | x - y");
    assert_snapshot!(replaced(&exprs, x.min(y)), @"x*(1 - a1) + y*a1 | x - y");
}

#[test]
fn multiples_share_a_switch() {
    let exprs = Exprs::new();
    let [x, y] = ["x", "y"].map(|name| exprs.variable(name));
    assert_snapshot!(replaced(&exprs, x.sign() + y * (-2.0 * x).sign()), @"y*(1 - 2*a1) + 2*a1 - 1 | x");
    assert_snapshot!(replaced(&exprs, (x - y).abs() + (y - x).abs()), @"(x - y)*(2*a1 - 1) + (-x + y)*(1 - 2*a1) | x - y");
    assert_snapshot!(replaced(&exprs, (x * y).sign() + (-3.0 * x * y).step()), @"a1 | x*y");
}

#[test]
fn inner_switches_stand_in_outer_surfaces() {
    let exprs = Exprs::new();
    let [x, y, z] = ["x", "y", "z"].map(|name| exprs.variable(name));
    assert_snapshot!(replaced(&exprs, x.max(y.min(z))), @"x*a2 + (y*(1 - a1) + z*a1)*(1 - a2) | y - z, x - y*(1 - a1) - z*a1");
    assert_snapshot!(replaced(&exprs, (x.abs() - 1.0).sign()), @"2*a2 - 1 | x, x*(2*a1 - 1) - 1");
}

#[test]
fn what_is_no_surface_is_refused() {
    let exprs = Exprs::new();
    let [x, y] = ["x", "y"].map(|name| exprs.variable(name));
    assert_snapshot!(replaced(&exprs, x.powi(2).sign()), @"1 |  refused x^2");
    assert_snapshot!(replaced(&exprs, (x * x + y * y).step()), @"1 |  refused x^2 + y^2");
    assert_snapshot!(replaced(&exprs, x.powi(3).sign()), @"1 |  refused x^3");
    assert_snapshot!(replaced(&exprs, x.abs().sign()), @"1 | x refused x*(2*a1 - 1)");
    // A kink has no such trouble: its branches agree.
    assert_snapshot!(replaced(&exprs, (-x.powi(3)).abs()), @"-x^3*(2*a1 - 1) | -x");
    assert_snapshot!(replaced(&exprs, x.powi(2).abs()), @"x^2 |");
    assert_snapshot!(replaced(&exprs, x.abs().max(exprs.constant(0.0))), @"x*(2*a1 - 1) | x");
}

#[test]
fn parameters_decide_the_sign_of_factors() {
    let exprs = Exprs::new();
    let [x, k] = ["x", "k"].map(|name| exprs.variable(name));
    let params = FxHashMap::from_iter([(k.as_variable().unwrap(), -3.0)]);
    let known = Known {
        numbers: params,
        ..Known::default()
    };
    let mut switches = Switches::new(&exprs, [exprs.variable("time")], known);
    let first = switches.enter(x, x, Entry::Condition);
    let second = switches.enter(k * x, k * x, Entry::Condition);
    assert_eq!(switches.list.len(), 1);
    assert_eq!(second, 1.0 - first);
    assert_eq!(switches.enter(k, k, Entry::Condition), exprs.constant(0.0));
}

/// Random expressions over x, y, z with smooth and nonsmooth terms.
fn random<'e>(vars: &[Expr<'e>], choices: &mut impl Iterator<Item = u8>, depth: usize) -> Expr<'e> {
    let mut next = || choices.next().unwrap_or(0);
    let choice = if depth == 0 { next() % 3 } else { next() % 13 };
    let mut below = || random(vars, choices, depth - 1);
    match choice {
        0..=2 => vars[usize::from(choice)],
        3 | 4 => below() + below(),
        5 => below() - 2.0 * below(),
        6 | 7 => below() * below(),
        8 => below().abs(),
        9 => below().max(below()),
        10 => below().min(below()),
        11 => below().sign(),
        _ => below().step(),
    }
}

proptest! {
    /// Off the surfaces, α at its side gives the value of the expression as it was written.
    #[test]
    fn switches_have_the_values_of_their_terms(
        choices in prop::collection::vec(any::<u8>(), 40),
        at in prop::array::uniform3(-3.0..3.0),
    ) {
        let exprs = Exprs::new();
        let vars = ["x", "y", "z"].map(|name| exprs.variable(name));
        let e = random(&vars, &mut choices.into_iter(), 4);
        let mut switches = Switches::new(&exprs, [exprs.variable("time")], Known::default());
        let replaced = switches.replace(e, Span::default());
        prop_assume!(switches.refused.is_empty());
        let replaced = switches.entries.merged(replaced);

        let value = |var: Var, alphas: &[(Var, f64)]| {
            let alpha = alphas.iter().find(|known| known.0 == var).map(|known| known.1);
            alpha.unwrap_or_else(|| vars.iter().position(|v| v.as_variable() == Some(var)).map_or(f64::NAN, |k| at[k]))
        };
        let mut alphas: Vec<(Var, f64)> = Vec::new();
        for switch in &switches.list {
            let psi = switch.psi.eval(&|var| value(var, &alphas));
            prop_assume!(psi.abs() > 1e-9);
            alphas.push((switch.alpha, f64::from(psi > 0.0)));
        }
        let written = e.eval(&|var| value(var, &[]));
        let found = replaced.eval(&|var| value(var, &alphas));
        prop_assert!((written - found).abs() <= 1e-9 * (1.0 + written.abs()), "{e}: {written}, {replaced}: {found}");

        let names: Vec<Var> = alphas.iter().map(|known| known.0).collect();
        prop_assert_eq!(multi_affine(replaced, &names), replaced);
    }
}
