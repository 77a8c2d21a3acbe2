//! Rows that vanish on all tangents because others do.

/// Entries of a row are zero up to this part of the terms that they are made of.
const CANCELS: f64 = 1e-9;

/// The span of rows that vanish, by an orthonormal basis.
pub(super) struct Implied {
    /// By which entries are multiplied.
    scales: Vec<f64>,
    basis: Vec<Vec<f64>>,
}

impl Implied {
    /// Those that vanish.
    pub fn by(rows: Vec<Vec<f64>>) -> Self {
        let width = rows.first().map_or(0, Vec::len);
        let scale = |i: usize| {
            let largest = rows.iter().map(|row| row[i].abs()).fold(0.0, f64::max);
            if largest > 0.0 { 1.0 / largest } else { 1.0 }
        };
        let mut implied = Implied {
            scales: (0..width).map(scale).collect(),
            basis: Vec::new(),
        };
        for row in rows {
            let row = implied.scaled(&row);
            let length = dot(&row, &row).sqrt();
            let (rest, _) = implied.rest(row);
            let left = dot(&rest, &rest).sqrt();
            // One that follows from the others is none of its own.
            if left > CANCELS * length {
                let unit = rest.iter().map(|entry| entry / left);
                implied.basis.push(unit.collect());
            }
        }
        implied
    }

    /// Whether a row, whose entries are made of terms of these sizes, is among them: entry by entry, so that it is so in whatever
    /// units, for any direction.
    pub fn has(&self, row: Vec<f64>, sizes: &[f64]) -> bool {
        let (rest, terms) = self.rest(self.scaled(&row));
        let sizes = self.scaled(sizes);
        let mut all = rest.iter().zip(terms.iter().zip(sizes));
        all.all(|(rest, (terms, size))| rest.abs() <= CANCELS * (terms + size))
    }

    fn scaled(&self, row: &[f64]) -> Vec<f64> {
        let scales = self.scales.iter().chain(std::iter::repeat(&1.0));
        row.iter().zip(scales).map(|(a, b)| a * b).collect()
    }

    /// What is left of a row outside of the span, and how large the terms are that have been taken away.
    fn rest(&self, mut row: Vec<f64>) -> (Vec<f64>, Vec<f64>) {
        let mut terms = vec![0.0; row.len()];
        // Twice, for what rounding leaves.
        for unit in self.basis.iter().chain(&self.basis) {
            let share = dot(unit, &row);
            for ((entry, term), unit) in row.iter_mut().zip(&mut terms).zip(unit) {
                *entry -= share * unit;
                *term += (share * unit).abs();
            }
        }
        (row, terms)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::Implied;

    fn has(known: &[&[f64]], row: &[f64]) -> bool {
        let sizes: Vec<f64> = row.iter().map(|entry| entry.abs()).collect();
        Implied::by(known.iter().map(|row| row.to_vec()).collect()).has(row.to_vec(), &sizes)
    }

    #[test]
    fn combinations_follow() {
        let known: [&[f64]; 3] = [
            &[1.0, 2.0, 0.0, 3.0],
            &[0.0, 1.0, 1.0, 1e8],
            &[1.0, 3.0, 1.0, 3.0 + 1e8],
        ];
        assert!(has(&known, &[2.0, 3.0, -1.0, 6.0 - 1e8]));
        assert!(has(&known, &[0.0; 4]) && has(&[], &[0.0; 4]));
        assert!(!has(&[], &[0.0, 0.0, 1e-30, 0.0]));
    }

    /// However small it is in another one's units.
    #[test]
    fn what_is_small_is_seen() {
        assert!(!has(&[&[1.0, -1.0, 0.0]], &[1.0, -1.0, 1e-20]));
        assert!(!has(&[&[1.0, 1e-12, 0.0]], &[1.0, 2e-12, 0.0]));
        assert!(has(&[&[1.0, 1e-12, 0.0]], &[-3.0, -3e-12, 0.0]));
    }
}
