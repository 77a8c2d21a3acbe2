//! A sweep of projected Gauss-Seidel: contact by contact, the impulse that its own law asks for (Moreau 1988; Jean 1999,
//! *The non-smooth contact dynamics method*).

use super::island::{Island, Motion};

/// Goes once over all contacts of the island.
pub(crate) fn sweep(island: &Island, motion: &mut Motion) {
    for (c, contact) in island.iter() {
        let [normal, tangential] = island.diagonal(c);
        let rate = island.rate(c, motion.v);
        let friction = island.laws.friction[c];
        if contact.is_conic() {
            let slip = island.slip(c, motion.v);
            let impulses = &motion.impulses;
            let present = (impulses.normal[c], impulses.tangential[c]);
            let (next, beta) = island.cone(c).law(present, (rate, slip), friction);
            motion.set_normal(island, c, next);
            motion.set_tangential(island, c, beta);
            continue;
        }
        let next = (motion.impulses.normal[c] - rate / normal).max(0.0);
        motion.set_normal(island, c, next);
        if contact.is_rough() && tangential > 0.0 {
            let row = contact.normal + 1;
            let slip = island.rows.rate(row, motion.v) + island.laws.slip_rate[c][0];
            let (beta, most) = (motion.impulses.tangential[c][0], friction * next);
            let next = (beta + slip / tangential).clamp(-most, most);
            island.rows.add_impulse(row, beta - next, motion.v);
            motion.impulses.tangential[c][0] = next;
        }
    }
}
