//! Clients of stores, one for each bucket, and the threads that their requests run on. Credentials and endpoints come from
//! the environment, as the crate `object_store` reads them.

use std::collections::BTreeMap;
use std::future::Future;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::http::HttpBuilder;
use object_store::path::Path as Key;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, ObjectStoreScheme, RetryConfig};
use tokio::runtime::{Builder, Runtime};
use url::{Position, Url};

use super::refusal::unusable;
use crate::Error;
use crate::run::runtime::runtime as build;

/// Number of times, and longest time, that a request is tried again, unless the environment says otherwise: about a minute.
const RETRIES: usize = 10;
const RETRY: Duration = Duration::from_secs(180);
/// Environment variable for the time, in seconds; then the number does not count.
const RETRY_VARIABLE: &str = "STILLPOINT_RETRY_S";
/// Waits between two tries, doubled from one to the other.
const FIRST_WAIT: Duration = Duration::from_millis(100);
const LONGEST_WAIT: Duration = Duration::from_secs(15);

/// An object or prefix, and the store that it is in.
#[derive(Clone, Debug)]
pub(super) struct ObjectPlace {
    pub(super) path: PathBuf,
    pub(super) key: Key,
    pub(super) store: Arc<dyn ObjectStore>,
    /// Whether the store takes a result only if there is none of its name, and results in parts.
    pub(super) is_plain: bool,
}

impl ObjectPlace {
    /// Understands a URL.
    pub(super) fn of(path: &Path) -> Result<Self, Error> {
        let wrong = |why: String| Error::Usage(format!("{}: {why}", path.display()));
        let text = path.to_str().ok_or_else(|| wrong("is no URL: it is not Unicode".to_owned()))?;
        let url = Url::parse(text).map_err(|error| wrong(format!("is no URL: {error}")))?;
        let (scheme, key) = ObjectStoreScheme::parse(&url).map_err(|error| wrong(error.to_string()))?;
        // Keys stand in these URLs as they are. What a web server gets is encoded.
        let raw = text.split_once("://").and_then(|(_, rest)| rest.split_once('/')).map_or("", |(_, key)| key);
        let key = if matches!(url.scheme(), "http" | "https") { Ok(key) } else { Key::parse(raw) };
        let key = key.map_err(|error| wrong(error.to_string()))?;
        if url.scheme().starts_with("http") && url.query().is_some() {
            return Err(wrong(
                "has a query, as presigned URLs do, which is not supported; name it by s3:// or gs://".to_owned(),
            ));
        }
        let is_plain = scheme == ObjectStoreScheme::Http;
        // Some stores name the bucket in front of the key.
        let bucket = match url.scheme() {
            "http" | "https" if !is_plain => text.strip_suffix(key.as_ref()).unwrap_or(text).to_owned(),
            _ => url[..Position::BeforePath].to_owned(),
        };
        let store = client(&bucket, &url, &scheme).map_err(|error| unusable(path, &error))?;
        Ok(Self { path: path.to_owned(), key, store, is_plain })
    }
}

/// Refuses a URL that names no object, at no request.
pub(crate) fn check(path: &Path) -> Result<(), Error> {
    ObjectPlace::of(path).map(drop)
}

type Clients = BTreeMap<String, Arc<dyn ObjectStore>>;

fn client(bucket: &str, url: &Url, scheme: &ObjectStoreScheme) -> object_store::Result<Arc<dyn ObjectStore>> {
    static CLIENTS: LazyLock<Mutex<Clients>> = LazyLock::new(Mutex::default);
    let mut clients = CLIENTS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = clients.get(bucket) {
        return Ok(Arc::clone(known));
    }
    // Whoever uses this as a library may have chosen another one.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let store: Arc<dyn ObjectStore> = match scheme {
        ObjectStoreScheme::AmazonS3 => {
            Arc::new(AmazonS3Builder::from_env().with_url(url.as_str()).with_retry(retry()).build()?)
        }
        ObjectStoreScheme::GoogleCloudStorage => {
            Arc::new(GoogleCloudStorageBuilder::from_env().with_url(url.as_str()).with_retry(retry()).build()?)
        }
        ObjectStoreScheme::MicrosoftAzure => {
            Arc::new(MicrosoftAzureBuilder::from_env().with_url(url.as_str()).with_retry(retry()).build()?)
        }
        _ => {
            let options = ClientOptions::new().with_allow_http(true);
            Arc::new(HttpBuilder::new().with_url(bucket).with_client_options(options).with_retry(retry()).build()?)
        }
    };
    clients.insert(bucket.to_owned(), Arc::clone(&store));
    Ok(store)
}

/// Number of times that requests are tried again, and the longest time.
pub(super) fn retry() -> RetryConfig {
    let typed = std::env::var(RETRY_VARIABLE).ok();
    let typed = typed.and_then(|text| Duration::try_from_secs_f64(text.trim().parse().ok()?).ok());
    let (max_retries, retry_timeout) = typed.map_or((RETRIES, RETRY), |typed| (usize::MAX, typed));
    let backoff = BackoffConfig { init_backoff: FIRST_WAIT, max_backoff: LONGEST_WAIT, base: 2.0 };
    RetryConfig { backoff, max_retries, retry_timeout }
}

/// Runs requests to their end. Must not be called by a request.
pub(super) fn wait<T>(path: &Path, work: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    runtime(path)?.block_on(work)
}

/// The threads that requests run on.
pub(super) fn runtime(path: &Path) -> Result<&'static Runtime, Error> {
    static RUNTIME: OnceLock<Result<Runtime, String>> = OnceLock::new();
    let built = RUNTIME.get_or_init(|| {
        let built = build(|| Builder::new_multi_thread().worker_threads(2).thread_name("store").enable_all().build());
        built.map_err(|error| error.to_string())
    });
    built.as_ref().map_err(|why| Error::input(path, format!("the system refuses threads for its store: {why}")))
}
