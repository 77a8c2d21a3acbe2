//! Symbolic factorizations, which are made once for all matrices of a pattern.
//!
//! Programs that differ in their numbers only have the same ones, and so have those of one branch. They are kept as far
//! as they fit into a bounded memory, those that were used last before others.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::ldl::{Analysis, SparseLdl};
use crate::optimization::problem::Pattern;

/// How much is kept, in numbers of 4 bytes.
const MOST_NUMBERS: usize = 1 << 25;

/// Symbolic factorizations that all who hold this share.
#[derive(Clone, Debug, Default)]
pub struct Analyses(Arc<Mutex<List<Analysis>>>);

impl Analyses {
    /// Memory for matrices of a pattern, of which these pairs of unknowns are eliminated together.
    pub fn ldl(&self, pattern: &Pattern, pairs: &[[u32; 2]]) -> SparseLdl {
        SparseLdl::of(self.list().find(pattern, pairs, || {
            let analysis = Analysis::new(pattern, pairs);
            (analysis.size(), analysis)
        }))
    }

    /// How many have been made.
    pub fn made(&self) -> usize {
        self.list().made
    }

    fn list(&self) -> MutexGuard<'_, List<Analysis>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What was used last comes last.
#[derive(Debug)]
struct List<A> {
    kept: Vec<Kept<A>>,
    made: usize,
}

#[derive(Debug)]
struct Kept<A> {
    pattern: Pattern,
    pairs: Vec<[u32; 2]>,
    analysis: Arc<A>,
    size: usize,
}

impl<A> Default for List<A> {
    fn default() -> Self {
        List {
            kept: Vec::new(),
            made: 0,
        }
    }
}

impl<A> List<A> {
    /// The one of a pattern and its pairs, which is made with its size where there is none.
    fn find(
        &mut self,
        pattern: &Pattern,
        pairs: &[[u32; 2]],
        make: impl FnOnce() -> (usize, A),
    ) -> Arc<A> {
        let same = |kept: &Kept<A>| kept.pattern == *pattern && kept.pairs == pairs;
        let known = self.kept.iter().position(same);
        let last = match known {
            Some(place) => self.kept.remove(place),
            None => {
                self.made += 1;
                let (size, analysis) = make();
                self.forget(MOST_NUMBERS.saturating_sub(size));
                Kept {
                    pattern: pattern.clone(),
                    pairs: pairs.to_vec(),
                    analysis: Arc::new(analysis),
                    size,
                }
            }
        };
        let analysis = last.analysis.clone();
        self.kept.push(last);
        analysis
    }

    /// Drops those that were not used for longest, until the others fit.
    fn forget(&mut self, most: usize) {
        let mut left = most;
        let fits = |kept: &&Kept<A>| {
            let fits = kept.size <= left;
            left = left.saturating_sub(kept.size);
            fits
        };
        let count = self.kept.iter().rev().take_while(fits).count();
        self.kept.drain(..self.kept.len() - count);
    }
}

#[cfg(test)]
mod tests {
    use super::{Analyses, List};
    use crate::linalg::symmetric::KktSolver;
    use crate::optimization::problem::Pattern;

    #[test]
    fn a_pattern_is_analyzed_once() {
        let analyses = Analyses::default();
        // ( 2 1 ) (1)   (3)
        // ( 1 -1) (1) = (0)
        let full = Pattern::new(2, vec![(0, 0), (1, 0), (1, 1)]);
        for scale in [1.0, -3.0] {
            let mut ldl = analyses.clone().ldl(&full, &[]);
            let matrix = [2.0, 1.0, -1.0].map(|a| scale * a);
            ldl.factor(&matrix).expect("it has pivots");
            let mut x = [3.0 * scale, 0.0];
            ldl.solve(&mut x);
            assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-15), "{x:?}");
        }
        assert_eq!(analyses.made(), 1);
        analyses.ldl(&full, &[[0, 1]]);
        analyses.ldl(&full, &[]);
        analyses.ldl(&full, &[[0, 1]]);
        assert_eq!(analyses.made(), 2);
        analyses.ldl(&Pattern::new(2, vec![(0, 0), (1, 1)]), &[]);
        assert_eq!(analyses.made(), 3);
    }

    #[test]
    fn what_was_not_used_for_longest_is_forgotten() {
        let mut list: List<u32> = List::default();
        let pattern = |n: usize| Pattern::new(n, Vec::new());
        let mut ask = |n: usize| *list.find(&pattern(n), &[], || (super::MOST_NUMBERS / 2, 0));
        for n in [1, 2, 1, 3, 1] {
            ask(n);
        }
        assert_eq!(list.made, 3);
        assert_eq!(list.kept.len(), 2);
        list.find(&pattern(2), &[], || (1, 0));
        assert_eq!(list.made, 4);
    }
}
