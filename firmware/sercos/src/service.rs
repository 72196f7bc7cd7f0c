//! The service channel: answers the steps of the master that need the processor (sercos2.md 3).
//!
//! The handshake bits belong to the ring controller. [`Server::step`] is called for the steps at which the controller
//! stops: another element or direction, END, a sender buffer used up, a receiver buffer full. Words that the controller
//! sent by itself are not told; words that it took in by itself are, as steps without END.

mod transfer;

use crate::attribute::{Format, Length};
use crate::capacity::{
    LIST_ENTRIES, LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES, LIVE_TEXT_BYTES, LONG_ENTRIES, SEGMENT_WORDS, TEXT_BYTES,
};
use crate::command::{CommandAction, CommandState, CommandStatus, Commands};
use crate::data_block::{DataBlock, Location, Selection};
use crate::dictionary::Dictionary;
use crate::error::{Element, ServiceError};
use crate::idn::Idn;
use crate::parameters::{self, Parameters};
use crate::phase::Phase;
use heapless::{String, Vec};
use transfer::{Source, Staging, State, Transfer};

/// One step of the master, as the control word and INFO of its MDT give it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// Control word bits 5 to 3, 0 to 7.
    pub element: u8,
    /// Control word bit 1: the master writes.
    pub write: bool,
    /// Control word bit 2: last step of this element.
    pub end: bool,
    /// INFO; means something if the master writes.
    pub info: u16,
    /// The controller saw another element or direction than before. The server notices that by itself; the flag tells
    /// it of a transfer that starts anew with the same element.
    pub new_transfer: bool,
    /// For reading: where this step stands in the words of the last [`Reply::Send`].
    pub position: ReadPosition,
}

/// Where a reading step stands in the words of the last [`Reply::Send`], as far as the controller knows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReadPosition {
    /// It took one of them, or there are none.
    #[default]
    Within,
    /// It took one of them that is certainly not the last.
    NotLast,
    /// It took the last one.
    TookLast,
    /// The step before took the last one: this step has no word.
    Exhausted,
}

/// What to do about a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Send these words: the first answers this step if it has no answer yet, the others the steps after it. At least one word.
    Send(Vec<u16, SEGMENT_WORDS>),
    /// Release the step as it is.
    Continue,
    /// The step of a write (or the closing) is accepted.
    Accept {
        /// INFO for the AT: the data status of the open IDN.
        info: u16,
    },
    /// The step is refused: INFO for the AT is the code, with the error bit of the status word.
    Error(ServiceError),
}

/// Data and commands that live in the drive; asked only for data blocks whose [`Location`] says so.
pub trait Live {
    /// Operation data of fixed length; values of two and four bytes in the low part.
    fn read(&mut self, block: &DataBlock, parameters: &Parameters) -> u64;

    /// The value that the MDT carries in the place of a parameter's own, if it does in this phase.
    fn cyclic(&mut self, block: &DataBlock) -> Option<u64>;

    /// A text: one that never changes is returned, any other is put into `text`, which is empty at the call.
    fn read_text(
        &mut self,
        block: &DataBlock,
        parameters: &Parameters,
        text: &mut String<LIVE_TEXT_BYTES>,
    ) -> Option<&'static str>;

    /// A list of two-byte items; `list` is empty at the call.
    fn read_list(&mut self, block: &DataBlock, list: &mut Vec<u16, LIVE_LIST_ENTRIES>);

    /// A list of four-byte items; `list` is empty at the call.
    fn read_longs(&mut self, block: &DataBlock, list: &mut Vec<u32, LIVE_LONG_ENTRIES>);

    /// Takes operation data of fixed length (S-0-0036, S-0-0047 while they are not cyclic); limits, phase and
    /// [`Live::refuses`] have been asked before.
    fn write(&mut self, block: &DataBlock, value: u64);

    /// Takes a text (S-0-0267); phase and [`Live::refuses`] have been asked before.
    ///
    /// # Errors
    /// The text is refused, and nothing has changed.
    fn write_text(&mut self, block: &DataBlock, text: &[u8]) -> Result<(), ServiceError>;

