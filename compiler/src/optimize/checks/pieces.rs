//! Changes that add up: where a surface divides them, those on one side of it.

use super::around::Column;
use super::reduced::Quantity;

/// Slopes that differ by no more than this share of them bend, and have no corner.
const BENT: f64 = 1e-2;

/// The changes of quantities from a point that lead to the same events, with their opposites, where not all do. A surface
/// that is touched, or met in the last instant, divides all changes d by a plane, g d = 0, on each side of which they add
/// up: which side one of them alone leads to says nothing of several. Their last row is g d, which is not to fall.
pub(super) fn pieces(columns: &[Column], quantities: &[Quantity], w: &[f64]) -> Vec<Vec<Column>> {
    let mut all: Vec<&[usize]> = columns.iter().map(|column| &column.events[..]).collect();
    all.sort_unstable();
    all.dedup();
    if all.len() < 2 {
        return Vec::new();
    }
    let opposite = |column: &Column| {
        let mut quantities = quantities.iter();
        let quantity = quantities.find(|quantity| quantity.index == column.index)?;
        column.opposite(quantity, w[column.index])
    };
    let piece = |events: &[usize]| {
        let (own, others): (Vec<&Column>, Vec<&Column>) =
            columns.iter().partition(|column| column.events == events);
        let plane = plane(&own, &others)?;
        let with = |column: Column| {
            let across = plane.iter().find(|(index, _)| *index == column.index);
            let across = across.map_or(0.0, |(_, g)| g * column.step);
            let rows = column.rows.iter().copied().chain([across]);
            Column {
                rows: rows.collect(),
                ..column
            }
        };
        let opposites = own.iter().filter_map(|column| opposite(column));
        let own = own.iter().map(|&column| column.clone());
        Some(own.chain(opposites).map(with).collect())
    };
    all.into_iter().filter_map(piece).collect()
}

impl Column {
    /// The change in the other direction, as far as bounds allow, if all that it does turned with it.
    fn opposite(&self, quantity: &Quantity, value: f64) -> Option<Column> {
        let room = match self.step > 0.0 {
            true => value - quantity.lower,
            false => quantity.upper - value,
        };
        let share = -(room / self.step.abs()).min(1.0);
        (share < 0.0).then(|| Column {
            index: self.index,
            step: share * self.step,
            cost: share * self.cost,
            rows: self.rows.iter().map(|row| share * row).collect(),
            events: Vec::new(),
        })
    }
}

/// g of the plane that divides changes, if there is one, by quantity: the derivatives of a function on both sides of it differ by a multiple
/// of g, and of all functions that which differs most says it. It is positive along the changes of the first side.
fn plane(own: &[&Column], others: &[&Column]) -> Option<Vec<(usize, f64)>> {
    let pairs = own.iter().filter_map(|column| {
        let other = others
            .iter()
            .find(|other| other.index == column.index && other.step * column.step < 0.0)?;
        Some((*column, *other))
    });
    let pairs: Vec<(&Column, &Column)> = pairs.collect();
    let n = own.first().map_or(0, |column| column.rows.len());
    let value = |column: &Column, row: usize| match row {
        row if row == n => column.cost,
        row => column.rows[row],
    };
    let slope = |column: &Column, row| value(column, row) / column.step;
    let bend = |&(column, other): &(&Column, &Column), row: usize| {
        (slope(column, row) - slope(other, row)).abs()
    };
    let share = |row: usize| {
        let bent: f64 = pairs.iter().map(|pair| bend(pair, row)).sum();
        let slopes = pairs
            .iter()
            .map(|(column, other)| slope(column, row).abs() + slope(other, row).abs());
        let all: f64 = slopes.sum();
        if all > 0.0 { bent / all } else { 0.0 }
    };
    let most = (0..=n).max_by(|&a, &b| share(a).total_cmp(&share(b)));
    let row = most.filter(|&row| share(row) > BENT)?;
    let g = |pair: &(&Column, &Column)| (pair.0.index, pair.0.step.signum() * bend(pair, row));
    Some(pairs.iter().map(g).collect())
}
