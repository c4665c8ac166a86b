//! Message bytes become numbers: schemas of every language understood or refused, every encoding walked to the same
//! values as independent encoders wrote, and as independent readers read.
#![allow(clippy::unwrap_used)]

#[path = "../common/needs.rs"]
mod needs;

mod batches;
mod cdr;
mod hostile;
mod idl;
mod intake;
mod interop;
mod json;
mod lists;
mod protobuf;
mod recordings;
mod rewritten;
mod rosmsg;

/// So many cases, unless `PROPTEST_CASES` says how many.
fn cases(cases: u32) -> proptest::test_runner::Config {
    let said = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
    proptest::test_runner::Config { cases: said.unwrap_or(cases), ..Default::default() }
}
