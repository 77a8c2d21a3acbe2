//! `nsdc solve`

mod folder;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use nsd_solver::optimization::mpcc::Observer;

use crate::cli::args::{Log, SolveArgs};
use crate::cli::files::{Form, Sink, is_standard};
use crate::cli::iterations::Iterations;
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::Diagnostics;
use crate::nl::{self, Names, Report, Settings};
use crate::report::Status;
use crate::source::SourceMap;

/// Extension of problem files.
const EXTENSION: &str = "nl";
/// Where AMPL puts the options of a solver of this name.
const OPTIONS: &str = "nsdc_options";

/// Solves a file or all files of a folder.
pub fn run(args: &SolveArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let is_folder = !is_standard(&args.path) && args.path.is_dir();
    if let Some(message) = misuse(args, is_folder) {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    let results = [&args.json, &args.csv, &args.plot];
    let results = results.into_iter().filter_map(|path| path.as_deref());
    if !files::foresee(results, streams)? {
        return Ok(Exit::Wrong);
    }
    let settings = match settings(args) {
        Ok(settings) => settings,
        Err(error) => {
            writeln!(streams.err, "error: {error}")?;
            return Ok(Exit::Usage);
        }
    };
    match is_folder {
        true => folder::run(args, &settings, streams),
        false => one(args, &settings, streams),
    }
}

/// The arguments of a call by AMPL, `nsdc stub -AMPL ..`, as those of `nsdc solve`; others as they are.
pub fn without_ampl(mut args: Vec<OsString>) -> Vec<OsString> {
    // Clients ask any solver for its version in this way.
    if args.len() == 2 && args[1] == "-v" {
        args[1] = "--version".into();
    }
    if let Some(flag) = args.iter_mut().skip(2).find(|arg| *arg == "-AMPL") {
        *flag = "--ampl".into();
        if args[1] != "solve" {
            args.insert(1, "solve".into());
        }
    }
    args
}

/// What is wrong with a combination of arguments.
fn misuse(args: &SolveArgs, is_folder: bool) -> Option<String> {
    if !is_folder && (args.csv.is_some() || args.plot.is_some() || args.jobs.is_some()) {
        return Some("`--csv`, `--plot` and `--jobs` are for folders".into());
    }
    if args.ampl && is_standard(&args.path) {
        return Some("`-AMPL` writes its solution beside a file, not standard input".into());
    }
    if args.ampl && is_folder {
        return Some(format!(
            "`-AMPL` takes a file, and `{}` is a folder",
            args.path.display()
        ));
    }
    let targets = [&args.json, &args.csv, &args.plot].into_iter().flatten();
    if targets.filter(|target| is_standard(target)).count() > 1 {
        return Some("only one of `--json`, `--csv`, `--plot` can write to standard output".into());
    }
    files::misnamed([
        (args.json.as_deref(), Form::Json),
        (args.csv.as_deref(), Form::Csv),
        (args.plot.as_deref(), Form::Svg),
    ])
}

/// Options of the command line, and before them those of AMPL.
fn settings(args: &SolveArgs) -> Result<Settings, nl::BadOption> {
    let mut settings = Settings::default();
    if args.ampl {
        if let Some(options) = std::env::var_os(OPTIONS) {
            settings.add(&options.to_string_lossy())?;
        }
        for option in &args.options {
            settings.add(option)?;
        }
    }
    settings.tolerance = args.tolerance.or(settings.tolerance);
    settings.time_limit = args.time_limit.or(settings.time_limit);
    settings.starts = args.starts.or(settings.starts);
    settings.is_quiet |= args.log == Log::Off;
    Ok(settings)
}

/// The file of a stub, which AMPL names without its extension.
fn file_of(path: &Path) -> PathBuf {
    let has_extension = path
        .extension()
        .is_some_and(|extension| extension == EXTENSION);
    if is_standard(path) || has_extension || path.exists() {
        return path.to_owned();
    }
    let mut whole = path.as_os_str().to_owned();
    whole.push(".");
    whole.push(EXTENSION);
    let whole = PathBuf::from(whole);
    if whole.exists() {
        whole
    } else {
        path.to_owned()
    }
}

/// The name of a problem: the file without folder and extension.
fn name_of(path: &Path) -> String {
    match is_standard(path) {
        true => files::display_name(path),
        false => path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
    }
}

/// The names that stand beside a file.
fn names_of(path: &Path) -> Names {
    let read = |extension: &str| {
        let text = files::read_if_present(&path.with_extension(extension));
        text.ok()
            .flatten()
            .map_or_else(Vec::new, |text| nsd_solver::optimization::nl::names(&text))
    };
    match is_standard(path) {
        true => Names::default(),
        false => Names {
            rows: read("row"),
            variables: read("col"),
        },
    }
}

/// Reads and solves a file; `None` after an error, which is in the diagnostics.
fn solve(
    path: &Path,
    settings: &Settings,
    sources: &mut SourceMap,
    diags: &mut Diagnostics,
    observer: &mut dyn Observer,
) -> Result<Option<Report>, files::FileError> {
    let clock = Instant::now();
    let bytes = files::read(path, nl::MAX_BYTES)?;
    let Some(mut problem) = nl::read(&files::display_name(path), bytes, sources, diags) else {
        return Ok(None);
    };
    let read_s = clock.elapsed().as_secs_f64();
    let names = names_of(path);
    Ok(Some(nl::solve(
        &name_of(path),
        &mut problem,
        &names,
        settings,
        read_s,
        observer,
    )))
}

/// Solves one file.
fn one(args: &SolveArgs, settings: &Settings, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let path = file_of(&args.path);
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let to_standard = args.json.as_deref().is_some_and(is_standard);
    // What is read by a program stays free of it.
    let out: &mut dyn io::Write = match to_standard || args.ampl {
        true => &mut *streams.err,
        false => &mut *streams.out,
    };
    let mut iterations = Iterations::new(out);
    let observer: &mut dyn Observer = match args.log {
        Log::Iterations => &mut iterations,
        Log::Off | Log::Summary => &mut (),
    };
    let report = match solve(&path, settings, &mut sources, &mut diags, observer) {
        Ok(Some(report)) => report,
        Ok(None) => {
            project::print(&diags, &sources, streams)?;
            return Ok(Exit::Wrong);
        }
        Err(error) => {
            error.tell(streams)?;
            return Ok(Exit::Wrong);
        }
    };
    if !settings.is_quiet && !to_standard {
        match args.ampl {
            true => writeln!(streams.out, "{}", nl::message(&report))?,
            false => streams.out.write_all(nl::text(&report).as_bytes())?,
        }
    }
    let mut sinks = Vec::new();
    if let Some(json) = &args.json {
        sinks.push(Sink::with(json, nl::json(&report) + "\n"));
    }
    if args.ampl {
        sinks.push(Sink::with(
            &path.with_extension("sol"),
            report.solution_file.clone(),
        ));
    }
    let mut exit = match report.status {
        Status::Solved => Exit::Success,
        // AMPL reads from the solution file how it went.
        _ if args.ampl => Exit::Success,
        _ => Exit::Failed,
    };
    for sink in sinks {
        if !sink.finish(streams)? {
            exit = Exit::Wrong;
        }
    }
    Ok(exit)
}
