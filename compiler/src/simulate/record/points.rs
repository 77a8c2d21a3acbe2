//! Points of a run, and both sides of what jumps.
//!
//! At an instant t at which a mode changes, data step or the state is kicked, a column g has the values g(t⁻), in the row
//! that ends a step, and g(t⁺), in a row behind it. Where no column jumps the second row says nothing, and is left out.

use crate::report::{self, Piece, Samples, curve};
use crate::simulate::record::modes::ModeNames;
use crate::system::System;

/// Instants this close, relative to them, are one: those of events have the rounding of the steps up to them.
const SAME_INSTANT: f64 = 16.0 * f64::EPSILON;

/// The least jump of a column, as a share of its largest value: what is continuous over a switch differs by what it is
/// located to.
const LEAST_JUMP: f64 = 1e-8;

pub(crate) fn is_one_instant(t: f64, other: f64) -> bool {
    (t - other).abs() <= SAME_INSTANT * other.abs()
}

/// The k-th multiple of a period, which is the horizon where rounding alone is between them.
pub(super) fn multiple(period: f64, k: usize, horizon: f64) -> f64 {
    let t = k as f64 * period;
    if is_one_instant(t, horizon) {
        horizon
    } else {
        t
    }
}

/// States that have jumped.
#[derive(Clone, Debug)]
pub(in crate::simulate) struct Jump {
    pub time: f64,
    /// The laws, in order.
    laws: Vec<usize>,
    /// Points recorded before.
    pub n_points: usize,
    pub before: Vec<f64>,
    pub after: Vec<f64>,
}

impl Jump {
    /// One event per law, in a mode.
    pub fn events<'j>(
        &'j self,
        names: &'j ModeNames,
        mode: &'j str,
    ) -> impl Iterator<Item = report::Event> + 'j {
        let laws = self.laws.iter();
        laws.map(move |&law| names.event(self.time, law, mode))
    }
}

/// Values behind a point at its instant.
#[derive(Clone, Debug)]
pub(crate) struct Behind {
    pub x: Vec<f64>,
    pub alpha: Vec<f64>,
    /// Whether they differ whatever is reported.
    pub is_certain: bool,
}

/// Puts the α of switches that outputs alone look at, at a time and a state.
pub(super) type See<'s> = dyn Fn(f64, &[f64], &mut [f64]) + 's;

/// What a row of a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Row {
    /// The end of a step, or an instant that was asked for.
    Point,
    /// Inside of a step.
    Inside,
    /// Behind the row before it, at its instant.
    Behind { is_certain: bool },
}

/// States and α at instants, and what jumps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Points {
    /// Instants, and states and α at them, one after another.
    pub times: Vec<f64>,
    pub states: Vec<f64>,
    pub alphas: Vec<f64>,
    pub(in crate::simulate) jumps: Vec<Jump>,
    /// Values behind points, with the number of these.
    behind: Vec<(usize, Behind)>,
}

impl Points {
    pub fn last_instant(&self) -> Option<f64> {
        self.times.last().copied()
    }

    /// n states and m α of the first point.
    pub fn first(&self, [n, m]: [usize; 2]) -> (&[f64], &[f64]) {
        (&self.states[..n], &self.alphas[..m])
    }

    /// The last point alone, of n states and m α.
    pub fn last(&self, [n, m]: [usize; 2]) -> Points {
        let last = self.times.len().saturating_sub(1);
        Points {
            times: self.times[last..].to_vec(),
            states: self.states[last * n..].to_vec(),
            alphas: self.alphas[last * m..].to_vec(),
            ..Points::default()
        }
    }

    /// The n states of the last point.
    pub fn last_state(&self, n: usize) -> &[f64] {
        &self.states[self.states.len() - n..]
    }

    /// Adds an instant behind the others.
    pub fn push(&mut self, time: f64, x: &[f64], alpha: &[f64]) {
        self.times.push(time);
        self.states.extend_from_slice(x);
        self.alphas.extend_from_slice(alpha);
    }

    /// Takes note of a jump of states by laws.
    pub fn jump(&mut self, time: f64, laws: Vec<usize>, before: &[f64], after: &[f64]) {
        self.jumps.push(Jump {
            time,
            laws,
            n_points: self.times.len(),
            before: before.to_vec(),
            after: after.to_vec(),
        });
    }

