//! Scopes: the groups of operations that a key may use.

use super::set::{Member, Set};
use serde::{Deserialize, Serialize};

/// Group of operations that a key may use. No scope includes another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Scope {
    /// Read measurements, materials and jobs, and query materials.
    Read,
    /// Upload and delete measurements and materials.
    Write,
    /// Start, cancel and repeat jobs.
    Jobs,
    /// Administer one tenant: its keys, usage and audit trail.
    Tenant,
    /// Administer the service: tenants, quotas, metrics.
    Instance,
}

/// Scopes of a key. The text `read,write,jobs` lists them in the order of [`Scope`].
pub(crate) type Scopes = Set<Scope>;

impl Member for Scope {
    const NOUN: &'static str = "scope";
    const ALL: &'static [Self] = &[Self::Read, Self::Write, Self::Jobs, Self::Tenant, Self::Instance];

    fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Write => "write",
            Self::Jobs => "jobs",
            Self::Tenant => "tenant",
            Self::Instance => "instance",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_of_scopes_has_one_text_and_reads_back() {
        for bits in 1_u32..32 {
            let chosen = Scope::ALL.iter().enumerate().filter(|(place, _)| bits >> place & 1 == 1);
            let scopes: Scopes = chosen.map(|(_, scope)| *scope).collect();
            assert_eq!(scopes.iter().count(), bits.count_ones() as usize);
            assert_eq!(scopes.to_string().parse(), Ok(scopes));
            let reversed: Vec<_> = scopes.to_string().split(',').rev().map(str::to_owned).collect();
            assert_eq!(reversed.join(",").parse(), Ok(scopes));
            let list = serde_json::to_string(&scopes).unwrap();
            assert_eq!(serde_json::from_str::<Scopes>(&list).unwrap(), scopes);
            // The list is that of single scopes.
            let single: Vec<Scope> = serde_json::from_str(&list).unwrap();
            assert_eq!(single, scopes.iter().collect::<Vec<_>>());
        }
        assert_eq!(Scopes::all().to_string(), "read,write,jobs,tenant,instance");
        assert_eq!("jobs, read".parse::<Scopes>().unwrap().to_string(), "read,jobs");
    }

    #[test]
    fn other_texts_are_no_scopes() {
        let long = "read,".repeat(20_000);
        for bad in ["", ",", "read,", "Read", "read;write", "admin", "read,read", long.as_str()] {
            let error = bad.parse::<Scopes>().unwrap_err().to_string();
            assert!(error.starts_with("found `") && error.ends_with("read, write, jobs, tenant, instance"), "{error}");
            assert!(error.len() < 200, "{error}");
        }
        for bad in [r#"["read","read"]"#, r#"["Read"]"#, r#""read""#, "[1]", "{}", "null"] {
            assert!(serde_json::from_str::<Scopes>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sets_are_compared_by_their_members() {
        let set = |text: &str| text.parse::<Scopes>().unwrap();
        assert!(set("read").is_within(set("read,jobs")) && !set("read,write").is_within(set("read,jobs")));
        assert!(Scopes::none().is_empty() && !set("read").is_empty());
        assert!(set("jobs").has(Scope::Jobs) && !set("jobs").has(Scope::Read));
    }
}
