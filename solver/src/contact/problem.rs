//! Contacts that meet: which forces, or impulses, keep them from passing each other.
//!
//! Rates change by D λ - T β, where D = M⁻¹J_n and T = M⁻¹J_t μ over the contacts, β = λ s with s in sign(w) of
//! the slip velocities w. With the rates a of what must not be negative and b of what friction resists,
//!
//! a = a₀ + J_nᵀ(D λ - T β) ⟂ λ,   β ∈ λ sign(b),   b = b₀ + J_tᵀ(D λ - T β),
//!
//! is Coulomb's law both for forces, with accelerations a and b, and for impulses, with velocities after an
//! impact. Written with β = β⁺ - β⁻ and γ = |b| it is the linear complementarity problem of Stewart & Trinkle 1996
//! in the plane,
//!
//! a ⟂ λ,   γ - b ⟂ β⁺,   γ + b ⟂ β⁻,   λ - β⁺ - β⁻ ⟂ γ.
//!
//! A slip velocity with two entries has a T, a b and a β for each: β ∈ λ ∂|b|. The linear problem has a β for each
//! direction of a polygon then, which is where the exact one starts, see `cones`.
//!
//! Forces in the rates are those of x' = f + (1 - α_n)(D - (2α_t - 1) T), so that ∂f/∂α_n = -D at α_t = ½ and
//! ∂f/∂α_t = -2T at α_n = 0. A contact that slips has no β: its force is D - T or D + T.

use std::ops::Range;

use super::cones::Cones;
use crate::expansion::mode::Mode;
use crate::optimization::lcp;
use crate::selector::select::BAND;

/// Directions of the polygon inside a cone's base at which its exact solution is looked for.
const FACETS: usize = 8;

/// A contact.
pub(crate) struct Touch {
    /// The switch of its gap.
    pub normal: usize,
    /// The switches of the entries of its slip velocity, where that is zero or may become so.
    pub slips: Vec<usize>,
}

impl Touch {
    /// All its switches.
    pub(crate) fn switches(&self) -> impl Iterator<Item = usize> + '_ {
        std::iter::once(self.normal).chain(self.slips.iter().copied())
    }
}

/// Contacts with their switches, and the matrices of the problem.
pub(crate) struct Meeting {
    pub contacts: Vec<Touch>,
    /// Where the entries of the slip velocities of each contact are among all, and their end.
    starts: Vec<usize>,
    /// J_nᵀD, J_nᵀT, J_tᵀD and J_tᵀT, row by row.
    blocks: [Vec<f64>; 4],
    /// λ₀, which λ is not below: a ⟂ λ - λ₀.
    pub least: Vec<f64>,
}

/// A solution: by contact, and by entry of all slip velocities.
pub(crate) struct Forces {
    /// λ.
    pub normal: Vec<f64>,
    /// β.
    pub friction: Vec<f64>,
    /// a.
    pub rates: Vec<f64>,
    /// b.
    pub slips: Vec<f64>,
    /// Largest |min| over all complementary pairs, relative to the size of the rates.
    pub residual: f64,
}

/// Why there is none.
pub(crate) enum NoForces {
    /// The force of this contact does not push it open.
    Paradox(usize),
    /// The search found none.
    NotFound,
}

impl Mode {
    /// `linearize`, and ∂f/∂α of all other rates that have these α: impulses move what gaps do not depend on, too,
    /// where a mass joins them.
    pub(crate) fn linearize_impulses(&mut self, switches: &[usize]) {
        self.linearize(switches);
        for &switch in switches {
            for at in 0..self.field.of_switch(switch).len() {
                let block = self.field.of_switch(switch)[at];
                self.field.linearize_block(block, &self.memory.values);
            }
        }
    }
}

impl Meeting {
    /// Reads the directions of forces off a mode that was linearized at α_n = 0 and α_t = ½.
    pub(crate) fn of(mode: &Mode, contacts: Vec<Touch>) -> Self {
        let mut starts = vec![0];
        starts.extend(contacts.iter().scan(0, |end, touch| {
            *end += touch.slips.len();
            Some(*end)
        }));
        let normals: Vec<usize> = contacts.iter().map(|touch| touch.normal).collect();
        let slips = contacts.iter().flat_map(|touch| &touch.slips).copied();
        let slips: Vec<usize> = slips.collect();
        let effects = |of: &[usize], by: &[usize], share: f64| -> Vec<f64> {
            let rows = of.iter();
            let effect = |of: usize| by.iter().map(move |&by| -share * mode.coupling(of, by));
            rows.flat_map(|&of| effect(of)).collect()
        };
        let blocks = [
            effects(&normals, &normals, 1.0),
            effects(&normals, &slips, 0.5),
            effects(&slips, &normals, 1.0),
            effects(&slips, &slips, 0.5),
        ];
        Meeting {
            least: vec![0.0; contacts.len()],
            contacts,
            starts,
            blocks,
        }
    }

