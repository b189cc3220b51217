//! Permissions of the directories and files that the program makes in data directories, stores and backups.

use rustix::fs::Mode;
use rustix::process::umask;
use std::fmt;
use std::str::FromStr;

/// Permissions that a process takes from the directories and files that it makes, as three octal digits: those of the
/// owner, of the group and of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Umask(u32);

impl Umask {
    /// Takes these permissions from all that this process, and those that it starts, make from now on.
    pub(crate) fn set(self) {
        umask(Mode::from_raw_mode(self.0));
    }

    /// Returns the permissions as the bits of a mode.
    pub(crate) fn bits(self) -> u32 {
        self.0
    }
}

impl FromStr for Umask {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_octal = (1..=4).contains(&text.len()) && text.bytes().all(|digit| digit.is_ascii_digit());
        let bits = u32::from_str_radix(text, 8).ok().filter(|bits| is_octal && *bits <= 0o077);
        bits.map(Self).ok_or_else(|| "expected octal permissions from 000 to 077, such as 077 or 027".to_owned())
    }
}

impl fmt::Display for Umask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:03o}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permissions_of_the_owner_are_never_taken() {
        for (text, bits) in [("077", 0o077), ("0027", 0o027), ("22", 0o022), ("0", 0)] {
            assert_eq!(text.parse(), Ok(Umask(bits)), "{text}");
        }
        for text in ["", "700", "0100", "078", "-7", "+7", "00077", "private"] {
            assert!(text.parse::<Umask>().is_err(), "{text}");
        }
        assert_eq!(Umask(0o027).to_string(), "027");
    }
}
