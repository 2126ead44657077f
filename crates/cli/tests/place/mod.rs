//! A folder of its own for each test, and the binary run inside it.

#![allow(dead_code)] // Not every test file needs all of it.

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

/// A folder of its own, and the binary run inside it.
pub struct Place(tempfile::TempDir);

impl Place {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.at(name), bytes).unwrap();
        self.at(name)
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_granulcal-cli"));
        command.args(args).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    pub fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Runs, expects the exit code, returns stdout.
    pub fn expect(&self, code: i32, args: &[&str]) -> String {
        let output = self.run(args);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(code), "{args:?}\nstdout: {out}\nstderr: {err}");
        out
    }

    /// Runs what must be refused as bad input; every word must stand in the message.
    pub fn refused(&self, args: &[&str], words: &[&str]) {
        let before = self.listing();
        let output = self.run(args);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(2), "{args:?}\nstdout: {out}\nstderr: {err}");
        assert_eq!(out, "", "{args:?}");
        for word in words {
            assert!(err.contains(word), "{args:?}: {word:?} is missing in\n{err}");
        }
        assert_eq!(self.listing(), before, "{args:?} left something on the disk");
    }

    pub fn listing(&self) -> Vec<PathBuf> {
        let mut found: Vec<_> =
            fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().path()).collect();
        found.sort();
        found
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn json(out: &str) -> Value {
    serde_json::from_str(out).unwrap_or_else(|e| panic!("{e}: {out}"))
}

/// Asks a command to stop, as Ctrl-C does, or as `kill` where the tests run in a script's background, whose commands
/// ignore Ctrl-C; returns whether it was there.
pub fn interrupt(child: &Child) -> bool {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap_or("0");
    let ignores_it = u64::from_str_radix(ignored.trim(), 16).unwrap() & 2 != 0;
    let signal = if ignores_it { "-TERM" } else { "-INT" };
    Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success()
}
