//! Systems with surfaces on the coordinate planes: x' = c + d t + Lx + Bα, ψ_i = x_i.

use std::ops::ControlFlow;

use proptest::prelude::*;

use super::{Event, Observer, Segment, Simulator};
use crate::hybrid::{
    Block, HybridSystem, Input, Outcome, Settings, Side, Status, Switch, SwitchKind,
};
use crate::tape::Tape;

struct Planes {
    n: usize,
    m: usize,
    c: Vec<f64>,
    d: Vec<f64>,
    l: Vec<f64>,
    b: Vec<f64>,
    /// One block of everything, or a block for every state.
    blocks: Vec<Block>,
    /// Surfaces that each surface's rate depends on.
    couplings: Vec<Vec<usize>>,
}

impl Planes {
    /// x' = c + Bα with as many surfaces as states.
    fn relays(c: &[f64], b: &[f64]) -> Self {
        let n = c.len();
        Planes::new(n, c, &vec![0.0; n], &vec![0.0; n * n], b)
    }

    /// The first `m` coordinate planes are surfaces.
    fn new(m: usize, c: &[f64], d: &[f64], l: &[f64], b: &[f64]) -> Self {
        let occurring = |row: usize| (0..m).filter(|i| b[row * m + i] != 0.0).collect();
        let n = c.len();
        Planes {
            n,
            m,
            c: c.to_vec(),
            d: d.to_vec(),
            l: l.to_vec(),
            b: b.to_vec(),
            blocks: vec![Block {
                states: (0..n).collect(),
                switches: (0..m).collect(),
            }],
            couplings: (0..m).map(occurring).collect(),
        }
    }

    /// The same system, cut into one block for every state.
    fn cut(mut self) -> Self {
        let (m, b) = (self.m, &self.b);
        let occurring = |row: usize| (0..m).filter(move |i| b[row * m + i] != 0.0);
        let block = |row: usize| Block {
            states: vec![row],
            switches: occurring(row).collect(),
        };
        self.blocks = (0..self.n).map(block).collect();
        self
    }

    fn run(&self, t1: f64, x0: &[f64], settings: Settings) -> (Outcome, Vec<f64>) {
        let mut times = Times::default();
        let outcome = Simulator::new(self.system().into(), settings).run(0.0, t1, x0, &mut times);
        (outcome, times.0)
    }
}

impl Planes {
    fn system(&self) -> HybridSystem {
        let mut system = HybridSystem::default();
        for Block { states, switches } in &self.blocks {
            let (rates, inputs) = self.rates(states, switches);
            system.add_block(states.clone(), rates, inputs);
        }
        for (i, couplings) in self.couplings.iter().enumerate() {
            let mut switch = Switch::new(SwitchKind::Step);
            switch.couplings.clone_from(couplings);
            let plane = Tape::builder(1);
            let coordinate = plane.input(0);
            system.add_switch(switch, plane.finish(&[coordinate]), vec![Input::State(i)]);
        }
        system
    }

    fn rates(&self, states: &[usize], switches: &[usize]) -> (Tape, Vec<Input>) {
        let mut inputs = vec![Input::Time];
        inputs.extend((0..self.n).map(Input::State));
        inputs.extend(switches.iter().map(|&i| Input::Alpha(i)));
        let mut tape = Tape::builder(inputs.len());
        let mut rate = |row: &usize| {
            let mut sum = tape.constant(self.c[*row]);
            sum = tape.add_scaled(sum, self.d[*row], tape.input(0));
            for k in 0..self.n {
                sum = tape.add_scaled(sum, self.l[row * self.n + k], tape.input(1 + k));
            }
            for (at, i) in switches.iter().enumerate() {
                let b = self.b[row * self.m + i];
                sum = tape.add_scaled(sum, b, tape.input(1 + self.n + at));
            }
            sum
        };
        let rates: Vec<_> = states.iter().map(&mut rate).collect();
        (tape.finish(&rates), inputs)
    }
}

#[derive(Default)]
pub(crate) struct Times(pub(crate) Vec<f64>);

impl Observer for Times {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.0.push(event.time);
    }
}

