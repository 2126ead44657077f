//! A pour in time: what it is of and what can be asked of it. The substep is in `simulation/substep.rs`, when it ends
//! in `simulation/end.rs`, its state as bytes in `simulation/state.rs`.

mod bed;
mod end;
mod frozen;
mod inside;
mod intruder;
mod rest;
mod start;
mod state;
mod substep;

use std::sync::Arc;

use granulcal_scene::{Scene, SolverSettings};
use nalgebra::Vector3;

use crate::bodies::Bodies;
use crate::bonds::Bonds;
use crate::clumps::Clumps;
use crate::contact_context::ContactContext;
use crate::contact_set::ContactSet;
use crate::contacts::Contacts;
use crate::effect::Bridges;
use crate::energy::Energy;
use crate::error::DemError;
use crate::health::{Health, HealthWatch};
use crate::impact::{ImpactWork, Impacts};
use crate::initial;
use crate::lanes::Row;
use crate::liquid::Liquid;
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::pour::{ConvexGrains, Pour, Status};
use crate::wall_load::{self, WallLoad};

/// A scene in motion.
///
/// Each substep (Moreau's time stepping; docs/theory/contact.md, box 3):
/// list the contacts now and then; add gravity; assemble gaps, normals and biases; resolve the impacts, each at
/// its time; solve the lasting contacts; move.
#[derive(Clone, Debug)]
pub struct Simulation {
    particles: Particles,
    contacts: Contacts,
    around: ContactContext,
    impacts: Impacts,
    /// Liquid bridges between grains.
    bridges: Bridges,
    /// Contacts with a soft layer.
    on_layer: ContactSet,
    /// A liquid with a flow of its own, if there is one.
    liquid: Option<Liquid>,
    /// Bonds that join grains until they break, if there are any.
    bonds: Option<Bonds>,
    /// The bodies that the grains are, if they are not round: several spheres each, or
    clumps: Option<Clumps>,
    /// convex bodies of one shape, which have a substep of their own; `particles` follow them.
    bodies: Option<Bodies>,
    /// The scene's bed as it was when the ball was let go, once it has been: centres and radii.
    bed_at_rest: Option<Vec<Row>>,
    origin: Arc<Origin>,
    substep: usize,
    /// Whether the grains hardly moved at the last examination.
    is_quiet: bool,
    watch: HealthWatch,
    /// The last end that the end rule saw, and at which substep.
    seemed_ended: Option<(Status, usize)>,
    ended: Option<Status>,
}

/// What a simulation is of.
#[derive(Debug)]
struct Origin {
    scene: Scene,
    seed: u64,
}

impl Simulation {
    /// Puts the grains of `scene` at their start; the seed moves them within the start's jitter. Grains that begin in
    /// each other or in a wall are taken as they are: [`Simulation::check_start`] refuses them.
    ///
    /// # Errors
    /// What [`Scene::check`] says.
    pub fn new(scene: &Scene, seed: u64) -> Result<Self, DemError> {
        scene.check()?;
        let clumps = Clumps::of(scene, seed);
        let particles = initial::particles(scene, clumps.as_ref(), seed);
        let radii = (0..particles.count()).map(|grain| particles.radius(grain));
        let around = ContactContext::new(scene, radii);
        let gravity = around.gravity;
        let lift = gravity.norm() * scene.grains.radius();
        let heights = particles.heights(&around.effects.gravity);
        let least_scale = (lift + scene.end.kinetic_energy) * particles.count() as f64;
        Ok(Self {
            watch: HealthWatch::new(
                particles.count(),
                &energy(&particles, (None, None), &around),
                &heights,
                least_scale,
            ),
            contacts: Contacts::default(),
            around,
            particles,
            impacts: Impacts::default(),
            bridges: Bridges::default(),
            on_layer: ContactSet::default(),
            liquid: Liquid::of(scene),
            bonds: Bonds::of(scene),
            clumps,
            bodies: Bodies::of(scene, seed),
            bed_at_rest: None,
            origin: Arc::new(Origin { scene: scene.clone(), seed }),
            substep: 0,
            is_quiet: false,
            seemed_ended: None,
            ended: None,
        })
    }

    /// Settings other than the preset's, for convergence studies.
    ///
    /// # Errors
    /// [`DemError::Scene`] for a step, margin or bound that is not positive, or a count of 0; for another substep than
    /// that of the substeps that have been taken, which tell the time.
    pub fn with_settings(mut self, settings: SolverSettings) -> Result<Self, DemError> {
        settings.check()?;
        if self.substep > 0 && settings.dt.to_bits() != self.around.settings.dt.to_bits() {
            let allowed = "as before once a substep has been taken";
            return Err(DemError::range("settings.dt", settings.dt, allowed));
        }
        self.origin.scene.effects.check_method(settings.method)?;
        self.around.set_settings(settings);
        Ok(self)
    }

