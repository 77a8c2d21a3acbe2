//! Linear complementarity systems at random, most of whose multipliers are zero for a while.

use nalgebra::{DMatrix, DVector};

use super::{Case, Extent, Family};
use crate::random::Random;

/// Steps of the reference.
const STEPS: usize = 1500;

/// Members are not below zero by more than this, relative to what they may be.
const ROUNDING: f64 = 1e-12;

pub fn families(extent: Extent) -> Vec<Family> {
    let seeds = extent.sweep(&[20, 48], &(0..50).collect::<Vec<u64>>());
    let case = |m: usize, seed: u64| {
        let system = Linear::random(m, 1000 * m as u64 + seed);
        let (ends, scales) = system.integrate();
        let case = Case::new(m, system.text(), HORIZON);
        let known = (0..system.n()).fold(case, |case, i| {
            case.ends_each(&format!("x{i}"), &[ends[i]], &[scales[i]])
        });
        known.both()
    };
    let each = |m: usize| seeds.iter().flat_map(move |&seed| case(m, seed));
    vec![Family {
        name: "linear complementarity systems",
        about: "x' = Ax + Bz + waves, 0 ≤ z ⟂ Cx + Dz + q ≥ 0 with D + Dᵀ positive definite, D not symmetric: active \
                sets by enumeration, instants by bisection.",
        hardness: "pairs",
        cases: (1..=4).flat_map(each).collect(),
    }]
}

const HORIZON: f64 = 5.0;

/// x' = A x + B z + a sin(ω t + φ) and 0 ≤ z ⟂ C x + D z + q ≥ 0.
struct Linear {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    q: DVector<f64>,
    start: DVector<f64>,
    /// a, ω and φ of each state.
    waves: Vec<[f64; 3]>,
}

impl Linear {
    fn random(m: usize, seed: u64) -> Self {
        let mut random = Random(seed);
        let random = &mut random;
        let n = 2 + random.below(3);
        let mut matrix =
            |rows, columns| DMatrix::from_fn(rows, columns, |_, _| random.rounded(-1.0, 1.0));
        let (a, b, c) = (matrix(n, n), matrix(n, m), matrix(m, n));
        let (root, turn) = (matrix(m, m), matrix(m, m));
        let (q, start) = (matrix(m, 1), matrix(n, 1));
        let d = &root * root.transpose() + 0.5 * (&turn - turn.transpose());
        let wave = |_| {
            [
                random.rounded(0.0, 2.0),
                random.rounded(0.5, 4.0),
                random.rounded(0.0, 6.0),
            ]
        };
        Linear {
            a: a - DMatrix::identity(n, n),
            b,
            c,
            d: d + 0.3 * DMatrix::identity(m, m),
            q: q.column(0).into_owned(),
            start: start.column(0).into_owned(),
            waves: (0..n).map(wave).collect(),
        }
    }

    fn n(&self) -> usize {
        self.start.len()
    }

    fn m(&self) -> usize {
        self.q.len()
    }

    fn text(&self) -> String {
        let sum = |matrix: &DMatrix<f64>, row: usize, name: &str| {
            let entries = matrix.row(row);
            let terms = entries.iter().enumerate();
            let terms: Vec<String> = terms.map(|(k, v)| format!("({v:?})*{name}{k}")).collect();
            terms.join(" + ")
        };
        let states = (0..self.n()).map(|i| {
            let [size, frequency, phase] = self.waves[i];
            format!(
                "state x{i} = {:?}; x{i}' = {} + {} + {size:?}*sin({frequency:?}*time + {phase:?});",
                self.start[i],
                sum(&self.a, i, "x"),
                sum(&self.b, i, "z"),
            )
        });
        let pairs = (0..self.m()).map(|k| {
            format!(
                "algebraic z{k} = 0; 0 <= z{k} perp {} + {} + ({:?}) >= 0;",
                sum(&self.c, k, "x"),
                sum(&self.d, k, "z"),
                self.q[k],
            )
        });
        states.chain(pairs).collect::<Vec<String>>().join(" ")
    }

    /// x at the end, and the largest |x|: classical Runge-Kutta steps with one active set each, which end where it
    /// does.
    fn integrate(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut t, mut x) = (0.0, self.start.clone());
        let mut sizes = x.abs();
        let h = HORIZON / STEPS as f64;
        let mut active = self.next_active(t, &x);
        for k in 1..=STEPS {
            let end = h * k as f64;
            while t < end {
                let holds = |h: f64| {
                    let next = self.step(t, &x, h, &active);
                    self.holds(&next, &active).then_some(next)
                };
                if let Some(next) = holds(end - t) {
                    (t, x) = (end, next);
                    break;
                }
                let (mut low, mut high) = (0.0, end - t);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    match holds(middle) {
                        Some(_) => low = middle,
                        None => high = middle,
                    }
                }
                x = self.step(t, &x, high, &active);
                t += high;
                active = self.next_active(t, &x);
            }
            sizes.zip_apply(&x, |size, x| *size = size.max(x.abs()));
        }
        (x.as_slice().to_vec(), sizes.as_slice().to_vec())
    }

    /// The active set that holds behind a point.
    fn next_active(&self, t: f64, x: &DVector<f64>) -> Vec<bool> {
        let m = self.m();
        let mut sets =
            (0..1_usize << m).map(|bits| (0..m).map(|k| bits >> k & 1 == 1).collect::<Vec<bool>>());
        let goes_on = |set: &Vec<bool>| self.holds(&self.step(t, x, 1e-7, set), set);
        sets.find(goes_on)
            .expect("one set holds where D is positive definite")
    }

    fn step(&self, t: f64, x: &DVector<f64>, h: f64, active: &[bool]) -> DVector<f64> {
        let rate = |t: f64, x: &DVector<f64>| {
            let waves = self
                .waves
                .iter()
                .map(|[size, w, phase]| size * (w * t + phase).sin());
            let waves = DVector::from_iterator(self.n(), waves);
            &self.a * x + &self.b * self.multipliers(x, active) + waves
        };
        let k1 = rate(t, x);
        let k2 = rate(t + 0.5 * h, &(x + 0.5 * h * &k1));
        let k3 = rate(t + 0.5 * h, &(x + 0.5 * h * &k2));
        let k4 = rate(t + h, &(x + h * &k3));
        x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    }

    /// Neither a multiplier nor a row is negative.
    fn holds(&self, x: &DVector<f64>, active: &[bool]) -> bool {
        let z = self.multipliers(x, active);
        let rows = &self.c * x + &self.d * &z + &self.q;
        let least = -ROUNDING * (1.0 + x.amax());
        let mut members = z.iter().zip(rows.iter()).zip(active);
        members.all(|((z, row), active)| if *active { *z >= least } else { *row >= least })
    }

    /// z where these rows are zero, and the multipliers of all others.
    fn multipliers(&self, x: &DVector<f64>, active: &[bool]) -> DVector<f64> {
        let m = self.m();
        let entry = |i: usize, j: usize| match active[i] {
            true => self.d[(i, j)],
            false => f64::from(u8::from(i == j)),
        };
        let free = &self.c * x + &self.q;
        let rhs = DVector::from_fn(m, |i, _| if active[i] { -free[i] } else { 0.0 });
        let solved = DMatrix::from_fn(m, m, entry).lu().solve(&rhs);
        solved.expect("principal minors of D are positive")
    }
}
