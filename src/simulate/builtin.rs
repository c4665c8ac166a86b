//! Built-in scenarios.

/// Built-in scenarios: name and TOML text, to be printed and edited.
pub const BUILTIN: [(&str, &str); 5] = [
    ("demo", include_str!("scenarios/demo.toml")),
    ("thesis-sequence-1", include_str!("scenarios/thesis-sequence-1.toml")),
    ("thesis-sequence-3", include_str!("scenarios/thesis-sequence-3.toml")),
    ("rate-table", include_str!("scenarios/rate-table.toml")),
    ("six-faces", include_str!("scenarios/six-faces.toml")),
];
