//! Models as they are written, and the systems they become.

use insta::assert_snapshot;

use crate::compile;
use crate::diagnostics::{Diagnostics, render};
use crate::expr::Exprs;
use crate::project::clock::Clock;
use crate::source::SourceMap;
use crate::syntax::{Experiment, Item, parse};

/// The printed system of the first experiment, with warnings; else the diagnostics.
pub(crate) fn printed(text: &str) -> String {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    let experiments = file.items.iter().filter_map(|item| match item {
        Item::Experiment(experiment) => Some(experiment),
        _ => None,
    });
    let exprs = Exprs::new();
    let compiled = experiments.take(1).find_map(|experiment: &Experiment| {
        let mut clock = Clock::default();
        compile(&exprs, &file, experiment, &[], &mut clock, &mut diags)
    });
    let system = compiled.map(|compiled| compiled.system);
    let mut text = system
        .as_ref()
        .map(|system| system.to_string())
        .unwrap_or_default();
    if let Some(broken) = system.and_then(|system| system.verify().err()) {
        text += &format!("broken invariant: {broken}\n");
    }
    text + &render(&diags, &sources, false, 100)
}

/// [`printed`] for a model with states x, y, z.
fn statements(statements: &str) -> String {
    let needed: String = ["x", "y", "z"]
        .iter()
        .filter(|name| statements.contains(&format!("{name}'")))
        .map(|name| format!("state {name} = 1;\n"))
        .collect();
    printed(&format!(
        "model m {{\n{needed}{statements}\n}}\nsimulate run of m {{ horizon 1; }}"
    ))
}

