//! The contact law: Signorini, Coulomb, rolling resistance.
//!
//! Pure functions without loops over contacts; docs/theory/contact.md derives them.

use granulcal_scene::{Effect, Effects, GrainShape, Scene, Shape, Start, Wall};
use nalgebra::Vector3;

use crate::lanes::{Reg, Reg3, Width};
use crate::turning::nutates;

/// Number of the law that pours follow: of contacts, impacts, starts and of how all of it is solved.
///
/// It counts up whenever the physics of a pour changes, whatever the version of the package: data sets, checkpoints,
/// models and kept pours state it, so that pours of two laws are never mixed. Laws that only some scenes follow have
/// numbers of their own ([`law_of`]). 1 had impacts one by one; 2 has them as springs in the limit of infinite
/// stiffness.
pub const LAW: u32 = 2;
/// The number of the law of smaller grains, whose small lengths and speeds go with their size (`Small`).
const LAW_OF_SMALL: u32 = 3;
/// The number of the law of scenes with forces across gaps, of any size: pulls take the work that parting costs, and
/// films what they take along a way, whatever the substep; of a fluid between crowded grains; of a funnel that is moved
/// with the grains of every start.
const LAW_ACROSS_GAPS: u32 = 4;

/// The number of the law of unequal grains that start where equal ones would just fit, of whatever size and effects:
/// they are parted first.
const LAW_OF_PARTED: u32 = 5;

/// The number of the law of grains with liquid bridges at walls of triangles, of whatever size and start: a bridge goes
/// on where its grain passes from one triangle of a wall to the next.
const LAW_OF_BRIDGES: u32 = 6;

/// Whether grains that overlap where a scene starts them are parted before they are let go.
pub(crate) fn is_parted(scene: &Scene) -> bool {
    scene.starts_crowded() && !scene.effects.clump.is_on()
}

/// Number of the law that pours of a scene follow.
pub fn law_of(scene: &Scene) -> u32 {
    let bridges = &scene.effects.capillary;
    if bridges.is_on() && bridges.walls > 0.0 && has_facets(scene) {
        return LAW_OF_BRIDGES;
    }
    if is_parted(scene) {
        return LAW_OF_PARTED;
    }
    let Effects { adhesion, capillary, lubrication, fluid, funnel, .. } = &scene.effects;
    let is_between = fluid.is_on() && fluid.crowding > 0.0 && fluid.crowding < 1.0;
    let is_moved = funnel.is_on() && !matches!(scene.start, Start::Grid { .. });
    let reaches = adhesion.is_on() || capillary.is_on() || lubrication.is_on();
    if reaches || is_between || is_moved {
        return LAW_ACROSS_GAPS;
    }
    if scene.grains.radius() < LARGE { LAW_OF_SMALL } else { LAW }
}

/// Whether a scene has walls of triangles.
fn has_facets(scene: &Scene) -> bool {
    let is_of_them = |wall: &Wall| matches!(wall.shape, Shape::Box { .. } | Shape::Mesh(_));
    scene.walls.iter().any(is_of_them) || scene.effects.outlet.is_on()
}