    /// Lets `threads` threads share this one simulation. The result is the same to the last bit; only
    /// scenes of some ten thousand grains have enough contacts of a colour to gain from it.
    ///
    /// # Errors
    /// [`DemError::Threads`] if `threads` is 0 or the system gives none.
    pub fn with_threads(mut self, threads: usize) -> Result<Self, DemError> {
        self.around.threads = Threads::new(threads)?;
        Ok(self)
    }

    /// What is simulated.
    pub fn scene(&self) -> &Scene {
        &self.origin.scene
    }

    /// What the start was drawn by.
    pub fn seed(&self) -> u64 {
        self.origin.seed
    }

    /// The solver's settings: the preset's, unless they were replaced.
    pub fn settings(&self) -> &SolverSettings {
        &self.around.settings
    }

    /// Simulated time `[s]`.
    pub fn time(&self) -> f64 {
        self.substep as f64 * self.around.settings.dt
    }

    /// The number that each grain had at the start, from 0, of those that have not left the scene: what stands at one
    /// place of [`Simulation::positions`], velocities and radii is of this grain, however many have left before it. Of
    /// grains that are several spheres these are all spheres, of one grain after the other.
    pub fn numbers(&self) -> Vec<usize> {
        self.particles.present().collect()
    }

    /// Centres of the grains `[m]`, of their spheres where they are several; as velocities and radii, of those that
    /// have not left the scene. [`Simulation::numbers`] tells which they are.
    pub fn positions(&self) -> Vec<Vector3<f64>> {
        self.particles.present().map(|grain| self.particles.position(grain)).collect()
    }

    /// Velocities of the grains `[m/s]`.
    pub fn velocities(&self) -> Vec<Vector3<f64>> {
        self.particles.present().map(|grain| self.particles.velocity(grain)).collect()
    }

    /// Angular velocities of the grains `[rad/s]`.
    pub fn angular_velocities(&self) -> Vec<Vector3<f64>> {
        self.particles.present().map(|grain| self.particles.angular_velocity(grain)).collect()
    }

    /// Radii of the grains `[m]`.
    pub fn radii(&self) -> Vec<f64> {
        self.particles.present().map(|grain| self.particles.radius(grain)).collect()
    }

    /// Radii of all grains of the scene by their number at the start `[m]`: also of those that have left it, or are
    /// still to enter it, as an intruder, which is the last.
    pub fn all_radii(&self) -> Vec<f64> {
        (0..self.particles.count()).map(|grain| self.particles.radius(grain)).collect()
    }

    /// Radii of the grains that have left through the scene's outflow `[m]`.
    pub fn radii_out(&self) -> Vec<f64> {
        // An intruder that is still to enter has left through nothing.
        let is_open = self.origin.scene.outflow.is_some();
        let grains = 0..if is_open { self.particles.count() } else { 0 };
        grains.filter(|&i| self.particles.has_left(i)).map(|i| self.particles.radius(i)).collect()
    }

    /// Sets a grain (one that is not round, as a whole), by its number at the start, in motion: velocity `[m/s]` and
    /// angular velocity `[rad/s]` at its centre. A pour that had ended goes on, and the energy put in does not count as
    /// created.
    ///
    /// Velocities live at the middle of substeps (x += dt v after v += dt g): for a motion v at the present
    /// time set v - dt g / 2.
    ///
    /// # Errors
    /// [`DemError::Scene`] for a grain that is not there, or no longer, or a number that is not finite.
    pub fn set_motion(
        &mut self,
        grain: usize,
        velocity: Vector3<f64>,
        angular_velocity: Vector3<f64>,
    ) -> Result<(), DemError> {
        let count = self.clumps.as_ref().map_or(self.particles.count(), Clumps::count);
        if grain >= count || self.particles.has_left(grain) {
            let allowed = "less than the number of grains, and in the scene";
            return Err(DemError::range("grain", grain as f64, allowed));
        }
        for (name, vector) in [("velocity", velocity), ("angular_velocity", angular_velocity)] {
            if let Some(&got) = vector.iter().find(|c| !c.is_finite()) {
                return Err(DemError::range(name, got, "finite"));
            }
        }
        let before = match &self.clumps {
            Some(clumps) => clumps.velocity(grain),
            None => self.particles.velocity(grain),
        };
        let mass = if self.clumps.is_some() { 1.0 } else { self.particles.mass(grain) };
        let gained = mass * self.around.falling().half().dot(&(velocity - before));
        let work = if let Some(clumps) = &mut self.clumps {
            clumps.set_motion(&mut self.particles, grain, &velocity, &angular_velocity)
        } else if let Some(bodies) = &mut self.bodies {
            self.particles.set_motion(grain, &velocity, &angular_velocity);
            bodies.set_motion(grain, &velocity, &angular_velocity)
        } else {
            let before = self.particles.kinetic_energy(grain);
            self.particles.set_motion(grain, &velocity, &angular_velocity);
            self.particles.kinetic_energy(grain) - before
        };
        self.watch.see_work(work + gained);
        self.contacts.forget_list();
        (self.seemed_ended, self.ended) = (None, None);
        Ok(())
    }

