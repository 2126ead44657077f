//! The contacts of an impact.

use std::ops::{Index, IndexMut};

use granulcal_scene::Material;
use nalgebra::Vector3;

use super::friction::{Friction, FrictionBlock};
use super::rolling_spring::RollingSpring;
use crate::contact::ContactLaw;

/// Cosine of the angle between facets that count as one wall: 30 degrees.
const ONE_WALL: f64 = 0.866;

/// A contact that is closed while an impact lasts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    /// The two members; a wall is the second.
    pub ends: [usize; 2],
    /// Unit normal from the second to the first.
    pub normal: Vector3<f64>,
    /// Its spring, once it has closed fast enough.
    pub spring: Option<usize>,
    /// Compression, in units of velocity; negative for a gap that has opened since `[m/s]`.
    pub compression: f64,
    /// Normal impulse since friction last acted `[m/s]`.
    pub pushed: f64,
    /// 1 / A_n.
    pub compliance_n: f64,
    pub inverse_mass: [f64; 2],
    pub lever: [f64; 2],
    pub block: FrictionBlock,
    /// Restitution of the two by themselves `[-]`.
    pub restitution: f64,
    /// What it is raised to here: 1 for the pair that strikes `[-]`.
    pub exponent: f64,
    pub tangential_restitution: f64,
    /// What resists rolling in place of the block's cone, where the material has a dashpot.
    pub rolling_spring: Option<RollingSpring>,
    pub total: Total,
}

/// What a link has done so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Total {
    /// Normal impulse `[m/s]`.
    pub normal: f64,
    /// Impulses of friction.
    pub friction: Friction,
    /// Energy that sliding friction has taken, per typical mass `[m^2/s^2]`.
    pub sliding_taken: f64,
}

impl Link {
    pub fn new(
        ends: [usize; 2],
        normal: Vector3<f64>,
        law: ContactLaw,
        material: &Material,
        strikes: bool,
    ) -> Self {
        let compliance_n = 1.0 / (law.inverse_mass[0] + law.inverse_mass[1]);
        let mut block = FrictionBlock::new(&law, material.impact_friction);
        let rolling_spring = (material.rolling_dashpot > 0.0).then(|| {
            let cones = [law.rolling_friction, std::mem::take(&mut block.rolling)];
            RollingSpring::new(cones, material.rolling_dashpot, block.a_r, compliance_n)
        });
        Self {
            ends,
            normal,
            spring: None,
            compression: 0.0,
            pushed: 0.0,
            compliance_n,
            inverse_mass: law.inverse_mass,
            lever: law.lever,
            block,
            restitution: material.restitution,
            exponent: if strikes { 1.0 } else { material.touching_exponent },
            tangential_restitution: material.tangential_restitution,
            rolling_spring,
            total: Total::default(),
        }
    }

    /// lambda_r of all that the link has done.
    pub fn rolling_impulse(&self) -> Vector3<f64> {
        let Friction { m, about, .. } = &self.total.friction;
        self.normal.cross(m) + *about * self.normal
    }
}

/// The links in the order in which they were found.
#[derive(Clone, Debug, Default)]
pub(super) struct Links(Vec<Link>);

impl Links {
    pub fn clear(&mut self) {
        self.0.clear();
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn push(&mut self, link: &Link) {
        self.0.push(*link);
    }

    /// Whether a member has a link to a wall that faces the same way: the next facet of a curved mesh is no second
    /// wall.
    pub fn has_wall_like(&self, member: usize, normal: &Vector3<f64>) -> bool {
        let is_like = |link: &Link| {
            link.inverse_mass[1] == 0.0
                && link.ends[0] == member
                && link.normal.dot(normal) > ONE_WALL
        };
        self.0.iter().any(is_like)
    }

    pub fn iter(&self) -> impl Iterator<Item = &Link> {
        self.0.iter()
    }
}

impl Index<usize> for Links {
    type Output = Link;

    #[inline]
    fn index(&self, number: usize) -> &Link {
        &self.0[number]
    }
}

impl IndexMut<usize> for Links {
    #[inline]
    fn index_mut(&mut self, number: usize) -> &mut Link {
        &mut self.0[number]
    }
}
