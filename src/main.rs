//! The `stillpoint` program.
#![forbid(unsafe_code)]

fn main() {}
