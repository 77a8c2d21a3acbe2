//! Programs with boxes, rows and balls at random, whose active sets change in time.

use nalgebra::{DMatrix, DVector};

use super::{Case, Extent, Family};
use crate::random::Random;

/// Steps of the reference.
const STEPS: usize = 1500;

/// Multipliers and rows are not below zero by more than this.
const ROUNDING: f64 = 1e-12;

pub fn families(extent: Extent) -> Vec<Family> {
    vec![
        of_kind(extent, Kind::Argmin),
        of_kind(extent, Kind::Variational),
    ]
}

/// What z solves.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Argmin,
    Variational,
}

fn of_kind(extent: Extent, kind: Kind) -> Family {
    let seeds = extent.sweep(&[0, 1], &(0..70).collect::<Vec<u64>>());
    let case = |n: usize, seed: u64| {
        let program = Program::random(kind, n, 1000 * n as u64 + seed);
        let (end, size) = program.integrate();
        let case = Case::new(n, program.text(), program.horizon).ends("y", &[end], size);
        match seed % 5 {
            0 => case.both().to_vec(),
            _ => vec![case],
        }
    };
    let each = |n: usize| seeds.iter().flat_map(move |&seed| case(n, seed));
    let (name, about) = match kind {
        Kind::Argmin => (
            "programs with boxes and rows",
            "z minimizes zᵀQz/2 - u(t, y)ᵀz in boxes, rows that move and balls, y' = c·z - y/2: active sets by \
             enumeration, instants by bisection.",
        ),
        Kind::Variational => (
            "variational inequalities with boxes and rows",
            "The same for the map Mz - u(t, y), M + Mᵀ positive definite and M not symmetric.",
        ),
    };
    Family {
        name,
        about,
        hardness: "entries of z",
        cases: (1..=4).flat_map(each).collect(),
    }
}

/// m + a sin(ω t + φ)
#[derive(Clone, Copy)]
struct Wave {
    mean: f64,
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Wave {
    fn random(random: &mut Random, mean: [f64; 2], amplitude: [f64; 2]) -> Self {
        Wave {
            mean: random.within(mean[0], mean[1]),
            amplitude: random.within(amplitude[0], amplitude[1]),
            frequency: random.within(0.3, 3.0),
            phase: random.within(-3.0, 3.0),
        }
    }

    fn at(&self, t: f64) -> f64 {
        self.mean + self.amplitude * (self.frequency * t + self.phase).sin()
    }

    fn text(&self) -> String {
        let Wave {
            mean,
            amplitude,
            frequency,
            phase,
        } = self;
        match *amplitude {
            0.0 => format!("({mean:?})"),
            _ => format!("({mean:?} + {amplitude:?}*sin({frequency:?}*time + {phase:?}))"),
        }
    }
}

/// a·z ≥ b(t)
struct Row {
    normal: Vec<f64>,
    bound: Wave,
}

/// M z - u(t, y) over rows and a ball, and y' = c·z - y/2.
struct Program {
    kind: Kind,
    horizon: f64,
    matrix: DMatrix<f64>,
    load: Vec<Wave>,
    /// ∂u/∂y
    gain: Vec<f64>,
    rows: Vec<Row>,
    radius: Option<f64>,
    output: Vec<f64>,
}

/// Where the program is looked at.
#[derive(Clone, Copy)]
struct Place {
    t: f64,
    y: f64,
}

/// z with the multipliers of all rows, that of the ball last.
struct Point {
    z: DVector<f64>,
    multipliers: Vec<f64>,
}

impl Program {
    /// The origin is inside of all rows.
    fn random(kind: Kind, n: usize, seed: u64) -> Self {
        let mut random = Random(seed);
        let random = &mut random;
        let root = DMatrix::from_fn(n, n, |_, _| random.within(-1.0, 1.0));
        let mut matrix = &root * root.transpose();
        for i in 0..n {
            matrix[(i, i)] += random.within(0.3, 1.0);
            for j in (0..i).filter(|_| kind == Kind::Variational) {
                let turn = random.within(-1.5, 1.5);
                matrix[(i, j)] += turn;
                matrix[(j, i)] -= turn;
            }
        }
        let load = (0..n).map(|_| Wave::random(random, [-0.4, 0.4], [0.8, 2.0]));
        let load = load.collect();
        let gain = (0..n).map(|_| random.within(-0.5, 0.5)).collect();
        let mut rows = Vec::new();
        for k in 0..n {
            for sign in [1.0, -1.0] {
                if random.below(4) > 0 || n == 1 {
                    let mut normal = vec![0.0; n];
                    normal[k] = sign;
                    let bound = Wave::random(random, [-1.0, -0.3], [0.0, 0.0]);
                    rows.push(Row { normal, bound });
                }
            }
        }
        for _ in 0..random.below(3).min(n - 1) {
            let normal = (0..n).map(|_| random.within(-1.0, 1.0)).collect();
            let bound = Wave::random(random, [-0.9, -0.3], [0.0, 0.15]);
            rows.push(Row { normal, bound });
        }
        let has_ball = n > 1 && (random.below(3) == 0 || rows.is_empty());
        Program {
            kind,
            horizon: 6.0,
            matrix,
            load,
            gain,
            rows,
            radius: has_ball.then(|| random.within(0.4, 1.4)),
            output: (0..n).map(|_| random.within(0.3, 1.0)).collect(),
        }
    }

