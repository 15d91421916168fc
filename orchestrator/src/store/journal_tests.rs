use super::*;
use crate::plan::tests::step;

fn at(folder: &tempfile::TempDir) -> Utf8PathBuf {
    Utf8PathBuf::from_path_buf(folder.path().join("journal")).unwrap()
}

fn recipe(speed: f64) -> (Key, impl FnOnce() -> Ingredients) {
    let mut s = step("s", &[], &[]);
    s.parameters = serde_json::json!({ "speed": speed }).into();
    let made_by = Ingredients::of(&s);
    (made_by.digest(), || made_by)
}

fn key(n: u8) -> Key {
    Key([n; 32])
}

fn note(j: &mut Journal, item: u64, n: u8) {
    let made = Known {
        bytes: 10 + u64::from(n),
        labels: Some(vec!["A".into()]),
        stamp: Some(u64::from(n)),
    };
    let input = InputKey {
        port: "p".into(),
        step: "up".into(),
        item: vec![],
        key: key(200),
    };
    j.used(("s", &[item]), key(n), recipe(f64::from(n)), made, || {
        vec![input]
    });
}

#[test]
fn what_was_noted_is_read_again_with_its_ingredients() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    note(&mut j, 1, 2);
    j.flush().unwrap();
    let j = Journal::read(&at(&folder)).unwrap();
    assert_eq!(j.last("s", &[1]), Some(key(2)));
    assert_eq!(j.known(&key(1)).unwrap().bytes, 11);
    let (ingredients, inputs) = j.detail(&key(2)).unwrap();
    assert_eq!(ingredients.parameters["speed"], 2.0);
    assert_eq!(inputs[0].key, key(200));
}

#[test]
fn a_repeated_run_writes_nothing_and_a_return_to_an_old_key_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let size = || std::fs::metadata(at(&folder)).unwrap().len();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    note(&mut j, 0, 2);
    j.flush().unwrap();
    let before = size();
    note(&mut j, 0, 2);
    j.flush().unwrap();
    assert_eq!(size(), before);
    note(&mut j, 0, 1);
    j.flush().unwrap();
    assert!(size() > before);
    assert_eq!(
        Journal::read(&at(&folder)).unwrap().last("s", &[0]),
        Some(key(1))
    );
}

#[test]
fn a_journal_cut_anywhere_keeps_its_whole_records_and_can_be_continued() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    j.flush().unwrap();
    let first = std::fs::metadata(at(&folder)).unwrap().len() as usize;
    note(&mut j, 1, 2);
    j.flush().unwrap();
    let whole = std::fs::read(at(&folder)).unwrap();
    // What was seen of the files comes after the note that there are any: head, variant, key, and a small number.
    let seen = HEAD + 1 + 32 + 1;
    for cut in 0..whole.len() {
        std::fs::write(at(&folder), &whole[..cut]).unwrap();
        let mut j = Journal::open(&at(&folder)).unwrap();
        assert!(!j.is_damaged(), "cut at {cut}");
        let is_known = |n: u64| j.last("s", &[n]).is_some();
        assert_eq!(is_known(0), cut >= first - seen, "cut at {cut}");
        assert_eq!(is_known(1), cut >= whole.len() - seen, "cut at {cut}");
        note(&mut j, 2, 3);
        j.flush().unwrap();
        let j = Journal::read(&at(&folder)).unwrap();
        assert_eq!(j.last("s", &[2]), Some(key(3)), "cut at {cut}");
        assert!(j.detail(&key(3)).is_some(), "cut at {cut}");
    }
}

#[test]
fn a_flipped_byte_in_the_last_frame_looks_like_a_torn_tail() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    j.flush().unwrap();
    let mut bytes = std::fs::read(at(&folder)).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(at(&folder), bytes).unwrap();
    let j = Journal::read(&at(&folder)).unwrap();
    assert_eq!((j.last("s", &[0]), j.is_damaged()), (Some(key(1)), false));
    assert_eq!(
        j.known(&key(1)).unwrap().stamp,
        None,
        "the last that was noted"
    );
}

