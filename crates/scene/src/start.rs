//! Where the grains are when a pour begins.

use granulcal_numbers::half_open;
use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use crate::check::{finite, non_negative, positive};
use crate::error::SceneError;
use crate::grains::Grains;
use crate::walls::Funnel;

/// Most places of a lattice of which the lowest are taken.
const MOST_PLACES: f64 = 1e8;
/// Solid fraction of the closest packing of equal spheres, pi / sqrt(18).
const CLOSEST_PACKING: f64 = 0.740_480_489_693_061;
/// How far the norm of a stated quaternion may be from 1: what files round.
const UNIT: f64 = 1e-3;
/// What a limit in a message is within, as a share, so that it may be taken over as it is shown, with ten digits.
const TOLD: f64 = 1e-9;

/// The arrangement of the grains at time zero, at rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Start {
    /// A block about the z axis, filled layer by layer from below.
    Grid {
        /// Grains along x, y and z.
        counts: [usize; 3],
        /// Distance of neighbours `[m]`.
        spacing: f64,
        /// Half width of a uniform seeded displacement along each axis `[m]`.
        jitter: f64,
        /// Height of the lowest layer above the funnel's rim, or above the ground without a funnel `[m]`.
        base: f64,
    },
    /// A ball cut out of a face-centred cubic lattice, its lowest point at `height` above the ground, or above the
    /// scene's bed at rest.
    Ball {
        /// Height of the lowest grain's lowest point `[m]`.
        height: f64,
        /// Share of the lattice's volume that is grain `[-]`, or ball that holds a grain that is not round.
        solid_fraction: f64,
        /// Half width of a uniform seeded displacement along each axis `[m]`.
        jitter: f64,
        /// Whether the lattice has a random orientation, of the seed: along the axes it leaves heaps with four arms.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        turned: bool,
    },
    /// The inside of a cylinder, filled from its lowest point up on a cubic lattice along its axis: to settle in a
    /// tube, a drum or a hopper.
    Cylinder {
        /// Centre of one end `[m]`.
        from: [f64; 3],
        /// Centre of the other end `[m]`.
        to: [f64; 3],
        /// Radius `[m]`; no grain reaches beyond it.
        radius: f64,
        /// Distance of neighbours `[m]`.
        spacing: f64,
        /// Half width of a uniform seeded displacement along each axis `[m]`.
        jitter: f64,
    },
    /// Listed centres, for example those of another pour that has come to rest. The seed changes nothing.
    Positions {
        /// Centre of each grain `[m]`, shape `[grains.count, 3]`. Overlaps are pushed apart like any other.
        positions: Vec<[f64; 3]>,
    },
    /// Listed places of bodies, for example of grains with a shape that have come to rest. The seed changes nothing.
    Poses {
        /// Centre of mass of each grain `[m]`, shape `[grains.count, 3]`.
        positions: Vec<[f64; 3]>,
        /// Turn of each from its own axes to the scene's, as quaternions x, y, z, w, shape `[grains.count, 4]`.
        orientations: Vec<[f64; 4]>,
    },
}

impl Start {
    pub(crate) fn check(&self, grains: &Grains) -> Result<(), SceneError> {
        match self {
            &Self::Grid { counts, spacing, jitter, base } => {
                finite("start.base", base)?;
                positive("start.spacing", spacing)?;
                jitter_fits("start.jitter", jitter, spacing, grains.diameter)?;
                let capacity =
                    counts.iter().fold(1, |all: usize, &count| all.saturating_mul(count));
                if grains.count > capacity {
                    let count = grains.count;
                    return Err(SceneError::StartTooSmall { kind: "grid", capacity, count });
                }
            }
            &Self::Ball { height, solid_fraction, jitter, .. } => {
                non_negative("start.height", height)?;
                if !(solid_fraction > 0.0 && solid_fraction <= CLOSEST_PACKING) {
                    let allowed = "in (0, 0.7404]";
                    return Err(SceneError::range("start.solid_fraction", solid_fraction, allowed));
                }
                jitter_fits(
                    "start.jitter",
                    jitter,
                    lattice_spacing(grains.diameter, solid_fraction),
                    grains.diameter,
                )?;
            }
            &Self::Cylinder { from, to, radius, spacing, jitter } => {
                for (name, end) in [("from", from), ("to", to)] {
                    end.iter().try_for_each(|&c| finite(&format!("start.{name}"), c))?;
                }
                let length = (Vector3::from(to) - Vector3::from(from)).norm();
                positive("start (distance of from and to)", length)?;
                positive("start.radius", radius)?;
                positive("start.spacing", spacing)?;
                jitter_fits("start.jitter", jitter, spacing, grains.diameter)?;
                check_places("start", radius, length, spacing)?;
                let capacity = cylinder(grains, from, to, radius, spacing, jitter).len();
                if grains.count > capacity {
                    let count = grains.count;
                    return Err(SceneError::StartTooSmall { kind: "cylinder", capacity, count });
                }
            }
            Self::Positions { positions } => check_listed(positions, grains.count)?,
            Self::Poses { positions, orientations } => {
                check_listed(positions, grains.count)?;
                check_turns(orientations, grains.count)?;
            }
        }
        Ok(())
    }

