//! Messages that people read: of what strangers wrote, nothing steers a terminal, nothing fills it, and nothing is
//! quoted from a file that may be none of theirs.

use std::borrow::Cow;
use std::path::Path;

use granulcal_scene::TomlFault;

use crate::DatasetError;

/// Letters of a line, and lines of a message, that are shown.
const LINE: usize = 1000;
const LINES: usize = 60;
/// Letters beyond that are worth a cut.
const SLACK: usize = 20;

/// A text in which nothing steers a terminal: names in a stranger's file may hold escapes.
pub fn plain(text: &str) -> Cow<'_, str> {
    let steers = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let told = |c: char| if steers(c) { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(told).collect())
}

/// A message as [`plain`], with at most 60 lines of 1000 letters: what it quotes may be of any length.
pub fn readable(text: &str) -> Cow<'_, str> {
    let text = plain(text);
    let is_short = |line: &str| line.len() <= LINE || line.chars().count() <= LINE + SLACK;
    if text.lines().count() <= LINES && text.lines().all(is_short) {
        return text;
    }
    let cut = |line: &str| {
        if is_short(line) {
            return line.to_owned();
        }
        let (shown, all) = (line.chars().take(LINE).collect::<String>(), line.chars().count());
        format!("{} ... ({} further letters)", shown.trim_end(), all - LINE)
    };
    let mut lines: Vec<_> = text.lines().take(LINES).map(cut).collect();
    let further = text.lines().count().saturating_sub(LINES);
    if further > 0 {
        lines.push(format!("... ({further} further lines)"));
    }
    Cow::Owned(lines.join("\n"))
}

/// What is wrong with the TOML of a `what` in the file at `path`. Of a file that is not called TOML no line is quoted:
/// somebody's task may name a scene that is another user's file. Of a link the name of the file counts that it leads
/// to.
pub(crate) fn toml_error(
    path: &Path,
    what: &'static str,
    text: &str,
    source: Box<TomlFault>,
) -> DatasetError {
    let named = path.canonicalize().unwrap_or_default();
    if named.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        return DatasetError::Toml { path: path.to_owned(), what, source };
    }
    let before = source.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
    let line = before.matches('\n').count() + 1;
    let found = format!("something else in line {line}");
    DatasetError::content(path, "the text", found, format!("TOML of a {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_steers_the_terminal() {
        assert_eq!(plain("a\tb\n"), "a\tb\n");
        assert_eq!(plain("\u{1b}[2Jtopic\u{7}"), "\\u{1b}[2Jtopic\\u{7}");
    }

    #[test]
    fn no_message_fills_it() {
        assert_eq!(readable("one\ntwo"), "one\ntwo");
        let long = readable(&"ä".repeat(5000)).into_owned();
        assert!(long.chars().count() < 1100 && long.ends_with("(4000 further letters)"), "{long}");
        let many = readable(&"line\n".repeat(500)).into_owned();
        assert_eq!(many.lines().count(), LINES + 1);
        assert!(many.ends_with("(440 further lines)"), "{many}");
    }

    #[test]
    fn nothing_is_quoted_of_what_is_no_recording() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        for (content, found) in
            [(&b"root:x:0:0:secret"[..], "text"), (b"\x00\xff\x01 secret", "bytes")]
        {
            std::fs::write(&path, content).unwrap();
            let said = crate::Recording::open(&path, &crate::ReadOptions::default())
                .unwrap_err()
                .to_string();
            assert!(
                said.contains(found) && !said.contains("root") && !said.contains("secret"),
                "{said}"
            );
        }
    }

    #[test]
    fn nothing_is_quoted_of_a_file_that_is_not_called_toml() {
        let folder = tempfile::tempdir().unwrap();
        let secret = "# users\nroot:x:0:0:secret:/root:/bin/sh\n";
        let files =
            [("passwd", false), ("mine.toml", true), ("passwd.txt", false), ("link.toml", false)];
        for (name, is_quoted) in files {
            let path = folder.path().join(name);
            if name == "link.toml" {
                #[cfg(unix)]
                std::os::unix::fs::symlink(folder.path().join("passwd"), &path).unwrap();
                #[cfg(not(unix))]
                continue;
            } else {
                std::fs::write(&path, secret).unwrap();
            }
            let whole = |error: DatasetError| {
                let mut text = error.to_string();
                let mut cause: &dyn std::error::Error = &error;
                while let Some(next) = cause.source() {
                    text += &next.to_string();
                    cause = next;
                }
                text
            };
            for said in [
                whole(crate::load_scene(&path).unwrap_err()),
                whole(crate::load_prior(&path).unwrap_err()),
                whole(crate::CameraFile::load(&path).unwrap_err()),
                whole(crate::load_sensor(&path).unwrap_err()),
            ] {
                assert_eq!(said.contains("secret"), is_quoted, "{said}");
                assert!(said.contains(name) && said.contains("line 2"), "{said}");
            }
        }
    }
}
