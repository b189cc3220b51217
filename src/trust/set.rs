//! Small sets of named members, with one text for each set: `read,jobs`.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

/// Upper bound in bytes on the text that lists the members of a set, checked before the text is split. Longer than the
/// names of all members.
const TEXT: usize = 64;

/// One of at most eight values that a [`Set`] may hold.
pub(crate) trait Member: Copy + PartialEq + 'static {
    /// Noun for one member of a set in messages, such as `scope`.
    const NOUN: &'static str;
    /// All members that a set may have, in the order in which its text lists them.
    const ALL: &'static [Self];

    /// Returns the name of the member, as the text of a set spells it.
    fn name(self) -> &'static str;
}

/// Set of at most eight possible members, one bit for each.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Set<M> {
    bits: u8,
    members: PhantomData<M>,
}

/// Error for a text that is not a list of members of a set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{found}`, expected {noun}s with commas between: {names}", names = .names.join(", "))]
pub(crate) struct NotASet {
    found: String,
    noun: &'static str,
    names: Vec<&'static str>,
}

impl<M: Member> Set<M> {
    /// Returns the set without members.
    pub(crate) fn none() -> Self {
        Self { bits: 0, members: PhantomData }
    }

    /// Returns the set of all members.
    pub(crate) fn all() -> Self {
        M::ALL.iter().copied().collect()
    }

    /// Returns true if `member` is in the set.
    pub(crate) fn has(self, member: M) -> bool {
        self.bits & Self::bit(member) != 0
    }

    /// Returns true if the set has no members.
    pub(crate) fn is_empty(self) -> bool {
        self.bits == 0
    }

    /// Returns true if every member is also in `other`.
    pub(crate) fn is_within(self, other: Self) -> bool {
        self.bits & !other.bits == 0
    }

    /// Returns the members in the order of [`Member::ALL`].
    pub(crate) fn iter(self) -> impl Iterator<Item = M> {
        M::ALL.iter().copied().filter(move |member| self.has(*member))
    }

    fn bit(member: M) -> u8 {
        M::ALL.iter().position(|known| *known == member).map_or(0, |place| 1 << place)
    }

    fn named(name: &str) -> Option<M> {
        M::ALL.iter().copied().find(|member| member.name() == name)
    }
}

impl<M: Member> FromIterator<M> for Set<M> {
    fn from_iter<I: IntoIterator<Item = M>>(members: I) -> Self {
        let bits = members.into_iter().fold(0, |bits, member| bits | Self::bit(member));
        Self { bits, members: PhantomData }
    }
}

impl<M: Member> fmt::Display for Set<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, member) in self.iter().enumerate() {
            write!(f, "{}{}", if place > 0 { "," } else { "" }, member.name())?;
        }
        Ok(())
    }
}

impl<M: Member> fmt::Debug for Set<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{{{self}}}")
    }
}

impl<M: Member> FromStr for Set<M> {
    type Err = NotASet;

    /// Parses a set from names with commas between, in any order. Refuses a name twice and a set without members.
    fn from_str(text: &str) -> Result<Self, NotASet> {
        let refused = || NotASet {
            found: text.chars().take(TEXT).collect(),
            noun: M::NOUN,
            names: M::ALL.iter().map(|member| member.name()).collect(),
        };
        if text.len() > TEXT {
            return Err(refused());
        }
        text.split(',').try_fold(Self::none(), |set, name| {
            let bit = Self::named(name.trim()).map(Self::bit).filter(|bit| set.bits & bit == 0).ok_or_else(refused)?;
            Ok(Self { bits: set.bits | bit, members: PhantomData })
        })
    }
}

impl<M: Member> Serialize for Set<M> {
    /// Writes the set as the list of its members' names.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter().map(Member::name))
    }
}

impl<'de, M: Member> Deserialize<'de> for Set<M> {
    /// Reads a set from a list of names, in any order. Refuses a name twice, so that the list is never longer than all
    /// members.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Names<M>(PhantomData<M>);

        impl<'de, M: Member> serde::de::Visitor<'de> for Names<M> {
            type Value = Set<M>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of {}s", M::NOUN)
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut names: A) -> Result<Set<M>, A::Error> {
                let mut set = Set::none();
                while let Some(name) = names.next_element::<std::borrow::Cow<'de, str>>()? {
                    let member = Set::<M>::named(&name).filter(|member| !set.has(*member));
                    let member =
                        member.ok_or_else(|| A::Error::custom(format_args!("unknown or repeated {}", M::NOUN)))?;
                    set = [member].into_iter().chain(set.iter()).collect();
                }
                Ok(set)
            }
        }

        deserializer.deserialize_seq(Names(PhantomData))
    }
}
