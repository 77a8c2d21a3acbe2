//! Slip velocities with two entries: w = 0 is a point of a plane, where elements stop and start.
//!
//! 0 = w_k - s u_k,   0 = 1 - |u|² - r,   0 ≤ s ⟂ r ≥ 0,   u = 2α - 1
//!
//! While w slips, r = 0 and u = w/|w|, which nothing determines at w = 0. So an element that comes there ends where |w| is
//! so small that it does not matter, w is set to zero, and the directional problem says what comes next: u so that w
//! rests, or the direction that w sets off in. Then w has a small length in that direction.

use super::system::{Disc, Reduced, Zero};
use super::watch::BAND;
use super::{Run, Simulator};
use crate::fesd::selection::directional::Choice;

/// |w| of this share of its size is none (chosen by trial: its square is rounding).
const STOPS: f64 = 1e-9;

/// What a rate makes of w within this share of a step is none, too.
const AT_ONCE: f64 = 1e-12;

/// |w| that is set off with, in those that stop.
const DEPARTS: f64 = 4.0;

/// A slip velocity that sets off.
#[derive(Clone, Copy, Debug)]
pub(super) struct Departure {
    /// The place of s.
    pub slip: usize,
    /// s, and its rate.
    pub speed: f64,
    pub rate: f64,
}

/// What a run keeps of its slip velocities with two entries.
#[derive(Clone, Default, Debug)]
pub(super) struct Slips {
    /// |w| that is none, by disc: the largest so far.
    stops: Vec<f64>,
    /// What sets off at an instant.
    pub departures: Vec<Departure>,
    pub at: f64,
    /// The length of a step there.
    pub step: f64,
}

impl Simulator<'_> {
    /// Raises what counts as no slip.
    pub(super) fn raise_bands(&self, run: &Run, bands: &mut [f64]) {
        for (k, disc) in self.system.discs.iter().enumerate() {
            let size = bands[disc.pair] / BAND;
            let known = run.slips.stops.get(k).copied().unwrap_or(0.0);
            let at_once = AT_ONCE * disc.friction * run.slips.step;
            let stop = (STOPS * size).max(known).max(at_once);
            bands[disc.pair] = 2.0 * stop.max(f64::MIN_POSITIVE.sqrt());
        }
    }

    /// Whether a slip velocity is at rest, of the pairs that meet.
    pub(super) fn rests_or_sets_off(&self, open: &[usize]) -> bool {
        let mut discs = self.system.discs.iter();
        discs.any(|disc| open.contains(&disc.pair))
    }

    /// What a watched slip velocity is where it stops, over the band of members.
    pub(super) fn size_of_stop(&self, pair: usize, bands: &[f64]) -> Option<f64> {
        let discs = &self.system.discs;
        discs.iter().find(|disc| disc.pair == pair)?;
        Some(0.5 * bands[pair] / BAND)
    }

    /// Sets slip velocities that are next to none to zero; the others slip.
    pub(super) fn rest(&self, run: &mut Run, bands: &[f64]) {
        for disc in &self.system.discs {
            if run.z[disc.slip] > bands[disc.pair] {
                run.zeros[disc.pair] = Zero::Right;
                continue;
            }
            let mut x = run.x.clone();
            self.set_slip(run.t, &mut x, &run.z, disc, [0.0; 2]);
            for ((low, x), before) in run.low.iter_mut().zip(&x).zip(&run.x) {
                if x != before {
                    *low = 0.0;
                }
            }
            run.x = x;
            run.z[disc.slip] = 0.0;
        }
    }

    /// What sets off with a choice, and the states that have it do so.
    pub(super) fn set_off(
        &self,
        run: &Run,
        choice: &Choice,
        reduced: &Reduced,
        bands: &[f64],
    ) -> (Vec<f64>, Vec<Departure>) {
        let (mut x, mut departures) = (run.x.clone(), Vec::new());
        for disc in &self.system.discs {
            let leaves = choice.zeros[disc.pair] == Zero::Right
                && run.z[disc.slip] <= bands[disc.pair]
                && reduced.unknowns.contains(&disc.slip);
            if !leaves {
                continue;
            }
            let u = disc.alphas.map(|z| 2.0 * choice.u[z] - 1.0);
            let rate = choice.u[disc.slip];
            let least = f64::max(
                0.5 * bands[disc.pair],
                AT_ONCE * run.slips.step * rate.abs(),
            );
            let speed = DEPARTS * least;
            self.set_slip(run.t, &mut x, &run.z, disc, u.map(|u| speed * u));
            departures.push(Departure {
                slip: disc.slip,
                speed,
                rate,
            });
        }
        (x, departures)
    }

    /// Takes note of what sets off.
    pub(super) fn keep_departures(&self, run: &mut Run, departures: Vec<Departure>) {
        let discs = &self.system.discs;
        run.slips.stops.resize(discs.len(), 0.0);
        for departure in &departures {
            run.z[departure.slip] = departure.speed;
            for (disc, stop) in discs.iter().zip(&mut run.slips.stops) {
                if disc.slip == departure.slip {
                    *stop = stop.max(departure.speed / DEPARTS);
                }
            }
        }
        run.slips.departures = departures;
        run.slips.at = run.t;
    }

    /// Moves x as little as possible so that w has this value.
    fn set_slip(&self, t: f64, x: &mut [f64], z: &[f64], disc: &Disc, target: [f64; 2]) {
        let (n, full) = (x.len(), &self.system.full);
        let mut inputs = vec![t];
        inputs.extend_from_slice(x);
        inputs.extend_from_slice(z);
        inputs[1 + n + disc.slip] = 0.0;
        inputs.extend_from_slice(&self.numbers);
        let mut values = vec![0.0; full.equations.n_outputs()];
        let mut scratch = full.equations.scratch();
        full.equations.eval(&inputs, &mut values, &mut scratch);
        let missing = [0, 1].map(|k| target[k] - values[n + disc.rows[k]]);
        let mut slopes = vec![0.0; full.slopes.entries.len()];
        let mut scratch = full.slopes.tape.scratch();
        full.slopes.tape.eval(&inputs, &mut slopes, &mut scratch);
        let gradient = |k: usize| {
            let mut gradient = vec![0.0; n];
            for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
                if row == n + disc.rows[k] && (1..=n).contains(&input) {
                    gradient[input - 1] = *slope;
                }
            }
            gradient
        };
        let [first, second] = [gradient(0), gradient(1)];
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (a, b, c) = (
            dot(&first, &first),
            dot(&first, &second),
            dot(&second, &second),
        );
        let determinant = a * c - b * b;
        let shares = [
            (c * missing[0] - b * missing[1]) / determinant,
            (a * missing[1] - b * missing[0]) / determinant,
        ];
        if !shares.iter().all(|share| share.is_finite()) {
            return;
        }
        for (i, x) in x.iter_mut().enumerate() {
            *x += shares[0] * first[i] + shares[1] * second[i];
        }
    }
}
