//! What is read is checked: bytes that are no tape, or no system, are refused.

use nsd_solver::hybrid::{HybridSystem, Input, Piecewise, Switch, SwitchKind};
use nsd_solver::tape::Tape;
use proptest::prelude::*;

/// x' = -sin(x) (1 - 2α) + r(t) on ψ = x², with data.
fn system() -> HybridSystem {
    let mut system = HybridSystem {
        data: vec![Piecewise::new(vec![0.0, 1.0], vec![1.0, 2.0, 3.0, 4.0]).into()],
        ..HybridSystem::default()
    };
    let mut tape = Tape::builder(4);
    let inputs = vec![
        Input::State(0),
        Input::Alpha(0),
        Input::Coefficient(0),
        Input::Number(0.5),
    ];
    let (sin, _) = tape.sin_cos(tape.input(0));
    let factor = tape.scale(-2.0, tape.input(1));
    let factor = tape.offset(1.0, factor);
    let pull = tape.mul(sin, factor);
    let sum = tape.sub(tape.input(2), pull);
    let rate = tape.mul(sum, tape.input(3));
    system.add_block(vec![0], tape.finish(&[rate]), inputs);
    let mut psi = Tape::builder(1);
    let square = psi.square(psi.input(0));
    system.add_switch(
        Switch::new(SwitchKind::Step),
        psi.finish(&[square]),
        vec![Input::State(0)],
    );
    system.switches[0].derivatives = 1..1;
    system
}

fn written(system: &HybridSystem) -> Vec<u8> {
    let mut bytes = Vec::new();
    ciborium::into_writer(system, &mut bytes).expect("it can be written");
    bytes
}

#[test]
fn what_is_written_is_read() {
    let bytes = written(&system());
    let read: HybridSystem = ciborium::from_reader(&bytes[..]).expect("it is a system");
    assert_eq!(written(&read), bytes);
}

type Change<'c> = &'c dyn Fn(&mut HybridSystem);

#[test]
fn what_is_missing_is_refused() {
    let refused = |change: Change| {
        let mut changed = system();
        change(&mut changed);
        let read: Result<HybridSystem, _> = ciborium::from_reader(&written(&changed)[..]);
        read.err()
            .map(|error| error.to_string())
            .expect("it is no system")
    };
    let cases: [(&str, Change); 7] = [
        ("every state", &|system| system.blocks[0].states[0] = 1),
        ("has its rates", &|system| system.rates.clear()),
        ("of a form", &|system| system.rates[0].form = 9),
        ("are there", &|system| {
            system.rates[0].inputs[1] = Input::Alpha(7)
        }),
        ("are there", &|system| {
            system.surfaces[0].inputs[0] = Input::State(3)
        }),
        ("refer to", &|system| system.switches[0].couplings = vec![4]),
        ("are there", &|system| system.data.clear()),
    ];
    for (says, change) in cases {
        let text = refused(change);
        assert!(text.contains(says), "{text}");
    }
}

proptest! {
    /// One byte is another one, or the rest is missing.
    #[test]
    fn damage_is_refused_or_harmless(at in any::<prop::sample::Index>(), byte: u8, cut: bool) {
        let mut bytes = written(&system());
        let at = at.index(bytes.len());
        bytes[at] = byte;
        if cut {
            bytes.truncate(at);
        }
        if let Ok(read) = ciborium::from_reader::<HybridSystem, _>(&bytes[..]) {
            prop_assert!(read.check().is_ok());
        }
    }
}
