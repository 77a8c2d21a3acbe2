//! Switches at ends of control intervals, moved to either side.
//!
//! Where the mode changes exactly at the end of an interval, nothing switches inside the two intervals, and their
//! elements are equal. The same trajectory has other descriptions: the interval behind may start with an element of
//! length zero in the old mode, or the interval before may end with one in the new mode. These points are far from
//! each other, as all elements of an interval have other lengths; a switch that would rather happen a little later
//! can do so from the one, a little earlier from the other, and from neither where it is: without more, every
//! end of an interval is a local minimum for every switch.
//!
//! With b the members of pairs that are continuous, b = 0 at the switch is a constraint. Its multiplier, without those
//! of the pairs, says in which direction the switch wants to go, where something closes on that side.
//!
//! In the same way a part of the trajectory that lies on a surface, where it makes no difference which side counts,
//! has descriptions in both modes, and in one after the other: small changes of several controls together cross the
//! surface on the way.

use std::collections::BTreeMap;
use std::ops::Range;

use nsd_solver::integrate::tableau::lagrange;
use nsd_solver::optimization::problem::{Member, Other};
use rustc_hash::FxHashMap;

use crate::lowering::discretize::Layout;
use crate::lowering::mpcc::{Conditions, Linearized, Others};
use crate::optimize::start::products::Product;

/// Runs that are so short, as a share of their interval, are none.
const SHORTEST: f64 = 1e-9;
/// b that is so small is zero.
const ON_SURFACE: f64 = 1e-9;
/// Rates that differ by no more, over the length of an element, are the same.
const SAME_RATES: f64 = 1e-7;
/// Multipliers above this are not negative.
const NEGATIVE: f64 = -1e-9;

/// Moves switches of a discretized system.
#[derive(Debug)]
pub(crate) struct Moved {
    layout: Layout,
    conditions: Conditions,
    products: Vec<Product>,
}

/// Consecutive elements of an interval in one mode.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    /// Which pairs are open.
    open: Vec<bool>,
    /// Where its values come from: elements from j to before j.
    from: (usize, usize, usize),
    /// When it starts in its interval, and how long it is.
    start: f64,
    length: f64,
    /// How many elements it gets.
    count: usize,
    /// Where it gets another mode.
    swap: Option<Swap>,
}

/// Another description.
#[derive(Clone, Debug)]
enum Change {
    /// The switch at the end of interval k belongs to the one behind.
    Later(usize),
    /// It belongs to interval k itself.
    Earlier(usize),
    /// There is none at the end of interval k.
    Plain(usize),
    /// A run has another mode.
    Mode {
        interval: usize,
        run: usize,
        swap: Swap,
    },
    /// The halves of a run have modes of their own, where there is one.
    Halves {
        interval: usize,
        run: usize,
        swaps: [Option<Swap>; 2],
    },
}

/// The member that opens and the one that closes.
type Swap = (usize, usize);

impl Change {
    /// The intervals that change with it, of so many.
    fn beside(&self, n: usize) -> Range<usize> {
        match *self {
            Change::Later(k) | Change::Earlier(k) | Change::Plain(k) => k - 1..k + 1,
            Change::Mode { interval, .. } | Change::Halves { interval, .. } => {
                interval.saturating_sub(1)..(interval + 2).min(n)
            }
        }
    }

    /// The interval and the number of the run that takes another mode.
    fn takes_modes_in(&self) -> Option<(usize, usize)> {
        match *self {
            Change::Later(_) | Change::Earlier(_) | Change::Plain(_) => None,
            Change::Mode { interval, run, .. } | Change::Halves { interval, run, .. } => {
                Some((interval, run))
            }
        }
    }

    /// Gives a run its modes.
    fn take_modes(&self, touched: &mut BTreeMap<usize, Vec<Run>>) {
        let Some((interval, run)) = self.takes_modes_in() else {
            return;
        };
        let runs = touched.entry(interval).or_default();
        match *self {
            Change::Mode { swap, .. } => runs[run].take(swap),
            Change::Halves { swaps, .. } => {
                let halves = runs[run].halves(swaps);
                runs.splice(run..=run, halves);
            }
            Change::Later(_) | Change::Earlier(_) | Change::Plain(_) => {}
        }
    }
}

impl Run {
    /// When it ends in its interval.
    fn end(&self) -> f64 {
        self.start + self.length
    }

