//! One impact: a pair that meets, and every contact that is closed at that moment (docs/theory/contact.md, box 1).
//!
//! Springs and dashpots with the contacts' restitution, in the limit of infinite stiffness: nothing moves meanwhile.
//! Each contact takes its turn with the exact motion of its own spring through a micro-step, and friction under what
//! that pressed. Every turn takes energy, so the whole does, whatever the coefficients.

use granulcal_scene::ImpactSettings;
use nalgebra::Vector3;

use super::friction::Friction;
use super::links::{Link, Links};
use super::members::Members;
use super::spring::Spring;
use crate::contact::Candidate;
use crate::contact_context::ContactContext;
use crate::contacts::Contacts;
use crate::law::INVERSE_INERTIA;
use crate::particles::Particles;

/// How long an impact lasts at most, in 1/omega: walls that close on a grain never let go. What still closes then is
/// for the contact solve `[-]`.
const LONGEST: f64 = 400.0;
/// Time between two turns of friction, in 1/omega: it has the direction of sliding to follow, not the spring `[-]`.
const FRICTION_PERIOD: f64 = 1.0;
/// Springs of restitutions that depend on speed are made for each contact; from so many on the old ones go.
const MANY_SPRINGS: usize = 64;

/// What an impact has done.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    /// Contacts that were closed, the pair's own among them.
    pub links: usize,
    /// 0 for a pair that touched nothing.
    pub micro_steps: usize,
    /// Whether contacts still pressed when the impact had lasted its longest.
    pub is_cut: bool,
    /// Work of moving walls per typical mass `[m^2/s^2]`.
    pub work_of_walls: f64,
    /// Energy of the grains that were hit, after over before and the walls' work `[-]`.
    pub energy_ratio: f64,
}

/// What stays the same while an impact is resolved.
struct Scenery<'a> {
    time: f64,
    particles: &'a Particles,
    contacts: &'a Contacts,
    around: &'a ContactContext,
    /// What gravity has done between the middle of the substep, whose velocities we have, and now.
    fallen: Vector3<f64>,
}

/// Room for one impact after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Cluster {
    members: Members,
    links: Links,
    springs: Vec<Spring>,
    /// The grains that the last impact has hit.
    pub hit: Vec<u32>,
}

impl Cluster {
    /// Lets a pair that meets at `time` `[s]` into the substep collide, with all that touches it, if it still closes
    /// fast enough. Leaves the grains that were hit where they are then.
    pub fn resolve(
        &mut self,
        pair: Candidate,
        time: f64,
        particles: &mut Particles,
        contacts: &Contacts,
        around: &ContactContext,
    ) -> Option<Outcome> {
        let fallen = around.gravity * (time - 0.5 * around.settings.dt);
        let scenery = Scenery { time, particles, contacts, around, fallen };
        self.clear();
        let closing = self.strike(pair, &scenery)?;
        let is_alone = self.links.len() == 1 && self.links[0].rolling_spring.is_none();
        let (micro_steps, is_cut) = if is_alone {
            self.collide_alone(closing);
            (0, false)
        } else {
            self.ring(around.settings.impact, &scenery)
        };
        self.give_sliding_back();
        let work_of_walls = if around.has_moving_walls { self.work_of_walls(&fallen) } else { 0.0 };
        let energy_ratio = self.write_back(time, particles, &fallen, work_of_walls);
        let links = self.links.len();
        Some(Outcome { links, micro_steps, is_cut, work_of_walls, energy_ratio })
    }

    fn clear(&mut self) {
        self.members.clear();
        self.links.clear();
        self.hit.clear();
        if self.springs.len() >= MANY_SPRINGS {
            self.springs.clear();
        }
    }

    /// Links the pair that meets and what touches either; the closing speed of the pair, if that is an impact's.
    fn strike(&mut self, pair: Candidate, scenery: &Scenery) -> Option<f64> {
        let (i, partner) = (pair.i as usize, pair.partner as usize);
        let first = self.members.grain(i, scenery.particles);
        let link = self.link(first, partner, true, scenery)?;
        let closing = -self.members.closing_rate(&link.ends, &link.normal);
        if closing <= scenery.around.impact_speed {
            return None;
        }
        let second = link.ends[1];
        self.links.push(&link);
        self.find_spring(0, closing, scenery.around);
        self.link_all_of(first, Some(pair.partner), scenery);
        if partner < scenery.particles.count() {
            self.link_all_of(second, None, scenery);
        }
        Some(closing)
    }

    /// Links the contacts of a member that are closed now, but not those that a partner has linked or `but`.
    fn link_all_of(&mut self, member: usize, but: Option<u32>, scenery: &Scenery) {
        self.members.set_linked(member);
        let grain = self.members.grain_of(member);
        for partner in scenery.contacts.partners(grain) {
            if but == Some(partner) {
                continue;
            }
            if let Some(link) = self.link(member, partner as usize, false, scenery) {
                self.links.push(&link);
            }
        }
    }

