//! Paths that are URLs of object stores.

use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;

/// Schemes of URLs that name objects.
const SCHEMES: [&str; 10] = ["s3", "s3a", "gs", "az", "adl", "azure", "abfs", "abfss", "https", "http"];

/// Whether a path is the URL of an object or prefix.
pub fn is_url(path: &Path) -> bool {
    let bytes = path.as_os_str().as_bytes();
    SCHEMES.iter().any(|scheme| bytes.strip_prefix(scheme.as_bytes()).is_some_and(|rest| rest.starts_with(b"://")))
}

/// Whether a path is the URL of a prefix, which ends with a slash, or of a whole bucket.
pub fn is_prefix(path: &Path) -> bool {
    let text = path.as_os_str().to_string_lossy();
    let rest = text.split_once("://").map_or("", |(_, rest)| rest);
    is_url(path) && (rest.ends_with('/') || !rest.contains('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_told_from_files_and_prefixes_from_objects() {
        let kinds = |text: &str| (is_url(Path::new(text)), is_prefix(Path::new(text)));
        assert_eq!(kinds("s3://bucket/a/x.mcap"), (true, false));
        assert_eq!(kinds("s3://bucket/a/"), (true, true));
        assert_eq!(kinds("gs://bucket"), (true, true));
        assert_eq!(kinds("https://host/x.mcap"), (true, false));
        for file in ["s3:/bucket/", "x.mcap", "ftp://host/x.mcap", "./s3://bucket/", "s3x://bucket"] {
            assert_eq!(kinds(file), (false, false), "{file}");
        }
    }
}
