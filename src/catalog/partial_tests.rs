//! Tests of uploads that a client may continue after a break.

use super::partial::*;
use super::{Catalog, testing};
use crate::store::{Digest, Object};
use std::time::Duration;

const LIMITS: PartialLimits = PartialLimits {
    all: 3,
    each: 2,
    tenant: 3,
    bytes: 100,
    bytes_each: 60,
    bytes_tenant: 100,
    largest: 50,
    keep: Duration::from_mins(1),
};
const LEASE: Duration = Duration::from_mins(1);

fn upload(id: &str, client: &str, length: Option<u64>) -> NewPartial {
    NewPartial { id: id.to_owned(), client: client.to_owned(), length, metadata: "filename YQ==".to_owned() }
}

async fn begun(catalog: &Catalog, id: &str, length: u64) -> Partial {
    match catalog.begin_partial(&upload(id, "a", Some(length)), &LIMITS).await.unwrap() {
        Begun::Now(partial) => partial,
        other => panic!("{other:?}"),
    }
}

async fn announced(catalog: &Catalog, before: &Partial, bytes: &[u8]) -> Object {
    let part = Object::part(&before.id, before.parts, Digest::of(bytes));
    catalog.intend_part(&part, bytes.len() as u64, LEASE).await.unwrap();
    part
}

#[tokio::test]
async fn a_part_is_added_once_and_by_the_request_that_holds_the_upload() {
    for (catalog, _guard) in testing::catalogs().await {
        let begun = begun(&catalog, "0a", 9).await;
        let Held::Now(held) = catalog.hold_partial("0a", "first", LEASE, Some(0)).await.unwrap() else { panic!() };
        assert!(held.is_held && held.received == 0 && held.metadata == begun.metadata);
        assert_eq!(catalog.hold_partial("0a", "second", LEASE, Some(0)).await.unwrap(), Held::Busy);
        let part = announced(&catalog, &held, b"four").await;
        assert!(catalog.add_part(&held, "second", (&part, 4), None, LIMITS.keep, true).await.unwrap().is_none());
        let added = catalog.add_part(&held, "first", (&part, 4), None, LIMITS.keep, true).await.unwrap().unwrap();
        assert_eq!((added.received, added.parts, added.is_held), (4, 1, false));
        let late = announced(&catalog, &held, b"late").await;
        assert!(catalog.add_part(&held, "first", (&late, 4), None, LIMITS.keep, true).await.unwrap().is_none());
        assert_eq!(catalog.parts_of("0a").await.unwrap(), [(part.clone(), 4)]);
        let found = catalog.hold_partial("0a", "first", LEASE, Some(0)).await.unwrap();
        assert!(matches!(found, Held::Elsewhere(partial) if partial.received == 4));
        // A lease that has run out is taken by another request, and its holder adds nothing any more.
        let Held::Now(old) = catalog.hold_partial("0a", "slow", Duration::ZERO, None).await.unwrap() else { panic!() };
        let Held::Now(held) = catalog.hold_partial("0a", "next", LEASE, Some(4)).await.unwrap() else { panic!() };
        assert!(!catalog.keep_partial("0a", "slow", LEASE).await.unwrap());
        assert!(catalog.keep_partial("0a", "next", LEASE).await.unwrap());
        let second = announced(&catalog, &held, b"fives").await;
        assert!(catalog.add_part(&old, "slow", (&second, 5), None, LIMITS.keep, true).await.unwrap().is_none());
        catalog.add_part(&held, "next", (&second, 5), None, LIMITS.keep, true).await.unwrap().unwrap();
        assert!(catalog.knows(&part).await.unwrap(), "a check of the store does not call it an orphan");

        assert!(catalog.end_partial("0a", Duration::ZERO).await.unwrap());
        assert!(!catalog.end_partial("0a", Duration::ZERO).await.unwrap());
        assert_eq!(catalog.hold_partial("0a", "x", LEASE, None).await.unwrap(), Held::Absent);
        let mut doomed = catalog.take_doomed(9, LEASE).await.unwrap();
        doomed.sort();
        assert_eq!(doomed, [(part, 4), (second, 5)]);
        // The late part goes when its announcement expires.
        testing::expire_intents(&catalog).await;
        assert_eq!(catalog.doom_expired(9, Duration::ZERO).await.unwrap(), 1);
    }
}

#[tokio::test]
async fn a_request_keeps_its_reservation_between_its_parts_and_takes_a_free_one_again() {
    for (catalog, _guard) in testing::catalogs().await {
        begun(&catalog, "0a", 9).await;
        let Held::Now(held) = catalog.hold_partial("0a", "long", LEASE, Some(0)).await.unwrap() else { panic!() };
        let part = announced(&catalog, &held, b"four").await;
        let after = catalog.add_part(&held, "long", (&part, 4), None, LIMITS.keep, false).await.unwrap().unwrap();
        assert_eq!((after.received, after.parts, after.is_held), (4, 1, true));
        assert_eq!(catalog.hold_partial("0a", "other", LEASE, Some(4)).await.unwrap(), Held::Busy);
        // The database stood still for longer than the lease.
        let stall = "UPDATE uploads SET lease_until = 1 WHERE id = '0a'";
        sqlx::query(stall).execute(&catalog.pool).await.unwrap();
        assert!(catalog.keep_partial("0a", "long", LEASE).await.unwrap());
        assert_eq!(catalog.hold_partial("0a", "other", LEASE, Some(4)).await.unwrap(), Held::Busy);
        let second = announced(&catalog, &after, b"fives").await;
        let whole = catalog.add_part(&after, "long", (&second, 5), None, LIMITS.keep, true).await.unwrap().unwrap();
        assert_eq!((whole.received, whole.parts, whole.is_held), (9, 2, false));
        assert_eq!(catalog.parts_of("0a").await.unwrap(), [(part, 4), (second, 5)]);
    }
}

