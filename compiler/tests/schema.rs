//! What programs read of `nsdc` obeys the schemas of `compiler/schema`.

use std::fs;
use std::path::{Path, PathBuf};

use jsonschema::Validator;
use serde_json::Value;

use crate::terminal::{folder, nsdc};

fn schema(name: &str) -> Validator {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("schema/{name}.json"));
    let text = fs::read_to_string(&path).expect("there is such a schema");
    let schema = serde_json::from_str(&text).expect("it is JSON");
    jsonschema::draft202012::meta::validate(&schema).expect("it is a schema");
    jsonschema::validator_for(&schema).expect("its references lead somewhere")
}

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../examples/{name}"))
}

/// The objects that a command writes, one on each line, all of which obey a schema.
fn obeys(name: &str, args: &[&str]) -> Vec<Value> {
    let ran = nsdc(&folder(&format!("schema_{name}")), args);
    let schema = schema(name);
    let read = |line: &str| {
        let value: Value = serde_json::from_str(line).expect("a line is an object");
        let errors: Vec<String> = (schema.iter_errors(&value))
            .map(|error| format!("{error} at {}", error.instance_path()))
            .collect();
        assert!(errors.is_empty(), "{args:?}: {errors:?}");
        value
    };
    let found: Vec<Value> = ran.out.lines().map(read).collect();
    assert!(!found.is_empty(), "{args:?}: {}", ran.err);
    found
}

/// Every optional field is in one of these.
#[test]
fn runs() {
    let folder = folder("schema_models");
    let model = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).expect("the folder is writable");
        path.display().to_string()
    };
    let all = model(
        "all.nsd",
        "model ball { state h = 1; state v = 0; h' = v;
           mechanics h, v { mass = 1; force = -9.81; contact floor { gap = h; restitution = 0.5; } } }
         model lag { state x = 0.5; state u = 0; x' = u; u' = (-sign(x) - u)/0.01; }
         model tank { state M[2, 2] = [1, 2; 3, 4]; M' = -M; param p in [0, 2] = 1; output n = M[1, 1]; }
         model drive { param p in [0, 2] = 1; state x = 1; control u in [-1, 1] = 0; x' = p*u; }
         model noise { state x = 0; x' = -x; }
         model block { state x = 1; state v = -1; x' = v; v' = 1.2 - s;
           switch s = sign(v) sliding nonlinear; hidden on s { v' += -2*pi*s*(1 - s^2); } }
         model blows { state x = 1; x' = x^2; }
         simulate bounces of ball { horizon 1; }
         simulate chatters of lag { horizon 2; tolerance 1e-3; method event { max_events = 200000; } on chattering slide; }
         simulate empties of tank { horizon 1; }
         simulate shakes of noise { horizon 1; perturb every 0.1 by sphere(0.1) seed 1; runs 3; }
         simulate slips of block { horizon 4; }
         simulate fails of blows { horizon 2; }
         optimize goes of drive { horizon 1; intervals 3; free { p; } subject to { x >= -5; }
           minimize final((x - 0.2)^2) + integral(u^2); }",
    );
    let mut found = obeys("run", &["run", &all, "--json", "-"]);
    let element = model(
        "element.nsd",
        "model m { state x = 1; x' = -sign(x); } simulate s of m { horizon 2; method fesd; }",
    );
    found.extend(obeys(
        "run",
        &["run", &element, "--json", "-", "--multipliers"],
    ));
    for field in ["optimum", "ensemble", "averaged", "multipliers"] {
        let has = |run: &Value| run.get(field).is_some();
        assert!(found.iter().any(has), "{field} is in none of them");
    }
    let chose = |event: &Value| event.get("sliding").is_some();
    let mut events = found
        .iter()
        .flat_map(|run| run["events"].as_array().into_iter().flatten());
    assert!(events.any(chose), "no event tells sliding modes");
    // A field that nobody has written down is found.
    let mut run = found.swap_remove(0);
    run["more"] = Value::Null;
    assert!(!schema("run").is_valid(&run));
}

#[test]
fn diagnostics() {
    let folder = folder("schema_wrong");
    let path = folder.join("wrong.nsd");
    let text = "model m { state x = 1; x' = clipp(x)\n state y = 0; y' = 1; let c = x - x; }";
    fs::write(&path, text).expect("the folder is writable");
    obeys(
        "check",
        &["check", &path.display().to_string(), "--json", "-"],
    );
}

#[test]
fn tests_and_roads() {
    let path = example("oscillator.nsd").display().to_string();
    obeys("test", &["test", &path, "--json", "-"]);
    obeys("verify", &["verify", &path, "--json", "-"]);
    let path = example("tutorial_ocp.nsd").display().to_string();
    obeys("verify", &["verify", &path, "--json", "-"]);
}

#[test]
fn sweeps() {
    let path = example("oscillator.nsd").display().to_string();
    obeys(
        "sweep",
        &[
            "sweep",
            &path,
            "crossing",
            "--over",
            "x[2]=[0.1, 0.2]",
            "--json",
            "-",
        ],
    );
}

#[test]
fn problems() {
    let path = example("two_minima.nl").display().to_string();
    obeys("solve", &["solve", &path, "--json", "-"]);
}
