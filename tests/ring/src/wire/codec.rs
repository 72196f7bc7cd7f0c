//! Flags, zero insertion and frame check sequence: bytes to line bits and back.

use crc::{CRC_16_IBM_SDLC, Crc};

use super::{CHECK_SEQUENCE_BYTES, LineError, SHORTEST_TELEGRAM_BYTES};

/// The flag that opens and closes a telegram, in wire order.
pub const FLAG: [bool; 8] = [false, true, true, true, true, true, true, false];

/// CRC-16/X.25: the catalogue's name is IBM-SDLC (sercon816.md 10.2).
const CHECK: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_SDLC);

/// After this many ones between the flags a zero is inserted.
const ONES_BEFORE_INSERTED_ZERO: u32 = 5;
/// This many ones in a row never occur in a telegram: abort or fill (sercon816.md 10.3, 10.5).
const ONES_OF_ABORT: u32 = 7;

/// The frame check sequence over address and data; sent low byte first.
///
/// sercos2.md 1.1: `FF 00` gives F087H, on the wire `87 F0`.
pub fn check_sequence(bytes: &[u8]) -> u16 {
    CHECK.checksum(bytes)
}

/// The line bits of a telegram: flag, address and data, frame check sequence, flag; zeros inserted.
pub fn encode(bytes: &[u8]) -> Vec<bool> {
    let mut bits = Vec::with_capacity(16 + (bytes.len() + CHECK_SEQUENCE_BYTES) * 10);
    bits.extend(FLAG);
    let mut ones = 0;
    for byte in bytes.iter().copied().chain(check_sequence(bytes).to_le_bytes()) {
        for position in 0..8 {
            let bit = byte >> position & 1 == 1;
            bits.push(bit);
            ones = if bit { ones + 1 } else { 0 };
            if ones == ONES_BEFORE_INSERTED_ZERO {
                bits.push(false);
                ones = 0;
            }
        }
    }
    bits.extend(FLAG);
    bits
}

/// Address and data of the first telegram in `bits`, its frame check sequence checked and taken off.
///
/// Bits before the opening and after the closing flag are ignored.
///
/// # Errors
///
/// The first reason, in the order of the line, why there is no valid telegram.
pub fn decode(bits: &[bool]) -> Result<Vec<u8>, LineError> {
    let opening =
        bits.windows(FLAG.len()).position(|window| window == FLAG).ok_or(LineError::NoFlag { bits: bits.len() })?;
    let mut rest = &bits[opening + FLAG.len()..];
    let mut content = content_before_flag(rest)?;
    while content.is_empty() {
        // A flag right after a flag: only the last one opens. The two may share a zero.
        let shared_zeros = usize::from(rest.first() == Some(&true));
        rest = &rest[FLAG.len() - shared_zeros..];
        content = content_before_flag(rest)?;
    }
    let data = without_inserted_zeros(content);
    if !data.len().is_multiple_of(8) {
        return Err(LineError::NotWholeBytes { bits: data.len() });
    }
    let mut bytes: Vec<u8> = data.chunks_exact(8).map(byte).collect();
    if bytes.len() < SHORTEST_TELEGRAM_BYTES {
        return Err(LineError::TooShort { bytes: bytes.len(), expected: SHORTEST_TELEGRAM_BYTES });
    }
    let received = bytes.split_off(bytes.len() - CHECK_SEQUENCE_BYTES);
    let actual = u16::from_le_bytes([received[0], received[1]]);
    let expected = check_sequence(&bytes);
    if actual != expected {
        return Err(LineError::CheckSequence { expected, actual });
    }
    Ok(bytes)
}

/// What stands between the opening flag, already taken off, and the closing one.
fn content_before_flag(bits: &[bool]) -> Result<&[bool], LineError> {
    let mut ones = 0;
    for (index, &bit) in bits.iter().enumerate() {
        if bit {
            ones += 1;
            if ones == ONES_OF_ABORT {
                return Err(LineError::Aborted { bits: index + 1 - ONES_OF_ABORT as usize });
            }
        } else {
            if ones == ONES_OF_ABORT - 1 {
                // The flag's first zero stands before the six ones; it is missing only when the ones follow the
                // opening flag at once, and then the two flags share it.
                return Ok(&bits[..(index + 1).saturating_sub(FLAG.len())]);
            }
            ones = 0;
        }
    }
    Err(LineError::Unterminated { bits: bits.len() })
}

fn without_inserted_zeros(bits: &[bool]) -> Vec<bool> {
    let mut data = Vec::with_capacity(bits.len());
    let mut ones = 0;
    for &bit in bits {
        if ones == ONES_BEFORE_INSERTED_ZERO {
            // `content_before_flag` ends at a sixth one, so this bit is the inserted zero.
            ones = 0;
            continue;
        }
        data.push(bit);
        ones = if bit { ones + 1 } else { 0 };
    }
    data
}