#[test]
fn oscillator() {
    let text = "
model oscillator {
  param omega = 2*pi;
  state x[2] = [exp(-1), 0];
  let A1 = [1, omega; -omega, 1];
  let A2 = [1, -omega; omega, 1];
  let c  = dot(x, x) - 1;
  region inside  where c < 0 { x' = A1*x; }
  region outside where c > 0 { x' = A2*x; }
}
simulate crossing of oscillator { horizon pi/2; }";
    assert_snapshot!(printed(text), @r"
    system oscillator
    param omega = 6.283185307179586
    state x[1] = 0.36787944117144233
    state x[2] = 0
    der(x[1]) = (omega*x[2] + x[1])*(1 - alpha[1]) + (-omega*x[2] + x[1])*alpha[1]
    der(x[2]) = (-omega*x[1] + x[2])*(1 - alpha[1]) + (omega*x[1] + x[2])*alpha[1]
    alpha[1] in step(x[1]^2 + x[2]^2 - 1)  // c, discontinuous
    partition of x[1], x[2]  // one region everywhere: proven
      inside: 1 - alpha[1]
      outside: alpha[1]
    subsystem alpha[1]  // disjoint regions
    ");
}

#[test]
fn branicky() {
    let text = "
model branicky {
  state x[2] = [1e-6, 1e-6];
  let A1 = [-1, 1; -10, -1];
  let A2 = [-1, 10; -1, -1];
  region one where x[1]*x[2] <= 0 { x' = A1*x; }
  region two where x[1]*x[2] >  0 { x' = A2*x; }
}
simulate growth of branicky { horizon 20; }";
    assert_snapshot!(printed(text), @r"
    system branicky
    state x[1] = 0.000001
    state x[2] = 0.000001
    der(x[1]) = (-x[1] + x[2])*(1 - alpha[1]) + (-x[1] + 10*x[2])*alpha[1]
    der(x[2]) = (-10*x[1] - x[2])*(1 - alpha[1]) + (-x[1] - x[2])*alpha[1]
    alpha[1] in step(x[1]*x[2])  // x[1]*x[2], discontinuous
    partition of x[1], x[2]  // one region everywhere: proven
      one: 1 - alpha[1]
      two: alpha[1]
    subsystem alpha[1]  // disjoint regions
    ");
}

#[test]
fn a_sign_in_the_dynamics() {
    assert_snapshot!(statements("x' = 2 - sign(x);"), @r"
    system m
    state x = 1
    der(x) = 3 - 2*alpha[1]
    alpha[1] in step(x)  // x, discontinuous
    subsystem alpha[1]
    ");
}

#[test]
fn kinks_are_continuous() {
    assert_snapshot!(statements("x' = 1 + max(0, x); y' = abs(x - y);"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = x*alpha[1] + 1
    der(y) = (x - y)*(2*alpha[2] - 1)
    alpha[1] in step(x)  // x, continuous
    alpha[2] in step(x - y)  // x - y, continuous
    subsystem alpha[1]
    subsystem alpha[2]
    ");
    assert_snapshot!(statements("x' = max(x, min(y, 2*y + 1)); y' = -1;"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = x*alpha[2] + (y*(1 - alpha[1]) + (2*y + 1)*alpha[1])*(1 - alpha[2])
    der(y) = -1
    alpha[1] in step(-y - 1)  // -y - 1, continuous
    alpha[2] in step(x - y*(1 - alpha[1]) - (2*y + 1)*alpha[1])  // x - min(y, 2*y + 1), continuous
    subsystem alpha[1], alpha[2]
    ");
    assert_snapshot!(statements("x' = sat(x); y' = deadzone(x, 2);"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = (x + 1)*alpha[1] - (x - 1)*alpha[2] - 1
    der(y) = 2 - (x + 2)*alpha[3] + (x - 2)*alpha[4] + x
    alpha[1] in step(x + 1)  // x + 1, continuous
    alpha[2] in step(x - 1)  // x - 1, continuous
    alpha[3] in step(x + 2)  // x + 2, continuous
    alpha[4] in step(x - 2)  // x - 2, continuous
    subsystem alpha[1]
    subsystem alpha[2]
    subsystem alpha[3]
    subsystem alpha[4]
    ");
    // The distance over its value is a sign.
    assert_snapshot!(statements("x' = -x/abs(x);"), @r"
    system m
    state x = 1
    der(x) = 1 - 2*alpha[1]
    alpha[1] in step(x)  // x, discontinuous
    subsystem alpha[1]
    ");
}

#[test]
fn an_if_that_agrees_on_its_surface_is_continuous() {
    assert_snapshot!(statements("x' = if x > 1 then x^2 else 2*x - 1;"), @r"
    system m
    state x = 1
    der(x) = (x^2 - 2*x + 1)*alpha[1] + 2*x - 1
    alpha[1] in step(x - 1)  // x - 1, continuous
    subsystem alpha[1]
    ");
    assert_snapshot!(statements("x' = if x > 1 then x else -x;"), @r"
    system m
    state x = 1
    der(x) = 2*x*alpha[1] - x
    alpha[1] in step(x - 1)  // x - 1, discontinuous
    subsystem alpha[1]
    ");
}

#[test]
fn one_surface_is_one_switch() {
    assert_snapshot!(statements("x' = -sign(x) + y; y' = -2*sign(x) + sign(-2*x);"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = y - 2*alpha[1] + 1
    der(y) = 3 - 6*alpha[1]
    alpha[1] in step(x)  // x, discontinuous
    subsystem alpha[1]
    ");
}

#[test]
fn products_of_switches_form_a_subsystem() {
    assert_snapshot!(statements("x' = sign(x)*sign(y); y' = -sign(y); z' = -sign(z);"), @r"
    system m
    state x = 1
    state y = 1
    state z = 1
    der(x) = (2*alpha[1] - 1)*(2*alpha[2] - 1)
    der(y) = 1 - 2*alpha[2]
    der(z) = 1 - 2*alpha[3]
    alpha[1] in step(x)  // x, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    alpha[3] in step(z)  // z, discontinuous
    subsystem alpha[1], alpha[2]
    subsystem alpha[3]
    ");
}

#[test]
fn a_vector_sign_is_a_switch_per_entry() {
    let text = "
model slider {
  state q[2] = [2, 1];
  control u[2] = [0, 0];
  let c = [q[1] + 0.15*q[2]^2, 0.05*q[1]^3 + q[2]];
  q' = -sign(c) + u;
  output side = sign(c);
}
simulate run of slider { with { u = [sin(time), -q[1]]; } horizon 4; }";
    assert_snapshot!(printed(text), @r"
    system slider
    state q[1] = 2
    state q[2] = 1
    der(q[1]) = sin(time) - 2*alpha[1] + 1
    der(q[2]) = 1 - q[1] - 2*alpha[2]
    alpha[1] in step(q[1] + 0.15*q[2]^2)  // c[1], discontinuous
    alpha[2] in step(0.05*q[1]^3 + q[2])  // c[2], discontinuous
    output side = [2*alpha[1] - 1, 2*alpha[2] - 1]
    control u = [sin(time), -q[1]]
    subsystem alpha[1]
    subsystem alpha[2]
    ");
}

#[test]
fn named_switches_with_readings() {
    let text = "
model chain {
  const n = 2;
  state v[n] = [1, -1];
  switch s = sign(v);
  v' = -s;
}
simulate run of chain { horizon 1; }";
    assert_snapshot!(printed(text), @r"
    system chain
    state v[1] = 1
    state v[2] = -1
    der(v[1]) = 1 - 2*alpha[1]
    der(v[2]) = 1 - 2*alpha[2]
    alpha[1] in step(v[1])  // s[1], discontinuous
      read by s[1] as psi
    alpha[2] in step(v[2])  // s[2], discontinuous
      read by s[2] as psi
    subsystem alpha[1]
    subsystem alpha[2]
    ");
    assert_snapshot!(statements("switch s = sign(x) sliding linear; x' = -s + 0.5*s^2;"), @r"
    system m
    state x = 1
    der(x) = 1.5 - 2*alpha[1]
    alpha[1] in step(x)  // s, discontinuous
      read by s as psi
    subsystem alpha[1]
    ");
}

#[test]
fn regions_with_friction_inside() {
    let text = "
x' = y;
region air   where x > 0 { y' = -9.81 - sign(x); }
region floor where x < 0 { y' = -100*x - sign(y)*sign(x); }";
    assert_snapshot!(statements(text), @r"
    system m
    state x = 1
    state y = 1
    der(x) = y
    der(y) = (-100*x + 2*alpha[2] - 1)*(1 - alpha[1]) - 10.81*alpha[1]
    alpha[1] in step(x)  // x, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    partition of y  // one region everywhere: proven
      air: alpha[1]
      floor: 1 - alpha[1]
    subsystem alpha[1], alpha[2]
    ");
}

#[test]
fn regions_by_conjunctions_and_the_rest() {
    let text = "
region corner where x > 0 and y > 0 { x' = -1; y' = -1; }
region rest else { x' = 1; y' = 0; }";
    assert_snapshot!(statements(text), @r"
    system m
    state x = 1
    state y = 1
    der(x) = 1 - 2*alpha[1]*alpha[2]
    der(y) = -alpha[1]*alpha[2]
    alpha[1] in step(x)  // x, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    partition of x, y  // one region everywhere: proven
      corner: alpha[1]*alpha[2]
      rest: 1 - alpha[1]*alpha[2]
    subsystem alpha[1], alpha[2]
    ");
    let text = "
region right where x > 0 { x' = -1; }
region above where x < 0 and y > 0 { x' = 1; }
region below where x < 0 and y < 0 { x' = 2; }
y' = -y;";
    assert_snapshot!(statements(text), @r"
    system m
    state x = 1
    state y = 1
    der(x) = (1 - alpha[1])*alpha[2] + 2*(1 - alpha[1])*(1 - alpha[2]) - alpha[1]
    der(y) = -y
    alpha[1] in step(x)  // x, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    partition of x  // one region everywhere: proven
      right: alpha[1]
      above: (1 - alpha[1])*alpha[2]
      below: (1 - alpha[1])*(1 - alpha[2])
    subsystem alpha[1], alpha[2]  // disjoint regions
    ");
}

#[test]
fn what_is_not_needed_is_skipped() {
    assert_snapshot!(statements("let unused = sign(y); x' = -sign(x); y' = 1;"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = 1 - 2*alpha[1]
    der(y) = 1
    alpha[1] in step(x)  // x, discontinuous
    subsystem alpha[1]
    skipped switch `y`
    ");
}

#[test]
fn parameters_may_decide_a_condition() {
    let text = "
model m {
  param friction = 1;
  param mu = 2*friction;
  state v = 1;
  v' = -mu*(if friction > 0 then sign(v) else v);
}
simulate run of m { with { friction = 0.5; } horizon 1; }";
    assert_snapshot!(printed(text), @r"
    system m
    param friction = 0.5
    param mu = 1
    state v = 1
    der(v) = -mu*(2*alpha[1] - 1)
    alpha[1] in step(v)  // v, discontinuous
    subsystem alpha[1]
    ");
}

#[test]
fn what_agrees_on_the_surface_needs_no_reading() {
    // sign(x)*abs(x) is x, and nested conditions are conditions.
    assert_snapshot!(statements("x' = -sign(x)*abs(x);"), @r"
    system m
    state x = 1
    der(x) = -x
    skipped switch `x`
    ");
    assert_snapshot!(statements("x' = if x > 0 and y > 0 then 1 else if x > 0 then 2 else 3; y' = 1;"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = 3 - alpha[1]*alpha[2] - alpha[1]
    der(y) = 1
    alpha[1] in step(x)  // x, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    subsystem alpha[1], alpha[2]
    ");
}

#[test]
fn the_rest_between_two_surfaces_keeps_them_independent() {
    let text = "
region low  where x < 0 { x' = 1; }
region high where x > 2 { x' = -1; }
region middle else { x' = 0; }";
    assert_snapshot!(statements(text), @r"
    system m
    state x = 1
    der(x) = 1 - alpha[1] - alpha[2]
    alpha[1] in step(x)  // x, discontinuous
    alpha[2] in step(x - 2)  // x - 2, discontinuous
    partition of x  // one region everywhere: proven
      low: 1 - alpha[1]
      high: alpha[2]
      middle: alpha[1] - alpha[2]
    subsystem alpha[1]
    subsystem alpha[2]
    ");
}

#[test]
fn a_kink_may_stand_in_a_surface_though_its_own_surface_slides() {
    assert_snapshot!(statements("x' = -sign(x - y) - sign(max(x, y) - 2); y' = 0;"), @r"
    system m
    state x = 1
    state y = 1
    der(x) = 2 - 2*alpha[1] - 2*alpha[2]
    der(y) = 0
    alpha[1] in step(x - y)  // x - y, discontinuous
    alpha[2] in step(x*alpha[1] + y*(1 - alpha[1]) - 2)  // max(x, y) - 2, discontinuous
    subsystem alpha[1]
    subsystem alpha[2]
    ");
}
