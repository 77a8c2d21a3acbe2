//! Events that accumulate in finite time.

use super::{Case, Extent, Family};

pub fn families(extent: Extent) -> Vec<Family> {
    vec![bounces(extent), spirals(extent), fuller(extent)]
}

/// A ball that loses the share 1 - e of its speed, to its rest and beyond.
fn bounces(extent: Extent) -> Family {
    let case = |e: f64| {
        let model = format!(
            "state q = 1; state v = 0; state z = 0; q' = v; z' = q;
             mechanics q, v {{ mass = 2; force = -16; contact floor {{ gap = q; restitution = {e:?}; }} }}"
        );
        // g = 8: the fall takes 1/2, flight k takes e^k and rises to e^{2k}.
        let limit = 0.5 + e / (1.0 - e);
        // Two thirds of height and duration are below a parabola.
        let area = 1.0 / 3.0 + 2.0 / 3.0 * e.powi(3) / (1.0 - e.powi(3));
        let case = Case::new(e, model, limit + 1.0).ends("q", &[0.0], 1.0);
        let case = case.ends("v", &[0.0], 4.0).ends("z", &[area], area);
        let grid = case.clone().in_steps(2000);
        [case, grid]
    };
    Family {
        name: "bounces that accumulate",
        about: "A ball that bounces with restitution e until it rests; the area below its path, geometric series.",
        hardness: "e",
        cases: extent
            .sweep(
                &[0.1, 0.9],
                &[0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99, 0.999],
            )
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// |x| + |y| falls at the rate 2, around the origin in ever smaller turns.
fn spirals(extent: Extent) -> Family {
    let case = |k: f64| {
        let model = format!(
            "state x = 1; state y = 0.5; state z = 0;
             x' = -sign(x) + {k:?}*sign(y); y' = -{k:?}*sign(x) - sign(y); z' = sign(x);"
        );
        // sign(x) = -(x' + k y')/(1 + k²), integrated to the origin.
        let exact = (1.0 + 0.5 * k) / (1.0 + k * k);
        let case = Case::new(k, model, 2.0)
            .ends("x", &[0.0], 1.0)
            .ends("y", &[0.0], 1.0);
        case.ends("z", &[exact], exact.max(0.1))
            .accurate_if(false)
            .both()
    };
    Family {
        name: "spirals",
        about: "x' = -s_x + k s_y, y' = -k s_x - s_y: infinitely many crossings until t = (|x| + |y|)/2, then rest; \
                the integral of s_x from the equations.",
        hardness: "k",
        cases: extent
            .sweep(&[2.0, 20.0], &[1.5, 2.0, 5.0, 20.0, 100.0, 1000.0])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// x'' = -sign(x + c v |v|): flights shrink by √((1/2 - c)/(1/2 + c)).
fn fuller(extent: Extent) -> Family {
    let case = |c: f64| {
        let model = format!(
            "state x = 1; state v = 0; state z = 0; x' = v; v' = -sign(x + {c:?}*v*abs(v)); z' = x;"
        );
        let ratio = ((0.5 - c) / (0.5 + c)).sqrt();
        // From rest at 1 to the curve at the speed s with 1 - s²/2 = c s².
        let speed = (1.0 / (0.5 + c)).sqrt();
        let limit = speed + speed * (1.0 + ratio) / (1.0 - ratio);
        // A flight from c s² at the speed -s to -c (r s)²; the next one is r³ of it, on the other side.
        let length = speed * (1.0 + ratio);
        let flight =
            c * speed * speed * length - 0.5 * speed * length.powi(2) + length.powi(3) / 6.0;
        let area = speed - speed.powi(3) / 6.0 + flight / (1.0 + ratio.powi(3));
        let case = Case::new(c, model, limit + 0.5)
            .ends("x", &[0.0], 1.0)
            .ends("v", &[0.0], 1.0);
        case.ends("z", &[area], area).accurate_if(false).both()
    };
    Family {
        name: "Fuller's phenomenon",
        about: "x'' = -sign(x + c v |v|): switches accumulate at rest in the origin; the area, geometric series.",
        hardness: "c",
        cases: extent
            .sweep(&[0.25, 0.05], &[0.45, 0.25, 0.1, 0.05, 0.01])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}
