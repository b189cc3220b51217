//! Links: URLs with which tools that send no headers fetch the file of one material. Made offline from a key.

use super::grant::{Grant, KeyFacts, MATERIALS, MaterialId, Method, NotMade, Reach, Refused, check_end, end};
use super::key::{Key, KeyId};
use super::scope::Scope;
use super::signing::{Signature, Signer};

/// Upper bound in characters on the query of a signed link, checked before the query is parsed. No valid query has more
/// than 140.
const LONGEST_QUERY: usize = 160;

/// First line of the text that is signed for a link. The text signed for a token begins with another line, so that
/// neither can be presented as the other.
const FIRST_LINE: &str = "wavelume link 1";

/// Last part of the URL path of a signed link.
const CONTENT: &str = "/content";

/// Signed link that has not expired, but whose signature is not verified yet. It grants nothing before
/// [`Link::verify`].
///
/// The signed text is `wavelume link 1`, the method `GET` (which includes `HEAD`), the path, the id of the key and the
/// end in Unix seconds, each followed by a line feed. It does not state the tenant: a key belongs to one tenant for as
/// long as it exists, and the signature is of that key. So the link is for the tenant in the row of its key, and the
/// holder of a key can make links without knowing the name of its tenant. It does not state the host either: proxies
/// may change it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    material: MaterialId,
    key: KeyId,
    expires: u64,
    signature: Signature,
}

impl Link {
    /// Makes a link at `now` (Unix seconds) to the file of `material` that holds for `seconds`.
    pub(crate) fn make(key: &Key, material: MaterialId, now: u64, seconds: u64) -> Result<Self, NotMade> {
        let (id, expires) = (key.id(), end(now, seconds)?);
        let signature = Signer::of(key)?.sign(&signed(material, id, expires))?;
        Ok(Self { material, key: id, expires, signature })
    }

    /// Returns path and query of the link, to follow the base URL of a service.
    pub(crate) fn target(&self) -> String {
        let Self { material, key, expires, signature } = self;
        format!("{}?key={key}&expires={expires}&signature={signature}", path(*material))
    }

    /// Parses the path and query of a request that may come from anybody as a signed link, and checks at `now` that it
    /// has not expired. Each link has one text.
    pub(crate) fn read(path: &str, query: &str, now: u64) -> Result<Self, Refused> {
        let link = Self::parse(path, query).ok_or(Refused::NotALink)?;
        check_end(link.expires, now)?;
        Ok(link)
    }

    /// Id of the access key that the signed link names.
    pub(crate) fn key(&self) -> KeyId {
        self.key
    }

    /// Verifies the signature and rights of the link at `now` with the stored facts of the key that it names.
    pub(crate) fn verify(&self, facts: &KeyFacts, now: u64) -> Result<Grant, Refused> {
        let grant = Grant {
            key: self.key,
            scopes: [Scope::Read].into_iter().collect(),
            methods: [Method::Get].into_iter().collect(),
            reach: Reach::One(self.material),
            expires: self.expires,
        };
        facts.check(&signed(self.material, self.key, self.expires), &self.signature, grant, now)
    }

    fn parse(path: &str, query: &str) -> Option<Self> {
        let material = Self::material(path)?;
        if query.len() > LONGEST_QUERY {
            return None;
        }
        let (key, rest) = query.strip_prefix("key=")?.split_once("&expires=")?;
        let (digits, signature) = rest.split_once("&signature=")?;
        let expires: u64 = digits.parse().ok()?;
        // A sign and leading zeros would be a second spelling.
        let is_plain = expires.to_string() == digits;
        is_plain.then_some(Self { material, key: key.parse().ok()?, expires, signature: Signature::read(signature)? })
    }

    /// Returns true if the path and query of a request look like a signed link.
    pub(crate) fn is_like(path: &str, query: &str) -> bool {
        query.contains("signature=") && Self::material(path).is_some()
    }

    /// Returns the id of the material whose file is at the URL path `path`; `None` for all paths that no signed link
    /// has.
    fn material(path: &str) -> Option<MaterialId> {
        MaterialId::read(path.strip_prefix(MATERIALS)?.strip_suffix(CONTENT)?)
    }
}

fn path(material: MaterialId) -> String {
    format!("{MATERIALS}{material}{CONTENT}")
}

/// Returns the text that is signed for a link. No field has a line feed, so that no two links have the same text.
fn signed(material: MaterialId, key: KeyId, expires: u64) -> String {
    format!("{FIRST_LINE}\nGET\n{}\n{key}\n{expires}\n", path(material))
}