    /// Told after every write but those to commands, before it is acknowledged. A check that was passed is void if it looked at
    /// this data block ([`crate::data_block::DataBlock::needed_for`]).
    ///
    /// # Errors
    /// The drive cannot work with the parameters as they are now: the server gives a parameter its old value back.
    fn written(&mut self, block: &DataBlock, parameters: &mut Parameters) -> Result<(), ServiceError>;

    /// Told after a write whose value the data block cannot have ([`ServiceError::InvalidData`]), unless [`Live::written`] has said so.
    fn not_taken(&mut self, block: &DataBlock);

    /// Does what the master wants of a command, and says how far the command is now (the answer to
    /// [`CommandAction::Cancel`] only matters if it is an error).
    ///
    /// # Errors
    /// The master's step is refused and the state of the command stays.
    fn command(
        &mut self,
        block: &DataBlock,
        action: CommandAction,
        parameters: &mut Parameters,
    ) -> Result<CommandState, ServiceError>;

    /// The communication phase, for write protection.
    fn phase(&self) -> Phase;

    /// A reason of the drive's own against writing this value (0 for lists and texts), as
    /// [`ServiceError::ProtectedBySettings`] while a command works with the data block.
    fn refuses(&mut self, block: &DataBlock, value: u64, parameters: &Parameters) -> Option<ServiceError>;

    /// Whether the password S-0-0267 locks what S-0-0279 lists.
    fn is_locked(&self) -> bool;
}

/// The slave's end of the service channel.
#[derive(Debug)]
pub struct Server {
    dictionary: &'static Dictionary,
    open: Option<&'static DataBlock>,
    transfer: Option<Transfer>,
    staging: Staging,
    commands: Commands,
    segment_words: usize,
}

impl Server {
    /// Closed, no command set, segments of [`SEGMENT_WORDS`].
    pub const fn new(dictionary: &'static Dictionary) -> Self {
        Self::with_segment_words(dictionary, SEGMENT_WORDS)
    }

    /// Like [`Server::new`], but never sends more than so many words (1 to [`SEGMENT_WORDS`]) at once.
    pub const fn with_segment_words(dictionary: &'static Dictionary, words: usize) -> Self {
        let segment_words = match words {
            0 => 1,
            1..=SEGMENT_WORDS => words,
            _ => SEGMENT_WORDS,
        };
        Self { dictionary, open: None, transfer: None, staging: Vec::new(), commands: Commands::new(), segment_words }
    }

    /// Answers one step.
    ///
    /// Nothing but an accepted END of element 7 changes a parameter or a command.
    pub fn step(&mut self, step: Step, parameters: &mut Parameters, live: &mut impl Live) -> Reply {
        let result = match Element::from_number(step.element) {
            None => {
                // Masters close with any L/S, END and INFO, and repeat the word of another drive (sercos2.md 2.1).
                self.close();
                Ok(Reply::Accept { info: 0 })
            }
            Some(Element::Idn) if step.write => self.open(step),
            Some(element) => self.transfer(element, step, parameters, live),
        };
        result.unwrap_or_else(Reply::Error)
    }

    /// Status word bit 5: a command has ended and was not cancelled yet.
    pub fn command_change(&self) -> bool {
        self.commands.change()
    }

    /// The data status of a command.
    pub fn command_status(&self, idn: Idn) -> CommandStatus {
        self.dictionary.find(idn).map_or(CommandStatus::NotSet, |block| self.commands.status(block))
    }

    /// News of a command that [`Live::command`] has called [`CommandState::Executing`].
    pub fn command_progress(&mut self, idn: Idn, state: CommandState) {
        if let Some(block) = self.dictionary.find(idn) {
            self.commands.progress(block, state);
        }
    }

    /// To be called on every phase change. The channel stays open from CP2 to CP4 (the master keeps its handshake);
    /// commands that cannot be cancelled in the new phase are forgotten.
    pub fn phase_changed(&mut self, phase: Phase) {
        if phase <= Phase::Cp2 {
            self.close();
        }
        self.commands.phase_changed(phase, self.dictionary);
    }

    /// The IDN that is open.
    pub fn open_idn(&self) -> Option<Idn> {
        self.open.map(|block| block.idn)
    }

    /// Closes the channel.
    pub fn close(&mut self) {
        self.open = None;
        self.transfer = None;
    }

