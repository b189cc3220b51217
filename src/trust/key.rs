//! Keys: the text that a client holds, its id and its secret, and the hash by which the catalog knows the secret.

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use ring::rand::{SecureRandom, SystemRandom};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt::{self, Write};
use std::str::FromStr;

/// First characters of every access key; scanners find leaked keys by them.
pub(super) const PREFIX: &str = "wlm_";

/// Number of characters in the public id of an access key, 5 random bits each: 50 bits in all. Ids name keys and are
/// not secret.
const ID: usize = 10;

/// Number of random bytes in the secret of a key: 256 bits, too many to guess, so that a fast hash of them is safe to
/// store.
const SECRET: usize = 32;

/// Number of characters in the secret of a key, written in base64url without padding.
const SECRET_TEXT: usize = 43;

/// Number of base-62 characters in the checksum of a key: 62⁶ exceeds 2³², the number of CRC-32 values.
const CHECKSUM: usize = 6;

/// Number of characters in the text of an access key.
const LENGTH: usize = PREFIX.len() + ID + 1 + SECRET_TEXT + 1 + CHECKSUM;

/// Base-32 digits of the id of a key: no `i`, `l`, `o` or `u`, which are misread.
const BASE32: &[u8; 32] = b"0123456789abcdefghjkmnpqrstvwxyz";

/// Base-62 digits of the checksum of a key.
const BASE62: &[u8; 62] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";

/// Context string with which BLAKE3 hashes the secret of a key for the catalog. Changing it makes all stored keys
/// invalid.
const HASHED: &str = "wavelume key hash 2026-11";

/// Access key of a client: `wlm_`, the id, the secret and a checksum of the characters before, with underscores
/// between. The text is given out once, by [`Key::reveal`]; no other method shows the secret.
pub(crate) struct Key {
    id: KeyId,
    secret: Secret,
}

/// Public name of a key: 10 digits and lower-case letters.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct KeyId([u8; ID]);

/// Secret of an access key. Cannot be converted to text, and its `Debug` shows nothing.
pub(crate) struct Secret([u8; SECRET]);

/// Hash of the secret of an access key, as the catalog stores it. Comparison takes the same time wherever two hashes
/// differ.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct SecretHash(blake3::Hash);

/// Error for a text that is not an access key. The messages never contain the text, which may be a secret.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum KeyError {
    /// The text does not begin like an access key.
    #[error("found a text that is not a key, expected 65 characters that begin with `wlm_`")]
    Shape,
    /// The text begins like an access key, but a character is missing, wrong or exchanged.
    #[error("found a mistyped or cut key (its checksum does not match), expected all 65 characters unchanged")]
    Mistyped,
}

/// Error for a text that is not the id of an access key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no id of a key, expected 10 characters of 0–9 and a–z without i, l, o and u")]
pub(crate) struct NotAKeyId(String);

/// Failure of the operating system to give random bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the operating system gives no random bytes, so that no key can be made")]
pub(crate) struct NoRandomness;

impl Key {
    /// Makes a new random key.
    pub(crate) fn generate() -> Result<Self, NoRandomness> {
        let (mut id, mut secret) = ([0; ID], [0; SECRET]);
        let random = SystemRandom::new();
        random.fill(&mut id).and_then(|()| random.fill(&mut secret)).map_err(|_| NoRandomness)?;
        // A byte has 8 times as many values as a digit: all digits are equally likely.
        let id = id.map(|byte| BASE32[usize::from(byte) % BASE32.len()]);
        Ok(Self { id: KeyId(id), secret: Secret(secret) })
    }

    /// Public name of the key.
    pub(crate) fn id(&self) -> KeyId {
        self.id
    }

    /// Returns the secret of the access key.
    pub(crate) fn secret(&self) -> &Secret {
        &self.secret
    }

    /// Returns the text of the key, secret included, for the one time that a client is shown it.
    pub(crate) fn reveal(&self) -> String {
        let body = format!("{PREFIX}{}_{}", self.id, URL_SAFE_NO_PAD.encode(self.secret.0));
        let checksum = checksum(&body);
        format!("{body}_{checksum}")
    }
}

impl FromStr for Key {
    type Err = KeyError;

