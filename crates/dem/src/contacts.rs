//! All contacts of a simulation: which are listed, and when the list is stale.
//!
//! A list made at time t covers every pair that comes nearer than a margin on straight paths. It stays
//! complete as long as every grain is within half the margin of its path. A grain that leaves it gets a new path
//! and the contacts that lie on it; when many do, the list is made afresh.

mod check;

use crate::Material;
use crate::assemble::{self, Seen};
use crate::bed::Bed;
use crate::contact::{ContactLaw, ContactSet, Listed};
use crate::impact::Impacts;
use crate::neighbor::{PairSearch, Path};
use crate::preset::SolverSettings;
use crate::scene::Scene;
use crate::wall::{Wall, walls_of};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Share of the grains from which on a new list is cheaper than single new paths.
const MANY: usize = 16;
/// Gap below which a contact is listed among those that will act, in radii of a typical grain `[-]`.
const NEAR: f64 = 0.02;

/// What the contacts are made of: walls, material and settings of one simulation.
#[derive(Clone, Debug)]
pub(crate) struct Surroundings {
    pub walls: Vec<Wall>,
    pub material: Material,
    pub gravity: Vector3<f64>,
    pub settings: SolverSettings,
    /// Radius of a typical grain `[m]`, the length that the settings are relative to.
    pub radius: f64,
    /// Gap below which a pair is listed in any case `[m]`.
    pub margin: f64,
}

impl Surroundings {
    pub fn new(scene: &Scene) -> Self {
        let settings = scene.preset.settings();
        Self {
            walls: walls_of(scene),
            material: scene.material,
            gravity: scene.gravity.into(),
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

    /// The coefficients of a contact between two grains.
    pub fn pair_law(&self, bed: &Bed, i: usize, j: usize) -> ContactLaw {
        let (r_i, r_j) = (bed.radius(i), bed.radius(j));
        let lever = [r_j / (r_i + r_j), r_i / (r_i + r_j)];
        contact_law(&self.material, [bed.inverse_mass[i], bed.inverse_mass[j]], lever)
    }

    /// The coefficients of a contact between a grain and a wall.
    pub fn wall_law(&self, bed: &Bed, i: usize, wall: usize) -> ContactLaw {
        contact_law(&self.walls[wall].material, [bed.inverse_mass[i], 0.0], [1.0, 0.0])
    }
}

fn contact_law(material: &Material, inverse_mass: [f64; 2], lever: [f64; 2]) -> ContactLaw {
    ContactLaw {
        inverse_mass,
        lever,
        sliding_friction: material.sliding_friction,
        rolling_friction: material.rolling_friction,
        torsional_friction: material.torsional_friction,
    }
}

/// Pairs and grains at walls, with their search.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Contacts {
    pub pairs: ContactSet,
    pub at_walls: ContactSet,
    search: PairSearch,
    #[serde(skip)]
    found: Vec<(u32, u32)>,
    #[serde(skip)]
    listed: Vec<Listed>,
    #[serde(skip)]
    far: Vec<Listed>,
    /// For each grain those that it is listed with: grains, and walls with the number of grains added.
    partners: Vec<Vec<u32>>,
    /// The way of each grain, from the time of the list on.
    paths: Vec<Path>,
    /// Grains whose path is newer than the list.
    renewed: Vec<u32>,
    /// Substeps since the list was made.
    age: usize,
    #[serde(skip)]
    strayed: Vec<u32>,
}

impl Contacts {
    /// Calls for a new list before the next substep: something other than the solve has set a grain in motion.
    pub fn forget_list(&mut self) {
        self.age = usize::MAX;
    }

    /// Lists what may touch in the coming substep.
    pub fn follow(&mut self, bed: &Bed, around: &Surroundings) {
        if self.paths.is_empty() || self.age >= around.settings.list_period {
            self.list(bed, around);
            return;
        }
        let now = self.age as f64 * around.settings.dt;
        self.strayed.clear();
        let dt = around.settings.dt;
        for (grain, path) in self.paths.iter().enumerate() {
            let at_end = bed.position(grain) + dt * bed.velocity(grain);
            if is_off(&(at_end - path.at(now + dt)), around) {
                self.strayed.push(grain as u32);
            }
        }
        if (self.strayed.len() + self.renewed.len()) * MANY > bed.count() {
            self.list(bed, around);
            return;
        }
        for number in 0..self.strayed.len() {
            self.renew(self.strayed[number] as usize, now, bed, around);
        }
    }

    /// Lists what a grain may touch after an impact at `time` `[s]` into the substep, if it will leave its path.
    pub fn follow_after_impact(
        &mut self,
        grain: usize,
        time: f64,
        bed: &Bed,
        around: &Surroundings,
    ) {
        let dt = around.settings.dt;
        // `assemble` has counted the present substep already.
        let begin = (self.age - 1) as f64 * dt;
        let end = bed.place_at(grain, dt).vector();
        if is_off(&(end - self.paths[grain].at(begin + dt)), around) {
            self.renew(grain, begin + time, bed, around);
        }
    }

    /// Those that a grain is listed with: grains, and walls with the number of grains added.
    pub fn partners(&self, grain: usize) -> &[u32] {
        &self.partners[grain]
    }

