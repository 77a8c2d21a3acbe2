//! Random contacts between random masses: what every impact and every motion must have.
//!
//! M (v⁺ - v⁻) = J_nᵀ Λ_n + J_tᵀ Λ_t,   0 ≤ Λ_n ⟂ J_n v⁺ + e J_n v⁻ ≥ 0,   |Λ_t| ≤ μ Λ_n against J_t v⁺
//!
//! where Λ_t and J_t v⁺ have one or two entries.
//!
//! With r = J_n v, the energy grows by Λᵀ(r⁺ + r⁻)/2. Without friction and with one e for all contacts that
//! is (1 - e) Λᵀr⁻/2 by complementarity, and (1 + e) Λᵀr⁻ = Λᵀ(r⁻ - r⁺) = -|Δv|² is not positive; with friction
//! and e = 0, Λᵀ(r⁺, J_t v⁺) ≤ 0, and the energy grows by that less |Δv|²/2 (norms of M). With different e, or
//! friction and e > 0, it may grow, and W0712 says so. By Poisson's law it may not with friction either: compression
//! takes ½|v° - v⁻|² at least, and of expansion comes e² times that at most.
//!
//! Between impacts forces are constant: contacts that stay closed do no work, slipping takes energy, and ½vᵀMv - fᵀq
//! never grows in a motion. By events a contact counts as closed whose gap is below 1e-12 of the size of positions, and
//! what stops it takes energy as well; steps of time either pay for what they lift or do not move. What is left is the
//! error of states, and of gaps where a contact closes: by energies of the size of the motion, a sum over steps of
//! 1e-11, the tolerance of the run, and 1e-12; of impulses in steps of time 1e-11.

use nalgebra::{DMatrix, DVector};
use nsd_tests::{end, run};
use nsdc::report::Status;
use proptest::prelude::*;

const NEWTON: &str = "newton";
const POISSON: &str = "poisson";

/// A run in steps of time.
const GRID: &str = "horizon 2; method timestepping { steps = 200; }";

/// Contacts that are all closed and struck at the start, or open.
#[derive(Clone, Debug)]
struct Scene {
    law: &'static str,
    mass: DMatrix<f64>,
    normals: DMatrix<f64>,
    /// By entry of the slip velocity.
    slips: Vec<DMatrix<f64>>,
    gaps: Vec<f64>,
    speed: DVector<f64>,
    force: DVector<f64>,
    restitution: f64,
    friction: f64,
}

fn numbers(count: usize) -> impl Strategy<Value = Vec<f64>> {
    // Multiples of 1/64, so that the text has them exactly; and zeros, so that not everything depends on everything.
    let number = prop_oneof![3 => -64..=64_i32, 1 => Just(0)].prop_map(|k| f64::from(k) / 64.0);
    prop::collection::vec(number, count)
}

/// d velocities and fewer contacts, all of them struck by the speed. Friction, with slip velocities of so many entries,
/// goes with e = 0 by Newton's law.
fn scene(law: &'static str, entries: usize) -> impl Strategy<Value = Scene> {
    let most = if entries > 1 { 8_usize } else { 6 };
    let sizes = (2..most).prop_flat_map(|d| (Just(d), 1..d));
    let scenes = sizes.prop_flat_map(move |(d, m)| {
        let parts = (
            numbers(d * d),
            numbers(d * m),
            numbers(entries * d * m),
            numbers(d),
            numbers(d),
        );
        (
            Just((d, m)),
            parts,
            numbers(m),
            0..5_u32,
            0..4_u32,
            any::<bool>(),
        )
    });
    scenes.prop_map(move |((d, m), parts, gaps, e, mu, rubs)| {
        let (mass, normals, slips, speed, force) = parts;
        let factor = DMatrix::from_vec(d, d, mass);
        let speed = DVector::from_vec(speed);
        let mut normals = DMatrix::from_vec(m, d, normals);
        for (i, mut normal) in normals.row_iter_mut().enumerate() {
            // Not nearly zero, not nearly one another, and against the speed.
            normal[i] += 2.0_f64.copysign(normal[i]);
            if (&normal * &speed)[0] > 0.0 {
                normal *= -1.0;
            }
        }
        let slips = slips.chunks(m * d).enumerate().map(|(k, slips)| {
            let mut slips = DMatrix::from_row_slice(m, d, slips);
            for mut slip in slips.row_iter_mut().filter(|slip| slip.amax() == 0.0) {
                slip[k] = 1.0;
            }
            slips
        });
        let slips = slips.collect();
        Scene {
            mass: &factor * factor.transpose() + DMatrix::identity(d, d),
            normals,
            slips,
            gaps: gaps.into_iter().map(f64::abs).collect(),
            speed,
            force: DVector::from_vec(force),
            law,
            restitution: if law == NEWTON && (rubs || entries > 1) {
                0.0
            } else {
                f64::from(e) / 4.0
            },
            friction: if rubs || entries > 1 {
                f64::from(mu) / 4.0
            } else {
                0.0
            },
        }
    })
}

