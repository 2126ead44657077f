//! All contacts of a simulation: which are listed, when the list is stale, and those that a solve creates.
//!
//! A list made at time t covers every pair that comes nearer than a margin on straight paths. It stays
//! complete until a grain has left its path by half the margin. A grain that the solve itself throws off
//! its path may meet a neighbour that is not listed: such *late* contacts are found after the sweeps and
//! solved with a few more, or an impact of 2 m/s would end a third of a radius inside the neighbour.

use nalgebra::Vector3;

use crate::Material;
use crate::assemble::{self, Seen};
use crate::bed::{Bed, Body};
use crate::contact::{ContactLaw, ContactSet, Listed};
use crate::neighbor::PairSearch;
use crate::preset::SolverSettings;
use crate::scene::Scene;
use crate::wall::{Wall, walls_of};

/// Overlap at the end of a substep from which a contact counts as missed, over the margin. It lies above
/// what an unfinished solve leaves of listed contacts.
const MISSED: f64 = 0.05;

/// What the contacts are made of: walls, material and settings of one simulation.
#[derive(Clone, Debug)]
pub(crate) struct Surroundings {
    pub walls: Vec<Wall>,
    pub material: Material,
    pub settings: SolverSettings,
    /// Radius of a typical grain `[m]`, the length that the settings are relative to.
    pub radius: f64,
    /// Gap below which a pair is listed in any case `[m]`.
    pub margin: f64,
    /// Whether any material bounces tangentially.
    pub tangential: bool,
}

impl Surroundings {
    pub fn new(scene: &Scene) -> Self {
        let walls = walls_of(scene);
        let bounces = |material: &Material| material.tangential_restitution > 0.0;
        let settings = scene.preset.settings();
        Self {
            tangential: bounces(&scene.material) || walls.iter().any(|w| bounces(&w.material)),
            walls,
            material: scene.material,
            settings,
            radius: scene.grains.radius(),
            margin: settings.margin * scene.grains.radius(),
        }
    }

    /// Replaces the preset's settings.
    pub fn set_settings(&mut self, settings: SolverSettings) {
        self.margin = settings.margin * self.radius;
        self.settings = settings;
    }
}

/// Pairs and grains at walls, with their search.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contacts {
    pub pairs: ContactSet,
    pub at_walls: ContactSet,
    pub late_pairs: ContactSet,
    pub late_at_walls: ContactSet,
    search: PairSearch,
    found: Vec<(u32, u32)>,
    listed: Vec<Listed>,
    /// Position and velocity of each grain when the list was made.
    paths: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Substeps since then.
    age: usize,
    strayed: Vec<usize>,
    /// What the solves of this substep have created.
    late: Vec<Late>,
}

impl Contacts {
    /// Makes a new list if the present one may miss a pair in the coming substep.
    pub fn refresh_list(&mut self, bed: &Bed, around: &Surroundings) {
        let is_due = self.paths.is_empty() || self.age >= around.settings.list_period;
        if is_due || self.has_strayed(bed, around) {
            self.list(bed, around);
        }
    }

    /// Calls for a new list before the next substep: something other than the solve has set a grain in motion.
    pub fn forget_list(&mut self) {
        self.age = usize::MAX;
    }

    /// Gaps, normals, biases and the warm start of every listed contact.
    pub fn assemble(
        &mut self,
        bed: &mut Bed,
        before: &[Body],
        around: &Surroundings,
        lost: &mut [bool],
    ) -> Seen {
        let dt = around.settings.dt;
        let pairs = assemble::refresh_pairs(&mut self.pairs, bed, before, dt);
        let set = &mut self.at_walls;
        let walls = assemble::refresh_walls(set, &around.walls, bed, before, dt, lost);
        self.age += 1;
        pairs.max(walls)
    }

    /// Finds and assembles the contacts that the solve has created, in addition to those of earlier
    /// calls in this substep; false if there are no new ones.
    pub fn add_late(
        &mut self,
        bed: &mut Bed,
        before: &mut Vec<Body>,
        around: &Surroundings,
        lost: &mut [bool],
    ) -> bool {
        let known = self.late.len();
        self.find_late(bed, around);
        if self.late.len() == known {
            return false;
        }
        let at_wall = self.late.partition_point(|late| !late.at_wall);
        let (pairs, walls) = self.late.split_at(at_wall);
        // Impulses found before are in the velocities already: late contacts begin without any.
        self.late_pairs.clear();
        self.late_at_walls.clear();
        self.listed.clear();
        self.listed.extend(pairs.iter().map(|late| late.contact));
        rebuild_pairs(&mut self.late_pairs, &self.listed, bed, around);
        self.listed.clear();
        self.listed.extend(walls.iter().map(|late| late.contact));
        rebuild_walls(&mut self.late_at_walls, &self.listed, bed, around);
        // A second impact in the same instant: it begins with the velocities that the first has left, for
        // all contacts. Kept to the first one's bias, a contact that has bounced would bounce again whenever
        // a late one slows it, and create energy.
        self.pairs.hold();
        self.at_walls.hold();
        before.clone_from(&bed.bodies);
        let dt = around.settings.dt;
        for set in [&mut self.pairs, &mut self.late_pairs] {
            assemble::refresh_pairs(set, bed, before, dt);
        }
        for set in [&mut self.at_walls, &mut self.late_at_walls] {
            assemble::refresh_walls(set, &around.walls, bed, before, dt, lost);
        }
        true
    }

