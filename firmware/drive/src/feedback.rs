//! The feedback values of one instant, in the weight of their IDNs.

/// What the AT and the service channel show of the motor side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FeedbackValues {
    /// S-0-0051.
    pub position: i32,
    /// S-0-0040.
    pub velocity: i32,
    /// S-0-0084 in 0.1 % of S-0-0111.
    pub torque: i64,
    /// S-0-0189.
    pub following_distance: i32,
    /// S-0-0347.
    pub velocity_error: i32,
}

impl FeedbackValues {
    /// S-0-0084 as it is transmitted, limited to 16 bits.
    pub(crate) fn torque_word(&self) -> u32 {
        let limited = self.torque.clamp(i64::from(i16::MIN), i64::from(i16::MAX));
        (limited & 0xFFFF).cast_unsigned() as u32
    }
}
