//! `wavelume tenants`: makes, lists, changes and closes tenants in the database, also while services run.

use super::failure::Failure;
use super::output::{Table, print, print_json};
use super::runtime::block_on;
use super::site::PlaceArgs;
use crate::api::About;
use crate::catalog::{Act, Catalog, Limit, MOST_WEIGHT, Settled, TenantChange, TenantRow, TenantState};
use crate::jobs::{Archive, Use, check_text};
use crate::trust::Tenant;

/// Action on the tenants of a service.
#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = "A service without keys has one tenant, `default`")]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Make a tenant
    Create(Named),
    /// List tenants with their limits and what they use
    List(List),
    /// Change a tenant's name, limits or share of the workers, or open it again
    Set(Set),
    /// Close a tenant: its requests are refused, its jobs wait, its data are kept
    Close(Close),
}

#[derive(Debug, clap::Args)]
struct Named {
    #[command(flatten)]
    places: PlaceArgs,
    /// Id of the tenant, which never changes: 1 to 40 of a–z, 0–9 and `-`, the first one a letter
    #[arg(value_name = "ID")]
    tenant: Tenant,
    #[command(flatten)]
    change: Change,
}

#[derive(Debug, clap::Args)]
struct Set {
    #[command(flatten)]
    named: Named,
    /// Serve the tenant again after it was closed
    #[arg(long)]
    open: bool,
}

#[derive(Debug, clap::Args)]
struct Close {
    #[command(flatten)]
    places: PlaceArgs,
    /// Id of the tenant
    #[arg(value_name = "ID")]
    tenant: Tenant,
}

#[derive(Debug, clap::Args)]
struct List {
    #[command(flatten)]
    places: PlaceArgs,
    /// Print the tenants as one line of JSON
    #[arg(long)]
    json: bool,
}

/// Properties of a tenant.
#[derive(Debug, clap::Args)]
struct Change {
    /// Name of the tenant, for people; by default its id
    #[arg(long, value_name = "TEXT")]
    name: Option<String>,
    /// Upper bound on the total bytes of the tenant's measurements and materials; `none` for no limit
    #[arg(long, value_name = "BYTES", value_parser = limit)]
    max_bytes: Option<Limit>,
    /// Upper bound on the number of the tenant's materials; `none` for no limit
    #[arg(long, value_name = "N", value_parser = limit)]
    max_materials: Option<Limit>,
    /// Upper bound on the number of the tenant's waiting jobs; `none` for no limit
    #[arg(long, value_name = "N", value_parser = limit)]
    max_queued: Option<Limit>,
    /// Upper bound on the requests of the tenant to each node within a minute; `none` for no limit
    #[arg(long, value_name = "N", value_parser = limit)]
    max_requests: Option<Limit>,
    /// Weight of the tenant when tenants share the workers: with 200 its jobs get twice the share that they get with
    /// 100, the default
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_WEIGHT))]
    weight: Option<u64>,
}

/// Name under which the audit trail records what was done by this command, which has no key of its own.
const ACTOR: &str = "wavelume tenants";

fn limit(text: &str) -> Result<Limit, String> {
    if text == "none" {
        return Ok(Limit(None));
    }
    let number = text.parse::<u64>().ok().filter(|number| i64::try_from(*number).is_ok());
    number.map(|number| Limit(Some(number))).ok_or_else(|| "expected a limit: a whole number, or `none`".to_owned())
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.action {
        Action::Create(args) => block_on(create(args)),
        Action::List(args) => block_on(list(args)),
        Action::Set(args) => {
            let change = TenantChange { state: args.open.then_some(TenantState::Active), ..args.named.change.read()? };
            block_on(change_tenant(&args.named.places, &args.named.tenant, change))
        }
        Action::Close(args) => {
            let change = TenantChange { state: Some(TenantState::Closed), ..TenantChange::default() };
            block_on(change_tenant(&args.places, &args.tenant, change))
        }
    }
}

impl Change {
    fn read(&self) -> Result<TenantChange, Failure> {
        if let Some(name) = &self.name {
            check_text("name", name).map_err(|reason| Failure::usage(format!("--name: {reason}")))?;
        }
        Ok(TenantChange {
            name: self.name.clone(),
            state: None,
            weight: self.weight,
            bytes: self.max_bytes,
            materials: self.max_materials,
            queued: self.max_queued,
            requests: self.max_requests,
        })
    }
}

async fn create(args: &Named) -> Result<(), Failure> {
    let change = args.change.read()?;
    let catalog = open(&args.places, Use::Make).await?;
    let settled = catalog.create_tenant(&args.tenant, &change).await.map_err(Failure::failed)?;
    catalog.close().await;
    tell(&args.tenant, settled)
}

async fn change_tenant(places: &PlaceArgs, tenant: &Tenant, change: TenantChange) -> Result<(), Failure> {
    let catalog = open(places, Use::Change).await?;
    let settled = catalog.change_tenant(tenant, &change).await.map_err(Failure::failed)?;
    if matches!(settled, Settled::Row(_)) {
        let (owner, subject) = (Some(tenant.clone()), Some(tenant.to_string()));
        let detail = Some(change.to_string());
        let act =
            Act { tenant: owner, actor: ACTOR.to_owned(), action: "tenant.change", subject, detail, ..Act::default() };
        catalog.record(&act).await.map_err(Failure::failed)?;
    }
    catalog.close().await;
    tell(tenant, settled)
}

fn tell(tenant: &Tenant, settled: Settled) -> Result<(), Failure> {
    match settled {
        Settled::Row(row) => print(&table(&[*row])),
        Settled::Taken => Err(Failure::failed(format!("the id or the name of the tenant {tenant} is another's"))),
        Settled::Absent => Err(Failure::failed(format!("there is no tenant {tenant}"))),
    }
}

async fn list(args: &List) -> Result<(), Failure> {
    let catalog = open(&args.places, Use::Read).await?;
    let tenants = catalog.tenants().await.map_err(Failure::failed)?;
    catalog.close().await;
    if args.json {
        return print_json(&tenants.into_iter().map(About::of).collect::<Vec<_>>());
    }
    print(&table(&tenants))
}

fn table(tenants: &[TenantRow]) -> String {
    let mut table = Table::new(&["tenant", "state", "weight", "bytes", "materials", "max queued", "name"]);
    let of = |used: u64, limit: Option<u64>| limit.map_or(used.to_string(), |limit| format!("{used} of {limit}"));
    for row in tenants {
        table.row([
            row.id.to_string(),
            row.state.name().to_owned(),
            row.weight.to_string(),
            of(row.bytes, row.quotas.bytes),
            of(row.materials, row.quotas.materials),
            row.quotas.queued.map_or_else(|| "none".to_owned(), |most| most.to_string()),
            row.name.clone(),
        ]);
    }
    table.render()
}

/// Opens the catalog of a service.
async fn open(places: &PlaceArgs, purpose: Use) -> Result<Catalog, Failure> {
    Archive::open_catalog(&places.site(), purpose).await.map_err(Failure::failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_whole_numbers_or_none() {
        assert_eq!((limit("0"), limit("none")), (Ok(Limit(Some(0))), Ok(Limit(None))));
        for wrong in ["", "-1", "1.5", "1k", "9223372036854775808", "None"] {
            assert!(limit(wrong).is_err(), "{wrong}");
        }
    }
}
