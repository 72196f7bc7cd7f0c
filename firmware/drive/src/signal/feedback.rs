//! What the AT can carry.

use super::word::Word;

/// A value that the AT carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Feedback {
    /// A measured value.
    Value(FeedbackValue),
    /// A word of single bits.
    Bits(Word),
}

sercos::data_blocks! {
    /// A measured value, or one that follows from the measured ones.
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    pub enum FeedbackValue in FEEDBACK_VALUES: Live [in_at];

    /// Velocity of the motor encoder.
    S 40 "Velocity feedback value 1" [velocity] I32 written NEVER () = 0 => Velocity;
    /// Position of the motor encoder, captured at t4.
    S 51 "Position feedback value 1 (motor feedback)" [position] I32 written NEVER () = 0 => Position;
    /// Position of the second encoder; where it comes from says P-0-2705.
    S 53 "Position feedback value 2 (external feedback)" [position] I32 written NEVER () = 0 => Position2;
    /// Torque that the measured current makes.
    S 84 "Torque feedback value" [torque] I16 written NEVER () = 0 => Torque;
    /// Position at the last positive edge of probe 1 that S-0-0170 took.
    S 130 "Probe value 1 positive edge" [position] I32 written NEVER () = 0 => Probe1Positive;
    /// Position at the last negative edge of probe 1 that S-0-0170 took.
    S 131 "Probe value 1 negative edge" [position] I32 written NEVER () = 0 => Probe1Negative;
    /// Position at the last positive edge of probe 2 that S-0-0170 took.
    S 132 "Probe value 2 positive edge" [position] I32 written NEVER () = 0 => Probe2Positive;
    /// Position at the last negative edge of probe 2 that S-0-0170 took.
    S 133 "Probe value 2 negative edge" [position] I32 written NEVER () = 0 => Probe2Negative;
    /// The bits that S-0-0026 and S-0-0328 have chosen.
    S 144 "Signal status word" [""] BITS/0 written NEVER () = 0 => SignalStatus;
    /// Position command minus position feedback; a longer one than fits is the longest.
    S 189 "Following distance" [position] I32 written NEVER () = 0 => FollowingDistance;
    /// Velocity command minus velocity feedback.
    S 347 "Velocity error" [velocity] I32 written NEVER () = 0 => VelocityError;
    /// Filtered voltage of the DC link.
    S 380 "DC bus voltage" ["V"] U16/0 written NEVER () = 0 => BusVoltage;
    /// From the sensor in the motor (P-0-0134); -200.0 where there is none, where it has no degrees, and while it is broken.
    S 383 "Motor temperature" ["C"] I16/1 written NEVER () = 0 => MotorTemperature;
    /// Of the heat sink; -200.0 while its sensor is broken.
    S 384 "Amplifier temperature" ["C"] I16/1 written NEVER () = 0 => AmplifierTemperature;
    /// State or error of the drive as a number; belongs to S-0-0095.
    S 390 "Diagnostic number" [""] HEX/0 written NEVER () = 0 => DiagnosticNumber;
    /// Where the drive goes by itself.
    S 430 "Effective target position" [position] I32 written NEVER () = 0 => EffectiveTarget;
    /// What limits the drive right now: bits 0 to 2 torque S-0-0082, 0083, 0092; 3 S-0-0109; 4 S-0-0110; 5, 6 load of motor and amplifier; 7 bus voltage; 8 field weakening; 9 to 11 velocity S-0-0038, 0039, 0091; 12 acceleration; 13 jerk; 14, 15 position S-0-0049, 0050.
    P 160 "Limits in force" [""] BITS/0 written NEVER () = 0 => Limits;
}
