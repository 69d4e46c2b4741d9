//! The page of a review, served to this machine alone. Who decides must know the token
//! that the command printed; a page of another origin, or a name that somebody made
//! point here (DNS rebinding), is refused before anything is read.

use super::{Decision, Review};
use axum::{
    Json, Router,
    body::Body,
    extract::{DefaultBodyLimit, Query, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use std::{
    io,
    net::{Ipv4Addr, SocketAddr},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::{net::TcpListener, sync::Notify};

/// The header that decisions carry the token in.
const TOKEN: &str = "x-aogauge-token";
/// Longest request, bytes: a reason and a name.
const LONGEST: usize = 64 << 10;

/// Why a review could not be served.
#[derive(Debug, thiserror::Error)]
pub enum ReviewError {
    /// The system gives no port.
    #[error("cannot serve the review at {address}: {source}")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// Why not.
        source: io::Error,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers for the token of the review: {0}")]
    Random(String),
}

/// How a review ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// By the button on the page.
    Finished,
    /// By Ctrl-C.
    Interrupted,
}

#[derive(Clone)]
struct Served {
    review: Arc<Mutex<Review>>,
    token: Arc<str>,
    port: u16,
    finished: Arc<Notify>,
}

impl Served {
    fn review(&self) -> MutexGuard<'_, Review> {
        // Every change of it is whole, so one that panicked left nothing half done.
        self.review.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Compares hashes, so that the time it takes tells nothing of the token.
    fn knows(&self, token: &str) -> bool {
        Sha256::digest(token.as_bytes()) == Sha256::digest(self.token.as_bytes())
    }
}

/// Serves a review on 127.0.0.1, on `port` or on any free one where that is 0, until it
/// is finished or interrupted. `ready` is told the address, which holds the token.
///
/// # Errors
/// Where the port cannot be had.
pub fn serve(review: Review, port: u16, ready: impl FnOnce(&str)) -> Result<(Ended, Review), ReviewError> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let fail = |source| ReviewError::Listen { address, source };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(fail)?;
    let token = token()?;
    runtime.block_on(async {
        let listener = TcpListener::bind(address).await.map_err(fail)?;
        let own = listener.local_addr().map_err(fail)?;
        let served = Served {
            review: Arc::new(Mutex::new(review)),
            token: token.as_str().into(),
            port: own.port(),
            finished: Arc::new(Notify::new()),
        };
        let end = Arc::new(Mutex::new(Ended::Interrupted));
        let (finished, ended) = (served.finished.clone(), end.clone());
        let stop = async move {
            tokio::select! {
                () = finished.notified() => *ended.lock().unwrap_or_else(PoisonError::into_inner) = Ended::Finished,
                _ = tokio::signal::ctrl_c() => {}
            }
        };
        ready(&format!("http://{own}/?token={token}"));
        axum::serve(listener, router(served.clone())).with_graceful_shutdown(stop).await.map_err(fail)?;
        let end = *end.lock().unwrap_or_else(PoisonError::into_inner);
        // Whoever asks last may still hold it.
        let review = served.review().clone();
        Ok((end, review))
    })
}

fn router(served: Served) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/decide", post(decide))
        .route("/finish", post(finish))
        .layer(DefaultBodyLimit::max(LONGEST))
        .layer(middleware::from_fn_with_state(served.clone(), guard))
        .with_state(served)
}

/// 256 random bits.
fn token() -> Result<String, ReviewError> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(|e| ReviewError::Random(e.to_string()))?;
    Ok(crate::layers::hex(&bytes))
}

