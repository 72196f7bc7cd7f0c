//! SYSCFG and EXTI: from a pin's edge to an interrupt line (RM0090 9.2 and 12.3).

/// System configuration controller: which port feeds which EXTI line.
#[derive(Clone, Debug, Default)]
pub(crate) struct Syscfg {
    registers: [u32; 9],
}

impl Syscfg {
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        self.registers.get(offset as usize / 4).copied()
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        *self.registers.get_mut(offset as usize / 4)? = value;
        Some(())
    }

    /// Port (0 = A) of an EXTI line.
    pub(crate) fn port(&self, line: u8) -> usize {
        let register = self.registers[2 + usize::from(line / 4)];
        (register >> (4 * (line % 4)) & 0xF) as usize
    }
}

/// External interrupt controller.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exti {
    pub(crate) interrupt_mask: u32,
    event_mask: u32,
    pub(crate) rising: u32,
    pub(crate) falling: u32,
    software: u32,
    pub(crate) pending: u32,
}

const LINES: u32 = 0x007F_FFFF;

impl Exti {
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.interrupt_mask,
            0x04 => self.event_mask,
            0x08 => self.rising,
            0x0C => self.falling,
            0x10 => self.software,
            0x14 => self.pending,
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        let value = value & LINES;
        match offset {
            0x00 => self.interrupt_mask = value,
            0x04 => self.event_mask = value,
            0x08 => self.rising = value,
            0x0C => self.falling = value,
            0x10 => {
                self.pending |= value & !self.software & self.interrupt_mask;
                self.software |= value;
            }
            0x14 => {
                self.pending &= !value;
                self.software &= !value;
            }
            _ => return None,
        }
        Some(())
    }

    /// A pin that feeds this line changed its level.
    pub(crate) fn edge(&mut self, line: u8, rises: bool) {
        let selected = if rises { self.rising } else { self.falling };
        self.pending |= selected & 1 << line;
    }

    /// Bits of the NVIC lines that are high (bit n = interrupt n).
    pub(crate) fn lines(&self) -> u128 {
        let active = self.pending & self.interrupt_mask;
        let mut lines = 0_u128;
        for line in 0..16 {
            if active & 1 << line != 0 {
                lines |= 1 << vector_of(line);
            }
        }
        lines
    }
}

/// NVIC position of an EXTI line 0 to 15.
pub(crate) fn vector_of(line: u8) -> u8 {
    match line {
        0..=4 => 6 + line,
        5..=9 => 23,
        _ => 40,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_selected_edges_of_unmasked_lines_interrupt() {
        let mut exti = Exti::default();
        exti.write(0x08, 0b100);
        exti.edge(2, false);
        assert_eq!(exti.lines(), 0);
        exti.edge(2, true);
        assert_eq!(exti.read(0x14), Some(0b100));
        assert_eq!(exti.lines(), 0, "masked");
        exti.write(0x00, 0b100);
        assert_eq!(exti.lines(), 1 << 8);
        exti.write(0x14, 0b100);
        assert_eq!(exti.lines(), 0);
    }

    #[test]
    fn lines_come_from_the_selected_port() {
        let mut syscfg = Syscfg::default();
        syscfg.write(0x08, 0x6000);
        assert_eq!((syscfg.port(3), syscfg.port(2)), (6, 0));
    }
}
