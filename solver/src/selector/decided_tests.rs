//! Relays that watch each other, which no model file can write.

use crate::event::Simulator;
use crate::event::tests::Times;
use crate::hybrid::{HybridSystem, Input, Settings, Side, Status, Switch, SwitchKind};
use crate::tape::Tape;

/// x' = 1, ψ = c + (x, 0) + Bα with own terms on the diagonal: two relays.
fn pair(c: [f64; 2], b: [[f64; 2]; 2]) -> HybridSystem {
    let mut system = HybridSystem::default();
    let mut rate = Tape::builder(0);
    let one = rate.constant(1.0);
    system.add_block(vec![0], rate.finish(&[one]), vec![]);
    for (i, (c, b)) in c.into_iter().zip(b).enumerate() {
        let mut psi = Tape::builder(3);
        let mut value = psi.constant(c);
        value = psi.add_scaled(value, if i == 0 { 1.0 } else { 0.0 }, psi.input(0));
        for (j, b) in b.into_iter().enumerate() {
            value = psi.add_scaled(value, b, psi.input(1 + j));
        }
        let mut switch = Switch::new(SwitchKind::Relay(Side::Minus));
        switch.inside = vec![0, 1];
        let inputs = vec![Input::State(0), Input::Alpha(0), Input::Alpha(1)];
        system.add_switch(switch, psi.finish(&[value]), inputs);
    }
    system
}

#[test]
fn relays_that_undo_each_other_end_the_run() {
    // The first is on above 1 and off where the second is on, which follows the first at once.
    let system = pair([-1.0, -0.6], [[1.0, -10.0], [1.0, 0.2]]);
    let mut simulator = Simulator::new(system.into(), Settings::default());
    let outcome = simulator.run(0.0, 2.0, &[0.0], &mut Times::default());
    let switches = vec![0, 1];
    assert_eq!(outcome.status, Status::Restless { switches });
    assert!((outcome.time - 1.0).abs() <= 1e-14);
}

#[test]
fn a_relay_makes_the_next_one_switch_at_the_same_instant() {
    let system = pair([-1.0, -0.6], [[0.5, 0.0], [1.0, 0.2]]);
    let mut times = Times::default();
    let outcome =
        Simulator::new(system.into(), Settings::default()).run(0.0, 2.0, &[0.0], &mut times);
    assert_eq!(
        (outcome.status, outcome.sides),
        (Status::Solved, vec![Side::Plus; 2])
    );
    assert_eq!(times.0.len(), 1);
    assert!((times.0[0] - 1.0).abs() <= 1e-14);
}
