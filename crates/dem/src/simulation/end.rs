//! When a pour ends, and how: docs/theory/contact.md, "End and health".

use granulcal_scene::RolledAway;
use nalgebra::Vector3;

use super::Simulation;
use super::rest::Rest;
use crate::clumps::Clumps;
use crate::law::INVERSE_INERTIA;
use crate::pour::Status;

/// Samples of the end rule within which a pour must seem ended twice.
const REST_SAMPLES: usize = 16;

/// How far out of view a grain must have rolled to leave the scene, in its radii, and how high it is at most.
const BEYOND: f64 = 20.0;
const LIFTED: f64 = 1.1;

impl Simulation {
    /// How the pour has ended, if it has. It must have seemed so twice within [`REST_SAMPLES`]: a pile whose last grain
    /// trembles is slow now and then. Grains that fall are slow at most as long as [`Rest`] says.
    pub(super) fn end_reached(&mut self) -> Option<Status> {
        let until = self.origin.scene.outflow.and_then(|outflow| outflow.until);
        if until.is_some_and(|percent| 100.0 * self.particles.outflow_fraction() >= percent) {
            return Some(Status::RanOut);
        }
        if self.time() < self.origin.scene.moves_until() {
            return None;
        }
        let energies: Vec<f64> =
            (0..self.particles.count()).map(|i| self.particles.translation(i)).collect();
        let rest = self.rest();
        let Some(now) = self.at_rest(&energies, rest.energy) else {
            if self.mean_in_view(&energies) > rest.falling {
                self.seemed_ended = None;
            }
            return self.at_horizon(&energies);
        };
        let list_period = self.around.settings.list_period;
        let window = REST_SAMPLES.max(rest.looks) * list_period;
        let seen =
            self.seemed_ended.filter(|&(then, at)| then == now && self.substep - at <= window);
        let ends = seen.is_some_and(|(_, at)| self.substep - at >= rest.looks * list_period);
        if ends || seen.is_none() {
            self.seemed_ended = Some((now, self.substep));
        }
        match (ends, rest.looks) {
            (true, _) => Some(now),
            // The next look tells.
            (false, 1) => None,
            (false, _) => self.at_horizon(&energies),
        }
    }

    /// How the pour ends if it has come to its horizon.
    fn at_horizon(&self, energies: &[f64]) -> Option<Status> {
        if self.time() < self.origin.scene.end.horizon {
            return None;
        }
        let has_stopped = self.flow_has_stopped(energies);
        Some(if has_stopped { Status::Jammed } else { Status::Horizon })
    }

    /// What rest is in this scene.
    fn rest(&self) -> Rest {
        let (scene, settings) = (&self.origin.scene, &self.around.settings);
        let look = settings.list_period as f64 * settings.dt;
        Rest::of(scene, self.around.effects.gravity.norm(), look)
    }

    /// Mean |v|^2 / 2 of the grains that the camera sees `[m^2/s^2]`; 0 where it sees none.
    fn mean_in_view(&self, energies: &[f64]) -> f64 {
        let camera = &self.origin.scene.camera;
        let (mut sum, mut count) = (0.0, 0);
        for grain in self.particles.present() {
            let at = self.particles.position(grain);
            if camera.sees_ground(at.x, at.y) {
                sum += energies[grain];
                count += 1;
            }
        }
        sum / f64::from(count.max(1))
    }

    /// How the pour would end if it stayed as it is now; a liquid must be as slow as the grains.
    fn at_rest(&self, energies: &[f64], threshold: f64) -> Option<Status> {
        let scene = &self.origin.scene;
        let flow = self.liquid.as_ref().and_then(|liquid| liquid.state());
        if flow.is_some_and(|flow| flow.kinetic_energy() > threshold) {
            return None;
        }
        let jammed_or = |status| {
            let is_jammed = self.in_funnel().next().is_some();
            Some(if is_jammed { Status::Jammed } else { status })
        };
        let present = self.particles.present().count();
        if energies.iter().sum::<f64>() <= threshold * present as f64 {
            // What has been let go moves on.
            let lets_go = scene.end.rolled_away == RolledAway::Leave;
            let moves_on = lets_go && present < self.particles.count();
            return jammed_or(if moves_on { Status::OutOfView } else { Status::AtRest });
        }
        let still = |(grain, energy): (usize, &f64)| {
            let at = self.particles.position(grain);
            *energy <= threshold || !scene.camera.sees_ground(at.x, at.y)
        };
        if energies.iter().enumerate().all(still) { jammed_or(Status::OutOfView) } else { None }
    }

    /// Whether grains remain in the funnel and are, on average, as slow as those of a pour at rest.
    fn flow_has_stopped(&self, energies: &[f64]) -> bool {
        let (mut sum, mut count) = (0.0, 0);
        for grain in self.in_funnel() {
            sum += energies[grain];
            count += 1;
        }
        count > 0 && sum <= self.origin.scene.end.kinetic_energy * f64::from(count)
    }

    /// Takes the grains that have rolled away out of the scene, if it says so.
    pub(super) fn let_go(&mut self) {
        if self.origin.scene.end.rolled_away == RolledAway::Stay {
            return;
        }
        let gone: Vec<usize> =
            self.particles.present().filter(|&grain| self.has_rolled_away(grain)).collect();
        if !gone.is_empty() {
            self.contacts.forget_list();
        }
        for grain in gone {
            self.particles.take_out(grain);
        }
    }

    /// Whether a grain is on the ground, farther out of view than [`BEYOND`], and will roll on outward: friction takes
    /// a ball that slides with v and would roll with v_r to (5 v + 2 v_r) / 7, whatever the friction.
    fn has_rolled_away(&self, grain: usize) -> bool {
        let (place, radius) = (self.particles.position(grain), self.particles.radius(grain));
        let across = place.xy();
        let distance = across.norm();
        let camera = &self.origin.scene.camera;
        // No farther in than the axis.
        let inward = across * (1.0 - BEYOND * radius / distance).max(0.0);
        if place.z > LIFTED * radius || camera.sees_ground(inward.x, inward.y) {
            return false;
        }
        let velocity = self.particles.velocity(grain);
        let rolling = (radius * self.particles.angular_velocity(grain)).cross(&Vector3::z());
        // 5 v + 2 v_r for balls, whose 1 / I is 5 / 2.
        let later = INVERSE_INERTIA * velocity + rolling;
        across.dot(&later.xy()) > 0.0
    }

    /// Number of the grains that are in the funnel, of several spheres with one of them at least.
    pub(super) fn grains_in_funnel(&self) -> usize {
        let members = self.clumps.as_ref().map_or(1, Clumps::members);
        let mut held: Vec<_> = self.in_funnel().map(|sphere| sphere / members).collect();
        // Spheres of a grain follow one another.
        held.dedup();
        held.len()
    }

    /// The grains that are in the funnel, if the scene has one; of several spheres the spheres.
    pub(super) fn in_funnel(&self) -> impl Iterator<Item = usize> {
        let scene = &self.origin.scene;
        let time = self.time();
        let is_held = move |grain| scene.is_in_funnel(&self.particles.position(grain), time);
        self.particles.present().filter(move |&grain| is_held(grain))
    }
}
