//! A range of numbers with round ticks, and its place on the sheet.

use std::ops::RangeInclusive;

/// Labels of decades along an axis.
const MOST_LABELS: i32 = 9;
/// Decades of an axis that has lines between them.
const MOST_DIVIDED: f64 = 4.5;

/// An axis: numbers from `lo` to `hi`, drawn from `start` to `end` in points.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Whether these are logarithms to base 10 of the numbers that are drawn.
    is_logarithmic: bool,
    /// Smallest number.
    pub lo: f64,
    /// Largest number.
    pub hi: f64,
    /// Where `lo` is drawn.
    pub start: f64,
    /// Where `hi` is drawn.
    pub end: f64,
}

impl Axis {
    /// From `lo` to `hi`, not placed yet.
    pub fn new(lo: f64, hi: f64) -> Self {
        Axis {
            is_logarithmic: false,
            lo,
            hi,
            start: 0.0,
            end: 1.0,
        }
    }

    /// Covers all finite values with a margin; rounding errors are not blown up to fill it.
    pub fn around(values: impl IntoIterator<Item = f64>) -> Self {
        let Some((lo, hi)) = range(values) else {
            return Axis::new(-1.0, 1.0);
        };
        let size = lo.abs().max(hi.abs());
        let span = hi - lo;
        if span <= 1e-9 * size || size < 1e-12 {
            let half = if size < 1e-12 { 1.0 } else { 0.5 * size };
            return Axis::new(lo - half, hi + half);
        }
        Axis::new(lo - 0.06 * span, hi + 0.06 * span)
    }

    /// A logarithmic axis that covers all positive values with a margin.
    pub fn decades(values: impl IntoIterator<Item = f64>) -> Self {
        let positive = values.into_iter().filter(|v| *v > 0.0);
        let (lo, hi) = range(positive.map(f64::log10)).unwrap_or((-1.0, 0.0));
        // A decade at least has its line in the frame.
        let margin = (0.04 * (hi - lo)).max(0.5 * (1.1 - (hi - lo)));
        Axis {
            is_logarithmic: true,
            ..Axis::new(lo - margin, hi + margin)
        }
    }

    /// The axis drawn from `start` to `end`.
    pub fn placed(mut self, start: f64, end: f64) -> Self {
        (self.start, self.end) = (start, end);
        self
    }

    /// Where a number is drawn.
    pub fn at(&self, value: f64) -> f64 {
        let value = if self.is_logarithmic {
            value.log10()
        } else {
            value
        };
        self.start + (value - self.lo) / (self.hi - self.lo) * (self.end - self.start)
    }

    /// a and b of a linear axis that draws v at a*v + b.
    pub fn line(&self) -> [f64; 2] {
        let slope = (self.end - self.start) / (self.hi - self.lo);
        [slope, self.start - self.lo * slope]
    }

    /// Where it is drawn from, and to.
    pub fn ends(&self) -> [f64; 2] {
        [self.start, self.end]
    }

    /// Half way between its ends.
    pub fn middle(&self) -> f64 {
        0.5 * (self.start + self.end)
    }

    /// Powers of ten on a logarithmic axis.
    pub fn powers(&self) -> impl Iterator<Item = f64> + use<> {
        self.exponents().map(|decade| 10f64.powi(decade))
    }

    fn exponents(&self) -> RangeInclusive<i32> {
        self.lo.ceil() as i32..=self.hi.floor() as i32
    }

    /// 2, 3, .., 9 times powers of ten on a logarithmic axis, where there is room for them.
    pub fn between_powers(&self) -> Vec<f64> {
        if self.hi - self.lo > MOST_DIVIDED {
            return Vec::new();
        }
        let decades = self.lo.floor() as i32..=self.hi.ceil() as i32;
        let all =
            decades.flat_map(|decade| (2..10).map(move |k| f64::from(k) * 10f64.powi(decade)));
        all.filter(|value| (self.lo..=self.hi).contains(&value.log10()))
            .collect()
    }

    /// Powers of ten with labels: every one, every second one, ..
    fn ticks_at_powers(&self) -> Ticks {
        let n = self.exponents().count() as i32;
        let every = ((n + MOST_LABELS - 1) / MOST_LABELS).max(1);
        let shown = self.exponents().filter(|k| k.rem_euclid(every) == 0);
        Ticks {
            marks: shown
                .map(|k| (10f64.powi(k), format!("10{}", superscripts(k))))
                .collect(),
            exponent: 0,
        }
    }

