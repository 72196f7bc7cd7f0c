//! The password S-0-0267: who may change what S-0-0279 lists.

use heapless::String;
use sercos::error::ServiceError;

/// Shortest password.
pub const SHORTEST_PASSWORD: usize = 3;
/// Longest password.
pub const LONGEST_PASSWORD: usize = 10;

/// The lock on stored parameters. It protects against slips, not against malice: passwords cross the ring in plain text.
///
/// Unlocked, writing 3 to 10 characters locks with them, an empty text keeps it unlocked. Locked, the password unlocks, and everything
/// else is refused. It outlives the supply. The way back for a drive that is locked with an unknown one is for who stands before it: a start with no drive address on
/// its switches forgets the password.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Access {
    password: Option<String<LONGEST_PASSWORD>>,
}

impl Access {
    /// Whether the stored parameters are locked.
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.password.is_some()
    }

    /// What reading S-0-0267 shows.
    #[must_use]
    pub const fn shown(&self) -> &'static str {
        if self.is_locked() { "***" } else { "" }
    }

    /// As it is kept: the password, filled up with zeros; nothing but zeros is no lock.
    pub(crate) fn emit(&self) -> [u8; LONGEST_PASSWORD] {
        let text = self.password.as_ref().map_or(&[][..], |password| password.as_bytes());
        let mut bytes = [0; LONGEST_PASSWORD];
        for (place, byte) in bytes.iter_mut().zip(text) {
            *place = *byte;
        }
        bytes
    }

    /// From [`Access::emit`]. What can be no password is no lock.
    pub(crate) fn parse(bytes: &[u8; LONGEST_PASSWORD]) -> Self {
        let text = bytes.split(|byte| *byte == 0).next().unwrap_or(&[]);
        let mut access = Self::default();
        // Refused where it is none.
        let _ = access.write(text);
        access
    }

    /// Takes a text written to S-0-0267. Zeros behind it do not count: a control may fill a text up with them.
    ///
    /// # Errors
    /// [`ServiceError::TooLong`], [`ServiceError::InvalidData`] for one that is too short, no text, has a zero within, or is not the password. Nothing has
    /// changed then.
    pub fn write(&mut self, text: &[u8]) -> Result<(), ServiceError> {
        let end = text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last.saturating_add(1));
        let text = text.get(..end).unwrap_or(text);
        if text.contains(&0) {
            return Err(ServiceError::InvalidData);
        }
        let text = core::str::from_utf8(text).map_err(|_| ServiceError::InvalidData)?;
        match &self.password {
            Some(password) if password.as_str() == text => self.password = None,
            Some(_) => return Err(ServiceError::InvalidData),
            None if text.is_empty() => {}
            None if text.len() < SHORTEST_PASSWORD => return Err(ServiceError::InvalidData),
            None => {
                let password =
                    String::try_from(text).map_err(|_| ServiceError::TooLong(sercos::error::Element::Data))?;
                self.password = Some(password);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_locks_and_only_the_same_one_unlocks() {
        let mut access = Access::default();
        access.write(b"").unwrap();
        assert!(!access.is_locked());
        access.write(b"press").unwrap();
        assert_eq!((access.is_locked(), access.shown()), (true, "***"));
        for wrong in [b"".as_slice(), b"Press", b"pres", b"press ", b"another"] {
            assert_eq!(access.write(wrong), Err(ServiceError::InvalidData));
            assert!(access.is_locked());
        }
        access.write(b"press").unwrap();
        assert_eq!((access.is_locked(), access.shown()), (false, ""));
    }

    #[test]
    fn a_lock_is_kept_with_its_password_and_no_lock_is_zeros() {
        for text in ["", "abc", "0123456789"] {
            let mut access = Access::default();
            access.write(text.as_bytes()).unwrap();
            assert_eq!(Access::parse(&access.emit()), access, "{text}");
            assert_eq!(access.emit() == [0; LONGEST_PASSWORD], text.is_empty());
        }
        assert!(!Access::parse(&[0xFF; LONGEST_PASSWORD]).is_locked());
    }

    #[test]
    fn zeros_behind_a_password_do_not_count_and_zeros_within_one_are_refused() {
        for (text, taken) in [
            (b"abc\0\0\0\0\0\0\0".as_slice(), true),
            (b"abc\0\0\0\0\0\0\0\0\0\0", true),
            (b"ab\0\0", false),
            (b"abc\0d", false),
            (b"\0abc", false),
        ] {
            let mut access = Access::default();
            assert_eq!(access.write(text), if taken { Ok(()) } else { Err(ServiceError::InvalidData) }, "{text:?}");
            assert_eq!(access.is_locked(), taken);
            let mut behind_the_supply = Access::parse(&access.emit());
            assert_eq!(behind_the_supply, access, "{text:?}");
            if taken {
                for wrong in [b"abc\0d".as_slice(), b"\0\0"] {
                    assert_eq!(behind_the_supply.write(wrong), Err(ServiceError::InvalidData));
                }
                behind_the_supply.write(b"abc\0").unwrap();
                access.write(b"abc").unwrap();
                assert!(!behind_the_supply.is_locked() && !access.is_locked());
            }
        }
        let mut access = Access::default();
        access.write(&[0; LONGEST_PASSWORD]).unwrap();
        assert!(!access.is_locked(), "no text at all");
    }

    #[test]
    fn a_text_that_can_be_no_password_is_refused_and_locks_nothing() {
        let mut access = Access::default();
        assert_eq!(access.write(b"ab"), Err(ServiceError::InvalidData));
        assert_eq!(access.write(b"elevenchars").unwrap_err().code(), 0x7003);
        assert_eq!(access.write(&[0xFF, 0xFE, 0xFD]), Err(ServiceError::InvalidData));
        assert!(!access.is_locked());
        access.write(b"tencharact").unwrap();
        assert!(access.is_locked());
    }
}
