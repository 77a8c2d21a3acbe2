//! Slip velocities with two entries: w = 0 is a point of a plane, where elements stop and start.
//!
//! 0 = w_k - s u_k,   0 = 1 - |u|² - r,   0 ≤ s ⟂ r ≥ 0,   u = 2α - 1
//!
//! While w slips, r = 0 and u = w/|w|, which nothing determines at w = 0. So an element that comes there ends where |w| is
//! so small that it does not matter, w is set to zero, and the directional problem says what comes next: u so that w
//! rests, or the direction that w sets off in. Then w has a small length in that direction.

use super::bands::slopes;
use super::directional::Choice;
use crate::fesd::element::Departure;
use crate::fesd::run::place::Place;
use crate::fesd::system::pointwise::Point;
use crate::fesd::system::{ComplementaritySystem, Disc, Reduced, Zero};
use crate::fesd::watch::BAND;

/// |w| of this share of its size is none (chosen by trial: its square is rounding).
const STOPS: f64 = 1e-9;

/// What a rate makes of w within this share of a step is none, too.
const AT_ONCE: f64 = 1e-12;

/// |w| that is set off with, in those that stop.
const DEPARTS: f64 = 4.0;

/// What a run keeps of its slip velocities with two entries.
#[derive(Clone, Default, Debug)]
pub(crate) struct Slips {
    /// |w| that is none, by disc: the largest so far.
    stops: Vec<f64>,
    /// What sets off at an instant.
    departures: Vec<Departure>,
    at: f64,
    /// The length of a step there.
    pub step: f64,
}

impl Slips {
    /// Raises what counts as no slip, of bands over [`BAND`].
    pub fn raise(&self, system: &ComplementaritySystem, bands: &mut [f64]) {
        for (k, disc) in system.discs.iter().enumerate() {
            let size = bands[disc.pair] / BAND;
            let known = self.stops.get(k).copied().unwrap_or(0.0);
            let at_once = AT_ONCE * disc.friction * self.step;
            let stop = (STOPS * size).max(known).max(at_once);
            bands[disc.pair] = 2.0 * stop.max(f64::MIN_POSITIVE.sqrt());
        }
    }

    /// What sets off at a time.
    pub fn departures_at(&self, t: f64) -> &[Departure] {
        match self.at == t {
            true => &self.departures,
            false => &[],
        }
    }

    /// What sets off with a choice, and the states that have it do so.
    pub fn set_off(
        &self,
        system: &ComplementaritySystem,
        bands: &[f64],
        numbers: &[f64],
        place: &Place,
        choice: &Choice,
        reduced: &Reduced,
    ) -> (Vec<f64>, Vec<Departure>) {
        let (mut x, mut departures) = (place.x.clone(), Vec::new());
        for disc in &system.discs {
            let leaves = choice.zeros[disc.pair] == Zero::Right
                && place.z[disc.slip] <= bands[disc.pair]
                && reduced.unknowns.contains(&disc.slip);
            if !leaves {
                continue;
            }
            let u = disc.alphas.map(|z| 2.0 * choice.u[z] - 1.0);
            let rate = choice.u[disc.slip];
            let least = f64::max(0.5 * bands[disc.pair], AT_ONCE * self.step * rate.abs());
            let speed = DEPARTS * least;
            let point = Point {
                x: &x,
                ..place.point(numbers)
            };
            x = with_slip(system, point, &place.z, disc, u.map(|u| speed * u));
            departures.push(Departure {
                slip: disc.slip,
                speed,
                rate,
            });
        }
        (x, departures)
    }

    /// Takes note of what sets off.
    pub fn keep(&mut self, discs: &[Disc], place: &mut Place, departures: Vec<Departure>) {
        self.stops.resize(discs.len(), 0.0);
        for departure in &departures {
            place.z[departure.slip] = departure.speed;
            for (disc, stop) in discs.iter().zip(&mut self.stops) {
                if disc.slip == departure.slip {
                    *stop = stop.max(departure.speed / DEPARTS);
                }
            }
        }
        self.departures = departures;
        self.at = place.t;
    }
}

/// Sets slip velocities that are next to none to zero; the others slip.
pub(crate) fn rest(
    system: &ComplementaritySystem,
    bands: &[f64],
    numbers: &[f64],
    place: &mut Place,
) {
    for disc in &system.discs {
        if place.z[disc.slip] > bands[disc.pair] {
            place.zeros[disc.pair] = Zero::Right;
            continue;
        }
        let x = with_slip(system, place.point(numbers), &place.z, disc, [0.0; 2]);
        for ((low, x), before) in place.low.iter_mut().zip(&x).zip(&place.x) {
            if x != before {
                *low = 0.0;
            }
        }
        place.x = x;
        place.z[disc.slip] = 0.0;
    }
}

/// x moved as little as possible so that w has this value.
fn with_slip(
    system: &ComplementaritySystem,
    point: Point,
    z: &[f64],
    disc: &Disc,
    target: [f64; 2],
) -> Vec<f64> {
    let (mut x, full) = (point.x.to_vec(), &system.full);
    let n = x.len();
    let mut inputs = point.with(z);
    inputs[1 + n + disc.slip] = 0.0;
    let mut values = vec![0.0; full.equations.n_outputs()];
    let mut scratch = full.equations.scratch();
    full.equations.eval(&inputs, &mut values, &mut scratch);
    let missing = [0, 1].map(|k| target[k] - values[n + disc.rows[k]]);
    let slopes = slopes(system, &inputs);
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
    if shares.iter().all(|share| share.is_finite()) {
        for (i, x) in x.iter_mut().enumerate() {
            *x += shares[0] * first[i] + shares[1] * second[i];
        }
    }
    x
}
