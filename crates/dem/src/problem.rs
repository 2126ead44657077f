//! The contact problem of one substep as plain numbers, for anyone who wants to solve it by other means.
//!
//! docs/theory/contact-problem.md states the equations, the frame and the file. Everything here is written in
//! scalars from the kinematics, apart from the solver's lanes, so that it checks them.

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::body::Body;
use crate::contact::Batch;
use crate::contact_set::ContactSet;
use crate::contacts::Contacts;
use crate::law::INVERSE_INERTIA;
use crate::particles::Particles;

/// Residual at which a solution counts as converged, over the fastest velocity or impulse `[-]`: some
/// fifty roundings.
const CONVERGED: f64 = 1e-14;
/// Sweeps between two evaluations of the residual, and sweeps at most.
pub(crate) const SWEEPS_A_LOOK: usize = 256;
const MAX_SWEEPS: usize = 1 << 20;

/// What a grain touches, or may touch in the substep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Partner {
    /// Another grain, by its number.
    Grain(usize),
    /// A wall, by its number in the scene: the ground first, then the funnel's, then the others.
    Wall(usize),
}

/// One contact of a [`ContactProblem`]. Its rows are, in this order: normal, the two tangents, rolling along the
/// two tangents, torsion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrozenContact {
    /// First grain i.
    pub grain: usize,
    /// Second grain j, or a wall.
    pub partner: Partner,
    /// Unit normal n from the partner to the grain.
    pub normal: Vector3<f64>,
    /// Unit tangents; `(t1, t2, n)` is right-handed.
    pub tangents: [Vector3<f64>; 2],
    /// Levers `R_eff / r_i` and `R_eff / r_j`, 1 and 0 at a wall `[-]` (1 and 1 where walls move: the second
    /// counts only in the bias).
    pub lever: [f64; 2],
    /// Sliding friction mu_s `[-]`.
    pub sliding_friction: f64,
    /// Rolling friction mu_r `[-]`.
    pub rolling_friction: f64,
    /// Torsional friction mu_t `[-]`.
    pub torsional_friction: f64,
    /// Bias of the six rows `[m/s]`: b, then zeros; less the wall's own motion where it moves.
    pub bias: Vector6<f64>,
    /// Impulses over a typical mass along the six rows that granulcal found `[m/s]`; the last three over R_eff.
    pub impulse: Vector6<f64>,
}

/// A block of the Delassus matrix: how the impulses of contact `column` change the velocities of contact `row`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelassusBlock {
    /// Contact whose relative velocity changes.
    pub row: usize,
    /// Contact whose impulse acts.
    pub column: usize,
    /// `J_row M^-1 J_column^T` `[-]`.
    pub block: Matrix6<f64>,
}

/// The contact problem of a substep: what is given, and the solution that many sweeps find.
///
/// With the relative velocities at the substep's end, bias added, `y = W r + q`, each contact demands
///
/// ```text
/// 0 <= y_n  _|_  r_n >= 0
/// r_t in the disk of radius mu_s r_n, y_t = 0 inside it, else y_t opposed to r_t
/// r_r in the disk of radius mu_r r_n (two rolling rows), rho across n likewise
/// r_tau in [-mu_t r_n, mu_t r_n] (torsion), rho along n likewise
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ContactProblem {
    /// Simulated time at which the substep begins `[s]`.
    pub time: f64,
    /// Length of the substep `[s]`.
    pub dt: f64,
    /// Mass of a typical grain over the grain's mass `[-]`, one for each grain.
    pub inverse_mass: Vec<f64>,
    /// Velocity and spin `r omega` of each grain with gravity and without contacts `[m/s]`.
    pub free_velocities: Vec<Vector6<f64>>,
    /// Every listed contact, pairs before walls, each in the order of their grains.
    pub contacts: Vec<FrozenContact>,
    /// Sweeps that the solution took.
    pub sweeps: usize,
}

impl FrozenContact {
    /// Reads lane `lane` of a batch; the impulses are those of the warm start.
    fn read(set: &ContactSet, number: usize, lane: usize, bodies: &[Body]) -> Self {
        let batch = &set.batches[number];
        let law = &set.laws[batch.law as usize];
        let partner = match set.at_walls.get(number) {
            Some(at) => Partner::Wall(at.wall[lane] as usize),
            None => Partner::Grain(batch.j[lane] as usize),
        };
        let normal = Vector3::from(batch.normal.get(lane));
        let tangents = tangents(&normal);
        let mut contact = Self {
            grain: batch.i[lane] as usize,
            partner,
            normal,
            tangents,
            lever: [law.lever_i.0[lane], law.lever_j.0[lane]],
            sliding_friction: law.sliding_friction.0[lane],
            rolling_friction: law.rolling_friction.0[lane],
            torsional_friction: law.torsional_friction.0[lane],
            bias: batch.bias.0[lane] * Vector6::x(),
            impulse: Vector6::zeros(),
        };
        if set.has_wall_bodies() {
            let wall = motion(&bodies[batch.j[lane] as usize]);
            contact.bias += contact.jacobian(Side::Partner) * wall;
        }
        contact.take_impulse(batch, lane);
        contact
    }