    /// Parses the text of a key. Each key has one text: every other spelling is refused.
    fn from_str(text: &str) -> Result<Self, KeyError> {
        if !text.starts_with(PREFIX) {
            return Err(KeyError::Shape);
        }
        if text.len() != LENGTH || !text.is_ascii() {
            return Err(KeyError::Mistyped);
        }
        let (body, end) = text.split_at(LENGTH - CHECKSUM - 1);
        if end.strip_prefix('_') != Some(checksum(body).as_str()) {
            return Err(KeyError::Mistyped);
        }
        let (id, secret) = body[PREFIX.len()..].split_at(ID);
        let secret = secret.strip_prefix('_').ok_or(KeyError::Mistyped)?;
        let mut bytes = [0; SECRET];
        match URL_SAFE_NO_PAD.decode_slice(secret, &mut bytes) {
            Ok(SECRET) => {}
            _ => return Err(KeyError::Mistyped),
        }
        Ok(Self { id: id.parse().map_err(|_| KeyError::Mistyped)?, secret: Secret(bytes) })
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Key({})", self.id)
    }
}

impl Secret {
    /// Returns the hash of the secret that the catalog stores.
    pub(crate) fn hash(&self) -> SecretHash {
        SecretHash(blake3::Hash::from_bytes(self.derive(HASHED)))
    }

    /// Derives 256 bits for one purpose from the secret of a key. Neither the secret nor the bits of another purpose
    /// follow from them.
    pub(super) fn derive(&self, context: &'static str) -> [u8; 32] {
        blake3::derive_key(context, &self.0)
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

impl fmt::Display for SecretHash {
    /// Writes the hash of a secret as 64 hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.to_hex())
    }
}

impl fmt::Debug for SecretHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SecretHash(…)")
    }
}

impl FromStr for SecretHash {
    type Err = blake3::HexError;

    fn from_str(text: &str) -> Result<Self, blake3::HexError> {
        blake3::Hash::from_hex(text).map(Self)
    }
}

impl fmt::Display for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| f.write_char(char::from(*byte)))
    }
}

impl fmt::Debug for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for KeyId {
    type Err = NotAKeyId;

    fn from_str(text: &str) -> Result<Self, NotAKeyId> {
        let bytes = <[u8; ID]>::try_from(text.as_bytes()).ok();
        let id = bytes.filter(|bytes| bytes.iter().all(|byte| BASE32.contains(byte)));
        // The text that is echoed to the user is bounded.
        id.map(Self).ok_or_else(|| NotAKeyId(text.chars().take(20).collect()))
    }
}

impl Serialize for KeyId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for KeyId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

