//! The SVG form: curves over time, and the phase plane of two states.
//!
//! Panels stand below each other over one time axis. Bands in the background
//! are modes, marks above the panels and thin lines through them are events.

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

use self::canvas::{Canvas, Stroke};
use self::frame::{FOOT, Frame, MARGIN};
use self::marks::{Bands, Legend};
use self::panel::Panel;
use crate::model::Units;
use crate::report::Trajectory;

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
/// Side of the phase plane.
const PHASE: f64 = 270.0;

/// A switching function of two states.
pub struct Surface<'a> {
    /// Its name.
    pub name: String,
    /// Its value.
    pub psi: Box<dyn Fn(f64, f64) -> f64 + 'a>,
}

/// The figure of a trajectory that has been refined as far as curves shall be smooth.
pub fn write(trajectory: &Trajectory, units: &Units, surfaces: &[Surface<'_>]) -> String {
    let panels = panel::arrange(trajectory, units);
    let bands = Bands::new(trajectory);
    let legend = match &trajectory.ensemble {
        Some(ensemble) => Legend::of_ensemble(ensemble),
        None => Legend::new(trajectory, &bands),
    };
    let has_phase_plane = trajectory.n_states() == 2 && trajectory.time.len() > 1;

    let left = MARGIN + panels.iter().map(Panel::left_space).fold(0.0, f64::max);
    let right = panels.iter().map(Panel::right_space).fold(0.0, f64::max);
    let n_panels = panels.len() as f64;
    let height = match has_phase_plane {
        true => HEIGHT.max((PHASE - GAP * (n_panels - 1.0)) / n_panels.max(1.0)),
        false => HEIGHT,
    };
    let legend_width = WIDTH + right;
    let top = MARGIN + legend.height(legend_width) + STRIP + 3.0;
    let bottom = top + n_panels * height + (n_panels - 1.0).max(0.0) * GAP;
    let curves_end = left + WIDTH + right + MARGIN;

    let plane = has_phase_plane
        .then(|| phase::Plane::new(trajectory, units, surfaces, (PHASE, bottom - top)));
    let width = curves_end + plane.as_ref().map_or(0.0, |plane| plane.width() + MARGIN);
    let needed = plane
        .as_ref()
        .map_or(0.0, |plane| MARGIN + plane.legend_height() + 3.0);
    let down = (needed - top).max(0.0);
    let (top, bottom) = (top + down, bottom + down);

    Canvas::svg(width, bottom + FOOT + MARGIN, |canvas| {
        legend.draw(canvas, (left, MARGIN), legend_width);
        let time = time_axis(trajectory).placed(left, left + WIDTH);
        for (k, panel) in panels.iter().enumerate() {
            let y = top + k as f64 * (height + GAP);
            let frame = panel.frame(&time, (y, y + height));
            // Modes and events are those of one of many runs.
            if trajectory.ensemble.is_none() {
                draw_bands(canvas, trajectory, &bands, &frame);
                draw_event_lines(canvas, trajectory, &frame);
            }
            panel.draw(canvas, trajectory, &frame);
        }
        if trajectory.ensemble.is_none() {
            draw_event_marks(canvas, trajectory, &time, top - STRIP / 2.0);
        }
        let whole = Frame {
            y: Axis::new(0.0, 1.0).placed(bottom, top),
            x: time,
        };
        whole.labels_below(canvas, &whole.x.ticks(TIME_TICKS), &units.title("time"));
        if let Some(plane) = &plane {
            plane.draw(canvas, trajectory, curves_end, (top, bottom));
        }
    })
}

/// From the first to the last instant, without margins.
fn time_axis(trajectory: &Trajectory) -> Axis {
    match (trajectory.time.first(), trajectory.time.last()) {
        (Some(&first), Some(&last)) if last > first => Axis::new(first, last),
        (Some(&only), _) => Axis::new(only, only + 1.0),
        _ => Axis::new(0.0, 1.0),
    }
}

/// One rectangle per mode; intervals too short to see are left to their neighbours.
fn draw_bands(canvas: &Canvas<'_>, trajectory: &Trajectory, bands: &Bands, frame: &Frame) {
    let (time, [bottom, top]) = (&frame.x, frame.y.ends());
    let mut from = time.start;
    for interval in &trajectory.modes {
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

fn draw_event_lines(canvas: &Canvas<'_>, trajectory: &Trajectory, frame: &Frame) {
    if trajectory.events.len() > MAX_EVENT_LINES {
        return;
    }
    let grey = plotters::style::RGBColor(150, 150, 150);
    let mut places: Vec<f64> = places(trajectory, &frame.x)
        .into_iter()
        .map(|(x, _)| x)
        .collect();
    places.dedup_by(|next, kept| (*next - *kept).abs() < 1.2);
    for x in places {
        canvas.line(&frame.vertical(x), Stroke(0.45, grey));
    }
}

fn draw_event_marks(canvas: &Canvas<'_>, trajectory: &Trajectory, time: &Axis, y: f64) {
    let mut places = places(trajectory, time);
    let is_crowded = places.len() > MAX_EVENT_MARKS;
    if is_crowded {
        places.dedup_by(|next, kept| next.0 - kept.0 < 5.0);
    }
    let size = if is_crowded { 2.2 } else { 3.2 };
    for (x, kind) in places {
        marks::mark(canvas, kind, (x, y), size);
    }
}

/// Where events are marked: those of one kind at one place once.
fn places(trajectory: &Trajectory, time: &Axis) -> Vec<(f64, super::EventKind)> {
    let mut places: Vec<(f64, super::EventKind)> = Vec::new();
    for event in &trajectory.events {
        let x = time.at(event.time);
        let same = |(other, kind): &(f64, _)| (x - other).abs() < 0.3 && *kind == event.kind;
        let inside = (time.lo..=time.hi).contains(&event.time);
        if inside && !places.iter().rev().take(8).any(same) {
            places.push((x, event.kind));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::{Surface, write};
    use crate::model::Units;
    use crate::report::sample;

    fn count(svg: &str, part: &str) -> usize {
        svg.matches(part).count()
    }

    #[test]
    fn two_states_get_panels_and_a_phase_plane() {
        let circle = Surface {
            name: "c < \"1\"".into(),
            psi: Box::new(|x, y| x * x + y * y - 1.0),
        };
        let svg = write(&sample::oscillator(), &Units::default(), &[circle]);
        for text in [
            "time", "inside", "outside", "crossing", "start", "end", "x[2]",
        ] {
            assert!(svg.contains(&format!(">\n{text}\n<")), "{text} is missing");
        }
        assert!(svg.contains("c &lt; &quot;1&quot; = 0"));
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn many_modes_share_one_colour_in_the_legend() {
        let mut trajectory = sample::shapes();
        let few = count(&write(&trajectory, &Units::default(), &[]), "<text");
        let interval = |k: usize| crate::report::ModeInterval {
            from: k as f64 / 50.0,
            to: (k + 1) as f64 / 50.0,
            mode: format!("mode {k}"),
            regions: Vec::new(),
            between: Vec::new(),
            sides: Vec::new(),
            contacts: Vec::new(),
        };
        trajectory.modes = (0..50).map(interval).collect();
        let svg = write(&trajectory, &Units::default(), &[]);
        assert_eq!(count(&svg, "<text"), few + 6);
        assert!(svg.contains("45 other modes"));
    }

    #[test]
    fn values_that_are_not_finite_interrupt_a_curve() {
        let mut trajectory = sample::oscillator();
        trajectory.states[0].values[2] = f64::NAN;
        trajectory.outputs[0].values = vec![f64::INFINITY; 3];
        let svg = write(&trajectory, &Units::default(), &[]);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn an_empty_run_is_an_empty_sheet() {
        assert!(write(&Default::default(), &Units::default(), &[]).starts_with("<svg"));
    }
}
