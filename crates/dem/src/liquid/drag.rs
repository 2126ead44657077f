//! Drag and added mass between a sheet of liquid and the grains in it, implicit in both.
//!
//! A grain of mass m, rate k and added mass A m, between two circles with weights w, follows the liquid of the new
//! step,
//!
//! ```text
//! v' = (v + A (v - U) + K sum of w u') / (1 + K),   K = k dt + A,   U = sum of w u
//! ```
//!
//! and gives each circle `w m (K (v' - u') - A (v - u))`, so that no drag is too strong for the step, and what one
//! gains the other loses. A is half of the displaced mass over the grain's, as of a sphere alone: between packed
//! spheres, too, whose tortuosity is `(1 + 1 / eps) / 2` (Berryman, Applied Physics Letters 37 (1980) 382,
//! doi:10.1063/1.91951).

use super::rows::Rows;

/// A grain that the liquid drags.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dragged {
    /// Distance from the axis, in rings.
    pub at: f64,
    /// Mass, in volumes of liquid over 2 pi times a ring's width squared `[m]`.
    pub mass: f64,
    /// Rate at which drag alone takes its velocity past the liquid `[1/s]`.
    pub rate: f64,
    /// Added mass over its own `[-]`.
    pub added: f64,
    /// Velocity outwards `[m/s]`.
    pub speed: f64,
}

impl Dragged {
    /// The circles around it where liquid flows, or where it stands at a wall, each with its weight; it is not dragged
    /// by what is not there.
    pub(super) fn weights(&self, mass: &[f64]) -> Vec<(usize, f64)> {
        let (circle, share) = (self.at as usize, self.at.fract());
        let flows = |circle: usize| mass.get(circle).is_some_and(|&mass| mass > 0.0);
        match (flows(circle), flows(circle + 1)) {
            (true, true) => vec![(circle, 1.0 - share), (circle + 1, share)],
            (true, false) => vec![(circle, 1.0)],
            (false, true) => vec![(circle + 1, 1.0)],
            (false, false) => Vec::new(),
        }
    }

    /// K of a step.
    fn strength(&self, dt: f64) -> f64 {
        dt * self.rate + self.added
    }

    /// Velocity that it would have, times 1 + K, in a liquid that had come to rest.
    fn own(&self, weights: &[(usize, f64)], old: &[f64]) -> f64 {
        let stream: f64 = weights.iter().map(|(circle, weight)| weight * old[*circle]).sum();
        self.speed + self.added * (self.speed - stream)
    }

    /// Follows the liquid that has flowed for `dt`, faster by `speed` less `old`; returns what it gives each circle, as
    /// force over 2 pi.
    pub(super) fn follow(
        &mut self,
        mass: &[f64],
        [old, speed]: [&[f64]; 2],
        dt: f64,
    ) -> Vec<(usize, f64)> {
        let (weights, k, before) = (self.weights(mass), self.strength(dt), self.speed);
        let stream: f64 = weights.iter().map(|(circle, weight)| weight * speed[*circle]).sum();
        if !weights.is_empty() {
            self.speed = (self.own(&weights, old) + k * stream) / (1.0 + k);
        }
        let given = |(at, weight)| {
            let slip = k * (self.speed - speed[at]) - self.added * (before - old[at]);
            (at, weight * self.mass * slip / dt)
        };
        weights.into_iter().map(given).collect()
    }
}

/// Adds what grains do to the circles within `dt`; below a tube to the share of them that is open.
pub(super) fn drag(
    rows: &mut Rows,
    (mass, opened, old): (&[f64], &[f64], &[f64]),
    dragged: &[Dragged],
    dt: f64,
) {
    for one in dragged {
        let k = one.strength(dt);
        let weights = one.weights(mass);
        let own = one.own(&weights, old) / (1.0 + k);
        for &(circle, weight) in &weights {
            // w m (K (v' - u') - A (v - u)), u' = u + dt a.
            let unit = opened[circle] * weight * one.mass / dt;
            let given = unit * k;
            let mut slip = own - old[circle];
            rows.add(circle, circle, dt * given);
            for &(other, its) in &weights {
                slip += k * its * old[other] / (1.0 + k);
                rows.add(circle, other, -dt * given * k * its / (1.0 + k));
            }
            rows.acts[circle] += given * slip - unit * one.added * (one.speed - old[circle]);
        }
    }
}

