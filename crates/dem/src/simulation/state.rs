//! A simulation's whole state as bytes, and back: what a checkpoint holds.
//!
//! All that a substep reads is stored: places, velocities, contacts with their impulses, colours and lists, paths,
//! health and end rule. What follows from the scene (walls, material, settings) is in the header, and buffers that
//! every use fills anew are left out (`serde(skip)`). The bytes are a function of the state alone: equal bytes are
//! equal bits.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::Simulation;
use crate::bodies::{Bodies, BodiesState};
use crate::bonds::{Bond, Bonds};
use crate::checkpoint::{self, CheckpointHeader};
use crate::clumps::{ClumpState, Clumps};
use crate::contact_set::ContactSet;
use crate::contacts::Contacts;
use crate::effect::Bridges;
use crate::error::DemError;
use crate::health::HealthWatch;
use crate::impact::Impacts;
use crate::lanes::Row;
use crate::liquid::RadialFlow;
use crate::particles::Particles;
use crate::pour::Status;

/// What changes as a simulation goes on.
#[derive(Serialize, Deserialize)]
struct State<'a> {
    substep: usize,
    is_quiet: bool,
    seemed_ended: Option<(Status, usize)>,
    ended: Option<Status>,
    particles: Cow<'a, Particles>,
    contacts: Cow<'a, Contacts>,
    bridges: Cow<'a, Bridges>,
    on_layer: Cow<'a, ContactSet>,
    clumps: Option<ClumpState>,
    watch: Cow<'a, HealthWatch>,
}

/// The bytes behind that: of what a scene has besides.
struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    /// Reads one part; `or` says what the bytes are if they are none.
    fn take<T: Deserialize<'a>>(&mut self, or: &'static str) -> Result<T, DemError> {
        let strange = |_| DemError::CheckpointState { what: or };
        let (part, rest) = postcard::take_from_bytes(self.0).map_err(strange)?;
        self.0 = rest;
        Ok(part)
    }
}

impl Simulation {
    /// The whole state with what it is of, to go on from with [`Simulation::resume`]; valid at any substep.
    /// docs/theory/checkpoint.md has the layout.
    pub fn checkpoint(&self) -> Vec<u8> {
        checkpoint::seal(&self.header(), &self.state())
    }

