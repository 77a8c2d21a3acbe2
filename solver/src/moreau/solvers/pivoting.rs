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
    let (n, m) = (island.contacts.len(), memory.find_rough(island, impulses));
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
    memory.clear(size);
    memory.write_normals(island, impulses, v);
    memory.write_slips(island, impulses, v);
    let Pivoting {
        lemke,
        matrix,
        q,
        cover,
        rough,
    } = memory;
    let scale = q.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    if scale == 0.0 {
        return true;
    }
    q.iter_mut().for_each(|q| *q /= scale);
    let Ok(z) = lemke.solve(matrix, q, cover) else {
        return false;
    };
    for ((c, contact), z) in island.iter().zip(&z[..n]) {
        impulses.normal[c] = scale * unit(impulses, c) * z;
        rows.push_by(contact.normal, impulses.normal[c], v);
    }
    for (r, &i) in rough.iter().enumerate() {
        let (c, contact) = island.contact(i);
        let beta = scale * unit(impulses, c) * (z[n + r] - z[n + m + r]);
        impulses.rub_to(rows, c, contact, [beta, 0.0], v);
    }
    true
}

/// The impulse of a contact that its unknowns are measured in: 1 / (J_n M⁻¹ J_nᵀ).
fn unit(impulses: &Impulses, c: usize) -> f64 {
    1.0 / impulses.diagonal(c)[0]
}

/// The unknowns are Λ of all contacts, then β⁺, β⁻ and γ of those with friction.
impl Pivoting {
    /// Notes the contacts with friction, and counts them.
    fn find_rough(&mut self, island: &Island, impulses: &Impulses) -> usize {
        self.rough.clear();
        self.rough.extend((0..island.contacts.len()).filter(|&i| {
            let (c, contact) = island.contact(i);
            contact.is_rough() && impulses.diagonal(c)[1] > 0.0
        }));
        self.rough.len()
    }

    /// A problem of zeros.
    fn clear(&mut self, size: usize) {
        for (memory, size) in [(&mut self.matrix, size * size), (&mut self.q, size)] {
            memory.clear();
            memory.resize(size, 0.0);
        }
        self.cover.clear();
        self.cover.resize(size, 1.0);
    }

    /// The rows J_n v⁺ + c.
    fn write_normals(&mut self, island: &Island, impulses: &Impulses, v: &[f64]) {
        let rows = &island.linear.rows;
        let (n, m, size) = (island.contacts.len(), self.rough.len(), self.q.len());
        for (i, (c, contact)) in island.iter().enumerate() {
            self.q[i] = rows.rate(contact.normal, v) + impulses.normal_rate[c];
            let row = &mut self.matrix[i * size..][..size];
            for (place, (c, other)) in row.iter_mut().zip(island.iter()) {
                *place = rows.coupling(contact.normal, other.normal) * unit(impulses, c);
            }
            for (r, &k) in self.rough.iter().enumerate() {
                let (c, other) = island.contact(k);
                let entry = rows.coupling(contact.normal, other.normal + 1) * unit(impulses, c);
                row[n + r] = -entry;
                row[n + m + r] = entry;
            }
        }
    }

    /// The rows γ ∓ (J_t v⁺ + s) and μΛ - β⁺ - β⁻.
    fn write_slips(&mut self, island: &Island, impulses: &Impulses, v: &[f64]) {
        let rows = &island.linear.rows;
        let (n, m, size) = (island.contacts.len(), self.rough.len(), self.q.len());
        let matrix = &mut self.matrix;
        for (r, &i) in self.rough.iter().enumerate() {
            let (c, contact) = island.contact(i);
            let slip = rows.rate(contact.normal + 1, v) + impulses.slip_rate[c][0];
            let (plus, minus, last) = (n + r, n + m + r, n + 2 * m + r);
            (self.q[plus], self.q[minus]) = (-slip, slip);
            for (k, (c, other)) in island.iter().enumerate() {
                let entry = rows.coupling(contact.normal + 1, other.normal) * unit(impulses, c);
                matrix[plus * size + k] = -entry;
                matrix[minus * size + k] = entry;
            }
            for (p, &k) in self.rough.iter().enumerate() {
                let (c, other) = island.contact(k);
                let entry = rows.coupling(contact.normal + 1, other.normal + 1) * unit(impulses, c);
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
    }
}
