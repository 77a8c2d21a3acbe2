//! The active set that goes on from the start or from a switch.

pub(crate) mod corner;
pub(crate) mod directional;
pub(crate) mod element_mcp;
pub(crate) mod guided;
pub(crate) mod independent;
pub(crate) mod newton;
pub(crate) mod simultaneous;
use super::adaptive::ROUNDING;
use super::emit::Observer;
use super::system::{Member, NEGLIGIBLE, Pair, Zero};
use super::watch::{BAND, Start, Verdict};
use super::{Run, Simulator};
use crate::fesd::selection::directional::{Choice, Found};
use crate::fesd::system::pointwise::Point;
use crate::hybrid::{Note, Side, Status};
use crate::selector::Candidate;

/// Length of the first trial element, relative to that of a step, and of every other to the one before.
const TRIAL: f64 = 1e-3;
const LONGER: f64 = 10.0;

/// What a trial element says about its set.
enum Trial {
    /// A member is negative from the start,
    Fails,
    /// or is, but by no more than a rate that counts as zero explains.
    Open,
    /// No member is negative, and one stays as close to zero.
    Tied,
    /// All members stay positive, or leave later.
    Passes,
}

/// What differences between rates of states are none next to: the largest rate by any set that was tried, or what
/// moves the state by no more than rounding within a step.
fn sizes_of_rates(run: &Run, found: &Found, length: f64) -> Vec<f64> {
    let states = run.scale.iter().zip(&found.sizes);
    let size = |(scale, size): (&f64, &f64)| size.max(ROUNDING * scale / length);
    states.map(size).collect()
}

