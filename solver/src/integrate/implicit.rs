//! One implicit step: solve, cut at the first event, and check.
//!
//! An event is found as a root of the step's polynomials, and then located by the length of the step
//! that ends on it, so that it is as accurate as a step's end.

use super::radau::{Implicit, Radau, Shape, Start};
use super::singular_rates::{outgrows, unseen_roots};
use super::step::{Step, step_failure};
use super::stepper::Stepper;
use super::stiffness::worth;
use super::watch::{Watch, first_event, is_at_end, met, simultaneous, verify_start};
use crate::event::state::{State, Trial};
use crate::events::grazing::Grazing;
use crate::events::roots::{Root, RootFinder};
use crate::events::unseen::Unseen;
use crate::expansion::dense::{Dense, place_of};
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::scales::{Bands, ROUNDINGS};
use crate::expansion::series;
use crate::expansion::step_size::StepSize;
use crate::expansion::taylor::Expansion;
use crate::hybrid::{Few, Side, Stats, Status};

/// Steps rejected in a row, for what their polynomials missed, before the method is given up.
const MAX_REJECTED: usize = 30;

/// Newton steps on the length of a step that ends at an event.
const MAX_POLISH: usize = 8;

/// Difference of a polynomial of ψ from ψ, in tolerances.
const UNSEEN: f64 = 100.0;

/// Relative length of a difference along the flow.
const NUDGE: f64 = 1e-7;

/// What implicit steps need besides the method's own memory.
#[derive(Default)]
pub(crate) struct Workspace {
    /// α of all switches at the point.
    alphas: Vec<f64>,
    y: Vec<f64>,
    /// Polynomials of the ψ that are monitored, one after another.
    pub psi: Vec<f64>,
    /// Their values at the start and the nodes.
    values: Vec<f64>,
    /// ∇ψ before a difference along the flow is taken.
    gradient: Vec<f64>,
    f: Vec<f64>,
    /// Switches with roots of a ψ that is not seen where the step starts, and |ψ|.
    unseen_roots: Vec<(usize, f64)>,
}

impl Stepper {
    /// Takes an implicit step; none where that is not possible.
    pub(crate) fn implicit_step(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        t1: f64,
    ) -> Result<Option<Step>, Status> {
        let look = self.stiffness.wants_series();
        let mut alpha = std::mem::take(&mut state.point.alpha);
        let solved = if look {
            Expansion { mode }.around(state.point.t, &state.point.x, &mut alpha)
        } else {
            mode.start(state.point.t, &state.point.x, &mut alpha)
        };
        state.scales.measure(mode, &mut state.bands);
        let remaining = t1 - state.point.t;
        (state.scales).measure_held(mode, &state.point, &state.bands, remaining);
        state.point.alpha = alpha;
        if solved.is_err() {
            return Err(step_failure(mode));
        }
        if look {
            let tolerance = self.local_tolerance;
            let step_size = StepSize { mode, tolerance };
            self.stiffness.explicit_length = step_size.of_states(&state.scales, remaining);
        }
        let mut start = std::mem::take(&mut self.stiffness.start);
        let mut stiff = Stiff {
            mode,
            work: &mut self.workspace,
        };
        stiff.write_start(state, &mut start);
        let shape = Shape {
            states: mode.n,
            algebraic: mode.sliding.len(),
        };
        let mut radau = self.stiffness.take(shape);
        let step = self.attempts(mode, &mut radau, &start, state, t1);
        count(&mut state.report.stats, &mut radau);
        self.stiffness.give_back(radau);
        self.stiffness.start = start;
        if let Ok(None) = step {
            self.stiffness.give_up();
        }
        step
    }

