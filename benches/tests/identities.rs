//! `identities.py` names the kind of each switch and of each inherited ID.
#![allow(clippy::unwrap_used, missing_docs, reason = "a broken test may stop loudly")]

use std::fmt::Write;
use std::process::Command;

/// A person in a frame: frame, number, column of the box, part that shows, what hides the rest.
type Row = (u32, u32, u32, f64, &'static str);
/// A track in a frame: frame, ID, column of the box; without a column it is predicted.
type Seen = (u32, u32, Option<u32>);

/// Returns the lines of the table of events for frames that are so far apart; `None` where there is no
/// Python.
fn events(people: &[Row], tracks: &[Seen], step_ms: u64) -> Option<Vec<String>> {
    let text = printed(people, tracks, step_ms)?;
    let (events, _) = text.split_once("\n\n").unwrap();
    Some(cells(events))
}

/// Returns the cells of the rows of a table, without the name of the log.
fn cells(table: &str) -> Vec<String> {
    let rows = table.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| log"));
    let rows = rows.filter(|line| !line.starts_with("| ---"));
    rows.map(|line| line.split(" | ").skip(1).collect::<Vec<_>>().join("; ")).collect()
}

/// Returns what the script prints; `None` where there is no Python.
fn printed(people: &[Row], tracks: &[Seen], step_ms: u64) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut truth = String::from("frame,id,ub_x,ub_y,ub_w,ub_h,visible,occluder\n");
    for (frame, id, column, visible, occluder) in people {
        writeln!(truth, "{frame},{id},{column},50,40,40,{visible},{occluder}").unwrap();
    }
    let mut boxes = String::new();
    let mut metres = String::from("stamp_ns,frame,id\n");
    for (frame, id, column) in tracks {
        if let Some(column) = column {
            writeln!(boxes, "{frame},{id},{column},50,40,40,1,-1,-1,-1").unwrap();
        }
        let stamp_ns = u64::from(*frame) * step_ms * 1_000_000;
        writeln!(metres, "{stamp_ns},{frame},{id}").unwrap();
    }
    let truth_path = folder.path().join("log.people.csv");
    std::fs::write(&truth_path, truth).unwrap();
    std::fs::write(folder.path().join("tracks.csv"), boxes).unwrap();
    std::fs::write(folder.path().join("tracks-metres.csv"), metres).unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/identities.py");
    let output =
        Command::new("python3").args(["-B", script]).arg(truth_path).arg(folder.path()).output();
    let output = output.ok()?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Returns the kind of the switch of a person who is so in the frame between; `None` without Python.
fn kind_of_switch(between: Row, step_ms: u64) -> Option<String> {
    let people = [(1, 1, 100, 1.0, "0"), between, (3, 1, 120, 1.0, "0")];
    let tracks = [(1, 5, Some(100)), (2, 5, None), (3, 6, Some(120))];
    let found = events(&people, &tracks, step_ms)?;
    let event = "3; person 1 is 6, and was 5 in frame 1; ";
    Some(found[0].strip_prefix(event).unwrap().trim_end_matches(" |").to_owned())
}

#[test]
fn switches_have_their_kind() {
    for (between, step_ms, kind) in [
        ((2, 1, 110, 0.25, "2"), 100, "lost while hidden"),
        ((2, 1, 110, 0.5, "border"), 100, "lost at the border"),
        ((2, 1, 0, 1.0, "0"), 100, "lost at the border"),
        ((2, 1, 110, 1.0, "0"), 500, "lost at low rate"),
        ((2, 1, 110, 0.5, "static"), 100, "lost"),
    ] {
        let Some(found) = kind_of_switch(between, step_ms) else { return };
        assert_eq!(found, kind, "{between:?}, {step_ms} ms");
    }
}

#[test]
fn two_people_who_take_each_others_ids_are_swapped() {
    let people = [(1, 1, 100, 1.0, "0"), (1, 2, 150, 1.0, "0")];
    let people = [people, people.map(|(_, id, column, visible, by)| (2, id, column, visible, by))];
    let tracks = [(1, 5, Some(100)), (1, 6, Some(150)), (2, 6, Some(100)), (2, 5, Some(150))];
    let Some(found) = events(people.as_flattened(), &tracks, 100) else { return };
    assert_eq!(
        found,
        [
            "2; person 1 has the ID 6 that person 2 had in frame 1; of the one beside |",
            "2; person 1 is 6, and was 5 in frame 1; swapped |",
            "2; person 2 has the ID 5 that person 1 had in frame 1; of the one beside |",
            "2; person 2 is 5, and was 6 in frame 1; swapped |",
        ]
    );
}

#[test]
fn an_id_is_inherited_from_a_track_or_by_recognition() {
    let people = [(1, 1, 100, 1.0, "0"), (3, 2, 120, 1.0, "0")];
    let kept = [(1, 5, Some(100)), (2, 5, None), (3, 5, Some(120))];
    let Some(found) = events(&people, &kept, 100) else { return };
    let event = "3; person 2 has the ID 5 that person 1 had in frame 1";
    assert_eq!(found, [format!("{event}; of a vague track |")]);
    let ended = [(1, 5, Some(100)), (3, 5, Some(120))];
    assert_eq!(events(&people, &ended, 100).unwrap(), [format!("{event}; recognised wrongly |")]);
}

#[test]
fn missed_people_are_counted_by_what_hides_them() {
    let people = [
        (1, 1, 100, 1.0, "0"),
        (2, 1, 0, 0.5, "border"),
        (3, 1, 100, 0.5, "2"),
        (4, 1, 100, 0.9, "2"),
        (5, 1, 100, 1.0, "0"),
    ];
    let Some(text) = printed(&people, &[(1, 5, Some(100))], 100) else { return };
    let (_, missed) = text.split_once("\n\n").unwrap();
    assert_eq!(cells(missed), ["5; 4; 1; 1; 2 |"]);
}
