use std::f64::consts::PI;

use super::*;

const GRAVITY: f64 = 9.81;

fn ground(viscosity: f64, puddle: f64) -> Ground {
    Ground { gravity: GRAVITY, viscosity, puddle, suction: (0.0, 1.0), gate: None }
}

/// A flow of rings of `ring` with a surface of its own.
fn shaped(ring: f64, count: usize, height: impl Fn(f64) -> f64) -> RadialFlow {
    let mut flow = RadialFlow::at_rest(ring, count, 0.0, &Solids::default());
    for (at, q) in flow.thickness.iter_mut().enumerate() {
        *q = height(RadialFlow::middle(at) * ring).max(0.0);
    }
    flow
}

/// Where the sheet is thinner than `least` for good, linear between rings `[m]`.
fn edge(flow: &RadialFlow, least: f64) -> f64 {
    let ring = flow.thickness.iter().rposition(|&q| q >= least).expect("liquid");
    let [here, next] = [flow.thickness[ring], flow.thickness[ring + 1]];
    flow.ring * (RadialFlow::middle(ring) + (here - least) / (here - next))
}

#[test]
fn a_paraboloid_stays_one_and_spreads_as_it_must() {
    // h = h_0 (R_0 / R)^2 (1 - r^2 / R^2) and u = r R' / R solve the equations without friction if R'' = 2 g h_0 R_0^2
    // / R^3, that is R^2 = R_0^2 + 2 g h_0 t^2; of a flat one, which sinks slowly.
    let (radius, height, time) = (0.1, 0.005, 0.6);
    let mut flow = shaped(1e-3, 100, |r| height * (1.0 - (r / radius).powi(2)));
    let before = flow.volume();
    flow.advance_for(time, &ground(0.0, 0.0));
    assert!((flow.volume() / before - 1.0).abs() < 1e-12);
    let wide = (radius * radius + 2.0 * GRAVITY * height * time * time).sqrt();
    let middle = height * (radius / wide).powi(2);
    for share in [0.0, 0.3, 0.6, 0.9] {
        let ring = (share * wide / flow.ring) as usize;
        let at = RadialFlow::middle(ring) / wide * flow.ring;
        let expected = middle * (1.0 - at * at);
        let found = flow.thickness[ring];
        assert!((found - expected).abs() < 0.03 * middle, "{share}: {found} {expected}");
    }
    let found = edge(&flow, 0.05 * middle);
    assert!((found / (wide * 0.95f64.sqrt()) - 1.0).abs() < 0.03, "{found} {wide}");
}

#[test]
fn what_is_thick_spreads_as_huppert_s_current() {
    // Source: Huppert, J. Fluid Mech. 121 (1982) 43: r_N = 0.894 (g V^3 t / 3 nu)^(1/8) of a constant volume.
    let (viscosity, volume) = (5e-3, 2e-4);
    let mut flow = shaped(1e-3, 50, |_| volume / (PI * 0.05f64.powi(2)));
    let sheet = ground(viscosity, 0.0);
    // From the time at which the current would have been as wide as this column.
    let at = |time: f64| 0.894 * (GRAVITY * volume.powi(3) * time / (3.0 * viscosity)).powf(0.125);
    let mut before = 0.0;
    for time in [4.0, 16.0] {
        flow.advance_for(time - before, &sheet);
        before = time;
        // Its surface falls as (1 - r^2)^(1/3): steep at the edge.
        let found = edge(&flow, 2e-4);
        assert!((found / at(time) - 1.0).abs() < 0.02, "{time} s: {found} {}", at(time));
    }
}

#[test]
fn tension_holds_a_puddle_at_its_thickness() {
    let (puddle, volume) = (3e-3, 1e-4);
    let mut flow = shaped(2e-3, 20, |_| volume / (PI * 0.04f64.powi(2)));
    flow.advance_for(10.0, &ground(1e-4, puddle));
    let expected = (volume / (PI * puddle)).sqrt();
    let found = edge(&flow, 0.5 * puddle);
    assert!((found / expected - 1.0).abs() < 0.04, "{found} {expected}");
    let fastest = flow.speed.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    assert!(fastest < 1e-4, "{fastest}");
}

#[test]
fn solids_lift_the_surface_and_liquid_at_rest_stays() {
    // 20 mm of packed solids in the middle and none outside, with liquid up to 30 mm everywhere: nothing moves.
    let solids = Solids::packed(&[0.02; 15]);
    let mut flow = RadialFlow::at_rest(2e-3, 40, 0.03, &solids);
    assert!((flow.height(3, &solids) - 0.03).abs() < 1e-15);
    let walled = Ground { gate: Some((40, 0.0)), ..ground(1e-6, 0.0) };
    let before = flow.clone();
    advance(&mut flow, &solids, &walled, &mut [], 0.05);
    let moved = flow.speed.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    assert!(moved < 1e-12, "{moved}");
    assert_eq!(flow.thickness.len(), before.thickness.len());
}

#[test]
fn a_gap_below_a_tube_lets_out_what_a_sluice_does() {
    // A wide column, so that its level falls little: c a sqrt(2 g h) over a length of gap, c = 0.61 of a free outflow
    // from below a sharp edge (Henry 1950); here the gap is one ring's jet without contraction.
    let (height, gap) = (0.05, 5e-3);
    let mut flow = RadialFlow::at_rest(2e-3, 100, height, &Solids::default());
    let half_open = Ground { gate: Some((100, gap)), ..ground(0.0, 0.0) };
    flow.advance_for(0.05, &half_open);
    let before = flow.volume_within(100);
    flow.advance_for(0.02, &half_open);
    let out = (before - flow.volume_within(100)) / 0.02 / (2.0 * PI * 0.2);
    let ratio = out / (gap * (2.0 * GRAVITY * height).sqrt());
    assert!((0.55..0.8).contains(&ratio), "{ratio}");
}

impl RadialFlow {
    fn advance_for(&mut self, seconds: f64, ground: &Ground) {
        let step = 5e-4;
        for _ in 0..(seconds / step).round() as usize {
            advance(self, &Solids::default(), ground, &mut [], step);
        }
    }

    fn volume_within(&self, count: usize) -> f64 {
        let of = |(ring, q): (usize, &f64)| Self::middle(ring) * q;
        let rings = self.thickness.iter().enumerate().take(count);
        2.0 * PI * self.ring * self.ring * rings.map(of).sum::<f64>()
    }

    fn volume(&self) -> f64 {
        self.volume_within(self.thickness.len())
    }
}
