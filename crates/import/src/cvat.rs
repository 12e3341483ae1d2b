//! Annotations of CVAT, as its formats "CVAT for video 1.1" and "CVAT for images 1.1" export them:
//! <https://docs.cvat.ai/docs/manual/advanced/xml_format/>.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node, TextPos};
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say, spare, write_file};
use tagalong_config::{FileLimit, PathText, check_xml, read_text};
use tagalong_eval::Region;
use tagalong_eval::formats::people::Row;
use tagalong_eval::formats::{MOST_FRAMES, MOST_ID};

use super::args::ImportArgs;
use super::truth::{WholeBody, boxes_csv, people_csv};

/// Largest file that is read, bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Assumed visible fraction of a person whose box is marked as occluded; CVAT has no fraction.
const OCCLUDED: f64 = 0.5;

/// Writes the boxes of an XML file as truth for a log.
///
/// # Errors
/// Exit code 1 for a file that cannot be read or has another format; 2 for an output that exists.
pub fn import(args: &ImportArgs) -> Outcome {
    let ending = if args.whole_bodies { "boxes.csv" } else { "people.csv" };
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.path, ending));
    spare(&output, args.overwrite)?;
    let Read { rows, note } = read(&args.path)?;
    note.iter().for_each(|note| say(note));
    let text = if args.whole_bodies { mot(&rows) } else { people_csv(&rows)? };
    write_file(&output, text)?;
    let shown = output.display();
    let count = rows.len();
    print(&match args.format {
        Format::Json => {
            format!("{:#}\n", serde_json::json!({ "truth": PathText(&output), "boxes": count }))
        }
        Format::Text => format!(
            "{count} boxes are in {shown}; beside LOG.mcap `eval` and `bench` look for LOG.{ending}\n"
        ),
    })?;
    Ok(Ended::Well)
}

fn default_output(path: &Path, ending: &str) -> PathBuf {
    path.with_extension(ending)
}

/// Reads the people of an XML file, ordered by frame and ID.
///
/// # Errors
/// A sentence with the line.
pub fn people_of_cvat(text: &str) -> Result<Vec<Row>, String> {
    parse(text).map(|read| read.rows)
}

/// Boxes of a file, and a note on shapes that are not boxes.
#[derive(Debug)]
struct Read {
    rows: Vec<Row>,
    note: Option<String>,
}

/// Reads the boxes, ordered by frame and ID.
fn read(path: &Path) -> Result<Read, Failure> {
    let name = path.display().to_string();
    let text = read_text(path, FileLimit::Bytes(MOST_BYTES)).map_err(|error| {
        Failure::failed(format!("cannot read {name}: {error}; give the XML file that CVAT exports"))
    })?;
    parse(&text).map_err(|why| Failure::failed(format!("{name}{why}")))
}

/// Reads the boxes; an error begins with the line.
fn parse(text: &str) -> Result<Read, String> {
    check_xml(text).map_err(|why| format!(", {why}"))?;
    let document = Document::parse(text).map_err(|error| format!(": {error}"))?;
    let root = document.root_element();
    if !root.has_tag_name("annotations") {
        let found = root.tag_name().name();
        return Err(format!(
            ": holds `{found}` and not `annotations`; export \"CVAT for video 1.1\" or \"CVAT for \
             images 1.1\""
        ));
    }
    let mut rows = Vec::new();
    for node in root.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "track" => track(&node, &mut rows)?,
            "image" => image(&node, &mut rows)?,
            _ => {}
        }
    }
    rows.sort_by_key(|row| (row.frame, row.id));
    if let Some(pair) =
        rows.windows(2).find(|pair| (pair[0].frame, pair[0].id) == (pair[1].frame, pair[1].id))
    {
        let id = pair[0].id;
        let frame = pair[0].frame - 1;
        return Err(format!(": person {id} is in CVAT's frame {frame} twice; number them apart"));
    }
    let note = other_shapes(&root);
    match (rows.is_empty(), note) {
        (false, note) => Ok(Read { rows, note }),
        (true, Some(note)) => Err(format!(": holds no box: {note}")),
        (true, None) => Err(": holds no box of a person; annotate with rectangles".to_owned()),
    }
}

