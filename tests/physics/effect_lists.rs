//! Whoever tells of the effects tells of all of them: the simulator's list, the page and the loop's library are one.

use std::collections::BTreeSet;
use std::path::Path;

use granulcal::dem::Effects;

/// A list of diameters, which is no number and has no path.
const LISTS: [&str; 1] = ["effects.polydispersity.diameters"];

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// What stands between two backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

#[test]
fn the_page_of_effects_has_a_row_for_each_with_all_its_numbers() {
    let page = read("docs/theory/effects.md");
    let table = page.split("| table | what it adds |").nth(1).expect("a table of the effects");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let mut told = BTreeSet::new();
    for row in rows {
        let cells: Vec<_> = row.split('|').collect();
        let name = quoted(cells[1]).next().expect("the table's name");
        told.extend(quoted(cells[3]).map(|number| format!("effects.{name}.{number}")));
    }
    let mut expected: BTreeSet<_> = Effects::paths().expect("defaults").into_iter().collect();
    expected.extend(LISTS.map(str::to_owned));
    assert_eq!(told, expected);
}

#[test]
fn the_library_of_the_loop_names_numbers_that_there_are_and_leaves_no_effect_out() {
    let library = read("python/granulcal/loop/effects/library.py");
    let named: BTreeSet<&str> =
        library.split('"').skip(1).filter(|text| text.starts_with("effects.")).collect();
    let paths = Effects::paths().expect("defaults");
    for path in &named {
        assert!(paths.iter().any(|known| known == path), "{path} is no number of an effect");
    }
    for effect in Effects::default().all() {
        let own = format!("{}.", effect.path());
        assert!(named.iter().any(|path| path.starts_with(&own)), "{own}* is in no entry");
    }
}