/// Returns the CRC-32 of `body` in base 62, most significant digit first. It finds every wrong character and every
/// exchange of two neighbours, and finds mistakes only: whoever has a secret can compute it.
fn checksum(body: &str) -> String {
    let mut crc = flate2::Crc::new();
    crc.update(body.as_bytes());
    let mut rest = crc.sum() as usize;
    let mut digits = ['0'; CHECKSUM];
    for digit in digits.iter_mut().rev() {
        *digit = char::from(BASE62[rest % BASE62.len()]);
        rest /= BASE62.len();
    }
    digits.iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Access key of fixed bytes, for tests. The text of its secret has letters of both cases, digits, `-` and `_`.
    fn fixed() -> Key {
        let secret = std::array::from_fn(|i| (i as u8).wrapping_mul(83).wrapping_add(0xfb));
        Key { id: "0123456xyz".parse().unwrap(), secret: Secret(secret) }
    }

    #[test]
    fn text_round_trips() {
        let made: Vec<Key> = (0..100).map(|_| Key::generate().unwrap()).chain([fixed()]).collect();
        for key in &made {
            let text = key.reveal();
            assert_eq!(text.len(), 65);
            let read: Key = text.parse().unwrap();
            assert_eq!((read.id(), read.secret.0, read.reveal()), (key.id(), key.secret.0, text));
        }
        let ids: BTreeSet<KeyId> = made.iter().map(Key::id).collect();
        assert_eq!(ids.len(), made.len());
    }

    #[test]
    fn the_text_of_a_key_never_changes() {
        assert_eq!(fixed().reveal(), "wlm_0123456xyz_-06h9Eea7UCT5jmM3zKF2Ct-0SR3yh1wwxZpvA9itQg_30ofMo");
        assert_eq!(
            fixed().secret.hash().to_string(),
            "ddc49d69f43f51fc4d54c5056236484347056e177f3e9848fea6ce6224a151bb"
        );
    }

    #[test]
    fn every_wrong_character_is_found() {
        for text in [fixed().reveal(), Key::generate().unwrap().reveal()] {
            for place in 0..LENGTH {
                for other in (0..=0x7f_u8).filter(|other| *other != text.as_bytes()[place]) {
                    let mut bytes = text.clone().into_bytes();
                    bytes[place] = other;
                    let expected = if place < PREFIX.len() { KeyError::Shape } else { KeyError::Mistyped };
                    assert_eq!(String::from_utf8(bytes).unwrap().parse::<Key>().unwrap_err(), expected, "{place}");
                }
            }
        }
    }

    #[test]
    fn every_exchange_of_neighbours_is_found() {
        for text in (0..50).map(|_| Key::generate().unwrap().reveal()) {
            for place in 1..LENGTH {
                let mut bytes = text.clone().into_bytes();
                bytes.swap(place - 1, place);
                let swapped = String::from_utf8(bytes).unwrap();
                assert!(swapped == text || swapped.parse::<Key>().is_err(), "{place}");
            }
        }
    }

    #[test]
    fn every_missing_and_every_added_character_is_found() {
        let text = fixed().reveal();
        for place in 0..=LENGTH {
            assert!(place == LENGTH || text[..place].parse::<Key>().is_err());
            for added in ["0", "_", "a", " ", "\n", "é"] {
                let (before, after) = text.split_at(place);
                assert!(format!("{before}{added}{after}").parse::<Key>().is_err(), "{place}");
                // A character of two bytes in the place of two others.
                if let Some(rest) = after.get(added.len()..) {
                    let replaced = format!("{before}{added}{rest}");
                    assert!(replaced == text || replaced.parse::<Key>().is_err(), "{place}");
                }
            }
        }
    }

    #[test]
    fn a_right_checksum_does_not_make_another_text_a_key() {
        let text = fixed().reveal();
        let body = &text[..LENGTH - CHECKSUM - 1];
        // The last digit of a secret carries four bits; a digit with more bits is a second spelling.
        let most = &body[..body.len() - 1];
        let second = BASE62.iter().map(|digit| format!("{most}{}", char::from(*digit)));
        let accepted = second.filter(|body| format!("{body}_{}", checksum(body)).parse::<Key>().is_ok());
        assert_eq!(accepted.count(), 16);
        for wrong in
            [body.replace("0123456xyz_", "0123456xyl_"), body.replace("xyz_", "xyz-"), body.replacen('x', "X", 1)]
        {
            let error = format!("{wrong}_{}", checksum(&wrong)).parse::<Key>().unwrap_err();
            assert_eq!(error, KeyError::Mistyped, "{wrong}");
        }
    }

    #[test]
    fn untrusted_text_of_any_length_is_refused_without_reading_it() {
        for text in ["", "wlm", "wlt_x", "Bearer", &"x".repeat(1 << 24)] {
            assert_eq!(text.parse::<Key>().unwrap_err(), KeyError::Shape);
        }
        for text in ["wlm_".to_owned(), format!("wlm_{}", "a".repeat(1 << 24)), format!("wlm_{}é", "a".repeat(59))] {
            assert_eq!(text.parse::<Key>().unwrap_err(), KeyError::Mistyped);
        }
        for text in ["", "0123456xy", "0123456xyz0", "0123456xyl", "0123456XYZ", "0123456xé", &"0".repeat(1 << 24)] {
            let error = text.parse::<KeyId>().unwrap_err().to_string();
            assert!(error.starts_with('`') && error.len() < 150, "{error}");
        }
    }

    #[test]
    fn nothing_but_reveal_shows_the_secret() {
        let key = fixed();
        let text = key.reveal();
        let secret = &text[PREFIX.len() + ID + 1..LENGTH - CHECKSUM - 1];
        let hex = blake3::Hash::from_bytes(key.secret.0).to_hex();
        let list = format!("{:?}", key.secret.0);
        let cut = text[..LENGTH - 1].parse::<Key>().unwrap_err();
        let shown = format!("{key:?} {key:#?} {:?} {:?} {cut} {cut:?}", key.secret, key.secret.hash());
        for spelling in [secret, &secret[..8], hex.as_str(), &list[1..8]] {
            assert!(!shown.contains(spelling), "{shown}");
        }
        assert!(shown.contains("0123456xyz"), "{shown}");
    }

    #[test]
    fn the_stored_hash_knows_its_secret_alone() {
        let (one, other) = (fixed(), Key::generate().unwrap());
        let stored: SecretHash = one.secret.hash().to_string().parse().unwrap();
        assert!(one.secret.hash() == stored && other.secret.hash() != stored);
        for bit in 0..8 * SECRET {
            let mut near = one.secret.0;
            near[bit / 8] ^= 1 << (bit % 8);
            assert!(Secret(near).hash() != stored, "{bit}");
        }
        assert_ne!(stored.to_string(), blake3::hash(&one.secret.0).to_hex().to_string());
    }
}
