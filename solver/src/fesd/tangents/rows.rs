//! The instants of a run that are asked for.

use super::Of;
use super::active::{Active, Parameters};
use super::element::{Motion, state, within};
use crate::event::Clock;
use crate::fesd::element::solved::Solved;
use crate::sensitivity::{Moment, Moved, Sensitivities, Slope};

/// A row that waits for the lengths of its elements.
pub(super) struct Row {
    point: Vec<f64>,
    /// x'.
    f: Vec<f64>,
    /// By direction, the last of which is the length.
    tangents: Vec<Option<Vec<f64>>>,
    /// α of what slides; none where w is not found.
    sliding: Option<Vec<(usize, Slope)>>,
}

/// The instants inside of an element, behind those that wait in `rows`.
pub(super) fn read(
    of: &Of,
    (found, parameters): (&Sensitivities, &Parameters),
    active: &mut Active,
    (solved, motions): (&Solved, &[Option<Motion>]),
    (until, is_last): (f64, bool),
    rows: &mut Vec<Row>,
) {
    let span = Span::of(of, solved, until);
    if span.stands() && !is_last {
        return;
    }
    while let Some(moment) = found.next(rows.len()) {
        if !(span.holds(moment) || is_last) {
            break;
        }
        let scheme = of.scheme;
        let sigma = span.share(of, solved, moment.time);
        let x = state(scheme, solved, sigma);
        let t = match of.clock {
            None => moment.time,
            Some(_) => solved.t + sigma * solved.h,
        };
        let here = active.here(t, (&x, &solved.w), parameters);
        let (alpha, f, sliding) = match here {
            Ok(here) => (here.alpha, here.f, Some(here.sliding)),
            Err(_) => (
                vec![f64::NAN; active.reduced.sides.len()],
                vec![f64::NAN; x.len()],
                None,
            ),
        };
        let tangent =
            |motion: &Option<Motion>| Some(within(scheme, solved, motion.as_ref()?, sigma));
        rows.push(Row {
            point: [x, alpha].concat(),
            tangents: motions.iter().map(tangent).collect(),
            sliding,
            f,
        });
    }
}

impl Row {
    /// The point, and tangents by direction, where lengths of elements move like this.
    pub fn whole(
        self,
        (n, clock): (usize, Option<usize>),
        lengths: &[f64],
    ) -> (Vec<f64>, Vec<Option<Vec<f64>>>) {
        let Row {
            point,
            f,
            mut tangents,
            sliding,
        } = self;
        let of_length = tangents.pop().flatten().unwrap_or_default();
        let whole = |(d, tangent): (usize, Option<Vec<f64>>)| {
            let (mut whole, sliding) = (tangent?, sliding.as_ref()?);
            for (value, by) in whole.iter_mut().zip(&of_length) {
                *value += lengths[d] * by;
            }
            // At an instant of the clock.
            let time = clock.map_or(0.0, |clock| -whole[clock] / f[clock]);
            if clock.is_some() {
                whole.iter_mut().zip(&f).for_each(|(x, f)| *x += f * time);
            }
            let x = whole.clone();
            whole.resize(point.len(), 0.0);
            for (i, slope) in sliding {
                let moved = Moved {
                    time,
                    ..Moved::still(&x)
                };
                whole[n + i] = slope.along(moved, d)[0];
            }
            Some(whole)
        };

        let all = tangents.into_iter().enumerate().map(whole).collect();
        (point, all)
    }
}

/// The times from the start of an element to its end.
struct Span {
    start: f64,
    end: f64,
    /// Times that are closer are one.
    near: f64,
    h: f64,
}

impl Span {
    fn of(of: &Of, solved: &Solved, until: f64) -> Self {
        let (start, end) = match of.clock {
            None => (solved.t, until),
            Some(clock) => {
                let start = solved.x[clock];
                (start, start + solved.h * solved.mean[clock])
            }
        };
        Span {
            near: match of.clock {
                // An instant that is asked for and that of an event are rounded.
                None => 4.0 * f64::EPSILON * end.abs(),
                Some(_) => 1e-12 * end.abs(),
            },
            h: solved.h,
            start,
            end,
        }
    }

    fn stands(&self) -> bool {
        Clock::stands(self.end - self.start, self.h)
    }

    fn holds(&self, Moment { time, is_behind }: Moment) -> bool {
        time < self.end - self.near || time <= self.end + self.near && !is_behind
    }

    /// The share of the element at a time.
    fn share(&self, of: &Of, solved: &Solved, time: f64) -> f64 {
        const ITERATIONS: usize = 20;
        if time >= self.end - self.near {
            return 1.0;
        }
        let Some(clock) = of.clock else {
            return ((time - solved.t - solved.t_low) / solved.h).clamp(0.0, 1.0);
        };
        let length = self.end - self.start;
        let mut share = ((time - self.start) / length).clamp(0.0, 1.0);
        for _ in 0..ITERATIONS {
            let off = time - state(of.scheme, solved, share)[clock];
            share = (share + off / length).clamp(0.0, 1.0);
        }
        share
    }
}