fn list<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> String {
    let numbers: Vec<String> = numbers.into_iter().map(|x| format!("{x:?}")).collect();
    numbers.join(", ")
}

impl Scene {
    fn text(&self, gaps: &[f64], force: &DVector<f64>, setting: &str) -> String {
        let d = self.speed.len();
        let rows: Vec<String> = self.mass.row_iter().map(|row| list(row.iter())).collect();
        let mut contacts = String::new();
        for (i, gap) in gaps.iter().enumerate() {
            let normal = list(self.normals.row(i).iter());
            let slips = self
                .slips
                .iter()
                .map(|slips| format!("dot([{}], v)", list(slips.row(i).iter())));
            let rubs = match self.friction {
                0.0 => String::new(),
                mu => {
                    let slips = slips.collect::<Vec<_>>().join(", ");
                    format!(" slip = [{slips}]; friction = {mu:?};")
                }
            };
            contacts += &format!(
                "contact c{i} {{ gap = dot([{normal}], q) + {gap:?}; restitution = {}({:?});{rubs} }}",
                self.law, self.restitution
            );
        }
        let (mass, speed, force) = (rows.join("; "), list(&self.speed), list(force));
        format!(
            "model scene {{
               state q[{d}] = zeros({d}); state v[{d}] = [{speed}]; q' = v;
               mechanics q, v {{ mass = [{mass}]; force = [{force}]; {contacts} }}
               output energy = 0.5*dot(v, [{mass}]*v) - dot([{force}], q);
             }}
             simulate this of scene {{ {setting} }}"
        )
    }

    /// The velocity at which no gap closes, and the impulses without friction that lead to it, none below the least: by
    /// projected Gauss-Seidel iterations.
    fn stopped(&self, before: &DVector<f64>, least: &[f64]) -> (DVector<f64>, Vec<f64>) {
        let inverse = self.mass.clone().try_inverse().expect("it is definite");
        let push = inverse * self.normals.transpose();
        let mut v = before + &push * DVector::from_column_slice(least);
        let mut impulses = least.to_vec();
        for _ in 0..20_000 {
            for (i, impulse) in impulses.iter_mut().enumerate() {
                let normal = self.normals.row(i);
                let change = -(normal * &v)[0] / (normal * push.column(i))[0];
                let next = f64::max(*impulse + change, least[i]);
                v += push.column(i) * (next - *impulse);
                *impulse = next;
            }
        }
        (v, impulses)
    }

    /// Whether this is a velocity after the impact of all contacts.
    fn is_an_impact(&self, after: &DVector<f64>) -> Result<(), TestCaseError> {
        let (m, d) = self.normals.shape();
        let change = after - &self.speed;
        let momentum = &self.mass * &change;
        let rubs = self.friction > 0.0;
        let slips = if rubs { &self.slips[..] } else { &[] };
        let jacobian = DMatrix::from_fn(m + m * slips.len(), d, |i, j| match i / m {
            0 => self.normals[(i, j)],
            k => slips[k - 1][(i % m, j)],
        });
        let energy = |v: &DVector<f64>| 0.5 * v.dot(&(&self.mass * v));
        prop_assert!(
            energy(after) <= energy(&self.speed) * (1.0 + 1e-12) + 1e-13,
            "energy"
        );

        let (before, behind) = (&self.normals * &self.speed, &self.normals * after);
        let size = self.mass.amax() * self.speed.amax().max(1.0) * 1e3;
        // What Λ is complementary to; of Poisson's law, whose Λ is that of two impacts, no more is known than signs.
        let is_poisson = self.law == POISSON;
        let rebound = if is_poisson { 0.0 } else { self.restitution };
        for i in 0..m {
            prop_assert!(behind[i] + rebound * before[i] >= -1e-10, "gap rate {i}");
        }
        // With friction, impulses are determined by the velocities where all rows are independent.
        let gram = &jacobian * jacobian.transpose();
        let Some(inverse) = gram
            .clone()
            .try_inverse()
            .filter(|i| i.amax() * gram.amax() < 1e4)
        else {
            return Ok(());
        };
        let impulses = inverse * &jacobian * &momentum;
        prop_assert!(
            (jacobian.transpose() * &impulses - momentum).amax() <= 1e-10 * size,
            "balance"
        );
        for i in 0..m {
            let normal = impulses[i];
            prop_assert!(normal >= -1e-10 * size, "impulse {i}: {normal}");
            let product = normal * (behind[i] + rebound * before[i]);
            prop_assert!(
                is_poisson || product.abs() <= 1e-10 * size * size,
                "complementarity {i}: {product}"
            );
            if rubs {
                let n = slips.len();
                let tangential = DVector::from_fn(n, |k, _| impulses[m + k * m + i]);
                let slip = DVector::from_fn(n, |k, _| (slips[k].row(i) * after)[0]);
                let bound = self.friction * normal;
                prop_assert!(tangential.norm() <= bound + 1e-10 * size, "cone {i}");
                let is_slip = slip.norm() > 1e-9;
                let missing = tangential + slip.normalize() * bound;
                prop_assert!(
                    is_poisson || !is_slip || missing.norm() <= 1e-10 * size,
                    "slip {i}: {missing}"
                );
            }
        }
        Ok(())
    }

    /// Runs with these settings: nothing penetrates, and energy does not grow.
    fn loses_energy(&self, settings: &[&str]) -> Result<(), TestCaseError> {
        for setting in settings {
            let text = self.text(&self.gaps, &self.force, setting);
            let found = run(&text, "this");
            if found.status != Status::Solved {
                prop_assert!(found.failure.is_some());
                continue;
            }
            let series = |name: &str| {
                let series = found
                    .samples
                    .states
                    .iter()
                    .chain(&found.samples.outputs)
                    .find(|s| s.name == name);
                series.expect("the model has it")
            };
            let (q, energy) = (series("q"), &series("energy").values);
            let size = energy.iter().fold(1.0_f64, |most, e| most.max(e.abs()));
            let mut least = f64::INFINITY;
            for &energy in energy {
                prop_assert!(
                    energy <= least + 1e-9 * size,
                    "{} after {}\n{}",
                    energy,
                    least,
                    text
                );
                least = least.min(energy);
            }
            for k in 0..found.samples.time.len() {
                let gaps = &self.normals * DVector::from_column_slice(q.at(k));
                for (gap, start) in gaps.iter().zip(&self.gaps) {
                    prop_assert!(
                        gap + start >= -1e-9 * size,
                        "depth {} at {}",
                        gap + start,
                        found.samples.time[k]
                    );
                }
            }
        }
        Ok(())
    }
}