    /// Where the entries of the slip velocity of a contact are among all.
    pub(crate) fn entries(&self, contact: usize) -> Range<usize> {
        self.starts[contact]..self.starts[contact + 1]
    }

    /// Entries of all slip velocities.
    pub(crate) fn n_slips(&self) -> usize {
        self.starts[self.contacts.len()]
    }

    /// How many columns a block has.
    fn width(&self, block: usize) -> usize {
        match block {
            0 | 2 => self.contacts.len(),
            _ => self.n_slips(),
        }
    }

    /// A row of a block.
    pub(crate) fn row(&self, block: usize, row: usize) -> &[f64] {
        let width = self.width(block);
        &self.blocks[block][row * width..(row + 1) * width]
    }

    /// Σ_k block_ik v_k
    pub(crate) fn times(&self, block: usize, row: usize, v: &[f64]) -> f64 {
        let row = self.row(block, row).iter();
        row.zip(v).map(|(entry, v)| entry * v).sum()
    }

    /// Whether a force of this contact, with friction against slipping in this direction, or in any, pushes it open.
    fn pushes(&self, contact: usize, slip: &[f64]) -> bool {
        let drags = &self.row(1, contact)[self.entries(contact)];
        let speed = norm(slip);
        let drag = match speed > 0.0 {
            true => {
                drags
                    .iter()
                    .zip(slip)
                    .map(|(drag, w)| drag * w)
                    .sum::<f64>()
                    / speed
            }
            false => norm(drags),
        };
        let push = self.push(contact);
        push - drag > BAND * (push.abs() + drag.abs())
    }

    /// The directions that friction of a contact has in the linear problem: both of a line, or so many of a plane.
    fn facets(&self, contact: usize) -> Vec<Vec<f64>> {
        match self.entries(contact).len() {
            0 => Vec::new(),
            1 => vec![vec![1.0], vec![-1.0]],
            _ => {
                let angle = |k: usize| std::f64::consts::TAU * k as f64 / FACETS as f64;
                let facet = |k: usize| vec![angle(k).cos(), angle(k).sin()];
                (0..FACETS).map(facet).collect()
            }
        }
    }

    /// λ and β for the rates `a` and `b` without forces. `slips` are slip velocities before: friction has their
    /// directions, and where it stops them or they vanish it may have any.
    pub(crate) fn solve(&self, a: &[f64], b: &[f64], slips: &[f64]) -> Result<Forces, NoForces> {
        let n = self.contacts.len();
        if let Some(i) = (0..n).find(|&i| !self.pushes(i, &slips[self.entries(i)])) {
            return Err(NoForces::Paradox(i));
        }
        // Rates of one size, with γ measured as b is: λ is scaled by its own push.
        let unit: Vec<f64> = (0..n).map(|i| 1.0 / self.push(i)).collect();
        let by_least = self.least.iter().zip(&unit);
        let by_least: Vec<f64> = by_least.map(|(least, unit)| least / unit).collect();
        let rates = a.iter().chain(b).chain(&by_least);
        let scale = rates.fold(0.0_f64, |s, v| s.max(v.abs()));
        let size = if scale > 0.0 { scale } else { 1.0 };
        let scaled = [a, b, &by_least];
        let scaled = scaled.map(|rates| rates.iter().map(|rate| rate / size).collect::<Vec<_>>());
        let (mut normal, mut friction, mut residual) = self.by_polygons(&scaled, &unit)?;
        if self.starts.windows(2).any(|range| range[1] - range[0] > 1) {
            let by_cones = Cones {
                meeting: self,
                rates: &scaled,
                unit: &unit,
            };
            residual = by_cones
                .refine(&mut normal, &mut friction)
                .ok_or(NoForces::NotFound)?;
        }
        for i in 0..n {
            normal[i] *= scale * unit[i];
            friction[self.entries(i)]
                .iter_mut()
                .for_each(|force| *force *= scale * unit[i]);
        }
        let turns = |i: usize| {
            let (slip, drag) = (&slips[self.entries(i)], &friction[self.entries(i)]);
            let along: f64 = slip.iter().zip(drag).map(|(w, drag)| w * drag).sum();
            along < 0.0 && !self.pushes(i, drag)
        };
        if let Some(i) = (0..n).find(|&i| turns(i)) {
            return Err(NoForces::Paradox(i));
        }
        let rates = (0..n)
            .map(|i| a[i] + self.times(0, i, &normal) - self.times(1, i, &friction))
            .collect();
        let slips = (0..self.n_slips())
            .map(|t| b[t] + self.times(2, t, &normal) - self.times(3, t, &friction))
            .collect();
        Ok(Forces {
            normal,
            friction,
            rates,
            slips,
            residual,
        })
    }

