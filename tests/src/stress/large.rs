//! Many states and many switches.

use std::f64::consts::PI;

use super::{Case, Extent, Family, root};

pub fn families(extent: Extent) -> Vec<Family> {
    vec![heat(extent), relays(extent), held(extent)]
}

/// A rod that is heated at one end while its middle is cold.
fn heat(extent: Extent) -> Family {
    let case = |n: usize| {
        let rod = Rod::new(n);
        let (d, middle, horizon) = (rod.diffusion, rod.middle, 3.0);
        let model = format!(
            "const n = {n}; state x[n] = zeros(n); let heating = 2*step(0.25 - x[{middle}]);
             x[1]' = {d:?}*(heating - 2*x[1] + x[2]);
             for i in 2..n-1 {{ x[i]' = {d:?}*(x[i-1] - 2*x[i] + x[i+1]); }}
             x[n]' = {d:?}*(x[n-1] - 2*x[n]);"
        );
        let (times, exact) = rod.solve(horizon);
        let case = Case::new(n, model, horizon).ends("x", &exact, 1.0);
        let case = case.switches_at(&times);
        // Elements keep every state to its own size. What rises from zero like t^k with a large k has none at first,
        // and they say so.
        // Larger ones say the same after minutes.
        let elements = (n <= 100).then(|| case.clone().by("fesd").accurate_if(false));
        [Some(case), elements].into_iter().flatten()
    };
    Family {
        name: "many states",
        about: "A rod of n nodes with a thermostat, the fastest of them n² times as fast as the slowest; sines \
                between the crossings, which are found by bisection.",
        hardness: "states n",
        cases: extent
            .sweep(&[10, 30], &[10, 50, 100, 200, 500])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// The nodes j of a rod in the modes sin(k π j/(n + 1)) of the differences between them.
struct Rod {
    n: usize,
    middle: usize,
    /// The slowest mode decays with a rate close to one.
    diffusion: f64,
    rates: Vec<f64>,
}

impl Rod {
    fn new(n: usize) -> Self {
        let length = (n + 1) as f64;
        let diffusion = (length / PI).powi(2);
        let rate = |k: usize| 4.0 * diffusion * (0.5 * PI * k as f64 / length).sin().powi(2);
        Rod {
            n,
            middle: n.div_ceil(2),
            diffusion,
            rates: (1..=n).map(rate).collect(),
        }
    }

    fn sine(&self, k: usize, j: usize) -> f64 {
        let period = 2 * (self.n + 1);
        (PI * (k * j % period) as f64 / (self.n + 1) as f64).sin()
    }

    /// The modes `tau` after others.
    fn flow(&self, modes: &[f64], heating: f64, tau: f64) -> Vec<f64> {
        let mode = |(k, (mode, rate)): (usize, (&f64, &f64))| {
            let driven = 2.0 / (self.n + 1) as f64 * self.diffusion * heating * self.sine(k + 1, 1);
            mode * (-rate * tau).exp() - driven / rate * (-rate * tau).exp_m1()
        };
        modes
            .iter()
            .zip(&self.rates)
            .enumerate()
            .map(mode)
            .collect()
    }

    fn node(&self, modes: &[f64], j: usize) -> f64 {
        modes
            .iter()
            .enumerate()
            .map(|(k, mode)| mode * self.sine(k + 1, j))
            .sum()
    }

    /// Crossings of 1/4 in the middle, and all nodes at the horizon.
    fn solve(&self, horizon: f64) -> (Vec<f64>, Vec<f64>) {
        let (mut t, mut heating, mut modes) = (0.0, 2.0, vec![0.0; self.n]);
        let mut times = Vec::new();
        let step = 1.0 / 64.0;
        loop {
            let above = |tau: f64| {
                let above = self.node(&self.flow(&modes, heating, tau), self.middle) - 0.25;
                if heating > 0.0 { above } else { -above }
            };
            let mut k = 1.0;
            while above(k * step) < 0.0 && t + k * step < horizon {
                k += 1.0;
            }
            let tau = match above(k * step) < 0.0 {
                true => horizon,
                false => root(above, (k - 1.0_f64).max(1e-3) * step, k * step),
            };
            if t + tau >= horizon {
                let end = self.flow(&modes, heating, horizon - t);
                return (times, (1..=self.n).map(|j| self.node(&end, j)).collect());
            }
            modes = self.flow(&modes, heating, tau);
            (t, heating) = (t + tau, 2.0 - heating);
            times.push(t);
        }
    }
}

/// x_i' = c_i - s_i + s_{i+1}/5 from above: every relay is met, and kept.
fn relays(extent: Extent) -> Family {
    let horizon = 5.0;
    let case = |n: usize| {
        let drive = |i: usize| 0.375 - 0.125 * (i % 4) as f64;
        let start = |i: usize| 0.1 + i as f64 / n as f64;
        let mut model = format!("state y = 0; state x[{n}] = [0.1 + (i - 1)/{n} for i in 1..{n}];");
        let mut sum = Vec::new();
        for i in 0..n {
            let (k, next) = (i + 1, (i + 1) % n + 1);
            model += &format!(
                "x[{k}]' = {:?} - sign(x[{k}]) + 0.2*sign(x[{next}]);",
                drive(i)
            );
            sum.push(format!("sign(x[{k}])"));
        }
        model += &format!("y' = ({})/{n};", sum.join(" + "));

        let mut x: Vec<f64> = (0..n).map(start).collect();
        let (mut t, mut y, mut times) = (0.0, 0.0, Vec::new());
        let mut held = vec![false; n];
        loop {
            // The signs of those that are held follow from their neighbours.
            let mut s = vec![1.0; n];
            for _ in 0..60 {
                let last = s.clone();
                for i in (0..n).filter(|i| held[*i]) {
                    s[i] = drive(i) + 0.2 * last[(i + 1) % n];
                }
            }
            assert!(held.iter().zip(&s).all(|(held, s)| !held || s.abs() < 1.0));
            let rate = |i: usize| drive(i) - s[i] + 0.2 * s[(i + 1) % n];
            let meets = |i: usize| {
                if rate(i) < 0.0 {
                    -x[i] / rate(i)
                } else {
                    f64::INFINITY
                }
            };
            let next = (0..n)
                .filter(|i| !held[*i])
                .min_by(|a, b| meets(*a).total_cmp(&meets(*b)));
            let tau = next.map_or(f64::INFINITY, meets).min(horizon - t);
            let free: Vec<usize> = (0..n).filter(|i| !held[*i]).collect();
            let rates: Vec<f64> = free.iter().map(|i| rate(*i)).collect();
            for (i, rate) in free.into_iter().zip(rates) {
                x[i] += tau * rate;
            }
            y += tau * s.iter().sum::<f64>() / n as f64;
            t += tau;
            match next {
                Some(i) if t < horizon => {
                    (held[i], x[i]) = (true, 0.0);
                    times.push(t);
                }
                _ => break,
            }
        }
        let case = Case::new(n, model, horizon)
            .ends("x", &x, 1.0)
            .ends("y", &[y], y);
        case.switches_at(&times).both()
    };
    Family {
        name: "many switches",
        about: "x_i' = c_i - s_i + s_{i+1}/5: n relays are met one after the other and kept; straight lines.",
        hardness: "switches n",
        cases: extent
            .sweep(&[10, 30], &[10, 20, 50, 100])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// n switches that slide from the start, s = (I - P/5)⁻¹ (cos(t + i)/2)_i with P the cyclic shift, and the integral y of
/// the first one up to t = 3.
pub fn held_switches(n: i32) -> (String, f64) {
    let mut model = format!("state x[{n}] = zeros({n}); state y = 0; y' = sign(x[1]);");
    for i in 1..=n {
        let next = i % n + 1;
        model += &format!("x[{i}]' = 0.5*cos(time + {i}) - sign(x[{i}]) + 0.2*sign(x[{next}]);");
    }
    let share = |k: i32| {
        let phase = f64::from(k % n + 1);
        0.5 * 0.2_f64.powi(k) * ((3.0 + phase).sin() - phase.sin())
    };
    (model, (0..60).map(share).sum())
}

fn held(extent: Extent) -> Family {
    let case = |n: i32| {
        let (model, exact) = held_switches(n);
        let case = Case::new(n, model, 3.0).ends("y", &[exact], 1.0);
        case.switches_at(&[]).accurate_if(n <= 8).both()
    };
    Family {
        name: "switches held from the start",
        about: "x_i' = cos(t + i)/2 - s_i + s_{i+1}/5 at x = 0, all of which slide; s by a geometric series.",
        hardness: "codimension n",
        cases: extent
            .sweep(&[3, 8], &[2, 4, 6, 7, 8, 10, 16, 30, 100])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}
