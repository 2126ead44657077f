//! Progress on stderr: a bar where somebody looks, a line now and then where nobody does.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use granulcal_dataset::Progress;

use crate::context::{Context, note};

/// Time between two lines where stderr is no terminal.
const PERIOD: Duration = Duration::from_secs(15);
/// Refreshes of a bar per second.
const REFRESH_HZ: u8 = 10;

/// The progress of a count of rows.
pub struct RowProgress {
    bar: ProgressBar,
    lines: bool,
    started: Instant,
    last_line: Instant,
}

impl RowProgress {
    /// A bar, lines or nothing, as the context has it.
    pub fn new(context: &Context) -> Self {
        let show_bar = context.terminal && !context.quiet;
        let target = if show_bar {
            ProgressDrawTarget::stderr_with_hz(REFRESH_HZ)
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(None, target);
        let template = "{bar:32} {pos}/{len} rows, {per_sec}, {eta} left {msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        let now = Instant::now();
        Self { bar, lines: !context.terminal && !context.quiet, started: now, last_line: now }
    }

    /// Shows how far the batch is.
    pub fn show(&mut self, progress: &Progress) {
        let Progress { total, resumed, made, unhealthy, out_of_view, jammed, .. } = *progress;
        let done = resumed + made;
        if self.bar.length() != Some(total) {
            self.bar.set_length(total);
            self.bar.set_position(resumed);
            self.bar.reset_eta();
        }
        self.bar.set_position(done);
        let counts =
            [(unhealthy, "unhealthy"), (out_of_view, "without grains in view"), (jammed, "jammed")];
        let told: Vec<_> = counts
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        if !told.is_empty() {
            self.bar.set_message(format!("({})", told.join(", ")));
        }
        if self.lines && self.last_line.elapsed() >= PERIOD {
            self.last_line = Instant::now();
            let rate = made as f64 / self.started.elapsed().as_secs_f64();
            let left = if made > 0 {
                let seconds = Duration::from_secs_f64((total - done) as f64 / rate);
                format!("{} left", indicatif::HumanDuration(seconds))
            } else {
                "no row finished yet".to_owned()
            };
            note(&format!("{done}/{total} rows, {rate:.2}/s, {left}"));
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// The progress of one pour in simulated time.
pub struct PourProgress {
    bar: ProgressBar,
}

impl PourProgress {
    /// A line on a terminal, else nothing: one pour is soon over.
    pub fn new(context: &Context) -> Self {
        let target = if context.terminal && !context.quiet {
            ProgressDrawTarget::stderr_with_hz(REFRESH_HZ)
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// Shows the simulated time.
    pub fn show(&self, simulated_s: f64, horizon_s: f64) {
        self.bar.set_message(format!("{simulated_s:.2} s of at most {horizon_s:.2} s simulated"));
        self.bar.tick();
    }

    /// Takes the line away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
