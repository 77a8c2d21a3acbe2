//! The sums that Taylor arithmetic is made of.

/// `Σ a[j] * b[n-1-j]` over two rows of the same length n.
///
/// Four partial sums, in a fixed order: the sum of one chain would wait for itself.
pub(crate) fn convolve(a: &[f64], b: &[f64]) -> f64 {
    let mut partial = [0.0; 4];
    let (chunks, rest) = a.as_chunks::<4>();
    let (rest_b, chunks_b) = b.as_rchunks::<4>();
    for (p, q) in chunks.iter().zip(chunks_b.iter().rev()) {
        partial[0] += p[0] * q[3];
        partial[1] += p[1] * q[2];
        partial[2] += p[2] * q[1];
        partial[3] += p[3] * q[0];
    }
    let rest: f64 = rest
        .iter()
        .zip(rest_b.iter().rev())
        .map(|(p, q)| p * q)
        .sum();
    (partial[0] + partial[2]) + (partial[1] + partial[3]) + rest
}

/// `Σ w[j] * a[j] * b[n-1-j]` over rows of the same length n.
pub(crate) fn convolve_weighted(weights: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let mut partial = [0.0; 4];
    let (w, rest_w) = weights.as_chunks::<4>();
    let (chunks, rest) = a.as_chunks::<4>();
    let (rest_b, chunks_b) = b.as_rchunks::<4>();
    for ((w, p), q) in w.iter().zip(chunks).zip(chunks_b.iter().rev()) {
        partial[0] += w[0] * p[0] * q[3];
        partial[1] += w[1] * p[1] * q[2];
        partial[2] += w[2] * p[2] * q[1];
        partial[3] += w[3] * p[3] * q[0];
    }
    let rest = rest_w.iter().zip(rest).zip(rest_b.iter().rev());
    let rest: f64 = rest.map(|((w, p), q)| w * p * q).sum();
    (partial[0] + partial[2]) + (partial[1] + partial[3]) + rest
}

/// The coefficient of order `k >= 1` of the square of a row with the orders `0..=k`.
pub(crate) fn square(a: &[f64]) -> f64 {
    let n = a.len();
    let half = n / 2;
    let middle = if n % 2 == 1 { a[half] * a[half] } else { 0.0 };
    2.0 * convolve(&a[..half], &a[n - half..]) + middle
}