/// By the work that it takes: behind each of a quarter of a million places there seems to be a frame of 32 KiB.
#[test]
fn a_file_that_is_full_of_lengths_is_scanned_without_hashing_behind_each() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = [MAGIC.to_vec(), [0x7f, 0x7f, 0, 0].repeat(1 << 18)].concat();
    let plausible = |at: &usize| payload(&bytes, *at).is_some_and(|p| p.len() <= LOOKED_FOR);
    let decoded = |at: usize| {
        let payload = payload(&bytes, at)?;
        postcard::take_from_bytes::<Entry>(&bytes[payload]).ok()
    };
    let places: Vec<usize> = (MAGIC.len()..bytes.len()).filter(plausible).collect();
    assert!(places.len() > 200_000, "{}", places.len());
    assert!(!places.into_iter().any(|at| decoded(at).is_some()));
    assert_eq!(next_frame(&bytes, MAGIC.len()), None);
    assert!(!Journal::scan(&at(&folder), bytes).0.is_damaged());
}

#[test]
fn a_bit_that_turns_anywhere_costs_one_record_and_the_damaged_file_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    for n in 0..4 {
        note(&mut j, n.into(), n + 1);
        j.flush().unwrap();
    }
    let whole = std::fs::read(at(&folder)).unwrap();
    let kept = Journal::damaged_file(&at(&folder));
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let is_known = |j: &Journal, n: u64| j.last("s", &[n]) == Some(key(n as u8 + 1));
        let j = Journal::scan(&at(&folder), bytes.clone()).0;
        assert!(
            (0..4).filter(|n| is_known(&j, *n)).count() >= 3,
            "bit {bit}"
        );
        let damaged = j.is_damaged();
        // One in the last frame looks like a torn tail.
        assert!(damaged || bit / 8 > whole.len() - 60, "bit {bit}");
        if bit % 499 > 0 {
            continue;
        }
        std::fs::write(at(&folder), &bytes).unwrap();
        let mut j = Journal::open(&at(&folder)).unwrap();
        assert_eq!(j.is_damaged(), damaged);
        assert_eq!(std::fs::read(&kept).is_ok_and(|b| b == bytes), damaged);
        note(&mut j, 7, 8);
        j.flush().unwrap();
        let j = Journal::read(&at(&folder)).unwrap();
        assert!(!j.is_damaged() && j.last("s", &[7]) == Some(key(8)));
        let _ = std::fs::remove_file(&kept);
    }
}

#[test]
fn what_was_seen_of_files_is_noted_again_only_when_it_is_new() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    let again = |j: &mut Journal, stamp| {
        let artifact = Known {
            stamp: Some(stamp),
            ..j.known(&key(1)).unwrap().clone()
        };
        j.used(("s", &[0]), key(1), recipe(1.0), artifact, Vec::new);
        j.flush().unwrap();
        std::fs::metadata(at(&folder)).unwrap().len()
    };
    let before = again(&mut j, 1);
    assert!(again(&mut j, 2) > before);
    assert_eq!(again(&mut j, 2), again(&mut j, 2));
    let j = Journal::read(&at(&folder)).unwrap();
    assert_eq!(j.known(&key(1)).unwrap().stamp, Some(2));
    assert!(j.detail(&key(1)).is_some());
}

#[test]
fn what_was_read_ahead_is_taken_only_if_nobody_has_written_since() {
    let folder = tempfile::tempdir().unwrap();
    let path = at(&folder);
    assert!(Scanned::read(&path).is_none());
    let mut j = Journal::open(&path).unwrap();
    note(&mut j, 0, 1);
    j.flush().unwrap();
    let ahead = Scanned::read(&path).unwrap();
    assert_eq!(ahead.journal().last("s", &[0]), Some(key(1)));
    let mut open = Journal::open_with(&path, Some(ahead)).unwrap();
    note(&mut open, 1, 2);
    open.flush().unwrap();
    // Another has written after it was read.
    let ahead = Scanned::read(&path).unwrap();
    note(&mut open, 2, 3);
    open.flush().unwrap();
    let late = Journal::open_with(&path, Some(ahead)).unwrap();
    for n in 0..3u8 {
        assert_eq!(late.last("s", &[n.into()]), Some(key(n + 1)));
    }
}