    /// A link to a partner that strikes or touches, unless that one's own links are known already.
    fn link(
        &mut self,
        member: usize,
        partner: usize,
        strikes: bool,
        scenery: &Scenery,
    ) -> Option<Link> {
        let Scenery { time, particles, around, fallen, .. } = scenery;
        let grain = self.members.grain_of(member);
        let sphere = particles.sphere_at(grain, *time);
        if let Some(surface) = partner.checked_sub(particles.count()) {
            let (wall, at) = (around.walls.wall(surface), sphere.vector());
            let near = around.walls.nearest(surface, &at, *time);
            let (gap, radius) = (near.distance - sphere.0[3], sphere.0[3]);
            // Not at hand: the sphere at the foreseen time may be, by a rounding, past the wall's edge.
            let touches = strikes || gap <= wall.material.softness * radius;
            if near.distance.is_infinite() || !touches {
                return None;
            }
            if self.links.has_wall_like(member, &near.normal) {
                return None;
            }
            let (velocity, omega) = wall.motion_at(&(at - near.distance * near.normal));
            let spin = radius * omega;
            // A contact sees the surface of its second body at v - n x w.
            let velocity = velocity + near.normal.cross(&spin) - fallen;
            let second = self.members.wall(velocity, spin);
            let law = around.wall_law(particles, grain, surface);
            return Some(Link::new([member, second], near.normal, law, &wall.material, strikes));
        }
        let theirs = particles.sphere_at(partner, *time);
        let apart = particles.nearest(sphere.vector() - theirs.vector());
        let touching = sphere.0[3] + theirs.0[3];
        let reach = touching * (1.0 + 0.5 * around.material.softness);
        let square = apart.norm_squared();
        if !strikes && (square > reach * reach || particles.has_left(partner)) {
            return None;
        }
        let second = self.members.grain(partner, particles);
        if self.members.is_linked(second) {
            return None;
        }
        let distance = square.sqrt();
        let normal = if distance > 0.0 { apart / distance } else { Vector3::z() };
        let law = around.pair_law(particles, grain, partner);
        Some(Link::new([member, second], normal, law, &around.material, strikes))
    }

    /// Gives a link that closes at a speed for the first time its spring.
    fn find_spring(&mut self, number: usize, closing: f64, around: &ContactContext) {
        let link = &self.links[number];
        let mut restitution = around.effects.restitution_at(link.restitution, closing);
        if link.exponent != 1.0 {
            restitution = libm::pow(restitution, link.exponent);
        }
        let h = around.settings.impact.micro_step;
        let at = self.springs.iter().position(|spring| spring.is_of(restitution, h));
        let at = at.unwrap_or_else(|| {
            self.springs.push(Spring::new(restitution, h));
            self.springs.len() - 1
        });
        self.links[number].spring = Some(at);
    }

    /// A pair that touches nothing: its spring's outcome, known without its motion.
    fn collide_alone(&mut self, closing: f64) {
        let link = &self.links[0];
        let restitution = self.springs[link.spring.expect("pressed")].restitution();
        let push = (1.0 + restitution) * closing * link.compliance_n;
        let friction = link.block.act_throughout(self.members.slip(link), push);
        self.members.push(&self.links[0], push);
        self.rub_with(0, &friction);
        self.links[0].total.normal = push;
        let [i, j] = self.links[0].ends;
        self.members.set_hit(i);
        self.members.set_hit(j);
    }

    /// Micro-steps, forward and backward through the links in turn, until nothing presses any more; returns their
    /// number, and whether they were cut short.
    fn ring(&mut self, settings: ImpactSettings, scenery: &Scenery) -> (usize, bool) {
        // A force, so that it does not depend on how finely time is cut.
        let slowness = scenery.around.small.slowness;
        let enough = slowness * settings.stopping_speed * settings.micro_step;
        let mut rubbed = 0;
        // A rolling spring has a motion of its own to follow.
        let period = if self.links.iter().any(|link| link.rolling_spring.is_some()) {
            1
        } else {
            (FRICTION_PERIOD / settings.micro_step).round().max(1.0) as usize
        };
        let most = (LONGEST / settings.micro_step) as usize;
        for micro_step in 0..most {
            let begin = self.links.len();
            let (mut strongest, mut turn) = (0.0_f64, 0);
            // Links that are found on the way come last either way.
            while turn < self.links.len() {
                let backward = micro_step % 2 == 1 && turn < begin;
                let number = if backward { begin - 1 - turn } else { turn };
                turn += 1;
                let pushed = self.press_on(number, settings.micro_step, scenery.around);
                if pushed > 0.0 {
                    strongest = strongest.max(pushed);
                    for member in self.links[number].ends {
                        // A grain that is hit brings its own contacts.
                        if self.members.set_hit(member) {
                            self.link_all_of(member, None, scenery);
                        }
                    }
                }
            }
            // In the first micro-step the pair's own spring may hardly push yet.
            let is_over = strongest < enough && micro_step > 1;
            if is_over || (micro_step + 1).is_multiple_of(period) {
                self.rub(settings.micro_step * (micro_step + 1 - rubbed) as f64);
                rubbed = micro_step + 1;
            }
            if is_over {
                return (micro_step + 1, false);
            }
        }
        self.rub(settings.micro_step * (most - rubbed) as f64);
        (most, true)
    }

