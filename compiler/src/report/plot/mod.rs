//! The SVG form: curves over time, and the phase plane of two states.
//!
//! Panels stand below each other over one time axis. Bands in the background
//! are modes, marks above the panels and thin lines through them are events.

pub mod animation;
mod axis;
pub mod branches;
mod canvas;
mod contour;
mod frame;
mod loglog;
mod marks;
pub mod overlay;
mod panel;
mod phase;
pub mod plane;
pub mod profile;
mod sweep;

use self::axis::Axis;
pub use self::loglog::{Curve, LogLog};
pub use self::sweep::Sweep;

use self::canvas::{Align, Canvas, INK, Stroke};
use self::frame::{FOOT, Frame, MARGIN};
use self::marks::{Bands, Legend};
use self::panel::Panel;
use crate::model::Units;
use crate::report::{History, Samples, Series, Trajectory};

/// Width of the panels of curves.
const WIDTH: f64 = 400.0;
/// Height of one panel.
const HEIGHT: f64 = 96.0;
/// Space between panels.
const GAP: f64 = 9.0;
/// Strip of the event marks.
const STRIP: f64 = 12.0;
/// Steps between ticks of time.
const TIME_TICKS: usize = 6;
/// Events before their lines would cover the curves.
const MAX_EVENT_LINES: usize = 150;
/// Events before their marks would cover each other.
const MAX_EVENT_MARKS: usize = 50;
/// Pixels between events that no eye tells apart.
const ONE_INSTANT: f64 = 0.3;
/// Side of the phase plane.
const PHASE: f64 = 270.0;

/// Height of a line with the title of a figure, and its letters.
const TITLE: f64 = 20.0;
const TITLE_SIZE: f64 = 12.0;
/// Panels and phase planes are at least this share of what they are by themselves.
const SMALLEST: f64 = 0.2;

/// A switching function of two states.
pub struct Surface<'a> {
    /// Its name.
    pub name: String,
    /// Its value.
    pub psi: Box<dyn Fn(f64, f64) -> f64 + 'a>,
}

/// Two scalars, one over the other, with the curves on which their system switches.
pub struct Phase<'a> {
    /// What goes from left to right, and from the bottom to the top, with their values at all instants.
    pub axes: [(String, Vec<f64>); 2],
    /// Whether these are entries of one quantity, which have one scale.
    pub is_of_one: bool,
    /// Switching functions of these two.
    pub surfaces: Vec<Surface<'a>>,
}

/// What is drawn of a run: curves over time, panel by panel, and phase planes on their right.
pub struct Figure<'a> {
    /// The run, with its modes and its events.
    pub trajectory: &'a Trajectory,
    /// It at as many instants as its curves need to be smooth.
    pub samples: &'a Samples,
    /// Units of what is drawn.
    pub units: &'a Units,
    /// What stands above.
    pub title: Option<&'a str>,
    /// The width of the sheet in pixels; none for that of its panels and planes.
    pub width: Option<f64>,
    /// Panels, each with what it shows.
    pub panels: Vec<Vec<&'a Series>>,
    /// Phase planes.
    pub phases: Vec<Phase<'a>>,
}

/// Where panels and phase planes are on a sheet.
struct Layout {
    /// The frames of panels, from left to right, and how high one is.
    panels: [f64; 2],
    height: f64,
    /// The upper end of the first and the lower end of the last of them, which are those of planes too.
    vertical: (f64, f64),
    /// Where each plane begins with its labels.
    planes: Vec<f64>,
    /// The width of the sheet.
    width: f64,
}