    fn n(&self) -> usize {
        self.load.len()
    }

    fn entry(&self, k: usize) -> String {
        match self.n() {
            1 => "z".to_owned(),
            _ => format!("z[{}]", k + 1),
        }
    }

    /// Σ a_k z_k
    fn sum(&self, factors: impl Iterator<Item = f64>) -> String {
        let terms = factors.enumerate().filter(|(_, a)| *a != 0.0);
        let terms: Vec<String> = terms
            .map(|(k, a)| format!("({a:?})*{}", self.entry(k)))
            .collect();
        terms.join(" + ")
    }

    fn text(&self) -> String {
        let n = self.n();
        let load = |k: usize| format!("({} + ({:?})*y)", self.load[k].text(), self.gain[k]);
        let mut rows: Vec<String> = (self.rows.iter())
            .map(|row| {
                let value = self.sum(row.normal.iter().copied());
                format!("{value} >= {};", row.bound.text())
            })
            .collect();
        rows.extend(self.radius.map(|radius| format!("norm(z) <= {radius:?};")));
        let rows = rows.join(" ");
        let map = (0..n).map(|i| {
            let of_z = self.sum(self.matrix.row(i).iter().copied());
            format!("{of_z} - {}", load(i))
        });
        let declared = match n {
            1 => "z".to_owned(),
            _ => format!("z[{n}]"),
        };
        let program = match self.kind {
            Kind::Variational => {
                let map: Vec<String> = map.collect();
                let map = match n {
                    1 => map[0].clone(),
                    _ => format!("[{}]", map.join(", ")),
                };
                format!("{declared} in variational {{ {rows} }} solves {map};")
            }
            Kind::Argmin => {
                let terms = (0..n).map(|i| {
                    let of_z = self.sum(self.matrix.row(i).iter().copied());
                    format!("{}*(0.5*({of_z}) - {})", self.entry(i), load(i))
                });
                let terms: Vec<String> = terms.collect();
                let objective = terms.join(" + ");
                format!("{declared} in argmin {objective} subject to {{ {rows} }};")
            }
        };
        let output = self.sum(self.output.iter().copied());
        format!("state y = 0; {program} y' = {output} - 0.5*y;")
    }

    /// y at the end, and the largest |y|: classical Runge-Kutta steps with one active set each, which end where it does.
    fn integrate(&self) -> (f64, f64) {
        let mut at = Place { t: 0.0, y: 0.0 };
        let mut size: f64 = 0.0;
        let mut active = self.next_active(at, &vec![false; self.rows.len() + 1]);
        let h = self.horizon / STEPS as f64;
        for k in 1..=STEPS {
            let end = h * k as f64;
            while at.t < end {
                let whole = end - at.t;
                let holds = |h: f64| {
                    let next = self.step(at, h, &active);
                    next.filter(|next| self.holds(*next, &active))
                };
                if let Some(next) = holds(whole) {
                    at = Place { t: end, ..next };
                    break;
                }
                let (mut low, mut high) = (0.0, whole);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    match holds(middle) {
                        Some(_) => low = middle,
                        None => high = middle,
                    }
                }
                at = self.step(at, high, &active).expect("a step that is cut");
                active = self.next_active(at, &active);
            }
            size = size.max(at.y.abs());
        }
        (at.y, size)
    }

