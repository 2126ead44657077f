//! A pour in time: the substep and the health; when it ends is in `simulation/end.rs`, its state as bytes in
//! `simulation/state.rs`.

mod end;
mod start;
mod state;

use std::sync::Arc;

use nalgebra::Vector3;

use crate::assemble::Seen;
use crate::bed::Bed;
use crate::clumps::Clumps;
use crate::contact_set::ContactSet;
use crate::contacts::Contacts;
use crate::effect::Bridges;
use crate::error::DemError;
use crate::frozen_search::FrozenSearch;
use crate::health::{Health, HealthWatch};
use crate::impact::Impacts;
use crate::initial;
use crate::parallel::Threads;
use crate::pour::{Pour, Status};
use crate::preset::SolverSettings;
use crate::problem::{ContactProblem, SWEEPS_A_LOOK};
use crate::rebound;
use crate::scene::Scene;
use crate::solver::frozen::FrozenSolve;
use crate::solver::{self, nsgs};
use crate::surroundings::Surroundings;
use crate::wall_load::{self, WallLoad};

/// Mean energy of a grain's translation over that of a fall by its radius below which grains hardly move `[-]`.
const QUIET: f64 = 0.0025;
/// Change of an impulse in a sweep over that by gravity in a substep below which it has settled in a quiet state `[-]`.
const QUIET_SETTLED: f64 = 1e-2;
/// Examinations between two looks at the residual, which costs about a sweep.
const RESIDUAL_PERIOD: usize = 4;
/// A scene in motion.
///
/// Each substep (Moreau's time stepping; docs/theory/contact.md, box 3):
/// list the contacts now and then; add gravity; assemble gaps, normals and biases; resolve the impacts, each at
/// its time; solve the lasting contacts; move.
#[derive(Clone, Debug)]
pub struct Simulation {
    bed: Bed,
    contacts: Contacts,
    around: Surroundings,
    impacts: Impacts,
    /// Liquid bridges between grains.
    bridges: Bridges,
    /// Contacts with a soft layer.
    on_layer: ContactSet,
    /// The bodies that the grains are, if they are not round.
    clumps: Option<Clumps>,
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
    /// Puts the grains of `scene` at their start; the seed moves them within the start's jitter.
    ///
    /// # Errors
    /// What [`Scene::check`] says.
    pub fn new(scene: &Scene, seed: u64) -> Result<Self, DemError> {
        scene.check()?;
        let clumps = Clumps::of(scene, seed);
        let bed = initial::bed(scene, clumps.as_ref(), seed);
        let around = Surroundings::new(scene);
        let gravity = around.gravity;
        let lift = gravity.norm() * scene.grains.radius();
        let least_scale = (lift + scene.end.kinetic_energy) * bed.count() as f64;
        Ok(Self {
            watch: HealthWatch::new(bed.count(), energy(&bed, None, &around), least_scale),
            contacts: Contacts::default(),
            around,
            bed,
            impacts: Impacts::default(),
            bridges: Bridges::default(),
            on_layer: ContactSet::default(),
            clumps,
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
    /// [`DemError::OutOfRange`] for a step, margin or bound that is not positive, or a count of 0.
    pub fn with_settings(mut self, settings: SolverSettings) -> Result<Self, DemError> {
        settings.check()?;
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

    /// The solver's settings: the preset's, unless they were replaced.
    pub fn settings(&self) -> &SolverSettings {
        &self.around.settings
    }

    /// Simulated time `[s]`.
    pub fn time(&self) -> f64 {
        self.substep as f64 * self.around.settings.dt
    }

    /// Centres of the grains `[m]`; as velocities and radii, of those that have not left the scene.
    pub fn positions(&self) -> Vec<Vector3<f64>> {
        self.bed.present().map(|grain| self.bed.position(grain)).collect()
    }

    /// Velocities of the grains `[m/s]`.
    pub fn velocities(&self) -> Vec<Vector3<f64>> {
        self.bed.present().map(|grain| self.bed.velocity(grain)).collect()
    }

    /// Angular velocities of the grains `[rad/s]`.
    pub fn angular_velocities(&self) -> Vec<Vector3<f64>> {
        self.bed.present().map(|grain| self.bed.angular_velocity(grain)).collect()
    }

    /// Radii of the grains `[m]`.
    pub fn radii(&self) -> Vec<f64> {
        self.bed.present().map(|grain| self.bed.radius(grain)).collect()
    }

    /// Radii of the grains that have left through the scene's outflow `[m]`.
    pub fn radii_out(&self) -> Vec<f64> {
        let grains = 0..self.bed.count();
        grains.filter(|&i| self.bed.has_left(i)).map(|i| self.bed.radius(i)).collect()
    }

    /// Sets a grain (one that is not round, as a whole), by its number at the start, in motion: velocity `[m/s]` and angular velocity `[rad/s]` at its centre. A pour that had
    /// ended goes on, and the energy put in does not count as created.
    ///
    /// Velocities live at the middle of substeps (x += dt v after v += dt g): for a motion v at the present
    /// time set v - dt g / 2.
    ///
    /// # Errors
    /// [`DemError::OutOfRange`] for a grain that is not there, or no longer, or a number that is not finite.
    pub fn set_motion(
        &mut self,
        grain: usize,
        velocity: Vector3<f64>,
        angular_velocity: Vector3<f64>,
    ) -> Result<(), DemError> {
        let count = self.clumps.as_ref().map_or(self.bed.count(), Clumps::count);
        if grain >= count || self.bed.has_left(grain) {
            let allowed = "less than the number of grains, and in the scene";
            return Err(DemError::range("grain", grain as f64, allowed));
        }
        for (name, vector) in [("velocity", velocity), ("angular_velocity", angular_velocity)] {
            if let Some(&got) = vector.iter().find(|c| !c.is_finite()) {
                return Err(DemError::range(name, got, "finite"));
            }
        }
        let work = if let Some(clumps) = &mut self.clumps {
            clumps.set_motion(&mut self.bed, grain, &velocity, &angular_velocity)
        } else {
            let before = self.bed.kinetic_energy(grain);
            self.bed.set_motion(grain, &velocity, &angular_velocity);
            self.bed.kinetic_energy(grain) - before
        };
        self.watch.see_work(work);
        self.contacts.forget_list();
        (self.seemed_ended, self.ended) = (None, None);
        Ok(())
    }

    /// What the grains press on every wall with in the last substep: the ground first, then the funnel's cone
    /// and stem if there is one, then the scene's walls in their order. See [`WallLoad`].
    pub fn wall_loads(&self) -> Vec<WallLoad> {
        let dt = self.around.settings.dt;
        let walls = &self.around.walls;
        let mut loads = wall_load::of(&self.contacts.at_walls, walls, dt);
        for (load, through_layer) in loads.iter_mut().zip(wall_load::of(&self.on_layer, walls, dt))
        {
            load.force += through_layer.force;
            load.normal_force += through_layer.normal_force;
        }
        loads
    }

    /// How the pour ended, once it has.
    pub fn ended(&self) -> Option<Status> {
        self.ended
    }

    /// The health so far.
    pub fn health(&self) -> Health {
        self.watch.health(self.substep)
    }

    /// The contact problem of the next substep, frozen as it is assembled, with its solution after
    /// as many sweeps as its residual needs to be rounding. The simulation itself stays as it is.
    ///
    /// # Errors
    /// [`DemError::NotInContactProblem`] for a scene with an effect that changes what a contact is.
    pub fn contact_problem(&self) -> Result<ContactProblem, DemError> {
        if let Some(effect) = self.origin.scene.effects.of_contacts() {
            return Err(DemError::NotInContactProblem { effect });
        }
        let mut twin = self.clone();
        let dt = twin.around.settings.dt;
        twin.assemble();
        let (bed, contacts) = (&mut twin.bed, &mut twin.contacts);
        let mut problem = ContactProblem::new(bed, contacts, self.time(), dt);
        while !problem.is_solved() {
            problem.put_velocities(&mut bed.bodies);
            let Contacts { pairs, at_walls, .. } = &mut *contacts;
            nsgs::sweep_plainly(&mut [pairs, at_walls], &mut bed.bodies, SWEEPS_A_LOOK);
            problem.take_impulses(contacts, &bed.bodies, SWEEPS_A_LOOK);
        }
        Ok(problem)
    }

    /// Simulates `seconds`, or less if the pour ends before.
    pub fn advance(&mut self, seconds: f64) {
        let last = self.substep + (seconds / self.around.settings.dt).round() as usize;
        while self.ended.is_none() && self.substep < last {
            self.step();
        }
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
        Pour {
            velocities: self.velocities(),
            angular_velocities: self.angular_velocities(),
            status: self.ended.unwrap_or(Status::Horizon),
            health: self.health(),
            grains_in_funnel: self.in_funnel().count(),
            simulated_s: self.time(),
            state_hash: self.state_hash(),
            positions: self.positions(),
            radii: self.radii(),
            radii_out: self.radii_out(),
        }
    }

    /// Lists and assembles the contacts of a substep, lets gravity act and resolves the impacts.
    fn assemble(&mut self) -> Seen {
        self.around.move_walls(self.substep as f64 * self.around.settings.dt);
        let gained = self.contacts.wrap(&mut self.bed, &self.around.effects.gravity);
        self.watch.see_work(gained);
        self.contacts.follow(&self.bed, &self.around);
        self.accelerate();
        let (bed, contacts, around) = (&mut self.bed, &mut self.contacts, &self.around);
        let seen =
            contacts.assemble(bed, around, self.watch.lost_mut(), &mut self.impacts.candidates);
        if self.clumps.is_some() {
            // Impacts of bodies that turn are a matter of the contact solve.
            self.impacts.candidates.clear();
        }
        if self.impacts.resolve(bed, contacts, around) > 0 {
            contacts.assemble_again(bed, around);
            bed.rewind();
        }
        contacts.move_walls(bed, around);
        if self.clumps.is_some() {
            rebound::rebound(&mut contacts.pairs, bed, around);
            rebound::rebound(&mut contacts.at_walls, bed, around);
        }
        self.pull();
        if let Some(pad) = &self.around.effects.pad {
            let (bed, around) = (&self.bed, &self.around);
            let ground = |grain| around.wall_law(bed, grain, 0);
            pad.assemble(&mut self.on_layer, bed, around.settings.dt, ground);
        }
        seen
    }

    /// Lets gravity and drag act.
    fn accelerate(&mut self) {
        let dt = self.around.settings.dt;
        if self.around.effects.vibration.is_some() {
            // The middle of the substep, where velocities are.
            self.around.gravity = self.around.effects.gravity_at(self.time() + 0.5 * dt);
            let shaking = self.around.gravity - self.around.effects.gravity;
            self.watch.see_work(self.bed.work_of(&shaking, dt));
        }
        let (bed, around) = (&mut self.bed, &self.around);
        bed.accelerate(&around.gravity, dt, &around.threads);
        if let Some(drag) = &around.effects.drag {
            let pairs = &self.contacts.pairs;
            let given = drag.act(bed, pairs, &around.gravity, around.radius, dt);
            self.watch.see_work(given);
        }
        bed.hold_those_out();
    }

    /// Lets pulls act, after the impacts: what a pull adds in a substep to a closed contact is not an impact.
    fn pull(&mut self) {
        if let Some(pull) = &self.around.effects.pull {
            let (walls, dt) = (&self.around.walls, self.around.settings.dt);
            let near = [&self.contacts.pairs, &self.contacts.at_walls];
            pull.act(&mut self.bed, near, walls, &mut self.bridges, dt);
        }
    }

    /// The contact problem that the coming substep has to solve, for studies of solvers; the simulation stays as
    /// it is.
    pub fn frozen_solve(&self) -> FrozenSolve {
        let mut copy = self.clone();
        copy.assemble();
        let Contacts { pairs, at_walls, .. } = copy.contacts;
        FrozenSolve::new([pairs, at_walls], copy.bed, self.around.radius)
    }

    /// The search for pairs of the present state, for studies of its cost; the simulation stays as it is.
    pub fn frozen_search(&self) -> FrozenSearch {
        FrozenSearch::new(self.bed.clone(), &self.around)
    }

    /// One substep.
    fn step(&mut self) {
        let threads = self.around.threads.clone();
        threads.run(|| self.step_here());
    }

    fn step_here(&mut self) {
        let seen = self.assemble();
        self.solve();
        self.count_work_of_walls();
        match &mut self.clumps {
            None => self.bed.move_on(self.around.settings.dt),
            Some(clumps) => clumps.move_on(&mut self.bed, self.around.settings.dt),
        }
        self.watch.see_penetration(seen.penetration);
        self.substep += 1;
        if self.substep.is_multiple_of(self.around.settings.list_period) {
            self.examine();
        }
    }

    /// What moving walls put into the grains is not created.
    fn count_work_of_walls(&mut self) {
        if self.around.has_moving_walls {
            let in_impacts = std::mem::take(&mut self.impacts.work_of_walls);
            self.watch.see_work(in_impacts + self.contacts.work_of_walls(&self.bed));
        }
    }

    /// Solves the lasting contacts.
    fn solve(&mut self) {
        let Contacts { pairs, at_walls, .. } = &mut self.contacts;
        let (bodies, around) = (&mut self.bed.bodies, &self.around);
        let sets = &mut [pairs, at_walls, &mut self.on_layer];
        let sets = if around.effects.pad.is_some() { &mut sets[..] } else { &mut sets[..2] };
        let settings = &around.settings;
        let still = self.is_quiet.then(|| QUIET_SETTLED * around.gravity.norm() * settings.dt);
        let clumps = self.clumps.as_mut();
        let (radius, threads) = (around.radius, &around.threads);
        let work = solver::solve(sets, bodies, settings, still, radius, clumps, threads);
        self.watch.see_solve(&work);
    }

    /// Looks at the state between two searches: outflow, health and the end rule.
    fn examine(&mut self) {
        if let Some(outflow) = &self.origin.scene.outflow
            && self.bed.let_out(outflow.below)
        {
            self.contacts.forget_list();
        }
        if self.substep.is_multiple_of(RESIDUAL_PERIOD * self.around.settings.list_period) {
            let Contacts { pairs, at_walls, .. } = &mut self.contacts;
            let sets = [pairs, at_walls, &mut self.on_layer];
            let residual = nsgs::ResidualSums::of(&sets, &mut self.bed.bodies);
            self.watch.see_residual(residual.relative());
        }
        let fall = self.around.effects.gravity.norm() * self.around.radius;
        self.is_quiet = self.bed.mean_translation() <= QUIET * fall;
        self.watch.see_contacts(self.contacts.count());
        self.watch.see_energy(energy(&self.bed, self.clumps.as_ref(), &self.around));
        self.ended = self.end_reached().map(|status| {
            let trusted = self.watch.is_healthy(self.around.settings.max_penetration);
            if trusted { status } else { Status::Unhealthy }
        });
        if self.ended.is_none() && !self.watch.is_finite() {
            self.ended = Some(Status::Unhealthy);
        }
    }
}

/// Energy of the grains and of what they press in, per typical mass `[m^2/s^2]`.
fn energy(bed: &Bed, clumps: Option<&Clumps>, around: &Surroundings) -> f64 {
    let gravity = &around.effects.gravity;
    let energy = clumps.map_or_else(|| bed.energy(gravity), |clumps| clumps.energy(gravity));
    around.effects.pad.as_ref().map_or(energy, |pad| energy + pad.energy(bed))
}

#[cfg(test)]
mod tests;
