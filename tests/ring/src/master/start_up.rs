//! CP1 to CP3: who is there, what it needs, what it is told, whether it agrees.

use super::{Drive, MasterError, Round, ScriptedMaster, SlotChoice, Telegram, Work};
use crate::ident::{Idn, Value};
use crate::service_client::{Finished, Reply, Request, ServiceError, control};
use crate::slots::{DriveData, DriveTimes, Slots};

/// Cycles without a returned MST after which the ring is called open.
pub(super) const RING_OPEN_AFTER: u32 = 200;
/// How often an address is asked for an answer in CP1.
const IDENTIFICATION_TRIES: u32 = 10;
/// How often the data status of a procedure command is asked for.
const COMMAND_POLLS: u32 = 200;
/// What is read from every drive in CP2, in the order of the recorded master; S-0-0087 besides.
const TIMES: [Idn; 7] =
    [Idn::T1_MIN, Idn::T_AT_MDT, Idn::T_MDT_MST, Idn::SLAVE_ARRANGEMENT, Idn::T5, Idn::T_MDT_COMMAND, Idn::T_AT_AT];

impl ScriptedMaster {
    /// The MDT of CP1: one address after the other, until it answers.
    pub(super) fn identify(&mut self) -> Option<Vec<u8>> {
        let Work::Identify { mut drive, mut tries } = self.work else { return None };
        if self.addressed == Some(drive) && self.drives[drive].at.is_some() {
            drive += 1;
            tries = 0;
        }
        self.addressed = None;
        if tries == IDENTIFICATION_TRIES {
            self.fail(MasterError::NoAnswer { address: self.drives[drive].address, tries });
            return None;
        }
        self.work = Work::Identify { drive, tries: tries + 1 };
        let address = self.drives.get(drive)?.address;
        self.addressed = Some(drive);
        let word = control::HANDSHAKE.to_le_bytes();
        Some(vec![address, word[0], word[1], 0, 0])
    }

    /// The MDT of CP2: one drive a cycle.
    pub(super) fn dialogue(&mut self) -> Option<Vec<u8>> {
        if let Work::Dialogue { round, drive, loaded: false } = self.work {
            for request in self.requests(round, drive) {
                self.drives[drive].client.request(request);
            }
            self.work = Work::Dialogue { round, drive, loaded: true };
        }
        let talking = match self.work {
            Work::Dialogue { drive, .. } => drive,
            _ => self.drives.len().checked_sub(1)?,
        };
        let expected = self.addressed == Some(talking);
        let drive = &mut self.drives[talking];
        if expected && drive.at.is_none() {
            self.report.drives[talking].missed_ats += 1;
        }
        let words = drive.client.poll(drive.at.as_ref().map(|at| at.words));
        let [low, high] = words.control.to_le_bytes();
        let [info_low, info_high] = words.info.to_le_bytes();
        let bytes = vec![drive.address, low, high, info_low, info_high];
        self.addressed = Some(talking);
        self.take_results(talking);
        if let Work::Dialogue { round, drive, .. } = self.work
            && self.drives[drive].client.is_idle()
        {
            self.next_in_dialogue(round, drive + 1);
        }
        Some(bytes)
    }

    /// CP3: once the drives have had their time, all of them at once.
    pub(super) fn check_for_cp4(&mut self) {
        match self.work {
            Work::Synchronise { left: 0 } => {
                for (drive, script) in self.drives.iter_mut().zip(&self.script.drives) {
                    for (idn, value) in &script.parameters_cp3 {
                        drive.client.request(write(*idn, value.clone()));
                    }
                    drive.client.request(Request::Command { idn: Idn::CHECK_FOR_CP4, polls: COMMAND_POLLS });
                }
                self.work = Work::CheckForCp4;
            }
            Work::CheckForCp4 if self.drives.iter().all(|drive| drive.client.is_idle()) => {
                self.work = Work::Settle { left: self.script.idle_before_cp4.max(1), phase: 4 };
            }
            _ => {}
        }
    }