    /// The active set that holds behind a point, of those the one that differs least.
    fn next_active(&self, at: Place, before: &[bool]) -> Vec<bool> {
        let m = self.rows.len() + 1;
        let mut sets: Vec<Vec<bool>> = (0..1_usize << m)
            .map(|bits| (0..m).map(|k| bits >> k & 1 == 1).collect())
            .filter(|set: &Vec<bool>| set.iter().filter(|active| **active).count() <= self.n())
            .filter(|set| self.radius.is_some() || !set[m - 1])
            .collect();
        let changes = |set: &Vec<bool>| set.iter().zip(before).filter(|(a, b)| a != b).count();
        sets.sort_by_key(changes);
        let goes_on = |set: &&Vec<bool>| {
            let next = self.step(at, 1e-7, set);
            next.is_some_and(|next| self.holds(next, set))
        };
        sets.iter()
            .find(goes_on)
            .expect("a program has a solution")
            .clone()
    }

    fn step(&self, at: Place, h: f64, active: &[bool]) -> Option<Place> {
        let rate = |t: f64, y: f64| {
            let point = self.solve(Place { t, y }, active)?;
            let along = point.z.iter().zip(&self.output).map(|(z, c)| z * c);
            Some(along.sum::<f64>() - 0.5 * y)
        };
        let Place { t, y } = at;
        let k1 = rate(t, y)?;
        let k2 = rate(t + 0.5 * h, y + 0.5 * h * k1)?;
        let k3 = rate(t + 0.5 * h, y + 0.5 * h * k2)?;
        let k4 = rate(t + h, y + h * k3)?;
        let y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        Some(Place { t: t + h, y })
    }

    /// No row is violated, and no multiplier negative.
    fn holds(&self, at: Place, active: &[bool]) -> bool {
        let Some(point) = self.solve(at, active) else {
            return false;
        };
        let row = |row: &Row| {
            let along = row.normal.iter().zip(point.z.iter()).map(|(a, z)| a * z);
            along.sum::<f64>() - row.bound.at(at.t)
        };
        let ball = self.radius.map_or(0.0, |r| r * r - point.z.norm_squared());
        let gaps = self.rows.iter().map(row).chain([ball]);
        let mut signs = gaps.zip(active).zip(&point.multipliers);
        signs.all(|((gap, active), multiplier)| match active {
            true => *multiplier >= -ROUNDING,
            false => gap >= -ROUNDING,
        })
    }

    /// z where these rows are equations: (M + 2νI) z - Aᵀμ = u, A z = b, and |z| = r by Newton's method for ν.
    fn solve(&self, at: Place, active: &[bool]) -> Option<Point> {
        let n = self.n();
        let held: Vec<usize> = (0..self.rows.len()).filter(|&k| active[k]).collect();
        let size = n + held.len();
        let mut rhs = DVector::zeros(size);
        for k in 0..n {
            rhs[k] = self.load[k].at(at.t) + self.gain[k] * at.y;
        }
        let mut matrix = DMatrix::zeros(size, size);
        matrix.view_mut((0, 0), (n, n)).copy_from(&self.matrix);
        for (j, &row) in held.iter().enumerate() {
            rhs[n + j] = self.rows[row].bound.at(at.t);
            for (k, &a) in self.rows[row].normal.iter().enumerate() {
                matrix[(k, n + j)] = -a;
                matrix[(n + j, k)] = a;
            }
        }
        let mut nu = 0.0;
        let mut solution = matrix.clone().lu().solve(&rhs)?;
        if active[self.rows.len()] {
            let radius = self.radius?;
            // |z|² falls and is convex in ν, but where rows hold it at its least value.
            for round in 0.. {
                let lu = matrix.clone().lu();
                solution = lu.solve(&rhs)?;
                let z = solution.rows(0, n).into_owned();
                let excess = z.norm_squared() - radius * radius;
                let mut along = DVector::zeros(size);
                along.rows_mut(0, n).copy_from(&(-2.0 * &z));
                let slope = 2.0 * z.dot(&lu.solve(&along)?.rows(0, n));
                let change = excess / slope;
                if !change.is_finite() || round > 60 {
                    return None;
                }
                if excess.abs() <= 1e-14 * radius * radius {
                    break;
                }
                nu -= change;
                for k in 0..n {
                    matrix[(k, k)] -= 2.0 * change;
                }
            }
        }
        let mut multipliers = vec![0.0; active.len()];
        for (j, &row) in held.iter().enumerate() {
            multipliers[row] = solution[n + j];
        }
        multipliers[self.rows.len()] = nu;
        let z = solution.rows(0, n).into_owned();
        Some(Point { z, multipliers })
    }
}