/// Kinds of shapes other than rectangles.
const OTHER_SHAPES: [&str; 7] =
    ["polygon", "polyline", "points", "mask", "cuboid", "ellipse", "skeleton"];

/// Returns a note on the shapes that are not rectangles, if there are any.
fn other_shapes(root: &Node<'_, '_>) -> Option<String> {
    let counted = OTHER_SHAPES
        .map(|kind| (root.descendants().filter(|node| node.has_tag_name(kind)).count(), kind));
    let found: Vec<String> = counted
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, kind)| format!("{count} of kind {kind}"))
        .collect();
    (!found.is_empty()).then(|| {
        format!(
            "shapes that are no rectangles are left out ({}); draw rectangles",
            found.join(", ")
        )
    })
}

fn boxes<'a, 'b>(node: &Node<'a, 'b>) -> impl Iterator<Item = Node<'a, 'b>> {
    node.children().filter(|child| child.has_tag_name("box"))
}

/// Adds the boxes of a person in a video. CVAT also exports the boxes between key frames.
fn track(node: &Node<'_, '_>, rows: &mut Vec<Row>) -> Result<(), String> {
    // CVAT counts tracks from 0, which is not a valid ID of a person.
    let id = whole_number(node, "id", MOST_ID - 1)? + 1;
    for shape in boxes(node).filter(|shape| !is_set(shape, "outside")) {
        let key = shape.attribute("keyframe") != Some("0");
        let id = id_of(&shape)?.unwrap_or(id);
        let frame = frame_of(&shape, "frame")?;
        rows.push(row(node, &shape, frame, id, key)?);
    }
    Ok(())
}

/// Adds the boxes of an image, which get new IDs.
fn image(node: &Node<'_, '_>, rows: &mut Vec<Row>) -> Result<(), String> {
    let frame = frame_of(node, "id")?;
    for shape in boxes(node) {
        let id = id_of(&shape)?.ok_or_else(|| {
            let why = "a box without a number: give it an attribute `id`, or a group";
            at(&shape, why)
        })?;
        rows.push(row(&shape, &shape, frame, id, true)?);
    }
    Ok(())
}

/// Returns the ID that the annotator assigned: the attribute `id`, or the group.
fn id_of(shape: &Node<'_, '_>) -> Result<Option<i64>, String> {
    let own = attribute(shape, "id").or_else(|| attribute(shape, "track_id"));
    let group = shape.attribute("group_id").filter(|group| *group != "0");
    let Some(text) = own.or(group) else { return Ok(None) };
    let id = text.trim().parse().ok().filter(|id| (1..=MOST_ID).contains(id));
    id.map(Some).ok_or_else(|| {
        at(
            shape,
            &format!("the number of a person is `{text}`, expected 1 or more, up to {MOST_ID}"),
        )
    })
}

/// Returns an attribute that the annotator assigned to a box.
fn attribute<'a>(shape: &Node<'a, '_>, name: &str) -> Option<&'a str> {
    let mut all = shape.children().filter(|child| child.has_tag_name("attribute"));
    all.find(|child| child.attribute("name") == Some(name))?.text()
}

fn is_set(node: &Node<'_, '_>, name: &str) -> bool {
    node.attribute(name) == Some("1")
}

