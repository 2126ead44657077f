//! The spring and dashpot of a contact in an impact, in a time of its own (docs/theory/contact.md, Impacts).
//!
//! Compression d and closing speed s, time in units of the undamped contact's 1/omega, so that d is a velocity, too:
//!
//! ```text
//! d' = s,    s' = -f,    f = max(0, d + 2 beta s) while d >= 0, else 0
//! ```
//!
//! The dashpot never pulls: a contact that closes at s lets go, where f vanishes, with -e s and
//! `e = exp(-2 beta acos(beta) / sqrt(1 - beta^2))`, `acosh` and `sqrt(beta^2 - 1)` beyond beta = 1. Functions of the
//! crate libm, whose bits are the same on every machine. Source: Schwager and Poeschel, Granular Matter 9 (2007) 465,
//! doi:10.1007/s10035-007-0065-z.

/// Restitution below which a contact swallows its closing at once: the dashpot is then stiffer than any micro-step.
const PLASTIC: f64 = 1e-5;

/// How a contact with a given restitution moves by itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spring {
    /// What it was made for `[-]`.
    restitution: f64,
    mode: Mode,
    /// Micro-step.
    h: f64,
    /// `(d, s)` after a micro-step, while it pushes: the rows of a matrix.
    through: [f64; 4],
}

#[derive(Clone, Copy, Debug)]
enum Mode {
    /// beta = cos phi, nu = sin phi.
    Rings { beta: f64, nu: f64 },
    /// beta = 1.
    Critical,
    /// beta = cosh psi, nu = sinh psi; two rates of decay, beta - nu and beta + nu.
    Creeps { beta: f64, nu: f64, slow: f64, fast: f64 },
    /// e = 0.
    Plastic,
}

impl Mode {
    /// Newton's method on `G = -ln e`: `2 phi cot phi` below 2, `2 psi coth psi` above.
    fn of(restitution: f64) -> Self {
        if restitution < PLASTIC {
            return Self::Plastic;
        }
        let wanted = -libm::log(restitution.min(1.0));
        if wanted == 2.0 {
            return Self::Critical;
        }
        if wanted < 2.0 {
            // From where the curve is steeper: phi cot phi <= 1 - phi^2 / 3.
            let mut phi = std::f64::consts::FRAC_PI_2.min((3.0 - 1.5 * wanted).sqrt());
            for _ in 0..ROUNDS {
                let (sin, cos) = libm::sincos(phi);
                let slope = 2.0 * (cos - phi / sin) / sin;
                phi -= (2.0 * phi * cos / sin - wanted) / slope;
            }
            // Without a dashpot nothing is lost, not even to rounding.
            let beta = if wanted == 0.0 { 0.0 } else { libm::cos(phi) };
            return Self::Rings { beta, nu: libm::sin(phi) };
        }
        let mut psi = (0.5 * wanted).min((1.5 * wanted - 3.0).sqrt());
        for _ in 0..ROUNDS {
            let (sinh, cosh) = (libm::sinh(psi), libm::cosh(psi));
            let slope = 2.0 * (cosh - psi / sinh) / sinh;
            psi -= (2.0 * psi * cosh / sinh - wanted) / slope;
        }
        let (slow, fast) = (libm::exp(-psi), libm::exp(psi));
        Self::Creeps { beta: libm::cosh(psi), nu: libm::sinh(psi), slow, fast }
    }

    fn beta(self) -> f64 {
        match self {
            Self::Rings { beta, .. } | Self::Creeps { beta, .. } => beta,
            Self::Critical => 1.0,
            Self::Plastic => f64::INFINITY,
        }
    }
}

/// Newton steps; six are enough.
const ROUNDS: usize = 12;

impl Spring {
    /// The spring with this restitution in `[0, 1]`, for micro-steps of `h`.
    pub fn new(restitution: f64, h: f64) -> Self {
        let mut spring = Self { restitution, mode: Mode::of(restitution), h, through: [0.0; 4] };
        let ([d_d, s_d], [d_s, s_s]) = (spring.flow(1.0, 0.0, h), spring.flow(0.0, 1.0, h));
        spring.through = [d_d, d_s, s_d, s_s];
        spring
    }

    /// Whether it is the one for this restitution and micro-step.
    pub fn is_of(&self, restitution: f64, h: f64) -> bool {
        self.restitution == restitution && self.h == h
    }

    pub fn restitution(&self) -> f64 {
        self.restitution
    }