    /// Its mode, for no time.
    fn of_no_length(&self, start: f64) -> Run {
        Run {
            start,
            length: 0.0,
            count: 1,
            ..self.clone()
        }
    }

    /// Takes another mode.
    fn take(&mut self, (opens, closes): Swap) {
        (self.open[opens], self.open[closes]) = (true, false);
        self.swap = Some((opens, closes));
    }

    /// One half after the other.
    fn halves(&self, swaps: [Option<Swap>; 2]) -> [Run; 2] {
        let middle = 0.5 * self.length;
        [0, 1].map(|half| {
            let mut run = Run {
                start: self.start + half as f64 * middle,
                length: middle,
                count: self.count.div_ceil(2),
                ..self.clone()
            };
            swaps[half].into_iter().for_each(|swap| run.take(swap));
            run
        })
    }
}

/// The modes of halves that are worth trying where a run may have `others`: its own is one of them unless it is on both sides.
fn halves(others: &[Swap], open: &[bool]) -> Vec<[Option<Swap>; 2]> {
    let pairs = others.iter().flat_map(|&(opens, closes)| {
        let other = Some((opens, closes));
        let back = others.contains(&(closes, opens));
        match (open[opens], back) {
            (false, _) => vec![[other, None], [None, other]],
            (true, true) => vec![[other, Some((closes, opens))]],
            (true, false) => Vec::new(),
        }
    });
    pairs.collect()
}

/// A point under construction: what differs from the old one.
struct Point<'a> {
    old: &'a [f64],
    new: BTreeMap<usize, f64>,
    zeros: BTreeMap<usize, Member>,
}

impl Moved {
    pub fn new(layout: &Layout, conditions: &Conditions, products: Vec<Product>) -> Self {
        Moved {
            layout: layout.clone(),
            conditions: conditions.clone(),
            products,
        }
    }

    /// The modes of interval k, without those of no length.
    fn runs(&self, k: usize, w: &[f64], zeros: &[Member]) -> Vec<Run> {
        let layout = &self.layout;
        let lengths: Vec<f64> = (1..=layout.elements)
            .map(|j| w[layout.h(k, j)].max(0.0))
            .collect();
        let whole: f64 = lengths.iter().sum();
        let mut runs: Vec<Run> = Vec::new();
        let mut start = 0.0;
        for (j, length) in (1..).zip(lengths) {
            let element = (k - 1) * layout.elements + j - 1;
            let open = self.conditions.open(element, zeros);
            match runs.last_mut().filter(|run| run.open == open) {
                Some(run) => {
                    run.from.2 = j + 1;
                    run.length += length;
                    run.count += 1;
                }
                None => runs.push(Run {
                    open,
                    from: (k, j, j + 1),
                    start,
                    length,
                    count: 1,
                    swap: None,
                }),
            }
            start += length;
        }
        runs.retain(|run| run.length > SHORTEST * whole);
        // One mode before and after one that has no length is one run.
        runs.into_iter()
            .fold(Vec::new(), |mut runs: Vec<Run>, run| {
                match runs.last_mut().filter(|last| last.open == run.open) {
                    Some(last) => {
                        last.from.2 = run.from.2;
                        last.length += run.length;
                        last.count += run.count;
                    }
                    None => runs.push(run),
                }
                runs
            })
    }

    /// Changes at the end of interval k that multipliers ask for, those about which they say nothing, and those that
    /// they advise against.
    fn at_end(&self, k: usize, runs: &[Vec<Run>], near: &Linearized) -> [Vec<Change>; 3] {
        let mut changes = [Vec::new(), Vec::new(), Vec::new()];
        let (Some(before), Some(behind)) = (runs[k - 1].last(), runs[k].first()) else {
            return changes;
        };
        if before.open == behind.open {
            changes[0].push(Change::Plain(k));
            return changes;
        }
        let (layout, continuous) = (&self.layout, self.continuous());
        for (change, stays, goes) in [
            (Change::Later(k), before, behind),
            (Change::Earlier(k), behind, before),
        ] {
            // What is positive where `stays` is the mode for a little longer.
            let opens = stays.open.iter().zip(&goes.open);
            let mut positive = opens.zip(&continuous);
            let slope = positive.find_map(|((stays, goes), &i)| {
                let b = layout.z(k, layout.elements, layout.end, i);
                (!stays && *goes).then(|| b.map_or(0.0, |b| near.slopes[b]))
            });
            match slope {
                None => changes[1].push(change),
                Some(slope) if slope < NEGATIVE => changes[0].push(change),
                Some(_) => changes[2].push(change),
            }
        }
        changes
    }

