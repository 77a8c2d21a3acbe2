//! What gaps are told apart: how small those are that count as zero.
//!
//! They are shares of a length, which is the largest position |q|. Where places are far from zero, |q| says nothing of
//! lengths: a gap that is closed is a small share of what positions move by, but no less than four roundings of the
//! positions that it balances itself.

use super::bodies::ROUNDING;
use super::scene::Family;

/// A gap below this share of its length is closed.
pub(super) const TOUCH: f64 = 1e-10;
/// A contact is closed by more than rounding at the start where its gap is below minus this share of its length.
const PENETRATES: f64 = 1e-9;
/// No gap counts as zero above this share of what positions move by: in a step, or at the start in the run (chosen by
/// trial).
const CLOSED: f64 = 1e-2;

/// What a gap is told apart from.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Resolution {
    /// The length of which gaps that count as zero are shares.
    length: f64,
    /// Rounding of the positions that the gap balances.
    rounding: f64,
}

impl Resolution {
    /// A share of the length, but no less than rounding.
    pub fn share(self, share: f64) -> f64 {
        (share * self.length).max(self.rounding)
    }

    /// Whether a gap is closed by more than rounding where a run starts.
    pub fn is_below(self, gap: f64) -> bool {
        gap.is_nan() || gap < -self.share(PENETRATES)
    }
}

/// How large positions are, and what they move by.
#[derive(Clone, Copy, Default)]
pub(super) struct Lengths {
    /// The largest |q|.
    size: f64,
    /// The length of which gaps that count as zero are shares.
    length: f64,
    /// The most that a step of the run has moved a position by.
    moved: f64,
}

impl Lengths {
    /// Takes the size of positions that move by `moved` in a step.
    pub fn measure(&mut self, size: f64, moved: f64) {
        self.size = size;
        self.moved = self.moved.max(moved);
        self.bound(TOUCH, self.moved);
    }

    /// Where a run starts in which positions move by `moved`: however long its steps are.
    pub fn start(&mut self, moved: f64) {
        self.bound(PENETRATES, moved);
    }

    /// Sets the length of which gaps are a share that count as zero; where nothing has moved yet, it is the size.
    fn bound(&mut self, share: f64, moved: f64) {
        self.length = match moved > 0.0 {
            true => self.size.min(CLOSED / share * moved),
            false => self.size,
        };
    }

    /// What the gap of a contact is told apart from. Shares of the size are above its rounding.
    pub fn of(self, family: &Family, member: u32, memory: &[f64]) -> Resolution {
        let mut size = 0.0_f64;
        if self.length < self.size {
            let places = family.inputs_of(member as usize);
            let positions = family.positions.iter().map(|&input| places[input] as usize);
            size = positions.fold(size, |size, place| size.max(memory[place].abs()));
        }
        Resolution {
            length: self.length,
            rounding: ROUNDING * size,
        }
    }
}
