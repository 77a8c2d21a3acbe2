//! Islands: contacts that act on each other, through bodies that they have in common.

use super::rows::{ContactRows, Mass, Rows};

/// Contacts by island.
#[derive(Default)]
pub(crate) struct Islands {
    parents: Vec<u32>,
    number: Vec<u32>,
    starts: Vec<usize>,
    contacts: Vec<u32>,
    of_contact: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Islands {
    /// Forgets all contacts.
    pub fn begin(&mut self, mass: &Mass) {
        self.parents.clear();
        self.parents.extend(0..mass.n_bodies() as u32);
    }

    /// Joins the bodies of all contacts.
    pub fn join(&mut self, rows: &Rows, contacts: impl Iterator<Item = ContactRows>, mass: &Mass) {
        for contact in contacts {
            // Friction also acts on bodies that the gap does not see.
            let columns = rows.columns_of(&contact);
            let first = columns[0] as usize;
            for &column in columns {
                let (a, b) = (mass.body_of(first), mass.body_of(column as usize));
                let (a, b) = (self.root(a as u32), self.root(b as u32));
                self.parents[a.max(b) as usize] = a.min(b);
            }
        }
    }

    fn root(&mut self, mut body: u32) -> u32 {
        while self.parents[body as usize] != body {
            let above = self.parents[self.parents[body as usize] as usize];
            self.parents[body as usize] = above;
            body = above;
        }
        body
    }

    /// The first body of the island that a body is in.
    pub fn of_body(&mut self, body: usize) -> usize {
        self.root(body as u32) as usize
    }

    /// The first body of the island of a contact.
    fn of(&mut self, rows: &Rows, contact: &ContactRows, mass: &Mass) -> usize {
        let columns = rows.columns(contact.normal);
        self.of_body(mass.body_of(columns[0] as usize))
    }

    /// Sorts contacts by island.
    pub fn sort(&mut self, rows: &Rows, contacts: &[ContactRows], mass: &Mass) {
        self.number.clear();
        self.number.resize(mass.n_bodies(), NONE);
        self.of_contact.clear();
        let mut count = 0;
        for contact in contacts {
            let root = self.of(rows, contact, mass);
            if self.number[root] == NONE {
                self.number[root] = count;
                count += 1;
            }
            self.of_contact.push(self.number[root]);
        }
        self.starts.clear();
        self.starts.resize(count as usize + 1, 0);
        for &island in &self.of_contact {
            self.starts[island as usize + 1] += 1;
        }
        for island in 0..count as usize {
            self.starts[island + 1] += self.starts[island];
        }
        self.contacts.clear();
        self.contacts.resize(self.of_contact.len(), 0);
        for contact in (0..self.of_contact.len()).rev() {
            let end = &mut self.starts[self.of_contact[contact] as usize + 1];
            *end -= 1;
            self.contacts[*end] = contact as u32;
        }
        // What were ends are starts now.
        self.starts.remove(0);
        self.starts.push(self.contacts.len());
    }

    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The contacts of an island, in order.
    pub fn contacts(&self, island: usize) -> &[u32] {
        &self.contacts[self.starts[island]..self.starts[island + 1]]
    }
}