    /// Goes on from the last point with other values; behind a jump they are those of its second point.
    pub fn go_on(&mut self, behind: Behind) {
        let last = self.times.len() - 1;
        let time = self.times[last];
        let is_second = |jump: &Jump| jump.n_points == last && is_one_instant(jump.time, time);
        if self.jumps.last().is_some_and(is_second) {
            let m = behind.alpha.len();
            self.alphas[last * m..].copy_from_slice(&behind.alpha);
        } else {
            self.behind.pop_if(|(point, _)| *point == last);
            self.behind.push((last, behind));
        }
    }

    /// Goes on from the last point where data step at it.
    pub(super) fn end(&mut self, system: &System) {
        if !self
            .last_instant()
            .is_some_and(|last| system.steps_at(last))
        {
            return;
        }
        let alphas = self.alphas.len() - system.switches.len();
        self.go_on(Behind {
            x: self.last_state(system.states.len()).to_vec(),
            alpha: self.alphas[alphas..].to_vec(),
            is_certain: false,
        });
    }

    /// The instants at which something may jump, and whether it does so for certain.
    pub fn breaks(&self) -> Vec<(f64, bool)> {
        let behind = self.behind.iter();
        let behind = behind.map(|(point, behind)| (self.times[*point], behind.is_certain));
        let jumps = self.jumps.iter().map(|jump| (jump.time, true));
        behind.chain(jumps).collect()
    }

    /// Whether the last row is behind the last point, if it is one.
    pub(super) fn goes_on_at_end(&self) -> bool {
        let last = self.times.len().checked_sub(1);
        self.behind
            .last()
            .is_some_and(|(point, _)| Some(*point) == last)
    }

    /// The points with rows behind them, and with those inside of steps, from polynomials of n states and m α, and what all
    /// rows are; none where all are points. `see` puts α that are not known.
    pub(super) fn spread(
        &self,
        [n, m]: [usize; 2],
        pieces: &[Piece],
        see: &See<'_>,
    ) -> Option<(Points, Vec<Row>)> {
        let span = self.last_instant().unwrap_or(0.0);
        let mut lengths = pieces.iter().map(|piece| piece.to - piece.from);
        if self.behind.is_empty() && !lengths.any(|length| curve::is_divided(length, span)) {
            return None;
        }
        let mut spread = Points::default();
        let (mut instants, mut values) = (Vec::new(), Vec::new());
        for piece in pieces {
            let begun = instants.len();
            let parts = curve::instants(piece.from, piece.to, span);
            instants.extend(parts.filter(|t| piece.from < *t && *t < piece.to));
            piece.read(&instants[begun..], n + m, &mut values);
        }
        let mut parts = instants.iter().copied().enumerate().peekable();
        let mut behind = self.behind.iter().peekable();
        let mut rows = Vec::new();
        for (k, &t) in self.times.iter().enumerate() {
            while let Some((part, at)) = parts.next_if(|(_, at)| *at < t) {
                let (x, alpha) = values[part * (n + m)..][..n + m].split_at_mut(n);
                see(at, x, alpha);
                spread.push(at, x, alpha);
                rows.push(Row::Inside);
            }
            // An instant of a step has one row.
            parts.next_if(|(_, at)| *at == t);
            spread.push(t, &self.states[k * n..][..n], &self.alphas[k * m..][..m]);
            rows.push(Row::Point);
            if let Some((_, behind)) = behind.next_if(|(point, _)| *point == k) {
                spread.push(t, &behind.x, &behind.alpha);
                let is_certain = behind.is_certain;
                rows.push(Row::Behind { is_certain });
            }
        }
        Some((spread, rows))
    }
}

/// Leaves out rows behind others where nothing jumps, and those inside of steps that straight lines do without.
pub(super) fn tidy(samples: &mut Samples, rows: &[Row]) {
    let mut kept: Vec<bool> = (rows.iter())
        .map(|row| *row != Row::Behind { is_certain: false })
        .collect();
    if kept.contains(&false) {
        for (_, values) in samples.series().flat_map(|series| series.columns()) {
            let finite = values.iter().filter(|value| value.is_finite());
            let size = finite.fold(0.0, |size: f64, value| size.max(value.abs()));
            for (k, kept) in kept.iter_mut().enumerate().skip(1) {
                let [before, here] = [values[k - 1], values[k]];
                let is_more = (here - before).abs() > LEAST_JUMP * size;
                *kept |= is_more || before.is_nan() != here.is_nan();
            }
        }
        curve::keep(samples, &kept);
    }
    let rows = rows.iter().zip(kept).filter(|(_, kept)| *kept);
    let inside: Vec<bool> = rows.map(|(row, _)| *row == Row::Inside).collect();
    if inside.contains(&true) {
        curve::thin(samples, &inside);
    }
}