    /// The algebraic variables b of all members.
    fn continuous(&self) -> Vec<usize> {
        let groups = self.conditions.groups.iter();
        groups.flat_map(|group| group.continuous.clone()).collect()
    }

    /// The algebraic variables in a of all members, and its derivatives.
    fn jumps(&self) -> Vec<(usize, f64)> {
        let groups = self.conditions.groups.iter();
        groups.flat_map(|group| group.jumps.clone()).collect()
    }

    /// Other modes of every run, where it is on a surface on both sides of which rates are the same.
    fn other_modes(&self, runs: &[Vec<Run>], w: &[f64], near: &Linearized) -> Vec<Vec<Change>> {
        let (layout, continuous) = (&self.layout, self.continuous());
        let jumps = self.jumps();
        let mut changes = Vec::new();
        for (interval, runs) in runs.iter().enumerate() {
            for (run, Run { open, from, .. }) in runs.iter().enumerate() {
                let (k, first, behind) = *from;
                let nodes =
                    || (first..behind).flat_map(|j| (1..=layout.nodes).map(move |m| (j, m)));
                let is_zero = |i: usize| {
                    let mut values = nodes().filter_map(|(j, m)| layout.z(k, j, m, i));
                    values.all(|b| w[b].abs() <= ON_SURFACE)
                };
                let members = 0..open.len();
                let on: Vec<usize> = members
                    .filter(|&i| open[i] || is_zero(continuous[i]))
                    .collect();
                let mut others = Vec::new();
                let pairs = on.iter().flat_map(|&a| on.iter().map(move |&b| (a, b)));
                for (opens, closes) in pairs.filter(|&(a, b)| a != b && open[b]) {
                    let mut direction = FxHashMap::default();
                    for (member, change) in [(closes, -1.0), (opens, 1.0)] {
                        let (i, sign) = jumps[member];
                        let places = nodes().filter_map(|(j, m)| layout.z(k, j, m, i));
                        direction.extend(places.map(|place| (place, sign * change)));
                    }
                    for (j, m) in nodes() {
                        self.follow(k, j, m, w, &mut direction);
                    }
                    if near.change(&direction) <= SAME_RATES {
                        others.push((opens, closes));
                    }
                }
                let halves = halves(&others, open).into_iter();
                let halves = halves.map(|swaps| Change::Halves {
                    interval,
                    run,
                    swaps,
                });
                let modes = others.iter().map(|&swap| Change::Mode {
                    interval,
                    run,
                    swap,
                });
                changes.push(modes.chain(halves).collect());
            }
        }
        changes
    }

    /// Adds how products at a node change.
    fn follow(
        &self,
        k: usize,
        j: usize,
        m: usize,
        w: &[f64],
        direction: &mut FxHashMap<usize, f64>,
    ) {
        let place = |i| self.layout.z(k, j, m, i);
        for product in &self.products {
            let change = product.change(
                |i| place(i).map_or(0.0, |place| w[place]),
                |i| {
                    place(i)
                        .and_then(|place| direction.get(&place))
                        .map_or(0.0, |d| *d)
                },
            );
            if let Some(place) = place(product.value).filter(|_| change != 0.0) {
                direction.insert(place, change);
            }
        }
    }

    /// The point with these changes, where elements suffice.
    fn changed(
        &self,
        changes: &[Change],
        runs: &[Vec<Run>],
        w: &[f64],
        zeros: &[Member],
    ) -> Option<Other> {
        let mut point = Point {
            old: w,
            new: BTreeMap::new(),
            zeros: BTreeMap::new(),
        };
        // The intervals that change, and those beside them.
        let mut touched: BTreeMap<usize, Vec<Run>> = BTreeMap::new();
        for change in changes {
            for i in change.beside(runs.len()) {
                touched.entry(i).or_insert_with(|| runs[i].clone());
            }
            change.take_modes(&mut touched);
        }
        self.reach_beyond(changes, runs, &mut touched);
        for change in changes {
            match change {
                Change::Later(k) => {
                    let interval = touched.entry(*k).or_default();
                    interval.insert(0, runs[k - 1].last()?.of_no_length(0.0));
                }
                Change::Earlier(k) => {
                    let end = runs[k - 1].last()?.end();
                    let interval = touched.entry(k - 1).or_default();
                    interval.push(runs[*k].first()?.of_no_length(end));
                }
                Change::Plain(_) | Change::Mode { .. } | Change::Halves { .. } => {}
            }
        }
        for (i, runs) in touched {
            if !self.arrange(i + 1, runs, &mut point) {
                return None;
            }
        }
        point.zeros.retain(|&pair, zero| zeros[pair] != *zero);
        (!point.zeros.is_empty()).then(|| Other {
            w: (point.new.into_iter())
                .map(|(i, value)| (i as u32, value))
                .collect(),
            zeros: (point.zeros.into_iter())
                .map(|(pair, zero)| (pair as u32, zero))
                .collect(),
        })
    }