fn row(
    labelled: &Node<'_, '_>,
    shape: &Node<'_, '_>,
    frame: u32,
    id: i64,
    key: bool,
) -> Result<Row, String> {
    let [x, y] = [number(shape, "xtl")?, number(shape, "ytl")?];
    let [width, height] = [number(shape, "xbr")? - x, number(shape, "ybr")? - y];
    // Corners far apart have no finite distance.
    if ![width, height].iter().all(|size| *size > 0.0 && size.is_finite()) {
        return Err(at(shape, "a box without an area"));
    }
    let ignored = attribute(shape, "ignore").is_some_and(|text| text.trim() == "true");
    Ok(Row {
        frame,
        id,
        upper_body: Some(Region { x, y, width, height }),
        visible_body: None,
        head_in_camera_m: None,
        visible: if is_set(shape, "occluded") { OCCLUDED } else { 1.0 },
        occluder: "0".into(),
        ignore: ignored || labelled.attribute("label") == Some("ignore"),
        interpolated: 1,
        key,
        proposed: String::new(),
    })
}

fn number(node: &Node<'_, '_>, name: &str) -> Result<f64, String> {
    let text = node.attribute(name).unwrap_or_default();
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| at(node, &format!("`{name}` is `{text}`, expected a number")))
}

/// Returns an attribute that is a whole number from 0 to `most`.
fn whole_number(node: &Node<'_, '_>, name: &str, most: i64) -> Result<i64, String> {
    let text = node.attribute(name).unwrap_or_default();
    let value = text.parse::<i64>().ok().filter(|value| (0..=most).contains(value));
    value.ok_or_else(|| {
        at(node, &format!("`{name}` is `{text}`, expected a whole number from 0 to {most}"))
    })
}

/// Returns the number of a frame, from 1. CVAT counts from 0.
fn frame_of(node: &Node<'_, '_>, name: &str) -> Result<u32, String> {
    let number = whole_number(node, name, i64::from(MOST_FRAMES) - 1)?;
    Ok(u32::try_from(number).unwrap_or(MOST_FRAMES - 1) + 1)
}

fn at(node: &Node<'_, '_>, why: &str) -> String {
    let TextPos { row, .. } = node.document().text_pos_at(node.range().start);
    format!(", line {row}: {why}")
}

/// Returns MOTChallenge text of whole bodies, from which `eval` derives the upper bodies.
fn mot(rows: &[Row]) -> String {
    let mut bodies = Vec::new();
    for row in rows {
        bodies.extend(row.upper_body.map(|region| WholeBody {
            frame: row.frame,
            id: row.id,
            region,
            visible: row.visible,
            counts: !row.ignore,
        }));
    }
    boxes_csv(&bodies)
}

#[cfg(test)]
mod tests {
    use tagalong_eval::formats::people;

    use super::*;

    const VIDEO: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version><meta><task><name>walk</name></task></meta>
<track id="0" label="person" source="manual">
  <box frame="0" keyframe="1" outside="0" occluded="0" xtl="10.5" ytl="20" xbr="60.5" ybr="70" z_order="0"></box>
  <box frame="1" keyframe="0" outside="0" occluded="1" xtl="12.5" ytl="20" xbr="62.5" ybr="70" z_order="0"></box>
  <box frame="2" keyframe="1" outside="1" occluded="0" xtl="14" ytl="20" xbr="64" ybr="70" z_order="0"></box>
</track>
<track id="4" label="ignore"><box frame="1" keyframe="1" outside="0" occluded="0" xtl="1" ytl="2" xbr="31" ybr="32"/></track>
</annotations>"#;

    const IMAGES: &str = r#"<annotations><image id="7" name="a.png" width="640" height="480">
<box label="person" occluded="0" xtl="1" ytl="2" xbr="31" ybr="32"><attribute name="id">3</attribute></box>
<box label="person" occluded="0" xtl="9" ytl="2" xbr="39" ybr="32" group_id="5"><attribute name="ignore">true</attribute></box>
</image></annotations>"#;

