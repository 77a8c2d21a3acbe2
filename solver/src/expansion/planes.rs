//! Switching functions that come in twos: w = (ψ_i, ψ_j), a slip velocity with two entries, vanishes at a point of a plane.
//!
//! Neither ψ = 0 alone is an event. What is monitored is w·d with the direction d = w/|w| at the start of a step. Rates have
//! u = w/|w| while w is not zero, whose derivatives have no bound at w = 0.

use super::mode::Mode;
use crate::expansion::scales::{Bands, Scales};
use crate::hybrid::{HybridSystem, Side};

/// What is monitored of two switching functions, by the first of their switches.
#[derive(Clone, Default)]
struct Plane {
    /// The other switch.
    other: usize,
    /// d.
    direction: [f64; 2],
    /// The series of w·d.
    series: Vec<f64>,
    /// The states whose rates have u in them.
    states: Vec<usize>,
    /// Whether w was not zero when sizes of terms were measured last.
    slipped: bool,
}

/// The pairs of a system, by switch.
pub(crate) struct Planes {
    of: Vec<Option<Plane>>,
    /// Switches of those that leave w = 0 within the step.
    pub onsets: Vec<usize>,
}

impl Planes {
    pub fn new(system: &HybridSystem) -> Self {
        let plane = |i: usize| {
            let other = system.second(i)?;
            let is_read = |switch: &usize| [i, other].contains(switch);
            let blocks = system.blocks.iter();
            let blocks = blocks.filter(|block| block.switches.iter().any(is_read));
            Some(Plane {
                other,
                states: blocks.flat_map(|block| block.states.clone()).collect(),
                ..Plane::default()
            })
        };
        Planes {
            of: (0..system.n_switches()).map(plane).collect(),
            onsets: Vec::new(),
        }
    }

    /// Whether the system has any.
    pub fn any(&self) -> bool {
        self.of.iter().any(Option::is_some)
    }

    /// The series of w·d, of the first entry of two.
    pub fn series(&self, switch: usize) -> Option<&[f64]> {
        self.of[switch].as_ref().map(|plane| &plane.series[..])
    }
}

impl Mode {
    /// Whether |ψ| where the point is is below its band, of two entries both.
    pub(crate) fn is_near(&mut self, switch: usize, bands: &Bands) -> bool {
        let is_near = |mode: &mut Mode, i: usize| mode.psi(i).abs() <= bands.width[i];
        let other = self.system.second(switch);
        is_near(self, switch) && other.is_none_or(|other| is_near(self, other))
    }

    /// Whether ψ, or one of two, cannot vanish within a step.
    pub(crate) fn keeps_off(&mut self, switch: usize, h: f64) -> bool {
        let all = [Some(switch), self.system.second(switch)];
        all.into_iter().flatten().any(|i| {
            let (values, reach) = (&self.memory.values, &self.monitored.reach);
            self.surfaces.stays_away(i, values, reach, h)
        })
    }

    /// ψ where the point is, or w·d.
    pub(crate) fn monitored_psi(&mut self, switch: usize) -> f64 {
        match self.planes.of[switch]
            .as_ref()
            .map(|plane| (plane.other, plane.direction))
        {
            Some((other, [d, e])) => d * self.psi(switch) + e * self.psi(other),
            None => self.psi(switch),
        }
    }

    /// True when the last evaluation, at the end of the step, has left a surface behind that the
    /// series did not see.
    pub(crate) fn on_wrong_side(&mut self, bands: &Bands) -> bool {
        for at in 0..self.monitored.switches.len() {
            let i = self.monitored.switches[at];
            if !bands.armed[i] && self.monitored_psi(i) * self.sides[i].sign() < -bands.width[i] {
                return true;
            }
        }
        false
    }

    /// Watches w along the direction that it has where the point is.
    pub(crate) fn aim(&mut self, switch: usize) {
        let Some(mut plane) = self.planes.of[switch].take() else {
            return;
        };
        plane.direction = direction([switch, plane.other].map(|i| self.psi(i)));
        self.planes.of[switch] = Some(plane);
    }

    /// Whether what is monitored is affine in time and states.
    pub(crate) fn is_monitored_affine(&self, switch: usize) -> bool {
        let all = [Some(switch), self.system.second(switch)];
        all.into_iter()
            .flatten()
            .all(|i| self.surfaces.is_affine(i))
    }

    /// Joins the series of both entries to that of w·d.
    pub(crate) fn expand_along(&mut self, switch: usize) {
        let Some(mut plane) = self.planes.of[switch].take() else {
            return;
        };
        let [first, second] = [switch, plane.other].map(|i| {
            let start = self.surfaces.row(i);
            &self.memory.rows[start..=start + self.order]
        });
        plane.direction = direction([first[0], second[0]]);
        let [d, e] = plane.direction;
        let terms = first.iter().zip(second);
        plane.series.clear();
        plane.series.extend(terms.map(|(a, b)| d * a + e * b));
        self.planes.of[switch] = Some(plane);
    }

