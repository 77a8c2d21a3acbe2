//! Small trajectories for the tests of this folder.

use super::*;

fn series(name: &str, shape: &[usize], values: &[f64]) -> Series {
    Series {
        name: name.into(),
        shape: shape.to_vec(),
        values: values.to_vec(),
    }
}

/// The unstable oscillator: crosses the unit circle at t = 1.
pub fn oscillator() -> Trajectory {
    let time = vec![0.0, 1.0, 1.5];
    let x = [0.36787944117144233, 0.0, 1.0, 0.0, -1.6487212707, 0.25];
    let interval = |from, to, region: &str, side| ModeInterval {
        from,
        to,
        mode: region.into(),
        regions: vec![region.into()],
        between: Vec::new(),
        sides: vec![side],
        contacts: Vec::new(),
    };
    let setup = Setup {
        experiment: "crossing".into(),
        model: "oscillator".into(),
        method: Method {
            name: "event".into(),
            options: vec![
                ("order".into(), MethodOption::Number(16.0)),
                ("tolerance".into(), MethodOption::Number(1e-10)),
            ],
        },
        parameters: vec![series("omega", &[], &[6.25])],
        ..Setup::default()
    };
    let samples = Samples {
        states: vec![series("x", &[2], &x)],
        outputs: vec![series("c", &[], &[-0.8646647167633873, 0.0, 1.7807818284])],
        time,
        ..Samples::default()
    };
    let history = History {
        events: vec![Event {
            time: 1.0,
            kind: EventKind::Crossing,
            surface: "c".into(),
            from: "inside".into(),
            to: "outside".into(),
            span: None,
            sliding: Vec::new(),
        }],
        modes: vec![
            interval(0.0, 1.0, "inside", Side::Below),
            interval(1.0, 1.5, "outside", Side::Above),
        ],
        switches: vec!["c".into()],
        ..History::default()
    };
    let quality = Quality {
        error_estimate: Some(1e-11),
        stats: Stats {
            compile_s: 0.002,
            solve_s: 0.001,
            steps: 12,
            rhs_evaluations: 204,
            ..Stats::default()
        },
        ..Quality::default()
    };
    Trajectory {
        setup,
        status: Status::Solved,
        samples: samples.into(),
        history,
        quality,
        warnings: vec![Warning {
            code: "W0501".into(),
            message: "a bound was left".into(),
            span: None,
        }],
        ..Trajectory::default()
    }
}

/// A scalar and a matrix state, at two instants.
pub fn shapes() -> Trajectory {
    let setup = Setup {
        experiment: "turn".into(),
        model: "body".into(),
        ..Setup::default()
    };
    let samples = Samples {
        time: vec![0.0, 1.0],
        states: vec![
            series("q", &[], &[1.5, 2.5]),
            series("R", &[2, 2], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        ],
        ..Samples::default()
    };
    Trajectory {
        setup,
        status: Status::Solved,
        samples: samples.into(),
        ..Trajectory::default()
    }
}