/// Number of the arithmetic that the law is worked out in, of pours of a scene.
///
/// It counts up whenever such a pour changes by its rounding or the order of its contacts alone: the same seed is then
/// another pour of the same law. Data sets and checkpoints state it, so that a batch is not gone on with by another;
/// what is learned from pours does not depend on it. 1 is double precision throughout; grains with a shape came to 2
/// when their points were swept eight at a time, and to 3 when walls were foreseen and cores told how bodies lie; boxes
/// came to 4 when their separating axes were tried by the crate itself. Boxes came to 5 and the others to 4 when what
/// is foreseen was looked at where a way leads elsewhere, and boxes met eight pairs at a time; to 6 and 5 when a corner
/// that has gone round the end of a shell was no longer taken for one that has come through it. Cylinders came to 6
/// when their nearest points were those of their features. Boxes and cylinders came to 7 and the others to 6 when an
/// overlap that is foreseen, no deeper than sweeps may leave a point, was no point of contact yet; to 8 and 7 when
/// corners that go through a shell were foreseen as those that go through a plane. Bodies and clumps that nutate came
/// one farther when they turned in parts of a substep, and bodies where walls move when those were looked at where they
/// go; bodies in scenes with walls of their own when corners that go through the edge where two sides meet were found,
/// and those at boxes, meshes and other outlets than round ones once more when they touched the edges of triangles and
/// went round them. All bodies came one farther when points that are open were swept apart from those that push, and
/// balls and clumps when pairs that pass each other were seen as far apart as they are at the end of a substep. Bodies
/// came one farther again when they met where they lie at that time, and once more when two that are known to meet, and
/// ways that lead into the same by more, were looked at no more; they came one farther still when points that hardly
/// change in a sweep were swept less often and small turns went by their series. Balls with a film between them came to
/// 2 when Newton's steps told what it leaves of a speed, and clumps to 3 when the ends of their ways were looked at.
/// Unequal balls came to 2 when contacts were solved to the least of them, and those that are parted to 3 when none
/// went through a wall for it, and they were parted across the ends of a period.
pub fn arithmetic(scene: &Scene) -> u32 {
    let of_shape = match scene.grains.shape {
        Some(GrainShape::Box { .. } | GrainShape::Cylinder { .. }) => 12,
        Some(_) => 11,
        None => 2,
    };
    let solid = scene.grains.solid();
    let nutates =
        solid.as_ref().map_or(scene.effects.clump.is_on(), |solid| nutates(&solid.inertia));
    let motions = scene.walls.iter().map(|wall| &wall.motion);
    let mut motions = motions.chain(scene.funnel.iter().map(|funnel| &funnel.motion));
    let meets_moving = solid.is_some() && motions.any(|motion| !motion.is_still());
    let meets_edges = solid.is_some() && !scene.walls.is_empty();
    let Effects { clump, lubrication, polydispersity, .. } = &scene.effects;
    let meets_facets = solid.is_some() && has_facets(scene);
    let solved_anew = [clump.is_on(), lubrication.is_on(), polydispersity.is_on()];
    let of_effects: u32 = solved_anew.map(u32::from).iter().sum();
    let of_shape = of_shape + u32::from(nutates || meets_moving);
    let of_shape = of_shape + u32::from(meets_edges) + u32::from(meets_facets);
    of_shape + of_effects + u32::from(is_parted(scene))
}

/// Share of a penetration that is corrected in one substep (Baumgarte).
const CORRECTION: f64 = 0.2;
/// Grains from this radius on have the numbers of [`Small::OF_LARGE`]; those of smaller ones are in proportion `[m]`.
const LARGE: f64 = 2e-3;

/// Speeds that gravity gives in a substep, in which a contact at rest is no impact `[-]`.
const FALLS: f64 = 2.5;

/// Lengths and speeds that are too small to matter, of grains of a size.
///
/// A pour of grains s times as small, all lengths like them and times like their root, is the same pour: so lengths go
/// with the radius and speeds with its root. They are no larger for grains above 4 mm, which loses nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Small {
    /// Penetration that is left alone, so that resting contacts stay closed `[m]`.
    pub slop: f64,
    /// Fastest correction of a penetration `[m/s]`.
    pub correction_speed: f64,
    /// Fastest way out `[m/s]` that is asked of a contact whose grains have parted in an impact and are pressed
    /// together again in the same substep.
    pub pinned_speed: f64,
    /// Approach below which an impact is inelastic `[m/s]`: a matter of the contact solve, not of `impact`.
    pub impact_speed: f64,
    /// The same where a dashpot acts on rolling, which brakes a grain however slowly it is met `[m/s]`.
    pub damped_impact_speed: f64,
    /// Factor on the speeds over those of large grains `[-]`.
    pub slowness: f64,
}

impl Small {
    pub const OF_LARGE: Self = Self {
        slop: 1e-5,
        correction_speed: 0.5,
        pinned_speed: 0.1,
        impact_speed: 0.05,
        damped_impact_speed: 0.01,
        slowness: 1.0,
    };

