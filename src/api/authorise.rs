//! Step that asks who calls before any handler or cache: a request needs a key with the scope of its route.

use super::caller::{Actor, Caller};
use super::decisions::{Decision, Judged, KeyState, Rights};
use super::expiring::{Expiring, Rest, SHORT, ended};
use super::guard::{AuthMode, Verdict};
use super::layers::{refuse, wrong_method};
use super::needs::{self, Need};
use super::places::Peer;
use super::problem::{Kind, Problem};
use super::resumable::carried_out;
use super::route::Route;
use super::seen::ForAll;
use super::state::App;
use super::words::shown;
use crate::catalog::Act;
use crate::jobs::unix_seconds;
use crate::trust::{self, Grant, Key, KeyId, Link, Reach, Scope, Scopes, SecretHash, Tenant, Token};
use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::response::{IntoResponse, Response};
use std::time::{Duration, Instant};

/// Names of headers by which a proxy tells that it passes a request on.
const PASSED_ON: [&str; 3] = ["forwarded", "x-forwarded-for", "via"];

/// Upper bound in characters on the subject of a record in the audit trail: longer than any id.
const LONGEST_SUBJECT: usize = 80;

/// Reason to refuse the key, token or link that a request presents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Refused {
    /// The header `Authorization` has another form than `Bearer KEY`.
    Form,
    /// The presented text is not an access key; most likely a character is wrong or missing.
    Mistyped,
    /// No access key has the presented id, or its secret differs from the presented one.
    Unknown(Option<KeyId>),
    /// The presented access key has expired.
    Expired,
    /// The presented access key was revoked.
    Revoked,
    /// The presented token or link is not valid. Holds the reason, and the id of the key that it names, if that could
    /// be read.
    Signed(trust::Refused, Option<KeyId>),
}

/// Step that identifies the caller of a request before the steps `next`, and refuses the request if its route needs a
/// scope that the caller lacks. If the rights of the caller end while the steps run, they are dropped, so that nothing
/// is named for it any more.
pub(crate) async fn authorise<F: Future<Output = Response>>(
    app: &App,
    request: Request,
    next: impl FnOnce(Request) -> F,
) -> Response {
    let (mut parts, body) = request.into_parts();
    let mut watched = None;
    match caller(app, &parts).await {
        Ok(Some(caller)) => {
            watched = caller.watched();
            parts.extensions.insert(caller);
        }
        // No route: the fallback answers.
        Ok(None) => {}
        Err(problem) => {
            count(&problem);
            // Whoever has no place left is refused before the rest of the request has come.
            return match app.guard.stranger(Peer::of_extensions(&parts.extensions)) {
                Ok(_place) => refuse(Request::from_parts(parts, body), problem).await,
                Err(_) => problem.into_response(),
            };
        }
    }
    let recorded = (app.guard.mode != AuthMode::Off).then(|| act(&parts)).flatten();
    let (rest, body) = if watched.is_some() { Rest::of(body) } else { (None, body) };
    let mut response = tokio::select! {
        biased;
        response = next(Request::from_parts(parts, body)) => response,
        problem = ended(app, watched) => {
            count(&problem);
            if let Some(rest) = rest {
                rest.discard(app.engine.limits.idle);
            }
            return problem.into_response();
        }
    };
    if let Some(act) = recorded.filter(|_| response.status().is_success()) {
        record(app, response.headers(), act).await;
    }
    if app.guard.mode != AuthMode::Off {
        // A cache on the way may give an answer to others only if they may ask for it themselves, without a key.
        let for_all = response.extensions().get::<ForAll>().is_some();
        if for_all && watched.is_none() {
            keep_short(response.headers_mut());
        } else {
            keep_private(response.headers_mut());
        }
    }
    let is_short = response.body().size_hint().upper().is_some_and(|bytes| bytes <= SHORT);
    match watched.filter(|_| !is_short) {
        Some(watched) => {
            let app = app.clone();
            let lost = async move { drop(ended(&app, Some(watched)).await) };
            response.map(|body| Body::new(Expiring::new(body, lost)))
        }
        None => response,
    }
}

