//! What processes that were killed have left half written.

use std::fs::{self, File};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::Duration;

/// Entries of a folder that are examined: one with a million files is not read for each that is written.
const MOST_ENTRIES: usize = 4096;
/// What was written to later than this ago may be of a process on another machine that shares the folder.
const OLD: Duration = Duration::from_secs(600);

/// Removes the old files beside `place` of the same `name` with this `ending`, of processes that are no more.
///
/// Those of other users stay, like that of `file`, which was just made: their processes may be hidden from this one.
/// What cannot be removed stays, too: it is in nobody's way.
pub(super) fn remove(place: &Path, (name, ending): (&str, &str), file: &File) {
    let Ok(own) = file.metadata() else { return };
    let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty());
    let entries = fs::read_dir(folder.unwrap_or(Path::new("."))).into_iter().flatten().flatten();
    for entry in entries.take(MOST_ENTRIES) {
        let Some(process) = process_of(&entry.file_name().to_string_lossy(), name, ending) else {
            continue;
        };
        let is_ours = || {
            entry.metadata().is_ok_and(|there| {
                let age = there.modified().ok().and_then(|at| at.elapsed().ok());
                there.is_file() && there.uid() == own.uid() && age.is_some_and(|age| age > OLD)
            })
        };
        if !may_live(process) && is_ours() {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The process that a temporary file of `name` belongs to: `.NAME.PROCESS-ATTEMPT` and the ending.
fn process_of(file: &str, name: &str, ending: &str) -> Option<u32> {
    let rest = file.strip_prefix('.')?.strip_prefix(name)?.strip_prefix('.')?;
    let (process, attempt) = rest.strip_suffix(ending)?.split_once('-')?;
    attempt.parse::<u32>().ok()?;
    process.parse().ok()
}

/// Whether a process of this number lives, or nobody can tell.
fn may_live(process: u32) -> bool {
    let all = Path::new("/proc");
    let is_told = all.join(std::process::id().to_string()).exists();
    !is_told || all.join(process.to_string()).exists()
}
