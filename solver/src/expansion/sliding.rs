//! The equations of the sliding switches K, cut into components that do not interact.
//!
//! φ_i = ∇ψ_i·f + ∂ψ_i/∂t with A = ∂φ_K/∂α_K = ∇ψ_K·∂f/∂α_K, and the Gram matrix of the gradients for
//! the projection. Both have nonzeros only within a component: switches of two components share no
//! state, and no α of one occurs in a rate of the other.

use super::field::Field;
use super::surfaces::{Surfaces, orientation};
use crate::hybrid::Few;
use crate::linalg::redundancy::eliminate;
use crate::linalg::{BlockLu, DenseLu, Singular};

/// The sliding switches, cut into components that share no state and no α.
#[derive(Default)]
struct Components {
    /// Component by component, in order of their first switch.
    switches: Vec<usize>,
    /// Where every component starts, and the end of the last one.
    starts: Vec<usize>,
    /// The place of a switch among `switches`.
    place: Vec<usize>,
    /// By state: the first place that has it in its gradient.
    owner: Vec<usize>,
    parent: Vec<usize>,
}

/// The equations of a mode.
#[derive(Default)]
pub(crate) struct Sliding {
    components: Components,
    /// Whether the components are those of the present mode.
    pub arranged: bool,
    lu: BlockLu,
    /// Signs of the determinants at the expansion point.
    orientation: Vec<f64>,
    /// Right-hand side and solution, component by component.
    pub rhs: Vec<f64>,
    /// Σ_l |∂φ_j/∂α_l|, by place: of the last matrix, and at the expansion point.
    row_sums: Vec<f64>,
    gains: Vec<f64>,
    /// By state: what a row of the Gram matrix is made of.
    scaled: Vec<f64>,
    /// By place: what takes the place of the equation of a switch whose surface another one has.
    ties: Vec<Option<Tie>>,
    /// By place: slip velocities that other surfaces keep at zero. α changes as little as it may.
    held: Vec<bool>,
    /// Whether it is known which are.
    weighed: bool,
}

/// α_i - ½ = σ (α_j - ½): the choice where one equation is all there is for two α.
///
/// If σ is the sign of the product of their coefficients, both stay in [0, 1] as long as any choice does. Those of
/// friction are μλ >= 0 times what the slip velocities are to each other, also where λ is rounding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tie {
    pub switch: usize,
    pub other: usize,
    pub sign: f64,
}

impl Tie {
    /// That of two switches whose α have these coefficients in the equation of the second one.
    pub(crate) fn new(
        surfaces: &Surfaces,
        [switch, other]: [usize; 2],
        coefficient: impl Fn(usize) -> f64,
    ) -> Self {
        let sign = match surfaces.is_slip(switch) {
            true => orientation(surfaces.gradient(switch), surfaces.gradient(other)),
            false if coefficient(switch) * coefficient(other) < 0.0 => -1.0,
            false => 1.0,
        };
        Tie {
            switch,
            other,
            sign,
        }
    }

    /// What is zero.
    pub(crate) fn residual(&self, alpha: &[f64]) -> f64 {
        alpha[self.switch] - 0.5 - self.sign * (alpha[self.other] - 0.5)
    }

    /// Its derivative by an α.
    pub(crate) fn derivative(&self, alpha: usize) -> f64 {
        match alpha {
            alpha if alpha == self.switch => 1.0,
            alpha if alpha == self.other => -self.sign,
            _ => 0.0,
        }
    }
}

impl Components {
    /// Finds them.
    fn find(&mut self, sliding: &[usize], field: &Field, surfaces: &Surfaces) {
        self.parent.clear();
        self.parent.extend(0..sliding.len());
        for (at, &i) in sliding.iter().enumerate() {
            self.place[i] = at;
        }
        self.owner.fill(usize::MAX);
        for (at, &i) in sliding.iter().enumerate() {
            for &(state, _) in surfaces.gradient(i) {
                match self.owner[state] {
                    usize::MAX => self.owner[state] = at,
                    other => join(&mut self.parent, at, other),
                }
                for (j, _) in field.slopes(state) {
                    join(&mut self.parent, at, self.place[j]);
                }
            }
        }
        // Components in order of their first switch.
        self.switches.clear();
        self.starts.clear();
        self.starts.push(0);
        let mut members: Few<(usize, usize)> = (0..sliding.len())
            .map(|at| (root(&mut self.parent, at), at))
            .collect();
        members.sort_unstable();
        for (k, &(component, at)) in members.iter().enumerate() {
            if k > 0 && members[k - 1].0 != component {
                self.starts.push(k);
            }
            self.place[sliding[at]] = k;
            self.switches.push(sliding[at]);
        }
        if !members.is_empty() {
            self.starts.push(members.len());
        }
    }
}