    fn open(&mut self, step: Step) -> Result<Reply, ServiceError> {
        self.transfer = None;
        if !step.end {
            return Err(ServiceError::InvalidIdnAccess);
        }
        self.open = self.dictionary.find(Idn(step.info));
        let block = self.open.ok_or(ServiceError::IdnNotAvailable)?;
        Ok(Reply::Accept { info: self.data_status(block) })
    }

    fn transfer(
        &mut self,
        element: Element,
        step: Step,
        parameters: &mut Parameters,
        live: &mut impl Live,
    ) -> Result<Reply, ServiceError> {
        let block = self.open.ok_or(ServiceError::ChannelNotOpen)?;
        let running = self.transfer.take().filter(|running| {
            // The controller takes what follows a refused step for a new transfer. A master that goes on writing regardless does not begin one:
            // what is left of its words is no value.
            let is_rest = matches!(running.state, State::Failed { write: true, .. });
            running.element == element && running.state.is_write() == step.write && (!step.new_transfer || is_rest)
        });
        let result = match (running.map(|running| running.state), step.write) {
            (Some(State::Failed { error, .. }), _) => Err(error),
            (Some(State::Reading { source, position }), _) => self.go_on_reading(element, step, source, position),
            (None, false) => self.start_reading(element, step, block, parameters, live),
            (Some(State::Writing), _) => self.take_written(step, block, parameters, live),
            (None, true) => {
                self.staging.clear();
                may_write(element, block, parameters, live)
                    .and_then(|()| self.take_written(step, block, parameters, live))
            }
        };
        if !step.end {
            let state = match &result {
                Ok((_, state)) => *state,
                Err(error) => State::Failed { error: *error, write: step.write },
            };
            self.transfer = Some(Transfer { element, state });
        }
        result.map(|(reply, _)| reply)
    }

    fn start_reading(
        &mut self,
        element: Element,
        step: Step,
        block: &'static DataBlock,
        parameters: &Parameters,
        live: &mut impl Live,
    ) -> Result<(Reply, State), ServiceError> {
        let source = self.source(element, block, parameters, live)?;
        self.send(element, step, source, 0)
    }

    fn go_on_reading(
        &self,
        element: Element,
        step: Step,
        source: Source,
        position: usize,
    ) -> Result<(Reply, State), ServiceError> {
        let goes_on = position < source.words(&self.staging);
        let same = State::Reading { source, position };
        match (step.position, step.end) {
            // Only the last segment holds the last word, and it is so short that the controller knows which word was taken.
            (ReadPosition::NotLast, true) => Err(ServiceError::TooShort(element)),
            (ReadPosition::Within | ReadPosition::TookLast, true) if goes_on => Err(ServiceError::TooShort(element)),
            (ReadPosition::TookLast | ReadPosition::Exhausted, false) if goes_on => {
                self.send(element, step, source, position)
            }
            (ReadPosition::Exhausted, true) if goes_on => self.send(element, step, source, position),
            (ReadPosition::TookLast, false) | (ReadPosition::Exhausted, _) => Err(ServiceError::TooLong(element)),
            (ReadPosition::Within | ReadPosition::NotLast, false)
            | (ReadPosition::Within | ReadPosition::TookLast, true) => Ok((Reply::Continue, same)),
        }
    }

    fn send(
        &self,
        element: Element,
        step: Step,
        source: Source,
        position: usize,
    ) -> Result<(Reply, State), ServiceError> {
        let remaining = source.words(&self.staging).saturating_sub(position);
        if step.end && remaining > 1 {
            return Err(ServiceError::TooShort(element));
        }
        let segment = source.segment(&self.staging, position, self.segment_words.min(before_last_segment(remaining)));
        let position = position.saturating_add(segment.len());
        Ok((Reply::Send(segment), State::Reading { source, position }))
    }

