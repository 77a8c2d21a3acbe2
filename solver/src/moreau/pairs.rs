//! Contacts of pairs of bodies, by boxes of bodies.
//!
//! The bodies that stand first, and those that stand second, in the contacts of a family are points of their
//! positions in two trees of boxes. Where the gap is above zero for all positions in two boxes, no pair of bodies from
//! them is looked at: from evenly spread bodies, some per body are left. The trees are made anew with every search,
//! in n log n operations.

use rustc_hash::FxHashMap;

use super::scene::{Family, Scene};
use super::search::Enclosing;
use crate::tape::Ball;

/// Bodies in a box that is not divided.
const LEAF: usize = 4;

/// The pairs of a family.
pub(super) struct Pairs {
    /// Inputs that are positions of the first, and of the second body.
    slots: [Vec<usize>; 2],
    /// The bodies that stand first, and second, by their places in memory.
    bodies: [Vec<Vec<u32>>; 2],
    /// Contact of two bodies.
    members: FxHashMap<(u32, u32), u32>,
    /// Values of numbers that differ from contact to contact.
    ranges: Vec<Option<Ball>>,
    /// Places of the inputs that all contacts share.
    shared: Vec<u32>,
    trees: [Tree; 2],
    open: Vec<(u32, u32)>,
}

impl Pairs {
    /// Nothing where contacts have one body, or more than two.
    pub fn of(family: &Family, scene: &Scene) -> Option<Self> {
        let mut body_of = FxHashMap::default();
        for (b, body) in scene.bodies.iter().enumerate() {
            body_of.extend(body.positions.iter().map(|&state| (1 + state as u32, b)));
        }
        let first = family.inputs_of(0);
        let &head = family.positions.first()?;
        let of_first = |places: &[u32], input: usize| {
            Some(body_of.get(&places[input])? == body_of.get(&places[head])?)
        };
        let mut slots = [Vec::new(), Vec::new()];
        for &input in &family.positions {
            slots[usize::from(!of_first(first, input)?)].push(input);
        }
        if slots[1].is_empty() {
            return None;
        }
        let mut bodies = [Vec::new(), Vec::new()];
        let mut known: [FxHashMap<Vec<u32>, u32>; 2] = Default::default();
        let mut members = FxHashMap::default();
        let numbers = |place: u32| (place as usize).checked_sub(scene.first_number);
        let mut ranges: Vec<Option<(f64, f64)>> = vec![None; family.n_inputs()];
        for member in 0..family.contacts.len() {
            let places = family.inputs_of(member);
            let mut pair = [0; 2];
            for side in 0..2 {
                let key: Vec<u32> = slots[side].iter().map(|&input| places[input]).collect();
                let mut of_key = key.iter().map(|place| body_of.get(place));
                let body = of_key.next()??;
                if !of_key.all(|other| other == Some(body)) {
                    return None;
                }
                let next = bodies[side].len() as u32;
                pair[side] = *known[side].entry(key.clone()).or_insert(next);
                if pair[side] == next {
                    bodies[side].push(key);
                }
            }
            members.insert((pair[0], pair[1]), member as u32);
            for (input, range) in ranges.iter_mut().enumerate() {
                if let Some(number) = numbers(places[input]) {
                    let value = scene.numbers[number];
                    let (low, high) = range.unwrap_or((value, value));
                    *range = Some((low.min(value), high.max(value)));
                } else if !family.positions.contains(&input)
                    && !family.slips.iter().flatten().any(|slip| *slip == input)
                    && places[input] != first[input]
                {
                    return None;
                }
            }
        }
        let range = |(low, high): (f64, f64)| Ball::new(0.5 * (low + high), 0.5 * (high - low));
        Some(Pairs {
            slots,
            bodies,
            members,
            ranges: ranges.into_iter().map(|r| r.map(range)).collect(),
            shared: first.to_vec(),
            trees: Default::default(),
            open: Vec::new(),
        })
    }

