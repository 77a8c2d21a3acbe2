//! Set points that step in time, by every method.

use nsd_tests::stress::{Extent, Outcome, families};

#[test]
fn loops_end_where_matrix_exponentials_do() {
    let family = families(if std::env::var_os("LONG").is_some() {
        Extent::Long
    } else {
        Extent::Short
    })
    .into_iter();
    let family = family.filter(|family| family.name == "set points that step");
    let mut told = String::new();
    for case in family.flat_map(|family| family.cases) {
        let at = std::time::Instant::now();
        let o = case.run();
        if std::env::var_os("LONG").is_some() {
            println!(
                "{} | {} | {o} | {:?}",
                case.hardness,
                case.method,
                at.elapsed()
            );
            if matches!(o, Outcome::Wrong { .. })
                || case.method.ends_with("stewart") && !matches!(o, Outcome::Met { .. })
            {
                println!("<<<{}>>> {}", case.text(), case.table());
            }
        }
        if !case.keeps(&o) {
            told += &format!("{} {} {o}\n{}\n", case.hardness, case.method, case.text());
        }
    }
    assert!(told.is_empty(), "{told}");
}
