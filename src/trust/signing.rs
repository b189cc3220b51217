//! Signatures by an Ed25519 key pair that is derived from the secret of an access key. The public half verifies and
//! cannot sign.

use super::key::Key;
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use ring::signature::{ED25519, Ed25519KeyPair, UnparsedPublicKey};
use std::fmt;
use std::str::FromStr;

/// Context string with which BLAKE3 derives the seed of an Ed25519 key pair from a secret. Changing it makes all tokens
/// and links invalid.
const SEED: &str = "wavelume link signing 2026-11";

/// Number of bytes in an Ed25519 signature.
const SIGNATURE: usize = 64;

/// Ed25519 key pair with which the holder of an access key signs tokens and links.
pub(crate) struct Signer(Ed25519KeyPair);

/// Public half of an Ed25519 key pair, for the catalog: written as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Verifier([u8; 32]);

/// Ed25519 signature of a text: written in 86 characters of base64url.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Signature([u8; SIGNATURE]);

/// Refusal of the cryptographic library to make an Ed25519 key pair; it accepts every seed of 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the cryptographic library refuses to make a pair for signatures from this key")]
pub(crate) struct NoSigner;

/// Error for a text that is not the public half of an Ed25519 key pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found a text that is not the public half of an Ed25519 key pair, expected 64 hexadecimal digits")]
pub(crate) struct NotAVerifier;

impl Signer {
    /// Derives the Ed25519 key pair of the access key `key`. An access key has the same pair on every machine.
    pub(crate) fn of(key: &Key) -> Result<Self, NoSigner> {
        Ed25519KeyPair::from_seed_unchecked(&key.secret().derive(SEED)).map(Self).map_err(|_| NoSigner)
    }

    /// Returns the public half of the key pair, from which the private half does not follow.
    pub(crate) fn verifier(&self) -> Result<Verifier, NoSigner> {
        use ring::signature::KeyPair;
        self.0.public_key().as_ref().try_into().map(Verifier).map_err(|_| NoSigner)
    }

    /// Signs `text`. The same text has the same signature each time.
    pub(super) fn sign(&self, text: &str) -> Result<Signature, NoSigner> {
        self.0.sign(text.as_bytes()).as_ref().try_into().map(Signature).map_err(|_| NoSigner)
    }
}

impl Verifier {
    /// Returns true if `signature` was made for `text` with the private half of the key pair. Everything compared is
    /// public, so the time that it takes tells nothing.
    pub(super) fn verifies(&self, text: &str, signature: &Signature) -> bool {
        UnparsedPublicKey::new(&ED25519, self.0).verify(text.as_bytes(), &signature.0).is_ok()
    }
}

impl Signature {
    /// Number of base64url characters in a signature, without padding.
    pub(super) const TEXT: usize = (SIGNATURE * 4).div_ceil(3);

    /// Parses a signature from base64url. Each signature has one text: padding and stray bits in the last character are
    /// refused.
    pub(super) fn read(text: &str) -> Option<Self> {
        let mut bytes = [0; SIGNATURE];
        let is_whole = text.len() == Self::TEXT && URL_SAFE_NO_PAD.decode_slice(text, &mut bytes) == Ok(SIGNATURE);
        is_whole.then_some(Self(bytes))
    }
}

impl fmt::Debug for Signer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Signer(…)")
    }
}

impl fmt::Display for Verifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Verifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Verifier({self})")
    }
}

impl FromStr for Verifier {
    type Err = NotAVerifier;

    fn from_str(text: &str) -> Result<Self, NotAVerifier> {
        blake3::Hash::from_hex(text).map(|digits| Self(*digits.as_bytes())).map_err(|_| NotAVerifier)
    }
}

impl fmt::Display for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&URL_SAFE_NO_PAD.encode(self.0))
    }
}

impl fmt::Debug for Signature {
    /// Writes a placeholder without any part of the signature: whoever has the signature of a link has the link.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Signature(…)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_public_half_verifies_the_text_of_its_key_alone() {
        let (one, other) = (Key::generate().unwrap(), Key::generate().unwrap());
        let (signer, stranger) = (Signer::of(&one).unwrap(), Signer::of(&other).unwrap());
        // Derived again from the text of the key, as on another machine.
        let again = Signer::of(&one.reveal().parse().unwrap()).unwrap();
        let verifier: Verifier = signer.verifier().unwrap().to_string().parse().unwrap();
        assert_eq!(again.verifier().unwrap(), verifier);
        let signature = again.sign("a text").unwrap();
        assert!(verifier.verifies("a text", &signature));
        for wrong in ["", "a text ", "a texs", "A text"] {
            assert!(!verifier.verifies(wrong, &signature), "{wrong}");
        }
        assert!(!stranger.verifier().unwrap().verifies("a text", &signature));
        assert!(!verifier.verifies("a text", &stranger.sign("a text").unwrap()));
        for bit in 0..8 * SIGNATURE {
            let mut near = signature;
            near.0[bit / 8] ^= 1 << (bit % 8);
            assert!(!verifier.verifies("a text", &near), "{bit}");
        }
    }

    #[test]
    fn the_pair_of_a_key_never_changes() {
        // Computed by the `blake3` and `cryptography` packages of Python.
        let verifier = Signer::of(&super::super::grant::fixed::key()).unwrap().verifier().unwrap();
        assert_eq!(verifier.to_string(), "85b1af8c5aeda2570cff17204924fe29ac7b31018bb492e8c948a2667be26883");
    }

    #[test]
    fn what_the_catalog_holds_neither_signs_nor_tells_the_secret() {
        let key = Key::generate().unwrap();
        let verifier = Signer::of(&key).unwrap().verifier().unwrap();
        let seed = key.secret().derive(SEED);
        assert_ne!(verifier.0, seed);
        assert_ne!(verifier.to_string(), key.secret().hash().to_string());
        // A pair from what is stored is another pair.
        for stored in [verifier.0, *blake3::Hash::from_hex(key.secret().hash().to_string()).unwrap().as_bytes()] {
            let forged = Signer(Ed25519KeyPair::from_seed_unchecked(&stored).unwrap());
            assert!(!verifier.verifies("a text", &forged.sign("a text").unwrap()));
        }
    }

    #[test]
    fn a_signature_has_one_text() {
        let signature = Signer::of(&Key::generate().unwrap()).unwrap().sign("a text").unwrap();
        let text = signature.to_string();
        assert_eq!((text.len(), Signature::read(&text)), (Signature::TEXT, Some(signature)));
        let most = &text[..text.len() - 1];
        let accepted = (0..=0x7f_u8).filter(|last| Signature::read(&format!("{most}{}", char::from(*last))).is_some());
        // The last character carries two bits.
        assert_eq!(accepted.count(), 4);
        for wrong in [most, &format!("{text}="), &format!("{text}A"), &format!("{}é", &most[1..]), &"A".repeat(1 << 24)]
        {
            assert_eq!(Signature::read(wrong), None);
        }
        assert!(!format!("{signature:?}").contains(&text[..8]));
    }

    #[test]
    fn other_texts_are_no_public_half() {
        for wrong in ["", "é", &"0".repeat(63), &"0".repeat(65), &"g".repeat(64), &"0".repeat(1 << 24)] {
            assert_eq!(wrong.parse::<Verifier>(), Err(NotAVerifier));
        }
        // Bytes that are no point of the curve verify nothing.
        let signature = Signer::of(&Key::generate().unwrap()).unwrap().sign("a text").unwrap();
        for digit in ["0", "f", "7"] {
            assert!(!digit.repeat(64).parse::<Verifier>().unwrap().verifies("a text", &signature));
        }
    }
}
