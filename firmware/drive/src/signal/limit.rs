//! Limits that the MDT can carry.

use sercos::Idn;

sercos::data_blocks! {
    /// A parameter in whose place the MDT may carry a value.
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    pub enum Limit in LIMITS: Parameter [stored, in_mdt];

    /// Highest velocity command; 0: only S-0-0091 counts.
    S 38 "Positive velocity limit value" [velocity] I32 written ALWAYS (0 to 2_147_483_647) = 0 => PositiveVelocity;
    /// Lowest velocity command; 0: only S-0-0091 counts.
    S 39 "Negative velocity limit value" [velocity] I32 written ALWAYS (-2_147_483_648 to 0) = 0 => NegativeVelocity;
    /// Highest torque.
    S 82 "Positive torque limit value" [torque] I16 written ALWAYS (0 to 32_767) = 32_767 => PositiveTorque;
    /// Lowest torque.
    S 83 "Negative torque limit value" [torque] I16 written ALWAYS (-32_768 to 0) = -32_767 => NegativeTorque;
    /// Largest velocity that the drive commands in either direction.
    S 91 "Bipolar velocity limit value" [velocity] U32 written ALWAYS (1 to 2_147_483_647) = 30_000_000 => BipolarVelocity, needed_for_cp4, restricted;
    /// Largest torque in either direction.
    S 92 "Bipolar torque limit value" [torque] U16 written ALWAYS (0 to 65_535) = 2_000 => BipolarTorque, needed_for_cp4;
    /// Largest acceleration of velocity commands away from standstill; 0 with S-0-0137 also 0: they are followed as they come.
    S 136 "Positive acceleration limit value" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => PositiveAcceleration, restricted;
    /// Largest acceleration of velocity commands towards standstill; see S-0-0136.
    S 137 "Negative acceleration limit value" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => NegativeAcceleration, restricted;
    /// Ramp of halt and of stopping after an error or Drive OFF.
    S 138 "Bipolar acceleration limit value" [acceleration] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => BipolarAcceleration, restricted;
    /// Jerk of positioning; 0: not limited.
    S 193 "Positioning jerk" [jerk] I32 written ALWAYS (0 to 2_147_483_647) = 0 => PositioningJerk, restricted;
    /// Speed of positioning, within S-0-0091.
    S 259 "Positioning velocity" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => PositioningVelocity, needed_for_cp4, restricted;
    /// Acceleration of positioning; also its deceleration if S-0-0359 is 0.
    S 260 "Positioning acceleration" [acceleration] I32 written ALWAYS (1_000 to 2_147_483_647) = 1_000_000 => PositioningAcceleration, restricted;
    /// Jerk of halt and of the ramps of velocity commands; 0: not limited.
    S 349 "Bipolar jerk limit value" [jerk] I32 written ALWAYS (0 to 2_147_483_647) = 0 => BipolarJerk, restricted;
}

impl Limit {
    /// All of them, in the order of their IDNs.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        LIMITS.iter().map(|&(_, limit)| limit)
    }

    /// Its data block.
    #[must_use]
    pub fn idn(self) -> Idn {
        // A row for each variant, in their order.
        LIMITS.get(self as usize).map_or(Idn(0), |(block, _)| block.idn)
    }
}
