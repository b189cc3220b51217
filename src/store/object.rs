//! Name of a stored object: its tenant, the digest of its bytes, and the generation that wrote it.
//!
//! No name is ever used twice, so that a write or a removal that arrives late hits nothing that is in use.

use super::digest::Digest;
use crate::trust::Tenant;
use std::fmt;
use std::str::FromStr;

/// Name of the folder that holds all objects of a store, apart from parts of uploads.
pub(crate) const FOLDER: &str = "blobs";

/// Name of the folder that holds the parts of uploads that are not complete. It has no folders of its own, which a
/// directory would keep after the last part of an upload is removed.
pub(crate) const PARTS: &str = "uploads";

/// Name of a stored object; written as the path of the object below the root of the store.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Object {
    /// Tenant that owns the bytes. The name of a part of an upload does not state the tenant; the default one stands
    /// here then.
    tenant: Tenant,
    /// Upload of which the object is a part, and the number of the part from 0; `None` for an object with all bytes of
    /// a file.
    part: Option<(String, u32)>,
    digest: Digest,
    /// Unique suffix of the object's name; empty for objects of the first version, which had one object for each
    /// digest.
    generation: String,
}

/// Text that is not the name of a stored object.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not the path of a stored object")]
pub(crate) struct NotAnObject(String);

impl Object {
    /// Builds the name of a new object of a tenant with the given digest; the name was never used before.
    pub(crate) fn fresh(tenant: &Tenant, digest: Digest) -> Self {
        Self::of(tenant, digest, uuid::Uuid::now_v7().simple().to_string())
    }

    /// Builds the name of a new object that holds a part of an upload; the name was never used before. Parts of one
    /// upload sort by their numbers.
    pub(crate) fn part(upload: &str, number: u32, digest: Digest) -> Self {
        Self { part: Some((upload.to_owned(), number)), ..Self::fresh(&Tenant::default(), digest) }
    }

    /// Returns the beginning that the names of all parts of an upload have in common, and the text that sorts behind
    /// them.
    pub(crate) fn parts_of(upload: &str) -> [String; 2] {
        // The character after `.`.
        [format!("{PARTS}/{upload}."), format!("{PARTS}/{upload}/")]
    }

    /// Builds the name of an existing object from its tenant, its digest and its unique suffix (generation).
    pub(crate) fn of(tenant: &Tenant, digest: Digest, generation: String) -> Self {
        Self { tenant: tenant.clone(), part: None, digest, generation }
    }

    /// Builds the name that the first version gave to the only object with a digest. Backups use it, too.
    pub(crate) fn plain(digest: Digest) -> Self {
        Self::of(&Tenant::default(), digest, String::new())
    }

    /// Returns the owner of the object's bytes; the default one for a part of an upload.
    pub(crate) fn tenant(&self) -> &Tenant {
        &self.tenant
    }

    /// Returns the digest of the object's bytes.
    pub(crate) fn digest(&self) -> Digest {
        self.digest
    }

    /// Returns the generation of the object, which is the unique suffix of its name.
    pub(crate) fn generation(&self) -> &str {
        &self.generation
    }

    /// Returns the folder that holds the object.
    pub(crate) fn folder(&self) -> String {
        let path = self.to_string();
        path.rsplit_once('/').map_or(String::new(), |(folder, _)| folder.to_owned())
    }

    /// Returns the folder that holds all objects of a tenant; `None` for the default one, whose objects are scattered.
    pub(crate) fn folder_of(tenant: &Tenant) -> Option<String> {
        (!tenant.is_default()).then(|| format!("{FOLDER}/{tenant}"))
    }

    /// Returns the folders that hold all objects of a tenant whose digest begins with byte `first`. The folders of all
    /// 256 bytes hold every object of the tenant. Objects of another tenant may be there, too.
    pub(crate) fn folders(tenant: &Tenant, first: u8) -> Vec<String> {
        let mut folders = vec![format!("{FOLDER}/{tenant}/{first:02x}")];
        if tenant.is_default() {
            // Objects of the first version. A tenant may be called like this folder.
            folders.push(format!("{FOLDER}/{first:02x}"));
        }
        folders
    }
}

impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digest = self.digest.to_string();
        let first = &digest[3..5];
        if let Some((upload, number)) = &self.part {
            return write!(f, "{PARTS}/{upload}.{number:06}.{digest}.{}", self.generation);
        }
        if self.generation.is_empty() {
            write!(f, "{FOLDER}/{first}/{digest}")
        } else {
            write!(f, "{FOLDER}/{}/{first}/{digest}.{}", self.tenant, self.generation)
        }
    }
}

impl FromStr for Object {
    type Err = NotAnObject;

    fn from_str(text: &str) -> Result<Self, NotAnObject> {
        let refused = || NotAnObject(text.chars().take(160).collect());
        let name = text.rsplit('/').next().unwrap_or(text);
        let plain = |text: &str| text.bytes().all(|b| b.is_ascii_digit() || b.is_ascii_lowercase());
        let fields: Vec<&str> = name.splitn(5, '.').collect();
        let mut tenant = Tenant::default();
        let (part, digest, generation) = match fields[..] {
            [digest] => (None, digest, ""),
            [digest, generation] => {
                tenant = text.split('/').nth(1).and_then(|name| name.parse().ok()).ok_or_else(refused)?;
                (None, digest, generation)
            }
            [upload, number, digest, generation] if plain(upload) && !upload.is_empty() => {
                let number = number.parse().map_err(|_| refused())?;
                (Some((upload.to_owned(), number)), digest, generation)
            }
            _ => return Err(refused()),
        };
        let digest = digest.parse().map_err(|_| refused())?;
        let object = Self { tenant, part, digest, generation: generation.to_owned() };
        // A path elsewhere, or with a generation of other characters, is somebody else's.
        if plain(generation) && object.to_string() == text { Ok(object) } else { Err(refused()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_paths_that_are_read_back_and_never_repeat() {
        let digest = Digest::of(b"wavelume");
        let (one, other) = (Tenant::default(), "ab".parse().unwrap());
        let (first, second, third) =
            (Object::fresh(&one, digest), Object::fresh(&one, digest), Object::fresh(&other, digest));
        assert_ne!(first, second);
        let old = Object::plain(digest);
        for object in [&first, &second, &third, &old] {
            assert_eq!(object.to_string().parse::<Object>().as_ref(), Ok(object));
            let byte = u8::from_str_radix(&digest.to_string()[3..5], 16).unwrap();
            let folders = Object::folders(object.tenant(), byte);
            assert!(folders.iter().any(|folder| object.to_string().starts_with(&format!("{folder}/"))));
        }
        assert!(third.to_string().starts_with("blobs/ab/") && first.to_string().starts_with("blobs/default/"));
        let (part, next) = (Object::part("0a", 9, digest), Object::part("0a", 10, digest));
        assert_eq!(part.to_string().parse::<Object>().as_ref(), Ok(&part));
        let [before, behind] = Object::parts_of("0a");
        assert!(before < part.to_string() && part.to_string() < next.to_string() && next.to_string() < behind);
        assert!(!Object::part("0a0", 0, digest).to_string().starts_with(&before));
        assert_eq!(old.to_string(), format!("blobs/{}/{digest}", &digest.to_string()[3..5]));
        for other in [
            "",
            "blobs/ab/notes.txt",
            &format!("elsewhere/{digest}"),
            &format!("{first}.x"),
            &format!("{first}/"),
            &format!("blobs/A/{}", &first.to_string()[14..]),
        ] {
            assert!(other.parse::<Object>().is_err(), "{other}");
        }
    }
}
