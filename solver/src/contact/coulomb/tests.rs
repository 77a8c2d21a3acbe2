//! Random contact problems: bodies with masses of a condition up to 1e8, contacts that depend on each other, tangential
//! dimensions 1 and 2. Each solution is held against the laws themselves, and in the plane against all combinations of
//! contacts that are open, stick or slip.

use super::islands::Islands;
use super::ladder::{Ladder, Options, solve};
use super::problem::{Delassus, NoSolution, Problem, Solution, Work};
use super::rows::{ContactRows, Mass, Rows};
use crate::hybrid::ImpactLaw;
use crate::linalg::norm;
use nalgebra::{DMatrix, DVector};

/// Velocities of a body.
const OF_BODY: usize = 3;

/// Numbers between -1 and 1.
pub(super) struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        let bits = crate::runtime::random::next(&mut self.0);
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A number below this one.
    fn below(&mut self, n: usize) -> usize {
        (0.5 * (self.next() + 1.0) * n as f64) as usize
    }
}

/// Contacts of some bodies: J, row by row with the normal and the slips of one contact after the other, M⁻¹, and v.
struct Scene {
    dim: usize,
    rows: Vec<Vec<f64>>,
    masses: Vec<f64>,
    mu: Vec<f64>,
    v: Vec<f64>,
}

impl Scene {
    /// Some contacts with bodies of masses 10^-spread to 10^spread; where they are redundant, some have the rows of one
    /// before or the mean of two.
    fn random(numbers: &mut Numbers, n: usize, dim: usize, spread: f64, redundant: bool) -> Self {
        let bodies = 1 + numbers.below(n + 1);
        let mut masses = Vec::new();
        for _ in 0..bodies {
            let mass = 10_f64.powf(spread * numbers.next());
            masses.extend([mass, mass, 0.1 * mass]);
        }
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for contact in 0..n {
            let [one, two] = [numbers.below(bodies), numbers.below(bodies)];
            let others = [numbers.below(contact.max(1)), numbers.below(contact.max(1))];
            for k in 0..=dim {
                let mut row = vec![0.0; masses.len()];
                for body in [one, two] {
                    let of_body = &mut row[body * OF_BODY..][..OF_BODY];
                    of_body.iter_mut().for_each(|j| *j += 0.3 * numbers.next());
                    of_body[k] += 1.0;
                }
                if redundant && contact > 0 && contact % 2 == 0 {
                    let [a, b] = others.map(|other| &rows[other * (1 + dim) + k]);
                    row = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
                }
                rows.push(row);
            }
        }
        Scene {
            dim,
            mu: (0..n).map(|_| 0.3 + 0.3 * numbers.next()).collect(),
            v: masses.iter().map(|_| numbers.next()).collect(),
            rows,
            masses,
        }
    }

    /// The impulses of all contacts as those of islands, and v behind them.
    fn solve_island(&mut self, ladder: &mut Ladder, islands: &mut Islands) -> Result<(), usize> {
        let dim = self.dim;
        let mut mass = Mass::new((0..self.masses.len() / OF_BODY).map(|_| OF_BODY));
        assert!(mass.write(|entries| {
            for (body, block) in entries.chunks_mut(OF_BODY * OF_BODY).enumerate() {
                (0..OF_BODY).for_each(|k| {
                    block[k * OF_BODY + k] = self.masses[body * OF_BODY + k];
                });
            }
        }));
        let (mut rows, mut touched) = (Rows::default(), Vec::new());
        rows.clear();
        for row in &self.rows {
            let entries = row.iter().copied().enumerate();
            let entries: Vec<(usize, f64)> = entries.filter(|(_, j)| *j != 0.0).collect();
            rows.push(&mass, &entries, &mut touched);
        }
        let contacts = (0..self.n_contacts()).map(|i| ContactRows {
            normal: i * (1 + dim),
            slips: dim,
        });
        let options = Options {
            attempts: 12,
            tolerance: 1e-11,
            rounding: 0.0,
        };
        ladder.begin(&rows, contacts.clone(), options);
        ladder.laws.friction.copy_from_slice(&self.mu);
        islands.begin(&mass);
        islands.join(&rows, contacts, &mass);
        ladder.solve(&rows, islands, &mass, &mut self.v)
    }

