//! Refusals of stores as errors of ours: which of them pass, and what to do about the others.

use std::error::Error as _;
use std::path::{Path, PathBuf};

use object_store::Error as Refusal;

use crate::Error;

/// What is done to find out whether a result is there.
pub(super) const LOOK: &str = "look at it";
/// What is done to find the recordings under a prefix.
pub(super) const LIST: &str = "list it";

/// Signs that credentials were good once, in the words of a store.
const EXPIRED: [&str; 4] = ["ExpiredToken", "TokenRefreshRequired", "token has expired", "security token is expired"];
/// What is said then.
const RENEW: &str = "the credentials have expired; renew them in the environment (AWS_SESSION_TOKEN with its keys, …)";

/// Most letters of a store's own words that are passed on.
const LONGEST: usize = 200;

/// Error that says what a refusal means.
pub(super) fn refused(path: &Path, doing: &'static str, refusal: Refusal) -> Error {
    let text = chain(&refusal);
    let input = |why: &str| Error::input(path, why);
    // What holds for all of a bucket is said of the bucket: the first that is asked for may be the result.
    let whole = bucket(path);
    let of_all = |why: &str| Error::input(&whole, why);
    match refusal {
        _ if EXPIRED.iter().any(|sign| text.contains(sign)) => passing(path, doing, RENEW),
        _ if text.contains("NoSuchBucket") => {
            of_all("no such bucket; check its name, and AWS_REGION and AWS_ENDPOINT_URL in the environment")
        }
        Refusal::PermissionDenied { .. } | Refusal::Unauthenticated { .. } => input(
            "the store denies it; check the credentials in the environment (AWS_ACCESS_KEY_ID, GOOGLE_APPLICATION_CREDENTIALS, \
             AZURE_STORAGE_ACCOUNT_NAME, …) and what they allow",
        ),
        _ if doing == LIST && is_of_web(path) && !is_out_of_reach(&text) => {
            input("a web server lists no recordings; name each by itself, or in a list (--inputs-from)")
        }
        _ if text.contains("non-partial response") || text.contains("Range request not supported") => {
            input("the server sends whole files only, and this reads parts of them; copy the file here first")
        }
        Refusal::NotFound { .. } => {
            input("no such object; all recordings under a prefix are meant by its name with a slash behind it")
        }
        Refusal::Precondition { .. } => input("changed while it was read: is it still being written?"),
        Refusal::AlreadyExists { .. } => Error::Exists(path.to_owned()),
        Refusal::NotImplemented { .. } | Refusal::NotSupported { .. } => not_offered(path, doing, &short(&text)),
        _ if text.contains("169.254.169.254") || text.contains("metadata.google") => {
            of_all(&format!("no credentials; set {}", credentials(path)))
        }
        _ if text.contains("configured region") || text.contains("PermanentRedirect") => {
            of_all("the bucket is in another region; set AWS_REGION")
        }
        _ => match status(&text) {
            Some(status) if status.starts_with('4') && !status.starts_with("408") && !status.starts_with("429") => {
                let code = between(&text, "<Code>", "</Code>").map(|code| format!(", {code}")).unwrap_or_default();
                Error::input(path, format!("cannot {doing}: the store refuses the request ({status}{code})"))
            }
            Some(status) if status.starts_with("501") || status.starts_with("505") => not_offered(path, doing, &status),
            Some(status) => passing(path, doing, &format!("its store answers {status}")),
            None if doing == LOOK => passing(&whole, "reach it", &short(&text)),
            None => passing(path, doing, &short(&text)),
        },
    }
}

/// Error of a store that cannot even be asked: nothing but another environment or URL helps.
pub(super) fn unusable(path: &Path, refusal: &Refusal) -> Error {
    let text = chain(refusal);
    let why = match text.contains("Account must be specified") {
        true => format!("no account; set {}", credentials(path)),
        false => format!("cannot reach its store: {}; check the environment: {}", short(&text), credentials(path)),
    };
    Error::input(&bucket(path), why)
}

/// Whether a refusal says that credentials have expired: the same request will not succeed before they are renewed.
pub(super) fn has_expired(error: &Error) -> bool {
    matches!(error, Error::OutOfReach { why, .. } if why == RENEW)
}

/// Whether only the body of an answer, which one to HEAD lacks, tells what a refusal means.
pub(super) fn is_unexplained(refusal: &Refusal) -> bool {
    matches!(refusal, Refusal::PermissionDenied { .. } | Refusal::Unauthenticated { .. })
        || status(&chain(refusal)).is_some_and(|status| status.starts_with("400"))
}

/// The variables that give a store's credentials.
fn credentials(path: &Path) -> &'static str {
    match path.to_string_lossy().split_once("://").map_or("", |(scheme, _)| scheme) {
        "gs" => {
            "GOOGLE_APPLICATION_CREDENTIALS or GOOGLE_SERVICE_ACCOUNT, or GOOGLE_SKIP_SIGNATURE=true for a public bucket"
        }
        "az" | "adl" | "azure" | "abfs" | "abfss" => {
            "AZURE_STORAGE_ACCOUNT_NAME with AZURE_STORAGE_ACCOUNT_KEY, or with AZURE_SKIP_SIGNATURE=true for a public container"
        }
        _ => "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_SKIP_SIGNATURE=true for a public bucket",
    }
}