/// Counts a request that was refused for its key.
fn count(problem: &Problem) {
    metrics::counter!("wavelume_unauthorised_total", "problem" => problem.code()).increment(1);
}

/// Returns the audit-trail record of a request; `None` if requests for its route are not recorded, or if their handler
/// records them itself.
fn act(parts: &Parts) -> Option<Act> {
    let action = needs::act(parts.method.as_str(), Route::of(&parts.extensions)?)?;
    let last = parts.uri.path().rsplit('/').next().filter(|_| parts.method != Method::POST);
    let subject = last.map(|id| shown(id, LONGEST_SUBJECT));
    Some(Act { subject, ..parts.extensions.get::<Caller>()?.act(action, "") })
}

/// Records a successful request in the audit trail. If the request has made something new, the header `Location` of the
/// answer names it.
async fn record(app: &App, headers: &HeaderMap, act: Act) {
    let made = headers.get(header::LOCATION).and_then(|value| value.to_str().ok()?.rsplit('/').next());
    let subject = made.map(str::to_owned).or(act.subject);
    app.record(&Act { subject, ..act }).await;
}

/// Identifies the caller of a request, and checks that it may use the route. Returns `None` if no route has the path.
async fn caller(app: &App, parts: &Parts) -> Result<Option<Caller>, Problem> {
    let caller = |tenant, scopes, actor| Ok(Some(Caller::new(tenant, scopes, actor, &parts.extensions)));
    if app.guard.mode == AuthMode::Off {
        if let Some(name) =
            PASSED_ON.into_iter().find(|name| !app.guard.is_insecure && parts.headers.contains_key(*name))
        {
            return Err(passed_on(name));
        }
        // A test may have said who calls.
        if parts.extensions.get::<Caller>().is_some() {
            return Ok(None);
        }
        return caller(Tenant::default(), Scopes::all(), Actor::Off);
    }
    let Some(path) = Route::of(&parts.extensions) else { return Ok(None) };
    let Some(need) = needs::need(parts.method.as_str(), path) else {
        return Err(wrong_method(&parts.method).with(header::ALLOW, &needs::methods(path)));
    };
    if need == Need::Public {
        return caller(Tenant::nobody(), Scopes::none(), Actor::Anonymous);
    }
    let query = parts.uri.query().unwrap_or_default();
    let shown = if parts.headers.contains_key(header::AUTHORIZATION) {
        by_header(app, parts).await?
    } else if Link::is_like(parts.uri.path(), query) {
        by_link(app, parts, query).await?
    } else if app.guard.mode == AuthMode::KeysAndAnonymousRead && need == Need::Material {
        // Whoever owns nothing sees what is public.
        let scopes = [Scope::Read].into_iter().collect();
        Shown { actor: Actor::Anonymous, tenant: Tenant::nobody(), scopes, reach: Reach::All, until: None }
    } else {
        let detail = "the request has no key, expected the header `Authorization: Bearer KEY`";
        return Err(Problem::unauthorised(detail));
    };
    let Shown { actor, tenant, scopes, reach, until } = shown;
    if !need.allows(scopes) {
        let needed = need.name();
        let detail = format!("the {actor} has the scopes {scopes}, expected the scope `{needed}` for this resource");
        return Err(Problem::new(Kind::MissingScope, detail));
    }
    Ok(Some(Caller::new(tenant, scopes, actor, &parts.extensions).limited(reach, until)))
}

/// Identity and rights of a caller, as its key, token or link proves them.
struct Shown {
    actor: Actor,
    tenant: Tenant,
    scopes: Scopes,
    reach: Reach,
    /// Time at which the rights of the caller end, in Unix seconds; `None` if they do not end.
    until: Option<u64>,
}

impl Shown {
    /// Builds the rights that a verified token or link gives, in the tenant of its key.
    fn granted(actor: Actor, grant: Grant, rights: &Rights) -> Self {
        let Grant { scopes, reach, expires, .. } = grant;
        Self { actor, tenant: rights.tenant.clone(), scopes, reach, until: Some(expires) }
    }
}