    fn n_contacts(&self) -> usize {
        self.mu.len()
    }

    /// The rows of J in the order of a problem: normals, and then all slips.
    fn ordered(&self) -> Vec<&Vec<f64>> {
        let of_contact = self.rows.chunks(1 + self.dim);
        let normals = of_contact.clone().map(|rows| &rows[0]);
        normals
            .chain(of_contact.flat_map(|rows| &rows[1..]))
            .collect()
    }

    /// The problem of its velocities.
    fn problem(&self) -> Problem {
        let rows = self.ordered();
        let times = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let by_mass = |row: &[f64]| -> Vec<f64> {
            row.iter().zip(&self.masses).map(|(j, m)| j / m).collect()
        };
        let dims = (0..self.n_contacts()).map(|_| self.dim);
        let w = Delassus::new(dims, |i, k| times(rows[i], &by_mass(rows[k])));
        let q = rows.iter().map(|row| times(row, &self.v)).collect();
        Problem::new(w, self.mu.clone(), q)
    }
}

/// What the laws themselves say of forces: how far a gap is below zero, a force outside its cone, a force that pushes
/// from its gap, and friction from its direction; relative to the terms of the rates.
fn violation(problem: &Problem, normal: &[f64], tangential: &[f64]) -> f64 {
    let w = &problem.w;
    let forces: Vec<f64> = (normal.iter().copied())
        .chain(tangential.iter().map(|beta| -beta))
        .collect();
    let terms = |row: usize| w.row(row).iter().zip(&forces).map(|(w, p)| w * p);
    let rate = |row: usize| problem.q[row] + terms(row).sum::<f64>();
    let rows = 0..w.size();
    let size = rows.fold(f64::MIN_POSITIVE, |size, row| {
        size.max(problem.q[row].abs() + terms(row).map(f64::abs).sum::<f64>())
    });
    let mut worst = 0.0_f64;
    for (i, &normal) in normal.iter().enumerate() {
        let force = (normal - problem.least[i]) * w.push(i) / size;
        let gap = rate(i) / size;
        worst = worst.max(-gap).max(-force).max(gap.min(force));
        let slip: Vec<f64> = w.slip_rows(i).map(|t| rate(t) / size).collect();
        let unit = w.resistance(i) / size;
        let beta: Vec<f64> = w.slips(i).map(|t| tangential[t] * unit).collect();
        let most = problem.mu[i] * normal * unit;
        worst = worst.max(norm(&beta) - most);
        let speed = norm(&slip);
        for (slip, beta) in slip.iter().zip(&beta) {
            worst = worst.max((speed * beta - most * slip).abs());
        }
    }
    worst
}

/// Whether some contact is not pushed open by its own force, for some direction of friction.
fn has_paradox(problem: &Problem) -> bool {
    let none = [0.0; 2];
    (0..problem.mu.len()).any(|i| {
        let w = &problem.w;
        !problem.pushes(i, &none[..w.slips(i).len()])
    })
}

#[test]
fn few_contacts_are_solved_to_rounding() {
    let mut numbers = Numbers(1);
    for dim in [1, 2] {
        let (mut solved, mut failed) = (0, 0);
        for case in 0..600 {
            let n = 1 + case % 6;
            let spread = [0.0, 2.0, 4.0][case % 3];
            let scene = Scene::random(&mut numbers, n, dim, spread, case % 2 == 0);
            let problem = scene.problem();
            if has_paradox(&problem) {
                continue;
            }
            match solve(&problem, &problem.q[n..]) {
                Ok(found) => {
                    let worst = violation(&problem, &found.normal, &found.tangential);
                    assert!(worst <= 1e-10, "{dim}, {case}: {worst:e}");
                    solved += 1;
                }
                Err(why) => {
                    assert_eq!(why, NoSolution::NotFound, "{dim}, {case}");
                    failed += 1;
                }
            }
        }
        // In the plane there always is a solution. Newton's method need not come to that of cones.
        assert!(failed <= [0, 12][dim - 1], "{dim}: {failed}");
        assert!(solved > 300, "{dim}: {solved}");
    }
}

