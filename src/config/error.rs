//! Error in a configuration, with its position.

/// Error in a configuration, with its position.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Not TOML.
    #[error("{at}: {why}")]
    Syntax {
        /// File and line, or the option.
        at: String,
        /// Message of the parser.
        why: String,
    },
    /// An unknown key or choice.
    #[error("{at}: `{key}`: no such {kind} `{name}`{advice}")]
    Unknown {
        /// File and line, or the option.
        at: String,
        /// The dotted key.
        key: String,
        /// "key" or "choice".
        kind: &'static str,
        /// Name as written.
        name: String,
        /// The nearest valid name, or all of them.
        advice: String,
    },
    /// A value of the wrong type or outside its range.
    #[error("{at}: `{key}`: {why}")]
    Value {
        /// File and line, or the option.
        at: String,
        /// The dotted key.
        key: String,
        /// Fault of the value.
        why: String,
    },
    /// Not `key=value`.
    #[error("--set {0}: expected key=value, for example --set still.min_fit_s=2")]
    Set(String),
}
