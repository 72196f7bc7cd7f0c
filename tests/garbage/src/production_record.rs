//! What the works may have written into a drive.

use drive::dictionary::{parameters_on, source};
use drive::production::{Production, ProductionRecord, RECORD_BYTES, Text};
use drive::{Amplifier, DriveSettings};

use crate::bytes::Bytes;
use crate::configuration::FACTS;

/// Whatever stands in the flash:
///
/// * nothing panics, and what was not written as a record is none;
/// * a record of whatever numbers gives them back, and the scaling of the loops takes or refuses them.
///
/// # Panics
/// When one of these does not hold.
pub fn production_record(bytes: &[u8]) {
    let mut sector = bytes.to_vec();
    sector.resize(RECORD_BYTES, 0);
    if let Production::Record(record) = Production::read(&sector) {
        assert_eq!(record.emit().as_slice(), sector);
    }
    let mut bytes = Bytes::new(bytes);
    let mut long = || Some(u32::from(bytes.word()?) << 16 | u32::from(bytes.word()?));
    let Some(amplifier) = (|| {
        Some(Amplifier {
            peak_current: long()?,
            continuous_current: long()?,
            trip_current: long()?,
            current_range: long()?,
            thermal_time_constant: long()?,
            dead_time_band: long()? as u16,
            bus_range: long()? as u16,
            undervoltage: long()? as u16,
            overvoltage: long()? as u16,
            withstand_voltage: long()? as u16,
            least_resistance: long()? as u16,
            warning_temperature: long()? as u16,
            shutdown_temperature: long()? as u16,
        })
    })() else {
        return;
    };
    let record = ProductionRecord { hardware: Text::new(), serial_number: Text::new(), amplifier };
    assert_eq!(ProductionRecord::parse(&record.emit()), Ok(record));
    let _ = DriveSettings::new(&parameters_on(&amplifier, &FACTS), &FACTS, source);
}