/// What a contact in the plane does.
#[derive(Clone, Copy, PartialEq)]
enum Does {
    Opens,
    Sticks,
    Slips(f64),
}

/// The forces of contacts in the plane that do this, p of all: rows of J without a rate have a force, λ of contacts that
/// slip one with friction.
fn forces_of(problem: &Problem, does: &[Does]) -> Option<DVector<f64>> {
    let (w, n) = (&problem.w, does.len());
    let mut matrix = DMatrix::zeros(2 * n, 2 * n);
    let mut rhs = DVector::zeros(2 * n);
    for (i, does) in does.iter().enumerate() {
        let (normal, slip) = (i, n + i);
        if *does == Does::Opens {
            matrix[(normal, normal)] = 1.0;
        } else {
            (0..2 * n).for_each(|k| matrix[(normal, k)] = w.row(normal)[k] / w.push(i));
            rhs[normal] = -problem.q[normal] / w.push(i);
        }
        match *does {
            Does::Opens => matrix[(slip, slip)] = 1.0,
            Does::Sticks => {
                (0..2 * n).for_each(|k| matrix[(slip, k)] = w.row(slip)[k] / w.push(i));
                rhs[slip] = -problem.q[slip] / w.push(i);
            }
            Does::Slips(sign) => {
                matrix[(slip, slip)] = 1.0;
                matrix[(slip, normal)] = sign * problem.mu[i];
            }
        }
    }
    matrix.lu().solve(&rhs)
}

#[test]
fn in_the_plane_it_is_one_of_all_combinations() {
    let mut numbers = Numbers(2);
    let choices = [
        Does::Opens,
        Does::Sticks,
        Does::Slips(1.0),
        Does::Slips(-1.0),
    ];
    let mut compared = 0;
    for case in 0..120 {
        let n = 1 + case % 4;
        let problem = Scene::random(&mut numbers, n, 1, 1.0, false).problem();
        let Ok(found) = solve(&problem, &problem.q[n..]) else {
            continue;
        };
        let mut distance = f64::INFINITY;
        for number in 0..choices.len().pow(n as u32) {
            let does: Vec<Does> = (0..n).map(|i| choices[number >> (2 * i) & 3]).collect();
            let Some(forces) = forces_of(&problem, &does) else {
                continue;
            };
            let (normal, tangential) = (&forces.as_slice()[..n], -forces.rows(n, n));
            if violation(&problem, normal, tangential.as_slice()) > 1e-9 {
                continue;
            }
            let rates = found.rates.iter().chain(&found.slips).enumerate();
            let off = rates.map(|(row, rate)| (problem.rate(row, forces.as_slice()) - rate).abs());
            distance = distance.min(off.fold(0.0, f64::max));
        }
        let size = problem.q.iter().fold(0.0_f64, |size, q| size.max(q.abs()));
        assert!(distance <= 1e-8 * size, "{case}: {distance:e}");
        compared += 1;
    }
    assert!(compared > 90, "{compared}");
}

/// The work of impulses of a scene.
fn work_of(found: &Solution, before: &[f64]) -> Work {
    let mut work = Work::default();
    let impulses = found.normal.iter().copied();
    let impulses = impulses.chain(found.tangential.iter().map(|beta| -beta));
    let after = found.rates.iter().chain(&found.slips);
    for ((impulse, before), after) in impulses.zip(before).zip(after) {
        work.add(impulse, *before, *after);
    }
    work
}