impl<'a> Figure<'a> {
    /// A panel for each state, output and control, and the phase plane of a run with two states.
    pub fn of(
        trajectory: &'a Trajectory,
        samples: &'a Samples,
        units: &'a Units,
        surfaces: Vec<Surface<'a>>,
    ) -> Figure<'a> {
        let entries = samples.states.iter().flat_map(Series::columns);
        let axes: Result<[_; 2], _> = entries.collect::<Vec<_>>().try_into();
        let axes = axes.ok().filter(|_| samples.time.len() > 1);
        Figure {
            trajectory,
            samples,
            units,
            title: None,
            width: None,
            panels: panel::arrange(samples),
            phases: match axes {
                Some(axes) => vec![Phase {
                    axes,
                    is_of_one: samples.states.len() == 1,
                    surfaces,
                }],
                None => Vec::new(),
            },
        }
    }

    /// The SVG text.
    pub fn write(&self) -> String {
        let (history, units) = (&self.trajectory.history, self.units);
        let several = &self.trajectory.several;
        let many = several.ensemble.as_ref();
        let end = self.samples.time.last().copied().unwrap_or(0.0);
        let panels = self.panels.iter();
        let panels = panels.map(|group| Panel::new(group, units, several, end));
        let measured = || several.fit.iter().flat_map(|fit| &fit.data);
        let others = measured().filter(|data| data.with.is_some());
        let panels = panels.chain(others.map(Panel::of_run));
        let panels = panels.chain(measured().map(Panel::of_residuals));
        let panels: Vec<Panel> = panels.filter(|panel| !panel.is_empty()).collect();
        let bands = Bands::new(history);
        let legend = match many {
            _ if panels.is_empty() => Legend::default(),
            Some(ensemble) => {
                Legend::of_ensemble(ensemble, panels.iter().any(Panel::has_quantiles))
            }
            None => Legend::new(history, &bands),
        };
        let share = self.share(&panels);
        let size = (PHASE * share, self.height(panels.len(), share));
        let planes = self.phases.iter();
        let planes = planes.map(|phase| phase::Plane::new(phase, units, size));
        let planes: Vec<phase::Plane> = planes.collect();
        let layout = self.layout((&panels, &planes), &legend, share);
        let (top, bottom) = layout.vertical;
        let sheet = (layout.width, bottom + FOOT + MARGIN);
        let time = &self.samples.time;
        Canvas::svg_of_width(self.width, sheet, |canvas| {
            if let Some(title) = self.title {
                let place = (0.5 * layout.width, 0.5 * (MARGIN + TITLE));
                canvas.sized_text(place, title, Align::Centre, INK, TITLE_SIZE);
            }
            if !panels.is_empty() {
                self.draw_panels(canvas, &panels, (&legend, &bands), &layout);
            }
            for (plane, left) in planes.iter().zip(&layout.planes) {
                plane.draw(canvas, (time, history), *left, (top, bottom));
            }
        })
    }

    /// The width of panels and planes as a share of what it is by itself.
    fn share(&self, panels: &[Panel]) -> f64 {
        let Some(width) = self.width else {
            return 1.0;
        };
        let size = (PHASE, self.height(panels.len(), 1.0));
        let planes = self.phases.iter();
        let planes = planes.map(|phase| phase::width_in(phase, size) + MARGIN);
        let natural = end_of_panels(panels, WIDTH) + planes.sum::<f64>();
        let in_panels = if panels.is_empty() { 0.0 } else { WIDTH };
        let frames = in_panels + PHASE * self.phases.len() as f64;
        (1.0 + (width - natural) / frames.max(1.0)).max(SMALLEST)
    }

    /// How high all panels are together, as high as a plane beside them at least.
    fn height(&self, n_panels: usize, share: f64) -> f64 {
        let gaps = GAP * (n_panels.max(1) - 1) as f64;
        let plane = match self.phases.is_empty() {
            true => 0.0,
            false => PHASE * share,
        };
        (n_panels as f64 * HEIGHT + gaps).max(plane)
    }

    fn title_height(&self) -> f64 {
        if self.title.is_some() { TITLE } else { 0.0 }
    }

    fn layout(
        &self,
        (panels, planes): (&[Panel], &[phase::Plane]),
        legend: &Legend,
        share: f64,
    ) -> Layout {
        let [left, right] = beside(panels);
        let wide = WIDTH * share;
        let mut end = end_of_panels(panels, wide);
        let mut starts = Vec::new();
        for plane in planes {
            starts.push(end);
            end += plane.width() + MARGIN;
        }
        let above = planes.iter().map(|plane| plane.legend_height() + 3.0);
        let over_panels = legend.height(wide + right) + STRIP + 3.0;
        let over_panels = if panels.is_empty() { 0.0 } else { over_panels };
        let top = MARGIN + self.title_height() + above.fold(over_panels, f64::max);
        let all = self.height(panels.len(), share);
        let gaps = GAP * (panels.len().max(1) - 1) as f64;
        Layout {
            panels: [left, left + wide],
            height: (all - gaps) / panels.len().max(1) as f64,
            vertical: (top, top + all),
            planes: starts,
            width: end,
        }
    }

    /// Panels over one axis of time, with modes, events and the legend of these.
    fn draw_panels(
        &self,
        canvas: &Canvas<'_>,
        panels: &[Panel],
        (legend, bands): (&Legend, &Bands),
        layout: &Layout,
    ) {
        let (history, instants) = (&self.trajectory.history, &self.samples.time);
        let many = self.trajectory.several.ensemble.as_ref();
        let [left, right] = layout.panels;
        let (top, bottom) = layout.vertical;
        let beside = panels.iter().map(Panel::right_space).fold(0.0, f64::max);
        let width = right - left + beside;
        legend.draw(canvas, (left, MARGIN + self.title_height()), width);
        let time = time_axis(instants).placed(left, right);
        for (k, panel) in panels.iter().enumerate() {
            let y = top + k as f64 * (layout.height + GAP);
            let frame = panel.frame(&time, (y, y + layout.height));
            // Modes and events are those of one of many runs.
            if many.is_none() {
                draw_bands(canvas, history, bands, &frame);
                draw_event_lines(canvas, history, &frame);
            }
            panel.draw(canvas, instants, many, &frame);
        }
        if many.is_none() {
            draw_event_marks(canvas, history, &time, top - STRIP / 2.0);
        }
        let whole = Frame {
            y: Axis::new(0.0, 1.0).placed(bottom, top),
            x: time,
        };
        let title = self.units.title("time");
        whole.labels_below(canvas, &whole.x.ticks(TIME_TICKS), &title);
    }
}

