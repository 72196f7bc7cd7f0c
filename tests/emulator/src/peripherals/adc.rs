//! ADC1 to ADC3: injected sequences, started by TRGO of TIM1 or by software, alone or at the same time (RM0090 chapter 13).
//!
//! A rank takes its sampling time and twelve cycles of the ADC clock; the value is taken at the *hold* instant that ends the sampling. The
//! latency of the trigger, up to three cycles by the data sheet, is not in it. Regular conversions, DMA, the analogue watchdog, discontinuous
//! and automatic injection, other resolutions than 12 bits and the alternate trigger mode are not modelled.

use ring::Nanoseconds;

use crate::wiring::analogue_pin;

const SR: u32 = 0x00;
pub(crate) const CR1: u32 = 0x04;
pub(crate) const CR2: u32 = 0x08;
const SMPR1: u32 = 0x0C;
const SMPR2: u32 = 0x10;
const JOFR1: u32 = 0x14;
const HTR: u32 = 0x24;
const LTR: u32 = 0x28;
const SQR1: u32 = 0x2C;
const SQR3: u32 = 0x34;
const JSQR: u32 = 0x38;
const JDR1: u32 = 0x3C;
const JDR4: u32 = 0x48;
const DR: u32 = 0x4C;
const CSR: u32 = 0x300;
const CCR: u32 = 0x304;
const CDR: u32 = 0x308;

const INJECTED_END: u32 = 1 << 2;
const INJECTED_START: u32 = 1 << 3;
pub(crate) const INJECTED_INTERRUPT: u32 = 1 << 7;
const SCAN: u32 = 1 << 8;
const ON: u32 = 1;
const LEFT: u32 = 1 << 11;
pub(crate) const TRIGGER_EDGES: u32 = 3 << 20;
pub(crate) const TRIGGER_SOURCE: u32 = 0xF << 16;
const SOFTWARE_START: u32 = 1 << 22;

/// JEXTEN = 1 and JEXTSEL = 1: rising edge of TRGO of TIM1.
pub(crate) const TRIGGERED_BY_TIM1: u32 = 1 << 20 | 1 << 16;
/// MULTI: injected simultaneous mode of ADC1 and ADC2.
const DUAL: u32 = 0b00101;
/// MULTI: injected simultaneous mode of all three.
pub(crate) const TRIPLE: u32 = 0b10101;
/// Data sheet, VDDA above 2.4 V.
pub(crate) const FASTEST_CLOCK_HZ: u64 = 36_000_000;
/// Data sheet: the first conversion may start so long after ADON.
const STABILISATION: Nanoseconds = Nanoseconds(3_000);
/// Successive approximation of 12 bits.
const CONVERSION_CYCLES: u64 = 12;

/// Gives the 12-bit value that an ADC (1 to 3) holds at an instant on a channel.
pub(crate) type Sampler<'a> = dyn FnMut(Nanoseconds, usize, u8) -> Result<u16, String> + 'a;

/// The three converters and their common registers.
#[derive(Clone, Debug)]
pub(crate) struct Converters {
    converters: [Converter; 3],
    common: u32,
    /// PCLK2.
    clock_hz: u64,
}

#[derive(Clone, Debug)]
struct Converter {
    status: u32,
    control: [u32; 2],
    sampling: [u32; 2],
    offsets: [u32; 4],
    thresholds: [u32; 2],
    regular: [u32; 3],
    sequence: u32,
    data: [u32; 4],
    on_since: Nanoseconds,
    running: Option<Running>,
}

/// A sequence under way.
#[derive(Clone, Copy, Debug)]
struct Running {
    started: Nanoseconds,
    rank: usize,
    /// Cycles from the start of the sequence to the start of this rank.
    cycles: u64,
    held: Option<u16>,
}

impl Converter {
    fn new() -> Self {
        Self {
            status: 0,
            control: [0; 2],
            sampling: [0; 2],
            offsets: [0; 4],
            thresholds: [0xFFF, 0],
            regular: [0; 3],
            sequence: 0,
            data: [0; 4],
            on_since: Nanoseconds::ZERO,
            running: None,
        }
    }

