//! The CSV forms: values, one line per instant and one column per scalar entry, and events, one line each.
//!
//! Numbers round-trip. Names that hold a comma, such as `R[1,2]`, are quoted.

use crate::report::{History, Samples, Series};

/// Header `time,x[1],x[2],...` and one line per instant: states, outputs, controls, and derivatives that were asked for
/// as `d x[1]/d mu`, empty where they are not known.
pub fn write(samples: &Samples) -> String {
    let derivatives = || {
        let all = samples.sensitivities.iter();
        all.flat_map(|by| {
            by.states
                .iter()
                .chain(&by.outputs)
                .map(move |of| (of, &by.to))
        })
    };
    let columns: Vec<&Series> = samples.series().collect();
    let mut text = csv::Writer::from_writer(Vec::new());

    let names = samples.series().flat_map(|series| series.entry_names());
    let derived = derivatives().flat_map(|(series, to)| {
        let entries = series.entry_names().into_iter();
        entries.map(move |entry| format!("d {entry}/d {to}"))
    });
    let names = names.chain(derived);
    // Writing to memory does not fail and every record has the same length.
    let _ = text.write_record(std::iter::once("time".to_owned()).chain(names));
    for (k, time) in samples.time.iter().enumerate() {
        let values = columns.iter().flat_map(|series| series.at(k));
        // The shortest text that reads back as the same number, with an exponent where it is shorter.
        let values = std::iter::once(time).chain(values);
        let values = values.map(|value| format!("{value:?}"));
        // What is not known is left empty.
        let known = derivatives().flat_map(|(series, _)| series.at(k));
        let known = known.map(|value| match value.is_nan() {
            true => String::new(),
            false => format!("{value:?}"),
        });
        let _ = text.write_record(values.chain(known));
    }

    finished(text)
}

/// Header `time,kind,surface,from,to` and one line per event, the modes before and after it.
pub fn events(history: &History) -> String {
    let mut text = csv::Writer::from_writer(Vec::new());
    let _ = text.write_record(["time", "kind", "surface", "from", "to"]);
    for event in &history.events {
        let time = format!("{:?}", event.time);
        let words = [&*event.surface, &event.from, &event.to];
        let _ = text.write_record([&*time, event.kind.as_str()].into_iter().chain(words));
    }
    finished(text)
}

fn finished(text: csv::Writer<Vec<u8>>) -> String {
    let bytes = text.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::{events, write};
    use crate::report::sample;

    #[test]
    fn one_column_per_entry_and_one_line_per_instant() {
        insta::assert_snapshot!(write(&sample::oscillator().samples), @"
time,x[1],x[2],c
0.0,0.36787944117144233,0.0,-0.8646647167633873
1.0,1.0,0.0,0.0
1.5,-1.6487212707,0.25,1.7807818284
");
    }

    #[test]
    fn one_line_per_event() {
        let mut trajectory = sample::oscillator();
        trajectory
            .history
            .events
            .push(trajectory.history.events[0].clone());
        trajectory.history.events[1].surface = "max(a, b)".to_owned();
        insta::assert_snapshot!(events(&trajectory.history), @r#"
time,kind,surface,from,to
1.0,crossing,c,inside,outside
1.0,crossing,"max(a, b)",inside,outside
"#);
    }

    #[test]
    fn names_with_commas_are_quoted() {
        insta::assert_snapshot!(write(&sample::shapes().samples), @r#"
time,q,"R[1,1]","R[1,2]","R[2,1]","R[2,2]"
0.0,1.5,1.0,2.0,3.0,4.0
1.0,2.5,5.0,6.0,7.0,8.0
"#);
    }

    #[test]
    fn numbers_round_trip() {
        let mut trajectory = sample::shapes();
        let awkward = [0.1 + 0.2, 1e-300, f64::MAX, -0.0];
        for value in awkward {
            trajectory.samples.states[0].values[0] = value;
            let text = write(&trajectory.samples);
            let field = text.lines().nth(1).unwrap().split(',').nth(1).unwrap();
            assert_eq!(field.parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
    }
}
