//! Deliberate faults of one line each, and the test that catches each of them: the table `faults.csv`.
//!
//! ```csv
//! file,line,becomes,package,target,test
//! solver/src/optimization/lcp.rs,row[i] = 1.0;,row[i] = -1.0;,nsd-solver,lib,lcp::tests::name
//! ```
//!
//! Lines are written without what they are indented by. What becomes nothing is left out.

use std::fs;
use std::path::{Path, PathBuf};

/// The columns of the table.
const HEADER: [&str; 6] = ["file", "line", "becomes", "package", "target", "test"];

/// One row of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The file, from the root of the workspace.
    pub file: String,
    /// The line as it stands, without indentation.
    pub line: String,
    /// What stands there instead.
    pub becomes: String,
    /// What catches it.
    pub test: Test,
}

/// A test by name.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Test {
    /// The package.
    pub package: String,
    /// The file of tests, a module of the program `all` of its package, or `lib` for those beside the code.
    pub target: String,
    /// The path of the test in it.
    pub name: String,
}

/// The root of the workspace.
pub fn root() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().expect("the package is a folder of it")
}

/// The rows of the table, or what is wrong with one of them.
pub fn table() -> Result<Vec<Fault>, String> {
    read(include_str!("../faults.csv"))
}

fn read(text: &str) -> Result<Vec<Fault>, String> {
    let told = |error: csv::Error| format!("faults.csv: {error}");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    if *reader.headers().map_err(told)? != HEADER[..] {
        return Err(format!("faults.csv: the columns are {}", HEADER.join(",")));
    }
    let rows = reader.deserialize::<[String; 6]>();
    rows.map(|row| row.map(Fault::from).map_err(told)).collect()
}

impl From<[String; 6]> for Fault {
    fn from([file, line, becomes, package, target, name]: [String; 6]) -> Self {
        let test = Test {
            package,
            target,
            name,
        };
        Fault {
            file,
            line,
            becomes,
            test,
        }
    }
}

impl Fault {
    /// The text of the file with the fault in it, or why there is none.
    pub fn apply(&self, text: &str) -> Result<String, String> {
        let is_it = |line: &&str| line.trim() == self.line;
        match text.lines().filter(is_it).count() {
            1 => {}
            n => return Err(format!("the line is there {n} times")),
        }
        if self.becomes == self.line {
            return Err("the line stays as it is".to_owned());
        }
        let change = |line: &str| match line.trim() == self.line {
            true => line.replace(&self.line, &self.becomes) + "\n",
            false => line.to_owned() + "\n",
        };
        Ok(text.lines().map(change).collect())
    }
}

impl Test {
    /// The folder of its package, from the root of the workspace.
    pub fn folder(&self) -> &'static str {
        match &self.package[..] {
            "nsd-expr" => "compiler/expr",
            "nsd-solver" => "solver",
            "nsdc" => "compiler",
            _ => "tests",
        }
    }

    /// The path of the test in its program.
    pub fn path(&self) -> String {
        match &self.target[..] {
            "lib" => self.name.clone(),
            file => format!("{file}::{}", self.name),
        }
    }

    /// Whether there is a function of that name where it should be.
    pub fn exists(&self) -> bool {
        let name = self.name.rsplit("::").next().unwrap_or_default();
        let head = format!("fn {name}(");
        let has = |file: &PathBuf| fs::read_to_string(file).is_ok_and(|text| text.contains(&head));
        self.files().iter().any(has)
    }

    fn files(&self) -> Vec<PathBuf> {
        let package = root().join(self.folder());
        if self.target == "lib" {
            return sources(&package.join("src"));
        }
        let tests = package.join("tests");
        let mut files = sources(&tests.join(&self.target));
        files.push(tests.join(format!("{}.rs", self.target)));
        files
    }
}

/// All sources below a folder; none where there is no such folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{Fault, Test, read};

    const TEXT: &str = r#"file,line,becomes,package,target,test
a/b.rs,"f(|x| x, ""1"")","f(|x| -x, ""1"")",nsd-tests,goldens,name
a/b.rs,skip();,,nsd-solver,lib,a::tests::name
"#;

    fn test(package: &str, target: &str, name: &str) -> Test {
        let [package, target, name] = [package, target, name].map(str::to_owned);
        Test {
            package,
            target,
            name,
        }
    }

    fn fault(line: &str, becomes: &str, test: Test) -> Fault {
        let [file, line, becomes] = ["a/b.rs", line, becomes].map(str::to_owned);
        Fault {
            file,
            line,
            becomes,
            test,
        }
    }

    #[test]
    fn the_rows_are_read() {
        let goldens = test("nsd-tests", "goldens", "name");
        let lib = test("nsd-solver", "lib", "a::tests::name");
        let expected = [
            fault("f(|x| x, \"1\")", "f(|x| -x, \"1\")", goldens),
            fault("skip();", "", lib),
        ];
        assert_eq!(read(TEXT).unwrap(), expected);
        assert!(read(&TEXT.replace(",goldens,name", ",goldens")).is_err());
        assert!(read(&TEXT.replace("becomes", "name")).is_err());
    }

    #[test]
    fn a_fault_changes_one_line_and_nothing_else() {
        let fault = |line, becomes| fault(line, becomes, test("nsdc", "lib", "name"));
        let text = "if a {\n    b();\n    bb();\n}\n";
        let faulty = fault("b();", "c();").apply(text);
        assert_eq!(faulty.unwrap(), "if a {\n    c();\n    bb();\n}\n");
        assert!(fault("d();", "c();").apply(text).is_err());
        assert!(fault("b();", "b();").apply(text).is_err());
        let twice = text.replace("bb", "b");
        assert!(fault("b();", "c();").apply(&twice).is_err());
    }
}
