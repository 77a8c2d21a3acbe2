//! The next mode where several switches meet that interact, nonlinear ones among them.
//!
//! Their dummy systems are one, dz_i/dτ = c_i φ_i(α), α = min(max(z, 0), 1), started at the α of the sides that the
//! state comes from. What it tends to is the next mode: a switch slides where z_i stays between 0 and 1, and leaves
//! where z_i does for ever. Fixed points do not depend on the rates c_i, which say how steep the switches are,
//! but their basins and stability may; so several are tried, and different outcomes are reported.

use std::sync::Arc;

use super::judge::Judge;
use super::nonlinear::ScalarRate;
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::TIE;
use crate::hybrid::point::Point;
use crate::hybrid::status::Candidate;
use crate::hybrid::{Few, HybridSystem, Role, Settings, Side, Status};
use crate::linalg::DenseLu;
use crate::selector::selection::{Choice, Decision, Entry, fastest};

/// Steepness of one switch relative to that of the others.
const STEEPNESS: [f64; 2] = [8.0, 0.125];

/// Steps before the dummy system counts as one without a limit.
const MAX_STEPS: usize = 20_000;

/// Error of its steps.
const ACCURACY: f64 = 1e-6;

/// Distance to a fixed point at which it counts as reached.
const REACHED: f64 = 1e-5;

/// Outcomes that are closer are one.
const SAME: f64 = 1e-7;

/// What a fold is left by.
const NUDGE: f64 = 1e-3;

/// The dummy system of a group in focus.
struct Dummy<'m> {
    mode: &'m mut Mode,
    group: &'m [usize],
    /// α of all switches.
    alphas: Vec<f64>,
    /// c_i, with the inverse sizes of the rates.
    speeds: Vec<f64>,
    scales: &'m [f64],
}

/// What a dummy system tends to.
#[derive(Clone)]
struct Way {
    sides: Vec<Side>,
    alpha: Vec<f64>,
    /// The switches, by their places, that leave their surface with a rate that vanishes.
    tied: Vec<usize>,
}

impl Dummy<'_> {
    fn set(&mut self, z: &[f64]) {
        for (&i, z) in self.group.iter().zip(z) {
            self.alphas[i] = z.clamp(0.0, 1.0);
        }
        self.mode.vary(&self.alphas);
        self.mode.linearize(self.group);
    }

    fn rate(&mut self, z: &[f64]) -> Vec<f64> {
        self.set(z);
        let rates = self.group.iter().zip(&self.speeds);
        rates.map(|(&i, c)| c * self.mode.phi(i)).collect()
    }

    /// The α and sides that it tends to; none where it does not come to rest.
    fn limit(&mut self, mut z: Vec<f64>) -> Option<Way> {
        let (mut h, mut first) = (0.01_f64, self.rate(&z));
        for step in 0..MAX_STEPS {
            // Bogacki and Shampine's pair of orders 3 and 2.
            let along = |z: &[f64], terms: &[(f64, &[f64])]| -> Vec<f64> {
                let sum = |at: usize| terms.iter().map(|(c, k)| c * k[at]).sum::<f64>();
                (0..z.len()).map(|at| z[at] + sum(at)).collect()
            };
            let second = self.rate(&along(&z, &[(0.5 * h, &first)]));
            let third = self.rate(&along(&z, &[(0.75 * h, &second)]));
            let next = along(
                &z,
                &[
                    (2.0 / 9.0 * h, &first),
                    (h / 3.0, &second),
                    (4.0 / 9.0 * h, &third),
                ],
            );
            let fourth = self.rate(&next);
            let errors = (0..z.len()).map(|at| {
                let low = 5.0 / 72.0 * first[at] - second[at] / 12.0 - third[at] / 9.0;
                (h * (low + 0.125 * fourth[at])).abs()
            });
            let error = errors.fold(0.0, f64::max);
            if error.is_nan() {
                return None;
            }
            let factor = 0.9 * (ACCURACY / error.max(1e-12)).cbrt();
            if error <= ACCURACY {
                (z, first) = (next, fourth);
                if step % 8 == 0
                    && let Some(found) = self.rest_near(&z)
                {
                    return Some(found);
                }
            }
            h = (h * factor.clamp(0.2, 4.0)).min(10.0);
        }
        None
    }

    /// The fixed point of the sides that z has, where it is close.
    fn rest_near(&mut self, z: &[f64]) -> Option<Way> {
        let side = |z: &f64| match *z {
            z if z <= TIE => Side::Minus,
            z if z >= 1.0 - TIE => Side::Plus,
            _ => Side::Slide,
        };
        let sides: Vec<Side> = z.iter().map(side).collect();
        let free: Vec<usize> = (0..z.len())
            .filter(|&at| sides[at] == Side::Slide)
            .collect();
        let mut alpha: Vec<f64> = z.iter().map(|z| z.clamp(0.0, 1.0)).collect();
        let (mut lu, mut rhs) = (DenseLu::new(free.len()), vec![0.0; free.len()]);
        for _ in 0..20 {
            self.set(&alpha);
            let mut matrix = Vec::new();
            for (rhs, &row) in rhs.iter_mut().zip(&free) {
                let row = self.group[row];
                *rhs = self.mode.phi(row);
                matrix.extend(
                    free.iter()
                        .map(|&at| self.mode.coupling(row, self.group[at])),
                );
            }
            let change = match free.is_empty() {
                true => 0.0,
                false => {
                    lu.factor(&matrix).ok()?;
                    lu.solve(&mut rhs);
                    for (&at, delta) in free.iter().zip(&rhs) {
                        alpha[at] -= delta;
                    }
                    rhs.iter().fold(0.0_f64, |m, delta| m.max(delta.abs()))
                }
            };
            let is_close = free.iter().all(|&at| (alpha[at] - z[at]).abs() <= REACHED);
            if !is_close {
                return None;
            }
            if change <= 1e-13 {
                self.set(&alpha);
                let mut way = Way {
                    sides,
                    alpha,
                    tied: Vec::new(),
                };
                for at in (0..z.len()).filter(|at| way.sides[*at] != Side::Slide) {
                    let rate = self.mode.phi(self.group[at]) * way.sides[at].sign();
                    if rate < -TIE * self.scales[at] {
                        return None;
                    }
                    if rate <= TIE * self.scales[at] {
                        way.tied.push(at);
                    }
                }
                return Some(way);
            }
        }
        None
    }
}

