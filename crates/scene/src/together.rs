//! What cannot be with what in one scene.

use crate::camera::{Mask, Projection};
use crate::check::seen_to_swing;
use crate::effects::{Effect, Effects};
use crate::end::RolledAway;
use crate::error::SceneError;
use crate::grain_shape::Solid;
use crate::observe::Observe;
use crate::preset::Preset;
use crate::scene::Scene;
use crate::start::Start;

/// Radius of a column of liquid in radii of a typical grain, which are the width of its rings: there are 2048 at most.
const WIDEST_LIQUID: f64 = 2000.0;
/// Largest ratio of a listed diameter to that of a typical grain, and one over the smallest `[-]`.
const UNLIKE: f64 = 50.0;

impl Scene {
    /// Refuses what cannot be with something else that is there.
    ///
    /// # Errors
    /// [`SceneError::Exclude`] and [`SceneError::Needs`] name both; [`SceneError::OutOfRange`] and
    /// [`SceneError::BadShape`] what is wrong with one.
    pub(crate) fn check_together(&self) -> Result<(), SceneError> {
        self.check_rolled_away()?;
        self.check_sizes()?;
        self.check_clump()?;
        self.check_shape()?;
        self.check_bodies()?;
        self.check_intruder()?;
        self.check_bed()?;
        self.check_fluid()?;
        self.check_liquid()?;
        self.check_bonds()?;
        self.check_layer()?;
        self.check_vibration()?;
        self.check_of_funnel()
    }

    /// Whether listed sizes may be those of these grains: millimetres among metres are not.
    fn check_sizes(&self) -> Result<(), SceneError> {
        let typical = self.grains.diameter;
        let listed = self.effects.polydispersity.diameters.iter().enumerate();
        for (number, &diameter) in listed {
            if !(typical / UNLIKE..=typical * UNLIKE).contains(&diameter) {
                let path = format!("effects.polydispersity.diameters.{number}");
                let allowed = "from a fiftieth to 50 times grains.diameter, in metres";
                return Err(SceneError::range(path, diameter, allowed));
            }
        }
        Ok(())
    }

    /// What grains that are not round cannot be with.
    fn check_clump(&self) -> Result<(), SceneError> {
        let Effects { polydispersity, adhesion, capillary, lubrication, fluid, .. } = &self.effects;
        let among_grains = [fluid.crowding, fluid.entrained, fluid.saturated];
        let others = [
            (polydispersity.path(), polydispersity.is_on()),
            // They would act once for each pair of a clump's spheres.
            (adhesion.path(), adhesion.is_on()),
            (capillary.path(), capillary.is_on()),
            (lubrication.path(), lubrication.is_on()),
            (
                "effects.fluid.crowding, entrained or saturated",
                fluid.is_on() && among_grains.iter().any(|&share| share > 0.0),
            ),
            ("outflow", self.outflow.is_some()),
            ("periodic", self.periodic.is_some()),
        ];
        if self.effects.clump.is_on() { exclude("effects.clump", &others) } else { Ok(()) }
    }

    /// What convex bodies cannot be with: they have walls, gravity and the plain law.
    fn check_shape(&self) -> Result<(), SceneError> {
        let Some(shape) = &self.grains.shape else {
            let (one, needs) = ("start.orientations", "grains.shape");
            let is_turned = matches!(self.start, Start::Poses { .. });
            return if is_turned { Err(SceneError::Needs { one, needs }) } else { Ok(()) };
        };
        shape.check()?;
        Solid::new(shape, self.grains.diameter)?;
        let Effects { ground, tilt, funnel, outlet, .. } = self.effects.clone();
        let alone = Effects { ground, tilt, funnel, outlet, ..Effects::default() };
        let looks = |observe: &Observe| {
            observe.images.is_some() || observe.surface.is_some() || observe.front.is_some()
        };
        let others = [
            ("effects but ground, tilt, funnel and outlet", self.effects != alone),
            ("outflow", self.outflow.is_some()),
            ("periodic", self.periodic.is_some()),
            ("observe.images, surface or front", self.observe.as_ref().is_some_and(looks)),
            ("an orthographic camera", self.camera.projection == Projection::Orthographic),
            ("preset paper", self.preset == Preset::Paper),
        ];
        exclude("grains.shape", &others)
    }

