//! Whether a scene prefers a direction about the vertical.

use crate::effects::Effect as _;
use crate::scene::Scene;
use crate::start::Start;

impl Scene {
    /// Whether nothing in it prefers a direction about the vertical, so that its formations are as long as wide but for
    /// chance: upright gravity, a start that is round or square, no wall, bed, outflow or intruder, a funnel that hangs
    /// still in its place. A lattice that is turned, listed places and liquids that flow are taken for a direction.
    pub fn is_axisymmetric(&self) -> bool {
        let is_start = match &self.start {
            Start::Grid { counts, .. } => self.funnel.is_some() || counts[0] == counts[1],
            Start::Ball { turned, .. } => !turned,
            Start::Cylinder { from, to, .. } => from[..2] == to[..2],
            Start::Positions { .. } | Start::Poses { .. } => false,
        };
        let effects = &self.effects;
        let is_aside = effects.tilt.is_on()
            || effects.funnel.is_on()
            || effects.outlet.is_on()
            || effects.vibration.is_on()
            || effects.liquid.is_on();
        is_start
            && !is_aside
            && self.gravity[..2] == [0.0; 2]
            && self.funnel.as_ref().is_none_or(|funnel| funnel.motion.is_still())
            && self.walls.is_empty()
            && self.bed.is_none()
            && self.intruder.is_none()
            && self.periodic.is_none()
            && self.outflow.is_none()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Motion, Scene, Start};

    #[test]
    fn what_has_a_direction_is_known() {
        let funnel = Scene::funnel(0.12);
        assert!(funnel.is_axisymmetric() && Scene::drop(0.1).is_axisymmetric());
        let mut tilted = funnel.clone();
        tilted.set(&[("effects.tilt.x", 0.02)]).unwrap();
        let mut aslant = funnel.clone();
        aslant.gravity[0] = 0.1;
        let mut lifted = funnel.clone();
        let velocity = [0.0, 0.1, 0.1];
        lifted.funnel.as_mut().unwrap().motion = Motion::Lift { velocity, begin: 0.0, end: 1.0 };
        let long = Start::Grid { counts: [20, 10, 10], spacing: 8e-3, jitter: 1e-4, base: 0.0 };
        // A funnel makes any grid round.
        assert!(Scene { start: long.clone(), ..funnel.clone() }.is_axisymmetric());
        let block = Scene { start: long, funnel: None, ..funnel };
        for scene in [tilted, aslant, lifted, block] {
            assert!(!scene.is_axisymmetric(), "{scene:?}");
        }
    }
}