fn assert_close(found: &[f64], exact: &[f64], tolerance: f64) {
    assert_eq!(found.len(), exact.len(), "{found:?} and {exact:?}");
    for (found, exact) in found.iter().zip(exact) {
        assert!((found - exact).abs() <= tolerance, "{found} is not {exact}");
    }
}

#[test]
fn crosses_where_both_sides_agree() {
    // x' = 3 below, 1 above.
    let (outcome, times) = Planes::relays(&[3.0], &[-2.0]).run(1.0, &[-1.0], Settings::default());
    assert_eq!(
        (outcome.status, outcome.sides),
        (Status::Solved, vec![Side::Plus])
    );
    assert_close(&times, &[1.0 / 3.0], 1e-15);
    assert_close(&outcome.x, &[2.0 / 3.0], 1e-15);
}

#[test]
fn slides_and_leaves_where_alpha_reaches_its_bound() {
    // x' = 1 + t - 2α from 0: slides with α = (1 + t)/2 until t = 1, then x = (t - 1)²/2.
    let system = Planes::new(1, &[1.0], &[1.0], &[0.0], &[-2.0]);
    let (outcome, times) = system.run(2.0, &[0.0], Settings::default());
    assert_eq!(
        (outcome.status, outcome.sides),
        (Status::Solved, vec![Side::Plus])
    );
    assert_close(&times, &[1.0], 1e-14);
    assert_close(&outcome.x, &[0.5], 1e-14);
}

#[test]
fn names_all_solutions_of_a_repelling_surface_and_takes_the_one_asked_for() {
    let system = Planes::relays(&[-1.0], &[2.0]);
    let (outcome, _) = system.run(1.0, &[0.0], Settings::default());
    let Status::NonUnique(candidates) = outcome.status else {
        panic!("{:?}", outcome.status)
    };
    assert_eq!(candidates.len(), 3);
    for (side, end) in [(Side::Plus, 1.0), (Side::Minus, -1.0), (Side::Slide, 0.0)] {
        let (outcome, _) = system.run(
            1.0,
            &[0.0],
            Settings {
                branch: vec![side],
                ..Settings::default()
            },
        );
        assert_eq!(outcome.status, Status::Solved);
        assert_close(&outcome.x, &[end], 1e-14);
    }
}

/// x₂ = 1 - t, x₁' = -2 x₂ for x₁ > 0: x₁ = (1 - t)² touches zero at t = 1 and turns back. Below,
/// x₁' is larger by `push`.
fn graze(push: f64) -> Planes {
    let l = [0.0, -2.0, 0.0, 0.0];
    Planes::new(1, &[push, -1.0], &[0.0; 2], &l, &[-push, 0.0])
}

#[test]
fn a_graze_stays_on_its_side() {
    let (outcome, times) = graze(0.25).run(2.0, &[1.0, 1.0], Settings::default());
    assert_eq!(outcome.status, Status::Solved);
    assert_close(&times, &[], 0.0);
    assert_close(&outcome.x, &[1.0, -1.0], 1e-12);
}

#[test]
fn a_graze_of_a_surface_that_could_be_left_is_not_unique() {
    let (outcome, _) = graze(-0.25).run(2.0, &[1.0, 1.0], Settings::default());
    let Status::NonUnique(candidates) = outcome.status else {
        panic!("{:?}", outcome.status)
    };
    // It could also slide: α = 1 at the point, and falls.
    assert_eq!(
        candidates,
        [[(0, Side::Plus)], [(0, Side::Minus)], [(0, Side::Slide)]]
    );
}

#[test]
fn arrives_at_eight_surfaces_at_once() {
    // x_i' = 1 - 2α_i + 0.2 (α_{i+1} - α_{i-1}) from -0.5 each: all reach zero together and slide.
    let m = 8;
    let mut b = vec![0.0; m * m];
    for i in 0..m {
        b[i * m + i] = -2.0;
        if i + 1 < m {
            b[i * m + i + 1] = 0.2;
            b[(i + 1) * m + i] = -0.2;
        }
    }
    let (outcome, times) =
        Planes::relays(&vec![1.0; m], &b).run(1.0, &vec![-0.5; m], Settings::default());
    assert_eq!(
        (outcome.status, outcome.sides),
        (Status::Solved, vec![Side::Slide; m])
    );
    assert_close(&times, &[0.5], 1e-14);
    assert_close(&outcome.x, &vec![0.0; m], 1e-14);
}