    /// Refuses numbers of balls' impacts, the grains' or a wall's, where grains are not round.
    fn check_bodies(&self) -> Result<(), SceneError> {
        let body = match (self.effects.clump.is_on(), &self.grains.shape) {
            (true, _) => self.effects.clump.path(),
            (false, Some(_)) => "grains.shape",
            (false, None) => return Ok(()),
        };
        let walls = self.walls.iter().enumerate();
        let named = walls.map(|(index, wall)| (format!("walls.{index}.material"), wall.material));
        let funnel = self.funnel.iter().map(|f| ("funnel.material".to_owned(), f.material));
        let ground = std::iter::once(("ground.material".to_owned(), self.ground.material));
        self.material.check_bodies("material", body)?;
        ground
            .chain(funnel)
            .chain(named)
            .try_for_each(|(name, wall)| wall.over(&self.material).check_bodies(&name, body))
    }

    /// What grains that leave once they have rolled away cannot be with: what might turn one back, what looks at where
    /// it is, and bodies that do not roll as balls do.
    fn check_rolled_away(&self) -> Result<(), SceneError> {
        if self.end.rolled_away == RolledAway::Stay {
            return Ok(());
        }
        let slopes = self.gravity[0] != 0.0 || self.gravity[1] != 0.0 || self.gravity[2] >= 0.0;
        let others = [
            ("walls", !self.walls.is_empty()),
            ("gravity that is not along -z", slopes),
            ("effects.tilt", self.effects.tilt.is_on()),
            ("effects.vibration", self.effects.vibration.is_on()),
            ("effects.clump", self.effects.clump.is_on()),
            ("grains.shape", self.grains.shape.is_some()),
            ("observe", self.observe.is_some()),
            ("views", !self.views.is_empty()),
            ("outflow", self.outflow.is_some()),
            ("periodic", self.periodic.is_some()),
            ("intruder", self.intruder.is_some()),
            ("bed", self.bed.is_some()),
        ];
        exclude("end.rolled_away = \"leave\"", &others)
    }

    /// What an intruder cannot be with.
    fn check_intruder(&self) -> Result<(), SceneError> {
        let Some(intruder) = &self.intruder else { return Ok(()) };
        intruder.check(&self.grains)?;
        let others = [
            ("grains.shape", self.grains.shape.is_some()),
            ("effects.clump", self.effects.clump.is_on()),
            ("outflow", self.outflow.is_some()),
            ("periodic", self.periodic.is_some()),
        ];
        exclude("intruder", &others)?;
        // The fluid's weight and drag are those of grains of one density.
        let Effects { fluid, liquid, .. } = &self.effects;
        let others = [(fluid.path(), fluid.is_on()), (liquid.path(), liquid.is_on())];
        let is_like = intruder.density == self.grains.density;
        if is_like { Ok(()) } else { exclude("intruder.density other than the grains'", &others) }
    }

    /// What a liquid that flows by itself cannot be with: it stands about the z axis on a level ground.
    fn check_liquid(&self) -> Result<(), SceneError> {
        let slopes = self.gravity[0] != 0.0 || self.gravity[1] != 0.0 || self.gravity[2] >= 0.0;
        let others = [
            ("effects.fluid", self.effects.fluid.is_on()),
            ("gravity that is not along -z", slopes),
            ("effects.tilt", self.effects.tilt.is_on()),
            ("effects.vibration", self.effects.vibration.is_on()),
            ("effects.clump", self.effects.clump.is_on()),
            ("periodic", self.periodic.is_some()),
            ("bed", self.bed.is_some()),
        ];
        if self.effects.liquid.is_on() {
            let radius = self.effects.liquid.radius;
            if radius > WIDEST_LIQUID * self.grains.radius() {
                let allowed = "at most 2000 radii of a grain";
                return Err(SceneError::range("effects.liquid.radius", radius, allowed));
            }
            return exclude("effects.liquid", &others);
        }
        if self.observe.as_ref().is_some_and(Observe::asks_for_liquid) {
            let allowed = "positive where observe.liquid or observe.clock asks for its front";
            let got = self.effects.liquid.height;
            return Err(SceneError::range("effects.liquid.height", got, allowed));
        }
        Ok(())
    }

    /// What bonds cannot be with: bodies of several spheres.
    fn check_bonds(&self) -> Result<(), SceneError> {
        let others = [
            ("effects.clump", self.effects.clump.is_on()),
            ("grains.shape", self.grains.shape.is_some()),
        ];
        if self.effects.bonds.is_on() { exclude("effects.bonds", &others) } else { Ok(()) }
    }