    /// Whether every place is stated.
    pub fn is_listed(&self) -> bool {
        matches!(self, Self::Positions { .. } | Self::Poses { .. })
    }

    /// The turns that are stated, one for each grain; `pose` is where the funnel hangs beside its place.
    pub(crate) fn orientations(
        &self,
        pose: Option<&Isometry3<f64>>,
    ) -> Option<Vec<UnitQuaternion<f64>>> {
        let Self::Poses { orientations, .. } = self else { return None };
        let turn = |&[x, y, z, w]: &[f64; 4]| {
            let own = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
            pose.map_or(own, |pose| pose.rotation * own)
        };
        Some(orientations.iter().map(turn).collect())
    }

    /// How near two centres of a lattice may be `[m]`; none of listed ones.
    pub(crate) fn closest(&self, grains: &Grains) -> Option<f64> {
        let (spacing, jitter) = match self {
            &Self::Grid { spacing, jitter, .. } | &Self::Cylinder { spacing, jitter, .. } => {
                (spacing, jitter)
            }
            &Self::Ball { solid_fraction, jitter, .. } => {
                (lattice_spacing(grains.diameter, solid_fraction), jitter)
            }
            Self::Positions { .. } | Self::Poses { .. } => return None,
        };
        Some(spacing - 2.0 * jitter * 3f64.sqrt())
    }

    /// Centres of the grains `[m]`, one each. `grains` are the balls that hold them, `pose` is where the funnel hangs
    /// beside its place.
    pub(crate) fn positions(
        &self,
        grains: &Grains,
        funnel: Option<&Funnel>,
        pose: Option<&Isometry3<f64>>,
        seed: u64,
    ) -> Vec<Vector3<f64>> {
        let mut random = random(seed);
        let (mut positions, jitter) = match self {
            &Self::Grid { counts, spacing, jitter, base } => {
                let floor = funnel.map_or(0.0, Funnel::rim_height);
                (grid(grains.count, counts, spacing, floor + base), jitter)
            }
            &Self::Ball { height, solid_fraction, jitter, turned } => {
                let spacing = lattice_spacing(grains.diameter, solid_fraction);
                let turn = turned.then(|| orientation(&mut random));
                (ball(grains, spacing, height + jitter, turn), jitter)
            }
            &Self::Cylinder { from, to, radius, spacing, jitter } => {
                let mut points = cylinder(grains, from, to, radius, spacing, jitter);
                points.sort_by(|a, b| a.z.total_cmp(&b.z));
                points.truncate(grains.count);
                (points, jitter)
            }
            Self::Positions { positions } | Self::Poses { positions, .. } => {
                (positions.iter().map(|&position| Vector3::from(position)).collect(), 0.0)
            }
        };
        // The grains hang with the funnel, however they are placed.
        if let Some(pose) = pose {
            for point in &mut positions {
                *point = (pose * Point3::from(*point)).coords;
            }
        }
        if !self.is_listed() {
            displace(&mut positions, jitter, &mut random);
        }
        positions
    }
}

fn check_listed(positions: &[[f64; 3]], expected: usize) -> Result<(), SceneError> {
    let got = positions.len();
    if got != expected {
        return Err(SceneError::Length { name: "start.positions", got, expected });
    }
    for (grain, position) in positions.iter().enumerate() {
        for (axis, &value) in ["x", "y", "z"].iter().zip(position) {
            finite(&format!("start.positions.{grain}.{axis}"), value)?;
        }
    }
    Ok(())
}

fn check_turns(orientations: &[[f64; 4]], expected: usize) -> Result<(), SceneError> {
    let got = orientations.len();
    if got != expected {
        return Err(SceneError::Length { name: "start.orientations", got, expected });
    }
    for (grain, turn) in orientations.iter().enumerate() {
        let norm = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
        // NaN is none.
        let is_unit = (norm - 1.0).abs() <= UNIT;
        if !is_unit {
            let name = format!("start.orientations.{grain} (norm of the quaternion x, y, z, w)");
            return Err(SceneError::range(name, norm, "1 within a thousandth"));
        }
    }
    Ok(())
}

