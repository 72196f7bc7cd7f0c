//! What a master writes in CP2, and the run-up with it.

use bench::parameters_of;
use drive::DICTIONARY;
use ring::ident::{Idn, Value};
use ring::service_client::status;

use crate::slave::{GOOD_MSTS, Outcome, Slave};

/// The cyclic telegrams of a run: S-0-0001 to S-0-0024 and S-0-0089. Times in us, lengths in bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// S-0-0001; `None`: not written.
    pub control_unit_cycle: Option<u16>,
    /// S-0-0002.
    pub cycle: u16,
    /// S-0-0006.
    pub t1: u16,
    /// S-0-0089.
    pub t2: u16,
    /// S-0-0008.
    pub t3: u16,
    /// S-0-0007.
    pub t4: u16,
    /// S-0-0009.
    pub position: u16,
    /// S-0-0010.
    pub length: u16,
    /// S-0-0015.
    pub telegram_type: u16,
    /// S-0-0016.
    pub at: Vec<u16>,
    /// S-0-0024.
    pub mdt: Vec<u16>,
    /// Further data blocks, written in CP2 before S-0-0127.
    pub others: Vec<(u16, Vec<u16>)>,
}

impl Default for Configuration {
    /// Telegram type 2 (velocity), 2 ms, with room for every time.
    fn default() -> Self {
        Self {
            control_unit_cycle: None,
            cycle: 2_000,
            t1: 200,
            t2: 1_000,
            t3: 1_500,
            t4: 1_800,
            position: 1,
            length: 8,
            telegram_type: 2,
            at: Vec::new(),
            mdt: Vec::new(),
            others: Vec::new(),
        }
    }
}

impl Configuration {
    /// An application telegram with these data; the record is the only one of the MDT.
    #[must_use]
    pub fn application(at: &[u16], mdt: &[u16]) -> Self {
        let bytes: u16 = mdt.iter().map(|&idn| bytes_of(idn)).sum();
        Self { telegram_type: 7, at: at.to_vec(), mdt: mdt.to_vec(), length: 4 + bytes, ..Self::default() }
    }

    /// A standard telegram.
    #[must_use]
    pub fn standard(telegram_type: u16) -> Self {
        let bytes = match telegram_type & 7 {
            0 => 0,
            1 => 2,
            5 => 8,
            _ => 4,
        };
        Self { telegram_type, length: 4 + bytes, ..Self::default() }
    }

    /// The same with one more data block written in CP2.
    #[must_use]
    pub fn with(mut self, idn: u16, words: &[u16]) -> Self {
        self.others.push((idn, words.to_vec()));
        self
    }

    /// The same with a four-byte value.
    #[must_use]
    pub fn with_long(self, idn: u16, value: i32) -> Self {
        let value = value as u32;
        self.with(idn, &[value as u16, (value >> 16) as u16])
    }

    /// A whole MDT with this record in its place, shorter or longer than configured as it may be; the other records are 0.
    #[must_use]
    pub fn mdt(&self, record: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0; usize::from(self.length) + 1];
        bytes[0] = ring::wire::BROADCAST;
        let begin = usize::from(self.position);
        for (place, byte) in bytes.iter_mut().skip(begin).zip(record) {
            *place = *byte;
        }
        bytes
    }

    /// The writes of CP2, in the order of the recorded master (sercos2.md 10.2).
    #[must_use]
    pub fn writes(&self) -> Vec<(u16, Vec<u16>)> {
        let mut writes = Vec::new();
        if let Some(cycle) = self.control_unit_cycle {
            writes.push((1, vec![cycle]));
        }
        for (idn, value) in [
            (2, self.cycle),
            (6, self.t1),
            (89, self.t2),
            (8, self.t3),
            (7, self.t4),
            (9, self.position),
            (10, self.length),
            (15, self.telegram_type),
        ] {
            writes.push((idn, vec![value]));
        }
        if self.telegram_type & 7 == 7 {
            writes.push((16, list(&self.at)));
            writes.push((24, list(&self.mdt)));
        }
        writes.extend(self.others.iter().cloned());
        writes
    }
}

/// A list of two-byte items as it is written: both length words, then the items.
#[must_use]
pub fn list(items: &[u16]) -> Vec<u16> {
    let bytes = 2 * items.len() as u16;
    [[bytes, bytes].as_slice(), items].concat()
}