    /// What a bed cannot be with. It is seen by what has become of it, which a map of heights tells.
    fn check_bed(&self) -> Result<(), SceneError> {
        let Some(bed) = &self.bed else { return Ok(()) };
        bed.check(&self.grains)?;
        let others = [
            ("a start that is no ball", !matches!(self.start, Start::Ball { .. })),
            (
                "a camera that is not orthographic",
                self.camera.projection != Projection::Orthographic,
            ),
            ("camera.mask = \"colour\"", self.camera.mask != Mask::Height),
            ("grains.shape", self.grains.shape.is_some()),
            ("effects.clump", self.effects.clump.is_on()),
            (self.effects.polydispersity.path(), self.effects.polydispersity.is_on()),
            ("funnel", self.funnel.is_some()),
            ("outflow", self.outflow.is_some()),
            ("periodic", self.periodic.is_some()),
            ("intruder", self.intruder.is_some()),
            ("observe", self.observe.is_some()),
            ("views", !self.views.is_empty()),
        ];
        exclude("bed", &others)
    }

    /// What a fluid around the grains cannot be with: where it fills them up to their own surface that has an end.
    fn check_fluid(&self) -> Result<(), SceneError> {
        let is_in_them = self.effects.fluid.is_on() && self.effects.fluid.saturated > 0.0;
        let slopes = self.gravity[0] != 0.0 || self.gravity[1] != 0.0 || self.gravity[2] >= 0.0;
        let others = [
            ("periodic", self.periodic.is_some()),
            // Its pressure is that of a fluid below a surface that is told along the ground's normal.
            ("effects.tilt", self.effects.tilt.is_on()),
            ("gravity that is not along -z", slopes),
        ];
        if is_in_them { exclude("effects.fluid.saturated", &others) } else { Ok(()) }
    }

    /// What pulls and films cannot be with: the ground that they see is the hard one, below a soft layer.
    fn check_layer(&self) -> Result<(), SceneError> {
        let Effects { layer, adhesion, capillary, lubrication, .. } = &self.effects;
        let others: [&dyn Effect; 3] = [adhesion, capillary, lubrication];
        let others = others.map(|other| (other.path(), other.is_on()));
        if layer.is_on() { exclude(layer.path(), &others) } else { Ok(()) }
    }

    /// Refuses a table that shakes too fast for the substeps.
    fn check_vibration(&self) -> Result<(), SceneError> {
        let vibration = &self.effects.vibration;
        if !vibration.is_on() {
            return Ok(());
        }
        seen_to_swing("effects.vibration.frequency", vibration.frequency, self.settings().dt)
    }

    /// Refuses what says how the funnel is where there is none.
    fn check_of_funnel(&self) -> Result<(), SceneError> {
        let Effects { funnel, outlet, .. } = &self.effects;
        let of_it: [&dyn Effect; 2] = [funnel, outlet];
        match of_it.into_iter().find(|effect| self.funnel.is_none() && effect.is_on()) {
            Some(effect) => Err(SceneError::Needs { one: effect.path(), needs: "a funnel" }),
            None => Ok(()),
        }
    }
}