fn byte(bits: &[bool]) -> u8 {
    bits.iter().enumerate().fold(0, |byte, (position, &bit)| byte | u8::from(bit) << position)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// sercon816.md 10.4: bytes, frame check sequence, line bits.
    const GOLDEN: [(&str, &str, &str); 10] = [
        ("FF 00", "87 F0", "0111111011111011100000000111000010000111101111110"),
        ("FF 01", "0E E1", "0111111011111011110000000011100001000011101111110"),
        ("FF 02", "95 D3", "0111111011111011101000000101010011100101101111110"),
        ("FF 03", "1C C2", "01111110111110111110000000001110000100001101111110"),
        ("FF 04", "A3 B6", "0111111011111011100100000110001010110110101111110"),
        ("01 01 00 00 00", "88 D8", "011111101000000010000000000000000000000000000000000100010001101101111110"),
        ("01 0F 00 03 00", "A2 5C", "011111101000000011110000000000001100000000000000010001010011101001111110"),
        ("01 18 00 03 00", "22 C8", "011111101000000000011000000000001100000000000000010001000001001101111110"),
        (
            "03 01 58 00 00 00 00 9F 11 00 00 03 00",
            "54 AB",
            "01111110110000001000000000011010000000000000000000000000000000001111100011000100000000000000000001100000000000000001010101101010101111110",
        ),
        (
            "04 01 58 00 00 00 00 00 EF 34 00 00 00",
            "E4 23",
            "01111110001000001000000000011010000000000000000000000000000000000000000011110111001011000000000000000000000000000010011111000010001111110",
        ),
    ];

    fn hex(text: &str) -> Vec<u8> {
        text.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("golden bytes are hex")).collect()
    }

    fn bits(text: &str) -> Vec<bool> {
        text.chars().map(|bit| bit == '1').collect()
    }

    #[test]
    fn golden_vectors_both_ways() {
        for (bytes, sequence, line) in GOLDEN {
            assert_eq!(check_sequence(&hex(bytes)).to_le_bytes().to_vec(), hex(sequence), "{bytes}");
            assert_eq!(encode(&hex(bytes)), bits(line), "{bytes}");
            assert_eq!(decode(&bits(line)), Ok(hex(bytes)), "{bytes}");
        }
    }

    #[test]
    fn every_single_bit_error_of_the_golden_telegrams_is_rejected() {
        for (bytes, _, line) in GOLDEN {
            let clean = bits(line);
            for position in 0..clean.len() {
                let mut wrong = clean.clone();
                wrong[position] ^= true;
                assert!(decode(&wrong).is_err(), "{bytes}: bit {position} flipped and still accepted");
            }
        }
    }

    #[test]
    fn errors_say_what_was_expected() {
        let mut wrong = bits(GOLDEN[5].2);
        wrong[30] ^= true;
        let error = decode(&wrong).expect_err("one bit is wrong");
        assert!(
            matches!(error, LineError::CheckSequence { actual: 0xD888, expected } if expected != 0xD888),
            "{error}"
        );
        assert_eq!(decode(&[false; 20]), Err(LineError::NoFlag { bits: 20 }));
        assert_eq!(decode(&bits("0111111000000000")), Err(LineError::Unterminated { bits: 8 }));
        assert_eq!(decode(&bits("0111111000011111110")), Err(LineError::Aborted { bits: 3 }));
        assert_eq!(decode(&bits("01111110000001111110")), Err(LineError::NotWholeBytes { bits: 4 }));
        assert_eq!(decode(&bits("011111100000000001111110")), Err(LineError::TooShort { bytes: 1, expected: 4 }));
    }

    #[test]
    fn the_last_of_several_flags_opens() {
        for flags in ["01111110", "011111101111110", "0111111001111110"] {
            let mut line = bits(flags);
            line.extend(&encode(&[7, 8, 9])[8..]);
            assert_eq!(decode(&line), Ok(vec![7, 8, 9]), "{flags}");
        }
    }

    proptest! {
        #[test]
        fn what_is_encoded_decodes_to_itself(bytes in prop::collection::vec(any::<u8>(), 2..80), lead in prop::collection::vec(Just(false), 0..9)) {
            let mut line = lead;
            line.extend(encode(&bytes));
            line.extend([true; 9]);
            prop_assert_eq!(decode(&line), Ok(bytes));
        }

        #[test]
        fn a_telegram_never_lasts_longer_than_the_standard_says(bytes in prop::collection::vec(any::<u8>(), 2..80)) {
            // sercos2.md 5.2: (16 + 9.6 n) bit times, n with the frame check sequence.
            let most = 16.0 + 9.6 * (bytes.len() + CHECK_SEQUENCE_BYTES) as f64;
            prop_assert!(encode(&bytes).len() as f64 <= most);
        }

        #[test]
        fn a_wrong_bit_is_noticed(bytes in prop::collection::vec(any::<u8>(), 2..20), at in any::<prop::sample::Index>()) {
            let mut line = encode(&bytes);
            let position = at.index(line.len());
            line[position] ^= true;
            prop_assert_ne!(decode(&line), Ok(bytes));
        }

        #[test]
        fn noise_never_panics(line in prop::collection::vec(any::<bool>(), 0..400)) {
            let _ = decode(&line);
        }
    }
}