/// The random numbers of a seed.
pub(crate) fn random(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Moves every point by at most `jitter` `[m]` along each axis.
pub(crate) fn displace(points: &mut [Vector3<f64>], jitter: f64, random: &mut Pcg64) {
    for point in points {
        for axis in 0..3 {
            point[axis] += jitter * (2.0 * half_open(random.next_u64()) - 1.0);
        }
    }
}

/// Two neighbours may move towards each other by `jitter` along every axis, so twice its length must fit the gap that
/// grains of `diameter` leave in a lattice of `spacing` `[m]`.
pub(crate) fn jitter_fits(
    name: &str,
    jitter: f64,
    spacing: f64,
    diameter: f64,
) -> Result<(), SceneError> {
    non_negative(name, jitter)?;
    let gap = spacing - diameter;
    let refused = |name: String, got, bound, limit| {
        Err(SceneError::Lattice { name, got, bound, limit, needs: diameter })
    };
    let diagonal = 2.0 * 3f64.sqrt();
    if gap < 0.0 {
        let table = name.strip_suffix(".jitter").unwrap_or(name);
        let least = (1.0 + TOLD) * (diameter + diagonal * jitter);
        return refused(format!("{table}.spacing"), spacing, "at least", least);
    }
    if diagonal * jitter <= gap + 1e-12 {
        return Ok(());
    }
    refused(name.to_owned(), jitter, "at most", (1.0 - TOLD) * gap / diagonal)
}

/// Refuses a lattice in a cylinder of more places than anybody fills.
pub(crate) fn check_places(
    of: &str,
    radius: f64,
    length: f64,
    spacing: f64,
) -> Result<(), SceneError> {
    let places = std::f64::consts::PI * radius * radius * length / spacing.powi(3);
    if places <= MOST_PLACES {
        return Ok(());
    }
    let name = format!("{of} (places of the lattice in the cylinder)");
    let allowed = "at most 1e8: a smaller cylinder, or a wider spacing, holds as many grains";
    Err(SceneError::range(&name, places, allowed))
}

fn lattice_spacing(diameter: f64, solid_fraction: f64) -> f64 {
    diameter * (CLOSEST_PACKING / solid_fraction).cbrt()
}

fn grid(count: usize, counts: [usize; 3], spacing: f64, bottom: f64) -> Vec<Vector3<f64>> {
    let centred = |index: usize, n: usize| spacing * (index as f64 - 0.5 * (n as f64 - 1.0));
    (0..count)
        .map(|index| {
            let (x, rest) = (index % counts[0], index / counts[0]);
            let (y, z) = (rest % counts[1], rest / counts[1]);
            Vector3::new(centred(x, counts[0]), centred(y, counts[1]), bottom + spacing * z as f64)
        })
        .collect()
}

/// The points of a cubic lattice along the axis of a cylinder at which a grain that may move by `jitter` fits into it.
pub(crate) fn cylinder(
    grains: &Grains,
    from: [f64; 3],
    to: [f64; 3],
    radius: f64,
    spacing: f64,
    jitter: f64,
) -> Vec<Vector3<f64>> {
    let (from, to) = (Vector3::from(from), Vector3::from(to));
    let length = (to - from).norm();
    let axis = (to - from) / length;
    let u = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    let v = axis.cross(&u);
    let margin = grains.radius() + 3f64.sqrt() * jitter;
    let (room, free) = (radius - margin, length - 2.0 * margin);
    if room < 0.0 || free < 0.0 {
        return Vec::new();
    }
    let layers = (free / spacing).floor() as i64 + 1;
    let side = (room / spacing).floor() as i64;
    let first = 0.5 * (length - spacing * (layers - 1) as f64);
    let mut points = Vec::new();
    for layer in 0..layers {
        let middle = from + (first + spacing * layer as f64) * axis;
        for a in -side..=side {
            for b in -side..=side {
                let (a, b) = (spacing * a as f64, spacing * b as f64);
                if a.hypot(b) <= room {
                    points.push(middle + a * u + b * v);
                }
            }
        }
    }
    points
}

/// A rotation, all equally likely (Marsaglia 1972: a point of the unit ball in four dimensions).
///
/// Square roots and no sines, so that it is the same to the last bit on every machine.
fn orientation(random: &mut Pcg64) -> UnitQuaternion<f64> {
    loop {
        let mut coordinate = || 2.0 * half_open(random.next_u64()) - 1.0;
        let point = Quaternion::new(coordinate(), coordinate(), coordinate(), coordinate());
        if (0.01..=1.0).contains(&point.norm_squared()) {
            return UnitQuaternion::new_normalize(point);
        }
    }
}

/// The `count` lattice points nearest to the centre of a face-centred cubic lattice, which may be turned, lowest point
/// at `height`.
fn ball(
    grains: &Grains,
    spacing: f64,
    height: f64,
    turn: Option<UnitQuaternion<f64>>,
) -> Vec<Vector3<f64>> {
    let edge = spacing * std::f64::consts::SQRT_2;
    // Four points a cubic cell: this many cells each way hold twice the ball.
    let reach = (3.0 * grains.count as f64 / (8.0 * std::f64::consts::PI)).cbrt().ceil() as i64 + 1;
    let corners = [[0.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]];
    let mut points = Vec::new();
    for z in -reach..=reach {
        for y in -reach..=reach {
            for x in -reach..=reach {
                for corner in corners {
                    let cell = Vector3::new(x as f64, y as f64, z as f64);
                    points.push(edge * (cell + Vector3::from(corner)));
                }
            }
        }
    }
    // A stable sort: points at one distance keep the lattice's order on every machine.
    points.sort_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    points.truncate(grains.count);
    if let Some(turn) = turn {
        for point in &mut points {
            *point = turn * *point;
        }
    }
    let lowest = points.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    if lowest.is_finite() {
        let lift = height + grains.radius() - lowest;
        for point in &mut points {
            point.z += lift;
        }
    }
    points
}

#[cfg(test)]
mod tests;