#[cfg(test)]
mod tests {
    use super::super::Token;
    use super::super::grant::{LONGEST, Methods, SKEW, fixed};
    use super::super::scope::Scopes;
    use super::*;
    use proptest::prelude::*;

    const DAY: u64 = 24 * 60 * 60;

    /// Link that `fixed::key()` makes at `fixed::NOW` for one day, computed by other programs: the `blake3` and
    /// `cryptography` packages of Python.
    const LINK: &str = concat!(
        "/v1/materials/b3-0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef/content?key=01",
        "23456xyz&expires=1795737600&signature=09KW6LEBzdkvaqR1P1ILIlpQrDwxro-uMjMx7V1jvD_XCINNPPnEAMe_aL",
        "UoE034CcuDPVDf_Iy2mbslMCILDA",
    );

    /// Regular expression that matches the query strings of signed links.
    const QUERY: &str = "key=[0-9a-z]{10}&expires=17957[0-9]{5}&signature=[A-Za-z0-9_-]{86}";

    fn made() -> Link {
        Link::make(&fixed::key(), fixed::material(), fixed::NOW, DAY).unwrap()
    }

    fn checked(target: &str, facts: &KeyFacts, now: u64) -> Result<Grant, Refused> {
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        Link::read(path, query, now)?.verify(facts, now)
    }

    #[test]
    fn a_link_never_changes_and_grants_one_file() {
        let target = made().target();
        assert_eq!(target, LINK);
        let grant = checked(&target, &fixed::facts(), fixed::NOW).unwrap();
        assert_eq!(
            (grant.key, grant.reach, grant.expires),
            (fixed::key().id(), Reach::One(fixed::material()), fixed::NOW + DAY)
        );
        assert_eq!((grant.scopes.to_string(), grant.methods.to_string()), ("read".to_owned(), "GET".to_owned()));
        let path = target.split_once('?').unwrap().0;
        assert!(grant.allows("GET", path) && grant.allows("HEAD", path));
        for method in ["POST", "PUT", "DELETE", "OPTIONS", "get"] {
            assert!(!grant.allows(method, path), "{method}");
        }
    }

    #[test]
    fn every_changed_character_is_refused() {
        let target = made().target();
        let facts = fixed::facts();
        for place in 0..target.len() {
            for other in (0..=0x7f_u8).filter(|other| *other != target.as_bytes()[place]) {
                let mut bytes = target.clone().into_bytes();
                bytes[place] = other;
                let changed = String::from_utf8(bytes).unwrap();
                assert!(checked(&changed, &facts, fixed::NOW).is_err(), "{place}: {changed}");
            }
            assert!(checked(&target[..place], &facts, fixed::NOW).is_err());
            assert!(checked(&format!("{}0{}", &target[..place], &target[place..]), &facts, fixed::NOW).is_err());
        }
    }

    #[test]
    fn other_paths_and_queries_are_no_links() {
        let target = made().target();
        let (path, query) = target.split_once('?').unwrap();
        let parts: Vec<&str> = query.split('&').collect();
        let [key, expires, signature] = parts[..] else { panic!("{query}") };
        for wrong in [
            String::new(),
            "key=".to_owned(),
            format!("{expires}&{key}&{signature}"),
            format!("{key}&{expires}"),
            format!("{query}&x=1"),
            format!("x=1&{query}"),
            format!("{key}&{query}"),
            format!("{query}&{signature}"),
            format!("{key}&{}&{signature}", expires.replace('=', "=0")),
            format!("{key}&{}&{signature}", expires.replace('=', "=+")),
            query.replace("key", "%6bey"),
            query.replace('&', ";"),
            "&".repeat(1 << 24),
        ] {
            assert_eq!(Link::read(path, &wrong, fixed::NOW).unwrap_err(), Refused::NotALink, "{}", wrong.len());
        }
        for wrong in [
            "",
            "/",
            "/v1/materials//content",
            &path.replace("/content", ""),
            &path.replace("/content", "/export"),
            &path.replace("/content", "/content/"),
            &path.replace("/content", "/%63ontent"),
            &path.replace("materials", "measurements"),
            &path.replace("abcdef", "ABCDEF"),
            &format!("/{path}"),
            &format!("{path}{path}"),
            &"/v1/materials/".repeat(1 << 20),
        ] {
            assert_eq!(Link::read(wrong, query, fixed::NOW).unwrap_err(), Refused::NotALink, "{}", wrong.len());
        }
    }

