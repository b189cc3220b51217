//! Tokens: `wlt_`, claims, a dot and a signature. Made offline from an access key, and sent as `Authorization: Bearer
//! wlt_…`.

use super::grant::{Grant, KeyFacts, Methods, NotMade, Reach, Refused, check_end, end, token_scopes};
use super::key::{Key, KeyId};
use super::scope::Scopes;
use super::signing::{Signature, Signer};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use serde::Deserialize;

/// First characters of every token; scanners find leaked tokens by them.
pub(super) const PREFIX: &str = "wlt_";

/// Upper bound in characters on a token, checked before it is parsed. No valid token has more than 362.
const LONGEST_TEXT: usize = 512;

/// First line of the text that is signed for a token. The text signed for a link begins with another line, so that
/// neither can be presented as the other.
const FIRST_LINE: &str = "wavelume token 1";

/// Version of the format of the claims in a token.
const VERSION: u8 = 1;

/// Token that has not expired, but whose signature is not verified yet. It grants nothing before [`Token::verify`].
///
/// The claims do not state the tenant. They state the key, a key belongs to one tenant for as long as it exists, and
/// the signature is of that key: so the token is for the tenant in the row of its key, and the holder of a key can make
/// tokens without knowing the name of its tenant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Token {
    grant: Grant,
    signature: Signature,
}

/// Claims of a token, which are JSON without white space or escapes: the version, then the fields in this order.
#[derive(Deserialize)]
struct Claims<'a> {
    key: &'a str,
    scopes: &'a str,
    methods: &'a str,
    material: &'a str,
    expires: u64,
}

impl Token {
    /// Makes the text of a token at `now` (Unix seconds) that holds for `seconds`.
    pub(crate) fn make(
        key: &Key,
        scopes: Scopes,
        methods: Methods,
        reach: Reach,
        now: u64,
        seconds: u64,
    ) -> Result<String, NotMade> {
        if scopes.is_empty() || !scopes.is_within(token_scopes()) {
            return Err(NotMade::Scopes(scopes));
        }
        if methods.is_empty() {
            return Err(NotMade::Methods);
        }
        let claims = encoded(&Grant { key: key.id(), scopes, methods, reach, expires: end(now, seconds)? });
        let signature = Signer::of(key)?.sign(&signed(&claims))?;
        Ok(format!("{PREFIX}{claims}.{signature}"))
    }

    /// Returns true if `text` begins like a token.
    pub(crate) fn is_like(text: &str) -> bool {
        text.starts_with(PREFIX)
    }

    /// Parses a token from a request that may come from anybody, and checks at `now` that it has not expired. Each
    /// token has one text.
    pub(crate) fn read(text: &str, now: u64) -> Result<Self, Refused> {
        let token = Self::parse(text).ok_or(Refused::NotAToken)?;
        check_end(token.grant.expires, now)?;
        Ok(token)
    }

    /// Id of the access key that the token names.
    pub(crate) fn key(&self) -> KeyId {
        self.grant.key
    }

    /// Verifies the signature and rights of the token at `now` with the stored facts of the key that it names.
    pub(crate) fn verify(&self, facts: &KeyFacts, now: u64) -> Result<Grant, Refused> {
        facts.check(&signed(&encoded(&self.grant)), &self.signature, self.grant, now)
    }

    fn parse(text: &str) -> Option<Self> {
        if text.len() > LONGEST_TEXT {
            return None;
        }
        let (claims, signature) = text.strip_prefix(PREFIX)?.split_once('.')?;
        let json = URL_SAFE_NO_PAD.decode(claims).ok()?;
        let read: Claims<'_> = serde_json::from_slice(&json).ok()?;
        let (key, reach) = (read.key.parse().ok()?, Reach::read(read.material)?);
        let (scopes, methods) = (read.scopes.parse::<Scopes>().ok()?, read.methods.parse().ok()?);
        let grant = Grant { key, scopes, methods, reach, expires: read.expires };
        let token = Self { grant, signature: Signature::read(signature)? };
        // The text is compared whole: another version, or another spelling of the same claims, is no token.
        (scopes.is_within(token_scopes()) && encoded(&grant) == claims).then_some(token)
    }
}

