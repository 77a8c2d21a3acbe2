//! What is asked of a run that is differentiated, and what is found.

use super::why::{Loss, Why};

/// By what a run is differentiated: for each direction, what it does to the start and to the parameters.
#[derive(Clone, Debug, Default)]
pub struct Directions {
    /// dx(0)/dp, as many entries as states, by direction.
    pub initial: Vec<Vec<f64>>,
    /// The derivatives of the parameters of the system, by direction.
    pub parameters: Vec<Vec<f64>>,
}

impl Directions {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.initial.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.initial.is_empty()
    }
}

/// An instant of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// When.
    pub time: f64,
    /// Whether behind what happens there.
    pub is_behind: bool,
}

/// When something happened, and how that moves with each direction.
#[derive(Clone, Debug, PartialEq)]
pub struct EventTime {
    /// When.
    pub time: f64,
    /// dt/dp by direction; not a number where it is not known.
    pub by: Vec<f64>,
}

/// Instants that are nearer to an event, relative to 1 and to themselves, may be on either side of it.
const BESIDE: f64 = 1e-9;
/// Differences below this are none, whatever the sizes of tangents are.
const NOTHING: f64 = 1e-9;

/// The derivatives of a run.
pub struct Sensitivities {
    /// The instants of all events, in order.
    pub events: Vec<EventTime>,
    /// From when on directions are not known.
    pub lost: Vec<Option<Loss>>,
    /// The share of its terms up to which ψ is zero, as far as the run knows.
    width: f64,
    instants: Vec<Moment>,
    /// How many states and α there are, and of how many instants they are known.
    size: usize,
    n_points: usize,
    /// States and all α at the instants, up to where nothing is known.
    points: Vec<f64>,
    /// The tangents of these, by direction; not numbers where they are not known.
    tangents: Vec<f64>,
}

impl Sensitivities {
    /// Nothing yet of as many states and α, in so many directions, at instants in order.
    pub(crate) fn new(width: f64, [size, n_directions]: [usize; 2], instants: &[Moment]) -> Self {
        Sensitivities {
            events: Vec::new(),
            lost: vec![None; n_directions],
            width,
            instants: instants.to_vec(),
            size,
            n_points: 0,
            points: Vec::new(),
            tangents: Vec::new(),
        }
    }

    /// The first instant that nothing is known of yet, or one so many behind it.
    pub(crate) fn next(&self, behind: usize) -> Option<Moment> {
        self.instants.get(self.n_points() + behind).copied()
    }

    /// How many instants are known.
    pub(crate) fn n_points(&self) -> usize {
        self.n_points
    }

    /// Takes down the next instant: `point` writes states and all α, and `tangent` what moves with a direction, where that is
    /// known.
    pub(crate) fn push(
        &mut self,
        point: impl FnOnce(&mut [f64]),
        mut tangent: impl FnMut(usize, &mut [f64]) -> Option<()>,
    ) {
        let [n, first] = [self.points.len(), self.tangents.len()];
        self.n_points += 1;
        self.points.resize(n + self.size, 0.0);
        point(&mut self.points[n..]);
        self.tangents
            .resize(first + self.lost.len() * self.size, 0.0);
        let all = self.tangents[first..].chunks_mut(self.size.max(1));
        for (d, own) in all.enumerate() {
            if tangent(d, own).is_none() {
                own.fill(f64::NAN);
            }
        }
    }

    /// Gives up a direction, unless it is lost.
    pub(crate) fn lose(&mut self, direction: usize, loss: Loss) {
        self.lost[direction].get_or_insert(loss);
    }

    /// Gives up directions from where on a finer run has other tangents of these many states: by more than a share of the
    /// largest entry that they have had. Where something happens either may be on the other side.
    pub fn confirm(&mut self, finer: &Sensitivities, n_states: usize, within: f64) {
        let near = |time: f64| {
            let mut events = self.events.iter().chain(&finer.events);
            events.any(|event| (event.time - time).abs() <= BESIDE * time.abs().max(1.0))
        };
        let compared: Vec<usize> = (0..self.n_points())
            .filter(|&instant| !near(self.instants[instant].time))
            .collect();
        for direction in 0..self.lost.len() {
            let (mut largest, mut known) = (0.0_f64, 0.0);
            for &instant in &compared {
                let Some(own) = self.at(instant, direction) else {
                    break;
                };
                let other = finer.at(instant, direction);
                let differs = other.is_none_or(|other| {
                    let states = other.iter().take(n_states);
                    largest = states.fold(largest, |most, v| most.max(v.abs()));
                    let pairs = own.iter().zip(other).take(n_states);
                    let mut apart = pairs.map(|(a, b)| (a - b).abs());
                    apart.any(|apart| apart > within * largest + NOTHING)
                });
                if differs {
                    self.give_up(direction, known);
                    break;
                }
                known = self.instants[instant].time;
            }
        }
    }

    /// Gives up a direction from an instant on, events behind it among that.
    fn give_up(&mut self, direction: usize, time: f64) {
        self.lose(
            direction,
            Loss {
                time,
                why: Why::Coarse,
                switches: Vec::new(),
            },
        );
        let behind = self.events.iter_mut().filter(|event| event.time > time);
        behind.for_each(|event| event.by[direction] = f64::NAN);
    }

    /// The same of another system with so many states and α, which follow from these, as their tangents do, with those of its
    /// switches that are among these.
    pub fn seen(
        mut self,
        size: usize,
        point: impl Fn(&[f64]) -> Vec<f64>,
        tangent: impl Fn(&[f64]) -> Vec<f64>,
        switch: impl Fn(usize) -> Option<usize>,
    ) -> Self {
        let own = self.size.max(1);
        self.points = self.points.chunks(own).flat_map(point).collect();
        self.tangents = self.tangents.chunks(own).flat_map(tangent).collect();
        self.size = size;
        for loss in self.lost.iter_mut().flatten() {
            loss.switches = loss.switches.iter().filter_map(|&k| switch(k)).collect();
        }
        self
    }

    /// dx/dp at one of the instants that were asked for, and behind it those of all α; none from where on they are not
    /// known.
    pub fn at(&self, instant: usize, direction: usize) -> Option<&[f64]> {
        let Moment { time, is_behind } = self.instants[instant];
        if instant >= self.n_points {
            return None;
        }
        let is_lost = |loss: &Loss| time > loss.time || time == loss.time && is_behind;
        let first = (instant * self.lost.len() + direction) * self.size;
        let known = &self.tangents[first..][..self.size];
        let is_known = !self.lost[direction].as_ref().is_some_and(is_lost);
        is_known
            .then_some(known)
            .filter(|known| known.iter().all(|v| !v.is_nan()))
    }

    /// The share of its terms up to which ψ is zero, as far as the run knows.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// The state and all α of that instant, nothing behind losses of all directions; an α is not a number where nothing but
    /// outputs looks at it.
    pub fn point(&self, instant: usize) -> &[f64] {
        match instant < self.n_points {
            true => &self.points[instant * self.size..][..self.size],
            false => &[],
        }
    }
}
