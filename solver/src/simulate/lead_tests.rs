//! Relays that watch each other, which no model file can write.

use std::sync::Arc;

use super::tests::Times;
use super::{
    Affine, Block, Partials, Rates, Settings, Side, Simulator, Status, Surface, SwitchedSystem,
};
use crate::tape::Tape;

/// x' = 1, ψ = c + (x, 0) + Bα with own terms on the diagonal: two relays.
struct Pair {
    c: [f64; 2],
    b: [[f64; 2]; 2],
    blocks: [Block; 1],
}

impl Pair {
    fn new(c: [f64; 2], b: [[f64; 2]; 2]) -> Self {
        let (states, switches) = (vec![0], vec![]);
        let blocks = [Block { states, switches }];
        Pair { c, b, blocks }
    }
}

impl SwitchedSystem for Pair {
    fn n_states(&self) -> usize {
        1
    }

    fn n_switches(&self) -> usize {
        2
    }

    fn is_continuous(&self, _: usize) -> bool {
        false
    }

    fn relay(&self, _: usize) -> Option<Side> {
        Some(Side::Minus)
    }

    fn couplings(&self, _: usize) -> &[usize] {
        &[]
    }

    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    fn inside(&self, _: usize) -> &[usize] {
        &[0, 1]
    }

    fn rates(&self, _: usize, _: &[Side]) -> Rates {
        let mut tape = Tape::builder(0);
        let one = tape.constant(1.0);
        Rates {
            inputs: vec![],
            field: Arc::new(tape.finish(&[one])),
            by_alpha: Arc::new(Partials::none(0)),
        }
    }

    fn surface(&self, switch: usize, sides: &[Side]) -> Surface {
        let terms = self.b[switch].iter().zip(sides);
        let jump: f64 = terms.map(|(b, side)| b * (0.5 + 0.5 * side.sign())).sum();
        Surface::Affine(Affine {
            terms: vec![(0, if switch == 0 { 1.0 } else { 0.0 })],
            time: 0.0,
            constant: self.c[switch] + jump,
        })
    }

    fn jacobian(&self, _: usize, _: &[Side]) -> Arc<Partials> {
        Arc::new(Partials::none(0))
    }
}

#[test]
fn relays_that_undo_each_other_end_the_run() {
    // The first is on above 1 and off where the second is on, which follows the first at once.
    let system = Pair::new([-1.0, -0.6], [[1.0, -10.0], [1.0, 0.2]]);
    let mut simulator = Simulator::new(&system, Settings::default());
    let outcome = simulator.run(0.0, 2.0, &[0.0], &mut Times::default());
    let switches = vec![0, 1];
    assert_eq!(outcome.status, Status::Restless { switches });
    assert!((outcome.time - 1.0).abs() <= 1e-14);
}

#[test]
fn a_relay_makes_the_next_one_switch_at_the_same_instant() {
    let system = Pair::new([-1.0, -0.6], [[0.5, 0.0], [1.0, 0.2]]);
    let mut times = Times::default();
    let outcome = Simulator::new(&system, Settings::default()).run(0.0, 2.0, &[0.0], &mut times);
    assert_eq!(
        (outcome.status, outcome.sides),
        (Status::Solved, vec![Side::Plus; 2])
    );
    assert_eq!(times.0.len(), 1);
    assert!((times.0[0] - 1.0).abs() <= 1e-14);
}
