//! `wavelume keys`: makes, lists and revokes access keys in the database, also while services run.

use super::failure::Failure;
use super::output::{Table, print, print_json, warn};
use super::runtime::block_on;
use super::settings::AccessSettings;
use super::site::PlaceArgs;
use crate::api::{AccessKey, MadeKey};
use crate::catalog::{Act, AddedKey, Catalog, NewKey, Revoked};
use crate::jobs::date;
use crate::jobs::{Archive, Unit, Use, WorkConfig, check_text};
use crate::trust::{Key, KeyId, Scopes, Signer, Tenant};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Action on the access keys of a service.
#[derive(Debug, clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "A key is printed once. The database holds a hash, from which nobody can make the key again"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Make a key and print it
    Create(Create),
    /// List keys, newest first
    List(List),
    /// Revoke keys; running services refuse them within five seconds
    Revoke(Revoke),
    /// Print a new key that no database knows, for the variable `WAVELUME_BOOTSTRAP_KEY`
    Generate,
}

#[derive(Debug, clap::Args)]
struct Create {
    #[command(flatten)]
    places: PlaceArgs,
    #[command(flatten)]
    settings: AccessSettings,
    /// Tenant for which the key acts
    #[arg(long, value_name = "ID", default_value_t)]
    tenant: Tenant,
    /// Scopes of the key, with commas between: read, write, jobs, tenant (keys and audit trail of its tenant), instance
    /// (the whole service)
    #[arg(long, value_name = "LIST", default_value = "read,write,jobs")]
    scopes: Scopes,
    /// Name of the key, to recognise it in lists
    #[arg(long, value_name = "TEXT")]
    name: Option<String>,
    /// Time for which the key is valid, such as 12h or 90d; by default the setting `key-age`, which is also the most
    #[arg(long, value_name = "TIME", value_parser = life)]
    expires: Option<Duration>,
    /// Print the key and its description as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct List {
    #[command(flatten)]
    places: PlaceArgs,
    /// List only the keys of this tenant
    #[arg(long, value_name = "ID")]
    tenant: Option<Tenant>,
    /// Print the keys as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct Revoke {
    #[command(flatten)]
    places: PlaceArgs,
    /// Ids of the keys to revoke, as `wavelume keys list` shows them
    #[arg(value_name = "KEY", required = true)]
    keys: Vec<KeyId>,
}

/// Name under which keys and the audit trail record what was done by this command, which has no key of its own.
const ACTOR: &str = "wavelume keys";

/// Number of access keys that one query reads from the database. Raising it needs fewer queries and more memory.
const PAGE: usize = 1000;

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.action {
        Action::Create(args) => block_on(create(args)),
        Action::List(args) => block_on(list(args)),
        Action::Revoke(args) => block_on(revoke(args)),
        Action::Generate => print(&format!("{}\n", new_key()?.reveal())),
    }
}

fn new_key() -> Result<Key, Failure> {
    Key::generate().map_err(Failure::failed)
}

/// Parses a duration such as `12h` or `90d`.
fn life(text: &str) -> Result<Duration, String> {
    let millis = Unit::Time.parse(text).filter(|millis| *millis >= 1000);
    millis.map(Duration::from_millis).ok_or_else(|| "expected a time such as 12h or 90d, at least 1s".to_owned())
}

async fn create(args: &Create) -> Result<(), Failure> {
    let mut config = WorkConfig::new(&args.places.directory);
    args.settings.apply(&mut config);
    let most = config.limits.key_age;
    let life = args.expires.unwrap_or(most);
    if life > most {
        let (found, most) = (in_words(life), in_words(most));
        return Err(Failure::usage(format!("--expires: found {found}, expected at most {most} (--key-age)")));
    }
    if let Some(name) = &args.name {
        check_text("name", name).map_err(|reason| Failure::usage(format!("--name: {reason}")))?;
    }
    let catalog = open(&args.places, Use::Make).await?;
    let key = new_key()?;
    let verifier = Signer::of(&key).and_then(|signer| signer.verifier()).map_err(Failure::failed)?;
    let new = NewKey {
        id: key.id(),
        tenant: args.tenant.clone(),
        name: args.name.clone().unwrap_or_default(),
        hash: key.secret().hash(),
        verifier: Some(verifier),
        scopes: args.scopes,
        life,
        created_by: ACTOR.to_owned(),
    };
    let act = Act { detail: Some(new.scopes.to_string()), ..act(Some(args.tenant.clone()), "key.create", key.id()) };
    let limit = config.limits.keys_each;
    let added = catalog.add_key(&new, limit, &act).await.map_err(Failure::failed)?;
    catalog.close().await;
    match added {
        AddedKey::Row(row) if args.json => print_json(&MadeKey::of(&key, *row)),
        AddedKey::Row(row) => {
            print(&format!("{}\n", key.reveal()))?;
            warn(&format!(
                "this is the only time that the key is shown; it has the scopes {} for the tenant {} and expires on {}",
                row.scopes,
                row.tenant,
                day(row.expires_ms)
            ));
            Ok(())
        }
        AddedKey::NoTenant => Err(Failure::usage(format!("--tenant: there is no tenant {}", args.tenant))),
        AddedKey::Taken => Err(Failure::failed("the random id of the new key is already taken: try again")),
        AddedKey::Full(valid) => {
            let tenant = &args.tenant;
            Err(Failure::failed(format!("the tenant {tenant} has {valid} of {limit} valid keys (--keys-each)")))
        }
        AddedKey::Ended(all) => {
            let tenant = &args.tenant;
            let reason = "ended ones are forgotten after 30 days, or give a larger --keys-each";
            Err(Failure::failed(format!("the tenant {tenant} has {all} keys, valid and ended: {reason}")))
        }
    }
}

