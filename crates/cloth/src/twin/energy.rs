use serde::Serialize;

/// Where the energy of a twin is, and what has come and gone since the start [J].
///
/// Everything is taken half a step back, where velocities are known; energies of position are
/// the mean of those before and after.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Energies {
    /// Of motion.
    pub kinetic: f64,
    /// In the yarns' strain.
    pub stretch: f64,
    pub shear: f64,
    pub bending: f64,
    /// Kinetic and strain energy at the start.
    pub initial: f64,
    /// Work done by gravity.
    pub gravity: f64,
    /// Work done by clamps.
    pub external: f64,
    /// Work done by pressure.
    pub press: f64,
    /// Work done by the tool's tack.
    pub adhesion: f64,
    /// Lost on impact on the tool; this and what follows has been turned into heat.
    pub contact: f64,
    /// Lost to friction on the tool.
    pub friction: f64,
    /// Lost to damping by mass.
    pub damping: f64,
    /// Lost to damping of the yarns' strain.
    pub viscosity: f64,
}

impl Energies {
    /// In strain of all kinds.
    pub fn strain(&self) -> f64 {
        self.stretch + self.shear + self.bending
    }

    /// What has been put in.
    pub fn supplied(&self) -> f64 {
        self.initial + self.gravity + self.external + self.press + self.adhesion
    }

    /// What has been turned into heat.
    pub fn dissipated(&self) -> f64 {
        self.contact + self.friction + self.damping + self.viscosity
    }

    /// What is missing: 0 if the integration were exact. Positive where energy has vanished.
    pub fn residual(&self) -> f64 {
        self.supplied() - self.kinetic - self.strain() - self.dissipated()
    }

    /// The greatest of the amounts that the balance consists of, to hold the residual against.
    pub fn size(&self) -> f64 {
        let held = [self.kinetic, self.stretch, self.shear, self.bending];
        let worked = [self.gravity, self.external, self.press, self.adhesion];
        let lost = [self.contact, self.friction, self.damping, self.viscosity];
        let parts = [held, worked, lost].into_iter().flatten();
        parts.fold(self.initial.abs(), |max, part| max.max(part.abs()))
    }
}
