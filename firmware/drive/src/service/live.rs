//! The drive as the service channel asks for it.

use heapless::{String, Vec};
use rtic_core::Mutex;
use sercon816::Bus;
use sercos::Phase;
use sercos::capacity::{LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES, LIVE_TEXT_BYTES};
use sercos::command::{CommandAction, CommandState};
use sercos::data_block::DataBlock;
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::service::Live;

use super::context::Context;
use super::finding::{Finding, what_it_takes};
use crate::dictionary::access::Access;
use crate::dictionary::access_of;
use crate::dictionary::texts::Text;
use crate::hardware::Hardware;
use crate::motion::Motion;

impl<B, H, M> Live for Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    fn read(&mut self, block: &DataBlock, parameters: &Parameters) -> u64 {
        self.value(access_of(block), parameters).into()
    }

    fn cyclic(&mut self, block: &DataBlock) -> Option<u64> {
        let Access::Limit(limit) = access_of(block) else { return None };
        self.motion.lock(|motion| motion.cyclic_limit(limit)).map(u64::from)
    }

    fn read_text(
        &mut self,
        block: &DataBlock,
        parameters: &Parameters,
        buffer: &mut String<LIVE_TEXT_BYTES>,
    ) -> Option<&'static str> {
        let Access::Text(text) = access_of(block) else { return None };
        self.text(text, parameters, buffer)
    }

    fn read_list(&mut self, block: &DataBlock, list: &mut Vec<u16, LIVE_LIST_ENTRIES>) {
        if let Access::Words(words) = access_of(block) {
            self.words(words, list);
        }
    }

    fn read_longs(&mut self, block: &DataBlock, list: &mut Vec<u32, LIVE_LONG_ENTRIES>) {
        if let Access::Longs(longs) = access_of(block) {
            self.longs(longs, list);
        }
    }

    fn write(&mut self, block: &DataBlock, value: u64) {
        self.set_value(access_of(block), (value & 0xFFFF_FFFF) as u32);
    }

    fn write_text(&mut self, block: &DataBlock, text: &[u8]) -> Result<(), ServiceError> {
        if access_of(block) != Access::Text(Text::Password) {
            return Err(ServiceError::IdnNotAvailable);
        }
        let before = self.access.is_locked();
        self.access.write(text)?;
        let locked = self.access.is_locked();
        if locked != before {
            self.motion.lock(|motion| motion.show_lock(locked));
            self.note_lock();
        }
        Ok(())
    }

    fn written(&mut self, block: &DataBlock, parameters: &mut Parameters) -> Result<(), ServiceError> {
        self.take_effect(block, parameters)
    }

    fn not_taken(&mut self, block: &DataBlock) {
        self.checks.finding = Some(Finding::Value(block.idn, what_it_takes(block)));
    }

    fn command(
        &mut self,
        block: &DataBlock,
        action: CommandAction,
        parameters: &mut Parameters,
    ) -> Result<CommandState, ServiceError> {
        let Access::Procedure(procedure) = access_of(block) else { return Err(ServiceError::IdnNotAvailable) };
        self.procedure(procedure, action, parameters)
    }

    fn refuses(&mut self, block: &DataBlock, value: u64, parameters: &Parameters) -> Option<ServiceError> {
        self.refusal(block, value, parameters)
    }

    fn is_locked(&self) -> bool {
        self.access.is_locked()
    }

    fn phase(&self) -> Phase {
        self.phases.current()
    }
}