    /// Gaps, normals and biases of every listed contact, and what may be an impact.
    pub fn assemble(
        &mut self,
        bed: &Bed,
        around: &Surroundings,
        lost: &mut [bool],
        impacts: &mut Impacts,
    ) -> Seen {
        let (dt, found) = (around.settings.dt, &mut impacts.candidates);
        self.age += 1;
        let pairs = assemble::assemble_pairs(&mut self.pairs, bed, dt, found);
        let walls =
            assemble::assemble_walls(&mut self.at_walls, &around.walls, bed, dt, lost, found);
        pairs.max(walls)
    }

    /// The same for the contacts of grains that have had an impact.
    pub fn assemble_again(&mut self, bed: &Bed, around: &Surroundings) {
        assemble::refresh_pairs(&mut self.pairs, bed, around.settings.dt);
        assemble::refresh_walls(&mut self.at_walls, &around.walls, bed, around.settings.dt);
    }

    /// Number of listed contacts.
    pub fn count(&self) -> usize {
        self.pairs.len() + self.at_walls.len()
    }

    /// A new list for all grains.
    fn list(&mut self, bed: &Bed, around: &Surroundings) {
        self.age = 0;
        self.renewed.clear();
        self.paths.clear();
        self.paths.extend(
            (0..bed.count()).map(|i| Path { from: bed.position(i), velocity: bed.velocity(i) }),
        );
        self.partners.resize(bed.count(), Vec::new());
        self.partners.iter_mut().for_each(Vec::clear);
        let interval = around.settings.dt * around.settings.list_period as f64;

        self.search.pairs(bed, &self.paths, interval, around.margin, &mut self.found);
        // Contacts that will act come first: their batches are full of them, the others are passed over whole.
        self.listed.clear();
        self.far.clear();
        for &(i, partner) in &self.found {
            let contact = Listed { i, partner };
            let near = [i, partner].map(|n| bed.radius(n as usize)).iter().sum::<f64>()
                + NEAR * around.radius;
            let [a, b] = [i, partner].map(|n| &self.paths[n as usize]);
            if a.comes_within(b, near, interval) {
                self.listed.push(contact);
            } else {
                self.far.push(contact);
            }
            self.partners[i as usize].push(partner);
            self.partners[partner as usize].push(i);
        }
        self.listed.append(&mut self.far);
        self.pairs.rebuild(&self.listed, bed.count(), false, |contact| {
            around.pair_law(bed, contact.i as usize, contact.partner as usize)
        });

        self.listed.clear();
        for (grain, path) in self.paths.iter().enumerate() {
            let range = bed.radius(grain) + around.margin + interval * path.velocity.norm();
            for (number, wall) in around.walls.iter().enumerate() {
                if wall.surface.may_reach(&path.from, range) {
                    self.listed.push(Listed { i: grain as u32, partner: number as u32 });
                    self.partners[grain].push((bed.count() + number) as u32);
                }
            }
        }
        self.at_walls.rebuild(&self.listed, bed.count(), true, |contact| {
            around.wall_law(bed, contact.i as usize, contact.partner as usize)
        });
    }

    /// Gives a grain a new path from `now` `[s]` after the list on and lists what lies on it.
    fn renew(&mut self, grain: usize, now: f64, bed: &Bed, around: &Surroundings) {
        let settings = &around.settings;
        let left = settings.dt * settings.list_period as f64 - now;
        let (at, velocity) = (bed.position(grain), bed.velocity(grain));
        let path = Path { from: at, velocity };
        self.paths[grain] = Path { from: at - now * velocity, velocity };
        self.renewed.push(grain as u32);

        let half_way = 0.5 * left * velocity;
        let reach = bed.radius(grain) + half_way.norm() + around.margin;
        self.found.clear();
        let mut visit = |other: usize| self.found.push((grain as u32, other as u32));
        self.search.around(&(at + half_way), reach, &mut visit);
        // Those with a new path may have left the cell in which the search knows them.
        self.renewed.iter().for_each(|&other| visit(other as usize));
        for number in 0..self.found.len() {
            let other = self.found[number].1 as usize;
            if other == grain || self.partners[grain].contains(&(other as u32)) {
                continue;
            }
            let theirs = &self.paths[other];
            let theirs = Path { from: theirs.at(now), velocity: theirs.velocity };
            let limit = bed.radius(grain) + bed.radius(other) + around.margin;
            if path.comes_within(&theirs, limit, left) {
                let (i, j) = (grain.min(other), grain.max(other));
                self.partners[i].push(j as u32);
                self.partners[j].push(i as u32);
                let contact = Listed { i: i as u32, partner: j as u32 };
                self.pairs.append(contact, false, around.pair_law(bed, i, j));
            }
        }
        let range = bed.radius(grain) + around.margin + left * velocity.norm();
        for (number, wall) in around.walls.iter().enumerate() {
            let partner = (bed.count() + number) as u32;
            if !self.partners[grain].contains(&partner) && wall.surface.may_reach(&at, range) {
                self.partners[grain].push(partner);
                let contact = Listed { i: grain as u32, partner: number as u32 };
                self.at_walls.append(contact, true, around.wall_law(bed, grain, number));
            }
        }
    }
}

/// Whether a grain this far from its path has left it.
fn is_off(deviation: &Vector3<f64>, around: &Surroundings) -> bool {
    deviation.norm_squared() > 0.25 * around.margin * around.margin
}