    /// Results of one drive's service channel.
    pub(super) fn take_results(&mut self, index: usize) {
        while let Some(finished) = self.drives[index].client.take_finished() {
            let judged = judge(&mut self.drives[index], &finished, self.phase);
            self.report.drives[index].services.push(finished);
            if let Err(error) = judged {
                let beside_the_script =
                    matches!(self.work, Work::Move(_)) && self.phase == 4 && !self.script.stops_at_refusals;
                if !beside_the_script && !matches!(self.work, Work::Finished | Work::Failed) {
                    self.fail(error);
                }
            }
        }
    }

    fn next_in_dialogue(&mut self, round: Round, drive: usize) {
        if drive < self.drives.len() {
            self.work = Work::Dialogue { round, drive, loaded: false };
            return;
        }
        let next = match round {
            Round::Read => {
                if let Err(error) = self.place() {
                    self.fail(error);
                    return;
                }
                Round::Write
            }
            Round::Write if self.script.reset_diagnostics => Round::Reset,
            Round::Write | Round::Reset => Round::Check,
            Round::Check => {
                self.work = Work::Settle { left: self.script.idle_before_cp3.max(1), phase: 3 };
                return;
            }
        };
        self.work = Work::Dialogue { round: next, drive: 0, loaded: false };
    }

    fn requests(&self, round: Round, drive: usize) -> Vec<Request> {
        let script = &self.script.drives[drive];
        match round {
            Round::Read => {
                let times = TIMES.map(Request::Read);
                let fields = script.telegram.at.iter().chain(&script.telegram.mdt);
                std::iter::once(Request::Handshake)
                    .chain(times)
                    .chain(fields.map(|idn| Request::ReadAttribute(*idn)))
                    .collect()
            }
            Round::Write => self.communication_parameters(drive),
            Round::Reset => vec![Request::Command { idn: Idn::RESET_CLASS_1, polls: COMMAND_POLLS }],
            Round::Check => vec![Request::Command { idn: Idn::CHECK_FOR_CP3, polls: COMMAND_POLLS }],
        }
    }

    fn communication_parameters(&self, drive: usize) -> Vec<Request> {
        let (Some(slots), script) = (&self.slots, &self.script.drives[drive]) else { return Vec::new() };
        let data = self.data();
        let word = |idn: Idn, value: u16| Request::Write(idn, Value::Word(value));
        let mut requests = vec![
            word(Idn::CONTROL_UNIT_CYCLE, self.script.cycle * self.script.control_unit_cycles),
            word(Idn::CYCLE, self.script.cycle),
            word(Idn::T1, slots.t1[drive]),
            word(Idn::T2, slots.t2),
            word(Idn::T3, slots.t3),
            word(Idn::T4, slots.t4),
            word(Idn::MDT_POSITION, Slots::mdt_positions(&data)[drive]),
            word(Idn::MDT_LENGTH, Slots::mdt_length(&data) as u16),
            word(Idn::TELEGRAM_TYPE, script.telegram.kind),
        ];
        if script.telegram.kind & Telegram::APPLICATION == Telegram::APPLICATION {
            requests.push(Request::WriteList(Idn::AT_LIST, Value::idns(&script.telegram.at)));
            requests.push(Request::WriteList(Idn::MDT_LIST, Value::idns(&script.telegram.mdt)));
        }
        requests.extend(script.parameters.iter().map(|(idn, value)| write(*idn, value.clone())));
        requests
    }

