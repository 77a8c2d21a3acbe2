//! The curve ψ(x, y) = 0 over a rectangle, by marching squares.
//!
//! Each cell of a grid whose corners differ in sign holds one or two segments;
//! segments that share an edge of the grid are joined to one line.

use rustc_hash::FxHashMap;

/// Cells in each direction.
const N: usize = 160;

/// An edge of the grid: its lower left node, and whether it runs along y.
type Edge = (usize, usize, bool);

/// Lines of points on ψ = 0 with x in `xs` and y in `ys`.
pub fn zero_set(
    psi: &dyn Fn(f64, f64) -> f64,
    (x_lo, x_hi): (f64, f64),
    (y_lo, y_hi): (f64, f64),
) -> Vec<Vec<(f64, f64)>> {
    let x = |i: usize| x_lo + (x_hi - x_lo) * i as f64 / N as f64;
    let y = |j: usize| y_lo + (y_hi - y_lo) * j as f64 / N as f64;
    let values: Vec<f64> = (0..=N)
        .flat_map(|j| (0..=N).map(move |i| (i, j)))
        // A node exactly on the curve belongs to the side above.
        .map(|(i, j)| match psi(x(i), y(j)) {
            0.0 => f64::MIN_POSITIVE,
            value => value,
        })
        .collect();
    let value = |i: usize, j: usize| values[j * (N + 1) + i];

    let mut neighbours: FxHashMap<Edge, Vec<Edge>> = FxHashMap::default();
    let mut order: Vec<Edge> = Vec::new();
    for j in 0..N {
        for i in 0..N {
            for (a, b) in segments(i, j, &value) {
                for (from, to) in [(a, b), (b, a)] {
                    neighbours.entry(from).or_default().push(to);
                    order.push(from);
                }
            }
        }
    }

    // Where ψ = 0 on the edge, by linear interpolation.
    let point = |(i, j, along_y): Edge| {
        let (k, l) = if along_y { (i, j + 1) } else { (i + 1, j) };
        let (a, b) = (value(i, j), value(k, l));
        let share = a / (a - b);
        (x(i) + share * (x(k) - x(i)), y(j) + share * (y(l) - y(j)))
    };

    // Open lines first, from their ends; what is left then is closed.
    let ends = order.iter().filter(|edge| neighbours[*edge].len() == 1);
    let starts: Vec<Edge> = ends.chain(&order).copied().collect();
    let mut lines = Vec::new();
    for start in starts {
        let mut line = vec![point(start)];
        let mut here = start;
        while let Some(next) = neighbours.get_mut(&here).and_then(Vec::pop) {
            if let Some(back) = neighbours.get_mut(&next)
                && let Some(k) = back.iter().position(|&edge| edge == here)
            {
                back.swap_remove(k);
            }
            line.push(point(next));
            here = next;
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

/// The segments in the cell whose lower left node is (i, j).
fn segments(i: usize, j: usize, value: &impl Fn(usize, usize) -> f64) -> Vec<(Edge, Edge)> {
    let corners = [
        value(i, j),
        value(i + 1, j),
        value(i + 1, j + 1),
        value(i, j + 1),
    ];
    if corners.iter().any(|corner| !corner.is_finite()) {
        return Vec::new();
    }
    let edges: [Edge; 4] = [
        (i, j, false),
        (i + 1, j, true),
        (i, j + 1, false),
        (i, j, true),
    ];
    let crossed: Vec<Edge> = (0..4)
        .filter(|&k| (corners[k] > 0.0) != (corners[(k + 1) % 4] > 0.0))
        .map(|k| edges[k])
        .collect();
    match crossed[..] {
        [a, b] => vec![(a, b)],
        // A saddle: the mean value says which corners belong together.
        [a, b, c, d] => {
            let joined = corners.iter().sum::<f64>() > 0.0;
            if (corners[0] > 0.0) == joined {
                vec![(a, b), (c, d)]
            } else {
                vec![(d, a), (b, c)]
            }
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::zero_set;

    const SQUARE: (f64, f64) = (-2.0, 2.0);

    #[test]
    fn a_circle_is_one_closed_line() {
        let lines = zero_set(&|x, y| x * x + y * y - 1.0, SQUARE, SQUARE);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].first(), lines[0].last());
        assert!(
            lines[0]
                .iter()
                .all(|(x, y)| (x.hypot(*y) - 1.0).abs() < 1e-3)
        );
    }

    #[test]
    fn an_axis_is_one_line_from_edge_to_edge() {
        let lines = zero_set(&|x, _| x, SQUARE, SQUARE);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].iter().all(|(x, _)| x.abs() < 1e-12));
        let ends = [lines[0][0].1, lines[0][lines[0].len() - 1].1];
        assert_eq!(ends.map(f64::abs), [2.0, 2.0]);
    }

    #[test]
    fn nothing_is_drawn_where_it_is_not_finite_or_has_no_zero() {
        assert!(zero_set(&|_, _| 1.0, SQUARE, SQUARE).is_empty());
        assert!(zero_set(&|_, _| f64::NAN, SQUARE, SQUARE).is_empty());
    }
}
