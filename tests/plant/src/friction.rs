//! Friction of a shaft.

/// Coulomb and viscous friction of a mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Friction {
    /// In Nm, while the mass moves.
    pub(crate) coulomb: f64,
    /// In Nm s/rad.
    pub(crate) viscous: f64,
    /// Inertia of the mass in kg m².
    pub(crate) inertia: f64,
}

impl Friction {
    /// The velocity after `dt` under an outside torque; friction slows down and holds, it never drives. At standstill it holds against any
    /// smaller torque than it has.
    pub(crate) fn rub(&self, velocity: f64, outside: f64, dt: f64) -> f64 {
        self.rub_or_stick(velocity, outside, self.coulomb, dt)
    }

    /// The same of a mass that sticks against any torque in Nm that is smaller than `holding`.
    #[inline(always)]
    pub(crate) fn rub_or_stick(&self, velocity: f64, outside: f64, holding: f64, dt: f64) -> f64 {
        let direction = if velocity != 0.0 { velocity.signum() } else { outside.signum() };
        if velocity == 0.0 && outside.abs() <= holding {
            return 0.0;
        }
        let torque = outside - direction * self.coulomb;
        // Trapezoidal in the viscous part.
        let half = 0.5 * self.viscous * dt / self.inertia;
        let next = (velocity * (1.0 - half) + torque / self.inertia * dt) / (1.0 + half);
        let reversed = next * direction < 0.0;
        if reversed && outside.abs() <= holding { 0.0 } else { next }
    }
}