/// What panels need left and right of their frames.
fn beside(panels: &[Panel]) -> [f64; 2] {
    let left = panels.iter().map(Panel::left_space).fold(0.0, f64::max);
    let right = panels.iter().map(Panel::right_space).fold(0.0, f64::max);
    [MARGIN + left, right]
}

/// Where panels end whose frames are so wide, and planes begin.
fn end_of_panels(panels: &[Panel], wide: f64) -> f64 {
    let [left, right] = beside(panels);
    match panels.is_empty() {
        true => MARGIN,
        false => left + wide + right + MARGIN,
    }
}

/// From the first to the last instant, without margins.
fn time_axis(time: &[f64]) -> Axis {
    match (time.first(), time.last()) {
        (Some(&first), Some(&last)) if last > first => Axis::new(first, last),
        (Some(&only), _) => Axis::new(only, only + 1.0),
        _ => Axis::new(0.0, 1.0),
    }
}

/// One rectangle per mode; intervals too short to see are left to their neighbours.
fn draw_bands(canvas: &Canvas<'_>, history: &History, bands: &Bands, frame: &Frame) {
    let (time, [bottom, top]) = (&frame.x, frame.y.ends());
    let mut from = time.start;
    for interval in &history.modes {
        let to = time.at(interval.to.min(time.hi));
        if to - from < 0.25 {
            continue;
        }
        if let Some(color) = bands.color(&interval.mode) {
            canvas.rect((from, top), (to, bottom), color);
        }
        from = to;
    }
}

fn draw_event_lines(canvas: &Canvas<'_>, history: &History, frame: &Frame) {
    if history.events.len() > MAX_EVENT_LINES {
        return;
    }
    let grey = plotters::style::RGBColor(150, 150, 150);
    let mut places: Vec<f64> = places(history, &frame.x)
        .into_iter()
        .map(|(x, _)| x)
        .collect();
    places.dedup_by(|next, kept| (*next - *kept).abs() < 1.2);
    for x in places {
        canvas.line(&frame.vertical(x), Stroke(0.45, grey));
    }
}