    fn take_impulse(&mut self, batch: &Batch, lane: usize) {
        let [t1, t2] = self.tangents;
        let friction = Vector3::from(batch.lambda_t.get(lane));
        let moment = Vector3::from(batch.lambda_r.get(lane));
        self.impulse = Vector6::new(
            batch.lambda_n.0[lane],
            t1.dot(&friction),
            t2.dot(&friction),
            t1.dot(&moment),
            t2.dot(&moment),
            self.normal.dot(&moment),
        );
    }

    /// The rows of J: relative velocities of the contact per velocity and spin of one of its grains.
    ///
    /// ```text
    /// u   = v_i - v_j + n x (w_i + w_j)     rows n, t1, t2
    /// rho = l_i w_i - l_j w_j               rows t1, t2, n
    /// ```
    pub fn jacobian(&self, side: Side) -> Matrix6<f64> {
        let (sign, lever) = match side {
            Side::Grain => (1.0, self.lever[0]),
            Side::Partner => (-1.0, self.lever[1]),
        };
        let [t1, t2] = self.tangents;
        let mut rows = Matrix6::zeros();
        for (row, direction) in [self.normal, t1, t2].into_iter().enumerate() {
            // d . (n x w) = (d x n) . w
            let turned = direction.cross(&self.normal);
            rows.fixed_view_mut::<1, 3>(row, 0).copy_from(&(sign * direction).transpose());
            rows.fixed_view_mut::<1, 3>(row, 3).copy_from(&turned.transpose());
        }
        for (row, direction) in [t1, t2, self.normal].into_iter().enumerate() {
            let rolls = sign * lever * direction;
            rows.fixed_view_mut::<1, 3>(3 + row, 3).copy_from(&rolls.transpose());
        }
        rows
    }

    /// Its grains with their rows of J: one at a wall, two elsewhere.
    pub fn jacobians(&self) -> impl Iterator<Item = (usize, Matrix6<f64>)> + use<> {
        let partner = match self.partner {
            Partner::Grain(j) => Some((j, self.jacobian(Side::Partner))),
            Partner::Wall(_) => None,
        };
        std::iter::once((self.grain, self.jacobian(Side::Grain))).chain(partner)
    }

    /// How far the law would still move the impulses, given the velocities `y` and the diagonal of its block.
    fn natural_map(&self, y: &Vector6<f64>, diagonal: &Vector6<f64>) -> f64 {
        let next = self.impulse - y.component_div(diagonal);
        let [r_n, ..] = self.impulse.data.0[0];
        let ball = |first: usize, rows: usize, radius: f64| {
            let (old, next) = (self.impulse.rows(first, rows), next.rows(first, rows));
            let shrink = if next.norm() > radius { radius / next.norm() } else { 1.0 };
            (old - shrink * next).norm()
        };
        (r_n - next[0].max(0.0))
            .abs()
            .max(ball(1, 2, self.sliding_friction * r_n))
            .max(ball(3, 2, self.rolling_friction * r_n))
            .max(ball(5, 1, self.torsional_friction * r_n))
    }
}

/// One of the two bodies of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The first grain, i.
    Grain,
    /// The second grain, j, or the resting wall.
    Partner,
}

/// Two unit vectors that complete `normal` to a right-handed frame `(t1, t2, n)`.
fn tangents(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let t1 = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    [t1, normal.cross(&t1)]
}

/// Velocity and spin of a body as one vector.
fn motion(body: &Body) -> Vector6<f64> {
    let ([vx, vy, vz, _], [wx, wy, wz, _]) = (body.velocity.0, body.spin.0);
    Vector6::new(vx, vy, vz, wx, wy, wz)
}

impl ContactProblem {
    /// Reads assembled contacts; `particles` holds the free velocities, without the warm start.
    pub(crate) fn new(particles: &Particles, contacts: &Contacts, time: f64, dt: f64) -> Self {
        let free_velocities = particles.bodies[..particles.count()].iter().map(motion).collect();
        let contacts = lanes(contacts)
            .map(|(set, number, lane)| FrozenContact::read(set, number, lane, &particles.bodies))
            .collect();
        let mut problem = Self {
            time,
            dt,
            inverse_mass: particles.inverse_mass.clone(),
            free_velocities,
            contacts,
            sweeps: 0,
        };
        problem.sort();
        problem
    }

    /// Takes over the impulses after `sweeps` more sweeps.
    pub(crate) fn take_impulses(&mut self, contacts: &Contacts, bodies: &[Body], sweeps: usize) {
        self.contacts.clear();
        let read = |(set, number, lane)| FrozenContact::read(set, number, lane, bodies);
        self.contacts.extend(lanes(contacts).map(read));
        self.sort();
        self.sweeps += sweeps;
    }

