//! A sweep of projected Gauss-Seidel: contact by contact, the impulse that its own law asks for (Moreau 1988; Jean 1999,
//! *The non-smooth contact dynamics method*).

use super::island::{Island, Motion};

/// Goes once over all contacts of the island, each with the impulses of the others as they are:
///
/// Λ ← max(Λ - a/W_nn, 0),   then for one tangential direction   β ← min(max(β + b/W_tt, -μΛ), μΛ)
///
/// with the rate a of the gap and the slip velocity b. β is friction against the slip, hence the plus. With two tangential
/// directions the law of the contact is solved as a whole (`law.rs`).
pub(crate) fn sweep(island: &Island, motion: &mut Motion) {
    for (c, contact) in island.iter() {
        let [w_nn, w_tt] = island.diagonal(c);
        let rate = island.rate(c, motion.v);
        let friction = island.laws.friction[c];
        if contact.is_conic() {
            let slip = island.slip(c, motion.v);
            let impulses = &motion.impulses;
            let present = (impulses.normal[c], impulses.tangential[c]);
            let (lambda, beta) = island.cone(c).law(present, (rate, slip), friction);
            motion.set_normal(island, c, lambda);
            motion.set_tangential(island, c, beta);
            continue;
        }
        let lambda = (motion.impulses.normal[c] - rate / w_nn).max(0.0);
        motion.set_normal(island, c, lambda);
        if contact.is_rough() && w_tt > 0.0 {
            let row = contact.normal + 1;
            let slip = island.rows.rate(row, motion.v) + island.laws.slip_rate[c][0];
            let (beta, bound) = (motion.impulses.tangential[c][0], friction * lambda);
            let next = (beta + slip / w_tt).clamp(-bound, bound);
            island.rows.add_impulse(row, beta - next, motion.v);
            motion.impulses.tangential[c][0] = next;
        }
    }
}