    /// The normal motion of a link by itself through a micro-step; returns its impulse.
    #[inline]
    fn press_on(&mut self, number: usize, h: f64, around: &ContactContext) -> f64 {
        let link = &mut self.links[number];
        let closing = -self.members.closing_rate(&link.ends, &link.normal);
        let Some(spring) = link.spring else {
            if closing > around.impact_speed {
                self.find_spring(number, closing, around);
                return self.press_on(number, h, around);
            }
            // Gaps that open in between are remembered.
            link.compression = (link.compression + h * closing).min(0.0);
            return 0.0;
        };
        let [compression, left] = self.springs[spring].advance(link.compression, closing);
        link.compression = compression;
        let push = (closing - left) * link.compliance_n;
        if push <= 0.0 {
            return 0.0;
        }
        link.pushed += push;
        self.members.push(link, push);
        push
    }

    /// Friction of every link under what has been pressed since it last acted, a time ago.
    fn rub(&mut self, time: f64) {
        for number in 0..self.links.len() {
            let push = std::mem::take(&mut self.links[number].pushed);
            if push > 0.0 {
                self.roll_on_spring(number, push, time);
                let link = &self.links[number];
                let friction = link.block.act(&self.members.slip(link), push);
                self.rub_with(number, &friction);
                self.links[number].total.normal += push;
            }
        }
    }

    /// Lets the rolling spring of a link that has one act.
    fn roll_on_spring(&mut self, number: usize, push: f64, time: f64) {
        let Some(mut spring) = self.links[number].rolling_spring else { return };
        let r = self.members.slip(&self.links[number]).r;
        let m = spring.act(&r, push, time);
        self.links[number].rolling_spring = Some(spring);
        self.rub_with(number, &Friction { m, ..Friction::default() });
    }

    /// Applies and notes friction of a link.
    #[inline]
    fn rub_with(&mut self, number: usize, friction: &Friction) {
        let link = &mut self.links[number];
        if link.tangential_restitution > 0.0 {
            // Work of an impulse: itself times the mean of the velocities before and after.
            let slip = self.members.slip(link).u;
            let after = slip + link.block.a_t * friction.t + link.block.kappa * friction.m;
            link.total.sliding_taken -= 0.5 * friction.t.dot(&(slip + after));
        }
        self.members.rub(link, friction);
        link.total.friction += friction;
    }

    /// Tangential restitution, after Poisson: a contact gives e_t times its sliding impulse back, within its cone and
    /// no more work than e_t^2 of what sliding has taken.
    fn give_sliding_back(&mut self) {
        for number in 0..self.links.len() {
            let link = &self.links[number];
            let e_t = link.tangential_restitution;
            if e_t == 0.0 || link.total.normal == 0.0 {
                continue;
            }
            let slip = self.members.slip(link);
            let block = &link.block;
            let cone = block.sliding * link.total.normal;
            let along = link.total.friction.t;
            let length = along.norm();
            if length == 0.0 {
                continue;
            }
            let mut share = e_t.min((cone / length - 1.0).max(0.0));
            // work(share) = share along . u + share^2 A_t along^2 / 2 <= e_t^2 taken
            let (speed, stiff) = (along.dot(&slip.u), 0.5 * block.a_t * length * length);
            let most = e_t * e_t * link.total.sliding_taken;
            let root = (speed * speed + 4.0 * stiff * most).max(0.0).sqrt();
            share = share.min(((root - speed) / (2.0 * stiff)).max(0.0));
            let back = Friction { t: share * along, ..Friction::default() };
            self.rub_with(number, &back);
        }
    }

    /// Work of walls that move, per typical mass `[m^2/s^2]`.
    fn work_of_walls(&self, fallen: &Vector3<f64>) -> f64 {
        let of = |link: &Link| {
            let Some((velocity, spin)) = self.members.wall_motion(link.ends[1]) else { return 0.0 };
            let surface = velocity + fallen - link.normal.cross(&spin);
            let force = link.total.normal * link.normal + link.total.friction.t;
            force.dot(&surface) + link.rolling_impulse().dot(&spin)
        };
        self.links.iter().map(of).sum()
    }

    /// Puts the new velocities of the grains that were hit into `particles`; returns the ratio of their energies.
    fn write_back(
        &mut self,
        time: f64,
        particles: &mut Particles,
        fallen: &Vector3<f64>,
        work_of_walls: f64,
    ) -> f64 {
        let (mut before, mut after) = (work_of_walls, 0.0);
        for member in self.members.hit() {
            let grain = member.grain;
            let mass = 1.0 / particles.inverse_mass[grain];
            let energy = |v: Vector3<f64>, w: Vector3<f64>| {
                0.5 * mass * ((v + fallen).norm_squared() + w.norm_squared() / INVERSE_INERTIA)
            };
            particles.advance(grain, time);
            let body = &mut particles.bodies[grain];
            before += energy(body.velocity.vector(), body.spin.vector());
            after += energy(member.velocity, member.spin);
            body.velocity.set(&member.velocity);
            body.spin.set(&member.spin);
            self.hit.push(grain as u32);
        }
        after / before
    }
}