/// A wall that stops the first of three velocities moves the others, too, with the mass [2 1 0; 1 2 1; 0 1 2]: its
/// inverse is [3 -2 1; -2 4 -2; 1 -2 3]/4. For v⁻ = (-1, 0, 0) and a gap q₁ an
/// impulse Λ = 4/3 (1 + e) makes v⁺ = v⁻ + Λ (3, -2, 1)/4 = v⁻ + (1 + e) (1, -2/3, 1/3).
#[test]
fn impulses_move_what_gaps_do_not_depend_on() {
    for e in [0.0, 0.5, 1.0] {
        for method in ["event;", "timestepping { steps = 2; }"] {
            let text = format!(
                "model row {{
                   state q[3] = zeros(3); state v[3] = [-1, 0, 0]; q' = v;
                   mechanics q, v {{
                     mass = [2, 1, 0; 1, 2, 1; 0, 1, 2]; force = zeros(3);
                     contact wall {{ gap = q[1]; restitution = {e:?}; }}
                     contact other {{ gap = q[2] + q[3] + 10; restitution = 0; }}
                   }}
                 }}
                 simulate this of row {{ horizon 1; method {method} }}"
            );
            let found = run(&text, "this");
            assert_eq!(found.status, Status::Solved, "{text}");
            let change = [1.0, -2.0 / 3.0, 1.0 / 3.0].map(|part| (1.0 + e) * part);
            for (v, expected) in
                end(&found, "v")
                    .iter()
                    .zip([change[0] - 1.0, change[1], change[2]])
            {
                assert!(
                    (v - expected).abs() <= 1e-10,
                    "{method} e = {e}: {v} is not {expected}"
                );
            }
        }
    }
}