    fn ranks(&self) -> usize {
        (self.sequence >> 20 & 3) as usize + 1
    }

    /// Channel of a rank, counted from 0. A sequence shorter than four sits at the upper end: with JL = 1 it is JSQ3 and JSQ4.
    fn channel(&self, rank: usize) -> u8 {
        let field = 4 - self.ranks() + rank;
        (self.sequence >> (5 * field) & 0x1F) as u8
    }

    fn sampling_cycles(&self, channel: u8) -> u64 {
        let code = match channel {
            0..=9 => self.sampling[1] >> (3 * channel),
            _ => self.sampling[0] >> (3 * (channel - 10)),
        };
        [3, 15, 28, 56, 84, 112, 144, 480][(code & 7) as usize]
    }

    /// From the trigger to the end of the last rank.
    fn sequence_cycles(&self) -> u64 {
        (0..self.ranks()).map(|rank| self.sampling_cycles(self.channel(rank)) + CONVERSION_CYCLES).sum()
    }

    fn is_on(&self) -> bool {
        self.control[1] & ON != 0
    }

    /// What the data register of a rank gets: the offset is taken off, the result is signed.
    fn result(&self, rank: usize, value: u16) -> u32 {
        let difference = i32::from(value & 0xFFF) - self.offsets[rank] as i32;
        let aligned = if self.control[1] & LEFT != 0 { difference << 3 } else { difference };
        aligned as u32 & 0xFFFF
    }

    /// `Err` tells why a sequence cannot start.
    fn start(&mut self, at: Nanoseconds) -> Result<(), String> {
        if self.running.is_some() {
            return Err("triggered while the last sequence is still being converted".into());
        }
        if at < self.on_since + STABILISATION {
            return Err("triggered before it is stable, 3 us after ADON".into());
        }
        if self.ranks() > 1 && self.control[0] & SCAN == 0 {
            return Err(format!("a sequence of {} ranks without SCAN", self.ranks()));
        }
        self.status |= INJECTED_START;
        self.running = Some(Running { started: at, rank: 0, cycles: 0, held: None });
        Ok(())
    }
}

impl Converters {
    pub(crate) fn new() -> Self {
        Self { converters: [(); 3].map(|()| Converter::new()), common: 0, clock_hz: 16_000_000 }
    }

    /// PCLK2 changes.
    pub(crate) fn set_clock(&mut self, hertz: u64) {
        self.clock_hz = hertz;
    }

    /// Frequency of the ADC clock.
    pub(crate) fn converter_hz(&self) -> u64 {
        self.clock_hz / (2 * (u64::from(self.common >> 16 & 3) + 1))
    }

    /// MULTI.
    pub(crate) fn multi(&self) -> u32 {
        self.common & 0x1F
    }

    /// Channels of the injected sequence of ADC 1 to 3, first rank first.
    pub(crate) fn sequence(&self, adc: usize) -> Vec<u8> {
        let converter = &self.converters[adc - 1];
        (0..converter.ranks()).map(|rank| converter.channel(rank)).collect()
    }

    /// From the trigger to the hold instant of the first rank.
    pub(crate) fn first_sampling_time(&self, adc: usize) -> Nanoseconds {
        let converter = &self.converters[adc - 1];
        self.cycles_time(converter.sampling_cycles(converter.channel(0)))
    }

    /// CR1 and CR2 of ADC 1 to 3.
    pub(crate) fn control(&self, adc: usize) -> [u32; 2] {
        self.converters[adc - 1].control
    }

    /// Is the common interrupt line high?
    pub(crate) fn line(&self) -> bool {
        self.converters.iter().any(|adc| adc.status & INJECTED_END != 0 && adc.control[0] & INJECTED_INTERRUPT != 0)
    }