/// Returns the rights of the key or token in the header `Authorization`.
async fn by_header(app: &App, parts: &Parts) -> Result<Shown, Problem> {
    let refuse = |reason| refused(app, parts, reason);
    let text = bearer(&parts.headers).map_err(refuse)?;
    if Token::is_like(text) {
        let now = unix_seconds();
        let token = Token::read(text, now).map_err(|reason| refuse(Refused::Signed(reason, None)))?;
        let verify = |facts: &trust::KeyFacts| token.verify(facts, now);
        let (grant, rights) = signed(app, parts, token.key(), verify).await?;
        if !grant.allows(carried_out(parts), parts.uri.path()) {
            let methods = grant.methods;
            let detail = match grant.reach {
                Reach::All => format!("the token allows only {methods}, expected a request with such a method"),
                Reach::One(id) => {
                    format!("the token allows only {methods} at /v1/materials/{id} and below, expected such a request")
                }
            };
            return Err(Problem::new(Kind::MissingScope, detail));
        }
        return Ok(Shown::granted(Actor::Token(grant.key), grant, &rights));
    }
    let key = text.parse::<Key>().map_err(|_| refuse(Refused::Mistyped))?;
    let rights = rights(app, parts, key.id(), Some(key.secret().hash()), Refused::Unknown(Some(key.id()))).await?;
    // Only its owner knows the key, so that this is no guess.
    match rights.state {
        KeyState::Valid => {}
        KeyState::Expired => return Err(unauthorised(Refused::Expired)),
        KeyState::Revoked => return Err(unauthorised(Refused::Revoked)),
        KeyState::Closed => return Err(closed(&rights.tenant)),
    }
    let (tenant, scopes, until) = (rights.tenant.clone(), rights.scopes, rights.until());
    Ok(Shown { actor: Actor::Key(key.id()), tenant, scopes, reach: Reach::All, until })
}

/// Verifies the signed link of a request. Returns the rights that the link gives.
async fn by_link(app: &App, parts: &Parts, query: &str) -> Result<Shown, Problem> {
    let now = unix_seconds();
    let link = Link::read(parts.uri.path(), query, now);
    let link = link.map_err(|reason| refused(app, parts, Refused::Signed(reason, None)))?;
    let verify = |facts: &trust::KeyFacts| link.verify(facts, now);
    let (grant, rights) = signed(app, parts, link.key(), verify).await?;
    if !grant.allows(parts.method.as_str(), parts.uri.path()) {
        return Err(Problem::new(Kind::MissingScope, "the signed link allows only GET, expected a GET request"));
    }
    Ok(Shown::granted(Actor::Link(grant.key), grant, &rights))
}

/// Verifies a token or a link that names the key `id`.
async fn signed(
    app: &App,
    parts: &Parts,
    id: KeyId,
    verify: impl Fn(&trust::KeyFacts) -> Result<Grant, trust::Refused>,
) -> Result<(Grant, Decision), Problem> {
    // A key that does not exist is told like a signature that does not match.
    let reason = |reason| Refused::Signed(reason, Some(id));
    let rights = rights(app, parts, id, None, reason(trust::Refused::Forged)).await?;
    let verified = rights.facts().ok_or(trust::Refused::Forged).and_then(|facts| verify(&facts));
    let grant = verified.map_err(|found| refused(app, parts, reason(found)))?;
    match rights.state {
        // Revoked keys were refused with the signature.
        KeyState::Valid | KeyState::Revoked => Ok((grant, rights)),
        // The database has the better clock.
        KeyState::Expired => Err(unauthorised(reason(trust::Refused::KeyExpired))),
        KeyState::Closed => Err(closed(&rights.tenant)),
    }
}

