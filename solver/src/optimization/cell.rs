//! Cells of an arrangement of planes: polyhedra that are known by a ball inside.
//!
//! A cell is cut by one plane after the other. Where a plane cuts the known ball, both sides have an interior and
//! nothing needs to be solved; else a linear program finds the largest ball (Chebyshev centre, Boyd & Vandenberghe
//! 2004, section 4.3.1) of the side that the ball is not in:
//!
//! maximize t  subject to  a_i·x + b_i >= t for all rows,  t <= 1,  |a_i| = 1
//!
//! It has a solution for any rows; t < 0 is by how much the rows must be moved before they have a common point.
//! The centre proves t from below, and the multipliers prove it from above.

use crate::optimization::qp;
use crate::optimization::qp::HalfSpace;

/// A ball of a smaller radius is no interior, and rows that miss each other by less touch. It is relative to
/// coordinates in which the offsets of planes are of the order of one.
pub const THIN: f64 = 1e-8;

/// Parallel planes are apart when their offsets differ by more than this, relatively.
const PARALLEL: f64 = 1e-12;

/// Multipliers prove nothing when the gradient that they leave is larger.
const RESIDUAL: f64 = 1e-8;

/// { x : a_i·x + b_i >= 0 for all i }.
#[derive(Clone, Debug)]
pub struct Cell {
    rows: Vec<HalfSpace>,
    centre: Vec<f64>,
    radius: f64,
}

/// What is on one side of a plane.
#[derive(Clone, Debug)]
pub enum Part {
    /// A cell; it may be [thin](Cell::is_thin).
    Cell(Cell),
    /// Proven to be empty.
    Empty,
    /// The linear program has failed.
    Unknown,
}

impl Cell {
    /// All of the space. Coordinates are those that occur in rows.
    pub fn space() -> Self {
        Cell {
            rows: Vec::new(),
            centre: Vec::new(),
            radius: 1.0,
        }
    }

    /// A point that satisfies all rows, with some distance where the cell has an interior.
    pub fn centre(&self) -> &[f64] {
        &self.centre
    }

    /// The half-spaces that bound the cell.
    pub fn rows(&self) -> &[HalfSpace] {
        &self.rows
    }

    /// True where no interior was found: planes only touch in the cell.
    pub fn is_thin(&self) -> bool {
        self.radius <= THIN
    }

    /// What is on the side of a half-space, whose normal has length one. `programs` counts what had to be solved.
    pub fn part(&self, row: &HalfSpace, programs: &mut usize) -> Part {
        let highest = row.normal.iter().map(|&(j, _)| j + 1).max().unwrap_or(0);
        if highest > self.centre.len() {
            let mut cell = self.clone();
            cell.centre.resize(highest, 0.0);
            return cell.part(row, programs);
        }
        let value = row.value(&self.centre);
        if !self.is_thin() && value >= self.radius {
            return Part::Cell(self.with(row, self.centre.clone(), self.radius));
        }
        if !self.is_thin() && value > 2.0 * THIN - self.radius {
            // The ball's cap reaches from the plane, at -value along the normal, to +radius.
            let mut centre = self.centre.clone();
            let shift = 0.5 * (self.radius - value);
            for &(j, a) in &row.normal {
                centre[j] += shift * a;
            }
            return Part::Cell(self.with(row, centre, 0.5 * (self.radius + value)));
        }
        let opposite = row.opposite();
        let parallel = (self.rows.iter()).filter(|known| is_parallel(known, &opposite));
        // Between parallel planes, the width is known to rounding and without a program.
        let widths = parallel.map(|known| (known.offset + row.offset, known.offset.abs()));
        let mut negative = widths.filter(|(width, size)| *width < -PARALLEL * size);
        if negative.next().is_some() {
            return Part::Empty;
        }
        *programs += 1;
        self.largest_ball(row)
    }

    fn with(&self, row: &HalfSpace, centre: Vec<f64>, radius: f64) -> Self {
        let mut rows = self.rows.clone();
        let implies = |known: &HalfSpace| is_parallel(known, row) && known.offset <= row.offset;
        if !rows.iter().any(implies) {
            rows.retain(|known| !is_parallel(known, row));
            rows.push(row.clone());
        }
        Cell {
            rows,
            centre,
            radius,
        }
    }

    fn largest_ball(&self, row: &HalfSpace) -> Part {
        let n = self.centre.len();
        let cell = self.with(row, self.centre.clone(), 0.0);
        let mut rows = cell.rows.clone();
        for row in &mut rows {
            row.normal.push((n, -1.0));
        }
        rows.push(HalfSpace {
            normal: vec![(n, -1.0)],
            offset: 1.0,
        });
        let mut cost = vec![0.0; n + 1];
        cost[n] = -1.0;
        let Some(solution) = qp::solve(&vec![0.0; n + 1], &cost, &rows) else {
            return Part::Unknown;
        };
        let centre = solution.x[..n].to_vec();
        let radius = (cell.rows.iter())
            .map(|row| row.value(&centre))
            .fold(1.0, f64::min);
        if radius > THIN {
            return Part::Cell(Cell {
                centre,
                radius,
                ..cell
            });
        }
        match upper_bound(&cell.rows, &solution.multipliers, n) {
            Some(bound) if bound < -THIN => Part::Empty,
            Some(bound) if bound <= 2.0 * THIN => Part::Cell(Cell {
                centre,
                radius: 0.0,
                ..cell
            }),
            _ => Part::Unknown,
        }
    }

