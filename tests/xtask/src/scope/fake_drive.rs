//! A drive that is nothing but the real oscilloscope, its real data blocks, and a velocity that follows its command.

use super::channel::{ChannelError, ServiceChannel};
use drive::DICTIONARY;
use drive::oscilloscope::{
    CONTROL, Configuration, INTERVAL, LoopValues, Oscilloscope, POINTS, SIGNALS, STATE, SignalValues, TRIGGER, Task,
    WINDOW, sample_source,
};
use drive::service::scope::{refuses_setting, signal};
use drive::{Command, Feedback, Source};
use sercos::Idn;
use sercos::parameters::Parameters;
use servo::axis::{AxisOutput, Limiting};
use servo::motor::CurrentLoopValues;
use servo::path::CommandSource;
use servo::scope::Scope;
use servo::units::{CurrentFraction, Position, Velocity};
use std::collections::BTreeMap;

/// Ticks that every access to the service channel takes: two cycles of 2 ms.
const TICKS_OF_AN_ACCESS: u64 = 32;

pub(super) struct FakeDrive {
    oscilloscope: Oscilloscope<'static>,
    parameters: Parameters,
    written: BTreeMap<u16, u64>,
    values: Values,
    ticks: u64,
    /// Lists are shorter than they should be by so many points.
    pub(super) withheld: usize,
    /// Whether the drive has an oscilloscope at all.
    pub(super) has_scope: bool,
}

struct Values {
    loops: LoopValues,
    command: i32,
}

impl SignalValues for Values {
    fn command(&self, _: Command) -> u32 {
        self.command.cast_unsigned()
    }

    fn feedback(&self, _: Feedback) -> u32 {
        self.loops.output.velocity.to_ten_thousandths_rpm().cast_unsigned()
    }

    fn bits(&self, _: Source) -> u16 {
        0
    }

    fn loops(&self) -> &LoopValues {
        &self.loops
    }

    fn current_loop(&self) -> &CurrentLoopValues {
        const NONE: CurrentLoopValues = CurrentLoopValues {
            quadrature: CurrentFraction::ZERO,
            direct_command: CurrentFraction::ZERO,
            direct: CurrentFraction::ZERO,
            phases: [CurrentFraction::ZERO; 3],
            quadrature_voltage: 0,
            direct_voltage: 0,
            angle: 0,
            bus_voltage: 0,
        };
        &NONE
    }
}

impl FakeDrive {
    pub(super) fn new() -> Self {
        let output = AxisOutput {
            current: CurrentFraction::ZERO,
            following_error: Position::ZERO,
            velocity: Velocity::ZERO,
            loop_velocity: Velocity::ZERO,
            velocity_command: Velocity::ZERO,
            position_command: Position::ZERO,
            command_source: CommandSource::Interpolated,
            standstill: true,
            limiting: Limiting::empty(),
            travelled: false,
        };
        Self {
            // A few test drives: their memory need not come back.
            oscilloscope: Oscilloscope::new(Box::leak(Box::new(Scope::new()))),
            parameters: Parameters::new(&DICTIONARY),
            written: BTreeMap::new(),
            values: Values { loops: LoopValues { position: Position::ZERO, output }, command: 0 },
            ticks: 0,
            withheld: 0,
            has_scope: true,
        }
    }

    /// What was written to a data block last.
    pub(super) fn written(&self, idn: Idn) -> Option<u64> {
        self.written.get(&idn.0).copied()
    }

    fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.ticks += 1;
            let output = &mut self.values.loops.output;
            output.velocity_command = Velocity::from_ten_thousandths_rpm(self.values.command);
            // A time constant of 64 ticks, 8 ms.
            let missing = output.velocity_command.to_bits() - output.velocity.to_bits();
            output.velocity = Velocity::from_bits(output.velocity.to_bits() + missing / 64);
            if let Some(signals) = self.oscilloscope.wanted(Task::ControlLoop) {
                let values = signals.map(|signal| sample_source(signal, &self.values));
                self.oscilloscope.record(&values);
            }
        }
    }

    fn access(&mut self, idn: Idn) -> Result<(), ChannelError> {
        self.run(TICKS_OF_AN_ACCESS);
        let known = self.has_scope || (idn.is_product() && !(200..220).contains(&idn.number()));
        if known { Ok(()) } else { Err(ChannelError::Refused { idn: idn.0, code: 0x1001 }) }
    }
}

impl ServiceChannel for FakeDrive {
    fn read(&mut self, idn: u16) -> Result<u64, ChannelError> {
        self.access(Idn(idn))?;
        match Idn(idn) {
            STATE => Ok(self.oscilloscope.state().into()),
            INTERVAL => Ok(self.oscilloscope.interval(625).into()),
            _ => Err(ChannelError::Refused { idn, code: 0x1001 }),
        }
    }

    fn read_list(&mut self, idn: u16) -> Result<Vec<i32>, ChannelError> {
        self.access(Idn(idn))?;
        let channel = POINTS.iter().position(|of| of.0 == idn).ok_or(ChannelError::Refused { idn, code: 0x1001 })?;
        Ok(self.oscilloscope.points(channel).skip(self.withheld).map(u32::cast_signed).collect())
    }

    fn write(&mut self, idn: u16, value: u64) -> Result<(), ChannelError> {
        self.access(Idn(idn))?;
        let refused = |error: sercos::error::ServiceError| ChannelError::Refused { idn, code: error.code() };
        if let Some(error) = refuses_setting(Idn(idn), value, &self.parameters) {
            return Err(refused(error));
        }
        self.written.insert(idn, value);
        match Idn(idn) {
            CONTROL if value == 0 => self.oscilloscope.stop(),
            CONTROL => {
                let written = &self.written;
                let setting = |idn: Idn| written.get(&idn.0).copied().unwrap_or(0) as u32;
                let configuration = Configuration::new(setting, |number| signal(number, &self.parameters));
                self.oscilloscope.arm(configuration.map_err(|error| refused(error.service_error()))?);
            }
            WINDOW => self.oscilloscope.set_window(value as u16),
            Idn(37) => self.values.command = value as u32 as i32,
            idn => assert!((SIGNALS[0]..TRIGGER).contains(&idn) || (TRIGGER..CONTROL).contains(&idn), "{idn}"),
        }
        Ok(())
    }

    fn wait(&mut self, microseconds: u64) -> Result<(), ChannelError> {
        self.run(microseconds / 125);
        Ok(())
    }
}
