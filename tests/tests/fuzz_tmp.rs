use nsd_tests::stress::{Extent, families};
#[test]
fn fuzz() {
    let lo: usize = std::env::var("LO").unwrap().parse().unwrap();
    let hi: usize = std::env::var("HI").unwrap().parse().unwrap();
    let name = std::env::var("FAM").unwrap();
    for family in families(Extent::Long) {
        if !family.name.contains(&name) {
            continue;
        }
        for case in &family.cases[lo..hi] {
            let t = std::time::Instant::now();
            let outcome = case.run();
            let line = format!(
                "{} {} {:.2}s {}",
                case.hardness,
                outcome,
                t.elapsed().as_secs_f64(),
                if case.keeps(&outcome) { "" } else { "BROKEN" }
            );
            eprintln!("{line}");
            if !case.keeps(&outcome) {
                eprintln!("{}", case.text());
            }
        }
    }
}