    /// Puts the velocities that follow from the impulses into `bodies`. What sweeps add up drifts away from
    /// them by a rounding each time, and a long solve would end where the drift lets it.
    pub(crate) fn put_velocities(&self, bodies: &mut [Body]) {
        for (body, motion) in bodies.iter_mut().zip(self.velocities()) {
            body.velocity.0[..3].copy_from_slice(&motion.as_slice()[..3]);
            body.spin.0[..3].copy_from_slice(&motion.as_slice()[3..]);
        }
    }

    /// Whether the sweeps are done.
    pub(crate) fn is_solved(&self) -> bool {
        self.sweeps >= MAX_SWEEPS || self.residual() <= CONVERGED * self.scale()
    }

    /// The fastest of the free velocities and impulses `[m/s]`: what the residual is small against.
    pub fn scale(&self) -> f64 {
        let free = self.free_velocities.iter().map(Vector6::amax);
        free.chain(self.contacts.iter().map(|contact| contact.impulse[0])).fold(0.0, f64::max)
    }

    fn sort(&mut self) {
        let at_wall = |contact: &FrozenContact| matches!(contact.partner, Partner::Wall(_));
        self.contacts.sort_by_key(|contact| (at_wall(contact), contact.grain, contact.partner));
    }

    /// Inverse of a grain's mass matrix as its diagonal `[-]`: c for the velocity, 5/2 c for the spin.
    pub fn inverse_inertia(&self, grain: usize) -> Vector6<f64> {
        let c = self.inverse_mass[grain];
        let spin = INVERSE_INERTIA * c;
        Vector6::new(c, c, c, spin, spin, spin)
    }

    /// Velocity and spin of each grain at the substep's end, `v_free + M^-1 J^T r` `[m/s]`.
    pub fn velocities(&self) -> Vec<Vector6<f64>> {
        let mut velocities = self.free_velocities.clone();
        for contact in &self.contacts {
            for (grain, rows) in contact.jacobians() {
                let change = rows.transpose() * contact.impulse;
                velocities[grain] += self.inverse_inertia(grain).component_mul(&change);
            }
        }
        velocities
    }

    /// Relative velocities of each contact for given motions of the grains, with its bias: `J v + b` `[m/s]`.
    pub fn relative_velocities(&self, motions: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let relative = |contact: &FrozenContact| {
            contact.jacobians().fold(contact.bias, |sum, (grain, rows)| sum + rows * motions[grain])
        };
        self.contacts.iter().map(relative).collect()
    }

    /// The right-hand side `q = J v_free + b` `[m/s]`, one row of six for each contact.
    pub fn right_hand_side(&self) -> Vec<Vector6<f64>> {
        self.relative_velocities(&self.free_velocities)
    }

    /// The blocks of `W = J M^-1 J^T` that are not zero, by row and column.
    pub fn delassus(&self) -> Vec<DelassusBlock> {
        let mut at_grain = vec![Vec::new(); self.inverse_mass.len()];
        for (column, contact) in self.contacts.iter().enumerate() {
            for (grain, rows) in contact.jacobians() {
                at_grain[grain].push((column, rows));
            }
        }
        let mut blocks = Vec::new();
        for (row, contact) in self.contacts.iter().enumerate() {
            let first = blocks.len();
            for (grain, rows) in contact.jacobians() {
                let weighted = rows * Matrix6::from_diagonal(&self.inverse_inertia(grain));
                for (column, others) in &at_grain[grain] {
                    let block = weighted * others.transpose();
                    blocks.push(DelassusBlock { row, column: *column, block });
                }
            }
            blocks[first..].sort_by_key(|block| block.column);
        }
        // A pair meets itself at both of its grains, and two grains may share walls.
        blocks.dedup_by(|next, kept| {
            let same = (next.row, next.column) == (kept.row, kept.column);
            if same {
                kept.block += next.block;
            }
            same
        });
        blocks
    }

    /// Largest natural-map residual of a contact `[m/s]`: how far the law, taken literally, would still move its
    /// normal, tangential or rolling impulse. Zero at a solution.
    pub fn residual(&self) -> f64 {
        let y = self.relative_velocities(&self.velocities());
        let worst = |(contact, y): (&FrozenContact, &Vector6<f64>)| {
            contact.natural_map(y, &self.block_diagonal(contact))
        };
        self.contacts.iter().zip(&y).map(worst).fold(0.0, f64::max)
    }

    fn block_diagonal(&self, contact: &FrozenContact) -> Vector6<f64> {
        contact.jacobians().fold(Vector6::zeros(), |sum, (grain, rows)| {
            sum + rows.component_mul(&rows) * self.inverse_inertia(grain)
        })
    }
}

/// Every lane in use of every listed contact, as set, batch and lane.
fn lanes(contacts: &Contacts) -> impl Iterator<Item = (&ContactSet, usize, usize)> {
    [&contacts.pairs, &contacts.at_walls].into_iter().flat_map(|set| {
        // A facet of which a neighbour is nearer is infinitely far.
        let is_one =
            |&(number, lane): &(usize, usize)| set.batches[number].bias.0[lane].is_finite();
        set.lanes().filter(is_one).map(move |(number, lane)| (set, number, lane))
    })
}

#[cfg(test)]
mod tests;
