//! Members that count as zero at once, although one of them may vanish later by a time that matters.
//!
//! A member is zero below its band, whatever its rate. Where another one vanishes and it does not yet, the set in
//! which it is still positive lasts v/|v'|, with v' in that set: long, if both are of surfaces that are nearly
//! parallel, and with another field, if that is large between surfaces close together.

use super::bands::Bands;
use super::directional::{Choice, Directional, agree, switches_of};
use crate::fesd::run::Run;
use crate::fesd::run::place::Place;
use crate::fesd::system::ComplementaritySystem;
use crate::fesd::watch::BAND;
use crate::hybrid::Note;

/// Roundings of a member that is zero, and of a rate.
const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

/// Of more pairs it is not asked which was first.
const MOST: usize = 8;

impl Directional {
    /// Takes note of members that are zero at once where it matters which vanishes first: where states differ by more
    /// than a tolerance, relative to their sizes.
    pub(crate) fn note_together(&mut self, run: &mut Run, bands: &Bands, tolerance: f64) {
        let (system, length, bands) = (bands.system, bands.length, &bands.of);
        let pairs = &system.pairs;
        // What was positive with the present set, and is zero now.
        let met = |&at: &usize| {
            let (_, member) = pairs[at].split(run.place.zeros[at]);
            system.is_continuous(member.variable) && member.value(&run.place.z) <= bands[at]
        };
        let met: Vec<usize> = (0..pairs.len()).filter(met).collect();
        if !(2..=MOST).contains(&met.len()) {
            return;
        }
        let Some(all) = self.only(system, &run.place, bands, length) else {
            return;
        };
        for &at in &met {
            let mut others = bands.clone();
            others[at] = f64::NEG_INFINITY;
            let Some(between) = self.only(system, &run.place, &others, length) else {
                continue;
            };
            let (_, member) = pairs[at].split(run.place.zeros[at]);
            let least = ROUNDINGS * bands[at] / BAND;
            let still = ROUNDINGS * between.rate_scale;
            let approach = -member.slope() * between.u[member.variable];
            if approach < -still {
                continue;
            }
            let value = member.value(&run.place.z).max(least);
            let lasts = (value / approach.max(still)).min(run.t1 - run.place.t);
            let mut rates = between.rates.iter().zip(&all.rates).zip(&run.scale);
            if rates.any(|((a, b), scale)| (a - b).abs() * lasts > tolerance * scale) {
                let mut switches = system.switches_of[at].to_vec();
                for other in switches_of(system, &met) {
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
                if switches.len() > 1 && !run.record.notes.iter().any(is_known) {
                    let time = run.place.t;
                    run.record.notes.push(Note::Together { time, switches });
                }
                return;
            }
        }
    }

    /// The one set that goes on where members below these bands are zero.
    fn only(
        &mut self,
        system: &ComplementaritySystem,
        place: &Place,
        bands: &[f64],
        length: f64,
    ) -> Option<Choice> {
        let least = bands.iter().fold(0.0_f64, |size, band| size.max(*band)) / (BAND * length);
        let least = least.max(0.0) * f64::EPSILON;
        self.set(place.t, &place.x, &place.z);
        let found = self.choices(system, &place.zeros, &place.z, bands, least);
        let mut choices = found.choices.into_iter().filter(|choice| choice.strict);
        let first = choices.next()?;
        let is_same = |other: Choice| agree(&first, &other, least, &found.sizes);
        choices.all(is_same).then_some(first)
    }
}
