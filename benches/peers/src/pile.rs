//! What the engines are compared by, and the loop that pours until a pile rests.

use std::fmt;

use cpu_time::ThreadTime;
use granulcal_dem::Scene;

/// Time between two checks of rest and overlap `[s]`.
const LOOK: f64 = 0.01;
/// Speed below which a grain counts as resting `[m/s]`.
const SLOW: f64 = 0.01;
/// Share of the grains that must be slow at the end of a pour.
const RESTING: f64 = 0.995;
/// Nothing rests before the last grain has fallen `[s]`.
const FALLEN: f64 = 0.6;
/// When a pour ends at the latest `[s]`.
const HORIZON: f64 = 3.0;

/// A pour in progress, in any engine.
pub trait Engine {
    /// Moves on by `seconds`, to the nearest whole step.
    fn advance(&mut self, seconds: f64);
    /// Centres of the grains `[m]`.
    fn positions(&self) -> Vec<[f64; 3]>;
    /// Speeds of the grains `[m/s]`.
    fn speeds(&self) -> Vec<f64>;
    /// Deepest overlap at this moment, or so far where the engine keeps it, over the diameter.
    fn overlap(&self) -> f64;
}

/// One row of the table.
pub struct Pile {
    rest: f64,
    cpu: f64,
    overlap: f64,
    max_z: f64,
    mean_z: f64,
    mean_r: f64,
    r95: f64,
}

impl Pile {
    /// Pours `scene` in `engine` until 99.5 % of its grains are slow.
    pub fn pour(engine: &mut impl Engine, scene: &Scene) -> Self {
        let started = ThreadTime::now();
        let (mut time, mut overlap) = (0.0, 0.0_f64);
        while time < HORIZON {
            engine.advance(LOOK);
            time += LOOK;
            overlap = overlap.max(engine.overlap());
            let speeds = engine.speeds();
            let slow = speeds.iter().filter(|&&speed| speed < SLOW).count();
            if time > FALLEN && slow as f64 > RESTING * speeds.len() as f64 {
                break;
            }
        }
        Self::measure(&engine.positions(), scene.grains.radius()).with(
            time,
            started.elapsed().as_secs_f64(),
            overlap,
        )
    }

    fn measure(positions: &[[f64; 3]], radius: f64) -> Self {
        let count = positions.len() as f64;
        let mean = |axis: usize| positions.iter().map(|p| p[axis]).sum::<f64>() / count;
        let (x, y) = (mean(0), mean(1));
        let mut r: Vec<f64> = positions.iter().map(|p| (p[0] - x).hypot(p[1] - y)).collect();
        r.sort_by(f64::total_cmp);
        Self {
            rest: 0.0,
            cpu: 0.0,
            overlap: 0.0,
            max_z: positions.iter().map(|p| p[2]).fold(0.0, f64::max) + radius,
            mean_z: mean(2),
            mean_r: r.iter().sum::<f64>() / count,
            r95: r[(0.95 * (count - 1.0)).round() as usize],
        }
    }

    fn with(self, rest: f64, cpu: f64, overlap: f64) -> Self {
        Self { rest, cpu, overlap, ..self }
    }
}

/// The columns of [`Pile`]'s row; lengths in mm.
pub const HEAD: &str = "rest s | CPU s | worst overlap % | max z | mean z | mean r | 95 % r";

impl fmt::Display for Pile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm = |metres: f64| 1e3 * metres;
        write!(
            f,
            "{:.2} | {:.2} | {:.1} | {:.1} | {:.2} | {:.1} | {:.1}",
            self.rest,
            self.cpu,
            100.0 * self.overlap,
            mm(self.max_z),
            mm(self.mean_z),
            mm(self.mean_r),
            mm(self.r95)
        )
    }
}
