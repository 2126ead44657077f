//! What is wrong with a TOML, in the words of those who write it: they know no `usize`.

use std::fmt;
use std::ops::Range;

/// What the reader of TOML says of kinds, and what people call them; longer ones first.
const WORDS: [(&str, &str); 17] = [
    ("wanted string or table", "must be one of its words, in quotation marks, or a table"),
    ("expected usize", "expected a whole number, 0 or more"),
    ("expected u64", "expected a whole number, 0 or more"),
    ("expected u32", "expected a whole number, 0 or more"),
    ("expected i64", "expected a whole number"),
    ("expected f64", "expected a number"),
    ("expected f32", "expected a number"),
    ("expected a boolean", "expected true or false"),
    ("expected a sequence", "expected a list"),
    ("expected an array", "expected a list"),
    ("expected a map", "expected a table"),
    ("invalid type: map", "invalid type: a table"),
    ("invalid type: sequence", "invalid type: a list"),
    ("invalid type: string", "invalid type: the text"),
    ("invalid type: floating point", "invalid type: the number"),
    ("invalid type: integer", "invalid type: the whole number"),
    ("invalid value: integer", "invalid value: the whole number"),
];
/// A table that one of several names has.
const OF_VARIANTS: &str = "expected struct variant ";
/// A table, whatever it is called inside.
const OF_TABLES: [&str; 2] = ["expected struct ", "expected internally tagged enum "];

/// What the reader of TOML found, told without the names that kinds of numbers have in Rust.
#[derive(Clone, Debug, PartialEq)]
pub struct TomlFault(toml::de::Error);

impl TomlFault {
    /// Where it is in the text.
    pub fn span(&self) -> Option<Range<usize>> {
        self.0.span()
    }
}

impl From<toml::de::Error> for TomlFault {
    fn from(error: toml::de::Error) -> Self {
        Self(error)
    }
}

impl fmt::Display for TomlFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (whole, message) = (self.0.to_string(), self.0.message());
        // Before the message stands the line of the file as it is.
        match whole.rfind(message) {
            Some(at) => {
                write!(
                    f,
                    "{}{}{}",
                    &whole[..at],
                    in_plain_words(message),
                    &whole[at + message.len()..]
                )
            }
            None => f.write_str(&whole),
        }
    }
}

impl std::error::Error for TomlFault {}

/// A message of the reader of TOML, in plain words.
pub(crate) fn in_plain_words(message: &str) -> String {
    // What somebody wrote stands first, and is left as it is: only the last of each kind is the reader's.
    let (found, expected) = message.split_at(message.rfind(", expected ").unwrap_or(0));
    let mut plain = replaced(expected);
    if let Some((before, variant)) = plain.split_once(OF_VARIANTS) {
        let name = variant.rsplit("::").next().unwrap_or(variant);
        plain = format!("{before}expected the table of {name}");
    }
    for name in OF_TABLES {
        if let Some(at) = plain.find(name) {
            plain = format!("{}expected a table", &plain[..at]);
        }
    }
    let first = WORDS.iter().find(|(theirs, _)| found.starts_with(theirs));
    match first {
        Some((theirs, ours)) => format!("{ours}{}{plain}", &found[theirs.len()..]),
        None => format!("{found}{plain}"),
    }
}

fn replaced(text: &str) -> String {
    WORDS.iter().fold(text.to_owned(), |text, (theirs, ours)| text.replace(theirs, ours))
}

#[cfg(test)]
mod tests {
    use crate::{Prior, Scene, SceneError};

    fn told(text: &str) -> String {
        match Scene::from_toml(text) {
            Err(SceneError::Toml(fault)) => fault.to_string(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn kinds_are_told_as_people_call_them() {
        let scene = Scene::funnel(0.12).to_toml().unwrap();
        let of = |from: &str, to: &str| {
            assert!(scene.contains(from), "{scene}");
            told(&scene.replacen(from, to, 1))
        };
        let count = of("count = 2000", "count = \"f64, expected usize\"");
        let plain =
            "invalid type: the text \"f64, expected usize\", expected a whole number, 0 or more";
        assert!(count.contains(plain) && count.contains("TOML parse error at line"), "{count}");
        let negative = of("count = 2000", "count = -3");
        assert!(
            negative.contains("whole number `-3`, expected a whole number, 0 or more"),
            "{negative}"
        );
        let length = of("diameter = 0.004", "diameter = \"4 mm\"");
        assert!(length.contains("the text \"4 mm\", expected a number"), "{length}");
        let preset = of("preset = \"default\"", "preset = 3");
        assert!(preset.contains("must be one of its words, in quotation marks"), "{preset}");
        let gravity = of("gravity = [0.0, 0.0, -9.81]", "gravity = \"down\"");
        assert!(gravity.contains("expected a list of length 3"), "{gravity}");
        let table = told("grains = 3");
        assert!(table.contains("whole number `3`, expected a table"), "{table}");
        for text in [&count, &negative, &length, &preset, &gravity, &table] {
            let tail = text.rsplit("expected").next().unwrap();
            assert!(!["usize", "f64", "struct"].iter().any(|word| tail.contains(word)), "{text}");
        }
    }

    #[test]
    fn priors_and_paths_are_told_so_as_well() {
        let error = Scene::funnel(0.12).with("grains.count", -3.0).unwrap_err().to_string();
        assert!(!error.contains("usize"), "{error}");
        let text = Prior::default().to_toml().unwrap().replacen("low = 0.0", "low = \"0\"", 1);
        let Err(SceneError::PriorToml(fault)) = Prior::from_toml(&text) else { panic!("{text}") };
        assert!(fault.to_string().contains("the text \"0\", expected a number"), "{fault}");
    }
}
