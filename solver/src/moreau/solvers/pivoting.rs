//! The problem of a small island by complementary pivoting.
//!
//! With β = β⁺ - β⁻ and γ = |J_t v⁺ + s| (Stewart & Trinkle 1996),
//!
//! J_n v⁺ + c ⟂ Λ,   γ - (J_t v⁺ + s) ⟂ β⁺,   γ + (J_t v⁺ + s) ⟂ β⁻,   μΛ - β⁺ - β⁻ ⟂ γ,
//!
//! is a linear complementarity problem that Lemke's method solves; it takes what sweeps find hard.

use crate::moreau::impulse::{Impulses, Island};
use crate::optimization::lcp::Lemke;

/// Unknowns up to which it is worth its matrix.
const MOST: usize = 160;

/// Memory for such problems.
#[derive(Default)]
pub(crate) struct Pivoting {
    lemke: Lemke,
    matrix: Vec<f64>,
    q: Vec<f64>,
    cover: Vec<f64>,
    /// Places in the island of contacts with friction.
    rough: Vec<usize>,
}

/// Sets impulses and velocities to a solution; false where there is none, too many unknowns, or friction in two
/// directions.
pub(crate) fn solve(
    memory: &mut Pivoting,
    island: &Island,
    impulses: &mut Impulses,
    v: &mut [f64],
) -> bool {
    let rows = &island.linear.rows;
    let contact = |i: usize| {
        let c = island.contacts[i] as usize;
        (c, &island.linear.contacts[c])
    };
    let Pivoting {
        lemke,
        matrix,
        q,
        cover,
        rough,
    } = memory;
    let n = island.contacts.len();
    rough.clear();
    rough.extend((0..n).filter(|&i| {
        let (c, contact) = contact(i);
        contact.is_rough() && impulses.diagonal(c)[1] > 0.0
    }));
    let m = rough.len();
    let size = n + 3 * m;
    if size > MOST || island.iter().any(|(_, contact)| contact.is_conic()) {
        return false;
    }
    // Without any impulses.
    for (c, contact) in island.iter() {
        rows.push_by(contact.normal, -impulses.normal[c], v);
        impulses.normal[c] = 0.0;
        impulses.rub_to(rows, c, contact, [0.0; 2], v);
    }
    for (memory, size) in [(&mut *matrix, size * size), (&mut *q, size)] {
        memory.clear();
        memory.resize(size, 0.0);
    }
    cover.clear();
    cover.resize(size, 1.0);
    let normal = |i: usize| contact(i).1.normal;
    let unit = |impulses: &Impulses, i: usize| 1.0 / impulses.diagonal(contact(i).0)[0];
    for (i, (c, contact)) in island.iter().enumerate() {
        q[i] = rows.rate(contact.normal, v) + impulses.normal_rate[c];
        for (k, (_, other)) in island.iter().enumerate() {
            matrix[i * size + k] = rows.coupling(contact.normal, other.normal) * unit(impulses, k);
        }
        for (r, &k) in rough.iter().enumerate() {
            let entry = rows.coupling(contact.normal, normal(k) + 1) * unit(impulses, k);
            matrix[i * size + n + r] = -entry;
            matrix[i * size + n + m + r] = entry;
        }
    }
    for (r, &i) in rough.iter().enumerate() {
        let (c, contact) = contact(i);
        let slip = rows.rate(contact.normal + 1, v) + impulses.slip_rate[c][0];
        let (plus, minus, last) = (n + r, n + m + r, n + 2 * m + r);
        (q[plus], q[minus]) = (-slip, slip);
        for (k, (_, other)) in island.iter().enumerate() {
            let entry = rows.coupling(contact.normal + 1, other.normal) * unit(impulses, k);
            matrix[plus * size + k] = -entry;
            matrix[minus * size + k] = entry;
        }
        for (p, &k) in rough.iter().enumerate() {
            let entry = rows.coupling(contact.normal + 1, normal(k) + 1) * unit(impulses, k);
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
    let Ok(z) = lemke.solve(matrix, q, cover) else {
        return false;
    };
    for (i, (c, contact)) in island.iter().enumerate() {
        impulses.normal[c] = scale * unit(impulses, i) * z[i];
        rows.push_by(contact.normal, impulses.normal[c], v);
    }
    for (r, &i) in rough.iter().enumerate() {
        let (c, contact) = contact(i);
        let beta = scale * unit(impulses, i) * (z[n + r] - z[n + m + r]);
        impulses.rub_to(rows, c, contact, [beta, 0.0], v);
    }
    true
}