    /// Whether some contact slips with two entries.
    pub(crate) fn slips_in_a_plane(&self) -> bool {
        (0..self.planes.of.len()).any(|i| self.slips_by(i))
    }

    /// Whether a contact slips with two entries, of which this is the first one.
    pub(crate) fn slips_by(&self, switch: usize) -> bool {
        let is_off = self.sides[switch] != Side::Slide && !self.system.is_idle(switch, &self.sides);
        self.planes.of[switch].is_some() && is_off
    }

    /// What rounding does to w is so many times as large in w/|w| where the point is, of all that slips in a plane: close
    /// to w = 0 forces are not known better.
    pub(crate) fn roundings_of_direction(&mut self, bands: &Bands) -> f64 {
        let mut most = 0.0_f64;
        for i in 0..self.planes.of.len() {
            if let Some(other) = self.system.second(i).filter(|_| self.slips_by(i)) {
                let terms = bands.terms[i].max(bands.terms[other]);
                most = most.max(terms / self.psi(i).hypot(self.psi(other)));
            }
        }
        most
    }

    /// The same, once the terms of all such w have been measured.
    pub(crate) fn measure_directions(&mut self, bands: &mut Bands) -> f64 {
        for i in 0..self.planes.of.len() {
            if let Some(other) = self.system.second(i).filter(|_| self.slips_by(i)) {
                self.measure_terms_of_psi(i, bands);
                self.measure_terms_of_psi(other, bands);
            }
        }
        self.roundings_of_direction(bands)
    }

    /// Forgets how large the terms of what slips in a plane were: next to rest, what rounding does to a direction is large
    /// for as long as it is next to rest.
    pub(crate) fn forget_directions(&mut self, scales: &mut Scales) {
        for i in 0..self.planes.of.len() {
            let slips = self.slips_by(i);
            if let Some(plane) = &mut self.planes.of[i]
                && (std::mem::replace(&mut plane.slipped, slips) || slips)
            {
                plane.states.iter().for_each(|&j| scales.activity[j] = 0.0);
            }
        }
    }

    /// Changes what each w is made of by a share of itself, in the way that turns w/|w| most.
    pub(crate) fn perturb_directions(&mut self) {
        let by = self.terms.share;
        for i in 0..self.planes.of.len() {
            let Some(other) = self.system.second(i).filter(|_| self.slips_by(i)) else {
                continue;
            };
            let [d, e] = direction([i, other].map(|k| self.psi(k)));
            for (k, across) in [(i, -e), (other, d)] {
                self.surfaces.linearize(k, &self.memory.values);
                let time = std::iter::once((0, self.surfaces.time_gradient(k)));
                let states = self.surfaces.gradient(k).iter();
                for (at, g) in time.chain(states.map(|&(j, g)| (1 + j, g))) {
                    let input = self.memory.values[at];
                    self.terms.perturbed[at] = input + by * input.abs() * (across * g).signum();
                }
            }
        }
    }

    /// Cuts all series before their first term that is no number: close to w = 0 terms grow with their order until they
    /// overflow. What is cut off too early shows in the defect of a step.
    pub(crate) fn cut_overflow(&mut self) {
        let starts = (0..self.n)
            .flat_map(|i| [self.memory.state(i), self.field.rows[i]])
            .chain(self.sliding.iter().map(|&i| self.memory.alpha(i)));
        let starts: Vec<usize> = starts.collect();
        let rows = &mut self.memory.rows;
        let is_finite = |k: &usize| starts.iter().all(|start| rows[start + k].is_finite());
        // Values that are no numbers end the run.
        let Some(end) = (0..=self.order).find(|k| !is_finite(k)).filter(|k| *k > 0) else {
            return;
        };
        for start in starts {
            rows[start + end..=start + self.order].fill(0.0);
        }
    }

    /// Whether a slip velocity that sets off has the direction that its α say, where the point is.
    pub(crate) fn goes_along(&mut self, switch: usize, scales: &Scales, allowed: f64) -> bool {
        let Some(other) = self.system.second(switch) else {
            return true;
        };
        let [first, second] = [switch, other].map(|i| {
            self.surfaces.linearize(i, &self.memory.values);
            let size = self.surfaces.weigh(i, |j| scales.size(j));
            (
                self.psi(i),
                2.0 * self.memory.values[1 + self.n + i] - 1.0,
                size,
            )
        });
        let speed = first.0.hypot(second.0);
        let rounding = 64.0 * f64::EPSILON * (first.2 + second.2);
        let off = (first.0 - speed * first.1).hypot(second.0 - speed * second.1);
        off <= allowed * speed + rounding
    }
}

/// w/|w|, or any direction where w is zero.
fn direction(w: [f64; 2]) -> [f64; 2] {
    let speed = w[0].hypot(w[1]);
    match speed > 0.0 {
        true => w.map(|w| w / speed),
        false => [1.0, 0.0],
    }
}