async fn list(args: &List) -> Result<(), Failure> {
    let catalog = open(&args.places, Use::Read).await?;
    let (mut keys, mut after) = (Vec::new(), None);
    loop {
        let page = catalog.keys(args.tenant.as_ref(), after, PAGE).await.map_err(Failure::failed)?;
        keys.extend(page.items);
        after = page.next;
        if after.is_none() {
            break;
        }
    }
    catalog.close().await;
    if args.json {
        return print_json(&keys.into_iter().map(AccessKey::of).collect::<Vec<_>>());
    }
    let mut table = Table::new(&["key", "tenant", "scopes", "state", "expires", "last used", "name"]);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as i64);
    for key in &keys {
        let state = match (key.revoked_ms, key.expires_ms) {
            (Some(_), _) => "revoked",
            (None, Some(expires)) if expires <= now => "expired",
            _ => "valid",
        };
        table.row([
            key.id.to_string(),
            key.tenant.to_string(),
            key.scopes.to_string(),
            state.to_owned(),
            day(key.expires_ms),
            day(key.used_ms),
            key.name.clone(),
        ]);
    }
    print(&if keys.is_empty() { "no keys\n".to_owned() } else { table.render() })
}

async fn revoke(args: &Revoke) -> Result<(), Failure> {
    let catalog = open(&args.places, Use::Change).await?;
    let mut unknown = Vec::new();
    for id in &args.keys {
        let revoked = catalog.revoke_key(*id, None, &act(None, "key.revoke", *id)).await.map_err(Failure::failed)?;
        if revoked == Revoked::Done {
            print(&format!("{id}  revoked\n"))?;
        } else {
            unknown.push(id.to_string());
        }
    }
    catalog.close().await;
    match unknown.as_slice() {
        [] => Ok(()),
        [id] => Err(Failure::failed(format!("there is no key {id}"))),
        ids => Err(Failure::failed(format!("there are no keys with the ids {}", ids.join(", ")))),
    }
}

/// Opens the catalog of a service.
async fn open(places: &PlaceArgs, purpose: Use) -> Result<Catalog, Failure> {
    Archive::open_catalog(&places.site(), purpose).await.map_err(Failure::failed)
}

fn act(tenant: Option<Tenant>, action: &'static str, id: KeyId) -> Act {
    Act { tenant, actor: ACTOR.to_owned(), action, subject: Some(id.to_string()), ..Act::default() }
}

/// Formats a time, in milliseconds since the Unix epoch, as day and minute in UTC: `2026-11-26 05:40`.
fn day(ms: Option<i64>) -> String {
    ms.map_or_else(|| "never".to_owned(), |ms| date(ms.div_euclid(1000)))
}

fn in_words(time: Duration) -> String {
    match time.as_secs() {
        seconds if seconds % 86_400 == 0 => format!("{}d", seconds / 86_400),
        seconds if seconds % 3600 == 0 => format!("{}h", seconds / 3600),
        seconds => format!("{seconds}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_days_too() {
        assert_eq!(life("90d"), Ok(Duration::from_hours(90 * 24)));
        assert_eq!(life("12h"), Ok(Duration::from_hours(12)));
        for wrong in ["0d", "-1d", "999ms", "soon", "999999999999999999d"] {
            assert!(life(wrong).is_err(), "{wrong}");
        }
        assert_eq!([in_words(Duration::from_hours(48)), in_words(Duration::from_mins(90))], ["2d", "5400s"]);
    }

    #[test]
    fn days_are_those_of_the_calendar() {
        for (ms, expected) in [
            (0, "1970-01-01 00:00"),
            (951_782_399_999, "2000-02-28 23:59"),
            (951_782_400_000, "2000-02-29 00:00"),
            (951_868_800_000, "2000-03-01 00:00"),
            (1_798_675_200_000, "2026-12-31 00:00"),
            (4_107_542_399_000, "2100-02-28 23:59"),
            (4_107_542_400_000, "2100-03-01 00:00"),
        ] {
            assert_eq!(day(Some(ms)), expected);
        }
        assert_eq!(day(None), "never");
    }
}