#[test]
fn the_spiral_comes_to_rest() {
    // Filippov's spiral circles the origin infinitely often and rests there from t = 1/2 on.
    let system = Planes::relays(&[-1.0, 3.0], &[-2.0, 4.0, -4.0, -2.0]);
    let (outcome, _) = system.run(1.0, &[0.0, 1.0], Settings::default());
    assert_eq!(
        (outcome.status, outcome.sides),
        (Status::Solved, vec![Side::Slide; 2])
    );
    assert_close(&outcome.x, &[0.0, 0.0], 1e-12);
}

#[test]
fn a_relay_on_position_is_refused_with_its_surface() {
    // x₁' = x₂, x₂' = 1 - 2α with ψ = x₁: α shows only in the second derivative.
    let l = [0.0, 1.0, 0.0, 0.0];
    let system = Planes::new(1, &[0.0, 1.0], &[0.0; 2], &l, &[0.0, -2.0]);
    let (outcome, _) = system.run(1.0, &[0.0, 0.0], Settings::default());
    assert_eq!(outcome.status, Status::Undetermined { switches: vec![0] });
}

#[test]
fn limits_and_rates_that_are_no_numbers_end_in_a_status() {
    let system = Planes::relays(&[3.0], &[-2.0]);
    let (outcome, _) = system.run(
        1.0,
        &[-1.0],
        Settings {
            max_steps: 1,
            ..Settings::default()
        },
    );
    assert_eq!(outcome.status, Status::StepLimit);
    let (outcome, _) = system.run(
        1.0,
        &[-1.0],
        Settings {
            max_events: 0,
            ..Settings::default()
        },
    );
    assert_eq!(outcome.status, Status::EventLimit);
    let (outcome, _) = Planes::relays(&[f64::NAN], &[0.0]).run(1.0, &[1.0], Settings::default());
    assert_eq!(outcome.status, Status::NotFinite);
}

/// A system on the first surfaces of a larger one, which slides on the others and hardly couples.
fn embedded(small: &Planes, others: usize) -> Planes {
    let (k, n) = (small.n, small.n + others);
    let (mut c, mut b) = (vec![0.3; n], vec![0.0; n * n]);
    c[..k].copy_from_slice(&small.c);
    for i in 0..n {
        for j in 0..n {
            b[i * n + j] = match (i < k, j < k) {
                (true, true) => small.b[i * k + j],
                _ if i == j => -1.0,
                // Enough to make one group of all.
                _ if i == k || j + 1 == k => 1e-13,
                _ if i == j + 1 => 0.01,
                _ => 0.0,
            };
        }
    }
    Planes::relays(&c, &b)
}

proptest! {
    /// Trying all sides and Lemke's method with its search agree on how many solutions there are,
    /// which is odd, and on the solution where there is one.
    #[test]
    fn all_solutions_are_found_beyond_enumeration(b in prop::collection::vec(-1.0..1.0_f64, 9), c in prop::collection::vec(-1.0..1.0_f64, 3)) {
        let small = Planes::relays(&c, &b);
        let (few, _) = small.run(0.01, &[0.0; 3], Settings::default());
        let (many, _) = embedded(&small, 7).run(0.01, &[0.0; 10], Settings::default());
        match (few.status, many.status) {
            (Status::Solved, Status::Solved) => assert_close(&many.x[..3], &few.x, 1e-10),
            (Status::NonUnique(few), Status::NonUnique(many)) => {
                prop_assert_eq!(few.len(), many.len());
                prop_assert_eq!(few.len() % 2, 1);
            }
            (few, many) => prop_assert!(false, "{:?} and {:?}", few, many),
        }
    }
}

#[test]
fn seven_repelling_surfaces_are_not_left_in_silence() {
    let m = 7;
    let b: Vec<f64> = (0..m * m)
        .map(|at| if at % (m + 1) == 0 { 2.0 } else { 0.1 })
        .collect();
    let (outcome, _) =
        Planes::relays(&vec![-1.3; m], &b).run(1.0, &vec![0.0; m], Settings::default());
    assert!(
        matches!(outcome.status, Status::NonUnique(_)),
        "{:?}",
        outcome.status
    );
}