    #[test]
    fn tracks_of_a_video_become_people() {
        let Read { rows, note } = parse(VIDEO).unwrap();
        assert_eq!(note, None);
        let seen: Vec<_> =
            rows.iter().map(|r| (r.frame, r.id, r.key, r.visible, r.ignore)).collect();
        let wanted = [(1, 1, true, 1.0, false), (2, 1, false, 0.5, false), (2, 5, true, 1.0, true)];
        assert_eq!(seen, wanted);
        let region = Region { x: 10.5, y: 20.0, width: 50.0, height: 50.0 };
        assert_eq!(rows[0].upper_body, Some(region));
        assert_eq!(people::parse(&people_csv(&rows).unwrap(), "made").unwrap(), rows);
        assert_eq!(mot(&rows).lines().next(), Some("1,1,10.5,20,50,50,1,1,1"));
    }

    #[test]
    fn boxes_of_images_take_the_numbers_that_they_were_given() {
        let rows = parse(IMAGES).unwrap().rows;
        let seen: Vec<_> = rows.iter().map(|row| (row.frame, row.id, row.ignore)).collect();
        assert_eq!(seen, [(8, 3, false), (8, 5, true)]);
    }

    #[test]
    fn polygons_are_told_and_a_file_of_them_alone_is_refused() {
        let polygon = r#"<polygon label="person" points="1,2;3,4;5,6"/>"#;
        let mixed = IMAGES.replace("</image>", &format!("{polygon}{polygon}</image>"));
        let read = parse(&mixed).unwrap();
        assert_eq!(read.rows.len(), 2);
        assert!(read.note.unwrap().contains("2 of kind polygon"));
        let alone = format!(r#"<annotations><image id="0">{polygon}</image></annotations>"#);
        let error = parse(&alone).unwrap_err();
        assert!(error.contains("no box") && error.contains("1 of kind polygon"), "{error}");
        assert!(parse("<annotations/>").unwrap_err().contains("no box"));
    }

    #[test]
    fn files_that_are_something_else_are_refused_with_line_and_reason() {
        let many_attributes: String = (0..2000).map(|n| format!("a{n}=\"\" ")).collect();
        for (text, cause) in [
            ("no xml", ": "),
            ("<a/>", "holds `a` and not `annotations`"),
            (&VIDEO.replace("xtl=\"12.5\"", "xtl=\"wide\""), ", line 5: `xtl` is `wide`"),
            (&VIDEO.replace("xbr=\"62.5\"", "xbr=\"2\""), ", line 5: a box without an area"),
            (&VIDEO.replace("frame=\"1\" keyframe=\"0\"", "frame=\"-1\""), "`frame` is `-1`"),
            (&VIDEO.replace("frame=\"0\"", "frame=\"1700000000\""), "line 4: `frame` is `17"),
            (
                &VIDEO.replace("id=\"4\"", "id=\"9223372036854775807\""),
                "`id` is `9223372036854775807`,",
            ),
            (&VIDEO.replace("id=\"4\"", "id=\"1e400\""), ", line 8: `id` is `1e400`"),
            (&VIDEO.replace("id=\"4\"", "id=\"0.5\""), ", line 8: `id` is `0.5`"),
            (
                &VIDEO
                    .replace("xtl=\"1\"", "xtl=\"-1e308\"")
                    .replace("xbr=\"31\"", "xbr=\"1e308\""),
                "a box without an area",
            ),
            (&IMAGES.replace(">3<", ">9223372036854775807<"), "the number of a person is `92"),
            (&IMAGES.replace("id=\"7\"", "id=\"4294967295\""), ", line 1: `id` is `4294967295`"),
            (&VIDEO.replace("id=\"4\"", "id=\"0\""), "person 1 is in CVAT's frame 1 twice"),
            (&IMAGES.replace(">3<", ">me<"), ", line 2: the number of a person is `me`"),
            (&IMAGES.replace(" group_id=\"5\"", ""), ", line 3: a box without a number"),
            (&IMAGES.replace("id=\"7\"", &many_attributes), ", line 1: an element with more than"),
            (&format!("<!DOCTYPE a [<!ENTITY b \"c\">]>{IMAGES}"), "DTD"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(cause), "{error}");
        }
    }
}