    /// λ and β in their units, with polygons in place of cones, and the residual of the linear problem, which is one
    /// in λ - λ₀.
    fn by_polygons(
        &self,
        [a, b, least]: &[Vec<f64>; 3],
        unit: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>, f64), NoForces> {
        let n = self.contacts.len();
        let all: Vec<Vec<Vec<f64>>> = (0..n).map(|i| self.facets(i)).collect();
        let most = all.iter().map(Vec::len).max().unwrap_or(0);
        // First directions of all contacts come first.
        let in_order = (0..most).flat_map(|k| {
            let all = &all;
            (0..n).filter_map(move |i| Some((i, all[i].get(k)?)))
        });
        let facets: Vec<(usize, &Vec<f64>)> = in_order.collect();
        let rough: Vec<usize> = (0..n).filter(|&i| !all[i].is_empty()).collect();
        let (m, size) = (facets.len(), n + facets.len() + rough.len());
        let (mut matrix, mut q) = (vec![0.0; size * size], vec![0.0; size]);
        let mut set = |row: usize, column: usize, value: f64| matrix[row * size + column] = value;
        // Along a direction of a contact.
        let along = |(i, d): (usize, &Vec<f64>), row: &[f64]| -> f64 {
            let of_contact = &row[self.entries(i)];
            of_contact.iter().zip(d).map(|(entry, d)| entry * d).sum()
        };
        let by_least: Vec<f64> = least.iter().zip(unit).map(|(l, unit)| l * unit).collect();
        for i in 0..n {
            q[i] = a[i] + self.times(0, i, &by_least);
            for (k, (push, unit)) in self.row(0, i).iter().zip(unit).enumerate() {
                set(i, k, push * unit);
            }
            for (f, &facet) in facets.iter().enumerate() {
                set(i, n + f, -along(facet, self.row(1, i)) * unit[facet.0]);
            }
        }
        for (f, &(i, d)) in facets.iter().enumerate() {
            let entries = || self.entries(i).zip(d);
            let rate = |t: usize| b[t] + self.times(2, t, &by_least);
            q[n + f] = -entries().map(|(t, d)| rate(t) * d).sum::<f64>();
            for (k, unit) in unit.iter().enumerate() {
                let effect: f64 = entries().map(|(t, d)| self.row(2, t)[k] * d).sum();
                set(n + f, k, -effect * unit);
            }
            for (g, &facet) in facets.iter().enumerate() {
                let effect = entries().map(|(t, d)| along(facet, self.row(3, t)) * d);
                set(n + f, n + g, effect.sum::<f64>() * unit[facet.0]);
            }
        }
        for (r, &i) in rough.iter().enumerate() {
            q[n + m + r] = least[i];
            set(n + m + r, i, 1.0);
            for (f, _) in facets.iter().enumerate().filter(|(_, facet)| facet.0 == i) {
                set(n + f, n + m + r, 1.0);
                set(n + m + r, n + f, -1.0);
            }
        }
        let z = lcp::lemke(&matrix, &q, &vec![1.0; size]).map_err(|_| NoForces::NotFound)?;
        let mut residual = 0.0_f64;
        for row in 0..size {
            let terms = z.iter().zip(&matrix[row * size..]).map(|(z, m)| z * m);
            let w = q[row] + terms.sum::<f64>();
            residual = residual.max(w.min(z[row]).abs());
        }
        let mut friction = vec![0.0; self.n_slips()];
        for (&(i, d), force) in facets.iter().zip(&z[n..]) {
            for (t, d) in self.entries(i).zip(d) {
                friction[t] += force * d;
            }
        }
        let normal = z.iter().zip(least).map(|(z, least)| z + least);
        Ok((normal.collect(), friction, residual))
    }

    /// What the rate of a contact is made of by a force λ of its own.
    pub(crate) fn push(&self, contact: usize) -> f64 {
        self.row(0, contact)[contact]
    }

    /// The same for friction: the largest entry of J_tᵀT on its diagonal.
    pub(crate) fn resistance(&self, contact: usize) -> f64 {
        let entries = self.entries(contact);
        entries.fold(0.0, |most, t| f64::max(most, self.row(3, t)[t]))
    }
}

/// |v|
pub(crate) fn norm(v: &[f64]) -> f64 {
    match v {
        [one] => one.abs(),
        _ => v.iter().copied().fold(0.0, f64::hypot),
    }
}