impl Sliding {
    pub(crate) fn new(n_states: usize, n_switches: usize) -> Self {
        Sliding {
            components: Components {
                place: vec![0; n_switches],
                owner: vec![usize::MAX; n_states],
                starts: vec![0],
                ..Components::default()
            },
            scaled: vec![0.0; n_states],
            ..Sliding::default()
        }
    }

    /// The sliding switches, component by component.
    pub(crate) fn switches(&self) -> &[usize] {
        &self.components.switches
    }

    /// Each of them with what was solved for, behind `solve`.
    pub(crate) fn solution(&self) -> impl Iterator<Item = (usize, f64)> {
        let switches = self.components.switches.iter();
        switches.copied().zip(self.rhs.iter().copied())
    }

    /// Finds the components of the sliding switches, once per mode.
    pub(crate) fn arrange(&mut self, sliding: &[usize], field: &Field, surfaces: &Surfaces) {
        if self.arranged {
            return;
        }
        self.components.find(sliding, field, surfaces);
        let Components {
            switches,
            starts,
            place,
            ..
        } = &self.components;
        self.lu.shape(starts);
        self.ties.clear();
        for &switch in switches {
            let before = &switches[..place[switch]];
            let tied = |&&other: &&usize| surfaces.are_redundant(switch, other);
            self.ties.push(before.iter().find(tied).map(|&other| Tie {
                switch,
                other,
                sign: 1.0,
            }));
        }
        self.held.clear();
        self.held.resize(sliding.len(), false);
        self.weighed = false;
        self.rhs.clear();
        self.rhs.resize(sliding.len(), 0.0);
        self.row_sums.clear();
        self.row_sums.resize(sliding.len(), 0.0);
        self.orientation.clear();
        self.orientation.resize(starts.len() - 1, 1.0);
        self.arranged = true;
    }

    /// Switches that do not interact with those of other components.
    pub(crate) fn components(&self) -> impl Iterator<Item = &[usize]> {
        let ranges = self.components.starts.windows(2);
        ranges.map(|range| &self.components.switches[range[0]..range[1]])
    }

    /// Factors A where gradients and slopes were last evaluated.
    pub(crate) fn factor(&mut self, field: &Field, surfaces: &Surfaces) -> Result<(), Singular> {
        for tie in self.ties.iter_mut().flatten() {
            // ∂φ/∂α of both in the one equation.
            let coefficient = |alpha: usize| -> f64 {
                let gradient = surfaces.gradient(tie.other).iter();
                let terms = gradient.flat_map(|&(state, g)| {
                    let of_alpha = field.slopes(state).filter(move |(j, _)| *j == alpha);
                    of_alpha.map(move |(_, slope)| g * slope)
                });
                terms.sum()
            };
            *tie = Tie::new(surfaces, [tie.switch, tie.other], coefficient);
        }
        for component in 0..self.components.starts.len() - 1 {
            let (start, end) = (
                self.components.starts[component],
                self.components.starts[component + 1],
            );
            let matrix = self.lu.matrix(component);
            for row in start..end {
                if let Some(tie) = self.ties[row] {
                    for col in start..end {
                        let entry = tie.derivative(self.components.switches[col]);
                        matrix[(row - start) * (end - start) + col - start] = entry;
                    }
                    continue;
                }
                for &(state, g) in surfaces.gradient(self.components.switches[row]) {
                    for (j, slope) in field.slopes(state) {
                        let column = self.components.place[j] - start;
                        matrix[(row - start) * (end - start) + column] += g * slope;
                    }
                }
            }
            for row in start..end {
                let row_of = matrix[(row - start) * (end - start)..]
                    .iter()
                    .take(end - start);
                self.row_sums[row] = match self.ties[row] {
                    None => row_of.map(|v| v.abs()).sum(),
                    Some(tie) => self.row_sums[self.components.place[tie.other]],
                };
            }
            let is_slip = |row: usize| surfaces.is_slip(self.components.switches[start + row]);
            if !self.weighed && (0..end - start).any(is_slip) {
                self.held[start..end].copy_from_slice(&held(matrix, end - start, is_slip));
            }
            let held = &self.held[start..end];
            if held.contains(&true) {
                let n = end - start;
                let mut least = least_changes(matrix, n, held, is_slip)
                    .unwrap_or_default()
                    .into_iter();
                for row in (0..n).filter(|&row| held[row]) {
                    let row_of = &mut matrix[row * n..][..n];
                    row_of.fill(0.0);
                    match least.next() {
                        Some(least) => row_of.copy_from_slice(&least),
                        None => row_of[row] = 1.0,
                    }
                }
            }
        }
        self.weighed = true;
        self.lu.factor()
    }

    /// Takes the matrix factored last as that of the expansion point.
    pub(crate) fn expand_here(&mut self) {
        self.gains.clone_from(&self.row_sums);
        for (component, sign) in self.orientation.iter_mut().enumerate() {
            *sign = self.lu.determinant_sign(component);
        }
    }

