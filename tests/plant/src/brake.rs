//! The holding brake on the motor shaft.

/// The torque builds up or fades within this part of the delay after the delay.
const TRANSITION: f64 = 0.2;

/// A brake that springs apply and a coil releases. It acts as Coulomb friction; at time zero it is engaged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldingBrake {
    /// In Nm.
    pub holding_torque: f64,
    /// From the energised coil to the torque's fading, in seconds; within a fifth of this it is gone.
    pub release_delay: f64,
    /// From the de-energised coil to the first torque, in seconds; within a fifth of this it is there.
    pub engage_delay: f64,
}

/// What can be wrong with a brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BrakeFailure {
    /// As with a coil that is never energised.
    StuckEngaged,
    /// As with a coil that is always energised.
    StuckReleased,
    /// This share of the holding torque is left.
    Worn(f64),
}

/// State of the brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grip {
    /// Share of the torque that is there, 0 ..= 1.
    level: f64,
    released: bool,
    /// Seconds until the level begins to change.
    wait: f64,
}

impl Grip {
    pub(crate) fn engaged() -> Self {
        Self { level: 1.0, released: false, wait: 0.0 }
    }

    pub(crate) fn holds(self) -> bool {
        self.level >= 1.0
    }
}

impl HoldingBrake {
    pub(crate) fn check(&self) {
        assert!(self.holding_torque >= 0.0, "the holding torque must not be negative");
        assert!(self.release_delay >= 0.0 && self.engage_delay >= 0.0, "delays must not be negative");
    }

    /// The grip when coil or health change.
    pub(crate) fn switch(&self, grip: Grip, energised: bool, failure: Option<BrakeFailure>) -> Grip {
        let released = match failure {
            Some(BrakeFailure::StuckEngaged) => false,
            Some(BrakeFailure::StuckReleased) => true,
            Some(BrakeFailure::Worn(_)) | None => energised,
        };
        if released == grip.released {
            return grip;
        }
        Grip { released, wait: if released { self.release_delay } else { self.engage_delay }, ..grip }
    }

    pub(crate) fn step(&self, grip: Grip, dt: f64) -> Grip {
        let active = (dt - grip.wait).max(0.0);
        let wait = (grip.wait - dt).max(0.0);
        let (delay, target) = if grip.released { (self.release_delay, 0.0) } else { (self.engage_delay, 1.0) };
        if active == 0.0 || grip.level == target {
            return Grip { wait, ..grip };
        }
        let change = if delay > 0.0 { active / (TRANSITION * delay) } else { 1.0 };
        let level = if grip.released { (grip.level - change).max(0.0) } else { (grip.level + change).min(1.0) };
        Grip { level, wait, ..grip }
    }

    /// Torque in Nm that the brake can hold.
    pub(crate) fn torque(&self, grip: Grip, failure: Option<BrakeFailure>) -> f64 {
        let left = if let Some(BrakeFailure::Worn(share)) = failure { share } else { 1.0 };
        self.holding_torque * left * grip.level
    }
}