/// Refuses the first of `others` that is there, beside `one`, which is.
fn exclude(one: &'static str, others: &[(&'static str, bool)]) -> Result<(), SceneError> {
    match others.iter().find(|(_, is_there)| *is_there) {
        Some(&(other, _)) => Err(SceneError::Exclude { one, other }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GrainShape, Intruder, Outflow, Periodic, PeriodicAxis};

    #[test]
    fn what_only_balls_impacts_read_is_refused_by_name_of_other_grains() {
        let shape = GrainShape::Box { aspect: [1.0, 1.0, 2.0] };
        for (body, clump, shape) in
            [("effects.clump", 1.5, None), ("grains.shape", 1.0, Some(shape))]
        {
            let mut plain = Scene::drop(0.1);
            plain.effects.clump.aspect = clump;
            plain.grains.shape = shape;
            plain.check().unwrap();
            for (path, value) in [
                ("material.tangential_restitution", 0.3),
                ("material.softness", 0.01),
                ("material.touching_exponent", 0.5),
                ("material.impact_friction", 1.1),
                ("material.rolling_dashpot", 0.7),
                ("ground.material.softness", 0.0),
            ] {
                let said = plain.with(path, value).unwrap_err().to_string();
                assert!(said.contains(path) && said.contains(body), "{said}");
                Scene::drop(0.1).with(path, value).unwrap();
            }
        }
    }

    #[test]
    fn a_liquid_of_more_rings_than_there_are_is_refused() {
        let mut scene = Scene::drop(0.1);
        (scene.effects.liquid.height, scene.effects.liquid.radius) = (0.01, 4.0);
        scene.check().unwrap();
        let said = scene.with("effects.liquid.radius", 4.1).unwrap_err().to_string();
        assert!(said.contains("effects.liquid.radius must be at most 2000 radii"), "{said}");
    }

    #[test]
    fn effects_that_would_be_wrong_together_are_refused_by_name() {
        let refused = |base: Scene, path: &str, value: f64, other: &str| {
            let said = base.with(path, value).unwrap_err().to_string();
            assert!(said.contains(other), "{path}: {said}");
        };
        let drop = || Scene::drop(0.1);
        let mut clumps = drop();
        clumps.effects.clump.aspect = 1.3;
        for path in
            ["effects.adhesion.bond", "effects.capillary.bond", "effects.lubrication.viscosity"]
        {
            let other = path.rsplit_once('.').unwrap().0;
            drop().with(path, 0.5).unwrap();
            refused(clumps.clone(), path, 0.5, other);
            refused(drop().with("effects.layer.thickness", 1e-3).unwrap(), path, 0.5, other);
        }
        clumps.effects.fluid.density = 1000.0;
        clumps.check().unwrap();
        refused(clumps, "effects.fluid.crowding", 1.0, "effects.fluid.crowding");
        let mut wet = drop();
        (wet.effects.fluid.density, wet.effects.fluid.saturated) = (1000.0, 1.0);
        wet.check().unwrap();
        refused(wet.clone(), "effects.tilt.x", 0.1, "effects.tilt");
        wet.gravity[0] = 1.0;
        assert!(wet.check().unwrap_err().to_string().contains("gravity"));
        let shaken = drop().with("effects.vibration.acceleration", 0.3).unwrap();
        shaken.with("effects.vibration.frequency", 200.0).unwrap();
        refused(shaken, "effects.vibration.frequency", 201.0, "ten substeps");
    }

    #[test]
    fn grains_leave_only_where_nothing_turns_them_back() {
        let mut scene = Scene::funnel(0.12);
        assert!(!scene.to_toml().unwrap().contains("rolled_away"));
        scene.end.rolled_away = RolledAway::Leave;
        scene.check().unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        for (change, name) in [
            ((|s: &mut Scene| s.gravity[0] = 0.1) as fn(&mut Scene), "gravity"),
            (|s| s.outflow = Some(Outflow { below: -1.0, until: None }), "outflow"),
            (|s| s.effects.tilt.x = 0.01, "effects.tilt"),
        ] {
            let mut scene = scene.clone();
            change(&mut scene);
            let text = scene.check().unwrap_err().to_string();
            assert!(text.contains("rolled_away") && text.contains(name), "{text}");
        }
    }

    #[test]
    fn an_intruder_in_a_fluid_is_of_the_grains_density() {
        let mut scene = Scene::drop(0.1);
        let density = scene.grains.density;
        let (position, velocity) = ([0.0, 0.0, 0.2], [0.0; 3]);
        let mut intruder = Intruder { diameter: 0.02, density, position, velocity, enters: 0.0 };
        scene.effects.fluid.density = 1000.0;
        scene.intruder = Some(intruder.clone());
        scene.check().unwrap();
        intruder.density = 2.0 * density;
        scene.intruder = Some(intruder);
        let said = scene.check().unwrap_err().to_string();
        assert!(said.contains("intruder.density") && said.contains("effects.fluid"), "{said}");
        scene.effects.fluid.density = 0.0;
        scene.check().unwrap();
    }

    #[test]
    fn sizes_in_another_unit_are_refused() {
        let mut scene = Scene::drop(0.1);
        scene.effects.polydispersity.diameters = vec![1e-4, 4e-3, 0.19];
        scene.check().unwrap();
        scene.effects.polydispersity.diameters = vec![4e-3, 3.0];
        let said = scene.check().unwrap_err().to_string();
        assert!(said.contains("diameters.1") && said.contains("in metres, got 3"), "{said}");
    }

    #[test]
    fn what_would_do_nothing_or_end_at_a_seam_is_refused() {
        let mut scene = Scene::drop(0.1);
        scene.effects.outlet.aspect = 1.2;
        let said = scene.check().unwrap_err().to_string();
        assert!(said.contains("effects.outlet") && said.contains("funnel"), "{said}");
        let mut scene = Scene::drop(0.1);
        scene.periodic = Some(Periodic { axis: PeriodicAxis::X, from: -0.1, to: 0.1 });
        scene.check().unwrap();
        scene.effects.fluid.density = 1000.0;
        scene.check().unwrap();
        scene.effects.fluid.saturated = 1.0;
        let said = scene.check().unwrap_err().to_string();
        assert!(said.contains("saturated") && said.contains("periodic"), "{said}");
        scene.effects.fluid.saturated = 0.0;
        scene.effects.polydispersity.diameters = vec![4e-3, 0.06];
        let said = scene.check().unwrap_err().to_string();
        assert!(said.contains("periodic.to") && said.contains("widest"), "{said}");
    }
}
