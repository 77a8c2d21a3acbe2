//! The not-a-knot cubic spline: the third derivative is continuous at the second and the last but one row.
//!
//! With h_k = t_{k+1} - t_k, slopes d_k of the data and s_k of the spline, continuity of the second derivative is
//!
//! h_k s_{k-1} + 2 (h_{k-1} + h_k) s_k + h_{k-1} s_{k+1} = 3 (h_k d_{k-1} + h_{k-1} d_k),
//!
//! and the two conditions at the ends are brought to two unknowns with it (de Boor 1978, chapter IV). Two rows
//! give the line through them, three the parabola.

/// Four coefficients for each interval between rows.
pub(crate) fn coefficients(times: &[f64], values: &[f64]) -> Vec<f64> {
    let h: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let rises = values.windows(2).map(|pair| pair[1] - pair[0]);
    let d: Vec<f64> = rises.zip(&h).map(|(rise, h)| rise / h).collect();
    let s = slopes(&h, &d);
    let piece = |k: usize| {
        let bend = (s[k] + s[k + 1] - 2.0 * d[k]) / h[k];
        [values[k], s[k], (d[k] - s[k]) / h[k] - bend, bend / h[k]]
    };
    (0..h.len()).flat_map(piece).collect()
}

/// The slopes of the spline in all rows.
fn slopes(h: &[f64], d: &[f64]) -> Vec<f64> {
    let last = h.len();
    match last {
        1 => return vec![d[0]; 2],
        2 => {
            // The parabola through three rows: 2 d_k = s_k + s_{k+1}.
            let middle = (h[1] * d[0] + h[0] * d[1]) / (h[0] + h[1]);
            return vec![2.0 * d[0] - middle, middle, 2.0 * d[1] - middle];
        }
        _ => {}
    }
    // Rows (lower, diagonal, upper | right side) of a tridiagonal system.
    let mut lower = vec![0.0; last + 1];
    let mut diagonal = vec![0.0; last + 1];
    let mut upper = vec![0.0; last + 1];
    let mut s = vec![0.0; last + 1];
    let both = h[0] + h[1];
    (diagonal[0], upper[0]) = (h[1], both);
    s[0] = ((h[0] + 2.0 * both) * h[1] * d[0] + h[0] * h[0] * d[1]) / both;
    for k in 1..last {
        (lower[k], diagonal[k], upper[k]) = (h[k], 2.0 * (h[k - 1] + h[k]), h[k - 1]);
        s[k] = 3.0 * (h[k] * d[k - 1] + h[k - 1] * d[k]);
    }
    let both = h[last - 2] + h[last - 1];
    (lower[last], diagonal[last]) = (both, h[last - 2]);
    s[last] = (h[last - 1] * h[last - 1] * d[last - 2]
        + (2.0 * both + h[last - 1]) * h[last - 2] * d[last - 1])
        / both;

    // After the first row, whose elimination leaves h_0 + h_1, the diagonal dominates.
    for k in 1..=last {
        let factor = lower[k] / diagonal[k - 1];
        diagonal[k] -= factor * upper[k - 1];
        s[k] -= factor * s[k - 1];
    }
    s[last] /= diagonal[last];
    for k in (0..last).rev() {
        s[k] = (s[k] - upper[k] * s[k + 1]) / diagonal[k];
    }
    s
}