    /// Round numbers, at most `n` steps, with their labels and the power of ten taken out of them; on a logarithmic
    /// axis powers of ten.
    pub fn ticks(&self, n: usize) -> Ticks {
        if self.is_logarithmic {
            return self.ticks_at_powers();
        }
        let step = round_step((self.hi - self.lo) / n.max(1) as f64);
        let (first, last) = ((self.lo / step).ceil(), (self.hi / step).floor());
        let size = self.lo.abs().max(self.hi.abs());
        let exponent = match size.log10().floor() as i32 {
            -2..=4 => 0,
            decade => decade,
        };
        let unit = 10f64.powi(exponent);
        let decimals = (-(step / unit).log10().floor()).clamp(0.0, 12.0) as usize;
        let count = (last - first).clamp(0.0, 50.0) as usize;
        let marks = (0..=count).map(|k| {
            let value = (first + k as f64) * step;
            (value, minus(&format!("{:.decimals$}", value / unit)))
        });
        Ticks {
            marks: marks.collect(),
            exponent,
        }
    }
}

/// The least and the largest of those values that are finite; none where there are none.
pub fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|value| value.is_finite());
    finite.fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((lo, hi)) => Some((lo.min(v), hi.max(v))),
    })
}

/// The ticks of an [`Axis`].
pub struct Ticks {
    /// Numbers and labels.
    pub marks: Vec<(f64, String)>,
    /// The labels are to be read times ten to this power.
    pub exponent: i32,
}

impl Ticks {
    /// The title of an axis with the power of ten of its labels.
    pub fn title(&self, name: &str) -> String {
        match self.exponent {
            0 => name.to_owned(),
            exponent => format!("{name}  (×10{})", superscripts(exponent)),
        }
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `rough`.
fn round_step(rough: f64) -> f64 {
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade);
    step.into_iter()
        .find(|&step| step >= rough * (1.0 - 1e-9))
        .unwrap_or(rough)
}

/// A true minus sign, and none before zero.
fn minus(label: &str) -> String {
    match label.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        Some(digits) => format!("\u{2212}{digits}"),
        None => label.to_owned(),
    }
}

/// A whole number as an exponent.
fn superscripts(exponent: i32) -> String {
    exponent.to_string().chars().map(superscript).collect()
}

fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => digit
            .to_digit(10)
            .and_then(|d| char::from_u32('⁰' as u32 + d))
            .unwrap_or(digit),
    }
}

#[cfg(test)]
mod tests {
    use super::Axis;

    fn labels(lo: f64, hi: f64) -> String {
        let ticks = Axis::new(lo, hi).ticks(5);
        let labels: Vec<_> = ticks.marks.into_iter().map(|(_, label)| label).collect();
        format!("{}: {}", ticks.exponent, labels.join(" "))
    }

    #[test]
    fn ticks_are_round_numbers() {
        insta::assert_snapshot!(labels(-1.1, 0.4), @"0: −1.0 −0.5 0.0");
        insta::assert_snapshot!(labels(0.0, 24.0), @"0: 0 5 10 15 20");
        insta::assert_snapshot!(labels(-3e-7, 9e-7), @"-7: 0 5");
        insta::assert_snapshot!(labels(1.00001, 1.00002), @"0: 1.000012 1.000014 1.000016 1.000018 1.000020");
        insta::assert_snapshot!(labels(0.0, 2.5e6), @"6: 0.0 0.5 1.0 1.5 2.0 2.5");
    }

    #[test]
    fn rounding_errors_do_not_fill_the_axis() {
        let axis = Axis::around([1e-17, -1e-17]);
        assert_eq!((axis.lo, axis.hi), (-1.0 - 1e-17, 1.0 + 1e-17));
        let axis = Axis::around([4.0, 4.0 + 1e-12, f64::NAN]);
        assert!(axis.lo <= 2.0 && axis.hi >= 6.0);
        let axis = Axis::around([]);
        assert_eq!((axis.lo, axis.hi), (-1.0, 1.0));
    }
}
