//! W = J D of contacts in factors: the rows J, and D = M⁻¹Jᵀ with M factored body by body.
//!
//! An impulse Λ changes the velocities v by D Λ, and these the rates J v.

use super::law::Pair;

/// M of bodies, a block for the velocities of each.
#[derive(Default)]
pub(crate) struct Mass {
    /// The first velocity of every body, and the end of the last.
    starts: Vec<usize>,
    /// The body that each velocity belongs to.
    body: Vec<usize>,
    /// M row by row, and its Cholesky factors.
    entries: Vec<f64>,
    factors: Vec<f64>,
    /// Where the blocks begin.
    blocks: Vec<usize>,
}

impl Mass {
    /// Bodies with so many velocities, one after the other; M is not known yet.
    pub fn new(sizes: impl Iterator<Item = usize>) -> Self {
        let (mut starts, mut blocks, mut body) = (vec![0], vec![0], Vec::new());
        for (b, size) in sizes.enumerate() {
            starts.push(starts[b] + size);
            blocks.push(blocks[b] + size.pow(2));
            body.resize(starts[b + 1], b);
        }
        let n = blocks[blocks.len() - 1];
        Mass {
            starts,
            body,
            entries: vec![0.0; n],
            factors: vec![0.0; n],
            blocks,
        }
    }

    pub fn n_bodies(&self) -> usize {
        self.starts.len() - 1
    }

    pub fn body_of(&self, velocity: usize) -> usize {
        self.body[velocity]
    }

    pub fn velocities_of(&self, body: usize) -> std::ops::Range<usize> {
        self.starts[body]..self.starts[body + 1]
    }

    /// Writes M row by row, body by body, and factors it; false where some M is not positive definite.
    pub fn write(&mut self, write: impl FnOnce(&mut [f64])) -> bool {
        write(&mut self.entries);
        self.factors.copy_from_slice(&self.entries);
        (0..self.n_bodies()).all(|b| {
            let n = self.velocities_of(b).len();
            cholesky(&mut self.factors[self.blocks[b]..], n)
        })
    }

    /// vᵀMw of a body.
    pub fn product(&self, body: usize, v: &[f64], w: &[f64]) -> f64 {
        let range = self.velocities_of(body);
        let n = range.len();
        let mass = &self.entries[self.blocks[body]..self.blocks[body + 1]];
        let (v, w) = (&v[range.clone()], &w[range]);
        let rows = mass.chunks_exact(n.max(1)).zip(v);
        rows.map(|(row, vi)| vi * row.iter().zip(w).map(|(m, wj)| m * wj).sum::<f64>())
            .sum()
    }

    /// Overwrites entries of a body's velocities by L⁻¹ times them.
    fn solve_half(&self, body: usize, rhs: &mut [f64]) {
        let n = rhs.len();
        let l = &self.factors[self.blocks[body]..self.blocks[body + 1]];
        for i in 0..n {
            let known: f64 = (0..i).map(|k| l[i * n + k] * rhs[k]).sum();
            rhs[i] = (rhs[i] - known) / l[i * n + i];
        }
    }

    /// Overwrites entries of a body's velocities by M⁻¹ times them.
    fn solve(&self, body: usize, rhs: &mut [f64]) {
        self.solve_half(body, rhs);
        let n = rhs.len();
        let l = &self.factors[self.blocks[body]..self.blocks[body + 1]];
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| l[k * n + i] * rhs[k]).sum();
            rhs[i] = (rhs[i] - known) / l[i * n + i];
        }
    }
}

/// L of a = L Lᵀ in the lower triangle; false where a is not positive definite.
fn cholesky(a: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
            let left = a[i * n + j] - known;
            if i == j {
                if left.is_nan() || left <= 0.0 {
                    return false;
                }
                a[i * n + i] = left.sqrt();
            } else {
                a[i * n + j] = left / a[j * n + j];
            }
        }
    }
    true
}

/// The rows of a contact: J_n, and behind it those of J_t.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactRows {
    pub normal: usize,
    /// Entries of the slip velocity; none without friction.
    pub slips: usize,
}

impl ContactRows {
    /// Whether there is friction.
    pub fn is_rough(&self) -> bool {
        self.slips > 0
    }

    /// Whether friction has two directions.
    pub fn is_conic(&self) -> bool {
        self.slips > 1
    }

    /// The rows of the slip velocity.
    pub fn slip_rows(&self) -> std::ops::Range<usize> {
        self.normal + 1..self.normal + 1 + self.slips
    }
}