    /// Of a scene's grains.
    pub fn of(scene: &Scene) -> Self {
        let fall = Vector3::from(scene.gravity).norm() * scene.settings().dt;
        Self::of_grains(scene.grains.radius(), fall)
    }

    /// Of grains of a radius `[m]` that gravity makes faster by `fall` in a substep `[m/s]`.
    fn of_grains(radius: f64, fall: f64) -> Self {
        let length = (radius / LARGE).min(1.0);
        let (large, speed) = (Self::OF_LARGE, length.sqrt());
        // What rests falls back by as much in a substep, and is no impact, however coarse that is.
        let least = (FALLS * fall).min(large.impact_speed);
        Self {
            slop: length * large.slop,
            correction_speed: speed * large.correction_speed,
            pinned_speed: speed * large.pinned_speed,
            impact_speed: least.max(speed * large.impact_speed),
            damped_impact_speed: speed * large.damped_impact_speed,
            slowness: speed,
        }
    }

    /// The bias of a closed contact of this gap, which pushes its bodies apart slowly `[m/s]`.
    pub fn push(&self, gap: f64, dt: f64) -> f64 {
        (CORRECTION * (gap + self.slop) / dt).clamp(-self.correction_speed, 0.0)
    }
}

/// Inverse moment of inertia of a sphere times its mass and squared radius, 5/2.
pub(crate) const INVERSE_INERTIA: f64 = 2.5;

/// Inverse of the tangential over the normal Delassus element of two spheres: 1 + 5/2.
pub(crate) const TANGENTIAL_INERTIA: f64 = 3.5;

/// Bias b of `0 <= w_n + b _|_ lambda_n >= 0` from the gap.
///
/// Open contacts may close their gap but not cross it; closed ones are pushed apart slowly.
#[inline(always)]
pub(crate) fn bias_lanes<W: Width>(gap: Reg<W>, dt: f64, small: &Small) -> Reg<W> {
    let (zero, step) = (Reg::splat(0.0), Reg::splat(dt));
    let push = Reg::splat(CORRECTION) * (gap + Reg::splat(small.slop)).over(step);
    gap.if_less(zero, push.max(Reg::splat(-small.correction_speed)), gap.over(step))
}

/// The bias of a contact of which a grain has had an impact: at the time `clock` of that impact there is this
/// gap, which opens at `w_n`. What the solve changes acts for the whole substep, so the gap counts that
/// would have been at its begin.
#[inline(always)]
pub(crate) fn bias_after_impact<W: Width>(
    gap: Reg<W>,
    w_n: Reg<W>,
    clock: Reg<W>,
    dt: f64,
    small: &Small,
) -> Reg<W> {
    let begin = (gap - clock * w_n).over(Reg::splat(dt)).max(Reg::splat(-small.pinned_speed));
    gap.if_less(Reg::splat(0.0), bias_lanes(gap, dt, small), begin)
}

/// The nearest point of the ball of radius `limit` to `impulse`: stick inside, slip on the rim.
#[inline(always)]
pub(crate) fn project_ball<W: Width>(impulse: Reg3<W>, limit: Reg<W>) -> Reg3<W> {
    let norm = impulse.norm();
    impulse.scale(limit.if_less(norm, limit.over(norm), Reg::splat(1.0)))
}

#[cfg(test)]
mod tests {
    use granulcal_scene::WallMaterial;
    use proptest::prelude::*;

    use super::*;
    use crate::lanes::{Lanes, Portable};

    type R = Reg<Portable>;

    fn first(value: R) -> f64 {
        let mut lanes = Lanes::ZERO;
        value.store(&mut lanes);
        lanes.0[0]
    }

    const DT: f64 = 1.0 / 2400.0;

