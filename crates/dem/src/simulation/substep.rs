//! One substep, line by line as box 3 of docs/theory/contact.md, and what is seen of the state between them.

use super::Simulation;
use crate::assemble::Seen;
use crate::bodies::Sweeps;
use crate::contacts::Contacts;
use crate::lanes::Row;
use crate::pour::Status;
use crate::rebound::rebound;
use crate::solver::residual::ResidualSums;
use crate::solver::solve_info::SolveInfo;
use crate::solver::{self, Solve, nsgs};

/// Mean energy of a grain's translation over that of a fall by its radius below which grains hardly move `[-]`.
const QUIET: f64 = 0.0025;
/// Change of an impulse in a sweep over that by gravity in a substep below which it has settled in a quiet state `[-]`.
const QUIET_SETTLED: f64 = 1e-2;
/// Examinations between two evaluations of the residual, which cost about a sweep.
const RESIDUAL_PERIOD: usize = 4;

/// How often contacts that bodies come to within a substep are looked for and solved, at most.
const FORESEEN: usize = 3;

/// How much of a substep is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Until {
    /// Up to the contact problem, which waits to be solved.
    Assembled,
    /// All of it.
    End,
}

impl Simulation {
    /// One substep.
    pub(super) fn step(&mut self) {
        let threads = self.around.threads.clone();
        threads.run(|| self.substep(Until::End));
    }

    /// The box of the substep.
    pub(super) fn substep(&mut self, until: Until) {
        self.around.move_walls(self.time());
        if self.bodies.is_some() {
            self.move_bodies();
            self.count_substep();
            return;
        }
        self.let_ball_go();
        self.let_intruder_in();
        self.join();
        self.follow();
        self.act_forces();
        let seen = self.assemble();
        self.resolve_impacts();
        self.act_across_gaps();
        self.assemble_layer();
        if until == Until::Assembled {
            return;
        }
        self.solve();
        self.move_on();
        self.follow_bonds();
        self.watch.see_penetration(seen.penetration);
        self.count_substep();
    }

    /// Examines the state now and then.
    fn count_substep(&mut self) {
        self.substep += 1;
        if self.substep.is_multiple_of(self.around.settings.list_period) {
            self.examine();
        }
    }

    /// The substep of convex bodies (docs/theory/bodies.md); the particles follow their centres.
    fn move_bodies(&mut self) {
        let Some(bodies) = &mut self.bodies else { return };
        let (around, watch) = (&self.around, &mut self.watch);
        let (settings, radius) = (&around.settings, around.radius);
        let (dt, scale) = (settings.dt, radius / settings.dt);
        let still = QUIET_SETTLED * around.gravity.norm() * dt;
        let (asked, enough) = if self.is_quiet { (settings.quiet_sweeps, still) } else { (0, 0.0) };
        let sweeps = Sweeps {
            least: settings.sweeps.max(asked),
            most: settings.max_sweeps,
            settled: enough.max(settings.settled * scale),
            closing: settings.closing * scale,
            idle: still,
        };
        let step = bodies.step(&around.gravity, &around.walls, &around.material, dt, sweeps);
        watch.see_penetration(step.deepest / radius);
        watch.see_residual(step.residual);
        watch.see_contacts(step.points);
        watch.see_work(step.work_of_walls);
        let (sweeps, unconverged) = (step.sweeps, step.unconverged);
        watch.see_solve(&SolveInfo { sweeps, unconverged, ..SolveInfo::default() });
        for (grain, [centre, velocity, omega]) in bodies.motions().enumerate() {
            let before = self.particles.position(grain);
            self.particles.spheres[grain] = Row::new(&centre, self.particles.radius(grain));
            self.particles.set_motion(grain, &velocity, &omega);
            let mut is_lost = false;
            around.walls.reached(&centre, radius, |surface| {
                is_lost |= around.walls.nearest(surface, &centre, 0.0).distance < 0.0
                    || around.walls.is_passed(surface, &before, &centre, dt);
            });
            watch.lost_mut()[grain] |= is_lost;
        }
    }

    /// Lists what may touch, once the grains that have left the period are in at its other end.
    fn follow(&mut self) {
        let gained = self.contacts.wrap(&mut self.particles, &self.around.effects.gravity);
        self.watch.see_work(gained);
        self.contacts.follow(&self.particles, &self.around);
    }

    /// Lets gravity act, and what acts with it.
    fn act_forces(&mut self) {
        let (dt, time) = (self.around.settings.dt, self.time());
        // The middle of the substep, where velocities are.
        if let Some(gravity) = self.around.effects.gravity_at(time + 0.5 * dt) {
            self.around.gravity = gravity;
            let added = gravity - self.around.effects.gravity;
            self.watch.see_work(self.particles.work_of(&added, dt));
        }
        let (particles, around) = (&mut self.particles, &self.around);
        let context = around.for_effects([&self.contacts.pairs, &self.contacts.at_walls]);
        self.watch.see_work(around.effects.act_before_gravity(particles, &context));
        particles.accelerate(&around.gravity, dt, &around.threads);
        self.watch.see_work(around.effects.act_with_gravity(particles, &context));
        if let Some(liquid) = &mut self.liquid {
            self.watch.see_work(liquid.act(particles, &context, time));
        }
        particles.freeze_removed();
    }

    /// Gaps, normals and biases of the listed contacts.
    fn assemble(&mut self) -> Seen {
        let found = &mut self.impacts.candidates;
        self.contacts.assemble(&self.particles, &self.around, self.watch.lost_mut(), found)
    }