    fn attempts(
        &mut self,
        mode: &mut Mode,
        radau: &mut Radau,
        start: &Start,
        state: &mut State,
        t1: f64,
    ) -> Result<Option<Step>, Status> {
        let tolerance = self.local_tolerance;
        let remaining = state.point.remaining(t1);
        if let Some(length) = self.stiffness.first_length() {
            radau.restart(length);
        }
        let mut stiff = Stiff {
            mode,
            work: &mut self.workspace,
        };
        unseen_roots(stiff.mode, state, tolerance, &mut stiff.work.unseen_roots);
        for _ in 0..MAX_REJECTED {
            // The longest step that the tolerance allows, and the first event within it.
            let Ok(h) = radau.step(&mut stiff, start, remaining) else {
                return Ok(None);
            };
            stiff.monitor_along(radau, start, &mut state.bands);
            let mut seen = stiff.is_faithful(radau, start, &state.bands, tolerance)
                && stiff.vouches(radau, start, state, tolerance, &mut self.unseen);
            let closeness = self.tolerance;
            let cut = stiff.cut(&mut self.roots, radau, start, state, h, closeness)?;
            let Some(cut) = cut else {
                return Ok(None);
            };
            seen &= cut.is_located;

            // What the polynomials did not see shows at the end.
            stiff.write_end(radau, start, cut.length, &mut state.trial);
            let mode = &mut *stiff.mode;
            mode.eval(start.t + cut.length, &state.trial.x, &state.trial.alpha);
            seen &= !outgrows(mode, &stiff.work.unseen_roots);
            let unseen = cut.event.is_none() && state.bands.leave_behind(mode);
            if !seen || unseen || mode.turned_over() {
                state.report.stats.rejected += 1;
                radau.limit_next(0.5 * h);
                continue;
            }
            // What is not monitored any more since the step ends earlier does not come close.
            state
                .approaches
                .close
                .retain(|(i, _)| mode.monitored.switches.contains(i));
            let met = met(cut.event).filter(|(i, _)| mode.monitored.switches.contains(i));
            let dense = Dense::Collocation(mode, radau, &stiff.work.psi);
            Grazing::new(dense, closeness).note(state, cut.length, met);
            accept(state, radau, h);
            let worth = worth(mode, radau.degree());
            self.stiffness.after_implicit(h, worth);
            return Ok(Some(Step {
                length: cut.length,
                reaches_end: cut.length >= remaining,
                triggers: cut.triggers,
                defect: radau.error(),
                implicit: true,
                ..Step::default()
            }));
        }
        Ok(None)
    }
}

/// Takes over what the method has counted in a step.
fn count(stats: &mut Stats, radau: &mut Radau) {
    let counts = std::mem::take(&mut radau.counts);
    stats.rejected += counts.rejected;
    stats.rhs_evaluations += counts.evaluations;
    stats.newton_iterations += counts.iterations;
    stats.factorizations += counts.factorizations;
}

/// Moves to the end of a step; `length` is what it would have been without an event.
fn accept(state: &mut State, radau: &Radau, length: f64) {
    std::mem::swap(&mut state.point.x, &mut state.trial.x);
    std::mem::swap(&mut state.point.alpha, &mut state.trial.alpha);
    // The terms of stiff rates are large, but what rounding does to them is damped.
    for (i, activity) in state.scales.activity.iter_mut().enumerate() {
        *activity = radau.noise(i) / radau.reach();
    }
    state.scales.last_step = length;
    state.report.stats.implicit_steps += 1;
}

/// Where an event cuts a step.
struct Cut {
    event: Option<(Root, Watch)>,
    length: f64,
    /// The switches that the event is of.
    triggers: Few<usize>,
    /// Whether the step that ends there could be solved.
    is_located: bool,
}

/// A mode as the implicit method sees it.
struct Stiff<'a> {
    mode: &'a mut Mode,
    work: &'a mut Workspace,
}