#[test]
fn impacts_add_no_energy() {
    let mut numbers = Numbers(3);
    let mut counted = 0;
    for case in 0..600 {
        let (n, dim) = (1 + case % 5, 1 + case % 2);
        let scene = Scene::random(&mut numbers, n, dim, [0.0, 3.0][case % 2], case % 3 == 0);
        let problem = scene.problem();
        if has_paradox(&problem) {
            continue;
        }
        let e = 0.5 * (1.0 + numbers.next());
        let poisson = ImpactLaw::Poisson.impulses(&mut problem.clone(), &vec![e; n]);
        let plastic = ImpactLaw::Newton.impulses(&mut problem.clone(), &vec![0.0; n]);
        // Newton's law may add energy where friction changes gaps; without friction it does not.
        let mut smooth = problem.clone();
        smooth.mu.fill(0.0);
        let newton = ImpactLaw::Newton.impulses(&mut smooth, &vec![e; n]);
        for (law, found) in [poisson, plastic, newton].into_iter().enumerate() {
            let Ok(found) = found else {
                continue;
            };
            let mut after = found.clone();
            // A solution of Newton's law has rates with (1 + e) of those before.
            let rates = after.rates.iter_mut().zip(&problem.q);
            let more = if law == 2 { e } else { 0.0 };
            rates.for_each(|(rate, before)| *rate -= more * before);
            let work = work_of(&after, &problem.q);
            let is_none = work.gain <= 1e-9 * work.exchanged;
            assert!(is_none, "{case}, {law}: {:e}", work.gain / work.exchanged);
            counted += 1;
        }
    }
    assert!(counted > 1200, "{counted}");
}

#[test]
fn islands_are_solved_from_sweeps_on() {
    let mut numbers = Numbers(4);
    let mut islands = Islands::default();
    let mut ladder = Ladder::default();
    for dim in [0, 1, 2] {
        let (mut solved, mut failed) = (0, 0);
        for case in 0..300 {
            let n = 1 + case % 12;
            let spread = [0.0, 2.0, 4.0][case % 3];
            let mut scene = Scene::random(&mut numbers, n, dim, spread, case % 2 == 0);
            let problem = scene.problem();
            if has_paradox(&problem) {
                continue;
            }
            let found = scene.solve_island(&mut ladder, &mut islands);
            match found {
                Ok(()) => solved += 1,
                Err(_) => {
                    failed += 1;
                    continue;
                }
            }
            let impulses = &ladder.impulses;
            let tangential = impulses.tangential.iter().flat_map(|beta| &beta[..dim]);
            let tangential: Vec<f64> = tangential.copied().collect();
            let worst = violation(&problem, &impulses.normal, &tangential);
            assert!(worst <= 1e-6, "{dim}, {case}: {worst:e}");
            // The velocities are those of the impulses.
            for (row, rate) in scene.problem().q.iter().enumerate() {
                let forces: Vec<f64> = (impulses.normal.iter().copied())
                    .chain(tangential.iter().map(|beta| -beta))
                    .collect();
                let terms = problem.w.row(row).iter().zip(&forces);
                let size = terms.fold(1.0, |size, (w, p)| size + (w * p).abs());
                let off = (problem.rate(row, &forces) - rate).abs();
                assert!(off <= 1e-9 * size, "{dim}, {case}, {row}: {off:e}");
            }
        }
        assert!(failed <= [0, 3, 6][dim], "{dim}: {failed}");
        assert!(solved > 150, "{dim}: {solved}");
    }
}

#[test]
fn what_is_no_number_is_no_solution() {
    let w = Delassus::new([1].into_iter(), |row, column| {
        f64::from(u8::from(row == column))
    });
    let problem = Problem::new(w, vec![0.5], vec![-1.0, 0.1]);
    assert!(problem.residual(&[1.0, -0.1]) < 1e-15);
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(problem.residual(&[bad, 0.0]), f64::INFINITY);
        assert_eq!(problem.residual(&[1.0, bad]), f64::INFINITY);
    }
    let (mut islands, mut ladder) = (Islands::default(), Ladder::default());
    for dim in [0, 1, 2] {
        let mut scene = Scene::random(&mut Numbers(7), 4, dim, 0.0, false);
        for at in 0..scene.v.len() {
            scene.v[at] = f64::NAN;
            let touches = scene.rows.iter().any(|row| row[at] != 0.0);
            let found = scene.solve_island(&mut ladder, &mut islands);
            assert_eq!(found.is_err(), touches, "{dim}, {at}");
            scene = Scene::random(&mut Numbers(7), 4, dim, 0.0, false);
        }
    }
}