    /// The point of the cell that is nearest to the origin, at half the known radius from all rows.
    pub fn nearest(&self) -> Option<Vec<f64>> {
        let margin = 0.5 * self.radius;
        let mut rows = self.rows.clone();
        rows.iter_mut().for_each(|row| row.offset -= margin);
        let n = self.centre.len();
        let found = qp::solve(&vec![1.0; n], &vec![0.0; n], &rows)?.x;
        (self.rows.iter())
            .all(|row| row.value(&found) > 0.5 * margin)
            .then_some(found)
    }
}

/// An upper bound on t from multipliers: with Σ z_i = 1 and Σ z_i a_i = 0, t <= Σ z_i (a_i·x + b_i) = Σ z_i b_i.
fn upper_bound(rows: &[HalfSpace], multipliers: &[f64], n: usize) -> Option<f64> {
    let total: f64 = multipliers.iter().sum();
    let mut gradient = vec![0.0; n];
    // The last row is t <= 1.
    let mut bound = *multipliers.last()? / total;
    for (row, z) in rows.iter().zip(multipliers) {
        for &(j, a) in &row.normal {
            gradient[j] += z / total * a;
        }
        bound += z / total * row.offset;
    }
    let residual = gradient.iter().map(|g| g.abs()).fold(0.0, f64::max);
    (residual <= RESIDUAL && bound.is_finite()).then_some(bound)
}

/// Whether two unit normals are equal to rounding.
fn is_parallel(a: &HalfSpace, b: &HalfSpace) -> bool {
    let same = |(x, y): (&(usize, f64), &(usize, f64))| x.0 == y.0 && (x.1 - y.1).abs() < 1e-14;
    a.normal.len() == b.normal.len() && a.normal.iter().zip(&b.normal).all(same)
}

#[cfg(test)]
mod tests {
    use super::{Cell, Part};
    use crate::optimization::qp::HalfSpace;

    fn row(normal: &[f64], offset: f64) -> HalfSpace {
        let normal = normal
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, a)| *a != 0.0);
        let row = HalfSpace {
            normal: normal.collect(),
            offset,
        };
        row.normalized().expect("a direction")
    }

    /// Counts the cells with interior of an arrangement, and the closed ones.
    fn count(planes: &[HalfSpace]) -> (usize, usize, usize) {
        let mut programs = 0;
        let mut cells = vec![Cell::space()];
        for plane in planes {
            let mut next = Vec::new();
            for cell in &cells {
                for side in [plane.clone(), plane.opposite()] {
                    match cell.part(&side, &mut programs) {
                        Part::Cell(cell) => next.push(cell),
                        Part::Empty => {}
                        Part::Unknown => panic!("undecided: {cell:?} {side:?}"),
                    }
                }
            }
            cells = next;
        }
        for cell in &cells {
            assert!(
                cell.rows()
                    .iter()
                    .all(|row| row.value(cell.centre()) > -1e-9)
            );
        }
        let open = cells.iter().filter(|cell| !cell.is_thin()).count();
        (open, cells.len(), programs)
    }

    #[test]
    fn planes_in_general_position_have_as_many_cells_as_the_formula_says() {
        // Σ_{i <= n} binomial(m, i) cells (Buck 1943).
        let angle = |k: usize| 0.3 + 2.4 * k as f64;
        let lines: Vec<HalfSpace> = (0..9)
            .map(|k| {
                row(
                    &[angle(k).cos(), angle(k).sin()],
                    0.4 - 0.17 * (k * k % 7) as f64,
                )
            })
            .collect();
        let (open, closed, _) = count(&lines);
        assert_eq!(open, 1 + 9 + 36);
        assert_eq!(closed, open);
        let planes: Vec<HalfSpace> = (0..6)
            .map(|k| {
                let (a, b) = (angle(k), 1.7 * angle(k) + 0.2);
                row(
                    &[a.cos(), a.sin(), b.cos()],
                    0.3 - 0.11 * (k * k % 5) as f64,
                )
            })
            .collect();
        assert_eq!(count(&planes).0, 1 + 6 + 15 + 20);
    }

    #[test]
    fn planes_through_a_point_touch() {
        // Three lines through the origin: six cells, and two combinations of sides at the origin only.
        let lines = [
            row(&[1.0, 0.0], 0.0),
            row(&[0.0, 1.0], 0.0),
            row(&[1.0, 1.0], 0.0),
        ];
        let (open, closed, _) = count(&lines);
        assert_eq!((open, closed), (6, 8));
    }

    #[test]
    fn parallel_planes_need_few_programs() {
        let lines: Vec<HalfSpace> = (0..30).map(|k| row(&[1.0], -0.1 * k as f64)).collect();
        let (open, closed, programs) = count(&lines);
        assert_eq!((open, closed), (31, 31));
        // Of 31 · 30 sides only those need one that are beyond the ball and not beyond a plane.
        assert!(programs < 30, "{programs}");
    }

    #[test]
    fn the_nearest_point_is_inside() {
        let mut programs = 0;
        let mut cell = Cell::space();
        for side in [
            row(&[1.0, 0.0], -3.0),
            row(&[-1.0, 0.0], 3.5),
            row(&[1.0, -2.0], 0.0),
        ] {
            cell = match cell.part(&side, &mut programs) {
                Part::Cell(cell) => cell,
                other => panic!("{other:?}"),
            };
        }
        let near = cell.nearest().expect("the strip is not empty");
        assert!(
            (3.0..3.5).contains(&near[0]) && near[1].abs() < 1e-6,
            "{near:?}"
        );
    }
}
