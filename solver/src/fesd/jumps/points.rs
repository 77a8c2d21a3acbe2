//! The algebraic variables of contacts at one instant and state: where steps start, and in the modes of other runs.

use serde::{Deserialize, Serialize};

use super::{CLOSED, Impact, Lowered, Slips, StepStart};
use crate::fesd::system::ComplementaritySystem;
use crate::fesd::system::pointwise::{Point, eval};
use crate::hybrid::check::{Fault, must};
use crate::linalg::largest;
use crate::tape::{Scratch, Tape};

/// Equations of what is continuous hold within this, relative to the largest value (chosen by trial).
const CONSISTENT: f64 = 1e-10;
/// A point of a disc may be outside by so much (chosen by trial).
const OUTSIDE: f64 = 1e-6;

/// The contacts of a system.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Contacts {
    /// What acts where elements meet.
    pub impacts: Vec<Impact>,
    /// The rate of the gap, the restitution and the friction of every contact, in t, x and parameters.
    pub laws: Tape,
    /// These.
    pub parameters: Vec<f64>,
}

/// The functions of a system with contacts at a point.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Known", into = "Known")]
pub struct Points {
    /// The contacts.
    pub contacts: Contacts,
    system: ComplementaritySystem,
    /// Those of its equations that what is continuous satisfies.
    continuous: Vec<usize>,
    numbers: Vec<f64>,
    inputs: Vec<f64>,
    values: Vec<f64>,
    scratch: Scratch,
}

/// The serialized fields of `Points`; the others are scratch memory.
#[derive(Serialize, Deserialize)]
struct Known {
    contacts: Contacts,
    system: ComplementaritySystem,
    continuous: Vec<usize>,
}

impl From<Points> for Known {
    fn from(points: Points) -> Self {
        Known {
            contacts: points.contacts,
            system: points.system,
            continuous: points.continuous,
        }
    }
}

impl TryFrom<Known> for Points {
    type Error = Fault;

    fn try_from(known: Known) -> Result<Self, Fault> {
        let Known {
            contacts,
            system,
            continuous,
        } = known;
        let n_rows = system.full.directional.n_outputs();
        must(
            continuous.iter().all(|row| *row < n_rows),
            "what is continuous satisfies equations",
        )?;
        let n_inputs = 1 + system.n_states() + contacts.parameters.len();
        let laws = &contacts.laws;
        must(
            laws.n_inputs() == n_inputs
                && laws.n_outputs() == 3 * contacts.impacts.len()
                && contacts.parameters.len() >= system.parameters.len(),
            "every contact has its laws",
        )?;
        let (n_z, n_switches) = (system.n_algebraics(), system.n_switches());
        let mut impacts = contacts.impacts.iter();
        let are_there = impacts.all(|impact| {
            let mut places = impact.places();
            let mut switches = [impact.switch].into_iter().chain(impact.line());
            switches.all(|switch| switch < n_switches) && places.all(|place| place < n_z)
        });
        must(are_there, "contacts have their switches and variables")?;
        Ok(Points::new(contacts, system, continuous))
    }
}

impl Points {
    /// Of a system without impulses, with the numbers of those of its equations that what is continuous satisfies.
    pub fn new(contacts: Contacts, system: ComplementaritySystem, continuous: Vec<usize>) -> Self {
        let n_inputs = 1 + system.n_states() + contacts.parameters.len();
        Points {
            inputs: Vec::with_capacity(n_inputs),
            values: vec![0.0; contacts.laws.n_outputs()],
            scratch: contacts.laws.scratch(),
            numbers: vec![0.0; system.n_numbers()],
            contacts,
            system,
            continuous,
        }
    }

    /// Whether the system has so many states, switches and parameters.
    pub(super) fn has(&self, n_states: usize, n_switches: usize, n_parameters: usize) -> bool {
        let system = &self.system;
        [n_states, n_switches, n_parameters]
            == [
                system.n_states(),
                system.n_switches(),
                system.parameters.len(),
            ]
    }

    /// The number of z.
    pub(super) fn n_algebraics(&self) -> usize {
        self.system.n_algebraics()
    }

    /// Gives all parameters other values.
    pub fn set_parameters(&mut self, values: &[f64]) {
        self.contacts.parameters[..values.len()].copy_from_slice(values);
        self.system.parameters.copy_from_slice(values);
    }

