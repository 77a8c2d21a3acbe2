//! Members that count as zero at once, although one of them may vanish later by a time that matters.
//!
//! A member is zero below its band, whatever its rate. Where another one vanishes and it does not yet, the set in
//! which it is still positive lasts v/|v'|, with v' in that set: long, if both are of surfaces that are nearly
//! parallel, and with another field, if that is large between surfaces close together.

use super::directional::Choice;
use crate::fesd::watch::BAND;
use crate::fesd::{Grid, Run, Simulator};
use crate::hybrid::Note;

/// Roundings of a member that is zero, and of a rate.
const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

/// What matters to a state, relative to its magnitude, where no tolerance says.
const MATTERS: f64 = 1e-8;

/// Of more pairs it is not asked which was first.
const MOST: usize = 8;

impl Simulator<'_> {
    /// Takes note of members that are zero at once where it matters which vanishes first.
    pub(crate) fn note_together(&mut self, run: &mut Run, bands: &[f64], length: f64) {
        let system = self.system;
        let pairs = &system.pairs;
        // What was positive with the present set, and is zero now.
        let met = |&at: &usize| {
            let (_, member) = pairs[at].split(run.zeros[at]);
            system.is_continuous(member.variable) && member.value(&run.z) <= bands[at]
        };
        let met: Vec<usize> = (0..pairs.len()).filter(met).collect();
        if !(2..=MOST).contains(&met.len()) {
            return;
        }
        let Some(all) = self.only(run, bands, length) else {
            return;
        };
        let tolerance = match self.settings.grid {
            Grid::Adaptive { tolerance } => tolerance,
            Grid::Steps { .. } => MATTERS,
        };
        for &at in &met {
            let mut others = bands.to_vec();
            others[at] = f64::NEG_INFINITY;
            let Some(between) = self.only(run, &others, length) else {
                continue;
            };
            let (_, member) = pairs[at].split(run.zeros[at]);
            let least = ROUNDINGS * bands[at] / BAND;
            let still = ROUNDINGS * between.rate_scale;
            let approach = -member.slope() * between.u[member.variable];
            if approach < -still {
                continue;
            }
            let value = member.value(&run.z).max(least);
            let lasts = (value / approach.max(still)).min(run.t1 - run.t);
            let mut rates = between.rates.iter().zip(&all.rates).zip(&run.scale);
            if rates.any(|((a, b), scale)| (a - b).abs() * lasts > tolerance * scale) {
                let mut switches = system.switches_of[at].to_vec();
                for other in self.switches_of_pairs(&met) {
                    if !switches.contains(&other) {
                        switches.push(other);
                    }
                }
                let is_known = |note: &Note| match note {
                    Note::Together {
                        switches: known, ..
                    } => *known == switches,
                    _ => false,
                };
                if switches.len() > 1 && !run.notes.iter().any(is_known) {
                    let time = run.t;
                    run.notes.push(Note::Together { time, switches });
                }
                return;
            }
        }
    }

    /// The one set that goes on where members below these bands are zero.
    fn only(&mut self, run: &Run, bands: &[f64], length: f64) -> Option<Choice> {
        let least = bands.iter().fold(0.0_f64, |size, band| size.max(*band)) / (BAND * length);
        let least = least.max(0.0) * f64::EPSILON;
        self.directional.set(run.t, &run.x, &run.z);
        let found = (self.directional).choices(self.system, &run.zeros, &run.z, bands, least);
        let mut choices = found.choices.into_iter().filter(|choice| choice.strict);
        let first = choices.next()?;
        let is_same =
            |other: Choice| super::directional::agree(&first, &other, least, &found.sizes);
        choices.all(is_same).then_some(first)
    }
}
