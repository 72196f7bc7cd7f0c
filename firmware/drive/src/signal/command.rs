//! What the MDT can carry.

use super::limit::Limit;

/// A value that the MDT carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// A command value.
    Value(CommandValue),
    /// A limit in place of its parameter.
    Limit(Limit),
}

sercos::data_blocks! {
    /// A command value.
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    pub enum CommandValue in COMMAND_VALUES: Live [in_mdt];

    /// Velocity command of the control unit.
    S 36 "Velocity command value" [velocity] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Velocity;
    /// Added to S-0-0036.
    S 37 "Additive velocity command value" [velocity] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => AdditiveVelocity;
    /// Position command of the control unit, compared with S-0-0051 modulo 2^32 or S-0-0103. While S-0-0148 is set it reads the place where the axis is held.
    S 47 "Position command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Position;
    /// Added to S-0-0047: the angle of this axis against the line shaft.
    S 48 "Additive position command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => AdditivePosition;
    /// Torque command of the control unit.
    S 80 "Torque command value" [torque] I16 written ALWAYS (-32_768 to 32_767) = 0 => Torque;
    /// Added to S-0-0080.
    S 81 "Additive torque command value" [torque] I16 written ALWAYS (-32_768 to 32_767) = 0 => AdditiveTorque;
    /// Sets the bits that S-0-0027 and S-0-0329 have chosen, whenever it changes.
    S 145 "Signal control word" [""] BITS/0 written ALWAYS () = 0 => SignalControl;
    /// Where the drive goes by itself in the modes 0013H and 001BH; a modulo axis in the direction of S-0-0393, an absolute one never over the border between its highest and its lowest number. If S-0-0393 drops the target when the mode begins, this becomes the position where the axis stands, unless it was written since the mode ended.
    S 258 "Target position" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => TargetPosition;
    /// Position or distance of the modes 0213H and 021BH, which S-0-0346 says; taken over when bit 0 of that changes.
    S 282 "Positioning command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => PositioningValue;
    /// Of the modes 0213H and 021BH. A change of bit 0 takes S-0-0282 over. Bits 2 and 1: 0 goes to S-0-0430, 1 turns in positive, 2 in negative direction until it ends, 3 stops and keeps the target. Bit 3: S-0-0282 is 0 a position, 1 a distance, bit 4: from 0 S-0-0430, 1 the actual position. Bit 5: it is taken 0 when the last target is attained, 1 at once. Changes of bit 0 while torque is off or another mode is active take nothing over, then or later.
    S 346 "Positioning control" [""] BITS/0 written ALWAYS () = 0 => PositioningControl;
}

/// The values, where each is put, and how it is read: told once for each.
macro_rules! command_values {
    ($($(#[doc = $documentation:literal])+ $field:ident: $number:ty = $variant:ident $(, $path:ident)?;)+) => {
        /// The cyclic command values as they came last, each in the weight of its IDN.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct CommandValues {
            /// S-0-0134, the control word with its service bits.
            pub control_word: u16,
            $($(#[doc = $documentation])+ pub $field: $number,)+
        }

        impl CommandValues {
            /// Takes a value as it is transmitted. Returns whether it changes the point of the path: with one of its values changed, the
            /// control unit has given a new one.
            #[inline]
            pub(crate) fn put(&mut self, value: CommandValue, raw: u32) -> bool {
                match value {
                    $(CommandValue::$variant => {
                        let before = core::mem::replace(&mut self.$field, raw as $number);
                        command_values!(@changed $($path)? (before != raw as $number))
                    })+
                }
            }

            /// A value as it is transmitted, two-byte values in the low half.
            #[inline]
            pub(crate) const fn data(&self, value: CommandValue) -> u32 {
                match value {
                    $(CommandValue::$variant => self.$field as u32 & (u32::MAX >> (u32::BITS - <$number>::BITS)),)+
                }
            }
        }
    };
    (@changed of_the_path ($changed:expr)) => { $changed };
    (@changed ($changed:expr)) => {{
        let _ = $changed;
        false
    }};
}

command_values! {
    /// S-0-0036.
    velocity: i32 = Velocity, of_the_path;
    /// S-0-0037.
    additive_velocity: i32 = AdditiveVelocity, of_the_path;
    /// S-0-0047.
    position: i32 = Position, of_the_path;
    /// S-0-0048.
    additive_position: i32 = AdditivePosition, of_the_path;
    /// S-0-0080.
    torque: i16 = Torque;
    /// S-0-0081.
    additive_torque: i16 = AdditiveTorque;
    /// S-0-0145.
    signal_control: u16 = SignalControl;
    /// S-0-0258.
    target_position: i32 = TargetPosition;
    /// S-0-0282.
    positioning_value: i32 = PositioningValue;
    /// S-0-0346.
    positioning_control: u16 = PositioningControl;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_value_keeps_the_bits_of_its_data_block_and_disturbs_no_other() {
        for &(block, value) in COMMAND_VALUES {
            let mut values = CommandValues::default();
            let bits = u32::from(block.fixed_bytes().unwrap()) * 8;
            let path = matches!(
                value,
                CommandValue::Velocity
                    | CommandValue::AdditiveVelocity
                    | CommandValue::Position
                    | CommandValue::AdditivePosition
            );
            assert_eq!(values.put(value, 0x8765_4321), path, "{}", block.idn);
            assert!(!values.put(value, 0x8765_4321), "{}: a repeated value is no new point", block.idn);
            assert_eq!(values.data(value), 0x8765_4321 & (u32::MAX >> (32 - bits)), "{}", block.idn);
            let others = COMMAND_VALUES.iter().filter(|&&(_, other)| other != value);
            assert!(others.into_iter().all(|&(_, other)| values.data(other) == 0), "{}", block.idn);
        }
    }
}
