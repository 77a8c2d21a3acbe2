//! Trial elements: whether the members of a set stay positive where their rates do not tell.

use super::bands::Bands;
use super::directional::{Choice, TIE};
use crate::fesd::element::scheme::Scheme;
use crate::fesd::modes::{Mode, Modes};
use crate::fesd::run::Run;
use crate::fesd::watch::{Start, Values, Verdict};

/// Length of the first trial element, relative to that of a step, and of every other to the one before.
const TRIAL: f64 = 1e-3;
const LONGER: f64 = 10.0;

/// What a trial element says about its set.
enum Trial {
    /// A member is negative from the start,
    Fails,
    /// or is, but by no more than a rate that counts as zero explains.
    Open,
    /// No member is negative, and one stays as close to zero.
    Tied,
    /// All members stay positive, or leave later.
    Passes,
}

/// Solves for trial elements.
pub(crate) struct Trials {
    values: Values,
}

impl Trials {
    /// Memory for elements of a scheme.
    pub fn new(scheme: &Scheme) -> Self {
        Trials {
            values: Values::new(scheme),
        }
    }

    /// The choice that trial elements confirm, of several with the same rates: short ones first, and
    /// longer ones as long as none of these tells.
    pub fn confirmed(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        class: &[Choice],
        bands: &Bands,
    ) -> Option<Choice> {
        let mut left: Vec<&Choice> = class.iter().collect();
        let mut tied = None;
        let mut h = TRIAL * bands.length;
        loop {
            let mut open = Vec::with_capacity(left.len());
            for choice in left {
                match self.trial(modes, run, choice, bands, h) {
                    Trial::Passes => return Some(choice.clone()),
                    Trial::Fails => continue,
                    Trial::Tied => tied = tied.or(Some(choice)),
                    Trial::Open => {}
                }
                open.push(choice);
            }
            if open.is_empty() || h >= bands.length {
                return tied.cloned();
            }
            left = open;
            h = (LONGER * h).min(bands.length);
        }
    }

    /// Whether the members of a set stay positive in a short element.
    pub fn passes(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        choice: &Choice,
        bands: &Bands,
        h: f64,
    ) -> bool {
        matches!(
            self.trial(modes, run, choice, bands, h),
            Trial::Passes | Trial::Tied
        )
    }

    /// Solves for an element of a set, and looks at its members.
    fn trial(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        choice: &Choice,
        bands: &Bands,
        h: f64,
    ) -> Trial {
        let Some(mode) = modes.of(&choice.zeros) else {
            return Trial::Fails;
        };
        let (system, scheme) = (modes.system, &modes.scheme);
        let Mode { element, hidden } = &mut modes.all[mode];
        let reduced = element.reduced.clone();
        // s of what slips is no rate.
        let is_slip = |i: usize| system.discs.iter().any(|disc| disc.slip == i);
        let w = reduced.unknowns.iter().map(|&i| match is_slip(i) {
            true => run.place.z[i],
            false => choice.u[i],
        });
        let w: Vec<f64> = w.collect();
        let (x, departures) = (run.slips).set_off(
            system,
            &bands.of,
            &modes.numbers,
            &run.place,
            choice,
            &reduced,
        );
        let watched = &reduced.watched;
        let sizes = watched.iter().map(|w| bands.size(&choice.zeros, w.pair));
        let mut sizes: Vec<f64> = sizes.collect();
        element.stages.guess(&choice.rates, &w);
        element.set_off(scheme, &departures, h);
        let solved = element.solve(
            scheme,
            run.place.t,
            h,
            &x,
            &run.scale,
            &mut run.record.stats,
        );
        let evaluated = solved.and_then(|()| self.values.evaluate(scheme, element, hidden));
        if evaluated.is_err() {
            return Trial::Fails;
        }
        self.values.lower_stops(scheme, &reduced, &sizes);
        let starts: Vec<Start> = watched.iter().map(|w| choice.starts[w.pair]).collect();
        sizes.extend(reduced.has_branches.then_some(1.0));
        let scales = (&sizes[..], choice.rate_scale * h);
        let verdict = self.values.judge(scheme, &starts, scales);
        // A rate within the tie moves a member by as much, whatever is behind it.
        let is_tied = |member: usize| {
            let pair = watched[member].pair;
            let (_, z) = system.pairs[pair].split(choice.zeros[pair]);
            let tie = match system.is_continuous(z.variable) {
                true => TIE * choice.rate_scale * h,
                false => TIE,
            };
            let largest = self.values.of(scheme, member).iter();
            let largest = largest.fold(0.0_f64, |size, value| size.max(value.abs()));
            starts[member] == Start::Tangent && largest <= tie
        };
        match verdict {
            Verdict::Wrong { member } if is_tied(member) => Trial::Open,
            Verdict::Wrong { .. } => Trial::Fails,
            _ if (0..watched.len()).any(is_tied) => Trial::Tied,
            _ => Trial::Passes,
        }
    }
}
