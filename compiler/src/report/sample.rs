//! Small trajectories for the tests of this folder.

use super::*;

/// The unstable oscillator: crosses the unit circle at t = 1.
pub fn oscillator() -> Trajectory {
    let time = vec![0.0, 1.0, 1.5];
    let interval = |from, to, region: &str, side| ModeInterval {
        from,
        to,
        mode: region.into(),
        regions: vec![region.into()],
        between: Vec::new(),
        sides: vec![side],
        contacts: Vec::new(),
    };
    Trajectory {
        experiment: "crossing".into(),
        model: "oscillator".into(),
        status: Status::Solved,
        method: Method {
            name: "event".into(),
            options: vec![
                ("order".into(), MethodOption::Number(16.0)),
                ("tolerance".into(), MethodOption::Number(1e-10)),
            ],
        },
        parameters: vec![Series {
            name: "omega".into(),
            shape: vec![],
            values: vec![6.25],
        }],
        states: vec![Series {
            name: "x".into(),
            shape: vec![2],
            values: vec![0.36787944117144233, 0.0, 1.0, 0.0, -1.6487212707, 0.25],
        }],
        outputs: vec![Series {
            name: "c".into(),
            shape: vec![],
            values: vec![-0.8646647167633873, 0.0, 1.7807818284],
        }],
        time,
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
        error_estimate: Some(1e-11),
        stats: Stats {
            compile_s: 0.002,
            solve_s: 0.001,
            steps: 12,
            rhs_evaluations: 204,
            ..Stats::default()
        },
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
    let series = |name: &str, shape: &[usize], values: &[f64]| Series {
        name: name.into(),
        shape: shape.to_vec(),
        values: values.to_vec(),
    };
    Trajectory {
        experiment: "turn".into(),
        model: "body".into(),
        status: Status::Solved,
        time: vec![0.0, 1.0],
        states: vec![
            series("q", &[], &[1.5, 2.5]),
            series("R", &[2, 2], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        ],
        ..Trajectory::default()
    }
}