    #[test]
    fn bodies_have_an_arithmetic_of_their_own() {
        let balls = Scene::funnel(0.12);
        let of = |shape| {
            let mut bodies = balls.clone();
            bodies.grains.shape = Some(shape);
            arithmetic(&bodies)
        };
        assert_eq!(arithmetic(&balls), 2);
        assert_eq!(of(GrainShape::Box { aspect: [1.0; 3] }), 12);
        assert_eq!(of(GrainShape::Cylinder { aspect: 1.0 }), 12);
        let superquadric = GrainShape::Superquadric { aspect: [1.0; 3], exponents: [2.0; 2] };
        assert_eq!(of(superquadric), 11);
        assert_eq!(of(GrainShape::Box { aspect: [1.0, 1.0, 2.0] }), 13);
        let mut boxed = Scene::funnel(0.12);
        boxed.grains.shape = Some(GrainShape::Box { aspect: [1.0; 3] });
        let shape = Shape::Box { min: [-0.1; 3], max: [0.1; 3], open: Vec::new() };
        boxed.walls.push(Wall::fixed(shape, WallMaterial::default()));
        assert_eq!(arithmetic(&boxed), 14);
        let mut clumps = balls.clone();
        clumps.effects.clump.aspect = 1.5;
        assert_eq!(arithmetic(&clumps), 4);
        let mut wet = balls.clone();
        wet.effects.lubrication.viscosity = 1e-3;
        assert_eq!(arithmetic(&wet), 3);
        let mut unlike = balls.clone();
        unlike.effects.polydispersity.cv = 0.3;
        assert_eq!(arithmetic(&unlike), 3);
        let mut sand = balls.clone();
        assert_eq!((law_of(&sand), Small::of(&sand)), (LAW, Small::OF_LARGE));
        sand.grains.diameter = 1e-3;
        let small = Small::of(&sand);
        assert_eq!((law_of(&sand), small.slowness, small.impact_speed), (LAW_OF_SMALL, 0.5, 0.025));
        sand.effects.adhesion.bond = 1.0;
        assert_eq!(law_of(&sand), LAW_ACROSS_GAPS);
        let mut wet = boxed.clone();
        wet.grains.shape = None;
        wet.effects.capillary.bond = 1.0;
        assert_eq!(law_of(&wet), LAW_OF_BRIDGES);
        wet.effects.capillary.walls = 0.0;
        assert_eq!(law_of(&wet), LAW_ACROSS_GAPS);
        // At the substep of large grains nothing below 12 mm/s is an impact.
        let mut unequal = Scene::drop(0.1);
        assert_eq!(law_of(&unequal), LAW);
        unequal.effects.polydispersity.cv = 0.1;
        assert_eq!((law_of(&unequal), arithmetic(&unequal)), (LAW_OF_PARTED, 4));
        // The lattice of the funnel is two diameters wide.
        let mut poured = Scene::funnel(0.12);
        poured.effects.polydispersity.cv = 0.3;
        assert_eq!(law_of(&poured), LAW);
        sand.grains.diameter = 1e-5;
        assert!((Small::of(&sand).impact_speed - 2.5 * 9.81 / 2000.0).abs() < 1e-12);
    }

    #[test]
    fn bias_has_its_modes() {
        let bias = |gap| first(bias_lanes(R::splat(gap), DT, &Small::OF_LARGE));
        assert_eq!(bias(1e-3), 1e-3 / DT); // open: the gap may close
        assert_eq!(bias(0.0), 0.0);
        assert_eq!(bias(-1e-2), -Small::OF_LARGE.correction_speed); // deep: capped correction
        assert!((bias(-2e-5) + CORRECTION * 1e-5 / DT).abs() < 1e-12);
        assert_eq!(bias(-Small::OF_LARGE.slop), 0.0); // at the slop nothing moves
    }

    proptest! {
        #[test]
        fn projection_is_inside_and_idempotent(
            x in -9f64..9.0, y in -9f64..9.0, z in -9f64..9.0, limit in 0f64..5.0,
        ) {
            let vector = Reg3 { x: R::splat(x), y: R::splat(y), z: R::splat(z) };
            let once = project_ball(vector, R::splat(limit));
            prop_assert!(first(once.norm()) <= limit * (1.0 + 1e-14));
            let twice = project_ball(once, R::splat(limit));
            prop_assert!(first((twice - once).norm()) <= 1e-14 * limit);
            if first(vector.norm()) <= limit {
                prop_assert_eq!(first((once - vector).norm()), 0.0);
            }
        }
    }
}