    /// Calls `keep` with all members that are not known to be open while positions stay within `radius`.
    #[allow(clippy::too_many_arguments, reason = "a search is about all of these")]
    pub fn search(
        &mut self,
        family: &Family,
        memory: &[f64],
        radius: f64,
        of_time: f64,
        least: f64,
        work: &mut Enclosing,
        keep: &mut impl FnMut(u32, &mut Enclosing),
    ) {
        for (tree, bodies) in self.trees.iter_mut().zip(&self.bodies) {
            tree.build(bodies, memory);
        }
        let [first, second] = &self.trees;
        self.open.clear();
        self.open.push((0, 0));
        while let Some((a, b)) = self.open.pop() {
            let (of_a, of_b) = (&first.nodes[a as usize], &second.nodes[b as usize]);
            work.inputs.clear();
            for input in 0..family.n_inputs() {
                work.inputs.push(match self.ranges[input] {
                    Some(range) => range,
                    None if self.shared[input] == 0 => Ball::new(memory[0], of_time),
                    None => Ball::new(memory[self.shared[input] as usize], 0.0),
                });
            }
            for (slots, (tree, node)) in self.slots.iter().zip([(first, a), (second, b)]) {
                for (&slot, bounds) in slots.iter().zip(tree.bounds(node)) {
                    work.inputs[slot] = Ball::new(bounds.middle, bounds.radius + radius);
                }
            }
            if work.is_open(family, least) {
                continue;
            }
            match (of_a.children, of_b.children) {
                (0, 0) => {
                    for &i in first.bodies(a) {
                        for &j in second.bodies(b) {
                            if let Some(&member) = self.members.get(&(i, j)) {
                                keep(member, work);
                            }
                        }
                    }
                }
                // The box with more bodies is divided.
                (left, right) if right == 0 || left != 0 && of_a.len() >= of_b.len() => {
                    self.open.extend([(left, b), (left + 1, b)]);
                }
                (_, right) => self.open.extend([(a, right), (a, right + 1)]),
            }
        }
    }
}

/// Boxes of bodies, each in the box above.
#[derive(Default)]
struct Tree {
    nodes: Vec<Node>,
    bounds: Vec<Ball>,
    order: Vec<u32>,
    dimension: usize,
}

#[derive(Clone, Copy)]
struct Node {
    start: u32,
    end: u32,
    /// The first of two, 0 for a box that is not divided.
    children: u32,
}

impl Node {
    fn len(&self) -> u32 {
        self.end - self.start
    }
}

impl Tree {
    /// Divides boxes at the median of their longest side.
    fn build(&mut self, bodies: &[Vec<u32>], memory: &[f64]) {
        let dimension = bodies[0].len();
        self.dimension = dimension;
        self.nodes.clear();
        self.bounds.clear();
        self.order.clear();
        self.order.extend(0..bodies.len() as u32);
        self.nodes.push(Node {
            start: 0,
            end: bodies.len() as u32,
            children: 0,
        });
        let mut at = 0;
        while at < self.nodes.len() {
            let Node { start, end, .. } = self.nodes[at];
            let range = start as usize..end as usize;
            let value = |body: u32, k: usize| memory[bodies[body as usize][k] as usize];
            let (mut longest, mut along) = (-1.0, 0);
            for k in 0..dimension {
                let values = self.order[range.clone()].iter().map(|&body| value(body, k));
                let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                    (l.min(v), h.max(v))
                });
                let bounds = Ball::new(0.5 * (low + high), 0.5 * (high - low));
                self.bounds.push(bounds);
                if bounds.radius > longest {
                    (longest, along) = (bounds.radius, k);
                }
            }
            if range.len() > LEAF {
                let middle = range.len() / 2;
                self.order[range].select_nth_unstable_by(middle, |&a, &b| {
                    value(a, along).total_cmp(&value(b, along))
                });
                let middle = start + middle as u32;
                self.nodes[at].children = self.nodes.len() as u32;
                for (start, end) in [(start, middle), (middle, end)] {
                    self.nodes.push(Node {
                        start,
                        end,
                        children: 0,
                    });
                }
            }
            at += 1;
        }
    }

    fn bounds(&self, node: u32) -> &[Ball] {
        let first = node as usize * self.dimension;
        &self.bounds[first..first + self.dimension]
    }

    fn bodies(&self, node: u32) -> &[u32] {
        let Node { start, end, .. } = self.nodes[node as usize];
        &self.order[start as usize..end as usize]
    }
}