/// Length of cyclic data, from the table.
#[must_use]
pub fn bytes_of(idn: u16) -> u16 {
    DICTIONARY.find(sercos::Idn(idn)).and_then(|block| block.fixed_bytes()).unwrap_or(0)
}

impl Slave {
    /// CP0 for ten cycles, then CP1 and CP2, with the handshake test of a real master.
    ///
    /// # Errors
    /// The slave does not answer, or its handshake does not follow.
    pub fn to_cp2(&mut self) -> Outcome {
        self.to_cp0();
        self.mst = Some(1);
        self.force(
            true,
            ring::service_client::Step { element: ring::ident::Element::Close, write: false, end: false, info: 0 },
        );
        self.cycles(3);
        let answers = self.last.as_ref().is_some_and(|at| at.status & status::HANDSHAKE != 0);
        if !answers {
            return Err(format!("no answer with AHS = 1 in CP1: {:?}", self.last));
        }
        self.mst = Some(2);
        self.cycles(2);
        self.close()
    }

    /// Ten clean cycles of CP0.
    pub fn to_cp0(&mut self) {
        self.mst = Some(0);
        self.control = 0;
        self.mdt = true;
        self.commands.clear();
        let address = self.address();
        self.address_to(address);
        self.cycles(GOOD_MSTS);
    }

    /// Writes the configuration in CP2.
    ///
    /// # Errors
    /// A write is refused.
    pub fn configure(&mut self, configuration: Configuration) -> Outcome {
        for (idn, words) in configuration.writes() {
            self.must_set(idn, &words)?;
        }
        self.configuration = configuration;
        Ok(())
    }

    /// S-0-0127 must succeed, then the MST goes to CP3.
    ///
    /// # Errors
    /// The check fails, with what it found; or no AT comes in CP3.
    pub fn to_cp3(&mut self) -> Outcome {
        self.check(127, 21)?;
        self.mst = Some(3);
        self.cycles(3);
        if self.is_silent() { Err("no AT in CP3".to_owned()) } else { Ok(()) }
    }

    /// S-0-0128 must succeed, then the MST goes to CP4.
    ///
    /// # Errors
    /// The check fails, with what it found; or no AT comes in CP4.
    pub fn to_cp4(&mut self) -> Outcome {
        self.check(128, 22)?;
        self.mst = Some(4);
        self.cycles(3);
        if self.is_silent() { Err("no AT in CP4".to_owned()) } else { Ok(()) }
    }

    /// As [`Slave::run_up`], with the settings that fit the simulated drive's motor, in this mode.
    ///
    /// # Errors
    /// The first thing that goes wrong.
    pub fn run_up_with_motor(&mut self, phase: u8, mode: u16, configuration: Configuration) -> Outcome {
        let told = configuration.with(32, &[mode]);
        let told = parameters_of(&self.drive.axis).into_iter().fold(told, |told, (idn, value)| match value {
            Value::Word(word) => told.with(idn.0, &[word]),
            Value::Long(long) => told.with_long(idn.0, long.cast_signed()),
            // An axis has no lists and no texts.
            _ => told,
        });
        self.run_up(phase, told)
    }

    /// A proper run-up from whatever there was, with this configuration, to this phase.
    ///
    /// # Errors
    /// The first thing that goes wrong.
    pub fn run_up(&mut self, phase: u8, configuration: Configuration) -> Outcome {
        if phase < 2 {
            self.to_cp0();
            self.mst = Some(phase);
            self.cycles(3);
            return Ok(());
        }
        self.to_cp2()?;
        self.configure(configuration)?;
        if phase >= 3 {
            self.to_cp3()?;
        }
        if phase >= 4 {
            self.to_cp4()?;
        }
        Ok(())
    }

    fn check(&mut self, command: u16, invalid: u16) -> Outcome {
        let status = self.command(command)?;
        if status == 3 {
            return Ok(());
        }
        let culprits: Vec<String> = self.entries(invalid)?.into_iter().map(|idn| Idn(idn).to_string()).collect();
        let finding = self.text(0x8003)?;
        Err(format!("{} ends with {status:X}H: {culprits:?}, {finding}", Idn(command)))
    }
}