    /// Ends the substep: the impulses of its solves become one.
    pub fn conclude(&mut self) {
        self.pairs.release();
        self.at_walls.release();
        self.late.clear();
        self.late_pairs.clear();
        self.late_at_walls.clear();
    }

    /// Number of listed contacts.
    pub fn count(&self) -> usize {
        self.pairs.len() + self.at_walls.len()
    }

    fn list(&mut self, bed: &Bed, around: &Surroundings) {
        self.age = 0;
        self.paths.clear();
        self.paths.extend((0..bed.count()).map(|i| (bed.positions[i], bed.velocity(i))));
        let interval = around.settings.dt * around.settings.list_period as f64;

        self.search.pairs(bed, interval, around.margin, &mut self.found);
        self.listed.clear();
        self.listed.extend(self.found.iter().map(|&(i, partner)| Listed { i, partner }));
        rebuild_pairs(&mut self.pairs, &self.listed, bed, around);

        self.listed.clear();
        for (grain, (position, velocity)) in self.paths.iter().enumerate() {
            let range = bed.radii[grain] + around.margin + interval * velocity.norm();
            for (number, wall) in around.walls.iter().enumerate() {
                if wall.surface.may_reach(position, range) {
                    self.listed.push(Listed { i: grain as u32, partner: number as u32 });
                }
            }
        }
        rebuild_walls(&mut self.at_walls, &self.listed, bed, around);
    }

    /// Whether any grain has left its listed path by half the margin.
    fn has_strayed(&self, bed: &Bed, around: &Surroundings) -> bool {
        let time = self.age as f64 * around.settings.dt;
        let slack = 0.5 * around.margin;
        self.paths.iter().zip(&bed.positions).any(|((from, velocity), at)| {
            (at - from - time * velocity).norm_squared() > slack * slack
        })
    }

    /// The grains that will have left their listed path by half the margin at the end of this substep.
    fn collect_strayed(&mut self, bed: &Bed, around: &Surroundings) {
        let dt = around.settings.dt;
        let time = self.age as f64 * dt;
        let slack = 0.5 * around.margin;
        self.strayed.clear();
        for (grain, (from, velocity)) in self.paths.iter().enumerate() {
            let at_end = bed.positions[grain] + dt * bed.velocity(grain);
            if (at_end - from - time * velocity).norm_squared() > slack * slack {
                self.strayed.push(grain);
            }
        }
    }

    /// Adds what the strayed grains will overlap at the end of this substep to `late`.
    fn find_late(&mut self, bed: &Bed, around: &Surroundings) {
        self.collect_strayed(bed, around);
        let dt = around.settings.dt;
        let missed = MISSED * around.margin;
        let at_end = |grain: usize| bed.positions[grain] + dt * bed.velocity(grain);
        for &i in &self.strayed {
            let end_i = at_end(i);
            self.search.around(&end_i, |j| {
                let touching = bed.radii[i] + bed.radii[j] - missed;
                if j != i && (end_i - at_end(j)).norm_squared() < touching * touching {
                    self.late.push(Late::pair(i.min(j), i.max(j)));
                }
            });
            for (number, wall) in around.walls.iter().enumerate() {
                if wall.surface.may_reach(&end_i, bed.radii[i] - missed) {
                    self.late.push(Late::at_wall(i, number));
                }
            }
        }
        self.late.sort_unstable();
        self.late.dedup();
    }
}

/// A contact that a solve has created. Pairs come before walls, each in the order of their grains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Late {
    at_wall: bool,
    contact: Listed,
}

impl Late {
    fn pair(i: usize, j: usize) -> Self {
        Self { at_wall: false, contact: Listed { i: i as u32, partner: j as u32 } }
    }

    fn at_wall(grain: usize, wall: usize) -> Self {
        Self { at_wall: true, contact: Listed { i: grain as u32, partner: wall as u32 } }
    }
}

fn rebuild_pairs(set: &mut ContactSet, listed: &[Listed], bed: &Bed, around: &Surroundings) {
    let material = &around.material;
    set.rebuild(listed, bed.count(), false, around.tangential, |contact| {
        let (i, j) = (contact.i as usize, contact.partner as usize);
        let (r_i, r_j) = (bed.radii[i], bed.radii[j]);
        let lever = [r_j / (r_i + r_j), r_i / (r_i + r_j)];
        contact_law(material, [bed.inverse_mass[i], bed.inverse_mass[j]], lever)
    });
}

fn rebuild_walls(set: &mut ContactSet, listed: &[Listed], bed: &Bed, around: &Surroundings) {
    set.rebuild(listed, bed.count(), true, around.tangential, |contact| {
        let material = &around.walls[contact.partner as usize].material;
        contact_law(material, [bed.inverse_mass[contact.i as usize], 0.0], [1.0, 0.0])
    });
}

fn contact_law(material: &Material, inverse_mass: [f64; 2], lever: [f64; 2]) -> ContactLaw {
    ContactLaw {
        inverse_mass,
        lever,
        sliding_friction: material.sliding_friction,
        rolling_friction: material.rolling_friction,
        restitution: material.restitution,
        tangential_restitution: material.tangential_restitution,
    }
}