    /// The next hold instant or end of a sequence of what runs, and of what a trigger at `trigger` would start.
    pub(crate) fn next_event(&self, trigger: Option<Nanoseconds>) -> Option<Nanoseconds> {
        let running = self.converters.iter().filter_map(|adc| self.next_announced_step(adc));
        let started = trigger
            .into_iter()
            .flat_map(|at| self.triggered().into_iter().map(move |adc| at + self.first_sampling_time(adc + 1)));
        running.chain(started).min()
    }

    /// The end of a sequence that raises the interrupt line: of the one that runs, or of the one that a trigger at `trigger` would start.
    pub(crate) fn next_end(&self, trigger: Option<Nanoseconds>) -> Option<Nanoseconds> {
        let interrupts = |adc: &Converter| adc.control[0] & INJECTED_INTERRUPT != 0;
        let end = |adc: &Converter, from: Nanoseconds| from + self.cycles_time(adc.sequence_cycles());
        let running =
            self.converters.iter().filter(|adc| interrupts(adc)).filter_map(|adc| Some(end(adc, adc.running?.started)));
        let started = trigger.into_iter().flat_map(|at| {
            let group = self.triggered().into_iter().map(|number| &self.converters[number]);
            group.filter(|adc| interrupts(adc)).map(move |adc| end(adc, at))
        });
        running.chain(started).min()
    }

    /// Does every hold and every end until `now`.
    pub(crate) fn advance(&mut self, now: Nanoseconds, sampler: &mut Sampler<'_>) -> Result<(), String> {
        loop {
            let next = (0..3).filter_map(|adc| Some((self.next_step(&self.converters[adc])?, adc))).min();
            match next {
                Some((at, adc)) if at <= now => self.step(at, adc, sampler)?,
                _ => return Ok(()),
            }
        }
    }

