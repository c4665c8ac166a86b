//! The shell: files, threads and signals live here and nowhere else.
//!
//! What the bytes mean is left to the layers beneath, which know none of these.

mod partial;
mod stop;

pub use partial::Partial;
pub use stop::Stop;