/// Returns the claims of a token as JSON in base64url.
fn encoded(grant: &Grant) -> String {
    let Grant { key, scopes, methods, reach, expires } = grant;
    // None of the texts has a character that JSON would escape.
    URL_SAFE_NO_PAD.encode(format!(
        r#"{{"v":{VERSION},"key":"{key}","scopes":"{scopes}","methods":"{methods}","material":"{reach}","expires":{expires}}}"#
    ))
}

/// Returns the text that is signed for a token with these claims in base64url.
fn signed(claims: &str) -> String {
    format!("{FIRST_LINE}\n{claims}\n")
}

#[cfg(test)]
mod tests {
    use super::super::grant::{LONGEST, MaterialId, SKEW, fixed};
    use super::super::scope::Scope;
    use super::super::set::Member;
    use super::*;
    use proptest::prelude::*;

    const DAY: u64 = 24 * 60 * 60;

    /// Token that `fixed::key()` makes at `fixed::NOW` for one day, computed by other programs: the `blake3` and
    /// `cryptography` packages of Python.
    const TOKEN: &str = concat!(
        "wlt_eyJ2IjoxLCJrZXkiOiIwMTIzNDU2eHl6Iiwic2NvcGVzIjoicmVhZCIsIm1ldGhvZHMiOiJHRVQiLCJtYXRlcmlhbCI6",
        "ImIzLTAxMjM0NTY3ODlhYmNkZWYwMTIzNDU2Nzg5YWJjZGVmMDEyMzQ1Njc4OWFiY2RlZjAxMjM0NTY3ODlhYmNkZWYiLCJl",
        "eHBpcmVzIjoxNzk1NzM3NjAwfQ.L5xDyFgWtHyNtIhpPFGpiIddTeePUW3_O_U_CC37MCS0Ep1Mqc2_QnhIsbssqmHNypoH7",
        "nQU3mYB6TBFBskRAw",
    );

    fn one() -> Reach {
        Reach::One(fixed::material())
    }

    fn made(scopes: &str, methods: &str, reach: Reach) -> String {
        let (scopes, methods) = (scopes.parse().unwrap(), methods.parse().unwrap());
        Token::make(&fixed::key(), scopes, methods, reach, fixed::NOW, DAY).unwrap()
    }

    fn checked(text: &str, facts: &KeyFacts, now: u64) -> Result<Grant, Refused> {
        Token::read(text, now)?.verify(facts, now)
    }

    #[test]
    fn a_token_never_changes_and_grants_what_it_was_made_for() {
        let text = made("read", "GET", one());
        assert_eq!(text, TOKEN);
        let grant = checked(&text, &fixed::facts(), fixed::NOW).unwrap();
        assert_eq!(grant.key, fixed::key().id());
        assert_eq!((grant.scopes.to_string(), grant.methods.to_string()), ("read".to_owned(), "GET".to_owned()));
        assert_eq!((grant.reach, grant.expires), (one(), fixed::NOW + DAY));
        for reach in [Reach::All, one()] {
            for (scopes, methods) in
                [("read", "POST"), ("write,jobs", "PUT,PATCH,DELETE"), ("read,write,jobs", "GET,POST")]
            {
                let text = made(scopes, methods, reach);
                assert!(Token::is_like(&text) && text.len() <= 362, "{text}");
                let grant = checked(&text, &fixed::facts(), fixed::NOW).unwrap();
                assert_eq!(
                    (grant.scopes.to_string(), grant.methods.to_string()),
                    (scopes.to_owned(), methods.to_owned())
                );
            }
        }
    }

    #[test]
    fn every_changed_character_is_refused() {
        let text = made("read,jobs", "GET,POST", one());
        let facts = fixed::facts();
        for place in 0..text.len() {
            for other in (0..=0x7f_u8).filter(|other| *other != text.as_bytes()[place]) {
                let mut bytes = text.clone().into_bytes();
                bytes[place] = other;
                let changed = String::from_utf8(bytes).unwrap();
                assert!(checked(&changed, &facts, fixed::NOW).is_err(), "{place}: {changed}");
            }
            assert!(checked(&text[..place], &facts, fixed::NOW).is_err());
            assert!(checked(&format!("{}A{}", &text[..place], &text[place..]), &facts, fixed::NOW).is_err());
        }
        assert!(checked(&format!("{text}A"), &facts, fixed::NOW).is_err());
    }

