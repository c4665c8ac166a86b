//! Object stores: recordings read from them by ranges, and results that appear in them when they are complete. The
//! ranges are those that [`input`](super::input) wants.
//!
//! A URL travels as the path of a recording or result, and only here means more than its text. Without the feature
//! `object-store`, every URL is refused.

mod listed;
mod mark;
mod place;

#[cfg(not(feature = "object-store"))]
mod absent;
#[cfg(feature = "object-store")]
mod cache;
#[cfg(feature = "object-store")]
mod client;
#[cfg(feature = "object-store")]
mod listing;
#[cfg(feature = "object-store")]
mod object;
#[cfg(feature = "object-store")]
mod refusal;
#[cfg(feature = "object-store")]
mod upload;

#[cfg(not(feature = "object-store"))]
pub(crate) use absent::{NoObject as Object, NoUpload as Upload, check, known_identity, list, marked};
#[cfg(feature = "object-store")]
pub(crate) use client::check;
pub(crate) use listed::Listed;
#[cfg(feature = "object-store")]
pub(crate) use listing::{known_identity, list};
pub(crate) use mark::ResultMark;
#[cfg(feature = "object-store")]
pub(crate) use object::Object;
pub use place::{is_prefix, is_url};
#[cfg(feature = "object-store")]
pub(crate) use upload::{Upload, marked};

use std::path::Path;

use crate::Error;

/// Puts a text into a store, if it is not there already.
///
/// # Errors
///
/// If the store refuses, or has another text of that name and `force` is not given.
pub fn put_text(path: &Path, text: &str, force: bool) -> Result<(), Error> {
    let mut upload = Upload::begin(path, force)?;
    upload.mark(&ResultMark::of_text(text), 0);
    upload.put(text.as_bytes())?;
    upload.finish().map(drop)
}
