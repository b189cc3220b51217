//! Keys, tokens and links from arbitrary bytes, checked at several times with the facts of one key.

use crate::trust::{Key, KeyFacts, KeyId, Link, Methods, Refused, Scopes, SecretHash, Signer, Token, Verifier};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use std::fmt::{Debug, Display};
use std::str::FromStr;

/// Key that made the tokens and links of the corpus.
const KEY: &str = "wlm_0123456xyz_-06h9Eea7UCT5jmM3zKF2Ct-0SR3yh1wwxZpvA9itQg_30ofMo";
/// Time in Unix seconds at which they hold.
const NOW: u64 = 1_795_651_200;
/// Path of the links in the corpus.
const PATH: &str = "/v1/materials/b3-0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef/content";

/// Reads `bytes` as every kind of credential: whole, as the claims of a token, and as the query of a link. Checks that
/// what is read has this text alone, and that nothing shows a secret.
pub fn read_credentials(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    match text.parse::<Key>() {
        Ok(key) => {
            assert_eq!(key.reveal(), text);
            assert!(!format!("{key:?} {:?}", key.secret()).contains(&text[15..58]));
        }
        Err(error) => assert!(error.to_string().len() < 150),
    }
    round_trips::<KeyId>(&text, true);
    round_trips::<Scopes>(&text, false);
    round_trips::<Methods>(&text, false);
    round_trips::<SecretHash>(&text, false);
    round_trips::<Verifier>(&text, false);

    let key: Key = KEY.parse().expect("the key is right");
    let signer = Signer::of(&key).expect("a pair is made of every key");
    let verifier = signer.verifier().expect("a pair has a public half");
    let facts = KeyFacts { scopes: Scopes::all(), verifier, expires: None, is_revoked: false };
    let wrapped = format!("wlt_{}.{}", URL_SAFE_NO_PAD.encode(bytes), "A".repeat(86));
    for now in [0, NOW, u64::MAX] {
        for token in [&*text, &wrapped] {
            if let Ok(token) = Token::read(token, now) {
                check(token.verify(&facts, now).map(|grant| (grant.key, grant.expires)), token.key(), now);
            }
        }
        let (path, query) = text.split_once('?').unwrap_or((PATH, &text));
        if let Ok(link) = Link::read(path, query, now) {
            assert_eq!(link.target(), format!("{path}?{query}"));
            check(link.verify(&facts, now).map(|grant| (grant.key, grant.expires)), link.key(), now);
        }
    }
}

fn check(verified: Result<(KeyId, u64), Refused>, key: KeyId, now: u64) {
    match verified {
        Ok((id, expires)) => assert!(id == key && expires.saturating_add(30) > now),
        Err(refused) => assert_eq!(refused, Refused::Forged),
    }
}

fn round_trips<T: FromStr<Err: Display> + Display + PartialEq + Debug>(text: &str, has_one_text: bool) {
    match text.parse::<T>() {
        Ok(value) => {
            let again = value.to_string();
            assert!(again.parse::<T>().is_ok_and(|other| other == value));
            assert!(!has_one_text || again == text);
        }
        Err(error) => assert!(error.to_string().len() < 400, "{error}"),
    }
}