    /// True when a determinant has another sign than at the expansion point.
    pub(crate) fn turned_over(&self) -> bool {
        let signs = self.orientation.iter().enumerate();
        let mut changed =
            signs.map(|(component, sign)| self.lu.determinant_sign(component) != *sign);
        changed.any(|changed| changed)
    }

    /// What takes the place of an equation.
    pub(crate) fn tie(&self, place: usize) -> Option<Tie> {
        self.ties[place]
    }

    /// True where others say that the rate is zero.
    pub(crate) fn is_held(&self, place: usize) -> bool {
        self.held[place]
    }

    /// Solves for `rhs`, with what was factored last.
    pub(crate) fn solve(&mut self) {
        self.lu.solve(&mut self.rhs);
    }

    /// Factors the Gram matrix of the gradients, weighted with the squares of the sizes of states, without switches that
    /// are left out.
    pub(crate) fn factor_gram(
        &mut self,
        surfaces: &Surfaces,
        size: impl Fn(usize) -> f64,
        is_left_out: impl Fn(usize) -> bool,
    ) -> Result<(), Singular> {
        for component in 0..self.components.starts.len() - 1 {
            let (start, end) = (
                self.components.starts[component],
                self.components.starts[component + 1],
            );
            let matrix = self.lu.matrix(component);
            for row in start..end {
                let follows = self.ties[row].is_some() || self.held[row];
                if follows || is_left_out(self.components.switches[row]) {
                    matrix[(row - start) * (end - start) + row - start] = 1.0;
                    continue;
                }
                let gradient = surfaces.gradient(self.components.switches[row]);
                for &(state, g) in gradient {
                    self.scaled[state] = g * size(state).powi(2);
                }
                for col in start..end {
                    let other = surfaces.gradient(self.components.switches[col]).iter();
                    matrix[(row - start) * (end - start) + col - start] =
                        other.map(|&(state, g)| g * self.scaled[state]).sum();
                }
                for &(state, _) in gradient {
                    self.scaled[state] = 0.0;
                }
            }
        }
        self.lu.factor()
    }

    /// Σ_l |∂φ/∂α_l| of a sliding switch at the expansion point.
    pub(crate) fn gain(&self, switch: usize) -> f64 {
        self.gains[self.components.place[switch]]
    }
}

/// The slip velocities among some surfaces that the others keep at zero with any friction: bodies that several contacts
/// hold. `matrix` is ∂φ/∂α.
pub(crate) fn held(matrix: &[f64], n: usize, is_slip: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut rest = matrix.to_vec();
    let solved = eliminate(&mut rest, &mut vec![0.0; n], &is_slip);
    let depends = |row: usize| is_slip(row) && !solved[row] && matrix[row * n + row] != 0.0;
    // Where normals depend on each other, their forces are not determined, and this does not make them so.
    let determined = (0..n).all(|row| solved[row] || depends(row));
    (0..n).map(|row| determined && depends(row)).collect()
}

fn root(parent: &mut [usize], mut at: usize) -> usize {
    while parent[at] != at {
        parent[at] = parent[parent[at]];
        at = parent[at];
    }
    at
}

/// Joins two components under the lesser root.
fn join(parent: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b)] = a.min(b);
}

/// The changes of α that leave all rates as they are, one for each slip velocity that is held, as rows whose products
/// with a change vanish where it is least.
fn least_changes(
    matrix: &[f64],
    n: usize,
    held: &[bool],
    is_slip: impl Fn(usize) -> bool,
) -> Option<Vec<Vec<f64>>> {
    let free: Vec<usize> = (0..n).filter(|&i| !held[i]).collect();
    let weight = |i: usize| match is_slip(i) {
        true => matrix[i * n + i].abs(),
        false => 0.0,
    };
    let mut lu = DenseLu::new(free.len());
    let entries = free
        .iter()
        .flat_map(|&row| free.iter().map(move |&column| (row, column)));
    let entries: Vec<f64> = entries
        .map(|(row, column)| matrix[row * n + column])
        .collect();
    lu.factor(&entries).ok()?;
    let mut rows = Vec::new();
    for h in (0..n).filter(|&h| held[h]) {
        let mut change: Vec<f64> = free.iter().map(|&row| -matrix[row * n + h]).collect();
        lu.solve(&mut change);
        let mut row = vec![0.0; n];
        row[h] = weight(h);
        for (&i, change) in free.iter().zip(&change) {
            row[i] = weight(i) * change;
        }
        let largest = row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        row.iter_mut().for_each(|v| *v /= largest);
        if !row.iter().all(|v| v.is_finite()) {
            return None;
        }
        rows.push(row);
    }
    Some(rows)
}
