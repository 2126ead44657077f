//! Rewrites `tests/golden/drop_400.json` with the statistics that its pour has now; see `tests/golden/README.md`.

#[path = "../tests/pipeline/heap.rs"]
mod heap;

use granulcal::dataset::observe;
use granulcal::features::PAPER16;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let statistics = observe(&heap::scene().camera, &heap::pour(), 11)?.statistics?;
    let line = |(name, value): (&str, f64)| {
        // Statistics use libm (logarithms, powers), whose last bits differ between systems.
        let tolerance = 1e-6 * value.abs();
        format!("  \"{name}\": {{\"value\": {value:?}, \"tolerance\": {tolerance:.1e}}}")
    };
    let names = PAPER16.iter().map(|statistic| statistic.name);
    let lines: Vec<_> = names.zip(statistics).map(line).collect();
    std::fs::write(heap::golden_path(), format!("{{\n{}\n}}\n", lines.join(",\n")))?;
    Ok(())
}
