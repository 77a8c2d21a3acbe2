//! The problem of a small island by complementary pivoting.
//!
//! With β = β⁺ - β⁻ and γ = |J_t v⁺ + s| (Stewart & Trinkle 1996),
//!
//! J_n v⁺ + c ⟂ Λ,   γ - (J_t v⁺ + s) ⟂ β⁺,   γ + (J_t v⁺ + s) ⟂ β⁻,   μΛ - β⁺ - β⁻ ⟂ γ,
//!
//! is a linear complementarity problem that Lemke's method solves; it takes what sweeps find hard.

use super::impulse::{Impulses, Island};
use crate::lcp;

/// Unknowns up to which it is worth its matrix.
const MOST: usize = 160;

/// Sets impulses and velocities to a solution; false where there is none, or too many unknowns.
pub(super) fn solve(island: &Island, impulses: &mut Impulses, v: &mut [f64]) -> bool {
    let rows = &island.linear.rows;
    let contacts: Vec<_> = island.iter().collect();
    let n = contacts.len();
    let rough: Vec<usize> = (0..n)
        .filter(|&i| contacts[i].1.is_rough && impulses.diagonal(contacts[i].0)[1] > 0.0)
        .collect();
    let m = rough.len();
    let size = n + 3 * m;
    if size > MOST {
        return false;
    }
    // Without any impulses.
    for &(c, contact) in &contacts {
        rows.push_by(contact.normal, -impulses.normal[c], v);
        impulses.normal[c] = 0.0;
        if contact.is_rough {
            rows.push_by(contact.normal + 1, impulses.tangential[c], v);
            impulses.tangential[c] = 0.0;
        }
    }
    let (mut matrix, mut q) = (vec![0.0; size * size], vec![0.0; size]);
    let unit = |i: usize| 1.0 / impulses.diagonal(contacts[i].0)[0];
    for (i, &(c, contact)) in contacts.iter().enumerate() {
        q[i] = rows.rate(contact.normal, v) + impulses.normal_rate[c];
        for (k, other) in contacts.iter().enumerate() {
            matrix[i * size + k] = rows.coupling(contact.normal, other.1.normal) * unit(k);
        }
        for (r, &k) in rough.iter().enumerate() {
            let entry = rows.coupling(contact.normal, contacts[k].1.normal + 1) * unit(k);
            matrix[i * size + n + r] = -entry;
            matrix[i * size + n + m + r] = entry;
        }
    }
    for (r, &i) in rough.iter().enumerate() {
        let (c, contact) = contacts[i];
        let slip = rows.rate(contact.normal + 1, v) + impulses.slip_rate[c];
        let (plus, minus, last) = (n + r, n + m + r, n + 2 * m + r);
        (q[plus], q[minus]) = (-slip, slip);
        for (k, other) in contacts.iter().enumerate() {
            let entry = rows.coupling(contact.normal + 1, other.1.normal) * unit(k);
            matrix[plus * size + k] = -entry;
            matrix[minus * size + k] = entry;
        }
        for (p, &k) in rough.iter().enumerate() {
            let entry = rows.coupling(contact.normal + 1, contacts[k].1.normal + 1) * unit(k);
            for (row, sign) in [(plus, 1.0), (minus, -1.0)] {
                matrix[row * size + n + p] = sign * entry;
                matrix[row * size + n + m + p] = -sign * entry;
            }
        }
        matrix[plus * size + last] = 1.0;
        matrix[minus * size + last] = 1.0;
        matrix[last * size + i] = impulses.friction[c];
        matrix[last * size + plus] = -1.0;
        matrix[last * size + minus] = -1.0;
    }
    let scale = q.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    if scale == 0.0 {
        return true;
    }
    q.iter_mut().for_each(|q| *q /= scale);
    let Ok(z) = lcp::lemke(&matrix, &q, &vec![1.0; size]) else {
        return false;
    };
    let units: Vec<f64> = (0..n).map(unit).collect();
    for (i, &(c, contact)) in contacts.iter().enumerate() {
        impulses.normal[c] = scale * units[i] * z[i];
        rows.push_by(contact.normal, impulses.normal[c], v);
    }
    for (r, &i) in rough.iter().enumerate() {
        let (c, contact) = contacts[i];
        impulses.tangential[c] = scale * units[i] * (z[n + r] - z[n + m + r]);
        rows.push_by(contact.normal + 1, -impulses.tangential[c], v);
    }
    true
}