fn draw_event_marks(canvas: &Canvas<'_>, history: &History, time: &Axis, y: f64) {
    let mut places = places(history, time);
    let is_crowded = places.len() > MAX_EVENT_MARKS;
    if is_crowded {
        places.dedup_by(|next, kept| next.0 - kept.0 < 5.0);
    }
    let size = if is_crowded { 2.2 } else { 3.2 };
    // Kinds of one instant stand side by side.
    let (mut instant, mut shift) = (f64::NEG_INFINITY, 0.0);
    for (x, kind) in places {
        match x - instant < ONE_INSTANT {
            true => shift += 2.0 * size,
            false => (instant, shift) = (x, 0.0),
        }
        marks::mark(canvas, kind, (x + shift, y), size);
    }
}

/// Where events are marked: those of one kind at one place once, and none that are as many as there are periods.
fn places(history: &History, time: &Axis) -> Vec<(f64, super::EventKind)> {
    let mut places: Vec<(f64, super::EventKind)> = Vec::new();
    for event in &history.events {
        let x = time.at(event.time);
        let same = |(other, kind): &(f64, _)| (x - other).abs() < 0.3 && *kind == event.kind;
        let is_sample = event.kind == super::EventKind::Sample;
        let inside = (time.lo..=time.hi).contains(&event.time) && !is_sample;
        if inside && !places.iter().rev().take(8).any(same) {
            places.push((x, event.kind));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::{Figure, Surface};
    use crate::model::Units;
    use crate::report::{Series, Trajectory, sample};

    fn write(trajectory: &Trajectory, surfaces: Vec<Surface<'_>>) -> String {
        Figure::of(trajectory, &trajectory.samples, &Units::default(), surfaces).write()
    }

    fn count(svg: &str, part: &str) -> usize {
        svg.matches(part).count()
    }

    #[test]
    fn two_states_get_panels_and_a_phase_plane() {
        let circle = Surface {
            name: "c < \"1\"".into(),
            psi: Box::new(|x, y| x * x + y * y - 1.0),
        };
        let svg = write(&sample::oscillator(), vec![circle]);
        for text in [
            "time", "inside", "outside", "crossing", "start", "end", "x[2]",
        ] {
            assert!(svg.contains(&format!(">\n{text}\n<")), "{text} is missing");
        }
        assert!(svg.contains("c &lt; &quot;1&quot; = 0"));
        assert!(!svg.contains("NaN"));
    }

    /// Two states of a part are no entries of one, though their names have one index.
    #[test]
    fn states_of_a_part_have_scales_of_their_own() {
        let mut trajectory = sample::oscillator();
        let [x] = &trajectory.samples.states[..] else {
            panic!("one vector")
        };
        let columns: Vec<_> = x.columns().map(|(_, values)| values).collect();
        let mut named = |names: [&str; 2]| {
            let states = names.iter().zip(&columns).map(|(name, values)| Series {
                name: (*name).to_owned(),
                shape: Vec::new(),
                values: values.clone(),
            });
            trajectory.samples.states = states.collect();
            write(&trajectory, Vec::new())
        };
        let of_part = named(["b[1].x", "b[1].v"]);
        assert_eq!(
            of_part.replace("b[1].", "b(1)."),
            named(["b(1).x", "b(1).v"])
        );
    }

    #[test]
    fn many_modes_share_one_colour_in_the_legend() {
        let mut trajectory = sample::shapes();
        let few = count(&write(&trajectory, Vec::new()), "<text");
        let interval = |k: usize| crate::report::ModeInterval {
            from: k as f64 / 50.0,
            to: (k + 1) as f64 / 50.0,
            mode: format!("mode {k}"),
            regions: Vec::new(),
            between: Vec::new(),
            sides: Vec::new(),
            contacts: Vec::new(),
        };
        trajectory.history.modes = (0..50).map(interval).collect();
        let svg = write(&trajectory, Vec::new());
        assert_eq!(count(&svg, "<text"), few + 6);
        assert!(svg.contains("45 other modes"));
    }

    #[test]
    fn values_that_are_not_finite_interrupt_a_curve() {
        let mut trajectory = sample::oscillator();
        trajectory.samples.states[0].values[2] = f64::NAN;
        trajectory.samples.outputs[0].values = vec![f64::INFINITY; 3];
        let svg = write(&trajectory, Vec::new());
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn an_empty_run_is_an_empty_sheet() {
        assert!(write(&Default::default(), Vec::new()).starts_with("<svg"));
    }
}
