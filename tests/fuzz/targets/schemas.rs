//! Any text is understood or refused, and every vector that a layout offers can be found in it and decoded.

use arbitrary::Unstructured;
use stillpoint::imu::{Decoder, Layout};

use super::language;

pub fn check(bytes: &[u8]) {
    let mut u = Unstructured::new(bytes);
    let Ok((encoding, schema)) = language::schema(&mut u) else { return };
    match Layout::new(encoding, Some(&schema)) {
        Ok(layout) => {
            for path in layout.vectors() {
                let places = layout.vector(&path).expect("a vector that is offered");
                // What cannot be located in every message is refused.
                let _ = Decoder::new(&layout, &places, None);
            }
        }
        // Errors are printed.
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    let _ = Layout::of_example("p", &schema.data);
}
