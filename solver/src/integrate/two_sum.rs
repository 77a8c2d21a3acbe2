//! Sums without error.

/// a + b rounded, and what rounding has taken from it (Knuth 1969, section 4.2.2).
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}