    #[test]
    fn other_spellings_of_the_same_claims_are_no_token() {
        let (key, signer) = (fixed::key(), Signer::of(&fixed::key()).unwrap());
        let end = fixed::NOW + DAY;
        let sealed = |json: &str| {
            let claims = URL_SAFE_NO_PAD.encode(json);
            format!("wlt_{claims}.{}", signer.sign(&signed(&claims)).unwrap())
        };
        let id = key.id();
        let right =
            format!(r#"{{"v":1,"key":"{id}","scopes":"read,jobs","methods":"GET","material":"all","expires":{end}}}"#);
        assert!(checked(&sealed(&right), &fixed::facts(), fixed::NOW).is_ok());
        for (from, to) in [
            (",", ", "),
            ("read,jobs", "jobs,read"),
            ("read,jobs", "read,read"),
            ("read,jobs", "read,tenant"),
            ("read,jobs", "instance"),
            ("read,jobs", ""),
            ("\"GET\"", "\"\""),
            ("\"GET\"", "\"get\""),
            ("\"GET\"", "\"HEAD\""),
            ("\"GET\"", "[\"GET\"]"),
            ("\"all\"", "\"\\u0061ll\""),
            ("\"all\"", "\"b3-0\""),
            ("\"all\"", "null"),
            ("\"v\":1", "\"v\":2"),
            ("\"v\":1,", ""),
            ("\"v\":1,", "\"v\":1,\"v\":1,"),
            ("\"v\":1,", "\"v\":1,\"tenant\":\"x\","),
            ("}", ",\"x\":1}"),
            ("}", "}}"),
            ("}", "} "),
        ] {
            let wrong = right.replacen(from, to, 1);
            assert_ne!(wrong, right);
            assert_eq!(checked(&sealed(&wrong), &fixed::facts(), fixed::NOW), Err(Refused::NotAToken), "{wrong}");
        }
        for end in
            ["1.7957376e9".to_owned(), "-1".to_owned(), format!("{end}.0"), format!("0{end}"), "\"1\"".to_owned()]
        {
            let wrong = right.replace(&(fixed::NOW + DAY).to_string(), &end);
            assert_eq!(checked(&sealed(&wrong), &fixed::facts(), fixed::NOW), Err(Refused::NotAToken), "{wrong}");
        }
    }

    #[test]
    fn untrusted_text_is_bounded() {
        let deep = format!("wlt_{}.A", URL_SAFE_NO_PAD.encode("[".repeat(300)));
        for text in [
            "",
            "wlt_",
            "wlt_.",
            "wlt_é.é",
            deep.as_str(),
            &"wlt_".repeat(1 << 22),
            &format!("wlt_{}.", "A".repeat(1 << 24)),
        ] {
            assert_eq!(Token::read(text, fixed::NOW).unwrap_err(), Refused::NotAToken);
        }
    }

    #[test]
    fn no_token_is_made_for_administration_or_for_longer_than_a_week() {
        let make = |scopes: Scopes, methods: Methods, seconds| {
            Token::make(&fixed::key(), scopes, methods, Reach::All, fixed::NOW, seconds)
        };
        let read: Scopes = "read".parse().unwrap();
        for scopes in ["tenant", "instance", "read,tenant"].map(|text| text.parse::<Scopes>().unwrap()) {
            assert_eq!(make(scopes, Methods::all(), DAY), Err(NotMade::Scopes(scopes)));
        }
        assert_eq!(make(Scopes::none(), Methods::all(), DAY), Err(NotMade::Scopes(Scopes::none())));
        assert_eq!(make(read, Methods::none(), DAY), Err(NotMade::Methods));
        for seconds in [0, LONGEST + 1, u64::MAX] {
            assert_eq!(make(read, Methods::all(), seconds), Err(NotMade::Time));
        }
        assert!(make(read, Methods::all(), LONGEST).is_ok());
    }

    #[test]
    fn a_token_holds_between_its_making_and_its_end() {
        let text = made("read", "GET", one());
        let at = |now: u64| checked(&text, &fixed::facts(), now).map(|grant| grant.expires);
        let end = fixed::NOW + DAY;
        for now in [fixed::NOW, end - 1, end + SKEW - 1] {
            assert_eq!(at(now), Ok(end));
        }
        assert_eq!(at(end + SKEW), Err(Refused::Expired));
        assert_eq!(at(u64::MAX), Err(Refused::Expired));
        // Made by a clock that is ahead.
        assert!(at(end - LONGEST - SKEW).is_ok());
        assert_eq!(at(end - LONGEST - SKEW - 1), Err(Refused::TooLong));
        assert_eq!(at(0), Err(Refused::TooLong));
    }

    #[test]
    fn a_token_ends_with_its_key_and_has_no_more_scopes() {
        let text = made("read,jobs", "GET", one());
        let (facts, now) = (fixed::facts(), fixed::NOW);
        let with = |facts: KeyFacts| checked(&text, &facts, now);
        assert_eq!(with(KeyFacts { is_revoked: true, ..facts }), Err(Refused::KeyRevoked));
        assert_eq!(with(KeyFacts { expires: Some(now), ..facts }), Err(Refused::KeyExpired));
        assert_eq!(with(KeyFacts { expires: Some(now + 1), ..facts }).map(|grant| grant.expires), Ok(now + 1));
        let (has, needs): (Scopes, Scopes) = ("read,write".parse().unwrap(), "read,jobs".parse().unwrap());
        assert_eq!(with(KeyFacts { scopes: has, ..facts }), Err(Refused::KeyScopes { has, needs }));
        // Nobody without a signature of the key learns anything about it.
        let stranger = Signer::of(&Key::generate().unwrap()).unwrap().verifier().unwrap();
        let gone = KeyFacts { scopes: Scopes::none(), verifier: stranger, expires: Some(0), is_revoked: true };
        assert_eq!(with(gone), Err(Refused::Forged));
    }

    #[test]
    fn nothing_shows_the_signature() {
        let text = made("read", "GET", one());
        let token = Token::read(&text, fixed::NOW).unwrap();
        let (claims, signature) = text.split_once('.').unwrap();
        let errors = [Token::read(&format!("{text}A"), fixed::NOW).unwrap_err(), Refused::Forged, Refused::Expired];
        let shown = format!("{token:?} {errors:?} {}", errors.map(|error| error.to_string()).join(" "));
        assert!(!shown.contains(&signature[..8]) && !shown.contains(&claims[10..20]), "{shown}");
    }

    proptest! {
        #[test]
        fn two_different_grants_never_sign_the_same_text(one in grants(), other in grants()) {
            let text = |grant: &Grant| signed(&encoded(grant));
            prop_assert_eq!(text(&one) == text(&other), one == other);
        }

        #[test]
        fn every_token_reads_back(grant in grants()) {
            let claims = encoded(&grant);
            let signature = Signer::of(&fixed::key()).unwrap().sign(&signed(&claims)).unwrap();
            let token = Token::parse(&format!("wlt_{claims}.{signature}"));
            prop_assert_eq!(token.map(|token| token.grant), Some(grant));
        }

        #[test]
        fn no_text_is_a_token_by_chance(text in "wlt_[A-Za-z0-9_.-]{0,500}", bytes in any::<Vec<u8>>()) {
            prop_assert!(checked(&text, &fixed::facts(), fixed::NOW).is_err());
            prop_assert!(checked(&String::from_utf8_lossy(&bytes), &fixed::facts(), fixed::NOW).is_err());
        }
    }

    /// Grants with few different values in each field, so that two of them are often equal.
    fn grants() -> impl Strategy<Value = Grant> {
        let scopes = proptest::sample::subsequence(&Scope::ALL[..3], 1..=3);
        let methods = proptest::sample::subsequence(super::super::grant::Method::ALL, 1..=5);
        let reach = prop_oneof![
            Just(Reach::All),
            (0..4_u8).prop_map(|n| Reach::One(MaterialId::read(&format!("b3-{n:064x}")).unwrap()))
        ];
        let key = (0..4_u8).prop_map(|n| format!("000000000{n}").parse::<KeyId>().unwrap());
        let expires = prop_oneof![0..3_u64, Just(u64::MAX), any::<u64>()];
        (scopes, methods, reach, key, expires).prop_map(|(scopes, methods, reach, key, expires)| Grant {
            key,
            scopes: scopes.into_iter().collect(),
            methods: methods.into_iter().collect(),
            reach,
            expires,
        })
    }
}
