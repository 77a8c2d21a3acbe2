//! `nsdc verify` finds what is wrong with one road: a model for each lowering and method that a fault may sit in.
//!
//! The table of faults in the README of `tests` has what these tests are to catch.

use std::fs;

use crate::terminal::{folder, nsdc};

/// Verifies the only experiment of a model, and expects so many roads to agree.
fn agree(name: &str, model: &str, roads: usize) {
    let folder = folder(&format!("roads_{name}"));
    fs::write(folder.join("model.nsd"), model).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "model.nsd"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    let expected = format!(": {roads} roads agree");
    assert!(ran.out.contains(&expected), "{}", ran.out);
}

/// The step response of a relay: it slides, leaves with the step, and is on its way at the end.
const RISE: &str = "
model step_response {
  state x = 0;
  let r = if time < 1 then 0 else 1;
  x' = sign(r - x);
}
simulate rises of step_response { horizon 1.5; }
";

/// Two set points that step.
const STEPS: &str = "
model steps {
  state x = 0;
  state y = 0.5;
  let r = if time < 1 then 0 else if time < 2 then 1 else 0.25;
  x' = 2*sign(r - x) - x/4;
  y' = sat(4*(r - y), -1, 1);
}
simulate follows of steps { horizon 2.25; }
";

/// Two switches whose product is in the rates.
const PRODUCT: &str = "
model product {
  state x[2] = [-1, 0.5];
  x[1]' = 1 + 0.5*sign(x[1])*sign(x[2]);
  x[2]' = -0.75 - 0.25*sign(x[2])*sign(x[1]) - 0.5*sign(x[1]);
}
simulate passes of product { horizon 1.5; }
";

/// Two switches that add up in one rate, and a kink.
const BOTH: &str = "
model both {
  state x = 1;
  state y = -0.5;
  x' = -sign(x - 0.25) - 0.5*sign(y) - 0.25*abs(x);
  y' = 1;
}
simulate passes of both { horizon 1.25; }
";

/// A thrown ball that slips as it bounces.
const THROWN: &str = "
model thrown {
  state q[2] = [0, 1];
  state v[2] = [2, 0];
  q' = v;
  mechanics q, v {
    mass = 1;
    force = [0, -9.81];
    contact floor { gap = q[2]; slip = v[1]; restitution = 0.5; friction = 0.2; }
  }
}
simulate bounces of thrown { horizon 0.9; }
";

/// A ball that stays on the floor and slips on it.
const CLAY: &str = "
model clay {
  state q[2] = [0, 0.5];
  state v[2] = [3, 0];
  q' = v;
  mechanics q, v {
    mass = 1;
    force = [0, -9.81];
    contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = 0.3; }
  }
}
simulate slips of clay { horizon 0.6; }
";

/// A heating that goes on and off.
const RELAY: &str = "
model relay {
  state x = 0.5;
  switch h = hysteresis(x, on = 0.25, off = 0.75, start = 1);
  x' = 1.5*h - 0.5*x;
}
simulate cycles of relay { horizon 3; }
";

/// A curved surface that is slid on.
const CURVED: &str = "
model curved {
  state x[2] = [0.5, 0];
  let c = x[1]^2 + 2*x[2]^2 + x[1]/4 - 1;
  x' = [-0.5, 1; -1, -0.5]*x - x*sign(c) + x;
}
simulate slides of curved { horizon 2; }
";

/// The objective is one with all lowerings.
const OPTIMUM: &str = "
model drive {
  state x[2] = [-0.5, 0.25];
  control u in [-2, 2] = 0.5;
  x[1]' = u + 0.5*sign(x[1])*sign(x[2]);
  x[2]' = -1;
}
optimize reach of drive {
  horizon 1;
  intervals 4;
  minimize integral(u^2) + 4*final((x[1] - 0.25)^2);
}
";

#[test]
fn set_points_that_step() {
    agree("steps", STEPS, 3);
}

#[test]
fn a_step_response() {
    agree("rise", RISE, 3);
}

#[test]
fn switches_that_multiply() {
    agree("product", PRODUCT, 3);
}

#[test]
fn switches_that_add_up() {
    agree("both", BOTH, 3);
}

#[test]
fn bounces_with_friction() {
    agree("thrown", THROWN, 4);
}

#[test]
fn an_inelastic_impact_with_friction() {
    agree("clay", CLAY, 4);
}

#[test]
fn relays_with_memory() {
    agree("relay", RELAY, 3);
}

#[test]
fn sliding_on_a_curve() {
    agree("curved", CURVED, 3);
}

#[test]
fn an_optimum_with_switches_that_multiply() {
    let folder = folder("roads_optimum");
    fs::write(folder.join("model.nsd"), OPTIMUM).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "model.nsd"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    let expected = "2 lowerings have the objective";
    assert!(ran.out.contains(expected), "{}", ran.out);
}