    /// Finds the words of an element, staging those that may change while they are read.
    fn source(
        &mut self,
        element: Element,
        block: &'static DataBlock,
        parameters: &Parameters,
        live: &mut impl Live,
    ) -> Result<Source, ServiceError> {
        let staging = &mut self.staging;
        let limit = |limit: Option<i64>| match (limit, block.fixed_bytes()) {
            // Limits are checked to fit the format when the dictionary is tested; the cast keeps the bits that are sent.
            (Some(limit), Some(bytes)) => Ok((bytes, limit as u64)),
            _ => Err(ServiceError::NotAvailable(element)),
        };
        match element {
            Element::Idn => transfer::stage_fixed(staging, 2, block.idn.0.into()),
            Element::Name => return Ok(Source::Text(block.name)),
            Element::Unit if block.unit.is_empty() => return Err(ServiceError::NotAvailable(element)),
            Element::Unit => return Ok(Source::Text(block.scaled_unit(parameters))),
            Element::Attribute => {
                transfer::stage_fixed(staging, 4, block.scaled_attribute(parameters).raw_value().into());
            }
            Element::Minimum | Element::Maximum => {
                let (bytes, raw) = limit(if element == Element::Minimum { block.minimum } else { block.maximum })?;
                transfer::stage_fixed(staging, bytes, raw);
            }
            Element::Data => match (block.location, block.fixed_bytes()) {
                (Location::Dictionary(selection), _) => return Ok(Source::Idns(self.dictionary.list(selection))),
                (Location::Command, _) => {
                    transfer::stage_fixed(staging, 2, u64::from(self.commands.status(block) as u16));
                }
                (Location::Parameter, Some(bytes)) => {
                    let cyclic = if block.is_in(Selection::ConfigurableInMdt) { live.cyclic(block) } else { None };
                    transfer::stage_fixed(staging, bytes, cyclic.unwrap_or_else(|| parameters.get(block.idn).into()));
                }
                (Location::Live, Some(bytes)) => {
                    transfer::stage_fixed(staging, bytes, live.read(block, parameters));
                }
                (Location::Parameter, None) => match list_kind(block) {
                    ListKind::Text => transfer::stage_text(staging, parameters.text(block.idn), TEXT_BYTES),
                    ListKind::Idns => {
                        let idns = parameters.list(block.idn).iter().map(|idn| idn.0);
                        transfer::stage_list(staging, idns, LIST_ENTRIES);
                    }
                    ListKind::Words => {
                        transfer::stage_list(staging, parameters.words(block.idn).iter().copied(), LIST_ENTRIES);
                    }
                    ListKind::Longs => transfer::stage_longs(staging, parameters.longs(block.idn), LONG_ENTRIES),
                },
                (Location::Live, None) => match list_kind(block) {
                    ListKind::Text => {
                        let mut text = String::new();
                        if let Some(text) = live.read_text(block, parameters, &mut text) {
                            return Ok(Source::Text(text));
                        }
                        transfer::stage_text(staging, &text, LIVE_TEXT_BYTES);
                    }
                    ListKind::Idns | ListKind::Words => {
                        let mut list = Vec::new();
                        live.read_list(block, &mut list);
                        transfer::stage_list(staging, list.iter().copied(), LIVE_LIST_ENTRIES);
                    }
                    ListKind::Longs => {
                        let mut list = Vec::new();
                        live.read_longs(block, &mut list);
                        transfer::stage_longs(staging, &list, LIVE_LONG_ENTRIES);
                    }
                },
            },
        }
        Ok(Source::Staged)
    }

    fn take_written(
        &mut self,
        step: Step,
        block: &'static DataBlock,
        parameters: &mut Parameters,
        live: &mut impl Live,
    ) -> Result<(Reply, State), ServiceError> {
        transfer::take_word(&mut self.staging, block, step.info)?;
        if step.end {
            if !transfer::is_complete(&self.staging, block) {
                return Err(ServiceError::TooShort(Element::Data));
            }
            // Asked again: the phase may have changed since the first word.
            may_write(Element::Data, block, parameters, live)?;
            self.execute_write(block, parameters, live)?;
        }
        Ok((Reply::Accept { info: self.data_status(block) }, State::Writing))
    }

    fn execute_write(
        &mut self,
        block: &DataBlock,
        parameters: &mut Parameters,
        live: &mut impl Live,
    ) -> Result<(), ServiceError> {
        let idn = block.idn;
        let value = if block.fixed_bytes().is_some() { transfer::written_value(&self.staging) } else { 0 };
        parameters::check_limits(block, value)?;
        let before = parameters.save(idn);
        if let Err(error) = self.take(block, value, parameters, live) {
            if error == ServiceError::InvalidData {
                live.not_taken(block);
            }
            return Err(error);
        }
        if block.location == Location::Command {
            return Ok(());
        }
        if let Err(error) = live.written(block, parameters) {
            parameters.restore(idn, before);
            return Err(error);
        }
        parameters.mark_written(idn);
        Ok(())
    }