    /// Resolves the impacts, each at its time, and lets bonds pull; those of bodies that turn are a matter of the
    /// contact solve.
    fn resolve_impacts(&mut self) {
        let (particles, contacts, around) = (&mut self.particles, &mut self.contacts, &self.around);
        if self.clumps.is_some() {
            self.impacts.candidates.clear();
        }
        particles.struck.clear();
        let hit = self.impacts.resolve(particles, contacts, around);
        if let Some(bonds) = &self.bonds {
            bonds.pull(particles, around.settings.dt);
        }
        if hit > 0 {
            contacts.assemble_again(particles, around);
            particles.rewind();
        }
        contacts.move_walls(particles, around);
        if self.clumps.is_some() {
            rebound(&mut contacts.pairs, particles, around);
            rebound(&mut contacts.at_walls, particles, around);
        }
    }

    /// Lets act what does so across gaps, after the impacts: what a pull adds in a substep to a closed contact is not
    /// an impact.
    fn act_across_gaps(&mut self) {
        let around = &self.around;
        let context = around.for_effects([&self.contacts.pairs, &self.contacts.at_walls]);
        let work = around.effects.act_across_gaps(&mut self.particles, &context, &mut self.bridges);
        self.watch.see_work(work);
    }

    /// Joins the grains of the start, where bonds do: those of a ball above a bed when it is let go.
    fn join(&mut self) {
        let is_there = self.origin.scene.bed.is_none() || self.bed_at_rest.is_some();
        let time = self.time();
        if let Some(bonds) = self.bonds.as_mut().filter(|_| is_there) {
            self.watch.see_work(bonds.join(&self.particles, time));
        }
    }

    /// Breaks the bonds of grains that have moved too far apart.
    fn follow_bonds(&mut self) {
        if let Some(bonds) = &mut self.bonds {
            bonds.follow(&self.particles, self.around.settings.dt);
        }
    }

    /// Lists the contacts with a soft layer, if there is one.
    fn assemble_layer(&mut self) {
        let (particles, around) = (&self.particles, &self.around);
        let ground = |grain| around.wall_law(particles, grain, 0);
        around.effects.assemble(&mut self.on_layer, particles, around.settings.dt, &ground);
    }

    /// Solves the lasting contacts, and again what bodies come to besides.
    fn solve(&mut self) {
        self.solve_contacts(solver::solve);
        for _ in 0..FORESEEN {
            if !self.foresee() {
                break;
            }
            self.solve_contacts(nsgs::solve);
        }
        self.count_work_of_walls();
    }

    /// Lets `by` solve what is listed.
    fn solve_contacts(&mut self, by: Solve) {
        let Contacts { pairs, at_walls, .. } = &mut self.contacts;
        let (bodies, around) = (&mut self.particles.bodies, &self.around);
        let sets = &mut [pairs, at_walls, &mut self.on_layer];
        let sets = if around.effects.has_contacts() { &mut sets[..] } else { &mut sets[..2] };
        let settings = &around.settings;
        let still = self.is_quiet.then(|| QUIET_SETTLED * around.gravity.norm() * settings.dt);
        let clumps = self.clumps.as_mut();
        let work = by(sets, bodies, settings, still, around.least, clumps, &around.threads);
        self.watch.see_solve(&work);
    }

    /// Looks where what is not round will be at the end of the substep; whether the contacts do not yet know of it.
    fn foresee(&mut self) -> bool {
        let Some(clumps) = &self.clumps else { return false };
        let ends = clumps.ends(self.around.settings.dt);
        self.contacts.follow_ends(&ends, &self.particles, &self.around);
        self.contacts.move_walls(&mut self.particles, &self.around);
        self.contacts.foresee(&ends, &self.particles, &self.around)
    }

    /// What moving walls put into the grains is not created.
    fn count_work_of_walls(&mut self) {
        if self.around.has_moving_walls {
            let in_impacts = std::mem::take(&mut self.impacts.work_of_walls);
            self.watch.see_work(in_impacts + self.contacts.work_of_walls(&self.particles));
        }
    }

    /// Moves the grains, and with those that are not round their spheres.
    fn move_on(&mut self) {
        let dt = self.around.settings.dt;
        match &mut self.clumps {
            None => self.particles.move_on(dt),
            Some(clumps) => clumps.move_on(&mut self.particles, dt),
        }
    }

    /// Examines the state between two searches: outflow, health and the end rule.
    fn examine(&mut self) {
        if let Some(outflow) = &self.origin.scene.outflow
            && self.particles.remove_below(outflow.below)
        {
            self.contacts.forget_list();
        }
        self.let_go();
        let is_due =
            self.substep.is_multiple_of(RESIDUAL_PERIOD * self.around.settings.list_period);
        if is_due && self.bodies.is_none() {
            let Contacts { pairs, at_walls, .. } = &mut self.contacts;
            let sets = [pairs, at_walls, &mut self.on_layer];
            let residual = ResidualSums::of(&sets, &mut self.particles.bodies);
            self.watch.see_residual(residual.relative());
        }
        let fall = self.around.effects.gravity.norm() * self.around.radius;
        self.is_quiet = self.particles.mean_translation() <= QUIET * fall;
        if self.bodies.is_none() {
            self.watch.see_contacts(self.contacts.count());
        }
        let energy = self.energy();
        let heights = self.particles.heights(&self.around.effects.gravity);
        self.watch.see_energy(&energy, &heights);
        self.ended = self.end_reached().map(|status| {
            let (is_cornered, settings) = (self.bodies.is_some(), &self.around.settings);
            let trusted = self.watch.is_healthy(is_cornered, settings.max_penetration);
            if trusted { status } else { Status::Unhealthy }
        });
        if self.ended.is_none() && !self.watch.is_finite() {
            self.ended = Some(Status::Unhealthy);
        }
    }
}
