//! `nsdc plot`: several runs and what was measured in one figure.

use std::fs;

use crate::terminal::{folder, nsdc};

const MODELS: &str = "
model slider { param k = 4; state q[2] = [1, 0]; output energy = dot(q, q); q' = [q[2], -k*q[1] - sign(q[2])]; }
model other { state q[2] = [0.5, 0]; state T = 1; q' = [-q[1], 0]; T' = 0; }
simulate swings of slider { horizon 2; }
simulate stiff of slider { with { k = 9; } horizon 2; }
simulate falls of other { horizon 1; }
simulate blows of up { horizon 2; }
model up { state x = 1; x' = x^2; }
";

#[test]
fn experiments_and_data_share_panels() {
    let folder = folder("plot");
    fs::write(folder.join("m.nsd"), MODELS).expect("the folder is writable");
    let data = "t,q[1],unknown\n0,1.01,2\n0.5,,3\n1,-0.5,4\n";
    fs::write(folder.join("d.csv"), data).expect("the folder is writable");
    let plot = |args: &[&str]| nsdc(&folder, &[&["plot", "m.nsd"], args].concat());
    let has = |svg: &str, text: &str| svg.contains(&format!(">\n{text}\n<"));

    let drawn = plot(&["swings", "falls", "--data", "d.csv"]);
    assert_eq!((drawn.status, drawn.err.as_str()), (0, ""));
    for text in [
        "swings", "falls", "d.csv", "q[1]", "q[2]", "energy", "T", "time",
    ] {
        assert!(has(&drawn.out, text), "{text}");
    }
    // What no run has is not drawn; an empty cell is no point.
    assert!(!has(&drawn.out, "unknown"));
    assert_eq!(drawn.out.matches("<circle").count(), 3);

    let some = plot(&["swings", "stiff", "--only", "q", "--output", "f.svg"]);
    assert_eq!((some.status, some.out.as_str()), (0, ""));
    let svg = fs::read_to_string(folder.join("f.svg")).expect("it was written");
    assert!(has(&svg, "q[1]") && has(&svg, "q[2]") && !has(&svg, "energy"));

    // What a run has reached is drawn.
    let failed = plot(&["blows"]);
    assert_eq!(failed.status, 2, "{}", failed.err);
    assert!(has(&failed.out, "blows") && failed.err.contains("E0706"));
    for (args, status, told) in [
        (&["swing"][..], 1, "`swings`"),
        (&["swings", "--only", "Q"], 1, "no quantity `Q`"),
        (&["swings", "--data", "none.csv"], 1, "none.csv"),
        (&["swings", "--data", "m.nsd"], 1, "m.nsd"),
        (&["swings", "--output", "f.png"], 64, ".svg"),
    ] {
        let ran = plot(args);
        assert_eq!((ran.status, ran.out.as_str()), (status, ""), "{args:?}");
        assert!(ran.err.contains(told), "{args:?}: {}", ran.err);
    }
    for (text, told) in [
        ("t,Q\n0,1\n", "`q[1]`, `q[2]`, `energy`"),
        ("t,q[1]\n,1\n", "line 2"),
        ("t,q[1]\n0,inf\n", "line 2"),
    ] {
        fs::write(folder.join("bad.csv"), text).expect("the folder is writable");
        let bad = plot(&["swings", "--data", "bad.csv"]);
        assert_eq!((bad.status, bad.out.as_str()), (1, ""), "{text}");
        assert!(bad.err.contains(told), "{}", bad.err);
    }
    let measured_alone = plot(&["swings", "--data", "d.csv", "--only", "unknown"]);
    assert_eq!(measured_alone.status, 1, "{}", measured_alone.out);
    fs::write(folder.join("bad.csv"), "t,q[1]\n0,one\n").expect("the folder is writable");
    let bad = plot(&["swings", "--data", "bad.csv"]);
    assert!(
        bad.err.contains("line 2") && bad.err.contains("`one`"),
        "{}",
        bad.err
    );
}

/// An experiment that says what its figure shows is drawn so, beside what others have; all of it where something is asked for.
#[test]
fn a_plot_of_an_experiment_is_its_part_of_the_figure() {
    let folder = folder("plot_part");
    let model = MODELS.replace(
        "horizon 2; }\nsimulate stiff",
        "horizon 2; plot { -k*q[1]; q; phase q[1], q[2]; } }\nsimulate stiff",
    );
    fs::write(folder.join("m.nsd"), model).expect("the folder is writable");
    let has = |svg: &str, text: &str| svg.contains(&format!(">\n{text}\n<"));
    let drawn = |args: &[&str]| {
        let ran = nsdc(&folder, &[&["plot", "m.nsd", "swings"], args].concat());
        assert_eq!((ran.status, ran.err.as_str()), (0, ""));
        ["-k*q[1]", "q[1]", "q[2]", "energy", "T"].map(|text| has(&ran.out, text))
    };
    assert_eq!(drawn(&[]), [true, true, true, false, false]);
    assert_eq!(drawn(&["falls"]), [true, true, true, false, true]);
    assert_eq!(
        drawn(&["--only", "energy"]),
        [false, false, false, true, false]
    );
    assert_eq!(
        drawn(&["--only=-k*q[1]"]),
        [true, false, false, false, false]
    );
}

/// Heights in metres that follow a rule without a unit.
const FALL: &str = "
model fall {
  param g : m/s^2 = 9.81; param k = 1;
  state q[2] : m = [1, 2]; state v : m/s = 0; state n = 0;
  output share : 1 = n; output energy : J/kg = v^2/2 + g*q[1]; output twice = 2*n;
  q' = [v, v]; v' = -g; n' = k;
}
simulate falls of fall { horizon 0.5; output q, v, n, share, energy, twice; }
simulate moves of fall { horizon 0.5; output q; }
model other { state q[2] : m = [1, 2]; state v : m = 0; state energy = 1; state n : 1 = 0; q' = [1, 0]; v' = 1; energy' = 1; n' = 1; }
simulate moved of other { horizon 0.5; }
model bare { state q[2] = [1, 2]; q' = [1, 0]; }
simulate plain of bare { horizon 0.5; }
";

#[test]
fn axes_have_the_units_of_the_model() {
    let folder = folder("plot_units");
    fs::write(folder.join("m.nsd"), FALL).expect("the folder is writable");
    let has = |svg: &str, text: &str| svg.contains(&format!(">\n{text}\n<"));
    let drawn = |args: &[&str], texts: &[&str]| {
        let ran = nsdc(&folder, args);
        assert_eq!((ran.status, ran.err.as_str()), (0, ""));
        for text in texts {
            assert!(has(&ran.out, text), "{args:?}: {text}");
        }
    };
    let run = ["run", "m.nsd", "falls", "--plot", "-"];
    // A pure number has no unit.
    let common = [
        "time [s]",
        "v [m/s]",
        "n",
        "share",
        "energy [J/kg]",
        "twice",
    ];
    drawn(&run, &[&common[..], &["q [m]", "q[1]", "q[2]"]].concat());
    // The phase plane.
    let run = ["run", "m.nsd", "moves", "--plot", "-"];
    drawn(&run, &["time [s]", "q [m]", "q[1] [m]", "q[2] [m]"]);
    let entries = ["q[1] [m]", "q[2] [m]"];
    drawn(
        &["plot", "m.nsd", "falls"],
        &[&common[..], &entries].concat(),
    );
    // What has several units in the models of a figure, or one in some of them alone, is without.
    let several = [
        "time [s]", "q[1] [m]", "q[2] [m]", "v", "energy", "n", "share",
    ];
    drawn(&["plot", "m.nsd", "falls", "moved"], &several);
    let none = ["time", "q[1]", "q[2]", "v [m/s]", "energy [J/kg]"];
    drawn(&["plot", "m.nsd", "falls", "plain"], &none);
    let sweep = ["sweep", "m.nsd", "falls", "--plot", "-", "--over"];
    let ends = [
        "v at end [m/s]",
        "q[2] at end [m]",
        "n at end",
        "twice at end",
    ];
    let over = |axis: &'static str| [&sweep[..], &[axis]].concat();
    drawn(&over("g=1:2:3"), &[&ends[..], &["g [m/s^2]"]].concat());
    drawn(&over("q[2]=1:2:3"), &[&ends[..], &["q[2] [m]"]].concat());
    drawn(&over("k=1:2:3"), &[&ends[..], &["k"]].concat());
}

/// A wheel that is braked, with a figure of its own.
const WHEEL: &str = "
model wheel {
  param torque = 2; state speed : 1/s = 3; state angle[2] = [0, 1]; state unused = 0;
  let loss = torque*sign(speed); signal wind = 0.5*time;
  speed' = -loss; angle' = [speed, 0]; unused' = 1;
}
simulate drawn of wheel {
  horizon 2; output angle every 1;
  plot { speed, 2*speed; loss; wind; torque; phase speed, angle[1]; phase angle[1], angle[2];
         title \"A <brake>\"; width 20 cm; }
}
simulate titled of wheel { horizon 2; output speed; plot { title \"Stops\"; width 300 px; } }
simulate narrow of wheel { horizon 2; plot { speed; phase speed, loss; width 10 mm; } }
simulate plane of wheel { horizon 2; plot { phase speed, loss; } }
model rubs { state x = 1; state v = 0; x' = v; v' = -x - 0.1*sign(v + 0.5); }
simulate usual of rubs { horizon 6; plot { phase x, v; } }
simulate turned of rubs { horizon 6; plot { phase v, x; } }
simulate other of rubs { horizon 6; plot { phase v, 2*x; } }
model shaken { state v = 1; v' = -v; }
simulate some of shaken { horizon 1; perturb every 0.1 by gauss(0.1); runs 3; output v; plot { v; } }
simulate none of shaken { horizon 1; perturb every 0.1 by gauss(0.1); runs 3; output v; plot { v^2; } }
";

#[test]
fn a_plot_says_what_a_figure_shows() {
    let folder = folder("plot_clause");
    fs::write(folder.join("m.nsd"), WHEEL).expect("the folder is writable");
    let has = |svg: &str, text: &str| svg.contains(&format!(">\n{text}\n<"));
    let drawn = |experiment: &str| {
        let ran = nsdc(&folder, &["run", "m.nsd", experiment, "--plot", "-"]);
        assert_eq!((ran.status, ran.err.as_str()), (0, ""));
        ran.out
    };
    let width = |svg: &str| {
        let text = svg
            .split("width=\"")
            .nth(1)
            .and_then(|rest| rest.split('"').next());
        let width = text.and_then(|text| text.parse::<f64>().ok());
        width.expect("a figure has a width")
    };
    let svg = drawn("drawn");
    for text in [
        "2*speed",
        "loss",
        "wind",
        "torque",
        "time [s]",
        "speed [1/s]",
        "angle[1]",
    ] {
        assert!(has(&svg, text), "{text}");
    }
    assert!(has(&svg, "A &lt;brake&gt;") && !has(&svg, "unused"));
    assert!((width(&svg) - 20.0 * 96.0 / 2.54).abs() < 1e-9);
    // What is drawn is in no table, and is kept for the figure.
    let ran = nsdc(&folder, &["run", "m.nsd", "drawn", "--csv", "-"]);
    assert_eq!(ran.out.lines().next(), Some("time,angle[1],angle[2]"));
    assert_eq!(ran.out.lines().count(), 4);

    let svg = drawn("titled");
    assert!(has(&svg, "Stops") && has(&svg, "speed [1/s]") && width(&svg) == 300.0);
    // What does not fit is scaled.
    assert!((width(&drawn("narrow")) - 96.0 / 25.4 * 10.0).abs() < 1e-9);
    let svg = drawn("plane");
    assert!(has(&svg, "start") && has(&svg, "loss") && !has(&svg, "time [s]"));

    // The curve v = -1/2 lies, or stands where the axes are the other way round.
    let curve = |svg: &str| {
        let of_curve = |line: &&str| line.starts_with("<polyline") && line.contains("#6E6E6E");
        let line = svg.lines().find(of_curve)?.to_owned();
        let points = line.split("points=\"").nth(1)?.split('"').next()?;
        let ends = points.split_whitespace().map(|point| point.split_once(','));
        let ends = ends.map(|point| Some((point?.0.parse().ok()?, point?.1.parse().ok()?)));
        ends.collect::<Option<Vec<(f64, f64)>>>()
    };
    let lies = |points: &[(f64, f64)]| points.iter().all(|p| (p.1 - points[0].1).abs() <= 2.0);
    let stands = |points: &[(f64, f64)]| points.iter().all(|p| (p.0 - points[0].0).abs() <= 2.0);
    let [usual, turned] = ["usual", "turned"].map(|name| curve(&drawn(name)).expect("a curve"));
    assert!(lies(&usual) && !stands(&usual) && stands(&turned) && !lies(&turned));
    assert_eq!(curve(&drawn("other")), None);

    // Quantiles are those of what the runs report.
    let median = "median of 3 runs";
    assert!(has(&drawn("some"), median) && has(&drawn("none"), "run with seed 1"));
    assert!(!has(&drawn("none"), median));
}

/// x = c exp(-t) of c = 1 and 2: what was measured of the second run stands on a curve of its own.
#[test]
fn runs_of_a_fit_are_curves_with_what_was_measured_of_them() {
    let folder = folder("plot-fit");
    let text = "model decay { param k = 2; state x : m = 1; x' = -k*x; }
        fit f of decay { horizon 2; free { k; }
          data \"d.csv\" { x -> one; }
          data \"d.csv\" with { x = 2; } { x -> two; } }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let rows = [0.0f64, 1.0, 2.0].map(|t| format!("{t},{},{}\n", (-t).exp(), 2.0 * (-t).exp()));
    let data = format!("t,one,two\n{}", rows.concat());
    fs::write(folder.join("d.csv"), data).expect("the folder is writable");
    let drawn = nsdc(&folder, &["plot", "m.nsd"]);
    assert_eq!((drawn.status, drawn.err.as_str()), (0, ""));
    for text in [
        "f",
        "f, x = 2",
        "one of d.csv",
        "two of d.csv, x = 2",
        "x [m]",
    ] {
        assert!(drawn.out.contains(&format!(">\n{text}\n<")), "{text}");
    }
    // Three points of each, and two in the legend.
    assert_eq!(drawn.out.matches("<circle").count(), 8);
}