    /// A step from a point: z there, and zero for gaps that are closed. None where the equations of what is continuous
    /// do not hold.
    pub fn start(&mut self, t: f64, x: &[f64]) -> Option<StepStart> {
        self.go_to(t);
        let mut z = self.system.z_at(self.at(t, x), &[]);
        let size = largest(x).max(1.0);
        for impact in &self.contacts.impacts {
            if z[impact.gap] <= CLOSED * size {
                z[impact.gap] = 0.0;
            }
        }
        let inputs = self.at(t, x).with(&z);
        let scale = inputs.iter().fold(1.0, |most: f64, v| most.max(v.abs()));
        let values = eval(&self.system.full.equations, &inputs);
        let rows = &values[self.system.n_states()..];
        let mut continuous = self.continuous.iter();
        let holds = continuous.all(|&row| rows[row].abs() <= CONSISTENT * scale);
        holds.then(|| StepStart {
            time: t,
            x: x.to_vec(),
            z,
        })
    }

    /// The slip velocities at a point.
    pub fn slips(&mut self, t: f64, x: &[f64]) -> Slips {
        let slips = self.contacts.impacts.iter().map(|impact| impact.slip);
        if slips.flatten().next().is_none() {
            return Slips::default();
        }
        self.go_to(t);
        let (psi, _) = self.at(t, x).sides(&self.system, &[]);
        let impacts = self.contacts.impacts.iter();
        let discs = self.system.discs.iter();
        Slips {
            lines: impacts
                .filter_map(|impact| Some(psi[impact.line()?]))
                .collect(),
            planes: discs.map(|disc| disc.switches.map(|k| psi[k])).collect(),
        }
    }

    /// The value of a member of a pair at a point, by its switch.
    pub fn member(&self, switch: usize, t: f64, x: &[f64]) -> f64 {
        let alphas = vec![0.5; self.system.n_switches()];
        -eval(&self.system.surfaces.psi, &self.at(t, x).with(&alphas))[switch]
    }

    /// α of all switches for values of z, whatever follows these.
    pub fn alphas(&self, z: &[f64]) -> Vec<f64> {
        let without = vec![f64::NAN; self.system.n_states()];
        let point = Point {
            t: f64::NAN,
            x: &without,
            numbers: &self.numbers,
        };
        eval(
            &self.system.full.alphas,
            &point.with(&z[..self.system.n_algebraics()]),
        )
    }

    /// The rate of the gap, the restitution and the friction of every contact at a point.
    pub fn laws(&mut self, t: f64, x: &[f64]) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.inputs.clear();
        self.inputs.push(t);
        self.inputs.extend_from_slice(x);
        self.inputs.extend_from_slice(&self.contacts.parameters);
        let (inputs, scratch) = (&self.inputs, &mut self.scratch);
        self.contacts.laws.eval(inputs, &mut self.values, scratch);
        let laws = self.values.chunks_exact(3);
        laws.map(|law| [law[0], law[1], law[2]])
    }

    /// Takes the numbers that hold at an instant.
    fn go_to(&mut self, t: f64) {
        self.system.numbers(t, &mut self.numbers);
    }

    fn at<'p>(&'p self, t: f64, x: &'p [f64]) -> Point<'p> {
        let numbers = &self.numbers;
        Point { t, x, numbers }
    }
}

impl Lowered for Points {
    fn impacts(&self) -> &[Impact] {
        &self.contacts.impacts
    }

    fn in_mode(&mut self, [t, inside]: [f64; 2], x: &[f64], alpha: &[f64]) -> Vec<f64> {
        self.go_to(inside);
        self.at(t, x).z_in_mode(&self.system, alpha)
    }

    /// Where w comes to zero, its direction is that before.
    fn direct(&mut self, alpha: &mut [f64], [t, inside]: [f64; 2], x: &[f64]) {
        let slips = |[first, second]: [usize; 2]| {
            let u = [first, second].map(|k| 2.0 * alpha[k] - 1.0);
            u[0].hypot(u[1]) > 1.0 + OUTSIDE
        };
        let discs = self.system.discs.iter().map(|disc| disc.switches);
        let impacts = self.contacts.impacts.iter();
        let idle = impacts.filter_map(|impact| impact.idle(alpha));
        let slipping = discs.filter(|disc| slips(*disc)).flatten();
        let slipping: Vec<usize> = slipping.chain(idle).collect();
        if slipping.is_empty() {
            return;
        }
        self.go_to(inside);
        let (_, there) = self.at(t, x).sides(&self.system, &[]);
        for k in slipping {
            alpha[k] = there[k];
        }
    }

    fn law(&mut self, contact: usize, t: f64, x: &[f64]) -> [f64; 2] {
        let law = self.laws(t, x).nth(contact);
        law.map_or([f64::NAN; 2], |[speed, restitution, _]| {
            [speed, restitution]
        })
    }
}
