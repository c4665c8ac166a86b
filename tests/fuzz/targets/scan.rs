//! Any splits of a recording over time and reads, and any interruptions, give the same events as one read of all of it.

use arbitrary::{Result, Unstructured};
use stillpoint::record::{Event, Inventory, Opened, Opener, Scan, Supply};

use super::made;

pub fn check(bytes: &[u8]) {
    let mut u = Unstructured::new(bytes);
    let Ok((file, how)) = case(&mut u) else { return };
    let (told, length) = follow(&file, &how);
    // One that ended before all of the file was there is the recording, whatever comes behind it.
    let (plain, _) = follow(&file[..length], &How::default());
    assert_eq!(told.as_ref().map(|(told, _)| told), plain.as_ref().map(|(told, _)| told), "{how:?}");
    // What is offered, or interrupted, may be counted elsewhere.
    if let (Ok((_, inventory)), Ok((_, other))) = (&plain, &told) {
        assert_eq!(format!("{inventory:?}"), format!("{other:?}"), "{how:?}");
    }
}

fn case(u: &mut Unstructured<'_>) -> Result<(Vec<u8>, How)> {
    let file = made::recording(u)?;
    let steps = |u: &mut Unstructured<'_>, most| -> Result<Vec<usize>> {
        (0..u.int_in_range(0..=8)?).map(|_| u.int_in_range(1..=most)).collect()
    };
    let how =
        How { growth: steps(u, 2000)?, reads: steps(u, 300)?, interrupted: u.arbitrary()?, offered: u.arbitrary()? };
    Ok((file, how))
}

/// How a recording comes: the steps by which it grows before it is all there, the lengths of reads over and over, when
/// the scan is taken apart and up again, and which chunks are opened elsewhere (bit by bit, none if 0).
#[derive(Debug, Default)]
struct How {
    growth: Vec<usize>,
    reads: Vec<usize>,
    interrupted: u8,
    offered: u8,
}

/// The events of a scan, or the error that ended it, and the length of the file by then.
fn follow(file: &[u8], how: &How) -> (std::result::Result<(Vec<String>, Inventory), String>, usize) {
    let mut length = 0;
    let told = follow_to(file, how, &mut length);
    (told, length)
}

fn follow_to(file: &[u8], how: &How, length: &mut usize) -> std::result::Result<(Vec<String>, Inventory), String> {
    let offering = |scan: Scan| if how.offered == 0 { scan } else { scan.offering_chunks() };
    let mut scan = offering(Scan::new());
    let mut told = Vec::new();
    let mut growth = how.growth.iter();
    let mut reads = how.reads.iter().cycle();
    let (mut waits, mut chunks) = (0, 0);
    loop {
        match scan.next_event().map_err(|error| error.to_string())? {
            Event::Read { offset, length: needed } => {
                let offset = offset as usize;
                assert!(needed > 0 && offset + needed <= *length, "{needed} bytes at {offset} of {length} asked for");
                let take = reads.next().copied().unwrap_or(needed).min(*length - offset);
                scan.insert(take).copy_from_slice(&file[offset..offset + take]);
                scan.notify_read(take);
            }
            Event::Chunk { offset, length: content } => {
                chunks += 1;
                let supply = if how.offered >> (chunks % 8) & 1 == 1 {
                    let mut chunk = Opened::default();
                    chunk.room(content as usize).copy_from_slice(&file[offset as usize + 9..][..content as usize]);
                    Opener::default().open(&mut chunk);
                    Supply::Opened(chunk)
                } else {
                    Supply::Absent
                };
                scan.supply(supply);
                scan.spent();
            }
            Event::Wait => {
                waits += 1;
                if how.interrupted >> (waits % 8) & 1 == 1
                    && let Some(position) = scan.position()
                {
                    let saved = rmp_serde::to_vec_named(&position).unwrap();
                    scan = offering(Scan::resume(rmp_serde::from_slice(&saved).unwrap()));
                }
                match growth.next() {
                    Some(step) => {
                        *length = (*length + step).min(file.len());
                        scan.extend(*length as u64);
                    }
                    None => {
                        *length = file.len();
                        scan.extend(*length as u64);
                        scan.finish();
                    }
                }
            }
            Event::End => return Ok((told, scan.into_inventory())),
            event => told.push(format!("{event:?}")),
        }
    }
}
