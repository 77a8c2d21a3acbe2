//! Finite elements without a `.nsd` file: a complementarity system that is filled in by hand, against its closed form,
//! and what is refused where one is read.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Segment};
use nsd_solver::fesd::{
    ComplementaritySystem, Full, Kinds, Member, Observer, Pair, Rule, Rules, Settings, Simulator,
    Surfaces, Switch, Units,
};
use nsd_solver::hybrid::{Piecewise, Side, Status};
use nsd_solver::integrate::tableau::Family;
use nsd_solver::tape::Tape;

/// x' = r(t) - 2α, α ∈ step(x), r = 1.5 up to t = 1 and 1 behind:
///
/// z = (α, λᵖ, λⁿ),   0 = x - λᵖ + λⁿ,   0 ≤ α ⟂ λⁿ ≥ 0,   0 ≤ 1 - α ⟂ λᵖ ≥ 0
fn relay() -> ComplementaritySystem {
    // t, x, z, where the piece begins, r
    let mut b = Tape::builder(7);
    let rate = b.add_scaled(b.input(6), -2.0, b.input(2));
    let above = b.sub(b.input(1), b.input(3));
    let row = b.add(above, b.input(4));
    let equations = b.finish(&[rate, row]);
    let alphas = Tape::builder(7);
    let alpha = alphas.input(2);
    let continuous = vec![false, true, true];
    let kinds = Kinds {
        continuous: &continuous,
        determines_state: &[false],
        discs: &[],
    };
    let member = |variable: usize, complement: bool| Member {
        variable,
        complement,
    };
    let pair = |left: Member, right: Member| Pair {
        left,
        right,
        group: 0,
        is_bounded: true,
    };
    let psi = Tape::builder(5);
    let x = psi.input(1);
    ComplementaritySystem {
        full: Full::new(equations, alphas.finish(&[alpha]), kinds),
        continuous,
        algebraic_states: Vec::new(),
        pairs: vec![
            pair(member(0, false), member(2, false)),
            pair(member(0, true), member(1, false)),
        ],
        switches_of: vec![vec![0]; 2],
        discs: Vec::new(),
        switches: vec![Switch {
            is_nonlinear: false,
            member: None,
        }],
        surfaces: Surfaces {
            psi: psi.finish(&[x]),
            rules: Rules {
                compared: Vec::new(),
                z: vec![Rule::Alpha(0), Rule::Above(0), Rule::Below(0)],
            },
            units: Units::default(),
            gaps: Vec::new(),
            leading: Vec::new(),
        },
        followers: Vec::new(),
        data: vec![Piecewise::new(vec![0.0, 1.0], vec![1.5, 1.0]).into()],
        parameters: Vec::new(),
        stops: Vec::new(),
    }
}

/// The instants of events.
#[derive(Default)]
struct Seen(Vec<f64>);

impl nsd_solver::event::Observer for Seen {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.0.push(event.time);
    }
}

impl Observer for Seen {}

/// x = 1 - t/2 up to t = 1, then 3/2 - t, and zero from t = 3/2 on, where 1 - 2α = 0.
#[test]
fn a_relay_slides_from_where_it_comes_to_zero() {
    let system = relay();
    system.check().expect("it is one");
    let settings = Settings::new(Family::RadauIia, 3);
    let mut simulator = Simulator::new(&system, settings).expect("three nodes are allowed");
    let mut seen = Seen::default();
    let outcome = simulator.run(0.0, 2.0, &[1.0], &mut seen).outcome;
    assert_eq!(outcome.status, Status::Solved);
    assert!(
        seen.0.len() == 1 && (seen.0[0] - 1.5).abs() < 1e-13,
        "{:?}",
        seen.0
    );
    assert_eq!(outcome.sides, [Side::Slide]);
    assert!(outcome.x[0].abs() < 1e-15 && (outcome.alpha[0] - 0.5).abs() < 1e-15);
}

fn written(system: &ComplementaritySystem) -> Vec<u8> {
    let mut bytes = Vec::new();
    ciborium::into_writer(system, &mut bytes).expect("it can be written");
    bytes
}

#[test]
fn what_is_written_is_read() {
    let bytes = written(&relay());
    let read: ComplementaritySystem = ciborium::from_reader(&bytes[..]).expect("it is a system");
    assert_eq!(written(&read), bytes);
}

type Change<'c> = &'c dyn Fn(&mut ComplementaritySystem);

#[test]
fn what_is_missing_is_refused() {
    let cases: [(&str, Change); 8] = [
        ("as many functions", &|system| system.data.clear()),
        ("has its kind", &|system| system.continuous.truncate(2)),
        ("are states", &|system| system.algebraic_states = vec![1]),
        ("are among z", &|system| system.pairs[1].left.variable = 3),
        ("has its switches", &|system| {
            system.switches_of[0] = vec![1]
        }),
        ("have their pairs", &|system| {
            system.switches[0].member = Some((2, nsd_solver::fesd::Zero::Left));
        }),
        ("has its rule", &|system| {
            system.surfaces.rules.z[1] = Rule::Above(1);
        }),
        ("by their inputs", &|system| {
            system.full.slopes.entries[0].1 = 5;
        }),
    ];
    for (says, change) in cases {
        let mut changed = relay();
        change(&mut changed);
        let read: Result<ComplementaritySystem, _> = ciborium::from_reader(&written(&changed)[..]);
        let text = read.expect_err("it is no system").to_string();
        assert!(text.contains(says), "{text}");
    }
}