fn not_offered(path: &Path, doing: &'static str, words: &str) -> Error {
    let what = "the server does not offer what this needs";
    Error::input(path, format!("cannot {doing}: {what} ({words}); copy the file instead"))
}

/// Whether a URL is a web server's.
fn is_of_web(path: &Path) -> bool {
    path.to_string_lossy().starts_with("http")
}

/// Whether a server was not reached, or is in trouble that may pass.
fn is_out_of_reach(text: &str) -> bool {
    match status(text) {
        Some(status) => ["408", "429", "500", "502", "503", "504"].iter().any(|passing| status.starts_with(passing)),
        None => text.contains("HTTP error"),
    }
}

/// The bucket, or server, that a URL leads into.
fn bucket(path: &Path) -> PathBuf {
    let url = path.to_string_lossy();
    let name =
        url.split_once("://").map(|(scheme, rest)| format!("{scheme}://{}", rest.split('/').next().unwrap_or(rest)));
    name.map_or_else(|| path.to_owned(), PathBuf::from)
}

fn passing(path: &Path, doing: &'static str, why: &str) -> Error {
    Error::OutOfReach { doing, path: path.to_owned(), why: why.to_owned() }
}

/// Text of a refusal and its causes.
fn chain(refusal: &Refusal) -> String {
    let mut text = refusal.to_string();
    let mut cause = refusal.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    text
}

/// Status of the answer, in a text of the crate's.
fn status(text: &str) -> Option<String> {
    let status = text.split("status code: ").nth(1)?;
    Some(status.split(':').next().unwrap_or_default().trim().to_owned())
}

fn between<'a>(text: &'a str, from: &str, until: &str) -> Option<&'a str> {
    text.split_once(from)?.1.split_once(until).map(|(found, _)| found)
}

/// The last of the causes, which is the most telling, in one line.
fn short(text: &str) -> String {
    let last = text.rsplit(" - ").next().unwrap_or(text);
    let words: Vec<_> = last.split_whitespace().collect();
    words.join(" ").chars().take(LONGEST).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_holds_for_a_bucket_is_said_of_it() {
        assert_eq!(bucket(Path::new("s3://robots/run/17.mcap")), Path::new("s3://robots"));
        let source = "Error performing PUT http://169.254.169.254/latest/api/token".into();
        let refusal = Refusal::Generic { store: "S3", source };
        let error = refused(Path::new("s3://robots/run/17.stillpoint.mcap"), LOOK, refusal).to_string();
        assert!(error.starts_with("s3://robots: no credentials; set AWS_ACCESS_KEY_ID"), "{error}");
    }

    fn answered(url: &str, doing: &'static str, answer: &str) -> Error {
        let source = format!("Error performing GET: Server returned non-2xx status code: {answer}").into();
        refused(Path::new(url), doing, Refusal::Generic { store: "S3", source })
    }

    #[test]
    fn credentials_that_have_expired_are_passing_trouble_and_said() {
        for status in ["400 Bad Request", "403 Forbidden"] {
            let answer = format!("{status}: <Error><Code>ExpiredToken</Code></Error>");
            let error = answered("s3://robots/17.mcap", "read", &answer);
            assert!(error.is_passing() && has_expired(&error), "{error}");
            assert!(error.to_string().contains("the credentials have expired; renew them"), "{error}");
        }
        let source = "status code: 403 Forbidden: <Code>ExpiredToken</Code>".into();
        let denied = Refusal::PermissionDenied { path: "17.mcap".to_owned(), source };
        assert!(refused(Path::new("s3://robots/17.mcap"), "write", denied).is_passing());
        assert!(!answered("s3://robots/17.mcap", "read", "400 Bad Request: <Code>InvalidRequest</Code>").is_passing());
    }

    #[test]
    fn what_a_server_never_offers_does_not_pass() {
        for (doing, answer) in [(LIST, "501 Not Implemented: "), (LIST, "405 Method Not Allowed: ")] {
            let error = answered("https://robots.example/run/", doing, answer);
            assert!(!error.is_passing() && error.to_string().contains("name each by itself"), "{error}");
        }
        assert!(!answered("https://robots.example/17.mcap", "write", "501 Not Implemented: ").is_passing());
        for answer in ["503 Service Unavailable: ", "500 Internal Server Error: ", "429 Too Many Requests: "] {
            assert!(answered("https://robots.example/run/", LIST, answer).is_passing());
            assert!(answered("s3://robots/run/", LIST, answer).is_passing());
        }
    }

    #[test]
    fn each_store_is_told_of_its_own_variables() {
        let missing = || Refusal::Generic { store: "MicrosoftAzure", source: "Account must be specified".into() };
        let error = unusable(Path::new("az://robots/17.mcap"), &missing());
        assert!(!error.is_passing(), "{error}");
        let error = error.to_string();
        assert!(error.starts_with("az://robots: no account; set AZURE_STORAGE_ACCOUNT_NAME"), "{error}");
        let source = "Error performing GET http://metadata.google.internal/computeMetadata".into();
        let error =
            refused(Path::new("gs://robots/17.mcap"), LOOK, Refusal::Generic { store: "GCS", source }).to_string();
        assert!(error.contains("GOOGLE_APPLICATION_CREDENTIALS") && !error.contains("AWS"), "{error}");
    }
}