    /// Lets modes that the first and the last run of an interval take last beyond it, in an element of no length, where one is
    /// left.
    fn reach_beyond(
        &self,
        changes: &[Change],
        runs: &[Vec<Run>],
        touched: &mut BTreeMap<usize, Vec<Run>>,
    ) {
        let mut reached = Vec::new();
        for change in changes {
            let Some((i, run)) = change.takes_modes_in() else {
                continue;
            };
            let sides = [(run == 0, i), (run + 1 == runs[i].len(), i + 1)];
            for (_, k) in sides.into_iter().filter(|(is_at, _)| *is_at) {
                let is_inside = 0 < k && k < runs.len();
                if !is_inside || reached.contains(&k) {
                    continue;
                }
                reached.push(k);
                let (Some(before), Some(behind)) = (
                    touched[&(k - 1)].last().cloned(),
                    touched[&k].first().cloned(),
                ) else {
                    continue;
                };
                let other = if k == i { k - 1 } else { k };
                let others = touched.entry(other).or_default();
                if before.open == behind.open || others.len() == self.layout.elements {
                    continue;
                }
                match k == i {
                    true => others.push(behind.of_no_length(before.end())),
                    false => others.insert(0, before.of_no_length(0.0)),
                }
            }
        }
    }

    /// Gives interval k these runs; false where there are more than elements.
    fn arrange(&self, k: usize, mut runs: Vec<Run>, point: &mut Point) -> bool {
        let n = self.layout.elements;
        if runs.len() > n {
            return false;
        }
        loop {
            let count: usize = runs.iter().map(|run| run.count).sum();
            let change = match count.cmp(&n) {
                std::cmp::Ordering::Equal => break,
                std::cmp::Ordering::Greater => runs.iter_mut().max_by_key(|run| run.count),
                std::cmp::Ordering::Less => {
                    let each = |run: &Run| run.length / run.count as f64;
                    runs.iter_mut().max_by(|a, b| each(a).total_cmp(&each(b)))
                }
            };
            let run = change.expect("an interval has a length");
            run.count = if count > n {
                run.count - 1
            } else {
                run.count + 1
            };
        }
        let mut j = 1;
        for run in &runs {
            let length = run.length / run.count as f64;
            for number in 0..run.count {
                let start = run.start + number as f64 * length;
                self.element((k, j), run, (start, length), point);
                j += 1;
            }
        }
        true
    }

    /// Fills an element of a run.
    fn element(
        &self,
        (k, j): (usize, usize),
        run: &Run,
        (start, length): (f64, f64),
        point: &mut Point,
    ) {
        let layout = &self.layout;
        point.new.insert(layout.h(k, j), length);
        if let (Some(t), Some(first)) = (layout.t(k, j), layout.t(k, 1)) {
            point.new.insert(t, point.old[first] + start);
        }
        let element = (k - 1) * layout.elements + j - 1;
        for (pairs, zero) in self.conditions.zeros(element, &run.open) {
            point.zeros.extend(pairs.map(|pair| (pair, zero)));
        }
        for (m, c) in layout.points.iter().enumerate().skip(1) {
            self.node(k, j, m, run, start + c * length, point);
        }
    }