#[test]
fn a_journal_of_the_earlier_version_is_read_and_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    j.flush().unwrap();
    let mut bytes = std::fs::read(at(&folder)).unwrap();
    bytes[..8].copy_from_slice(EARLIER);
    std::fs::write(at(&folder), &bytes).unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    assert!(!j.is_damaged());
    note(&mut j, 1, 2);
    j.flush().unwrap();
    assert!(std::fs::read(at(&folder)).unwrap().starts_with(MAGIC));
    let j = Journal::read(&at(&folder)).unwrap();
    assert_eq!(
        (j.last("s", &[0]), j.last("s", &[1])),
        (Some(key(1)), Some(key(2)))
    );
}

#[test]
fn a_long_history_is_shed_and_the_last_state_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    for round in 0..1200u64 {
        note(&mut j, 0, (round % 2) as u8 + 1);
    }
    j.flush().unwrap();
    let before = std::fs::metadata(at(&folder)).unwrap().len();
    drop(j);
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 1, 9);
    j.flush().unwrap();
    assert!(std::fs::metadata(at(&folder)).unwrap().len() < before / 10);
    let j = Journal::read(&at(&folder)).unwrap();
    assert_eq!(
        (j.last("s", &[0]), j.last("s", &[1])),
        (Some(key(2)), Some(key(9)))
    );
    assert!(j.detail(&key(2)).is_some());
}

#[test]
fn why_an_instance_failed_is_kept_until_it_is_done_or_fails_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    for item in [0, 1, 2] {
        j.failed(("s", &[item]), key(1 + item as u8), "no tool");
    }
    j.failed(("s", &[1]), key(2), "no bed");
    j.failed(("s", &[2]), key(7), "no frame");
    note(&mut j, 0, 9);
    // A long history beside it, which the next writer sheds.
    for round in 0..1200u64 {
        note(&mut j, 8, (round % 2) as u8 + 20);
    }
    j.flush().unwrap();
    for _ in 0..2 {
        let j = Journal::read(&at(&folder)).unwrap();
        // Done otherwise, it failed as it was all the same.
        assert_eq!(j.failure("s", &[0], &key(1)), Some("no tool"));
        assert_eq!(j.failure("s", &[0], &key(9)), None);
        assert_eq!(j.failure("s", &[1], &key(2)), Some("no bed"));
        assert_eq!(j.failure("s", &[2], &key(3)), None);
        assert_eq!(j.failure("s", &[2], &key(7)), Some("no frame"));
        drop(Journal::open(&at(&folder)).unwrap());
    }
    // Done, and failed and done once more: its artifact was gone.
    for _ in 0..2 {
        let mut j = Journal::open(&at(&folder)).unwrap();
        note(&mut j, 1, 2);
        j.flush().unwrap();
        let mut j = Journal::open(&at(&folder)).unwrap();
        assert_eq!(j.failure("s", &[1], &key(2)), None);
        j.failed(("s", &[1]), key(2), "no disk");
        j.flush().unwrap();
    }
}

#[test]
fn what_could_not_be_written_is_written_when_there_is_room_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut j = Journal::open(&at(&folder)).unwrap();
    note(&mut j, 0, 1);
    j.flush().unwrap();
    // A handle that refuses to write, as a full disk does.
    let writable = j.file.replace(File::open(at(&folder)).unwrap());
    note(&mut j, 1, 2);
    assert!(j.tick().is_err() && j.tick().is_err());
    // A part may have got there.
    let mut torn = File::options().append(true).open(at(&folder)).unwrap();
    torn.write_all(&[7; 5]).unwrap();
    j.file = writable;
    note(&mut j, 2, 3);
    j.flush().unwrap();
    let read = Journal::read(&at(&folder)).unwrap();
    for n in 0..3u8 {
        assert_eq!(read.last("s", &[n.into()]), Some(key(n + 1)));
    }
}