/// Decides switches that interact, nonlinear ones among them.
pub(crate) struct Several<'a> {
    mode: &'a mut Mode,
    system: Arc<HybridSystem>,
    settings: &'a Settings,
}

impl<'a> Several<'a> {
    /// In a mode, as the settings of a run say.
    pub(crate) fn new(mode: &'a mut Mode, settings: &'a Settings) -> Self {
        Several {
            system: mode.system.clone(),
            mode,
            settings,
        }
    }

    /// Decides a group of switches that interact, nonlinear ones among them.
    pub(crate) fn decide(
        &mut self,
        state: &mut State,
        group: &[usize],
        wanted: &[Option<Side>],
        t1: f64,
    ) -> Result<bool, Status> {
        let undetermined = || Status::Undetermined {
            switches: group.to_vec(),
        };
        let is_step = |&i: &usize| {
            self.system.role(i) == Role::Step
                && !self.system.is_unilateral(i)
                && self.system.slip_of(i).is_none()
        };
        if !group.iter().all(is_step) {
            return Err(undetermined());
        }
        let starts = self.starts(state, group);
        let (scales, sizes) = self.sizes(state, group).ok_or_else(undetermined)?;
        let ways = self.ways(&state.point, group, &starts, [&scales, &sizes]);
        let mut ways = ways.ok_or_else(undetermined)?;
        if ways.len() > 1 {
            let name = |way: &Way| -> Candidate {
                let sides = way.sides.iter().copied();
                group.iter().copied().zip(sides).collect()
            };
            let found = Status::NonUnique(ways.iter().map(name).collect());
            let fits = |way: &Way| {
                let mut pairs = way.sides.iter().zip(wanted);
                wanted.iter().any(Option::is_some)
                    && pairs.all(|(side, wanted)| wanted.is_none_or(|wanted| *side == wanted))
            };
            ways.retain(fits);
            if ways.len() != 1 {
                return Err(found);
            }
        }
        let way = ways.pop().ok_or_else(undetermined)?;
        let Way { sides, alpha, .. } = self
            .untied(state, group, way, t1)
            .ok_or_else(undetermined)?;
        self.tell_several(state, group, &sides, &alpha)?;
        Ok(true)
    }

    /// What rates of a group are relative to, and their sizes, without what a short step before says of their rounding;
    /// nothing where a rate has no size.
    fn sizes(&mut self, state: &State, group: &[usize]) -> Option<(Few<f64>, Few<f64>)> {
        let corners = [0.0, 1.0].map(|end| {
            let mut alphas = state.point.alpha.clone();
            group.iter().for_each(|&i| alphas[i] = end);
            self.mode.vary(&alphas);
            let states = self.mode.focus.states.iter();
            Choice {
                sides: Few::new(),
                alpha: Few::new(),
                f: states.map(|&state| self.mode.field.f[state]).collect(),
            }
        });
        let fastest = fastest(&corners);
        let scales = Judge::new(self.mode, self.settings).rates(state, group, &fastest);
        if scales.iter().any(|scale| *scale <= 0.0) {
            return None;
        }
        let size = |(&i, scale): (&usize, &f64)| {
            let largest =
                |state: usize| fastest(self.mode.focus.states.partition_point(|&j| j < state));
            let size =
                self.mode.surfaces.weigh(i, largest) + self.mode.surfaces.time_gradient(i).abs();
            if size > 0.0 { size } else { *scale }
        };
        let sizes = group.iter().zip(&scales).map(size).collect();
        Some((scales, sizes))
    }

