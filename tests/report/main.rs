//! What people and other programs are shown: reports, exports, layouts, numbers.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;

mod exports;
mod layout;
mod merge;
mod numbers;
mod page;