impl Simulator<'_> {
    /// The only one of several modes in which the switches that are to be below their surfaces are.
    pub(crate) fn preferred(&self, modes: &[usize]) -> Option<usize> {
        let below = &self.settings.below;
        let is_it = |mode: &usize| {
            let sides = &self.modes[*mode].element.reduced.sides;
            below.iter().all(|&switch| {
                let of = |mode: &usize| self.modes[*mode].element.reduced.sides[switch];
                sides[switch] == Side::Minus || modes.iter().all(|mode| of(mode) == sides[switch])
            })
        };
        let mut found = (0..modes.len()).filter(|&at| is_it(&modes[at]));
        let first = found.next().filter(|_| !below.is_empty())?;
        found.next().is_none().then_some(first)
    }

    /// The switches that slide in some of several modes, or are on different sides, with their sides
    /// in each.
    pub(crate) fn candidates(&self, modes: &[usize]) -> Vec<Candidate> {
        let sides = |mode: &usize| &self.modes[*mode].element.reduced.sides;
        let differs = |switch: &usize| {
            let mut all = modes.iter().map(|mode| sides(mode)[*switch]);
            let first = all.next();
            all.any(|side| Some(side) != first)
        };
        let open: Vec<usize> = (0..self.system.n_switches()).filter(differs).collect();
        let candidate = |mode: &usize| {
            open.iter()
                .map(|&switch| (switch, sides(mode)[switch]))
                .collect()
        };
        modes.iter().map(candidate).collect()
    }

    /// Finds the set that a run starts with.
    pub(crate) fn begin(&mut self, run: &mut Run, horizon: f64) -> Result<(), Status> {
        if self.mode_selector.is_some() {
            return self.begin_guided(run, horizon);
        }
        run.slips.step = horizon;
        self.measure_balance(run);
        let bands = self.bands(run);
        // Off its surface the continuous member is positive, and the other one zero.
        let zero = |(pair, band): (&Pair, &f64)| {
            let side = match self.system.is_continuous(pair.left.variable) {
                true => Zero::Left,
                false => Zero::Right,
            };
            let (continuous, _) = pair.split(side);
            if continuous.value(&run.z) > *band {
                side.other()
            } else {
                side
            }
        };
        run.zeros = self.system.pairs.iter().zip(&bands).map(zero).collect();
        self.select_from(run, &bands, horizon)
    }

    /// Takes the numbers that hold from an instant on, up to the next breakpoint.
    pub(crate) fn load(&mut self, run: &mut Run, from: f64) {
        run.until = self.system.numbers(from, &mut self.numbers);
        self.directional.set_numbers(&self.numbers);
        for mode in &mut self.modes {
            mode.element.set_numbers(&self.numbers);
            mode.hidden.set_numbers(&self.numbers);
        }
    }

    /// Goes on from a breakpoint: what depends on data may jump there, λ with it, and is computed anew
    /// from x; the set that goes on is found as at the start.
    pub(crate) fn pass_breakpoint(
        &mut self,
        run: &mut Run,
        length: f64,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        let before = self.modes[run.mode].element.reduced.sides.clone();
        // The instant may be just ahead, by rounding.
        let from = run.t.max(run.until);
        self.load(run, from);
        if self.mode_selector.is_some() {
            run.go_to(from);
            self.pass_guided(run, length)?;
        } else {
            run.go_to(from);
            self.begin_led(run, Vec::new(), length)?;
        }
        run.last = 0.0;
        self.tell_change(run, before, observer)
    }

    /// Finds the set that goes on where an element has ended on its boundary.
    pub(crate) fn select(&mut self, run: &mut Run, length: f64) -> Result<(), Status> {
        let mode = &mut self.modes[run.mode];
        let w = run.z_of(&mode.element.reduced.unknowns);
        mode.hidden.set(run.t, run.x.iter().copied(), &w);
        // At a fold w is known, and no solution by itself.
        if run.fold.is_none() {
            let solved = mode.hidden.solve(&mode.element.reduced);
            solved.map_err(|_| Status::Unsolved)?;
        }
        let reduced = mode.element.reduced.clone();
        for (z, value) in run.z.iter_mut().zip(mode.hidden.eval(&reduced.algebraics)) {
            *z = value;
        }
        run.slips.step = length;
        self.measure_balance(run);
        let bands = self.bands(run);
        if self.mode_selector.is_some() {
            return self.select_guided(run, &bands, length);
        }
        let led = self.led(run);
        if !led.is_empty() {
            return self.begin_led(run, led, length);
        }
        self.note_together(run, &bands, length);
        self.select_from(run, &bands, length)
    }

    /// The sides of switches that lead, those on the other one that have come to their surface; none where none has.
    fn led(&self, run: &Run) -> Vec<(usize, Side)> {
        let mut led = self.led_sides(run);
        let met = self.system.meets(self.point(run), &led);
        if !met.contains(&true) {
            return Vec::new();
        }
        for ((_, side), _) in led.iter_mut().zip(met).filter(|(_, met)| *met) {
            *side = Side::of(-side.sign());
        }
        led
    }

    /// Where the switches that lead stand.
    fn led_sides(&self, run: &Run) -> Vec<(usize, Side)> {
        let sides = &self.modes[run.mode].element.reduced.sides;
        let leading = self.system.surfaces.leading.iter();
        let leading = leading.map(|leading| leading.switch);
        leading.map(|switch| (switch, sides[switch])).collect()
    }

    /// Where a run is.
    pub(crate) fn point<'p>(&'p self, run: &'p Run) -> Point<'p> {
        Point {
            t: run.t,
            x: &run.x,
            numbers: &self.numbers,
        }
    }

    /// Finds the set where switching functions have jumped with data, or with switches on the sides `led`: λ is what
    /// they are now. Sides that are found otherwise than they were expected make others jump in turn.
    fn begin_led(
        &mut self,
        run: &mut Run,
        led: Vec<(usize, Side)>,
        length: f64,
    ) -> Result<(), Status> {
        let mut led = led;
        for _ in 0..=self.system.surfaces.leading.len() {
            run.z = self.system.z_at(self.point(run), &led);
            self.begin(run, length)?;
            let found = self.led_sides(run);
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

    fn select_from(&mut self, run: &mut Run, bands: &[f64], length: f64) -> Result<(), Status> {
        self.rest(run, bands);
        // Where a force balances the rates, no choice has a rate that shows the size of their terms: what
        // moves a gap by no more than rounding within a step is none.
        let gaps = self.system.pairs.iter().zip(bands);
        let gaps = gaps.filter(|(pair, _)| !pair.is_bounded);
        let least = gaps.fold(0.0_f64, |size, (_, band)| size.max(band / BAND)) / length;
        self.directional.set(run.t, &run.x, &run.z);
        let found = (self.directional).choices(self.system, &run.zeros, &run.z, bands, least);
        // Choices with the same rates are one solution.
        let sizes = sizes_of_rates(run, &found, length);
        let mut classes: Vec<Vec<Choice>> = Vec::new();
        for choice in found.choices.iter().cloned() {
            match classes
                .iter_mut()
                .find(|class| directional::agree(&class[0], &choice, least, &sizes))
            {
                Some(class) => class.push(choice),
                None => classes.push(vec![choice]),
            }
        }
        if let [class] = &classes[..]
            && let Some(choice) = class.iter().find(|choice| choice.strict)
        {
            match found.complete {
                true => run.rungs.predicted += 1,
                false => self.smoothed(run, &found),
            }
            return self.take(run, choice.clone(), bands);
        }
        // Where a derivative vanishes, an element of the set itself says what comes next.
        let mut accepted: Vec<Choice> = Vec::new();
        for class in &classes {
            let certain = class.iter().find(|choice| choice.strict).cloned();
            accepted.extend(certain.or_else(|| self.confirmed(run, class, bands, length)));
        }
        match accepted.len() {
            1 => {
                run.rungs.tried += 1;
                if !found.complete {
                    self.smoothed(run, &found);
                }
                self.take(run, accepted.swap_remove(0), bands)
            }
            // The problem of a whole element has no place for what sets off.
            0 if self.rests_or_sets_off(&found.open) => Err(self.nothing(run, &found)),
            0 => match self.whole(run, bands, length) {
                Some(choice) => {
                    run.rungs.whole += 1;
                    self.note_unsearched(run, &found);
                    self.take(run, choice, bands)
                }
                // What the clock has stopped has found nothing out.
                None => {
                    self.settings.limit.check()?;
                    Err(self.nothing(run, &found))
                }
            },
            _ => {
                accepted.retain(|choice| self.mode(&choice.zeros).is_some());
                let modes = accepted
                    .iter()
                    .filter_map(|choice| self.mode(&choice.zeros));
                let modes: Vec<usize> = modes.collect();
                if let Some(at) = self.preferred(&modes) {
                    run.rungs.tried += 1;
                    return self.take(run, accepted.swap_remove(at), bands);
                }
                let candidates = self.candidates(&modes);
                Err(match candidates.iter().all(Vec::is_empty) {
                    true => Status::Unweighted {
                        switches: self.switches_of_pairs(&found.open),
                    },
                    false => Status::NonUnique(candidates),
                })
            }
        }
    }

    /// Counts a set that was found by the smoothed directional problem.
    fn smoothed(&self, run: &mut Run, found: &Found) {
        run.rungs.smoothed += 1;
        self.note_unsearched(run, found);
    }

    /// Says that not all sets were tried.
    fn note_unsearched(&self, run: &mut Run, found: &Found) {
        run.notes.push(Note::Unsearched {
            time: run.t,
            switches: self.switches_of_pairs(&found.open),
        });
    }

    /// The choice that trial elements confirm, of several with the same rates: short ones first, and
    /// longer ones as long as none of these tells.
    fn confirmed(
        &mut self,
        run: &Run,
        class: &[Choice],
        bands: &[f64],
        length: f64,
    ) -> Option<Choice> {
        let mut left: Vec<&Choice> = class.iter().collect();
        let mut tied = None;
        let mut h = TRIAL * length;
        loop {
            let mut open = Vec::with_capacity(left.len());
            for choice in left {
                match self.trial(run, choice, bands, h) {
                    Trial::Passes => return Some(choice.clone()),
                    Trial::Fails => continue,
                    Trial::Tied => tied = tied.or(Some(choice)),
                    Trial::Open => {}
                }
                open.push(choice);
            }
            if open.is_empty() || h >= length {
                return tied.cloned();
            }
            left = open;
            h = (LONGER * h).min(length);
        }
    }

    /// Whether the members of a set stay positive in a short element.
    pub(crate) fn passes(&mut self, run: &Run, choice: &Choice, bands: &[f64], h: f64) -> bool {
        matches!(
            self.trial(run, choice, bands, h),
            Trial::Passes | Trial::Tied
        )
    }

    /// Solves for an element of a set, and looks at its members.
    fn trial(&mut self, run: &Run, choice: &Choice, bands: &[f64], h: f64) -> Trial {
        let Some(place) = self.mode(&choice.zeros) else {
            return Trial::Fails;
        };
        let mode = &self.modes[place];
        let reduced = mode.element.reduced.clone();
        // s of what slips is no rate.
        let slips = self.system.discs.iter().map(|disc| disc.slip);
        let slips: Vec<usize> = slips.collect();
        let w = reduced.unknowns.iter().map(|i| match slips.contains(i) {
            true => run.z[*i],
            false => choice.u[*i],
        });
        let w: Vec<f64> = w.collect();
        let (x, departures) = self.set_off(run, choice, &reduced, bands);
        let sizes = reduced.watched.iter();
        let sizes = sizes.map(|w| self.size(&choice.zeros, bands, w.pair));
        let sizes: Vec<f64> = sizes.collect();
        let mode = &mut self.modes[place];
        mode.element.guess(&choice.rates, &w);
        mode.element.set_off(&self.scheme, &departures, h);
        if mode
            .element
            .solve(&self.scheme, run.t, h, &x, &run.scale)
            .is_err()
        {
            return Trial::Fails;
        }
        let evaluated = self
            .values
            .evaluate(&self.scheme, &mode.element, &mut mode.hidden);
        if evaluated.is_err() {
            return Trial::Fails;
        }
        self.values.lower_stops(&self.scheme, &reduced, &sizes);
        let watched = &mode.element.reduced.watched;
        let starts: Vec<Start> = watched.iter().map(|w| choice.starts[w.pair]).collect();
        let determinant = reduced.has_branches.then_some(1.0);
        let sizes: Vec<f64> = sizes.into_iter().chain(determinant).collect();
        let scales = (&sizes[..], choice.rate_scale * h);
        let verdict = self
            .values
            .judge(&self.scheme, &starts, scales, &mut self.roots);
        let (scheme, values) = (&self.scheme, &self.values);
        // A rate within the tie moves a member by as much, whatever is behind it.
        let is_tied = |member: usize| {
            let pair = watched[member].pair;
            let (_, z) = self.system.pairs[pair].split(choice.zeros[pair]);
            let tie = match self.system.is_continuous(z.variable) {
                true => directional::TIE * choice.rate_scale * h,
                false => directional::TIE,
            };
            let largest = values.of(scheme, member).iter();
            let largest = largest.fold(0.0_f64, |size, value| size.max(value.abs()));
            starts[member] == Start::Tangent && largest <= tie
        };
        match verdict {
            Verdict::Wrong { member } if is_tied(member) => Trial::Open,
            Verdict::Wrong { .. } => Trial::Fails,
            _ if (0..watched.len()).any(is_tied) => Trial::Tied,
            _ => Trial::Passes,
        }
    }

    /// Goes on with a set.
    pub(crate) fn take(
        &mut self,
        run: &mut Run,
        choice: Choice,
        bands: &[f64],
    ) -> Result<(), Status> {
        let Some(mode) = self.mode(&choice.zeros) else {
            return Err(Status::Undetermined {
                switches: self.switches_of(&choice.zeros, &run.zeros),
            });
        };
        let reduced = &self.modes[mode].element.reduced;
        if reduced.slides() && !self.scheme.tableau.is_invertible() {
            let slides = |i: &usize| reduced.sides[*i] == Side::Slide;
            let switches = (0..reduced.sides.len()).filter(slides).collect();
            return Err(Status::CannotSlide { switches });
        }
        run.starts.clear();
        run.starts
            .extend(reduced.watched.iter().map(|w| choice.starts[w.pair]));
        run.sizes.clear();
        let sizes = reduced.watched.iter();
        run.sizes
            .extend(sizes.map(|w| self.size(&choice.zeros, bands, w.pair)));
        if reduced.has_branches {
            run.sizes.push(1.0);
        }
        run.rate_scale = choice.rate_scale;
        for (i, (z, u)) in run.z.iter_mut().zip(&choice.u).enumerate() {
            if !self.system.is_continuous(i) {
                *z = *u;
            }
        }
        let reduced = self.modes[mode].element.reduced.clone();
        let (x, departures) = self.set_off(run, &choice, &reduced, bands);
        run.x = x;
        self.keep_departures(run, departures);
        run.mode = mode;
        run.zeros = choice.zeros;
        run.rates = choice.rates;
        Ok(())
    }

    /// The inputs of the equations at the present point, and their slopes.
    fn linearized(&self, run: &Run) -> (Vec<f64>, Vec<f64>) {
        let full = &self.system.full;
        let mut inputs = vec![run.t];
        inputs.extend_from_slice(&run.x);
        inputs.extend_from_slice(&run.z);
        inputs.extend_from_slice(&self.numbers);
        let mut slopes = vec![0.0; full.slopes.entries.len()];
        full.slopes
            .tape
            .eval(&inputs, &mut slopes, &mut full.slopes.tape.scratch());
        (inputs, slopes)
    }

    /// Raises the sizes of algebraic states by what they balance: y = 0 is known to the rounding of the other terms of
    /// its rows, the least of (Σ |∂g/∂x_j x_j| + |g - ∇g·(x, z)|) / |∂g/∂y| without its own, next to which it may be
    /// [`NEGLIGIBLE`].
    fn measure_balance(&self, run: &mut Run) {
        let (n, full, algebraic) = (
            run.x.len(),
            &self.system.full,
            &self.system.algebraic_states,
        );
        if algebraic.is_empty() {
            return;
        }
        let (inputs, slopes) = self.linearized(run);
        let mut left = vec![0.0; full.equations.n_outputs()];
        full.equations
            .eval(&inputs, &mut left, &mut full.equations.scratch());
        let mut terms = vec![0.0; left.len()];
        for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
            if input > 0 {
                left[row] -= slope * inputs[input];
            }
            if (1..=n).contains(&input) {
                terms[row] += slope.abs() * run.scale[input - 1];
            }
        }
        for &y in algebraic {
            let of_rows = full.slopes.entries.iter().zip(&slopes);
            let of_rows = of_rows.filter(|((row, input), _)| *row >= n && *input == 1 + y);
            let balanced = of_rows.filter_map(|(&(row, _), slope)| {
                let all = terms[row] + left[row].abs();
                let others = all - slope.abs() * run.scale[y];
                (others > BAND * all).then_some(others / slope.abs())
            });
            let least = balanced.fold(f64::INFINITY, f64::min);
            if least.is_finite() {
                run.scale[y] = run.scale[y].max(NEGLIGIBLE * least);
            }
        }
    }

    /// Values of the continuous member of each pair below which it is zero: what rounding leaves of
    /// its terms, or of itself where these are zero.
    pub(crate) fn bands(&mut self, run: &Run) -> Vec<f64> {
        let (n, full) = (run.x.len(), &self.system.full);
        let (_, slopes) = self.linearized(run);
        let n_rows = full.equations.n_outputs() - n;
        let mut sizes = vec![0.0; n_rows];
        for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
            let scale = match input {
                0 => run.t.abs(),
                _ if input <= n => run.scale[input - 1],
                _ => continue,
            };
            if row >= n {
                sizes[row - n] += slope.abs() * scale;
            }
        }
        let mut of_variable = vec![0.0_f64; run.z.len()];
        for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
            if row >= n && input > n && *slope != 0.0 {
                let size = &mut of_variable[input - 1 - n];
                *size = size.max(sizes[row - n]);
            }
        }
        let band = |pair: &Pair| {
            let members = [pair.left, pair.right].into_iter();
            let continuous = members.filter(|m| self.system.is_continuous(m.variable));
            let size = |m: Member| of_variable[m.variable].max(m.value(&run.z).abs());
            BAND * continuous.map(size).fold(0.0, f64::max)
        };
        let mut bands: Vec<f64> = self.system.pairs.iter().map(band).collect();
        self.raise_bands(run, &mut bands);
        bands
    }

    /// What the member of a pair that is not zero is compared with: what jumps, like θ and α, is up to 1.
    fn size(&self, zeros: &[Zero], bands: &[f64], pair: usize) -> f64 {
        let (_, member) = self.system.pairs[pair].split(zeros[pair]);
        match self.system.is_continuous(member.variable) {
            true => (self.size_of_stop(pair, bands)).unwrap_or(bands[pair] / BAND),
            false => 1.0,
        }
    }

    fn nothing(&mut self, run: &Run, found: &Found) -> Status {
        let switches = match self.modes.get(run.mode) {
            Some(_) => self.switches_of_pairs(&found.open),
            None => Vec::new(),
        };
        Status::NoSolution { switches }
    }

    fn switches_of(&self, a: &[Zero], b: &[Zero]) -> Vec<usize> {
        let differing = a.iter().zip(b).enumerate().filter(|(_, (a, b))| a != b);
        let pairs: Vec<usize> = differing.map(|(pair, _)| pair).collect();
        self.switches_of_pairs(&pairs)
    }

    pub(crate) fn switches_of_pairs(&self, pairs: &[usize]) -> Vec<usize> {
        let switches = pairs
            .iter()
            .flat_map(|&pair| &self.system.switches_of[pair]);
        let mut switches: Vec<usize> = switches.copied().collect();
        switches.sort_unstable();
        switches.dedup();
        switches
    }
}