    /// Goes on from a checkpoint of this scene, seed and settings, whatever the number of threads of either:
    /// every bit from here on is that of the simulation that wrote it.
    ///
    /// ```
    /// use granulcal_dem::{Scene, Simulation};
    ///
    /// let mut scene = Scene::drop(0.02);
    /// scene.grains.count = 10;
    /// let mut first = Simulation::new(&scene, 7)?;
    /// first.advance(0.05);
    /// let second = Simulation::new(&scene, 7)?.resume(&first.checkpoint())?;
    /// assert_eq!(second.run(), first.run());
    /// # Ok::<(), granulcal_dem::DemError>(())
    /// ```
    ///
    /// # Errors
    /// What [`CheckpointHeader::read`] says; [`DemError::CheckpointDiffers`] for another scene, seed or settings;
    /// [`DemError::CheckpointState`] for a state that granulcal has not written.
    pub fn resume(mut self, checkpoint: &[u8]) -> Result<Self, DemError> {
        let (header, state) = checkpoint::open(checkpoint)?;
        header.require_same(&self.header())?;
        let strange = |what| DemError::CheckpointState { what };
        let (state, rest): (State<'_>, _) =
            postcard::take_from_bytes(state).map_err(|_| strange("bytes that are no state"))?;
        let mut rest = Rest(rest);
        let mut bed_at_rest = None;
        if self.origin.scene.bed.is_some() {
            bed_at_rest = rest.take::<Option<Vec<Row>>>("bytes that are no bed")?;
            let of_bed = self.particles.count() - self.origin.scene.grains.count;
            if bed_at_rest.as_ref().is_some_and(|bed| bed.len() != of_bed) {
                return Err(strange("a bed that is not the scene's"));
            }
        }
        if let Some(bodies) = &mut self.bodies {
            let state: BodiesState = rest.take("bytes that are no bodies")?;
            bodies.take(state).map_err(strange)?;
        }
        if let Some(liquid) = &mut self.liquid {
            let state: Option<RadialFlow> = rest.take("bytes that are no liquid")?;
            liquid.take(state).map_err(strange)?;
        }
        if let Some(bonds) = &mut self.bonds {
            let state: Option<Vec<Bond>> = rest.take("bytes that are no bonds")?;
            bonds.take(state).map_err(strange)?;
        }
        if !rest.0.is_empty() {
            return Err(strange("more bytes than a state has"));
        }
        let State { substep, is_quiet, seemed_ended, ended, watch, .. } = state;
        let (mut particles, contacts, watch) =
            (state.particles.into_owned(), state.contacts.into_owned(), watch.into_owned());
        match (&mut self.clumps, &state.clumps) {
            (Some(clumps), Some(state)) => clumps.take(state).map_err(strange)?,
            (None, None) => {}
            _ => return Err(strange("grains of another shape")),
        }
        let (bridges, on_layer) = (state.bridges.into_owned(), state.on_layer.into_owned());
        particles.check_like(&self.particles).map_err(strange)?;
        contacts.check(self.particles.count(), self.around.walls.surfaces()).map_err(strange)?;
        on_layer.check(self.particles.count(), Some(1)).map_err(strange)?;
        if !watch.is_of(self.particles.count()) {
            return Err(strange("health of another number of grains"));
        }
        if substep != header.substep || seemed_ended.is_some_and(|(_, at)| at > substep) {
            return Err(strange("substeps that do not fit"));
        }
        self.is_quiet = is_quiet;
        (self.substep, self.seemed_ended, self.ended) = (substep, seemed_ended, ended);
        particles.period = self.particles.period;
        (self.particles, self.contacts, self.watch) = (particles, contacts, watch);
        (self.bridges, self.on_layer) = (bridges, on_layer);
        self.bed_at_rest = bed_at_rest;
        self.impacts = Impacts::default();
        Ok(self)
    }

    /// A hash of every bit of the state: XXH3-128 of the bytes that a checkpoint keeps of it. Equal hashes are
    /// equal simulations, whatever machine, threads or pieces of time made them.
    pub fn state_hash(&self) -> u128 {
        checkpoint::hash(&self.state())
    }

    fn header(&self) -> CheckpointHeader {
        let (scene, seed) = (&self.origin.scene, self.origin.seed);
        CheckpointHeader::new(scene, seed, self.around.settings, self.substep)
    }

    fn state(&self) -> Vec<u8> {
        let state = State {
            substep: self.substep,
            is_quiet: self.is_quiet,
            seemed_ended: self.seemed_ended,
            ended: self.ended,
            particles: Cow::Borrowed(&self.particles),
            contacts: Cow::Borrowed(&self.contacts),
            bridges: Cow::Borrowed(&self.bridges),
            on_layer: Cow::Borrowed(&self.on_layer),
            clumps: self.clumps.as_ref().map(Clumps::state),
            watch: Cow::Borrowed(&self.watch),
        };
        let mut bytes = postcard::to_stdvec(&state).expect("a state in memory");
        // Behind the rest, so that a state of spheres has the bytes that it had before there were bodies, beds, liquids
        // and bonds.
        if self.origin.scene.bed.is_some() {
            bytes.extend(postcard::to_stdvec(&self.bed_at_rest).expect("a state in memory"));
        }
        if let Some(state) = self.bodies.as_ref().map(Bodies::state) {
            bytes.extend(postcard::to_stdvec(&state).expect("a state in memory"));
        }
        if let Some(liquid) = &self.liquid {
            bytes.extend(postcard::to_stdvec(&liquid.state()).expect("a state in memory"));
        }
        if let Some(state) = self.bonds.as_ref().map(Bonds::state) {
            bytes.extend(postcard::to_stdvec(&state).expect("a state in memory"));
        }
        bytes
    }
}