/// Returns the rights of an access key, if it exists and, where a hash is given, its secret has this hash. Otherwise
/// the caller is refused for the reason `wrong`.
async fn rights(
    app: &App,
    parts: &Parts,
    id: KeyId,
    hash: Option<SecretHash>,
    wrong: Refused,
) -> Result<Decision, Problem> {
    let peer = Peer::of_extensions(&parts.extensions);
    match app.guard.judge(&app.engine.archive.catalog, peer, id, hash).await? {
        Verdict::Judged(Judged::Known(rights), _) => Ok(rights),
        Verdict::Judged(Judged::Wrong, held) => {
            let problem = refused(app, parts, wrong);
            // The next look-up of the address begins after the wrong key was counted.
            drop(held);
            Err(problem)
        }
        Verdict::Unasked(wait) => Err(too_many(peer, wait)),
        Verdict::Late => {
            let detail = "the key was not checked, as keys from this address are still being looked up; try again soon";
            Err(Problem::new(Kind::Unavailable, detail))
        }
        Verdict::Full(full) => Err(full.into()),
    }
}

/// Returns the text after `Bearer` in the header `Authorization`, of which a request may have only one.
fn bearer(headers: &HeaderMap) -> Result<&str, Refused> {
    let mut fields = headers.get_all(header::AUTHORIZATION).iter();
    let (Some(field), None) = (fields.next(), fields.next()) else { return Err(Refused::Form) };
    let (scheme, text) = field.to_str().ok().and_then(|text| text.split_once(' ')).ok_or(Refused::Form)?;
    if scheme.eq_ignore_ascii_case("bearer") { Ok(text.trim()) } else { Err(Refused::Form) }
}

/// Builds the error response to a refused key, token or link. Counts it against the client address if it may be a
/// guess.
fn refused(app: &App, parts: &Parts, reason: Refused) -> Problem {
    if !reason.is_guess() {
        return unauthorised(reason);
    }
    let (peer, now) = (Peer::of_extensions(&parts.extensions), Instant::now());
    let guesses = &app.guard.guesses;
    if let Some(wait) = guesses.wait(peer, now) {
        return too_many(peer, wait);
    }
    let counted = guesses.count(peer, now);
    if let Some(left_out) = counted.recorded {
        let caller = Caller::new(Tenant::nobody(), Scopes::none(), Actor::Anonymous, &parts.extensions);
        let (subject, reason) = (reason.key().map_or_else(|| "none".to_owned(), |id| id.to_string()), reason.text());
        let then = counted.wait.map(|wait| format!("; refused with 429 for {} s", wait.as_secs() + 1));
        let others = (left_out > 0).then(|| format!("; {left_out} earlier wrong keys were not recorded"));
        let detail = Some(format!("{reason}{}{}", then.unwrap_or_default(), others.unwrap_or_default()));
        tracing::warn!(%peer, key = subject, reason, "a key was refused");
        // The wrong key may be anybody's, so that the record belongs to no tenant.
        let act = Act { tenant: None, detail, ..caller.act("key.refused", subject) };
        let catalog = app.engine.archive.catalog.clone();
        tokio::spawn(async move {
            if let Err(error) = catalog.record(&act).await {
                tracing::warn!(%error, "the refusal of a key was not recorded in the audit trail");
            }
        });
    }
    unauthorised(reason)
}

/// Builds the error response to a key that was not looked up, because its client address has sent too many wrong ones
/// and may try again after the time `wait`.
fn too_many(peer: Peer, wait: Duration) -> Problem {
    // Rounded up: whoever asks again after this time is answered.
    let seconds = wait.as_secs() + 1;
    let detail = format!("{peer} has sent too many wrong keys; try again in {seconds} s");
    Problem::new(Kind::TooManyRequests, detail).with(header::RETRY_AFTER, &seconds.to_string())
}

fn unauthorised(reason: Refused) -> Problem {
    Problem::unauthorised(reason.text())
}

fn closed(tenant: &Tenant) -> Problem {
    Problem::new(
        Kind::MissingScope,
        format!("the tenant {tenant} is closed; whoever administers the service can open it"),
    )
}

fn passed_on(name: &str) -> Problem {
    let detail = format!(
        "the request has the header {name}, so it came through a proxy, behind which anybody may be; start the service \
         with --auth keys, or with --insecure if the proxy decides who may ask"
    );
    Problem::new(Kind::PassedOn, detail)
}

/// Value of the header `Cache-Control` of answers to those without a key. Caches ask again after five minutes, with the
/// entity tag: a material that is private again is gone from them by then. Raising the time spares requests, and lets
/// caches show such a material for longer.
const SHARED: HeaderValue = HeaderValue::from_static("public, max-age=300, must-revalidate");

