//! What can go wrong inside a pour, in numbers, and the bounds beyond which it is called unhealthy.

use std::fmt;

use granulcal_scene::Scene;
use serde::{Deserialize, Serialize};

use crate::energy::{Energy, Heights};
use crate::solver::solve_info::SolveInfo;

/// Numbers that tell whether a pour can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Health {
    /// Deepest overlap of any contact so far, in radii of the smaller grain `[-]`.
    pub worst_penetration: f64,
    /// Mean natural-map residual over rms normal impulse of the sampled substeps `[-]`.
    pub mean_residual: f64,
    /// Worst natural-map residual over rms normal impulse of the sampled substeps `[-]`.
    pub worst_residual: f64,
    /// Largest rise of mechanical energy above its lowest value so far `[-]`, over what the start had above the lowest
    /// point that a grain has come to, or over what lifts every grain by its radius and sets it in motion as the end
    /// rule sees it, if that is more.
    pub energy_created: f64,
    /// Grains whose centre passed through a wall; must be 0.
    pub grains_lost: usize,
    /// Substeps taken.
    pub substeps: usize,
    /// Passes over all contacts: Gauss-Seidel sweeps, or iterations of the linear solver.
    pub sweeps: usize,
    /// Solves that used up their iterations before their contacts were as still as asked for.
    pub unconverged: usize,
    /// Newton steps that the guard has damped or replaced.
    pub guarded: usize,
    /// Mean number of listed contacts in a substep.
    pub mean_contacts: f64,
}

/// Energy that a pour may create, [`Health::energy_created`], before it is called unhealthy. Correcting
/// penetrations lifts grains a little; an unstable solver multiplies energy.
pub const MAX_ENERGY_CREATED: f64 = 0.01;

/// How much deeper than a sphere a convex body may be: a corner that no manifold had before enters by the way of a
/// substep.
const CORNER_SLACK: f64 = 2.0;

/// A bound of [`Health`] that a pour has broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Breach {
    /// The deepest overlap, in radii of the smaller grain.
    Overlap {
        /// What it was `[-]`.
        got: f64,
        /// The most that is allowed `[-]`.
        allowed: f64,
    },
    /// [`Health::energy_created`].
    Energy {
        /// What it was `[-]`.
        got: f64,
        /// The most that is allowed `[-]`.
        allowed: f64,
    },
    /// Grains whose centre passed through a wall.
    Lost(usize),
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Overlap { got, allowed } => {
                write!(f, "an overlap of {got:.3} radii, at most {allowed} are allowed")
            }
            Self::Energy { got, allowed } => {
                write!(f, "{got:.2e} of the energy created, at most {allowed} is allowed")
            }
            Self::Lost(1) => write!(f, "1 grain went through a wall"),
            Self::Lost(grains) => write!(f, "{grains} grains went through a wall"),
        }
    }
}

impl Health {
    /// The bounds of a scene that are broken; none of a healthy pour, nor where a number became infinite or NaN.
    pub fn breaches(&self, scene: &Scene) -> Vec<Breach> {
        let is_cornered = scene.grains.solid().is_some();
        self.beyond(deepest_allowed(is_cornered, scene.settings().max_penetration))
    }

    /// The bounds that are broken where overlaps may be so deep, in radii.
    fn beyond(&self, deepest: f64) -> Vec<Breach> {
        let (overlap, energy) = (self.worst_penetration, self.energy_created);
        let breaches = [
            (overlap > deepest).then_some(Breach::Overlap { got: overlap, allowed: deepest }),
            (energy > MAX_ENERGY_CREATED)
                .then_some(Breach::Energy { got: energy, allowed: MAX_ENERGY_CREATED }),
            (self.grains_lost > 0).then_some(Breach::Lost(self.grains_lost)),
        ];
        breaches.into_iter().flatten().collect()
    }
}

/// The deepest overlap that a healthy pour may have, in radii of the smaller grain `[-]`.
fn deepest_allowed(is_cornered: bool, max_penetration: f64) -> f64 {
    if is_cornered { CORNER_SLACK * max_penetration } else { max_penetration }
}

/// Collects the health of a running simulation.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct HealthWatch {
    worst_penetration: f64,
    residual_sum: f64,
    worst_residual: f64,
    residual_samples: usize,
    contacts_sum: f64,
    contacts_samples: usize,
    /// Kinetic energy at the start and what came from outside, and that of the start's heights.
    start_energy: f64,
    /// Energy of the heights if all grains were where the lowest has been.
    lowest: f64,
    least_scale: f64,
    energy: f64,
    lowest_energy: f64,
    created: f64,
    sweeps: usize,
    unconverged: usize,
    guarded: usize,
    lost: Vec<bool>,
}

