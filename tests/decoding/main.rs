//! Message bytes become numbers: schemas of every language understood or refused, every encoding walked to the same
//! values as independent encoders wrote, and as independent readers read.
#![allow(clippy::unwrap_used)]

mod cdr;
mod hostile;
mod idl;
mod interop;
mod json;
mod protobuf;
mod recordings;
mod rosmsg;