/// What grains do to a liquid that sinks past them.
pub(super) struct Held {
    /// Sum of mass times rate of the grains in each ring.
    pub rate: Vec<f64>,
    /// Velocity of the liquid past the grains of the new step at each circle, if it kept its own `[m/s]`.
    pub slip: Vec<f64>,
    /// Share of a change of the liquid's velocity by which grains do not follow it.
    pub stays: Vec<f64>,
}

impl Held {
    pub fn of(dragged: &[Dragged], mass: &[f64], old: &[f64], dt: f64) -> Self {
        let none = vec![0.0; mass.len() + 1];
        let (mut rate, mut sums) = (none.clone(), [none.clone(), none.clone(), none]);
        for one in dragged {
            let strength = one.mass * one.rate;
            if let Some(rate) = rate.get_mut(one.at as usize) {
                *rate += strength;
            }
            for (circle, weight) in one.weights(mass) {
                let weight = weight * strength;
                sums[0][circle] += weight;
                sums[1][circle] += weight * one.speed;
                sums[2][circle] += weight * dt * one.rate;
            }
        }
        let mean = |of: usize, circle: usize, otherwise: f64| {
            if sums[0][circle] > 0.0 { sums[of][circle] / sums[0][circle] } else { otherwise }
        };
        let circles = 0..mass.len();
        let stays: Vec<_> = circles.clone().map(|at| 1.0 / (1.0 + mean(2, at, 0.0))).collect();
        let slip = circles.map(|at| (old[at] - mean(1, at, old[at])) * stays[at]).collect();
        Self { rate, slip, stays }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grains_lose_the_liquid_gains_however_strong_the_drag() {
        let (mass, old, dt) = ([0.0, 2.0, 3.0, 4.0], [0.0, 0.1, 0.3, -0.2], 1e-3);
        let grains = [(1.25, 0.5, 0.8), (2.5, 1.5, -0.4), (2.9, 0.7, 0.1)];
        for rate in [1.0, 1e3, 1e7] {
            let mut dragged: Vec<_> = grains
                .map(|(at, mass, speed)| Dragged { at, mass, rate, added: 0.2, speed })
                .to_vec();
            let mut rows = Rows::new(4);
            for (circle, &mass) in mass.iter().enumerate() {
                rows.add(circle, circle, mass);
            }
            drag(&mut rows, (&mass, &[1.0; 4], &old), &dragged, dt);
            let gained = rows.solve(&mass);
            let new: Vec<_> = old.iter().zip(&gained).map(|(u, a)| u + dt * a).collect();
            let mut total = (0.0, 0.0);
            for (circle, mass) in mass.iter().enumerate() {
                total.0 += mass * old[circle];
                total.1 += mass * new[circle];
            }
            for one in &mut dragged {
                total.0 += one.mass * one.speed;
                one.follow(&mass, [&old, &new], dt);
                total.1 += one.mass * one.speed;
            }
            assert!((total.0 - total.1).abs() < 1e-9, "{rate}: {total:?}");
            if rate > 1e6 {
                // All go as one, with the mean velocity that they had: the circles are coupled by the grains between.
                let whole = 2.0 + 3.0 + 4.0 + 0.5 + 1.5 + 0.7;
                assert!(new[1..].iter().all(|u| (u - total.0 / whole).abs() < 1e-2), "{new:?}");
            }
        }
    }

    #[test]
    fn grains_that_follow_do_not_hold_up_what_sinks() {
        let loose = Dragged { at: 1.5, mass: 1.0, rate: 1.0, added: 0.2, speed: 0.0 };
        let tight = Dragged { rate: 1e6, ..loose };
        let (mass, old, dt) = ([0.0, 1.0, 1.0], [0.0, 0.2, 0.2], 1e-3);
        let [loose, tight] = [loose, tight].map(|one| Held::of(&[one], &mass, &old, dt));
        assert!((loose.slip[1] - 0.2).abs() < 1e-3 && (loose.stays[1] - 1.0).abs() < 1e-2);
        assert!(tight.slip[1].abs() < 1e-3 && tight.stays[1] < 1e-2);
        assert_eq!(loose.rate[1], 1.0);
    }
}
