//! General purpose ports A to I (RM0090 chapter 8).

/// One port. External levels are set by the board's wiring; a pin nobody drives follows its pull resistor.
#[derive(Clone, Debug)]
pub(crate) struct Port {
    mode: u32,
    output_type: u32,
    speed: u32,
    pull: u32,
    output: u32,
    lock: u32,
    alternate: [u32; 2],
    driven: u16,
    levels: u16,
}

/// MODER code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinMode {
    /// Digital input.
    Input,
    /// General purpose output.
    Output,
    /// Alternate function 0 to 15.
    Alternate(u8),
    /// Analogue: digital input off.
    Analogue,
}

impl Port {
    /// Port 0 = A.
    pub(crate) fn new(port: usize) -> Self {
        let (mode, speed, pull) = match port {
            0 => (0xA800_0000, 0x0C00_0000, 0x6400_0000),
            1 => (0x0000_0280, 0x0000_00C0, 0x0000_0100),
            _ => (0, 0, 0),
        };
        Self { mode, output_type: 0, speed, pull, output: 0, lock: 0, alternate: [0; 2], driven: 0, levels: 0 }
    }

    /// The world drives a pin.
    pub(crate) fn drive(&mut self, pin: u8, level: bool) {
        self.driven |= 1 << pin;
        self.levels = self.levels & !(1 << pin) | u16::from(level) << pin;
    }

    pub(crate) fn mode(&self, pin: u8) -> PinMode {
        match self.mode >> (2 * pin) & 3 {
            0 => PinMode::Input,
            1 => PinMode::Output,
            2 => {
                let register = self.alternate[usize::from(pin / 8)];
                PinMode::Alternate((register >> (4 * (pin % 8)) & 0xF) as u8)
            }
            _ => PinMode::Analogue,
        }
    }

    /// 0 none, 1 up, 2 down.
    pub(crate) fn pull(&self, pin: u8) -> u32 {
        self.pull >> (2 * pin) & 3
    }

    /// 0 low to 3 very high.
    pub(crate) fn speed(&self, pin: u8) -> u32 {
        self.speed >> (2 * pin) & 3
    }

    pub(crate) fn is_open_drain(&self, pin: u8) -> bool {
        self.output_type & 1 << pin != 0
    }

    pub(crate) fn output(&self, pin: u8) -> bool {
        self.output & 1 << pin != 0
    }

    /// The level that the input stage sees.
    pub(crate) fn level(&self, pin: u8) -> bool {
        match self.mode(pin) {
            PinMode::Analogue => false,
            PinMode::Output => self.output(pin),
            _ if self.driven & 1 << pin != 0 => self.levels & 1 << pin != 0,
            _ => self.pull(pin) == 1,
        }
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.mode,
            0x04 => self.output_type,
            0x08 => self.speed,
            0x0C => self.pull,
            0x10 => (0..16).fold(0, |all, pin| all | u32::from(self.level(pin)) << pin),
            0x14 => self.output,
            0x18 => 0,
            0x1C => self.lock,
            0x20 => self.alternate[0],
            0x24 => self.alternate[1],
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x00 => self.mode = value,
            0x04 => self.output_type = value & 0xFFFF,
            0x08 => self.speed = value,
            0x0C => self.pull = value,
            0x10 => {}
            0x14 => self.output = value & 0xFFFF,
            // Set wins over reset.
            0x18 => self.output = self.output & !(value >> 16) | value & 0xFFFF,
            0x1C => self.lock = value & 0x1_FFFF,
            0x20 => self.alternate[0] = value,
            0x24 => self.alternate[1] = value,
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn set_and_reset_register_changes_only_the_named_pins() {
        let mut port = Port::new(2);
        port.write(0x14, 0x00F0);
        port.write(0x18, 0x0030_0001);
        assert_eq!(port.read(0x14), Some(0x00C1));
        port.write(0x18, 0x0001_0001);
        assert!(port.output(0), "set wins");
    }

    #[test]
    fn an_input_follows_the_world_or_its_pull() {
        let mut port = Port::new(6);
        port.write(0x0C, 1 << 10);
        assert_eq!(port.read(0x10), Some(1 << 5));
        port.drive(5, false);
        assert_eq!(port.read(0x10), Some(0));
        port.write(0x00, 3 << 10);
        port.drive(5, true);
        assert_eq!(port.read(0x10), Some(0), "analogue mode switches the input off");
    }
}
