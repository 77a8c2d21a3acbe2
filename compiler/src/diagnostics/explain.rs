//! The pages of `nsdc explain`: one for each code of a diagnostic.
//!
//! A page is a Markdown file `explain/E0203.md`: the title `# E0203: ...`, some
//! prose, and two complete files, fenced as `nsd wrong` and `nsd right`, or `nl wrong` and
//! `nl right` for problem files; data that they read is fenced as `csv NAME`.

/// Codes and pages, in the order of the codes.
pub static PAGES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/pages.rs"));

/// The page of a code, in upper or lower case.
pub fn page(code: &str) -> Option<&'static str> {
    let found = PAGES
        .iter()
        .find(|(known, _)| known.eq_ignore_ascii_case(code));
    found.map(|(_, page)| *page)
}

/// The title of a page without its code.
pub fn title(page: &str) -> &str {
    let first = page.lines().next().unwrap_or_default();
    first.split_once(": ").map_or(first, |(_, title)| title)
}

/// The code closest to one that does not exist.
pub fn closest(code: &str) -> Option<&'static str> {
    let code = code.to_uppercase();
    let distance = |known: &str| strsim::damerau_levenshtein(known, &code);
    let best = PAGES
        .iter()
        .map(|(known, _)| *known)
        .min_by_key(|known| distance(known))?;
    (distance(best) <= 2).then_some(best)
}

/// The contents of the fences whose info string is a language, `nsd` or `nl`, and `word`.
pub fn examples<'p>(page: &'p str, language: &str, word: &str) -> Vec<&'p str> {
    let opening = format!("```{language} {word}\n");
    let fences = page.split(&opening).skip(1);
    fences.filter_map(|rest| rest.split("```").next()).collect()
}

#[cfg(test)]
mod tests {
    use super::{PAGES, examples, page, title};

    /// Codes of files that a page cannot hold, not text, too large, full of errors, and of commands.
    const WITHOUT_EXAMPLES: [&str; 10] = [
        "E0001", "E0002", "E0021", "E0521", "E0534", "E0808", "E0811", "E0812", "E0813", "E0814",
    ];

    #[test]
    fn every_page_has_a_title_and_examples() {
        for (code, page) in PAGES {
            let heading = format!("# {code}: ");
            assert!(
                page.starts_with(&heading),
                "{code} does not start with its title"
            );
            // What only a run shows may have no example that is sure to show it.
            let may_lack = code[1..].starts_with("07") || WITHOUT_EXAMPLES.contains(code);
            let count = |language, word| examples(page, language, word).len();
            let counts = ["wrong", "right"].map(|word| count("nsd", word) + count("nl", word));
            assert!(
                (may_lack && counts == [0, 0]) || !counts.contains(&0),
                "{code} lacks a wrong or a right example"
            );
        }
    }

    #[test]
    fn parts_of_a_page_are_found() {
        let text = "# E0000: a title\n\nProse.\n\n```nsd wrong\nmodel a\n```\n```nsd right\nmodel b { }\n```\n";
        assert_eq!(title(text), "a title");
        assert_eq!(examples(text, "nsd", "wrong"), ["model a\n"]);
        assert_eq!(examples(text, "nsd", "right"), ["model b { }\n"]);
        assert!(page("E9999").is_none());
    }
}