/// Without forces, contacts that an impact leaves closed push with nothing but rounding, and their gaps move by no more.
/// The velocity behind an impact without friction and with e = 0 is the point nearest to v⁻, by the metric of M, at
/// which no gap closes: projected Gauss-Seidel iterations on its impulses find it. The normals of the second scene
/// depend on each other: n₄ = 2 n₁ + 3 n₂ and n₅ = 2 n₄ + n₂.
#[test]
fn contacts_at_rest_without_forces_stay_closed() {
    let still = |d: usize, mass: &[f64], speed: &[f64], normals: &[f64]| Scene {
        mass: DMatrix::from_row_slice(d, d, mass),
        law: NEWTON,
        normals: DMatrix::from_row_slice(normals.len() / d, d, normals),
        slips: Vec::new(),
        gaps: vec![0.0; normals.len() / d],
        speed: DVector::from_row_slice(speed),
        force: DVector::zeros(d),
        restitution: 0.0,
        friction: 0.0,
    };
    #[rustfmt::skip]
    let scenes = [
        still(
            4,
            &[
                2.748779296875, -0.555908203125, 0.608154296875, -0.481689453125,
                -0.555908203125, 1.93212890625, -0.66748046875, -0.189697265625,
                0.608154296875, -0.66748046875, 2.24853515625, -0.224853515625,
                -0.481689453125, -0.189697265625, -0.224853515625, 1.747314453125,
            ],
            &[-0.921875, 0.453125, 0.265625, -0.515625],
            &[
                2.15625, 0.0, -0.578125, -0.3125,
                0.984375, -2.4375, -0.375, 0.96875,
                0.390625, -1.0, -2.53125, 0.0,
            ],
        ),
        still(
            4,
            &[
                1.0712890625, 0.03271484375, -0.07080078125, 0.0,
                0.03271484375, 2.493408203125, -0.531982421875, -0.5478515625,
                -0.07080078125, -0.531982421875, 1.660888671875, 0.062255859375,
                0.0, -0.5478515625, 0.062255859375, 1.635009765625,
            ],
            &[-0.265625, 0.734375, -0.46875, -0.84375],
            &[
                2.3125, -0.3125, -0.859375, 0.0,
                -0.703125, -2.421875, -0.59375, 0.578125,
                0.0, -0.875, 2.15625, -0.46875,
                2.515625, -7.890625, -3.5, 1.734375,
                4.328125, -18.203125, -7.59375, 4.046875,
            ],
        ),
    ];
    for scene in scenes {
        let text = scene.text(&scene.gaps, &scene.force, "horizon 0.5; method event;");
        let found = run(&text, "this");
        assert_eq!(found.status, Status::Solved, "{text}\n{:?}", found.failure);
        let (v, _) = scene.stopped(&scene.speed, &vec![0.0; scene.gaps.len()]);
        for (found, expected) in end(&found, "v").iter().zip(v.iter()) {
            assert!(
                (found - expected).abs() <= 1e-9,
                "{found} is not {expected}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// By events and in steps of time, which have one law.
    #[test]
    fn impacts_obey_their_law(scene in scene(NEWTON, 1)) {
        let gaps = vec![0.0; scene.normals.nrows()];
        let still = DVector::zeros(scene.speed.len());
        for method in ["event;", "timestepping { steps = 1; }"] {
            let text = scene.text(&gaps, &still, &format!("horizon 0.5; method {method}"));
            let found = run(&text, "this");
            // Friction may leave several motions, which is told.
            if scene.friction > 0.0 && found.status != Status::Solved {
                continue;
            }
            prop_assert_eq!(found.status, Status::Solved, "{}\n{:?}", text, found.failure);
            scene.is_an_impact(&DVector::from_vec(end(&found, "v")))?;
        }
    }

    /// With slip velocities of two entries.
    #[test]
    fn impacts_in_space_obey_their_law(scene in scene(NEWTON, 2)) {
        let gaps = vec![0.0; scene.normals.nrows()];
        let still = DVector::zeros(scene.speed.len());
        let text = scene.text(&gaps, &still, "horizon 0.5; method timestepping { steps = 1; }");
        let found = run(&text, "this");
        prop_assert_eq!(found.status, Status::Solved, "{}\n{:?}", text, found.failure);
        scene.is_an_impact(&DVector::from_vec(end(&found, "v")))?;
    }

    /// By events, where expansion follows on compression; without friction, the velocity behind is known.
    #[test]
    fn impacts_obey_the_law_of_poisson(scene in prop_oneof![scene(POISSON, 1), scene(POISSON, 2)]) {
        let gaps = vec![0.0; scene.normals.nrows()];
        let still = DVector::zeros(scene.speed.len());
        let found = run(&scene.text(&gaps, &still, "horizon 1e-3;"), "this");
        prop_assert!(!found.warnings.iter().any(|warning| warning.code == "W0712"));
        if scene.friction > 0.0 && found.status != Status::Solved {
            return Ok(());
        }
        prop_assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        let after = DVector::from_vec(end(&found, "v"));
        scene.is_an_impact(&after)?;
        if scene.friction == 0.0 {
            let none = vec![0.0; gaps.len()];
            let (slow, impulses) = scene.stopped(&scene.speed, &none);
            let given_back = impulses.iter().map(|impulse| scene.restitution * impulse);
            let (exact, _) = scene.stopped(&slow, &given_back.collect::<Vec<f64>>());
            prop_assert!((&after - &exact).amax() <= 1e-9, "{after} is not {exact}");
        }
    }

    /// Over many impacts by Poisson's law, friction and all.
    #[test]
    fn motions_lose_energy_by_the_law_of_poisson(scene in scene(POISSON, 1)) {
        scene.loses_energy(&["horizon 2; tolerance 1e-11;"])?;
    }

    /// Over many impacts: nothing penetrates, and energy does not grow.
    #[test]
    fn motions_lose_energy(scene in scene(NEWTON, 1)) {
        scene.loses_energy(&["horizon 2; tolerance 1e-11;", GRID])?;
    }

    /// The same with slip velocities of two entries.
    #[test]
    fn motions_in_space_lose_energy(scene in scene(NEWTON, 2)) {
        scene.loses_energy(&[GRID])?;
    }
}
