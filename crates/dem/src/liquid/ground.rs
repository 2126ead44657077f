//! What a sheet of liquid lies on, stands in and is made of.

/// A thinner sheet is dry ground `[m]`.
pub(super) const DRY: f64 = 1e-6;

/// What the flow goes by, besides itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground {
    /// Magnitude of gravity `[m/s^2]`.
    pub gravity: f64,
    /// Kinematic viscosity nu `[m^2/s]`.
    pub viscosity: f64,
    /// Thickness e of a puddle at rest `[m]`.
    pub puddle: f64,
    /// Height c that a surface between grains is drawn up by its menisci, and how far below the grains' surface they
    /// have all of it `[m]`.
    pub suction: (f64, f64),
    /// The circle that a tube stands on, and the gap below it `[m]`.
    pub gate: Option<(usize, f64)>,
}

impl Ground {
    /// Head of the pressure: the surface's height, less what menisci between grains draw it down by `[m]`.
    pub fn head(&self, height: f64, top: f64) -> f64 {
        let (most, over) = self.suction;
        if most == 0.0 {
            return height;
        }
        height - most * ((top - height) / over).clamp(0.0, 1.0)
    }

    /// The fastest wave where liquid is `deep` `[m/s]`; between grains menisci steepen it.
    pub fn wave(&self, deep: f64) -> f64 {
        let (most, over) = self.suction;
        let steeper = if most > 0.0 { 1.0 + most / over } else { 1.0 };
        (self.gravity * deep * steeper).sqrt()
    }

    /// What is open above the ground at a circle `[m]`: all of it where no tube stands.
    pub fn gap_at(&self, circle: usize) -> f64 {
        self.gate.filter(|(at, _)| *at == circle).map_or(f64::INFINITY, |(_, gap)| gap)
    }
}