/// Bounds the time for which caches keep an answer about a public material, which may become private again.
fn keep_short(headers: &mut HeaderMap) {
    if headers.get(header::CACHE_CONTROL).is_some_and(|value| value.as_bytes().starts_with(b"public")) {
        headers.insert(header::CACHE_CONTROL, SHARED);
    }
}

/// Sets headers of an answer that is for one caller, so that shared caches do not store it for others.
fn keep_private(headers: &mut HeaderMap) {
    headers.append(header::VARY, HeaderValue::from_static("authorization"));
    let public = headers.get(header::CACHE_CONTROL).and_then(|value| value.to_str().ok()?.strip_prefix("public"));
    if let Some(private) = public.and_then(|rest| HeaderValue::from_str(&format!("private{rest}")).ok()) {
        headers.insert(header::CACHE_CONTROL, private);
    }
}

impl Refused {
    /// Returns true if the refused caller may have guessed a secret; false if it has shown a right secret or signature,
    /// or something that nobody needs to guess.
    fn is_guess(self) -> bool {
        use trust::Refused::{Forged, NotAToken};
        match self {
            Self::Mistyped | Self::Unknown(_) => true,
            // A browser or a proxy sends other headers `Authorization`, and a page may hold any address.
            Self::Form | Self::Expired | Self::Revoked => false,
            Self::Signed(reason, _) => matches!(reason, Forged | NotAToken),
        }
    }

    /// Returns the id of the key that the refused caller has named, if any.
    fn key(self) -> Option<KeyId> {
        match self {
            Self::Unknown(key) | Self::Signed(_, key) => key,
            Self::Form | Self::Mistyped | Self::Expired | Self::Revoked => None,
        }
    }

    fn text(self) -> String {
        let text = match self {
            Self::Form => "found another form of the header Authorization, expected one `Authorization: Bearer KEY`",
            Self::Mistyped => "found a mistyped or cut key, expected all 65 characters of one",
            Self::Unknown(_) => "there is no such key",
            Self::Expired => "the key has expired: make another one",
            Self::Revoked => "the key was revoked: make another one",
            Self::Signed(reason, _) => return reason.to_string(),
        };
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::content::FOR_GOOD;

    #[test]
    fn one_bearer_is_read_in_any_case() {
        let found = |fields: &[&'static [u8]]| {
            let mut headers = HeaderMap::new();
            for field in fields {
                headers.append(header::AUTHORIZATION, HeaderValue::from_bytes(field).unwrap());
            }
            bearer(&headers).map(str::to_owned)
        };
        for good in [&b"Bearer x_y"[..], b"bearer x_y", b"BEARER  x_y "] {
            assert_eq!(found(&[good]), Ok("x_y".to_owned()));
        }
        for bad in
            [&[][..], &[&b"x_y"[..]], &[b"Basic x_y"], &[b"Bearer"], &[b"Bearer \xff"], &[b"Bearer a", b"Bearer a"]]
        {
            assert_eq!(found(bad), Err(Refused::Form), "{bad:?}");
        }
    }

    #[test]
    fn answers_to_a_caller_are_private() {
        let mut headers = HeaderMap::new();
        headers.insert(header::CACHE_CONTROL, FOR_GOOD);
        keep_private(&mut headers);
        assert_eq!(headers[header::CACHE_CONTROL], "private, max-age=31536000, immutable");
        assert_eq!(headers[header::VARY], "authorization");
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        keep_private(&mut headers);
        assert_eq!(headers[header::CACHE_CONTROL], "no-store");
    }

    #[test]
    fn answers_to_everybody_are_kept_for_minutes() {
        let mut headers = HeaderMap::new();
        keep_short(&mut headers);
        assert!(headers.is_empty());
        for (kept, then) in [(FOR_GOOD, SHARED), (HeaderValue::from_static("no-store"), "no-store".parse().unwrap())] {
            headers.insert(header::CACHE_CONTROL, kept);
            keep_short(&mut headers);
            assert_eq!(headers[header::CACHE_CONTROL], then);
        }
    }
}