/// Three repelling relays that do not interact: one side for all, or one for each.
#[test]
fn a_branch_is_chosen_for_every_surface_that_meets() {
    let b = [2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0];
    let system = Planes::relays(&[-1.0; 3], &b);
    let run = |branch: &[Side]| {
        let settings = Settings {
            branch: branch.to_vec(),
            ..Settings::default()
        };
        system.run(1.0, &[0.0; 3], settings).0
    };
    assert_close(&run(&[Side::Plus]).x, &[1.0; 3], 1e-14);
    let mixed = [Side::Minus, Side::Slide, Side::Plus];
    assert_close(&run(&mixed).x, &[-1.0, 0.0, 1.0], 1e-14);
    let status = run(&mixed[..2]).status;
    assert!(matches!(status, Status::NonUnique(_)), "{status:?}");
}

proptest! {
    /// Cut into blocks, a system does the same as in one piece, switch by switch.
    #[test]
    fn blocks_do_the_same_as_one_piece(
        b in prop::collection::vec(prop_oneof![Just(0.0), -2.0..0.5_f64], 16),
        l in prop::collection::vec(-1.0..1.0_f64, 25),
        c in prop::collection::vec(-1.0..1.0_f64, 5),
        x0 in prop::collection::vec(-0.5..0.5_f64, 5),
    ) {
        let mut coefficients = vec![0.3; 20];
        for row in 0..4 {
            coefficients[4 * row..4 * row + 4].copy_from_slice(&b[4 * row..4 * row + 4]);
            coefficients[5 * row] = -1.5;
        }
        let build = || Planes::new(4, &c, &[0.2; 5], &l, &coefficients);
        let (whole, times) = build().run(2.0, &x0, Settings::default());
        let (cut, times_cut) = build().cut().run(2.0, &x0, Settings::default());
        prop_assert_eq!(whole.status, cut.status);
        prop_assert_eq!(whole.sides, cut.sides);
        assert_close(&times_cut, &times, 1e-9);
        assert_close(&cut.x, &whole.x, 1e-9);
    }
}

/// The most terms of the series of a step.
#[derive(Default)]
struct Degree(usize);

impl Observer for Degree {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.0 = self.0.max(segment.polynomials().degree());
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

/// x'' = 3 + t below x = 0 and 1 + t above are polynomials of degree 3 in time, whose series end there; with friction they
/// are none.
#[test]
fn series_of_polynomials_end() {
    let run = |friction: f64| {
        let l = [0.0, 1.0, 0.0, -friction];
        let planes = Planes::new(1, &[0.0, 3.0], &[0.0, 1.0], &l, &[0.0, -2.0]);
        let mut simulator = Simulator::new(planes.system().into(), Settings::default());
        let mut degree = Degree::default();
        let outcome = simulator.run(0.0, 2.0, &[-5.0 / 3.0, 0.0], &mut degree);
        assert_eq!(outcome.status, Status::Solved);
        (outcome.x, degree.0, simulator.order())
    };
    let (x, degree, order) = run(0.0);
    // It crosses at t = 1 with a speed of 7/2.
    assert_close(&x, &[7.0 / 2.0 + 0.5 + 2.0 / 3.0, 3.5 + 1.0 + 1.5], 1e-14);
    assert!(degree < 8 && degree < order, "{degree}");
    assert_eq!(run(0.5).1, order);
}

#[test]
fn the_jacobian_is_that_of_the_linear_part() {
    let l = [0.5, -2.0, 0.0, 3.0];
    let planes = Planes::new(2, &[1.0, -1.0], &[0.0; 2], &l, &[-2.0, 0.0, 0.0, -1.0]);
    let mut simulator = Simulator::new(planes.cut().system().into(), Settings::default());
    let sides = [Side::Plus, Side::Slide];
    let mut found = [0.0; 4];
    simulator.jacobian(0.0, &[1.0, 0.0], &sides, &[1.0, 0.5], |row, col, value| {
        found[2 * row + col] += value;
    });
    assert_eq!(found, l);
}
