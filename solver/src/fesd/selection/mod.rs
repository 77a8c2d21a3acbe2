//! The active set that goes on from the start or from a switch.

pub(crate) mod bands;
pub(crate) mod corner;
pub(crate) mod directional;
pub(crate) mod element_mcp;
pub(crate) mod guided;
pub(crate) mod independent;
pub(crate) mod newton;
pub(crate) mod simultaneous;
pub(crate) mod slip;
pub(crate) mod trial;

use super::adaptive::ROUNDING;
use super::modes::Modes;
use super::run::Run;
use super::system::{ComplementaritySystem, Pair, Zero};
use super::watch::BAND;
use crate::fesd::selection::bands::{Bands, measure_balance};
use crate::fesd::selection::directional::{Choice, Directional, Found, switches_of};
use crate::fesd::selection::element_mcp::ElementMcp;
use crate::fesd::selection::guided::Guided;
use crate::fesd::selection::trial::Trials;
use crate::hybrid::{Note, Side, Status};
use crate::runtime::limit::Limit;
use crate::selector::Candidate;
use crate::selector::ModeSelector;

/// What differences between rates of states are none next to: the largest rate by any set that was tried, or what
/// moves the state by no more than rounding within a step.
fn sizes_of_rates(run: &Run, found: &Found, length: f64) -> Vec<f64> {
    let states = run.scale.iter().zip(&found.sizes);
    let size = |(scale, size): (&f64, &f64)| size.max(ROUNDING * scale / length);
    states.map(size).collect()
}

/// Whole elements that are tried, and how long each is next to the one before.
const MAX_ELEMENTS: usize = 4;
const SHRINK: f64 = 0.1;

/// What a user may choose of the selection.
pub(crate) struct Preferences {
    /// Switches that are below their surface where several sets go on that differ in them.
    pub below: Vec<usize>,
    /// When work stops.
    pub limit: Limit,
    /// What matters to a state, relative to its magnitude.
    pub tolerance: f64,
}

/// Decides about the active set that goes on.
pub(crate) struct Selection<'s> {
    system: &'s ComplementaritySystem,
    preferences: Preferences,
    directional: Directional,
    trials: Trials,
    element_mcp: ElementMcp,
    /// Where switches are nonlinear.
    guided: Option<Guided<'s>>,
}

impl<'s> Selection<'s> {
    /// Memory for the modes of a system.
    pub fn new(modes: &Modes<'s>, preferences: Preferences) -> Self {
        Selection {
            system: modes.system,
            preferences,
            directional: Directional::new(modes.system),
            trials: Trials::new(&modes.scheme),
            element_mcp: ElementMcp::default(),
            guided: None,
        }
    }

    /// Lets a selector choose among sliding modes of nonlinear switches.
    pub fn guide(&mut self, selector: Box<dyn ModeSelector + 's>) {
        self.guided = Some(Guided { selector });
    }