#[tokio::test]
async fn an_upload_is_kept_from_its_first_byte_on() {
    const DAY: i64 = 24 * 3_600_000;
    let limits = PartialLimits { keep: Duration::from_hours(24), ..LIMITS };
    for (catalog, _guard) in testing::catalogs().await {
        let begun = catalog.begin_partial(&upload("0a", "a", Some(9)), &limits).await.unwrap();
        let Begun::Now(begun) = begun else { panic!("{begun:?}") };
        let Held::Now(held) = catalog.hold_partial("0a", "x", LEASE, Some(0)).await.unwrap() else { panic!() };
        assert_eq!(held.expires_ms, begun.expires_ms);
        // While the first bytes arrive, it lasts as long as its reservation.
        assert!(catalog.keep_partial("0a", "x", Duration::from_hours(1)).await.unwrap());
        let kept = catalog.partial("0a").await.unwrap().unwrap().expires_ms;
        assert!(kept > begun.expires_ms && kept < begun.expires_ms + DAY / 2);
        let part = announced(&catalog, &held, b"four").await;
        let added = catalog.add_part(&held, "x", (&part, 4), None, limits.keep, true).await.unwrap().unwrap();
        assert!(added.expires_ms > begun.expires_ms + DAY / 2);
        // A later part changes nothing about it.
        let Held::Now(held) = catalog.hold_partial("0a", "y", LEASE, Some(4)).await.unwrap() else { panic!() };
        let second = announced(&catalog, &held, b"fives").await;
        let last = catalog.add_part(&held, "y", (&second, 5), None, limits.keep, true).await.unwrap().unwrap();
        assert_eq!((held.expires_ms, last.expires_ms), (added.expires_ms, added.expires_ms));
    }
}

#[tokio::test]
async fn limits_hold_for_one_client_and_for_all() {
    for (catalog, _guard) in testing::catalogs().await {
        let begin = async |id: &str, client: &str, length| {
            catalog.begin_partial(&upload(id, client, length), &LIMITS).await.unwrap()
        };
        assert!(matches!(begin("1", "a", Some(20)).await, Begun::Now(_)));
        assert_eq!(begin("2", "a", None).await, Begun::TooLarge(Bound::Client), "of unknown length");
        assert!(matches!(begin("2", "a", Some(40)).await, Begun::Now(_)));
        assert_eq!(begin("3", "a", Some(0)).await, Begun::TooMany(Bound::Client));
        assert_eq!(begin("3", "b", Some(50)).await, Begun::TooLarge(Bound::Tenant));
        assert!(matches!(begin("3", "b", Some(40)).await, Begun::Now(_)));
        assert_eq!(begin("4", "c", Some(0)).await, Begun::TooMany(Bound::Tenant));
        sqlx::query("UPDATE uploads SET expires_at = 1 WHERE id = '3'").execute(&catalog.pool).await.unwrap();
        assert!(matches!(begin("4", "c", Some(0)).await, Begun::Now(_)), "an expired one does not count");
        assert_eq!(catalog.hold_partial("3", "x", LEASE, None).await.unwrap(), Held::Expired);
        assert_eq!(catalog.forget_partials(LEASE).await.unwrap(), 1);
    }
}

#[tokio::test]
async fn uploads_of_one_tenant_neither_fill_an_address_nor_the_service_for_another() {
    let limits = PartialLimits { all: 4, bytes: 140, ..LIMITS };
    for (mine, _guard) in testing::catalogs().await {
        let theirs = testing::other(&mine, "lab").await;
        let begin = async |catalog: &Catalog, id: &str, client: &str, length| {
            catalog.begin_partial(&upload(id, client, Some(length)), &limits).await.unwrap()
        };
        for (id, client) in [("1", "a"), ("2", "a"), ("3", "b")] {
            assert!(matches!(begin(&mine, id, client, 30).await, Begun::Now(_)));
        }
        assert_eq!(begin(&mine, "4", "c", 30).await, Begun::TooMany(Bound::Tenant));
        assert!(matches!(begin(&theirs, "4", "a", 20).await, Begun::Now(_)), "from the same address");
        assert_eq!(begin(&theirs, "5", "a", 0).await, Begun::TooMany(Bound::All));
        sqlx::query("UPDATE uploads SET expires_at = 1 WHERE id = '3'").execute(&mine.pool).await.unwrap();
        assert_eq!(begin(&mine, "5", "c", 50).await, Begun::TooLarge(Bound::Tenant));
    }
}
