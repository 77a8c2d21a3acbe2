//! The same run at more instants, from its polynomial pieces.

use super::{Series, Trajectory};

/// The trajectory at about `n` instants, both ends of every piece among them.
///
/// `values` gives all reported states, outputs and controls, entry by entry, from
/// an instant and the rows of a piece there. Without pieces nothing changes.
pub fn refine(
    trajectory: &Trajectory,
    n: usize,
    values: &dyn Fn(f64, &[f64]) -> Vec<f64>,
) -> Trajectory {
    let mut fine = trajectory.clone();
    let (Some(first), Some(last)) = (
        trajectory.dense.pieces.first(),
        trajectory.dense.pieces.last(),
    ) else {
        return fine;
    };
    let span = last.to - first.from;
    fine.time.clear();
    let mut all: Vec<&mut Series> = fine
        .states
        .iter_mut()
        .chain(&mut fine.outputs)
        .chain(&mut fine.controls)
        .collect();
    all.iter_mut().for_each(|series| series.values.clear());

    for piece in &trajectory.dense.pieces {
        let n_steps = ((piece.to - piece.from) / span * n as f64).ceil().max(1.0);
        for k in 0..=n_steps as usize {
            let time = piece.from + (piece.to - piece.from) * (k as f64 / n_steps);
            let row = piece.at(time);
            let values = values(time, &row);
            let mut entries = values.into_iter();
            fine.time.push(time);
            for series in &mut all {
                series
                    .values
                    .extend(entries.by_ref().take(series.n_entries()));
            }
        }
    }
    fine
}

#[cfg(test)]
mod tests {
    use super::refine;
    use crate::report::{Dense, Piece, sample};

    #[test]
    fn pieces_are_sampled_with_both_ends() {
        let mut trajectory = sample::shapes();
        trajectory.states.truncate(1);
        trajectory.outputs = vec![trajectory.states[0].clone()];
        let piece = |from: f64, to: f64, coefficients: [f64; 2]| Piece {
            from,
            to,
            n_coefficients: 2,
            coefficients: coefficients.to_vec(),
        };
        trajectory.dense = Dense {
            pieces: vec![piece(0.0, 0.5, [1.0, 2.0]), piece(0.5, 1.0, [5.0, 0.0])],
        };
        let fine = refine(&trajectory, 4, &|time, row| vec![row[0], row[0] - time]);
        assert_eq!(fine.verify(), Ok(()));
        assert_eq!(fine.time, [0.0, 0.25, 0.5, 0.5, 0.75, 1.0]);
        assert_eq!(fine.states[0].values, [1.0, 1.5, 2.0, 5.0, 5.0, 5.0]);
        assert_eq!(fine.outputs[0].values[..2], [1.0, 1.25]);
    }
}
