//! A drive's answer to one step of the service channel: bytes of an MDT in, bytes of an AT out.
//!
//! `cargo run -p sercos --example service_request`

use heapless::{String, Vec};
use sercos::capacity::{LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES, LIVE_TEXT_BYTES};
use sercos::command::{CommandAction, CommandState};
use sercos::data_block::DataBlock;
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::service::{Live, ReadPosition, Reply, Server, Step};
use sercos::telegram::RecordPacket;
use sercos::word::{Readiness, StatusWord};
use sercos::{Idn, Phase};

// The table of data blocks, which every product writes for itself.
mod sample;
use sample::DICTIONARY;

/// The drive behind the channel. It has one value of its own, the position.
struct Drive {
    position: i32,
}

impl Live for Drive {
    fn read(&mut self, block: &DataBlock, _: &Parameters) -> u64 {
        if block.idn == Idn::standard(51) { u64::from(self.position.cast_unsigned()) } else { 0 }
    }
    fn cyclic(&mut self, _: &DataBlock) -> Option<u64> {
        None
    }
    fn read_text(&mut self, _: &DataBlock, _: &Parameters, _: &mut String<LIVE_TEXT_BYTES>) -> Option<&'static str> {
        Some("a drive")
    }
    fn read_list(&mut self, _: &DataBlock, _: &mut Vec<u16, LIVE_LIST_ENTRIES>) {}
    fn read_longs(&mut self, _: &DataBlock, _: &mut Vec<u32, LIVE_LONG_ENTRIES>) {}
    fn write(&mut self, _: &DataBlock, _: u64) {}
    fn write_text(&mut self, _: &DataBlock, _: &[u8]) -> Result<(), ServiceError> {
        Err(ServiceError::ProtectedByPassword)
    }
    fn written(&mut self, _: &DataBlock, _: &mut Parameters) -> Result<(), ServiceError> {
        Ok(())
    }
    fn not_taken(&mut self, _: &DataBlock) {}
    fn command(&mut self, _: &DataBlock, _: CommandAction, _: &mut Parameters) -> Result<CommandState, ServiceError> {
        Ok(CommandState::Executed)
    }
    fn phase(&self) -> Phase {
        Phase::Cp2
    }
    fn refuses(&mut self, _: &DataBlock, _: u64, _: &Parameters) -> Option<ServiceError> {
        None
    }
    fn is_locked(&self) -> bool {
        false
    }
}

/// The record of an AT that answers the record of an MDT.
///
/// A SERCON816 does this by itself for the words within an element; another controller asks the server at every step.
fn answer(record: &[u8], server: &mut Server, parameters: &mut Parameters, drive: &mut Drive) -> [u8; 4] {
    let record = RecordPacket::new_checked(record).expect("a record is four bytes or more");
    let control = record.control();
    let step = Step {
        element: control.element().value(),
        write: control.write(),
        end: control.end(),
        info: record.info(),
        new_transfer: true,
        position: ReadPosition::Within,
    };
    let (info, refused) = match server.step(step, parameters, drive) {
        Reply::Send(words) => (words[0], false),
        Reply::Continue => (0, false),
        Reply::Accept { info } => (info, false),
        Reply::Error(error) => (error.code(), true),
    };
    let status = StatusWord::default()
        .with_readiness(Readiness::ReadyForPower)
        .with_service_error(refused)
        .with_handshake(control.handshake());
    let mut bytes = [0; 4];
    let mut at = RecordPacket::new_checked(&mut bytes[..]).expect("four bytes are a record");
    at.set_first_word(status.raw_value());
    at.set_info(info);
    bytes
}

pub(crate) fn main() {
    let (mut server, mut parameters, mut drive) =
        (Server::new(&DICTIONARY), Parameters::new(&DICTIONARY), Drive { position: 123_456 });
    let mut dialogue = |what: &str, mdt: [u8; 4]| {
        let at = answer(&mdt, &mut server, &mut parameters, &mut drive);
        println!("{what:<38} MDT {mdt:02X?}  AT {at:02X?}");
        at
    };
    // Control word: element in bits 5 to 3, END bit 2, L/S bit 1, MHS bit 0.
    assert_eq!(dialogue("open S-0-0051", [0x0F, 0, 51, 0]), [0x01, 0x40, 0, 0]);
    // 123456 = 1E240H; the low word comes first.
    assert_eq!(dialogue("read its operation data, first word", [0x38, 0, 51, 0]), [0x00, 0x40, 0x40, 0xE2]);
    // 7004H: operation data that cannot be changed.
    assert_eq!(dialogue("write it", [0x3F, 0, 1, 0])[0] & 4, 4, "a feedback value is write-protected");
    assert_eq!(dialogue("close", [0x02, 0, 51, 0]), [0x00, 0x40, 0, 0]);
    assert_eq!(dialogue("open S-0-4000, which is not there", [0x0F, 0, 0xA0, 0x0F]), [0x05, 0x40, 0x01, 0x10]);
}