impl Stiff<'_> {
    /// True where the polynomials of the step solved last are what they stand for between the nodes and probes, too.
    fn vouches(
        &mut self,
        radau: &mut Radau,
        start: &Start,
        state: &mut State,
        tolerance: f64,
        unseen: &mut Unseen,
    ) -> bool {
        let h = radau.reach();
        unseen.begin_implicit(self.mode, radau, h);
        while let Some(tau) = unseen.next(self.mode, start.t, |_| 0.0) {
            let agrees = radau.error_at(self, start, tau) < UNSEEN
                && self.is_faithful_at(tau, radau, start, &state.bands, tolerance);
            if !agrees {
                return false;
            }
        }
        unseen.tell(self.mode, state);
        true
    }

    /// Where the first event within a step of length h cuts it; none where the method is not for what is met.
    fn cut(
        &mut self,
        roots: &mut RootFinder,
        radau: &mut Radau,
        start: &Start,
        state: &mut State,
        h: f64,
        closeness: f64,
    ) -> Result<Option<Cut>, Status> {
        let dense = Dense::Collocation(self.mode, radau, &self.work.psi);
        let mut cut = Cut {
            event: first_event(roots, dense, state, h, closeness),
            length: h,
            triggers: Few::new(),
            is_located: true,
        };
        let Some((root, watch)) = cut.event else {
            return Ok(Some(cut));
        };
        // What slips in two directions turns too fast where it stops.
        if let Watch::Surface(i) = watch
            && self.mode.system.switches[i].is_in_disc()
        {
            return Ok(None);
        }
        verify_start(dense, &state.bands, root.tau, watch, h)?;
        let at_end = is_at_end(dense, root.tau, h, watch);
        cut.length = if at_end { h } else { root.tau };
        if !at_end && start.t + cut.length > start.t {
            match self.locate(radau, start, root, watch, h) {
                Some(tau) => cut.length = tau,
                None => cut.is_located = false,
            }
            self.monitor_along(radau, start, &mut state.bands);
        }
        let dense = Dense::Collocation(self.mode, radau, &self.work.psi);
        let (length, reach) = (cut.length, radau.reach());
        cut.triggers = simultaneous(dense, &state.bands, length, reach, watch.switch());
        Ok(Some(cut))
    }

    /// The length of the step that ends where `watch` is zero, by Newton's method from the root of its
    /// polynomial; that step is then the one solved last. None where it cannot be solved, or where only
    /// the polynomial has a root, as when a surface has just been left at a small angle.
    fn locate(
        &mut self,
        radau: &mut Radau,
        start: &Start,
        root: Root,
        watch: Watch,
        h: f64,
    ) -> Option<f64> {
        let (mut tau, mut last) = (root.tau, f64::INFINITY);
        for _ in 0..MAX_POLISH {
            radau.solve(self, start, tau).ok()?;
            // A double root is no better known from the function than from its polynomial.
            if !root.crosses {
                break;
            }
            let (value, slope) = self.event_function(radau, start, tau, watch);
            let next = (tau - value / slope).min(h);
            let moved = (next - tau).abs();
            let rounding = f64::EPSILON * (start.t.abs() + tau);
            if moved <= rounding || moved >= last {
                break;
            }
            if moved.is_nan() || next <= 0.0 || moved > 1e-3 * h {
                return None;
            }
            (tau, last) = (next, moved);
        }
        if radau.reach() != tau {
            radau.solve(self, start, tau).ok()?;
        }
        Some(tau)
    }

    /// ψ, or the distance of α to its bound, at the end of the step `tau` solved last, and its slope.
    fn event_function(
        &mut self,
        radau: &Radau,
        start: &Start,
        tau: f64,
        watch: Watch,
    ) -> (f64, f64) {
        match watch {
            Watch::Surface(i) => {
                let mut y = std::mem::take(&mut self.work.y);
                for (row, y) in y.iter_mut().enumerate() {
                    *y = radau.end(start, row);
                }
                self.place(start.t + tau, &y);
                self.work.y = y;
                self.mode.field.eval(&self.mode.memory.values);
                self.mode.linearize(&[i]);
                (self.mode.psi(i), self.mode.phi(i))
            }
            Watch::Bound(i, limit) => {
                let row = place_of(self.mode, i);
                let slope = series::slope(radau.series(row), tau);
                (radau.end(start, row) - limit, slope)
            }
            Watch::Disc(i) => {
                let row = |i: usize| place_of(self.mode, i);
                let entries = std::iter::once(i)
                    .chain(self.mode.system.second(i))
                    .map(row);
                entries.fold((1.0, 0.0), |(value, slope), row| {
                    let u = 2.0 * radau.end(start, row) - 1.0;
                    let rate = series::slope(radau.series(row), tau);
                    (value - u * u, slope - 4.0 * u * rate)
                })
            }
        }
    }

    /// Adds d∇ψ/dt along the flow f to the rows of φ, by differences.
    fn add_curvature(&mut self, t: f64, y: &[f64], rows: &mut [f64]) {
        let largest = |v: &[f64]| v.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let (size, speed) = (largest(&y[..self.mode.n]), largest(&self.mode.field.f));
        let over = |v: f64| if v > 0.0 { v } else { 1.0 };
        let nudge = NUDGE * over(size) / over(speed);
        for (at, row) in rows.chunks_mut(y.len()).enumerate() {
            let i = self.mode.sliding[at];
            if self.mode.surfaces.is_affine(i) {
                continue;
            }
            self.place(t, y);
            let mode = &mut *self.mode;
            mode.linearize(&[i]);
            let mut before = std::mem::take(&mut self.work.gradient);
            before.clear();
            before.extend(mode.surfaces.gradient(i).iter().map(|entry| entry.1));
            mode.memory.values[0] += nudge;
            for (value, f) in mode.memory.values[1..].iter_mut().zip(&self.work.f) {
                *value += nudge * f;
            }
            mode.linearize(&[i]);
            for (&(state, after), before) in mode.surfaces.gradient(i).iter().zip(&before) {
                row[state] += (after - before) / nudge;
            }
            self.work.gradient = before;
        }
    }

    /// Moves to a point y = (x, α_K) without evaluating anything.
    fn place(&mut self, t: f64, y: &[f64]) {
        let alphas = &mut self.work.alphas;
        let (x, sliding) = y.split_at(self.mode.n);
        for (&i, &alpha) in self.mode.sliding.iter().zip(sliding) {
            alphas[i] = alpha;
        }
        self.mode.memory.set(t, x, alphas);
    }

    fn write_start(&mut self, state: &State, start: &mut Start) {
        start.t = state.point.t;
        start.y.clear();
        start.y.extend_from_slice(&state.point.x);
        start
            .y
            .extend(self.mode.sliding.iter().map(|&i| state.point.alpha[i]));
        start.scales.clear();
        start.scales.extend_from_slice(&state.scales.largest);
        start.scales.resize(start.y.len(), 1.0);
        start.terms.clear();
        start.terms.extend_from_slice(&state.scales.terms);
        let terms = &state.scales.terms;
        let size = |state: usize| terms[state].max(self.mode.field.f[state].abs());
        let rates = self
            .mode
            .sliding
            .iter()
            .map(|&i| self.mode.surfaces.weigh(i, size));
        start.terms.extend(rates);
        self.work.alphas.clone_from(&state.point.alpha);
    }

    /// Writes the state and α `length` after the start, which is the end of the step or within it.
    fn write_end(&self, radau: &Radau, start: &Start, length: f64, trial: &mut Trial) {
        let dense = Dense::Collocation(self.mode, radau, &self.work.psi);
        dense.states_at(length, &mut trial.x);
        dense.alphas_at(length, &mut trial.alpha);
        if length == radau.reach() {
            for (row, x) in trial.x.iter_mut().enumerate() {
                *x = radau.end(start, row);
            }
            for (j, &i) in self.mode.sliding.iter().enumerate() {
                trial.alpha[i] = radau.end(start, self.mode.n + j);
            }
        }
    }

    /// Looks for the switches off their surface that may reach it within the step solved last, and
    /// interpolates their ψ.
    fn monitor_along(&mut self, radau: &Radau, start: &Start, bands: &mut Bands) {
        let (h, s) = (radau.reach(), radau.degree());
        self.mode.monitored.switches.clear();
        self.mode.monitored.unobserved.clear();
        for i in 0..self.mode.n {
            self.mode.monitored.reach[i] = series::reach(radau.series(i), h);
        }
        self.place(start.t, &start.y);
        for switch in 0..self.mode.sides.len() {
            let is_off = self.mode.sides[switch] != Side::Slide
                && !self.mode.system.is_idle(switch, &self.mode.sides);
            let mode = &mut *self.mode;
            if !is_off || (Monitor { mode, bands }).keeps_off(switch, h) {
                continue;
            }
            self.mode.monitored.switches.push(switch);
            let (surfaces, values) = (&mut self.mode.surfaces, &self.mode.memory.values);
            self.mode.planes.aim(switch, surfaces, values);
            for i in std::iter::once(switch).chain(self.mode.system.second(switch)) {
                if !self.mode.system.sides_agree(i) {
                    self.mode.surfaces.linearize(i, &self.mode.memory.values);
                }
                bands.measure(self.mode, i);
            }
        }
        let n_monitored = self.mode.monitored.switches.len();
        self.work.values.resize(n_monitored * (s + 1), 0.0);
        self.work.psi.resize(n_monitored * (s + 1), 0.0);
        let mut y = std::mem::take(&mut self.work.y);
        y.clone_from(&start.y);
        for node in 0..=s {
            if node > 0 {
                for ((y, start), z) in y.iter_mut().zip(&start.y).zip(radau.displacement(node - 1))
                {
                    *y = start + z;
                }
                self.place(start.t + radau.tableau().nodes[node - 1] * h, &y);
            }
            for at in 0..n_monitored {
                self.work.values[at * (s + 1) + node] =
                    self.mode.monitored_psi(self.mode.monitored.switches[at]);
            }
        }
        self.work.y = y;
        let Workspace { psi, values, .. } = &mut *self.work;
        for (series, values) in psi.chunks_mut(s + 1).zip(values.chunks(s + 1)) {
            let displacement = |node: usize| values[node + 1] - values[0];
            radau
                .tableau()
                .interpolate(values[0], displacement, h, series);
        }
    }

    /// True when every ψ that is monitored has the value of its polynomial at the probes of the step.
    fn is_faithful(&mut self, radau: &Radau, start: &Start, bands: &Bands, tolerance: f64) -> bool {
        let h = radau.reach();
        let mut probes = 0..radau.tableau().probes.len();
        probes.all(|at| {
            let tau = radau.tableau().probes[at] * h;
            self.is_faithful_at(tau, radau, start, bands, tolerance)
        })
    }

    /// The same at one instant of the step.
    fn is_faithful_at(
        &mut self,
        tau: f64,
        radau: &Radau,
        start: &Start,
        bands: &Bands,
        tolerance: f64,
    ) -> bool {
        let (h, s) = (radau.reach(), radau.degree());
        let allowed = UNSEEN * tolerance.max(f64::EPSILON);
        let mut y = std::mem::take(&mut self.work.y);
        for (row, y) in y.iter_mut().enumerate() {
            *y = series::value(radau.series(row), tau);
        }
        self.place(start.t + tau, &y);
        self.work.y = y;
        (0..self.mode.monitored.switches.len()).all(|at| {
            let i = self.mode.monitored.switches[at];
            let psi = self.mode.monitored_psi(i);
            let polynomial = &self.work.psi[at * (s + 1)..][..=s];
            let (terms, magnitude) = (bands.terms[i], series::magnitude(polynomial, h, 0));
            let value = series::value(polynomial, tau);
            let difference = (value - psi).abs();
            // Where ψ is steep its terms are large beside itself, and say nothing of a side that it is on for an instant.
            let is_small = difference <= allowed * magnitude + ROUNDINGS * terms;
            let is_one_side = Side::of(value) == Side::of(psi);
            difference <= allowed * (terms + magnitude) && (is_small || is_one_side)
        })
    }
}

