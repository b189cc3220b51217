//! Verdicts on the database: reachable, new enough, encoded, durable, with the right schema and enough connections.

use super::super::archive::CONNECTIONS;
use super::asked::{Asked, PATIENCE};
use super::finding::Finding;
use crate::catalog::{CatalogError, Database, EngineFacts, Examined, OLDEST_SERVER, SCHEMA, ServerFacts};

/// Difference of clocks in milliseconds above which a warning is given. Lower values report machines whose clocks are
/// set over the network as they should be.
const APART: i64 = 5000;

/// Number of connections to PostgreSQL of one process: its pool, and the one that listens for notifications.
const EACH: i64 = CONNECTIONS as i64 + 1;

/// Returns the verdicts on the database at `place`, which `processes` nodes and workers share.
pub(super) fn judge(place: &Database, asked: &Asked, processes: u32) -> Vec<Finding> {
    let examined = match asked {
        Asked::Answered(examined) => examined,
        Asked::Missing => {
            return vec![Finding::warning(
                "database",
                format!("the database {place} does not exist yet"),
                "`wavelume serve`, `worker` and `migrate` create the database; check --data and --database if it \
                 should exist",
            )];
        }
        Asked::Silent => {
            return vec![Finding::fault(
                "database",
                format!("the database {place} gave no answer within {} s", PATIENCE.as_secs()),
                "check its address, the network in between, and that it runs",
            )];
        }
        Asked::Failed(error) => {
            let remedy = match error {
                // The messages of these errors say what to do.
                CatalogError::Unreachable { .. } | CatalogError::Unusable { .. } => "then run doctor again",
                _ => "check --database, and the rights of its user",
            };
            return vec![Finding::fault("database", error.to_string(), remedy)];
        }
    };
    let mut findings =
        vec![Finding::ok("database", format!("{place} answered in {} ms", examined.answered.as_millis()))];
    match &examined.engine {
        EngineFacts::Server(server) => {
            findings.extend([version(server), encoding(server), standby(server), server_durability(server)]);
        }
        EngineFacts::File { journal, synchronous, is_free } => {
            findings.push(file_durability(journal, *synchronous));
            findings.push(if *is_free {
                Finding::ok("database lock", "free")
            } else {
                Finding::warning(
                    "database lock",
                    "another program is writing to the database at this moment",
                    "run `wavelume doctor` again; if the program still writes, end it",
                )
            });
        }
    }
    findings.push(clock(examined));
    findings.push(schema(examined));
    if let Some(original) = &examined.copying {
        findings.push(Finding::fault(
            "database copy",
            format!("a copy of {original} into {place} was begun and has not ended"),
            "start the same `wavelume restore` or `wavelume move` again, which goes on",
        ));
    }
    if let EngineFacts::Server(server) = &examined.engine {
        findings.push(connections(server, processes));
    }
    findings
}

fn version(server: &ServerFacts) -> Finding {
    let found = format!("PostgreSQL {}", server.version_text);
    if server.version >= OLDEST_SERVER {
        return Finding::ok("database version", found);
    }
    Finding::fault("database version", found, format!("install PostgreSQL {} or newer", OLDEST_SERVER / 10_000))
}

fn encoding(server: &ServerFacts) -> Finding {
    let found = format!("encoding {}, order of texts {}", server.encoding, server.order);
    if server.is_bytewise() {
        return Finding::ok("database encoding", found);
    }
    Finding::fault(
        "database encoding",
        found,
        "make the database with CREATE DATABASE … TEMPLATE template0 ENCODING 'UTF8' LOCALE 'C'",
    )
}

fn standby(server: &ServerFacts) -> Finding {
    if server.is_standby {
        let found = "the server is a standby, which cannot be written";
        return Finding::fault("database role", found, "name the primary server in --database");
    }
    Finding::ok("database role", "primary")
}

fn server_durability(server: &ServerFacts) -> Finding {
    let settings = [
        ("fsync", &server.fsync),
        ("full_page_writes", &server.full_page_writes),
        ("synchronous_commit", &server.synchronous_commit),
    ];
    let shown: Vec<String> = settings.iter().map(|(name, value)| format!("{name} {value}")).collect();
    let off: Vec<String> =
        settings.iter().filter(|(_, value)| *value == "off").map(|(name, _)| format!("{name} = on")).collect();
    if off.is_empty() {
        return Finding::ok("database durability", shown.join(", "));
    }
    let remedy = format!("a crash loses what clients were told is stored: set {}", off.join(" and "));
    Finding::fault("database durability", shown.join(", "), remedy)
}

fn file_durability(journal: &str, synchronous: i64) -> Finding {
    const LEVELS: [&str; 4] = ["off", "normal", "full", "extra"];
    let level = usize::try_from(synchronous).ok().and_then(|level| LEVELS.get(level)).unwrap_or(&"unknown");
    let found = format!("journal {journal}, synchronous {level}");
    match (journal, synchronous) {
        (_, ..2) => Finding::fault(
            "database durability",
            found,
            "a crash loses what clients were told is stored: use a SQLite that honours PRAGMA synchronous = FULL",
        ),
        ("off" | "memory", _) => {
            Finding::warning("database durability", found, "the next start of serve or worker sets the journal to wal")
        }
        _ => Finding::ok("database durability", found),
    }
}

