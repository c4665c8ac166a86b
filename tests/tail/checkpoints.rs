//! A checkpoint holds what was learned, not what was read.

use crate::many_channels::checkpoint;

#[test]
fn a_checkpoint_of_40_000_chunks_of_41_channels_takes_no_megabyte() {
    let (few, many) = (500, 4_500);
    let ((short, _), (long, _)) = (checkpoint(few), checkpoint(many));
    let slope = (long as f64 - short as f64) / (many - few) as f64;
    let expected = short as f64 + slope * 40_000.0;
    assert!(expected < 1e6, "{short} bytes after {few} chunks, {long} after {many}: {slope:.2} a chunk");
    assert!(short > 10_000, "41 channels and what was learned are in it: {short}");
}