    /// Takes the numbers that hold from here on.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        self.directional.set_numbers(numbers);
    }

    /// Finds the set that a run starts with.
    pub fn begin(&mut self, modes: &mut Modes, run: &mut Run, horizon: f64) -> Result<(), Status> {
        if let Some(guided) = &mut self.guided {
            let bands = Bands::at(modes, run, horizon);
            let choice = guided.begin(&mut self.directional, run, &bands)?;
            return self.take(modes, run, choice, &bands);
        }
        run.slips.step = horizon;
        measure_balance(modes, run);
        let bands = Bands::at(modes, run, horizon);
        // Off its surface the continuous member is positive, and the other one zero.
        let zero = |(pair, band): (&Pair, &f64)| {
            let side = match self.system.is_continuous(pair.left.variable) {
                true => Zero::Left,
                false => Zero::Right,
            };
            let (continuous, _) = pair.split(side);
            if continuous.value(&run.place.z) > *band {
                side.other()
            } else {
                side
            }
        };
        run.place.zeros = self.system.pairs.iter().zip(&bands.of).map(zero).collect();
        self.select_from(modes, run, &bands)
    }

    /// Sides and α where pieces of data end, as far as what goes on depends on them.
    pub fn before_breakpoint(
        &self,
        modes: &mut Modes,
        run: &Run,
    ) -> Option<(Box<[Side]>, Vec<f64>)> {
        self.guided.is_some().then(|| modes.switches(run))
    }

    /// Goes on from a breakpoint: what depends on data may jump there, λ with it, and is computed anew
    /// from x; the set that goes on is found as at the start, or from sides and α before.
    pub fn pass_breakpoint(
        &mut self,
        before: Option<(Box<[Side]>, Vec<f64>)>,
        modes: &mut Modes,
        run: &mut Run,
        length: f64,
    ) -> Result<(), Status> {
        let (Some(guided), Some(before)) = (&mut self.guided, before) else {
            return self.begin_led(modes, run, Vec::new(), length);
        };
        let bands = Bands::at(modes, run, length);
        let choice = guided.pass(&mut self.directional, before, (modes, run), &bands)?;
        self.take(modes, run, choice, &bands)
    }

    /// Finds the set that goes on where an element has ended on its boundary.
    pub fn select(&mut self, modes: &mut Modes, run: &mut Run, length: f64) -> Result<(), Status> {
        if !modes.take_z(run) {
            return Err(Status::Unsolved);
        }
        run.slips.step = length;
        measure_balance(modes, run);
        let bands = Bands::at(modes, run, length);
        if let Some(guided) = &mut self.guided {
            let choice = guided.select(&mut self.directional, modes, run, &bands)?;
            return self.take(modes, run, choice, &bands);
        }
        let led = self.led(modes, run);
        if !led.is_empty() {
            return self.begin_led(modes, run, led, length);
        }
        let tolerance = self.preferences.tolerance;
        self.directional.note_together(run, &bands, tolerance);
        self.select_from(modes, run, &bands)
    }

    /// (switch, side) of the leading switches, those of time with which others jump: the opposite side for each that is on
    /// its surface, which time takes it across, and the present side for the others. Empty if none is on its surface.
    fn led(&self, modes: &Modes, run: &Run) -> Vec<(usize, Side)> {
        let mut led = self.led_sides(modes, run);
        let met = self.system.meets(run.place.point(&modes.numbers), &led);
        if !met.contains(&true) {
            return Vec::new();
        }
        for ((_, side), _) in led.iter_mut().zip(met).filter(|(_, met)| *met) {
            *side = Side::of(-side.sign());
        }
        led
    }

    /// (switch, side) of the leading switches in the present mode.
    fn led_sides(&self, modes: &Modes, run: &Run) -> Vec<(usize, Side)> {
        let sides = modes.sides(run.place.mode);
        let leading = self.system.surfaces.leading.iter();
        let leading = leading.map(|leading| leading.switch);
        leading.map(|switch| (switch, sides[switch])).collect()
    }

    /// Finds the set where switching functions have jumped with data, or with switches on the sides `led`: λ is what
    /// they are now. Sides that are found otherwise than they were expected make others jump in turn.
    fn begin_led(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        mut led: Vec<(usize, Side)>,
        length: f64,
    ) -> Result<(), Status> {
        for _ in 0..=self.system.surfaces.leading.len() {
            if !self.system.algebraic_states.is_empty() {
                let z = self.system.z_at(run.place.point(&modes.numbers), &led);
                let most = (length, &self.preferences.limit);
                self.element_mcp.settle(modes, run, &z, most);
            }
            run.place.z = self.system.z_at(run.place.point(&modes.numbers), &led);
            self.begin(modes, run, length)?;
            let found = self.led_sides(modes, run);
            if found == led {
                return Ok(());
            }
            led = found;
        }
        let leading = self.system.surfaces.leading.iter();
        Err(Status::Restless {
            switches: leading.map(|leading| leading.switch).collect(),
        })
    }

    fn select_from(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        bands: &Bands,
    ) -> Result<(), Status> {
        slip::rest(self.system, &bands.of, &modes.numbers, &mut run.place);
        // Where a force balances the rates, no choice has a rate that shows the size of their terms: what
        // moves a gap by no more than rounding within a step is none.
        let gaps = self.system.pairs.iter().zip(&bands.of);
        let gaps = gaps.filter(|(pair, _)| !pair.is_bounded);
        let least = gaps.fold(0.0_f64, |size, (_, band)| size.max(band / BAND)) / bands.length;
        let place = &run.place;
        self.directional.set(place.t, &place.x, &place.z);
        let mut found =
            (self.directional).choices(self.system, &place.zeros, &place.z, &bands.of, least);
        // Choices with the same rates are one solution.
        let sizes = sizes_of_rates(run, &found, bands.length);
        let mut classes: Vec<Vec<Choice>> = Vec::new();
        for choice in std::mem::take(&mut found.choices) {
            match classes
                .iter_mut()
                .find(|class| directional::agree(&class[0], &choice, least, &sizes))
            {
                Some(class) => class.push(choice),
                None => classes.push(vec![choice]),
            }
        }
        if let [class] = &mut classes[..]
            && let Some(at) = class.iter().position(|choice| choice.strict)
        {
            match found.complete {
                true => run.record.rungs.predicted += 1,
                false => self.smoothed(run, &found),
            }
            return self.take(modes, run, class.swap_remove(at), bands);
        }
        // Where a derivative vanishes, an element of the set itself says what comes next.
        let mut accepted: Vec<Choice> = Vec::new();
        for class in &classes {
            let certain = class.iter().find(|choice| choice.strict).cloned();
            let confirmed = || (self.trials).confirmed(modes, run, class, bands);
            accepted.extend(certain.or_else(confirmed));
        }
        match accepted.len() {
            0 => self.take_whole(modes, run, &found, bands),
            1 => {
                run.record.rungs.tried += 1;
                if !found.complete {
                    self.smoothed(run, &found);
                }
                self.take(modes, run, accepted.swap_remove(0), bands)
            }
            _ => self.take_preferred(modes, run, &found, accepted, bands),
        }
    }

    /// Goes on with the set of a whole element, where no choice does.
    fn take_whole(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        found: &Found,
        bands: &Bands,
    ) -> Result<(), Status> {
        // The problem of a whole element has no place for what sets off.
        let mut discs = self.system.discs.iter();
        if !discs.any(|disc| found.open.contains(&disc.pair)) {
            if let Some(choice) = self.whole(modes, run, bands) {
                run.record.rungs.whole += 1;
                self.note_unsearched(run, found);
                return self.take(modes, run, choice, bands);
            }
            // What the clock has stopped has found nothing out.
            self.preferences.limit.check()?;
        }
        let switches = match modes.all.get(run.place.mode) {
            Some(_) => switches_of(self.system, &found.open),
            None => Vec::new(),
        };
        Err(Status::NoSolution { switches })
    }

    /// The set of the first nodes of an element about as long as a step, where an element of that set up to the first
    /// node confirms it.
    fn whole(&mut self, modes: &mut Modes, run: &mut Run, bands: &Bands) -> Option<Choice> {
        self.element_mcp.begin(modes, &run.place);
        let mut h = bands.length;
        for _ in 0..MAX_ELEMENTS {
            let limit = &self.preferences.limit;
            if limit.is_over() {
                break;
            }
            let first = self.element_mcp.solve(modes, run, h, limit);
            let found = first.and_then(|first| {
                // What changes no more than rounding over the element has no rate.
                let rate_scale = first.rate_scale(self.system, bands.largest_size() / h);
                let solved = (first.zeros, first.u);
                let choice = (self.directional).choice(
                    self.system,
                    solved,
                    &run.place.z,
                    &bands.of,
                    rate_scale,
                )?;
                let passes = (self.trials).passes(modes, run, &choice, bands, first.distance);
                passes.then_some(choice)
            });
            if found.is_some() {
                return found;
            }
            h *= SHRINK;
        }
        None
    }

    /// Goes on with the only one of several choices in which the switches that are to be below their surfaces are.
    fn take_preferred(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        found: &Found,
        mut accepted: Vec<Choice>,
        bands: &Bands,
    ) -> Result<(), Status> {
        accepted.retain(|choice| modes.of(&choice.zeros).is_some());
        let all = accepted.iter().filter_map(|choice| modes.of(&choice.zeros));
        let all: Vec<usize> = all.collect();
        let sides: Vec<&[Side]> = all.iter().map(|&mode| modes.sides(mode)).collect();
        if let Some(at) = preferred(&self.preferences.below, &sides) {
            run.record.rungs.tried += 1;
            return self.take(modes, run, accepted.swap_remove(at), bands);
        }
        let candidates = candidates(&sides);
        Err(match candidates.iter().all(Vec::is_empty) {
            true => Status::Unweighted {
                switches: switches_of(self.system, &found.open),
            },
            false => Status::NonUnique(candidates),
        })
    }

    /// Counts a set that was found by the smoothed directional problem.
    fn smoothed(&self, run: &mut Run, found: &Found) {
        run.record.rungs.smoothed += 1;
        self.note_unsearched(run, found);
    }

    /// Says that not all sets were tried.
    fn note_unsearched(&self, run: &mut Run, found: &Found) {
        run.record.notes.push(Note::Unsearched {
            time: run.place.t,
            switches: switches_of(self.system, &found.open),
        });
    }

    /// Goes on with a set.
    fn take(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        choice: Choice,
        bands: &Bands,
    ) -> Result<(), Status> {
        let Some(mode) = modes.of(&choice.zeros) else {
            let both = choice.zeros.iter().zip(&run.place.zeros).enumerate();
            let differing = both.filter(|(_, (a, b))| a != b);
            let pairs: Vec<usize> = differing.map(|(pair, _)| pair).collect();
            return Err(Status::Undetermined {
                switches: switches_of(self.system, &pairs),
            });
        };
        let reduced = &*modes.all[mode].element.reduced;
        if reduced.slides() && !modes.scheme.tableau.is_invertible() {
            let slides = |i: &usize| reduced.sides[*i] == Side::Slide;
            let switches = (0..reduced.sides.len()).filter(slides).collect();
            return Err(Status::CannotSlide { switches });
        }
        let entry = &mut run.entry;
        let watched = reduced.watched.iter();
        entry.starts.clear();
        (entry.starts).extend(watched.clone().map(|w| choice.starts[w.pair]));
        entry.sizes.clear();
        (entry.sizes).extend(watched.map(|w| bands.size(&choice.zeros, w.pair)));
        if reduced.has_branches {
            entry.sizes.push(1.0);
        }
        entry.rate_scale = choice.rate_scale;
        let place = &mut run.place;
        for (i, (z, u)) in place.z.iter_mut().zip(&choice.u).enumerate() {
            if !self.system.is_continuous(i) {
                *z = *u;
            }
        }
        let (x, departures) = run.slips.set_off(
            self.system,
            &bands.of,
            &modes.numbers,
            place,
            &choice,
            reduced,
        );
        place.x = x;
        run.slips.keep(&self.system.discs, place, departures);
        (place.mode, place.zeros) = (mode, choice.zeros);
        entry.rates = choice.rates;
        Ok(())
    }
}

/// The only one of several modes, by their sides, in which the switches that are to be below their surfaces are.
fn preferred(below: &[usize], modes: &[&[Side]]) -> Option<usize> {
    let is_it = |at: &usize| {
        let sides = modes[*at];
        below.iter().all(|&switch| {
            let of_all = modes.iter().all(|mode| mode[switch] == sides[switch]);
            sides[switch] == Side::Minus || of_all
        })
    };
    let mut found = (0..modes.len()).filter(is_it);
    let first = found.next().filter(|_| !below.is_empty())?;
    found.next().is_none().then_some(first)
}

/// The switches that slide in some of several modes, or are on different sides, with their sides
/// in each.
fn candidates(modes: &[&[Side]]) -> Vec<Candidate> {
    let differs = |switch: &usize| modes.iter().any(|mode| mode[*switch] != modes[0][*switch]);
    let n_switches = modes.first().map_or(0, |sides| sides.len());
    let open: Vec<usize> = (0..n_switches).filter(differs).collect();
    let candidate = |mode: &&[Side]| open.iter().map(|&switch| (switch, mode[switch])).collect();
    modes.iter().map(candidate).collect()
}
