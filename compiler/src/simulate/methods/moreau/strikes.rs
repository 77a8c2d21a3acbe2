//! Impacts of two runs of one model, with other steps.
//!
//! An impact s of a contact in one run and r in the other are the same where each is nearest to the other in time.
//! Velocities have no common value from the start of the earlier one's step to the end of the later one's: one run has
//! jumped there, and the other has not.

/// An impact of a contact, and the step it was in.
#[derive(Clone, Copy, Debug)]
struct Strike {
    contact: usize,
    time: f64,
    step: (f64, f64),
}

/// The impacts of a run, in order of time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Strikes {
    all: Vec<Strike>,
    /// How many of them are in steps that have ended.
    dated: usize,
}

impl Strikes {
    /// An impact in the step that ends next.
    pub fn add(&mut self, time: f64, contact: usize) {
        self.all.push(Strike {
            contact,
            time,
            step: (time, time),
        });
    }

    /// A step has ended.
    pub fn step(&mut self, start: f64, end: f64) {
        for strike in &mut self.all[self.dated..] {
            strike.step = (start, end);
        }
        self.dated = self.all.len();
    }

    /// The intervals of time between impacts of this run and the same ones of another.
    pub fn between(&self, other: &Strikes) -> Vec<(f64, f64)> {
        let [one, other] = [self, other].map(Strikes::by_contact);
        let same = one.iter().filter_map(|strike| {
            let found = nearest(&other, strike)?;
            let back = nearest(&one, found)?;
            (back.time == strike.time).then_some([strike.step, found.step])
        });
        same.map(|[a, b]| (a.0.min(b.0), a.1.max(b.1))).collect()
    }

    /// Contact by contact.
    fn by_contact(&self) -> Vec<Strike> {
        let mut all = self.all.clone();
        all.sort_by(|a, b| order(a, b.contact, b.time));
        all
    }
}

fn order(strike: &Strike, contact: usize, time: f64) -> std::cmp::Ordering {
    strike
        .contact
        .cmp(&contact)
        .then(strike.time.total_cmp(&time))
}

/// The impact of the same contact that is nearest in time.
fn nearest<'s>(strikes: &'s [Strike], to: &Strike) -> Option<&'s Strike> {
    let behind = strikes.partition_point(|other| order(other, to.contact, to.time).is_lt());
    let near = &strikes[behind.saturating_sub(1)..(behind + 1).min(strikes.len())];
    let same = near.iter().filter(|other| other.contact == to.contact);
    same.min_by(|a, b| {
        (a.time - to.time)
            .abs()
            .total_cmp(&(b.time - to.time).abs())
    })
}

#[cfg(test)]
mod tests {
    use super::Strikes;

    /// Impacts (t, contact), each in a step of length h.
    fn strikes(h: f64, all: &[(f64, usize)]) -> Strikes {
        let mut strikes = Strikes::default();
        for &(t, contact) in all {
            strikes.add(t, contact);
            let start = (t / h).floor() * h;
            strikes.step(start, start + h);
        }
        strikes
    }

    #[test]
    fn impacts_are_one_that_are_nearest_to_each_other() {
        let coarse = strikes(0.5, &[(1.25, 0), (2.625, 0), (2.75, 1)]);
        let fine = strikes(0.25, &[(1.5625, 0), (2.125, 1), (2.875, 0), (3.125, 0)]);
        let between = coarse.between(&fine);
        assert_eq!(between, [(1.0, 1.75), (2.5, 3.0), (2.0, 3.0)]);
        // One that has no counterpart before the end is nowhere near one.
        let fewer = strikes(0.25, &[(1.5625, 0)]);
        assert_eq!(coarse.between(&fewer), [(1.0, 1.75)]);
        assert!(coarse.between(&Strikes::default()).is_empty());
    }
}