    /// Shape and orientations of the grains, if they are convex bodies.
    pub fn convex(&self) -> Option<ConvexGrains> {
        let bodies = self.bodies.as_ref()?;
        Some(ConvexGrains::new(&bodies.solid, bodies.orientations()))
    }

    /// Height of the surface of the scene's liquid, which flows about the z axis, in rings of this width `[m]`; None
    /// without one, or before its begin.
    pub fn liquid_profile(&self) -> Option<(f64, Vec<f64>)> {
        self.liquid.as_ref()?.profile(&self.particles)
    }

    /// What the grains press on every wall with in the last substep: the ground first, then the funnel's cone
    /// and stem if there is one, then the scene's walls in their order. See [`WallLoad`].
    ///
    /// # Errors
    /// [`DemError::Untold`] for grains with a shape, whose impulses are not kept.
    pub fn wall_loads(&self) -> Result<Vec<WallLoad>, DemError> {
        self.require_balls("the load of a wall")?;
        let dt = self.around.settings.dt;
        let walls = &self.around.walls;
        let mut loads = wall_load::of(&self.contacts.at_walls, walls, dt);
        for (load, through_layer) in loads.iter_mut().zip(wall_load::of(&self.on_layer, walls, dt))
        {
            load.force += through_layer.force;
            load.normal_force += through_layer.normal_force;
        }
        Ok(loads)
    }

    /// Refuses to tell `what` of grains with a shape, which have a substep of their own.
    fn require_balls(&self, what: &'static str) -> Result<(), DemError> {
        let effect = "grains.shape";
        if self.bodies.is_some() { Err(DemError::Untold { what, effect }) } else { Ok(()) }
    }

    /// How the pour ended, once it has.
    pub fn ended(&self) -> Option<Status> {
        self.ended
    }

    /// The health so far.
    pub fn health(&self) -> Health {
        self.watch.health(self.substep, self.members())
    }

    /// What the impacts so far have cost and taken; a simulation that goes on from a checkpoint counts afresh.
    pub fn impact_work(&self) -> ImpactWork {
        self.impacts.work
    }

    /// Simulates `seconds`, rounded to whole substeps, or less if the pour ends before; to its end for infinity.
    /// Nothing is simulated for less than half a substep, nor for a negative number or NaN. Returns how the pour ended,
    /// once it has: from then on no call simulates anything. Each call rounds by itself; see [`Self::advance_to`].
    pub fn advance(&mut self, seconds: f64) -> Option<Status> {
        self.advance_by(self.substeps(seconds))
    }

    /// Simulates to the substep that ends nearest to `time` `[s]`, or less if the pour ends before, in which case it
    /// returns how. A loop over the times of frames does not drift by this.
    pub fn advance_to(&mut self, time: f64) -> Option<Status> {
        self.advance_by(self.substeps(time).saturating_sub(self.substep))
    }

    /// Whole substeps in a time, none in a negative one or NaN.
    fn substeps(&self, seconds: f64) -> usize {
        (seconds / self.around.settings.dt).round() as usize
    }

    fn advance_by(&mut self, substeps: usize) -> Option<Status> {
        let last = self.substep.saturating_add(substeps);
        while self.ended.is_none() && self.substep < last {
            self.step();
        }
        self.ended
    }

    /// Simulates to the end.
    pub fn run(mut self) -> Pour {
        while self.ended.is_none() {
            self.step();
        }
        self.into_pour()
    }

    /// Simulates to the end, or gives up when `keep_going` says so; it is asked at every search for pairs.
    pub fn run_while(mut self, keep_going: &dyn Fn() -> bool) -> Option<Pour> {
        while self.ended.is_none() {
            if self.substep.is_multiple_of(self.around.settings.list_period) && !keep_going() {
                return None;
            }
            self.step();
        }
        Some(self.into_pour())
    }

    /// The state as it is, as a pour; one that has not ended counts as cut at its horizon.
    pub fn into_pour(self) -> Pour {
        self.to_pour()
    }

    /// The same of a simulation that goes on.
    pub fn to_pour(&self) -> Pour {
        Pour {
            velocities: self.velocities(),
            angular_velocities: self.angular_velocities(),
            status: self.ended.unwrap_or(Status::Horizon),
            health: self.health(),
            grains_in_funnel: self.grains_in_funnel(),
            simulated_s: self.time(),
            state_hash: self.state_hash(),
            positions: self.positions(),
            radii: self.radii(),
            radii_out: self.radii_out(),
            convex: self.convex(),
            bed: self.bed_before(),
        }
    }
}

/// Energy of the grains and of what they press in, per typical mass `[m^2/s^2]`.
fn energy(
    particles: &Particles,
    (clumps, bodies): (Option<&Clumps>, Option<&Bodies>),
    around: &ContactContext,
) -> Energy {
    let falling = around.falling();
    let Energy { kinetic, potential } = match (clumps, bodies) {
        (Some(clumps), _) => clumps.energy(&falling),
        (None, Some(bodies)) => bodies.energy(&falling),
        (None, None) => particles.energy(&falling),
    };
    Energy { kinetic, potential: potential + around.effects.energy(particles) }
}

#[cfg(test)]
mod tests;
