//! What experiments with an `output` list keep.

use insta::assert_snapshot;

use super::tests::printed;

const BANK: &str = "
model bank {
  param k = 2;
  state x[4] = [1, 2, 3, 4];
  state y = 0; state z = 0;
  control u = 1;
  output E = z^2;
  switch s = sign(x[4]);
  for i in 1..4 { x[i]' = -sign(x[i] - i/2) + k*x[i]; }
  region left  where y < 0 { y' = 1; z' = u; }
  region right where y > 0 { y' = -1; z' = 2*u; }
}
simulate run of bank { with { u = -x[1]; } horizon 1; ";

fn bank(settings: &str) -> String {
    printed(&format!("{BANK}{settings} }}"))
}

#[test]
fn a_state_needs_its_own_switches_only() {
    assert_snapshot!(bank("output x[2], u;"), @r"
    system bank
    param k = 2
    state x[1] = 1
    state x[2] = 2
    der(x[1]) = k*x[1] - 2*alpha[1] + 1
    der(x[2]) = k*x[2] - 2*alpha[2] + 1
    alpha[1] in step(x[1] - 0.5)  // x[1] - 1/2, discontinuous
    alpha[2] in step(x[2] - 1)  // x[2] - 2/2, discontinuous
    control u = -x[1]
    subsystem alpha[1]
    subsystem alpha[2]
    skipped states x[3..4], y, z
    skipped switch `x[3] - 3/2`
    skipped switch `x[4] - 4/2`
    skipped switch `y`
    ");
}

#[test]
fn a_state_of_a_partition_needs_its_guards_and_what_controls_read() {
    assert_snapshot!(bank("output z;"), @r"
    system bank
    param k = 2
    state x[1] = 1
    state y = 0
    state z = 0
    der(x[1]) = k*x[1] - 2*alpha[1] + 1
    der(y) = 1 - 2*alpha[2]
    der(z) = -x[1]*(1 - alpha[2]) - 2*x[1]*alpha[2]
    alpha[1] in step(x[1] - 0.5)  // x[1] - 1/2, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    partition of y, z  // one region everywhere: proven
      left: 1 - alpha[2]
      right: alpha[2]
    subsystem alpha[1]
    subsystem alpha[2]  // disjoint regions
    skipped states x[2..4]
    skipped switch `x[2] - 2/2`
    skipped switch `x[3] - 3/2`
    skipped switch `x[4] - 4/2`
    ");
}

#[test]
fn expectations_are_needs() {
    let kept = |expect: &str| {
        let system = bank(&format!("output x[2]; expect {expect};"));
        let lines = system
            .lines()
            .filter(|line| line.starts_with("der(") || line.contains(" in step("));
        lines.map(str::trim).collect::<Vec<_>>().join("\n")
    };
    assert_snapshot!(kept("x[3] at end <= 1"), @r"
    der(x[2]) = k*x[2] - 2*alpha[1] + 1
    der(x[3]) = k*x[3] - 2*alpha[2] + 1
    alpha[1] in step(x[2] - 1)  // x[2] - 2/2, discontinuous
    alpha[2] in step(x[3] - 1.5)  // x[3] - 3/2, discontinuous
    ");
    assert_snapshot!(kept("events(crossing, y) ~ [0] within 1"), @r"
    der(x[2]) = k*x[2] - 2*alpha[1] + 1
    der(y) = 1 - 2*alpha[2]
    alpha[1] in step(x[2] - 1)  // x[2] - 2/2, discontinuous
    alpha[2] in step(y)  // y, discontinuous
    ");
    assert_snapshot!(kept("mode at end is above(s)"), @r"
    der(x[2]) = k*x[2] - 2*alpha[1] + 1
    der(x[4]) = k*x[4] - 2*alpha[2] + 1
    alpha[1] in step(x[2] - 1)  // x[2] - 2/2, discontinuous
    alpha[2] in step(x[4] - 2)  // x[4] - 4/2, discontinuous
    alpha[3] in step(x[4])  // s, continuous
    ");
    assert_snapshot!(kept("mode at end is left"), @r"
    der(x[1]) = k*x[1] - 2*alpha[1] + 1
    der(x[2]) = k*x[2] - 2*alpha[2] + 1
    der(y) = 1 - 2*alpha[3]
    der(z) = -x[1]*(1 - alpha[3]) - 2*x[1]*alpha[3]
    alpha[1] in step(x[1] - 0.5)  // x[1] - 1/2, discontinuous
    alpha[2] in step(x[2] - 1)  // x[2] - 2/2, discontinuous
    alpha[3] in step(y)  // y, discontinuous
    ");
    // All but the switch `s`, which nothing reads.
    let all = kept("len(switches) = 0");
    assert_eq!(all, kept("len(events(crossing)) = 0"));
    assert_eq!(all.lines().count(), 6 + 5);
}

#[test]
fn whole_parts_are_counted() {
    let text = "
model relay { state x = 1; input r = 0; x' = -sign(x - r); }
model many {
  part b[i in 1..50] = relay { r = i; }
  part lone = relay;
  state y = 0;
  y' = sign(b[3].x - b[4].x);
}
simulate run of many { horizon 1; output b[2].x, b[3].x; }";
    assert_snapshot!(printed(text), @r"
    system many
    state b[2].x = 1
    state b[3].x = 1
    der(b[2].x) = 1 - 2*alpha[1]
    der(b[3].x) = 1 - 2*alpha[2]
    alpha[1] in step(b[2].x - 2)  // b[2].x - b[2].r, discontinuous
    alpha[2] in step(b[3].x - 3)  // b[3].x - b[3].r, discontinuous
    subsystem alpha[1]
    subsystem alpha[2]
    skipped part b[1], b[4..50]: 48 states, 48 switches
    skipped part lone: 1 state, 1 switch
    skipped state y
    skipped switch `b[3].x - b[4].x`
    ");
}
