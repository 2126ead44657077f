//! When a pour ends, and how: docs/theory/contact.md, "End and health".

use nalgebra::Vector3;

use super::Simulation;
use crate::pour::Status;

/// Samples of the end rule within which a pour must seem ended twice.
const REST_SAMPLES: usize = 16;

impl Simulation {
    /// How the pour has ended, if it has. It must have seemed so twice within [`REST_SAMPLES`]: a grain at the
    /// top of its bounce is slow, too, but once, while a pile whose last grain trembles is slow now and then.
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
        let Some(now) = self.at_rest(&energies) else {
            let is_over = self.time() >= self.origin.scene.end.horizon;
            let how =
                if self.flow_has_stopped(&energies) { Status::Jammed } else { Status::Horizon };
            return is_over.then_some(how);
        };
        let window = REST_SAMPLES * self.around.settings.list_period;
        let seen = self.seemed_ended.replace((now, self.substep));
        let again = seen.is_some_and(|(then, at)| then == now && self.substep - at <= window);
        again.then_some(now)
    }

    /// How the pour would end if it stayed as it is now.
    fn at_rest(&self, energies: &[f64]) -> Option<Status> {
        let (scene, threshold) = (&self.origin.scene, self.origin.scene.end.kinetic_energy);
        let jammed_or = |status| {
            let is_jammed = self.in_funnel().next().is_some();
            Some(if is_jammed { Status::Jammed } else { status })
        };
        if energies.iter().sum::<f64>() <= threshold * self.particles.present().count() as f64 {
            return jammed_or(Status::AtRest);
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

    /// The grains that are in the funnel, if the scene has one.
    pub(super) fn in_funnel(&self) -> impl Iterator<Item = usize> {
        let scene = &self.origin.scene;
        let (funnel, time) = (scene.funnel.as_ref(), self.time());
        let pose = funnel.and_then(|funnel| scene.effects.funnel.of(funnel));
        let seen = move |place: Vector3<f64>| {
            pose.map_or(place, |pose| pose.inverse_transform_point(&place.into()).coords)
        };
        let is_held = move |grain| {
            funnel.is_some_and(|f| f.holds(&seen(self.particles.position(grain)), time))
        };
        self.particles.present().filter(move |&grain| is_held(grain))
    }
}
