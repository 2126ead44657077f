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
        let template = "{bar:32} {pos}/{len} rows, {msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        let now = Instant::now();
        Self { bar, lines: !context.terminal && !context.quiet, started: now, last_line: now }
    }

    /// Shows how far the batch is.
    pub fn show(&mut self, progress: &Progress) {
        let Progress { total, resumed, made, unhealthy, no_grains_in_view, jammed, .. } = *progress;
        let done = resumed + made;
        if self.bar.length() != Some(total) {
            self.bar.set_length(total);
        }
        self.bar.set_position(done);
        let counts = [
            (unhealthy, "unhealthy"),
            (no_grains_in_view, "without grains in view"),
            (jammed, "jammed"),
        ];
        let told: Vec<_> = counts
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        let told = if told.is_empty() { String::new() } else { format!(" ({})", told.join(", ")) };
        let pace = pace(total.saturating_sub(done), made, self.started.elapsed());
        self.bar.set_message(format!("{pace}{told}"));
        if self.lines && self.last_line.elapsed() >= PERIOD {
            self.last_line = Instant::now();
            note(&format!("{done}/{total} rows, {pace}"));
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Rows a second and the time that the missing ones take, by the mean of all rows that this run has `made`.
///
/// A row may take many seconds: what the last few of them took says little of the rest.
fn pace(missing: u64, made: u64, elapsed: Duration) -> String {
    let rate = made as f64 / elapsed.as_secs_f64();
    let left = Duration::try_from_secs_f64(missing as f64 / rate);
    match left {
        Ok(left) if made > 0 => format!("{rate:.2}/s, {} left", in_words(left)),
        _ => "no row finished yet".to_owned(),
    }
}

/// A time in seconds, minutes or hours, as the commands in Python tell it.
pub fn in_words(time: Duration) -> String {
    let seconds = time.as_secs_f64().round();
    if seconds >= 5400.0 {
        return format!("{:.1} h", seconds / 3600.0);
    }
    match (seconds / 60.0).floor() {
        0.0 => format!("{seconds} s"),
        minutes => format!("{minutes} min {:02} s", seconds - 60.0 * minutes),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_by_the_mean_of_all_rows() {
        let after = |seconds| pace(900, 100, Duration::from_secs(seconds));
        assert_eq!(after(200), "0.50/s, 30 min 00 s left");
        // A row that takes half a minute longer moves it by as much as it should.
        assert_eq!(after(230), "0.43/s, 34 min 30 s left");
        assert_eq!(pace(900, 0, Duration::from_secs(3)), "no row finished yet");
        assert_eq!(pace(0, 5, Duration::from_secs(10)), "0.50/s, 0 s left");
    }

    #[test]
    fn times_have_the_unit_that_fits() {
        for (seconds, words) in
            [(0.4, "0 s"), (59.6, "1 min 00 s"), (5399.0, "89 min 59 s"), (5400.0, "1.5 h")]
        {
            assert_eq!(in_words(Duration::from_secs_f64(seconds)), words);
        }
    }
}