    /// Puts what was written where it belongs.
    fn take(
        &mut self,
        block: &DataBlock,
        value: u64,
        parameters: &mut Parameters,
        live: &mut impl Live,
    ) -> Result<(), ServiceError> {
        let idn = block.idn;
        if let Some(error) = live.refuses(block, value, parameters) {
            return Err(error);
        }
        match (block.location, block.fixed_bytes()) {
            (Location::Command, _) => {
                let value = (value & 0xFFFF) as u16;
                self.commands.write(block, value, |action| live.command(block, action, parameters))
            }
            (Location::Dictionary(_), _) => Err(ServiceError::ReadOnly(Element::Data)),
            (Location::Live, Some(_)) => {
                live.write(block, value);
                Ok(())
            }
            (Location::Live, None) if block.is_text() => {
                live.write_text(block, &transfer::written_bytes(&self.staging))
            }
            (Location::Live, None) => Err(ServiceError::ReadOnly(Element::Data)),
            (Location::Parameter, Some(_)) => parameters.set(idn, value),
            (Location::Parameter, None) => match list_kind(block) {
                ListKind::Text => parameters.set_text(idn, &transfer::written_bytes(&self.staging)),
                ListKind::Idns => {
                    let mut entries: Vec<Idn, LIST_ENTRIES> = Vec::new();
                    transfer::fill(&mut entries, self.staging.iter().skip(2).map(|&raw| Idn(raw)));
                    parameters.set_list(idn, &entries)
                }
                ListKind::Words => parameters.set_words(idn, self.staging.get(2..).unwrap_or(&[])),
                ListKind::Longs => parameters.set_longs(idn, &transfer::written_longs(&self.staging)),
            },
        }
    }

    /// The data status: the command acknowledgement, 0 for everything else (sercos2.md 3.6).
    fn data_status(&self, block: &DataBlock) -> u16 {
        match block.location {
            Location::Command => self.commands.status(block) as u16,
            _ => 0,
        }
    }
}

/// Words to be sent before the last segment of an element, or in it.
///
/// A controller that passes words by itself tells of END where it comes, and the handshake bit gives the parity of the word that was taken
/// then. With a last segment of at most two words this is enough to know whether END came too early.
const fn before_last_segment(remaining: usize) -> usize {
    const LAST_SEGMENT: usize = 2;
    if remaining > LAST_SEGMENT { remaining.saturating_sub(LAST_SEGMENT) } else { remaining }
}

/// What the items of a list are.
#[derive(Clone, Copy)]
enum ListKind {
    Text,
    Idns,
    Words,
    Longs,
}

const fn list_kind(block: &DataBlock) -> ListKind {
    match (block.attribute.length(), block.attribute.format()) {
        (Length::ListOfFour, _) => ListKind::Longs,
        (Length::ListOfTwo, Format::Idn) => ListKind::Idns,
        (Length::ListOfTwo, _) => ListKind::Words,
        _ => ListKind::Text,
    }
}

/// Write protection, before the first and after the last word.
fn may_write(
    element: Element,
    block: &DataBlock,
    parameters: &Parameters,
    live: &impl Live,
) -> Result<(), ServiceError> {
    if element != Element::Data {
        let available = match element {
            Element::Unit => !block.unit.is_empty(),
            Element::Minimum => block.minimum.is_some(),
            Element::Maximum => block.maximum.is_some(),
            _ => true,
        };
        return Err(if available { ServiceError::ReadOnly(element) } else { ServiceError::NotAvailable(element) });
    }
    let phase = live.phase();
    if block.attribute.is_read_only() {
        Err(ServiceError::ReadOnly(element))
    } else if block.attribute.is_protected_in(phase) {
        Err(ServiceError::WriteProtected(element))
    } else if phase >= Phase::Cp3 && parameters.cyclic_mdt().contains(&block.idn) {
        // Only what the MDT overwrites every cycle; a value that is merely shown in the AT can still be written.
        Err(ServiceError::ConfiguredCyclically)
    } else if block.stored && live.is_locked() {
        Err(ServiceError::ProtectedByPassword)
    } else {
        Ok(())
    }
}
