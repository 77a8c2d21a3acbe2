//! `nsdc new`: what it makes, and what it leaves alone.

use std::fs;

use crate::terminal::{folder, nsdc};
use insta::assert_snapshot;

#[test]
fn a_new_folder_passes_its_own_tests() {
    let folder = folder("new");
    let made = nsdc(&folder, &["new", "crate_on_spring"]);
    assert_eq!((made.status, made.err.as_str()), (0, ""));
    assert_snapshot!(made.out, @r"
    made `crate_on_spring` with a model, its tests and a README

      cd crate_on_spring
      nsdc test .
      nsdc run slider.nsd
    ");
    let inner = folder.join("crate_on_spring");
    let mut names: Vec<_> = fs::read_dir(&inner)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [".gitignore", "README.md", "slider.golden", "slider.nsd"]
    );
    let readme = fs::read_to_string(inner.join("README.md")).expect("a README");
    assert!(readme.starts_with("# crate_on_spring\n"));

    let tested = nsdc(&inner, &["test", "."]);
    assert_eq!(
        (tested.status, tested.err.as_str()),
        (0, ""),
        "{}",
        tested.out
    );
    assert!(
        tested
            .out
            .ends_with("2 passed, 0 failed, 0 not yet supported\n")
    );
    let laid_out = nsdc(&inner, &["fmt", "--check", "."]);
    assert_eq!((laid_out.status, laid_out.out.as_str()), (0, ""));

    fs::write(inner.join("slider.nsd"), "mine").expect("a writable folder");
    let again = nsdc(&folder, &["new", "crate_on_spring"]);
    assert_eq!(again.status, 1);
    assert_snapshot!(again.err, @r"
    error: `crate_on_spring` is there already
      help: choose another name; nothing is overwritten
    ");
    let kept = fs::read_to_string(inner.join("slider.nsd"));
    assert_eq!(kept.expect("the file"), "mine");
    assert_eq!(nsdc(&folder, &["new", ".."]).status, 1);
    assert_eq!(nsdc(&folder, &["new"]).status, 64);
}
