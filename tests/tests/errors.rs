//! Every file of `errors/`: its source and what the compiler says about it.
//!
//! The name of a file starts with the code it is about.

use std::fs;
use std::path::Path;

use nsd_tests::DataFolder;
use nsdc::diagnostics::{Diagnostics, render};
use nsdc::source::SourceMap;
use nsdc::source::imports;
use nsdc::{check, syntax};

#[test]
fn every_mistake_is_reported_as_it_was() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("errors");
    let entries = fs::read_dir(&folder).expect("the cases are there");
    let mut paths: Vec<_> = entries
        .map(|entry| entry.expect("a readable folder").path())
        .collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "nsd"));
    paths.sort();
    assert!(!paths.is_empty(), "no case in {}", folder.display());
    for path in paths {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let bytes = fs::read(&path).expect("a case can be read");
        let mut sources = SourceMap::new();
        let mut diags = Diagnostics::new();
        let source = sources.add_bytes(format!("{stem}.nsd"), bytes);
        let mut file = syntax::parse(&source, &mut diags);
        let mut beside = DataFolder(folder.clone());
        imports::link(&mut file, &stem, &mut beside, &mut sources, &mut diags);
        check(&file, &sources, &mut diags);

        let code = stem.split('_').next().unwrap_or_default().to_owned();
        let codes = diags.codes();
        assert!(codes.contains(&code), "{stem} gives {codes:?}");
        insta::assert_snapshot!(
            stem.as_ref(),
            render(&diags, &sources, false, 100),
            &source.text
        );
    }
}