fn clock(examined: &Examined) -> Finding {
    let found = format!("{} ms ahead of this machine", examined.ahead);
    if examined.ahead.abs() <= APART {
        return Finding::ok("database clock", found);
    }
    let remedy =
        "set both clocks over the network (NTP): leases follow the database's clock, log lines and S3 this machine's";
    Finding::warning("database clock", found, remedy)
}

fn schema(examined: &Examined) -> Finding {
    let found = match examined.schema {
        0 => format!("none yet, this program has version {SCHEMA}"),
        version => format!("version {version}, this program has version {SCHEMA}"),
    };
    let is_file = matches!(examined.engine, EngineFacts::File { .. });
    match examined.schema {
        _ if examined.oldest_reader > SCHEMA => {
            let remedy = format!("use a program of schema {} or newer", examined.oldest_reader);
            Finding::fault("database schema", found, remedy)
        }
        version if version >= SCHEMA => Finding::ok("database schema", found),
        _ if is_file => Finding::warning("database schema", found, "serve, worker and migrate bring it up to date"),
        _ => Finding::fault("database schema", found, "run `wavelume migrate`"),
    }
}

fn connections(server: &ServerFacts, processes: u32) -> Finding {
    let needed = i64::from(processes) * EACH;
    let found = format!(
        "{} connections for users, {} in use; {processes} processes need up to {needed}",
        server.connections, server.in_use
    );
    if needed > server.connections {
        let remedy =
            format!("raise max_connections of PostgreSQL by {}, or run fewer processes", needed - server.connections);
        return Finding::fault("database connections", found, remedy);
    }
    if server.in_use + EACH > server.connections {
        let remedy = "one more process may find no free connection: raise max_connections, or end idle clients";
        return Finding::warning("database connections", found, remedy);
    }
    Finding::ok("database connections", found)
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;
    use std::time::Duration;

    fn server() -> ServerFacts {
        ServerFacts {
            version: 150_018,
            version_text: "15.18".to_owned(),
            encoding: "UTF8".to_owned(),
            order: "C".to_owned(),
            is_standby: false,
            fsync: "on".to_owned(),
            full_page_writes: "on".to_owned(),
            synchronous_commit: "on".to_owned(),
            connections: 97,
            in_use: 12,
        }
    }

    fn verdicts(change: impl Fn(&mut Examined, &mut ServerFacts), processes: u32) -> Vec<(String, Verdict)> {
        let mut server = server();
        let mut examined = Examined {
            answered: Duration::from_millis(3),
            ahead: 4,
            schema: SCHEMA,
            oldest_reader: 0,
            instance: None,
            is_copy: false,
            has_claimed_store: false,
            copying: None,
            engine: EngineFacts::Server(server.clone()),
        };
        change(&mut examined, &mut server);
        if matches!(examined.engine, EngineFacts::Server(_)) {
            examined.engine = EngineFacts::Server(server);
        }
        let place = "postgres://w@db/w".parse().unwrap();
        let findings = judge(&place, &Asked::Answered(Box::new(examined)), processes);
        for finding in &findings {
            assert_eq!(finding.remedy.is_empty(), finding.verdict == Verdict::Ok, "{finding:?}");
        }
        let judged = findings.into_iter().filter(|finding| finding.verdict != Verdict::Ok);
        judged.map(|finding| (finding.check, finding.verdict)).collect()
    }

    #[test]
    fn each_fault_of_a_database_is_told_alone() {
        type Change = fn(&mut Examined, &mut ServerFacts);
        let cases: [(Change, &str, Verdict); 14] = [
            (|_, server| server.version = 120_004, "version", Verdict::Fault),
            (|_, server| server.encoding = "LATIN1".to_owned(), "encoding", Verdict::Fault),
            (|_, server| server.order = "de_DE.UTF-8".to_owned(), "encoding", Verdict::Fault),
            (|_, server| server.is_standby = true, "role", Verdict::Fault),
            (|_, server| server.fsync = "off".to_owned(), "durability", Verdict::Fault),
            (|_, server| server.synchronous_commit = "off".to_owned(), "durability", Verdict::Fault),
            (|examined, _| examined.ahead = -6000, "clock", Verdict::Warning),
            (|examined, _| examined.schema = SCHEMA - 1, "schema", Verdict::Fault),
            (|examined, _| examined.oldest_reader = SCHEMA + 1, "schema", Verdict::Fault),
            (|examined, _| examined.copying = Some("the catalog x".to_owned()), "copy", Verdict::Fault),
            (|_, server| server.connections = 35, "connections", Verdict::Fault),
            (|_, server| server.in_use = 90, "connections", Verdict::Warning),
            (
                |examined, _| {
                    let journal = "memory".to_owned();
                    examined.engine = EngineFacts::File { journal, synchronous: 2, is_free: true };
                },
                "durability",
                Verdict::Warning,
            ),
            (
                |examined, _| {
                    let journal = "wal".to_owned();
                    examined.engine = EngineFacts::File { journal, synchronous: 2, is_free: false };
                },
                "lock",
                Verdict::Warning,
            ),
        ];
        assert!(verdicts(|_, _| {}, 4).is_empty());
        assert!(verdicts(|examined, _| examined.schema = SCHEMA + 1, 4).is_empty());
        for (change, check, verdict) in cases {
            assert_eq!(verdicts(change, 4), [(format!("database {check}"), verdict)]);
        }
        assert_eq!(verdicts(|_, _| {}, 11), [("database connections".to_owned(), Verdict::Fault)]);
    }
}