    /// Everything has been read: the slots, and with them the layout of the telegrams.
    fn place(&mut self) -> Result<(), MasterError> {
        let mut times = Vec::new();
        for (index, drive) in self.drives.iter_mut().enumerate() {
            let telegram = &self.script.drives[index].telegram;
            let length = |idn: &Idn| (*idn, lengths(drive.values.get(idn)));
            drive.layout.at = telegram.at.iter().map(length).collect();
            drive.layout.mdt = telegram.mdt.iter().map(length).collect();
            let word = |idn: Idn| drive.values.get(&idn).and_then(Value::as_number).unwrap_or(0) as u16;
            let needs = DriveTimes {
                t1_min: word(Idn::T1_MIN),
                t_at_mdt: word(Idn::T_AT_MDT),
                t5: word(Idn::T5),
                t_mdt_mst: word(Idn::T_MDT_MST),
                t_mdt_command: word(Idn::T_MDT_COMMAND),
                t_at_at: word(Idn::T_AT_AT),
                arrangement: word(Idn::SLAVE_ARRANGEMENT),
            };
            self.report.drives[index].times = needs;
            times.push(needs);
        }
        let slots = match &self.script.slots {
            SlotChoice::Fixed(slots) => slots.clone(),
            SlotChoice::Computed(place) => {
                Slots::compute(&times, &self.data(), self.script.cycle, self.script.bit_rate, *place)?
            }
        };
        self.report.slots = Some(slots.clone());
        self.slots = Some(slots);
        Ok(())
    }

    fn data(&self) -> Vec<DriveData> {
        self.drives.iter().map(|drive| drive.layout.data()).collect()
    }
}

/// Lists are written the way the recorded master does it, with their attribute read first.
fn write(idn: Idn, value: Value) -> Request {
    match value {
        Value::Bytes(_) => Request::WriteList(idn, value),
        _ => Request::Write(idn, value),
    }
}

/// The length of cyclic data is kept beside the values, as a number.
fn lengths(stored: Option<&Value>) -> usize {
    stored.and_then(Value::as_number).unwrap_or(0) as usize
}

/// What a result means for the run-up.
fn judge(drive: &mut Drive, finished: &Finished, phase: u8) -> Result<(), MasterError> {
    let address = drive.address;
    let invalid_list = |idn: Idn| if idn == Idn::CHECK_FOR_CP3 { Idn::INVALID_FOR_CP3 } else { Idn::INVALID_FOR_CP4 };
    match (&finished.request, &finished.result) {
        (Request::Read(idn), result)
            if drive.refused.is_some() && matches!(*idn, Idn::INVALID_FOR_CP3 | Idn::INVALID_FOR_CP4) =>
        {
            let invalid = result.as_ref().ok().and_then(Reply::value).and_then(Value::as_idns).unwrap_or_default();
            match drive.refused.take() {
                Some(error) => Err(MasterError::CheckRefused { address, error, invalid }),
                None => Ok(()),
            }
        }
        (Request::Read(idn), Ok(Reply::Data { value, .. })) => {
            drive.values.insert(*idn, value.clone());
            Ok(())
        }
        (Request::ReadAttribute(idn), Ok(Reply::Attribute(attribute))) => match attribute.fixed_bytes() {
            Some(bytes) => {
                drive.values.insert(*idn, Value::Word(bytes as u16));
                Ok(())
            }
            None => {
                let error = ServiceError::ReservedLength { idn: *idn, attribute: attribute.0 };
                Err(MasterError::Service { address, phase, error })
            }
        },
        (Request::Command { idn, .. }, Err(error @ ServiceError::CommandFailed { .. }))
            if matches!(*idn, Idn::CHECK_FOR_CP3 | Idn::CHECK_FOR_CP4) =>
        {
            drive.refused = Some(*error);
            drive.client.request(Request::Read(invalid_list(*idn)));
            Ok(())
        }
        // Only a slave with several drives needs it (sercos2.md 4.1).
        (Request::Read(Idn::T_AT_AT), Err(ServiceError::Refused { .. })) => Ok(()),
        (_, Ok(_)) => Ok(()),
        (_, Err(error)) => Err(MasterError::Service { address, phase, error: *error }),
    }
}