impl HealthWatch {
    /// For so many grains with this energy at the start; energy created is compared with `least_scale` at least.
    pub fn new(grains: usize, start: &Energy, heights: &Heights, least_scale: f64) -> Self {
        let energy = start.total();
        Self {
            worst_penetration: 0.0,
            residual_sum: 0.0,
            worst_residual: 0.0,
            residual_samples: 0,
            contacts_sum: 0.0,
            contacts_samples: 0,
            start_energy: start.kinetic + heights.sum,
            lowest: heights.lowest,
            least_scale,
            energy,
            lowest_energy: energy,
            created: 0.0,
            sweeps: 0,
            unconverged: 0,
            guarded: 0,
            lost: vec![false; grains],
        }
    }

    /// One flag for each grain: set when its centre has passed through a wall.
    pub fn lost_mut(&mut self) -> &mut [bool] {
        &mut self.lost
    }

    pub fn see_penetration(&mut self, penetration: f64) {
        self.worst_penetration = self.worst_penetration.max(penetration);
    }

    pub fn see_residual(&mut self, residual: f64) {
        self.residual_samples += 1;
        self.residual_sum += residual;
        self.worst_residual = self.worst_residual.max(residual);
    }

    pub fn see_solve(&mut self, work: &SolveInfo) {
        self.sweeps += work.sweeps;
        self.unconverged += usize::from(work.unconverged);
        self.guarded += work.guarded;
    }

    pub fn see_contacts(&mut self, contacts: usize) {
        self.contacts_samples += 1;
        self.contacts_sum += contacts as f64;
    }

    pub fn see_energy(&mut self, now: &Energy, heights: &Heights) {
        let energy = now.total();
        self.energy = energy;
        self.lowest = self.lowest.min(heights.lowest);
        self.created = self.created.max(energy - self.lowest_energy);
        self.lowest_energy = self.lowest_energy.min(energy);
    }

    /// Counts energy that came from outside, which is not created.
    pub fn see_work(&mut self, work: f64) {
        self.start_energy += work;
        self.lowest_energy += work;
        self.energy += work;
    }

    /// False once a NaN or an infinity has reached the energy.
    pub fn is_finite(&self) -> bool {
        self.energy.is_finite()
    }

    /// Of grains of so many spheres each, of which one is enough to be lost.
    pub fn health(&self, substeps: usize, members: usize) -> Health {
        let mean = |sum: f64, samples: usize| sum / samples.max(1) as f64;
        Health {
            worst_penetration: self.worst_penetration,
            mean_residual: mean(self.residual_sum, self.residual_samples),
            worst_residual: self.worst_residual,
            energy_created: self.energy_created(),
            grains_lost: self.lost.chunks(members).filter(|grain| grain.contains(&true)).count(),
            substeps,
            sweeps: self.sweeps,
            unconverged: self.unconverged,
            guarded: self.guarded,
            mean_contacts: mean(self.contacts_sum, self.contacts_samples),
        }
    }

    /// Whether there is a flag for each of so many grains.
    pub fn is_of(&self, grains: usize) -> bool {
        self.lost.len() == grains
    }

    /// Whether no bound is broken, of grains with corners or balls.
    pub fn is_healthy(&self, is_cornered: bool, max_penetration: f64) -> bool {
        let deepest = deepest_allowed(is_cornered, max_penetration);
        self.is_finite() && self.health(0, 1).beyond(deepest).is_empty()
    }

    fn energy_created(&self) -> f64 {
        // Above the lowest that a grain has been, wherever the scene's origin is.
        let lowest = if self.lowest.is_finite() { self.lowest } else { 0.0 };
        let scale = (self.start_energy - lowest).max(self.least_scale);
        if scale > 0.0 { self.created / scale } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grain_of_several_spheres_is_lost_once() {
        let (still, level) = (Energy::default(), Heights { sum: 0.0, lowest: 0.0 });
        let mut watch = HealthWatch::new(6, &still, &level, 1.0);
        for sphere in [0, 1, 5] {
            watch.lost_mut()[sphere] = true;
        }
        assert_eq!([1, 2, 3, 6].map(|members| watch.health(0, members).grains_lost), [3, 2, 2, 1]);
    }

    #[test]
    fn every_bound_that_is_broken_is_told() {
        let scene = Scene::drop(0.02);
        let deepest = scene.settings().max_penetration;
        let fine = Health { worst_penetration: deepest, ..Health::default() };
        assert_eq!(fine.breaches(&scene), []);
        let health = Health {
            worst_penetration: 0.75,
            energy_created: 0.02,
            grains_lost: 2,
            ..Health::default()
        };
        let told: Vec<_> = health.breaches(&scene).iter().map(Breach::to_string).collect();
        let overlap = format!("an overlap of 0.750 radii, at most {deepest} are allowed");
        let energy = "2.00e-2 of the energy created, at most 0.01 is allowed".to_owned();
        assert_eq!(told, [overlap, energy, "2 grains went through a wall".to_owned()]);
    }
}