    /// What the dummy system tends to from these starts, one switch after another steeper or flatter than the others;
    /// nothing where it has no limit.
    fn ways(
        &mut self,
        point: &Point,
        group: &[usize],
        starts: &[Vec<f64>],
        [scales, sizes]: [&[f64]; 2],
    ) -> Option<Vec<Way>> {
        let mut ways: Vec<Way> = Vec::new();
        for start in starts {
            for trial in 0..=STEEPNESS.len() * group.len() {
                let mut speeds: Vec<f64> = sizes.iter().map(|size| 1.0 / size).collect();
                if let Some(steeper) = trial.checked_sub(1) {
                    speeds[steeper / STEEPNESS.len()] *= STEEPNESS[steeper % STEEPNESS.len()];
                }
                let mut dummy = Dummy {
                    mode: self.mode,
                    group,
                    alphas: point.alpha.clone(),
                    speeds,
                    scales,
                };
                let way = dummy.limit(start.clone())?;
                let known = |other: &Way| {
                    let mut pairs = other.alpha.iter().zip(&way.alpha);
                    other.sides == way.sides && pairs.all(|(a, b)| (a - b).abs() <= SAME)
                };
                if !ways.iter().any(known) {
                    ways.push(way);
                }
            }
        }
        Some(ways)
    }

    /// The same where the series say so of switches that leave with a rate that vanishes, or with these sliding.
    fn untied(&mut self, state: &mut State, group: &[usize], way: Way, t1: f64) -> Option<Way> {
        if way.tied.is_empty() {
            return Some(way);
        }
        let mut slides = way.clone();
        for &at in &way.tied {
            slides.sides[at] = Side::Slide;
        }
        let units = vec![1.0; group.len()];
        let mut agrees = |way: &Way| {
            let choice = Choice {
                sides: Few::from_slice(&way.sides),
                alpha: Few::from_slice(&way.alpha),
                f: Few::new(),
            };
            let verdict =
                Judge::new(self.mode, self.settings).verdict(state, group, &choice, &units, t1);
            verdict.is_some_and(|verdict| verdict.agrees)
        };
        let found = [way, slides].into_iter().find(|way| agrees(way));
        let sides = state.point.sides_sliding(group);
        self.mode.enter(&sides);
        self.mode
            .focus(state.point.t, &state.point.x, &state.point.alpha, group);
        found
    }

    /// Where the dummy system of a group may start: at one point, or at every corner that nobody knows better.
    fn starts(&self, state: &State, group: &[usize]) -> Vec<Vec<f64>> {
        let mut starts = vec![Vec::new()];
        for &i in group {
            let turn = state.selection.fold.as_ref().and_then(|fold| fold.turn(i));
            let nudge = turn.map_or(0.0, |turn| NUDGE * turn.direction);
            let values: &[f64] = match state.selection.entry[i] {
                Entry::Present => &[state.point.alpha[i] + nudge],
                Entry::From(alpha) => &[alpha],
                Entry::Unknown => &[0.0, 1.0],
            };
            let extended = starts.iter().flat_map(|start: &Vec<f64>| {
                values
                    .iter()
                    .map(move |value| [&start[..], &[*value]].concat())
            });
            starts = extended.collect();
        }
        starts
    }

    /// Takes what has been decided, with the sliding modes of every nonlinear switch while the others stay.
    fn tell_several(
        &mut self,
        state: &mut State,
        group: &[usize],
        chosen: &[Side],
        alpha: &[f64],
    ) -> Result<(), Status> {
        let folded = state.selection.fold.as_ref().map(|fold| fold.switch);
        let mut alphas = state.point.alpha.clone();
        for (&i, &a) in group.iter().zip(alpha) {
            alphas[i] = a;
        }
        for (at, &i) in group.iter().enumerate() {
            if !self.mode.system.switches[i].is_nonlinear {
                continue;
            }
            let mut rate = ScalarRate::of(self.mode, i, &mut alphas);
            let modes = rate.sliding_modes();
            alphas[i] = alpha[at];
            let modes = modes.map_err(|_| Status::Undetermined {
                switches: group.to_vec(),
            })?;
            let distance = |a: f64| (a - alpha[at]).abs();
            let nearest = modes.iter().map(|mode| mode.alpha);
            let nearest = nearest.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
            state.selection.decisions.push(Decision {
                switch: i,
                taken: nearest.filter(|_| chosen[at] == Side::Slide),
                modes,
                folds: folded == Some(i),
            });
        }
        state.point.change_sides(group, chosen);
        for (&i, &a) in group.iter().zip(alpha) {
            state.point.alpha[i] = a;
            state.selection.entry[i] = Entry::Present;
        }
        Ok(())
    }
}