impl Implicit for Stiff<'_> {
    fn eval(&mut self, t: f64, y: &[f64], values: &mut [f64]) {
        self.place(t, y);
        let mode = &mut *self.mode;
        mode.field.eval(&mode.memory.values);
        let (f, phi) = values.split_at_mut(mode.n);
        f.copy_from_slice(&mode.field.f);
        if !phi.is_empty() {
            mode.linearize_surfaces();
            for (phi, &i) in phi.iter_mut().zip(&mode.sliding) {
                *phi = mode.phi(i);
            }
        }
    }

    /// ∂φ/∂x = ∇ψ·∂f/∂x + d∇ψ/dt, the last along the flow.
    fn jacobian(&mut self, t: f64, y: &[f64], matrix: &mut [f64]) {
        let (n, width) = (self.mode.n, y.len());
        matrix.fill(0.0);
        self.place(t, y);
        let mode = &mut *self.mode;
        let (library, values) = (&mut mode.library, &mode.memory.values);
        mode.field.jacobian(library, values, |row, column, value| {
            matrix[row * width + column] += value;
        });
        if width == n {
            return;
        }
        mode.field.eval(&mode.memory.values);
        self.work.f.clone_from(&mode.field.f);
        mode.linearize_surfaces();
        mode.field.linearize_sliding(&mode.memory.values);
        let (by_f, by_phi) = matrix.split_at_mut(n * width);
        for (state, row) in by_f.chunks_mut(width).enumerate() {
            for (switch, slope) in mode.field.slopes(state) {
                row[place_of(mode, switch)] += slope;
            }
        }
        for (row, &i) in by_phi.chunks_mut(width).zip(&mode.sliding) {
            for &(state, g) in mode.surfaces.gradient(i) {
                let of_state = &by_f[state * width..(state + 1) * width];
                for (entry, value) in row[..n].iter_mut().zip(of_state) {
                    *entry += g * value;
                }
            }
            for (entry, &j) in row[n..].iter_mut().zip(&mode.sliding) {
                *entry = mode.coupling(i, j);
            }
        }
        self.add_curvature(t, y, by_phi);
    }
}
