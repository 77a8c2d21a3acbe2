//! The sliding modes of a nonlinear switch over two states on its surface.

use crate::report::Change;

/// Number and stability of sliding modes over a rectangle.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Name of the switch.
    pub switch: String,
    /// Names of the states.
    pub states: [String; 2],
    /// Values of the states at the nodes of a grid, ascending.
    pub at: [Vec<f64>; 2],
    /// Which modes attract, in the order of their values, row by row, the first state being the faster index; none
    /// where the surface is not met.
    pub patterns: Vec<Option<Vec<bool>>>,
    /// Where the modes change.
    pub curves: Vec<PlaneCurve>,
}

/// A curve along which modes begin or end.
#[derive(Clone, Debug)]
pub struct PlaneCurve {
    /// What happens there.
    pub change: Change,
    /// Points on it, in order: both states.
    pub points: Vec<[f64; 2]>,
}

impl Plane {
    /// The patterns that occur, with the share of the nodes that have them; the most frequent one first.
    pub fn shares(&self) -> Vec<(Option<Vec<bool>>, f64)> {
        let mut found: Vec<(Option<Vec<bool>>, usize)> = Vec::new();
        for pattern in &self.patterns {
            match found.iter_mut().find(|(known, _)| known == pattern) {
                Some((_, count)) => *count += 1,
                None => found.push((pattern.clone(), 1)),
            }
        }
        found.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let whole = self.patterns.len().max(1) as f64;
        let shares = found.into_iter();
        shares
            .map(|(pattern, n)| (pattern, n as f64 / whole))
            .collect()
    }
}

/// `1 attracting, 1 repelling`, in the order of their values, or `none`.
pub fn words_of(pattern: Option<&[bool]>) -> String {
    let Some(pattern) = pattern else {
        return "not on the surface".to_owned();
    };
    let words: Vec<String> = (pattern.chunk_by(|a, b| a == b))
        .map(|alike| match alike[0] {
            true => format!("{} attracting", alike.len()),
            false => format!("{} repelling", alike.len()),
        })
        .collect();
    match words.is_empty() {
        true => "none".to_owned(),
        false => words.join(", "),
    }
}
