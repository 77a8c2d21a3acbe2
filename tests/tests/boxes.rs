//! A box that is thrown on the floor in the plane, bounces on its corners and comes to rest on a side: what it ends with,
//! and what impacts must not do on the way.

use nsd_tests::{end, solved};
use nsdc::report::Trajectory;

struct Thrown {
    /// Of restitution.
    law: &'static str,
    /// Half of its sides.
    half: [f64; 2],
    inertia: f64,
    friction: f64,
    restitution: f64,
    angle: f64,
    speed: f64,
    turn: f64,
}

impl Thrown {
    fn run(&self) -> Trajectory {
        let Thrown {
            law,
            half: [a, b],
            inertia,
            friction,
            restitution,
            angle,
            speed,
            turn,
        } = *self;
        let corner = |name: &str, a: f64, b: f64| {
            let arm = format!("({a:?}*sin(q[3]) + {b:?}*cos(q[3]))");
            format!(
                "contact {name} {{
                   gap = q[2] + {arm};
                   slip = v[1] - {arm}*v[3];
                   restitution = {law}({restitution:?});
                   friction = {friction:?};
                 }}
                 output gap_{name} = q[2] + {arm};"
            )
        };
        let corners = [("c1", a, b), ("c2", a, -b), ("c3", -a, b), ("c4", -a, -b)];
        let texts = corners.map(|(name, a, b)| corner(name, a, b));
        let (contacts, outputs): (Vec<_>, Vec<_>) = (texts.iter())
            .filter_map(|text| text.split_once("output"))
            .unzip();
        let outputs: Vec<_> = outputs.iter().map(|text| format!("output{text}")).collect();
        let text = format!(
            "model box {{
               state q[3] = [0, 1, {angle:?}];
               state v[3] = [{speed:?}, 0, {turn:?}];
               q' = v;
               mechanics q, v {{
                 mass = diag([1, 1, {inertia:?}]);
                 force = [0, -9.81, 0];
                 {}
               }}
               {}
               output energy = (v[1]^2 + v[2]^2 + {inertia:?}*v[3]^2)/2 + 9.81*q[2];
             }}
             simulate this of box {{ horizon 6; }}",
            contacts.concat(),
            outputs.concat()
        );
        solved(&text, "this")
    }

    fn check(&self) {
        let run = self.run();
        let values = |name: &str| {
            let output = run
                .samples
                .outputs
                .iter()
                .find(|output| output.name == name);
            &output.expect("the model has it").values
        };
        for corner in ["gap_c1", "gap_c2", "gap_c3", "gap_c4"] {
            let depth = values(corner).iter().fold(0.0, |d: f64, gap| d.max(-gap));
            assert!(depth <= 1e-9, "{corner} is {depth} deep");
        }
        // With friction, Newton's law of restitution may add energy (W0712), and Poisson's may not.
        let is_warned = run.warnings.iter().any(|w| w.code == "W0712");
        assert!(self.law == "newton" || !is_warned, "{:?}", run.warnings);
        let energy = values("energy");
        let gained = energy.windows(2).map(|e| e[1] - e[0]).fold(0.0, f64::max);
        assert!(gained <= 1e-7 || is_warned, "gains {gained}");

        // It lies on one of its sides, and has its speed along the floor where nothing takes that away.
        let (q, v) = (end(&run, "q"), end(&run, "v"));
        let [a, b] = self.half;
        let lies = |height: f64| (q[1] - height).abs() <= 1e-9;
        assert!(lies(a) || lies(b), "it is at {}", q[1]);
        let along = if self.friction > 0.0 { 0.0 } else { self.speed };
        let slides = (v[0] - along).abs();
        assert!(
            slides <= 1e-9 && v[1].abs() <= 1e-9 && v[2].abs() <= 1e-9,
            "{v:?}"
        );
    }
}

fn thrown(numbers: [f64; 8]) -> Thrown {
    let [a, b, inertia, friction, restitution, angle, speed, turn] = numbers;
    Thrown {
        law: "newton",
        half: [a, b],
        inertia,
        friction,
        restitution,
        angle,
        speed,
        turn,
    }
}

/// Both corners of a side bounce together at the end, without friction, by little more than their gaps are known to.
#[test]
fn it_falls_on_a_side_and_bounces_on_both_corners() {
    for numbers in [
        [0.301, 0.35, 0.196, 0.0, 0.3, -0.21, 0.85, 3.07],
        [0.168, 0.298, 0.039, 0.0, 0.7, -2.56, 1.46, 2.3],
        [0.139, 0.188, 0.164, 0.0, 0.3, -2.36, -0.6, -2.61],
        [0.323, 0.099, 0.151, 0.0, 0.3, 1.98, 0.11, 3.83],
        [0.25, 0.2, 0.05, 0.0, 0.5, 0.0, 3.0, 0.0],
    ] {
        thrown(numbers).check();
    }
}

/// One corner stops bouncing while another one has it slip: what was at rest there is so no more.
#[test]
fn it_rattles_to_rest_on_a_rough_floor() {
    for numbers in [
        [0.138, 0.421, 0.075, 0.3, 0.7, 0.11, 1.68, 0.07],
        [0.183, 0.249, 0.073, 0.1, 0.7, 2.94, -1.14, -1.82],
        [0.528, 0.23, 0.034, 0.3, 0.7, -0.5, 0.84, -0.45],
        [0.31, 0.416, 0.136, 0.3, 0.7, -2.15, 0.38, 0.51],
        [0.493, 0.306, 0.054, 0.3, 0.7, 0.16, -1.96, 2.76],
        [0.583, 0.152, 0.043, 0.6, 0.7, 0.73, 0.91, -2.91],
        [0.23, 0.239, 0.044, 0.3, 0.7, 0.97, 1.26, 0.13],
        [0.322, 0.341, 0.097, 0.1, 0.7, -1.87, -1.85, -1.97],
        [0.172, 0.314, 0.091, 0.3, 0.3, 0.78, -1.66, 3.66],
        // On its side, sin and cos of its angle are such that terms of a gap change alike.
        [0.26, 0.229, 0.108, 0.1, 0.3, 0.36, 0.5, 3.72],
    ] {
        thrown(numbers).check();
        Thrown {
            law: "poisson",
            ..thrown(numbers)
        }
        .check();
    }
}