/// Rows J with D = M⁻¹Jᵀ, one after the other.
#[derive(Default)]
pub(crate) struct Rows {
    starts: Vec<usize>,
    columns: Vec<u32>,
    j: Vec<f64>,
    d: Vec<f64>,
}

impl Rows {
    pub fn clear(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.columns.clear();
        self.j.clear();
        self.d.clear();
    }

    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Adds a row with these entries, each (velocity, value).
    pub fn push(&mut self, mass: &Mass, entries: &[(usize, f64)], touched: &mut Vec<usize>) {
        touched.clear();
        touched.extend(entries.iter().map(|&(v, _)| mass.body_of(v)));
        touched.sort_unstable();
        touched.dedup();
        for &body in touched.iter() {
            let range = mass.velocities_of(body);
            let first = self.j.len();
            self.columns.extend(range.clone().map(|v| v as u32));
            self.j.resize(first + range.len(), 0.0);
            for &(v, value) in entries.iter().filter(|(v, _)| mass.body_of(*v) == body) {
                self.j[first + v - range.start] += value;
            }
            self.d.extend_from_slice(&self.j[first..]);
            mass.solve(body, &mut self.d[first..]);
        }
        self.starts.push(self.columns.len());
    }

    fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }

    /// The velocities of a row.
    pub fn columns(&self, row: usize) -> &[u32] {
        &self.columns[self.range(row)]
    }

    /// J v
    pub fn rate(&self, row: usize, v: &[f64]) -> f64 {
        let range = self.range(row);
        let terms = self.columns[range.clone()].iter().zip(&self.j[range]);
        terms.map(|(&column, j)| j * v[column as usize]).sum()
    }

    /// L⁻¹Jᵀ, by velocity of the row.
    pub fn rooted(&self, row: usize, mass: &Mass) -> Vec<f64> {
        let mut values = self.j[self.range(row)].to_vec();
        let columns = self.columns(row);
        let mut first = 0;
        while first < columns.len() {
            let body = mass.body_of(columns[first] as usize);
            let next = first + mass.velocities_of(body).len();
            mass.solve_half(body, &mut values[first..next]);
            first = next;
        }
        values
    }

    /// v += D z
    pub fn add_impulse(&self, row: usize, z: f64, v: &mut [f64]) {
        let range = self.range(row);
        for (&column, d) in self.columns[range.clone()].iter().zip(&self.d[range]) {
            v[column as usize] += d * z;
        }
    }

    /// J_t v of a contact.
    pub fn slip(&self, contact: &ContactRows, v: &[f64]) -> Pair {
        let mut slip = [0.0; 2];
        for (slip, row) in slip.iter_mut().zip(contact.slip_rows()) {
            *slip = self.rate(row, v);
        }
        slip
    }

    /// Velocities that occur in the rows of a contact, those of each row one after the other.
    pub fn columns_of(&self, contact: &ContactRows) -> &[u32] {
        let (first, end) = (contact.normal, contact.slip_rows().end);
        &self.columns[self.range(first).start..self.range(end - 1).end]
    }

    /// v -= D_t β
    pub fn add_friction(&self, contact: &ContactRows, beta: Pair, v: &mut [f64]) {
        for (row, beta) in contact.slip_rows().zip(beta) {
            self.add_impulse(row, -beta, v);
        }
    }

    /// J_a D_b
    pub fn coupling(&self, a: usize, b: usize) -> f64 {
        let (of_a, of_b) = (self.range(a), self.range(b));
        let (mut i, mut k, mut sum) = (of_a.start, of_b.start, 0.0);
        while i < of_a.end && k < of_b.end {
            match self.columns[i].cmp(&self.columns[k]) {
                std::cmp::Ordering::Less => i += 1,
                std::cmp::Ordering::Greater => k += 1,
                std::cmp::Ordering::Equal => {
                    sum += self.j[i] * self.d[k];
                    (i, k) = (i + 1, k + 1);
                }
            }
        }
        sum
    }

    /// |J|² of a row.
    pub fn square(&self, row: usize) -> f64 {
        self.j[self.range(row)].iter().map(|j| j * j).sum()
    }

    /// J D of a row.
    pub fn diagonal(&self, row: usize) -> f64 {
        let range = self.range(row);
        let terms = self.j[range.clone()].iter().zip(&self.d[range]);
        terms.map(|(j, d)| j * d).sum()
    }
}