    /// TRGO of TIM1 rises.
    pub(crate) fn trigger(&mut self, at: Nanoseconds) -> Result<(), String> {
        let group = self.triggered();
        self.start(&group, at)
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            CSR => {
                let status = self.converters.iter().enumerate();
                return Some(status.fold(0, |all, (adc, converter)| all | converter.status << (8 * adc)));
            }
            CCR => return Some(self.common),
            CDR => return Some(0),
            _ => {}
        }
        let adc = self.converters.get(offset as usize >> 8)?;
        Some(match offset & 0xFF {
            SR => adc.status,
            CR1 => adc.control[0],
            CR2 => adc.control[1],
            SMPR1 => adc.sampling[0],
            SMPR2 => adc.sampling[1],
            register @ JOFR1..HTR => adc.offsets[(register - JOFR1) as usize / 4],
            HTR => adc.thresholds[0],
            LTR => adc.thresholds[1],
            register @ SQR1..=SQR3 => adc.regular[(register - SQR1) as usize / 4],
            JSQR => adc.sequence,
            register @ JDR1..=JDR4 => adc.data[(register - JDR1) as usize / 4],
            DR => 0,
            _ => return None,
        })
    }

    /// What a read of a status or data register answers for as long as nothing runs.
    pub(crate) fn peek(&self, offset: u32) -> Option<u32> {
        let idle = self.converters.iter().all(|adc| adc.running.is_none());
        let lasting = matches!(offset & 0xFF, SR | JDR1..=JDR4) && offset < CSR;
        self.read(offset).filter(|_| idle && lasting)
    }

    /// `Err` tells what is not modelled or would fail on the part.
    pub(crate) fn write(&mut self, offset: u32, value: u32, now: Nanoseconds) -> Option<Result<(), String>> {
        match offset {
            CCR => return Some(self.write_common(value)),
            CSR | CDR => return Some(Ok(())),
            _ => {}
        }
        let number = offset as usize >> 8;
        let adc = self.converters.get_mut(number)?;
        let done = match offset & 0xFF {
            SR => {
                adc.status &= value;
                Ok(())
            }
            CR1 => {
                const MODELLED: u32 = INJECTED_INTERRUPT | SCAN;
                adc.control[0] = value & MODELLED;
                refuse("CR1", value & !MODELLED)
            }
            CR2 => return Some(self.write_control_2(number, value, now)),
            SMPR1 => store(&mut adc.sampling[0], value & 0x07FF_FFFF),
            SMPR2 => store(&mut adc.sampling[1], value & 0x3FFF_FFFF),
            register @ JOFR1..HTR => store(&mut adc.offsets[(register - JOFR1) as usize / 4], value & 0xFFF),
            HTR => store(&mut adc.thresholds[0], value & 0xFFF),
            LTR => store(&mut adc.thresholds[1], value & 0xFFF),
            register @ SQR1..=SQR3 => store(&mut adc.regular[(register - SQR1) as usize / 4], value),
            JSQR if adc.running.is_some() => Err("JSQR written while the sequence is being converted".into()),
            JSQR => store(&mut adc.sequence, value & 0x3F_FFFF),
            JDR1..=DR => Ok(()),
            _ => return None,
        };
        Some(done)
    }

    fn write_common(&mut self, value: u32) -> Result<(), String> {
        const DELAY: u32 = 0xF << 8;
        const PRESCALER: u32 = 3 << 16;
        const INTERNAL_SOURCES: u32 = 3 << 22;
        const MODELLED: u32 = 0x1F | DELAY | PRESCALER | INTERNAL_SOURCES;
        self.common = value & MODELLED;
        if ![0, DUAL, TRIPLE].contains(&self.multi()) {
            return Err(format!("ADC mode MULTI = {:#07b} is not modelled", self.multi()));
        }
        refuse("CCR", value & !MODELLED)
    }

    fn write_control_2(&mut self, number: usize, value: u32, now: Nanoseconds) -> Result<(), String> {
        const END_OF_EACH: u32 = 1 << 10;
        const MODELLED: u32 = ON | END_OF_EACH | LEFT | TRIGGER_SOURCE | TRIGGER_EDGES;
        let adc = &mut self.converters[number];
        if value & ON != 0 && !adc.is_on() {
            adc.on_since = now;
        }
        if value & ON == 0 {
            adc.running = None;
        }
        adc.control[1] = value & MODELLED;
        refuse("CR2", value & !(MODELLED | SOFTWARE_START))?;
        let triggered = value & TRIGGER_EDGES != 0;
        if triggered && value & (TRIGGER_EDGES | TRIGGER_SOURCE) != TRIGGERED_BY_TIM1 {
            return Err(format!("injected trigger CR2 = {value:#x} is not modelled: only the rising TRGO of TIM1 is"));
        }
        if value & SOFTWARE_START == 0 {
            return Ok(());
        }
        if value & ON == 0 {
            return Err("JSWSTART without ADON".into());
        }
        let group = self.group(number);
        self.start(&group, now)
    }

    /// The converters (0 to 2) that TRGO starts.
    fn triggered(&self) -> Vec<usize> {
        let mut all = Vec::new();
        for (number, adc) in self.converters.iter().enumerate() {
            if adc.is_on() && adc.control[1] & TRIGGER_EDGES != 0 {
                all.extend(self.group(number));
            }
        }
        all
    }

    /// Those that start together with one: in a simultaneous mode ADC1 is the master of the others.
    fn group(&self, number: usize) -> Vec<usize> {
        match (number, self.multi()) {
            (0, DUAL) => vec![0, 1],
            (0, TRIPLE) => vec![0, 1, 2],
            _ => vec![number],
        }
    }

    fn start(&mut self, group: &[usize], at: Nanoseconds) -> Result<(), String> {
        if !group.is_empty() && self.converter_hz() > FASTEST_CLOCK_HZ {
            return Err(format!("ADC clock {} Hz, allowed {FASTEST_CLOCK_HZ} Hz", self.converter_hz()));
        }
        self.check_simultaneous(group)?;
        for number in group {
            let adc = &mut self.converters[*number];
            if adc.is_on() {
                adc.start(at).map_err(|what| format!("ADC{}: {what}", number + 1))?;
            }
        }
        Ok(())
    }

    /// RM0090 13.9: no trigger for a slave, no pin twice at the same time, the same length and sampling times.
    fn check_simultaneous(&self, group: &[usize]) -> Result<(), String> {
        for (position, number) in group.iter().enumerate() {
            if group[..position].contains(number) {
                return Err(format!("ADC{} has a trigger of its own beside that of its master", number + 1));
            }
        }
        if self.multi() == 0 || !group.contains(&0) {
            return Ok(());
        }
        let together = self.group(0);
        for (position, second) in together.iter().enumerate() {
            for first in &together[..position] {
                self.check_pair(*first, *second)?;
            }
        }
        Ok(())
    }

    fn check_pair(&self, first: usize, second: usize) -> Result<(), String> {
        let names = format!("ADC{} and ADC{}", first + 1, second + 1);
        let (a, b) = (&self.converters[first], &self.converters[second]);
        if a.ranks() != b.ranks() {
            return Err(format!("{names} convert at once, but sequences of different length"));
        }
        for rank in 0..a.ranks() {
            let (on_a, on_b) = (a.channel(rank), b.channel(rank));
            if analogue_pin(first + 1, on_a) == analogue_pin(second + 1, on_b) {
                return Err(format!("{names} sample the same pin at once in rank {}", rank + 1));
            }
            if a.sampling_cycles(on_a) != b.sampling_cycles(on_b) {
                return Err(format!("{names} sample for different times in rank {}", rank + 1));
            }
        }
        Ok(())
    }

    fn next_step(&self, adc: &Converter) -> Option<Nanoseconds> {
        let running = adc.running?;
        let sampling = adc.sampling_cycles(adc.channel(running.rank));
        let conversion = if running.held.is_some() { CONVERSION_CYCLES } else { 0 };
        Some(running.started + self.cycles_time(running.cycles + sampling + conversion))
    }

    /// The end of a rank that another one follows shows in its data register only, and a read comes after [`Converters::advance`] anyway: the
    /// hold instant behind it is announced instead, which spares an exchange with the guest.
    fn next_announced_step(&self, adc: &Converter) -> Option<Nanoseconds> {
        let running = adc.running?;
        if running.held.is_none() || running.rank + 1 == adc.ranks() {
            return self.next_step(adc);
        }
        let sampling = [running.rank, running.rank + 1].map(|rank| adc.sampling_cycles(adc.channel(rank)));
        let cycles = running.cycles + sampling[0] + CONVERSION_CYCLES + sampling[1];
        Some(running.started + self.cycles_time(cycles))
    }

    fn step(&mut self, at: Nanoseconds, number: usize, sampler: &mut Sampler<'_>) -> Result<(), String> {
        let adc = &mut self.converters[number];
        let Some(mut running) = adc.running else { return Ok(()) };
        let channel = adc.channel(running.rank);
        match running.held {
            None => running.held = Some(sampler(at, number + 1, channel)?),
            Some(value) => {
                adc.data[running.rank] = adc.result(running.rank, value);
                running.cycles += adc.sampling_cycles(channel) + CONVERSION_CYCLES;
                running.rank += 1;
                running.held = None;
            }
        }
        let ended = running.rank == adc.ranks();
        adc.status |= if ended { INJECTED_END } else { 0 };
        adc.running = (!ended).then_some(running);
        Ok(())
    }

    fn cycles_time(&self, cycles: u64) -> Nanoseconds {
        Nanoseconds((cycles * 1_000_000_000).div_ceil(self.converter_hz()))
    }
}

fn store(register: &mut u32, value: u32) -> Result<(), String> {
    *register = value;
    Ok(())
}

fn refuse(register: &str, bits: u32) -> Result<(), String> {
    if bits == 0 { Ok(()) } else { Err(format!("bits {bits:#x} of ADC_{register} are not modelled")) }
}

#[cfg(test)]
mod tests;
