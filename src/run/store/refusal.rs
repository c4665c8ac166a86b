//! Refusals of stores as errors of ours: which of them pass, and what to do about the others.

use std::error::Error as _;
use std::path::{Path, PathBuf};

use object_store::Error as Refusal;

use crate::Error;

/// What is done to find out whether a result is there.
pub(super) const LOOK: &str = "look at it";

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
        _ if text.contains("NoSuchBucket") => {
            of_all("no such bucket; check its name, and AWS_REGION and AWS_ENDPOINT_URL in the environment")
        }
        _ if text.contains("non-partial response") || text.contains("Range request not supported") => {
            input("the server sends whole files only, and this reads parts of them; copy the file here first")
        }
        Refusal::NotFound { .. } => {
            input("no such object; all recordings under a prefix are meant by its name with a slash behind it")
        }
        Refusal::PermissionDenied { .. } | Refusal::Unauthenticated { .. } => input(
            "the store denies it; check the credentials in the environment (AWS_ACCESS_KEY_ID, GOOGLE_APPLICATION_CREDENTIALS, \
             AZURE_STORAGE_ACCOUNT_NAME, …) and what they allow",
        ),
        Refusal::Precondition { .. } => input("changed while it was read: is it still being written?"),
        Refusal::AlreadyExists { .. } => Error::Exists(path.to_owned()),
        Refusal::NotImplemented { .. } | Refusal::NotSupported { .. } => {
            let what = "the server does not offer what this needs";
            Error::input(path, format!("cannot {doing}: {what} ({}); copy the file instead", short(&text)))
        }
        _ if text.contains("169.254.169.254") || text.contains("metadata.google") => of_all(
            "no credentials; set those of the store in the environment (AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, …), or \
             AWS_SKIP_SIGNATURE=true for a public bucket",
        ),
        _ if text.contains("configured region") || text.contains("PermanentRedirect") => {
            of_all("the bucket is in another region; set AWS_REGION")
        }
        _ => match status(&text) {
            Some(status) if status.starts_with('4') && !status.starts_with("408") && !status.starts_with("429") => {
                let code = between(&text, "<Code>", "</Code>").map(|code| format!(", {code}")).unwrap_or_default();
                Error::input(path, format!("cannot {doing}: the store refuses the request ({status}{code})"))
            }
            Some(status) => passing(path, doing, &format!("its store answers {status}")),
            None if doing == LOOK => passing(&whole, "reach it", &short(&text)),
            None => passing(path, doing, &short(&text)),
        },
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
        assert!(error.starts_with("s3://robots: no credentials; set those of the store"), "{error}");
    }
}
