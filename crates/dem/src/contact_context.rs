//! What the contacts of a simulation are made of: walls, material, effects and settings.

use granulcal_scene::{Material, Scene, SolverSettings};
use nalgebra::Vector3;

use crate::contact::ContactLaw;
use crate::contact_set::ContactSet;
use crate::effect::{Acting, EffectContext};
use crate::energy::Falling;
use crate::law::Small;
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::path::Reach;
use crate::wall::Walls;

/// Gap below which a contact is listed among those that will act, in radii of a typical grain `[-]`.
const NEAR: f64 = 0.02;

/// What the contacts are made of: walls, material and settings of one simulation.
#[derive(Clone, Debug)]
pub(crate) struct ContactContext {
    pub walls: Walls,
    /// Whether any wall may move.
    pub has_moving_walls: bool,
    pub material: Material,
    /// Approach below which an impact is left to the contact solve `[m/s]`.
    pub impact_speed: f64,
    /// What is too small to matter, of these grains.
    pub small: Small,
    /// Gravity in the present substep `[m/s^2]`.
    pub gravity: Vector3<f64>,
    pub effects: Acting,
    pub settings: SolverSettings,
    pub threads: Threads,
    /// Radius of a typical grain `[m]`, the length that the settings are relative to.
    pub radius: f64,
    /// Radius of the least grain `[m]`, in which overlaps are told and to which contacts are solved.
    pub least: f64,
    /// Spheres that a grain is made of: those of one grain do not touch each other.
    pub members: usize,
    /// Gap below which a pair is listed in any case `[m]`.
    pub margin: f64,
}

impl ContactContext {
    /// Of a scene with grains of these radii `[m]`.
    pub fn new(scene: &Scene, radii: impl Iterator<Item = f64>) -> Self {
        let settings = scene.settings();
        let walls = Walls::of(scene);
        let (effects, radius) = (Acting::of(scene), scene.grains.radius());
        let small = Small::of(scene);
        let is_damped = scene.material.rolling_dashpot > 0.0 || walls.any_damps_rolling();
        Self {
            has_moving_walls: walls.any_moving(),
            walls,
            material: scene.material,
            impact_speed: if is_damped { small.damped_impact_speed } else { small.impact_speed },
            small,
            gravity: effects.gravity,
            members: scene.effects.clump.members(),
            settings,
            threads: Threads::default(),
            radius,
            least: radii.fold(radius, f64::min),
            margin: effects.reach().max(settings.margin * radius),
            effects,
        }
    }

    /// Replaces the preset's settings.
    pub fn set_settings(&mut self, settings: SolverSettings) {
        self.margin = self.effects.reach().max(settings.margin * self.radius);
        self.settings = settings;
    }

    /// Takes the walls that move to the substep that begins at `time` `[s]`.
    pub fn move_walls(&mut self, time: f64) {
        let (dt, interval) = (self.settings.dt, self.reach().interval);
        for placement in self.walls.placements() {
            placement.move_to(time, dt);
            placement.look_ahead(time, interval);
        }
    }

    /// What acts on all grains throughout.
    pub fn falling(&self) -> Falling {
        Falling { gravity: self.effects.gravity, dt: self.settings.dt }
    }

    /// What a list must hold to be complete until the next one.
    pub fn reach(&self) -> Reach {
        let interval = self.settings.dt * self.settings.list_period as f64;
        Reach { interval, near: NEAR * self.radius, far: self.margin }
    }

    /// What the effects see of a substep with these contacts.
    pub fn for_effects<'a>(&'a self, [pairs, at_walls]: [&'a ContactSet; 2]) -> EffectContext<'a> {
        let (walls, gravity, radius, dt) =
            (&self.walls, self.gravity, self.radius, self.settings.dt);
        EffectContext { pairs, at_walls, walls, gravity, radius, dt }
    }

    /// The coefficients of a contact between two grains.
    pub fn pair_law(&self, particles: &Particles, i: usize, j: usize) -> ContactLaw {
        let (r_i, r_j) = (particles.radius(i), particles.radius(j));
        let lever = [r_j / (r_i + r_j), r_i / (r_i + r_j)];
        self.law(&self.material, [particles.inverse_mass[i], particles.inverse_mass[j]], lever)
    }

    /// The coefficients of a contact between a grain and a wall.
    pub fn wall_law(&self, particles: &Particles, i: usize, wall: usize) -> ContactLaw {
        // The spin of a moving wall is in units of the grain's radius, so that its lever is the grain's.
        let lever = if self.has_moving_walls { [1.0, 1.0] } else { [1.0, 0.0] };
        self.law(&self.walls.wall(wall).material, [particles.inverse_mass[i], 0.0], lever)
    }

    fn law(&self, material: &Material, inverse_mass: [f64; 2], lever: [f64; 2]) -> ContactLaw {
        let mut law = ContactLaw {
            inverse_mass,
            lever,
            sliding_friction: material.sliding_friction,
            rolling_friction: material.rolling_friction,
            torsional_friction: material.torsional_friction,
            compliance: 0.0,
            rolling_speed: 0.0,
        };
        self.effects.change_law(&mut law);
        law
    }
}