    #[test]
    fn a_link_holds_until_its_end_and_as_long_as_its_key() {
        let target = made().target();
        let (facts, end) = (fixed::facts(), fixed::NOW + DAY);
        let at = |now: u64| checked(&target, &facts, now).map(|grant| grant.expires);
        assert_eq!(at(fixed::NOW), Ok(end));
        assert_eq!(at(end + SKEW - 1), Ok(end));
        assert_eq!(at(end + SKEW), Err(Refused::Expired));
        assert_eq!(at(end - LONGEST - SKEW - 1), Err(Refused::TooLong));
        let with = |facts: KeyFacts| checked(&target, &facts, fixed::NOW).map(|grant| grant.expires);
        assert_eq!(with(KeyFacts { is_revoked: true, ..facts }), Err(Refused::KeyRevoked));
        assert_eq!(with(KeyFacts { expires: Some(fixed::NOW), ..facts }), Err(Refused::KeyExpired));
        assert_eq!(with(KeyFacts { expires: Some(fixed::NOW + 5), ..facts }), Ok(fixed::NOW + 5));
        let (has, needs): (Scopes, Scopes) = ("write,jobs".parse().unwrap(), "read".parse().unwrap());
        assert_eq!(with(KeyFacts { scopes: has, ..facts }), Err(Refused::KeyScopes { has, needs }));
        for seconds in [0, LONGEST + 1, u64::MAX] {
            let refused = Link::make(&fixed::key(), fixed::material(), fixed::NOW, seconds).unwrap_err();
            assert_eq!(refused, NotMade::Time);
        }
    }

    #[test]
    fn the_signature_of_a_token_makes_no_link() {
        let read: Scopes = "read".parse().unwrap();
        let reach = Reach::One(fixed::material());
        let token = Token::make(&fixed::key(), read, Methods::all(), reach, fixed::NOW, DAY).unwrap();
        let (claims, signature) = token.strip_prefix("wlt_").unwrap().split_once('.').unwrap();
        let target = made().target();
        let (most, of_link) = target.rsplit_once('=').unwrap();
        assert_eq!(checked(&format!("{most}={signature}"), &fixed::facts(), fixed::NOW), Err(Refused::Forged));
        let swapped = Token::read(&format!("wlt_{claims}.{of_link}"), fixed::NOW).unwrap();
        assert_eq!(swapped.verify(&fixed::facts(), fixed::NOW), Err(Refused::Forged));
    }

    #[test]
    fn nothing_shows_the_signature() {
        let link = made();
        let target = link.target();
        let signature = target.rsplit_once('=').unwrap().1;
        assert!(!format!("{link:?} {}", Refused::Forged).contains(&signature[..8]));
    }

    proptest! {
        #[test]
        fn two_different_links_never_sign_the_same_text(one in fields(), other in fields()) {
            let text = |(material, key, expires)| signed(material, key, expires);
            prop_assert_eq!(text(one) == text(other), one == other);
        }

        #[test]
        fn every_link_reads_back((material, key, expires) in fields()) {
            let signature = Signer::of(&fixed::key()).unwrap().sign("").unwrap();
            let target = Link { material, key, expires, signature }.target();
            let (path, query) = target.split_once('?').unwrap();
            let link = Link::parse(path, query).map(|link| (link.material, link.key, link.expires));
            prop_assert_eq!(link, Some((material, key, expires)));
        }

        #[test]
        fn no_text_is_a_link_by_chance(query in QUERY, text in any::<String>()) {
            let path = path(fixed::material());
            for query in [query, text] {
                let target = format!("{path}?{query}");
                prop_assert!(checked(&target, &fixed::facts(), fixed::NOW).is_err());
            }
        }
    }

    /// Materials, keys and end times of links, drawn from few values so that two links are often equal.
    fn fields() -> impl Strategy<Value = (MaterialId, KeyId, u64)> {
        let material = prop_oneof![0..4_u64, any::<u64>()];
        let material = material.prop_map(|n| MaterialId::read(&format!("b3-{n:064x}")).unwrap());
        let key = (0..4_u8).prop_map(|n| format!("000000000{n}").parse::<KeyId>().unwrap());
        (material, key, prop_oneof![0..3_u64, Just(u64::MAX), any::<u64>()])
    }
}
