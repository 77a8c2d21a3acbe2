//! The impulses of an island without friction, as a convex program.
//!
//! v⁺ is the nearest to v, in the metric of M, of those with J v⁺ + c ≥ 0, and Λ are the multipliers. With M = L Lᵀ and
//! u = Lᵀ(v⁺ - v) it is min ½ |u|² subject to (L⁻¹Jᵀ)ᵀu + J v + c ≥ 0: whatever contacts depend on each other, the
//! solution is one, and an interior point method finds it.

use super::island::{Island, Motion};
use super::rows::Mass;
use crate::optimization::qp;
use crate::optimization::qp::HalfSpace;

/// Sets impulses and velocities of contacts without friction to a solution; false where there is none.
pub(crate) fn solve(island: &Island, mass: &Mass, motion: &mut Motion) -> bool {
    let rows = island.rows;
    for (c, _) in island.iter() {
        motion.set_normal(island, c, 0.0);
    }
    let mut columns: Vec<u32> = (island.iter())
        .flat_map(|(_, contact)| rows.columns(contact.normal))
        .copied()
        .collect();
    columns.sort_unstable();
    columns.dedup();
    let mut half_spaces: Vec<HalfSpace> = (island.iter())
        .map(|(c, contact)| {
            let of_row = rows.columns(contact.normal).iter();
            let place = |column| columns.binary_search(column).expect("it is one of them");
            let values = rows.rooted(contact.normal, mass);
            HalfSpace {
                normal: of_row.map(place).zip(values).collect(),
                offset: island.rate(c, motion.v),
            }
        })
        .collect();
    let offsets = half_spaces.iter().map(|half_space| half_space.offset);
    let scale = offsets.fold(0.0_f64, |most, offset| most.max(offset.abs()));
    if scale == 0.0 {
        return true;
    }
    for half_space in &mut half_spaces {
        half_space.offset /= scale;
    }
    let n = columns.len();
    // Large impulses of jammed bodies leave less than all digits; the residual says what it is worth.
    let found = qp::approach(&vec![1.0; n], &vec![0.0; n], &half_spaces);
    let Some((found, _)) = found.filter(|(found, _)| found.x.iter().all(|x| x.is_finite())) else {
        return false;
    };
    for ((c, _), multiplier) in island.iter().zip(found.multipliers) {
        motion.set_normal(island, c, scale * multiplier);
    }
    true
}