/// Refuses what does not come from this machine's own page, and keeps answers out of
/// caches, frames and other pages' hands.
async fn guard(State(served): State<Served>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let text = |name: HeaderName| headers.get(name).map(|v| v.to_str().unwrap_or_default());
    let mut response = if is_own(served.port, text(header::HOST), text(header::ORIGIN)) {
        next.run(request).await
    } else {
        refused("this review is served to its own page alone")
    };
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Whether a request names this server as its host, and no page but its own as its origin, where it names one.
/// Browsers leave out port 80, the default of HTTP.
fn is_own(port: u16, host: Option<&str>, origin: Option<&str>) -> bool {
    let is_here = |name: &str| {
        let end = ["127.0.0.1", "localhost"].iter().find_map(|own| name.strip_prefix(own));
        end.is_some_and(|end| end == format!(":{port}") || port == 80 && end.is_empty())
    };
    host.is_some_and(is_here) && origin.is_none_or(|o| o.strip_prefix("http://").is_some_and(is_here))
}

fn refused(why: &str) -> Response {
    (StatusCode::FORBIDDEN, why.to_owned()).into_response()
}

#[derive(Deserialize)]
struct Asked {
    token: Option<String>,
}

async fn page(State(served): State<Served>, Query(asked): Query<Asked>) -> Response {
    if !asked.token.is_some_and(|t| served.knows(&t)) {
        return refused("open the address that the command printed: it holds the token of this review");
    }
    match served.review().html(&served.token) {
        Ok(html) => ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], Body::from(html)).into_response(),
        Err(e) => (StatusCode::INTERNAL_SERVER_ERROR, e.to_string()).into_response(),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Decided {
    case: String,
    decision: Decision,
    reason: String,
}

async fn decide(State(served): State<Served>, headers: HeaderMap, Json(asked): Json<Decided>) -> Response {
    if !may_decide(&served, &headers) {
        return answer(StatusCode::FORBIDDEN, "the token is not that of this review", "");
    }
    let mut review = served.review();
    match review.decide(&asked.case, asked.decision, &asked.reason) {
        Ok(message) => answer(StatusCode::OK, &message, review.outcome(&asked.case)),
        Err(e) => answer(StatusCode::UNPROCESSABLE_ENTITY, &e.to_string(), review.outcome(&asked.case)),
    }
}

async fn finish(State(served): State<Served>, headers: HeaderMap) -> Response {
    if !may_decide(&served, &headers) {
        return answer(StatusCode::FORBIDDEN, "the token is not that of this review", "");
    }
    served.finished.notify_one();
    answer(StatusCode::OK, "The review has ended.", "")
}

fn may_decide(served: &Served, headers: &HeaderMap) -> bool {
    headers.get(TOKEN).and_then(|v| v.to_str().ok()).is_some_and(|t| served.knows(t))
}

fn answer(status: StatusCode, message: &str, outcome: &str) -> Response {
    (status, Json(serde_json::json!({ "message": message, "outcome": outcome }))).into_response()
}

#[cfg(test)]
mod tests {
    use super::is_own;

    #[test]
    fn the_port_may_be_left_out_where_it_is_http_s_own() {
        for port in [80, 8080] {
            for name in ["127.0.0.1", "localhost"] {
                let with = format!("{name}:{port}");
                let origins = [name, &with].map(|n| format!("http://{n}"));
                assert!(is_own(port, Some(&with), None) && is_own(port, Some(&with), Some(&origins[1])));
                assert_eq!(is_own(port, Some(name), None), port == 80, "{name} {port}");
                assert_eq!(is_own(port, Some(name), Some(&origins[0])), port == 80, "{name} {port}");
            }
        }
        for host in
            ["", ":80", "127.0.0.1:", "127.0.0.1:8080", "127.0.0.1.evil.example", "evil.example", "127.0.0.1:80:80"]
        {
            assert!(!is_own(80, Some(host), None), "{host}");
        }
        for origin in ["", "null", "127.0.0.1", "https://127.0.0.1", "http://127.0.0.1:81", "http://evil.example"] {
            assert!(!is_own(80, Some("127.0.0.1"), Some(origin)), "{origin}");
        }
        assert!(!is_own(80, None, None));
    }
}