    /// Fills a node: at an instant of the interval the polynomials of the element that the instant is in.
    fn node(&self, k: usize, j: usize, m: usize, run: &Run, at: f64, point: &mut Point) {
        let layout = &self.layout;
        let (from, first, behind) = run.from;
        // A run of no length is where it touches the one that its mode comes from.
        let (source, share) = if run.length == 0.0 {
            match from.cmp(&k) {
                std::cmp::Ordering::Less => (behind - 1, 1.0),
                _ => (first, 0.0),
            }
        } else {
            let before = (1..first).map(|j| point.old[layout.h(from, j)].max(0.0));
            let mut start: f64 = before.sum();
            let mut found = (first, 0.0);
            for source in first..behind {
                let length = point.old[layout.h(from, source)].max(0.0);
                if length > 0.0 {
                    found = (source, ((at - start) / length).clamp(0.0, 1.0));
                }
                if at <= start + length {
                    break;
                }
                start += length;
            }
            found
        };
        let n = layout.nodes;
        let through = lagrange(&layout.points[..=n], &[share]);
        for i in 0..layout.n_states() {
            let values = (0..=n).map(|m| point.old[layout.x(from, source, m) + i]);
            point
                .new
                .insert(layout.x(k, j, m) + i, dot(&through, values));
        }
        let inner = lagrange(&layout.points[1..=n], &[share]);
        for i in 0..layout.n_states() {
            if let Some(v) = layout.v(k, j, m.min(n)).filter(|_| m <= n) {
                let slope = |m| layout.v(from, source, m).map_or(0.0, |v| point.old[v + i]);
                point.new.insert(v + i, dot(&inner, (1..=n).map(slope)));
            }
        }
        for i in 0..layout.n_algebraics() {
            if let Some(z) = layout.z(k, j, m, i) {
                let value = |m| layout.z(from, source, m, i).map_or(0.0, |z| point.old[z]);
                point.new.insert(z, dot(&inner, (1..=n).map(value)));
            }
        }
        if let Some((opens, closes)) = run.swap {
            self.swap(k, j, m, opens, closes, point);
        }
    }

    /// Gives what a member has to another one, at a node.
    fn swap(&self, k: usize, j: usize, m: usize, opens: usize, closes: usize, point: &mut Point) {
        let jumps = self.jumps();
        let [(from, slope), (to, other_slope)] = [jumps[closes], jumps[opens]];
        let place = |i| self.layout.z(k, j, m, i);
        let Some(value) = place(from).and_then(|z| point.new.get_mut(&z)) else {
            return;
        };
        let given = if slope > 0.0 { *value } else { 1.0 - *value };
        *value -= slope * given;
        if to != from
            && let Some(value) = place(to).and_then(|z| point.new.get_mut(&z))
        {
            *value += other_slope * given;
        }
        for product in &self.products {
            let known = |place: usize| point.new.get(&place).map_or(0.0, |value| *value);
            let value = product.at(|i| place(i).map_or(0.0, known));
            if let Some(place) = place(product.value) {
                point.new.insert(place, value);
            }
        }
    }
}

impl Others for Moved {
    fn at(&self, w: &[f64], zeros: &[Member], near: &Linearized) -> Vec<Other> {
        let (layout, conditions) = (&self.layout, &self.conditions);
        // Where controls enter the switching functions a mode does not last beyond its interval.
        if conditions.groups.is_empty() || conditions.has_more || layout.algebraics.restarts {
            return Vec::new();
        }
        let runs = |k| self.runs(k, w, zeros);
        let runs: Vec<Vec<Run>> = (1..=layout.steps).map(runs).collect();
        let (mut asked, mut open, mut against) = (Vec::new(), Vec::new(), Vec::new());
        for k in 1..layout.steps {
            let [first, second, third] = self.at_end(k, &runs, near);
            asked.extend(first);
            open.extend(second);
            against.extend(third);
        }
        // Several switches may hold each other: all at once, in every mode where several will do, then one by one.
        // Multipliers that are not unique may be wrong about all of them.
        let modes = self.other_modes(&runs, w, near);
        let together = (0..modes.iter().map(Vec::len).max().unwrap_or(0)).map(|number| {
            // The last runs first: what is inserted counts in those behind it.
            let chosen = modes.iter().rev().filter_map(|modes| modes.get(number));
            chosen.chain(&asked).cloned().collect()
        });
        let both = [asked.clone(), against];
        let together: Vec<Vec<Change>> = both.into_iter().chain(together).collect();
        let alone = asked.into_iter().chain(open).chain(modes.concat());
        let mut others: Vec<Other> = Vec::new();
        for changes in together.into_iter().chain(alone.map(|change| vec![change])) {
            let other = self.changed(&changes, &runs, w, zeros);
            let is_new = |other: &Other| others.iter().all(|known| known.zeros != other.zeros);
            others.extend(other.filter(is_new));
        }
        others
    }
}

fn dot(weights: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    weights.iter().zip(values).map(|(a, b)| a * b).sum()
}
