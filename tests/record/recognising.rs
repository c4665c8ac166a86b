use proptest::prelude::*;
use stillpoint::record::{FileKind, Original, ReadAt, Sidecar, recognise, recognise_scanned};

use crate::drive::{blocks, fold, put, scan, settings, topics};
use crate::recordings::{Recipe, mistreated, shared};

proptest! {
    #[test]
    fn stripping_an_annotated_recording_gives_the_original(file in mistreated()) {
        let annotated = fold(&file, &topics(), &blocks());
        prop_assert_eq!(&strip(&annotated).unwrap(), &file);
        // Annotating twice is annotating the original, so only determinism is left to be shown.
        prop_assert_eq!(&fold(&file, &topics(), &blocks()), &annotated);
        let bare = fold(&file, &topics(), &[]);
        prop_assert_eq!(&strip(&bare).unwrap(), &file);
    }

    #[test]
    fn an_original_is_not_mistaken_for_an_annotated_recording(file in mistreated()) {
        prop_assert_eq!(recognise(&mut &file[..], file.len() as u64).unwrap(), FileKind::Recording);
        prop_assert_eq!(recognise_scanned(&mut &file[..], &scan(&file).1).unwrap(), FileKind::Recording);
    }

    #[test]
    fn ranges_of_an_original_are_found_in_its_file(file in mistreated(), ends in any::<[prop::sample::Index; 2]>()) {
        let annotated = fold(&file, &topics(), &blocks());
        let original = original(&annotated).unwrap();
        let mut ends = ends.map(|end| end.index(file.len() + 1));
        ends.sort_unstable();
        prop_assert_eq!(original.length(), file.len() as u64);
        let found = copy(&annotated, &original, ends[0] as u64..ends[1] as u64);
        prop_assert_eq!(&found[..], &file[ends[0]..ends[1]]);
    }
}

#[test]
fn the_recordings_of_others_are_restored() {
    for (path, file) in shared() {
        assert_eq!(recognise(&mut &file[..], file.len() as u64).unwrap(), FileKind::Recording, "{}", path.display());
        assert_eq!(strip(&fold(&file, &topics(), &blocks())).unwrap(), file, "{}", path.display());
    }
}

#[test]
fn the_original_is_found_although_the_end_of_the_annotated_recording_is_lost() {
    let file = Recipe::plain().write();
    let mut annotated = fold(&file, &topics(), &blocks());
    annotated.truncate(annotated.len() - 100);
    assert_eq!(recognise(&mut &annotated[..], annotated.len() as u64).unwrap(), FileKind::Recording);
    let kind = recognise_scanned(&mut &annotated[..], &scan(&annotated).1).unwrap();
    let FileKind::Annotated { original, settings: found, .. } = kind else { panic!("{kind:?}") };
    assert_eq!(copy(&annotated, &original, 0..original.length()), file);
    assert_eq!(found, settings());
}

#[test]
fn annotating_an_edited_recording_makes_it_the_original() {
    let first = fold(&Recipe::plain().write(), &topics(), &blocks());
    let second = fold(&first, &topics(), &blocks());
    assert_eq!(strip(&second).unwrap(), first);
}

#[test]
fn a_copy_by_another_program_is_not_mistaken_for_ours() {
    let annotated = fold(&Recipe::plain().write(), &topics(), &blocks());
    // As filters do: everything is kept, but written anew.
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut out).unwrap();
    let summary = mcap::Summary::read(&annotated).unwrap().unwrap();
    for message in mcap::MessageStream::new(&annotated).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    for index in &summary.attachment_indexes {
        writer.attach(&mcap::read::attachment(&annotated, index).unwrap()).unwrap();
    }
    for index in &summary.metadata_indexes {
        writer.write_metadata(&mcap::read::metadata(&annotated, index).unwrap()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let copy = out.into_inner();
    assert!(matches!(recognise(&mut &copy[..], copy.len() as u64).unwrap(), FileKind::Edited { .. }));
}

#[test]
fn what_was_added_behind_the_annotations_is_noticed() {
    let file = Recipe::plain().write();
    let annotated = fold(&file, &topics(), &blocks());
    let data_end = scan(&annotated).1.prefix() as usize;
    // The data section, one more metadata record, and no index of it: the worst case.
    let mut extended = annotated[..data_end].to_vec();
    extended.extend([0x0C, 12, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0, b'm', b'i', b'n', b'e', 0, 0, 0, 0]);
    let kind = recognise_scanned(&mut &extended[..], &scan(&extended).1).unwrap();
    assert!(matches!(kind, FileKind::Edited { .. }), "{kind:?}");
}

#[test]
fn a_sidecar_is_known_as_such() {
    let (mut sidecar, mut out) = Sidecar::open("ros2", &settings());
    out.extend(sidecar.block(&topics(), &blocks()[0]).unwrap());
    out.extend(put(sidecar.close(), &[], &[]));
    let kind = recognise(&mut &out[..], out.len() as u64).unwrap();
    assert_eq!(kind, FileKind::Sidecar { settings: settings() });
}

fn original(annotated: &[u8]) -> Option<Original> {
    match recognise(&mut &annotated[..], annotated.len() as u64).unwrap() {
        FileKind::Annotated { original, .. } => Some(original),
        _ => None,
    }
}

fn strip(annotated: &[u8]) -> Option<Vec<u8>> {
    original(annotated).map(|original| copy(annotated, &original, 0..original.length()))
}

fn copy(file: &[u8], original: &Original, range: std::ops::Range<u64>) -> Vec<u8> {
    original.pieces(range).flat_map(|piece| &file[piece.start as usize..piece.end as usize]).copied().collect()
}

/// Bytes of which one read fails: the one that comes after `left` others.
struct FailsOnce<'a> {
    bytes: &'a [u8],
    left: usize,
}

impl ReadAt for FailsOnce<'_> {
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> std::io::Result<()> {
        self.left = self.left.wrapping_sub(1);
        match self.left {
            usize::MAX => Err(std::io::Error::from_raw_os_error(5)),
            _ => self.bytes.read_at(offset, buffer),
        }
    }
}

#[test]
fn a_read_that_fails_tells_nothing_about_a_file() {
    let file = Recipe::plain().write();
    let (mut sidecar, mut alone) = Sidecar::open("ros2", &settings());
    alone.extend(sidecar.block(&topics(), &blocks()[0]).unwrap());
    alone.extend(put(sidecar.close(), &[], &[]));
    for bytes in [fold(&file, &topics(), &blocks()), alone, file] {
        let length = bytes.len() as u64;
        let kind = recognise(&mut &bytes[..], length).unwrap();
        let mut failed = 0;
        for left in 0..40 {
            match recognise(&mut FailsOnce { bytes: &bytes, left }, length) {
                Ok(found) => assert_eq!(found, kind, "read {left}"),
                Err(_) => failed += 1,
            }
        }
        assert!(failed > 0);
    }
}
