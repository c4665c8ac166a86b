//! Recordings are scanned for all that is whole in them, and annotated without losing a byte.
#![allow(clippy::unwrap_used)]

#[path = "../common/needs.rs"]
mod needs;

mod damage;
mod drive;
mod folding;
mod following;
mod limits;
mod offering;
mod recognising;
mod recordings;
mod records;
mod scanning;