    /// `[d, s]` after a time, had it not to let go.
    fn flow(&self, d: f64, s: f64, time: f64) -> [f64; 2] {
        let (even, odd, beta) = match self.mode {
            Mode::Rings { beta, nu } => {
                let (sin, cos) = libm::sincos(nu * time);
                let decay = libm::exp(-beta * time);
                (decay * cos, decay * sin / nu, beta)
            }
            Mode::Critical => (libm::exp(-time), time * libm::exp(-time), 1.0),
            Mode::Creeps { beta, nu, .. } if nu * time < 1.0 => {
                let decay = libm::exp(-beta * time);
                (decay * libm::cosh(nu * time), decay * libm::sinh(nu * time) / nu, beta)
            }
            Mode::Creeps { beta, nu, slow, fast } => {
                let (late, early) = (libm::exp(-slow * time), libm::exp(-fast * time));
                (0.5 * (late + early), 0.5 * (late - early) / nu, beta)
            }
            Mode::Plastic => return [0.0; 2],
        };
        [d * even + (s + beta * d) * odd, s * even - (d + beta * s) * odd]
    }

    /// When the force, positive now, vanishes.
    fn release(&self, d: f64, s: f64) -> f64 {
        let beta = self.mode.beta();
        let force = d + 2.0 * beta * s;
        let rise = s - beta * d - 2.0 * beta * beta * s;
        match self.mode {
            Mode::Rings { nu, .. } => libm::atan2(force, -rise / nu) / nu,
            Mode::Critical => -force / rise,
            Mode::Creeps { nu, .. } => {
                libm::log1p(-2.0 * nu * force / (rise + nu * force)) / (2.0 * nu)
            }
            Mode::Plastic => 0.0,
        }
    }

    /// `[d, s]` of a contact with d >= 0 after a time.
    fn pressed(&self, d: f64, s: f64, time: f64) -> [f64; 2] {
        if let Mode::Plastic = self.mode {
            return [0.0, s.min(0.0)];
        }
        let beta = self.mode.beta();
        if s <= 0.0 && d + 2.0 * beta * s <= 0.0 {
            return [d + time * s, s];
        }
        let m = &self.through;
        let [d_end, s_end] = if time == self.h {
            [m[0] * d + m[1] * s, m[2] * d + m[3] * s]
        } else {
            self.flow(d, s, time)
        };
        if d_end + 2.0 * beta * s_end > 0.0 {
            return [d_end, s_end];
        }
        let at = self.release(d, s);
        let at = if at.is_finite() { at.clamp(0.0, time) } else { time };
        let [d, s] = self.flow(d, s, at);
        [d + (time - at) * s, s]
    }

    /// Compression and closing speed after a micro-step; `d < 0` is a gap that has to close first.
    pub fn advance(&self, d: f64, s: f64) -> [f64; 2] {
        if d >= 0.0 {
            return self.pressed(d, s, self.h);
        }
        let end = d + self.h * s;
        if end <= 0.0 { [end, s] } else { self.pressed(0.0, s, end / s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_by_itself_rebounds_with_its_restitution_whatever_the_micro_step() {
        let critical = (-2f64).exp();
        let near = [critical, critical * (1.0 + 1e-9), critical * (1.0 - 1e-9), 0.136, 0.135];
        for e in [1.0, 0.99, 0.9, 0.6, 0.3, 0.14, 0.1, 0.05, 0.01].into_iter().chain(near) {
            for h in [0.01, 0.1, 0.25, 0.4, 1.0, 3.0] {
                let spring = Spring::new(e, h);
                let [mut d, mut s] = [0.0, 2.0];
                while s > 0.0 || d + 2.0 * spring.mode.beta() * s > 0.0 {
                    [d, s] = spring.advance(d, s);
                }
                assert!((s / -2.0 / e - 1.0).abs() < 1e-10, "e {e}, h {h}: {s}");
            }
        }
        assert_eq!(Spring::new(0.0, 0.25).advance(0.0, 2.0), [0.0, 0.0]);
        assert_eq!(Spring::new(0.0, 0.25).advance(0.0, -2.0), [0.0, -2.0]);
    }

    #[test]
    fn its_energy_never_rises() {
        for e in [0.0, 0.01, 0.3, 0.9, 1.0] {
            let spring = Spring::new(e, 0.25);
            for (d, s) in
                [(0.0, 1.0), (1.0, 1.0), (1.0, -0.1), (1.0, -3.0), (-0.1, 1.0), (2.0, 0.0)]
            {
                let [d_end, s_end] = spring.advance(d, s);
                let energy = |d: f64, s: f64| d.max(0.0).powi(2) + s * s;
                assert!(energy(d_end, s_end) <= energy(d, s) * (1.0 + 1e-15), "e {e}: {d}, {s}");
            }
        }
    }

    #[test]
    fn a_gap_closes_before_it_pushes() {
        let spring = Spring::new(0.5, 0.25);
        assert_eq!(spring.advance(-1.0, 2.0), [-0.5, 2.0]);
        let [d, s] = spring.advance(-0.25, 2.0);
        assert!(d > 0.0 && s < 2.0);
    }
}
