//! Boxes of people in a folder of images: the JSON of COCO, or a CSV with a header.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tagalong_app::outcome::Failure;
use tagalong_config::{FileLimit, read_text};
use tagalong_eval::Region;
use tagalong_math::counted;

use super::truth::WholeBody;

/// Names of classes that are people.
const PEOPLE: [&str; 6] = ["person", "people", "pedestrian", "human", "man", "woman"];
/// Names of the columns for the image and for the ID of a person.
const IMAGES: [&str; 8] =
    ["image", "image_id", "image_name", "filename", "file_name", "file", "path", "frame"];
const IDS: [&str; 5] = ["track_id", "track", "person_id", "object_id", "trackid"];
const CLASSES: [&str; 5] = ["class", "label", "category", "class_name", "labelname"];
/// Names of the four columns of a box: two corners, or one corner and the size.
const CORNERS: [[&str; 4]; 3] =
    [["xmin", "ymin", "xmax", "ymax"], ["x1", "y1", "x2", "y2"], ["xtl", "ytl", "xbr", "ybr"]];
const SIZES: [[&str; 4]; 4] = [
    ["x", "y", "w", "h"],
    ["x", "y", "width", "height"],
    ["left", "top", "width", "height"],
    ["bb_left", "bb_top", "bb_width", "bb_height"],
];

/// Box of a person in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct PersonBox {
    /// Name of the image, as the file has it.
    pub image: String,
    /// ID of the person, where the file has IDs.
    pub id: Option<String>,
    /// Left, top, width and height, pixels.
    pub sides: [f64; 4],
    /// False for a person that counts neither as a miss nor as a false positive.
    pub counts: bool,
}

#[derive(Deserialize)]
struct Coco {
    images: Vec<CocoImage>,
    annotations: Vec<CocoBox>,
    #[serde(default)]
    categories: Vec<CocoCategory>,
}

#[derive(Deserialize)]
struct CocoImage {
    id: u64,
    file_name: String,
}

#[derive(Deserialize)]
struct CocoBox {
    image_id: u64,
    bbox: [f64; 4],
    category_id: Option<u64>,
    #[serde(default)]
    iscrowd: u8,
    track_id: Option<u64>,
    #[serde(default)]
    attributes: BTreeMap<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct CocoCategory {
    id: u64,
    name: String,
}

/// Returns the whole bodies in these images, which are in the order of the frames, and notes on
/// boxes that were left out.
///
/// # Errors
/// A file that cannot be read, has another format, or names none of the images.
pub fn read(file: &Path, images: &[PathBuf]) -> Result<(Vec<WholeBody>, Vec<String>), Failure> {
    read_boxes(file)
        .and_then(|boxes| placed(boxes, images))
        .map_err(|why| Failure::failed(format!("{}: {why}", file.display())))
}

fn read_boxes(file: &Path) -> Result<Vec<PersonBox>, String> {
    let text = read_text(file, FileLimit::Table).map_err(|error| error.to_string())?;
    person_boxes(&text)
}

/// Parses the people of an annotation file: COCO if it is JSON, otherwise a CSV with a header.
///
/// # Errors
/// A sentence with the supported formats, and with the line of a CSV.
pub fn person_boxes(text: &str) -> Result<Vec<PersonBox>, String> {
    if text.trim_start().starts_with(['{', '[']) { coco(text) } else { csv(text) }
}

fn coco(text: &str) -> Result<Vec<PersonBox>, String> {
    let coco: Coco = serde_json::from_str(text).map_err(|why| {
        format!(
            "{why}; of JSON that of COCO is read: `images` with `id` and `file_name`, `annotations` with \
             `image_id`, `bbox` (left, top, width, height) and, for IDs, `track_id`; other tools convert to it"
        )
    })?;
    let mut names = BTreeMap::new();
    for CocoImage { id, file_name } in coco.images {
        names.insert(id, file_name);
    }
    let classes: BTreeMap<u64, &str> =
        coco.categories.iter().map(|it| (it.id, &*it.name)).collect();
    let kept = people_of(classes.values().copied())?;
    let mut boxes = Vec::new();
    for found in coco.annotations {
        let class = found.category_id.and_then(|id| classes.get(&id));
        if class.is_some_and(|class| !kept.contains(&class.to_lowercase())) {
            continue;
        }
        let Some(image) = names.get(&found.image_id).cloned() else {
            return Err(format!(
                "an annotation is of image {}, which is not listed",
                found.image_id
            ));
        };
        let attribute = found.attributes.get("track_id").map(ToString::to_string);
        let id = found.track_id.map(|id| id.to_string()).or(attribute);
        boxes.push(PersonBox { image, id, sides: found.bbox, counts: found.iscrowd == 0 });
    }
    Ok(boxes)
}

/// Returns the lower-case names of the classes of people, or the only class.
fn people_of<'a>(classes: impl Iterator<Item = &'a str>) -> Result<BTreeSet<String>, String> {
    let all: BTreeSet<String> = classes.map(str::to_lowercase).collect();
    let people: BTreeSet<String> =
        all.iter().filter(|name| PEOPLE.contains(&name.as_str())).cloned().collect();
    if people.is_empty() && all.len() > 1 {
        let named: Vec<&str> = all.iter().take(8).map(String::as_str).collect();
        return Err(format!("no class is `person`; there are: {}", named.join(", ")));
    }
    Ok(if people.is_empty() { all } else { people })
}

/// Indices of the columns of a CSV.
struct Columns {
    image: usize,
    sides: Vec<usize>,
    has_corners: bool,
    id: Option<usize>,
    class: Option<usize>,
}

impl Columns {
    fn of(header: &[String]) -> Option<Self> {
        let corners = CORNERS.iter().find_map(|names| places(header, names));
        // Width and height beside corners are those of the image.
        let has_corners = corners.is_some();
        let sizes = SIZES.iter().find_map(|names| places(header, names));
        let sides = corners.or(sizes).or_else(|| places(header, &["bbox"]))?;
        let image = first_of(header, &IMAGES)?;
        let id = first_of(header, &IDS);
        let class = first_of(header, &CLASSES);
        Some(Self { image, sides, has_corners, id, class })
    }

    /// Returns the box of a line, and its class; `None` without an image or four numbers.
    fn person(&self, cells: &[String]) -> Option<(Option<String>, PersonBox)> {
        let words = self.sides.iter().filter_map(|at| cells.get(*at)).flat_map(|cell| {
            cell.split(['[', ']', '(', ')', ',', ' ']).filter(|word| !word.is_empty())
        });
        let numbers: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
        let [x, y, third, fourth] = <[f64; 4]>::try_from(numbers).ok()?;
        let sides =
            if self.has_corners { [x, y, third - x, fourth - y] } else { [x, y, third, fourth] };
        let id = self.id.and_then(|at| cell(cells, at));
        let person = PersonBox { image: cell(cells, self.image)?, id, sides, counts: true };
        Some((self.class.and_then(|at| cell(cells, at)), person))
    }
}

/// Returns the indices of all columns with these names; `None` if one of them is missing.
fn places(header: &[String], names: &[&str]) -> Option<Vec<usize>> {
    names.iter().map(|name| first_of(header, &[*name])).collect()
}

/// Returns the index of the first column that has one of these names.
fn first_of(header: &[String], names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| header.iter().position(|it| it.eq_ignore_ascii_case(name)))
}

/// Returns a cell if it exists and is not empty.
fn cell(cells: &[String], at: usize) -> Option<String> {
    cells.get(at).filter(|cell| !cell.is_empty()).cloned()
}

fn csv(text: &str) -> Result<Vec<PersonBox>, String> {
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let header = lines.next().map_or("", |(_, line)| line);
    let separator = [';', '\t'].into_iter().find(|it| header.contains(*it)).unwrap_or(',');
    let columns = Columns::of(&cells(header, separator)).ok_or_else(|| {
        format!(
            "its first line, `{header}`, names no image and box; a CSV has the columns image, x, y, w, h; or \
             image, xmin, ymin, xmax, ymax; or image and bbox (left, top, width and height in quotes); and \
             track_id and class where it has them"
        )
    })?;
    let mut rows = Vec::new();
    for (number, line) in lines {
        let row = columns.person(&cells(line, separator));
        let row = row.ok_or_else(|| {
            format!("line {number}: `{line}` has no image, or no box of four numbers")
        })?;
        rows.push(row);
    }
    let kept = people_of(rows.iter().filter_map(|(class, _)| class.as_deref()))?;
    rows.retain(|(class, _)| {
        class.as_ref().is_none_or(|class| kept.contains(&class.to_lowercase()))
    });
    Ok(rows.into_iter().map(|(_, person)| person).collect())
}

/// Returns the cells of a line; a separator in quotes does not split.
fn cells(line: &str, separator: char) -> Vec<String> {
    let mut cells = vec![String::new()];
    for (part, text) in line.split('"').enumerate() {
        for (piece, text) in text.split(separator).enumerate() {
            let is_quoted = part % 2 == 1;
            match cells.last_mut() {
                Some(cell) if piece == 0 => cell.push_str(text),
                Some(cell) if is_quoted => cell.extend([String::from(separator), text.to_owned()]),
                _ => cells.push(text.to_owned()),
            }
        }
    }
    cells.iter().map(|cell| cell.trim().to_owned()).collect()
}

/// Assigns to each box the frame of its image and an ID.
fn placed(
    boxes: Vec<PersonBox>,
    images: &[PathBuf],
) -> Result<(Vec<WholeBody>, Vec<String>), String> {
    let mut frames = BTreeMap::new();
    for (frame, image) in (1..).zip(images) {
        frames.insert(image.file_name().unwrap_or_default(), frame);
        frames.entry(image.file_stem().unwrap_or_default()).or_insert(frame);
    }
    let has_ids = boxes.iter().all(|person| person.id.is_some());
    let mut numbers: BTreeMap<String, i64> = BTreeMap::new();
    let mut bodies: Vec<WholeBody> = Vec::new();
    let [mut elsewhere, mut empty] = [0, 0];
    let example = boxes.first().map(|person| person.image.clone()).unwrap_or_default();
    for PersonBox { image, id, sides: [x, y, width, height], counts } in boxes {
        let name = image.rsplit(['/', '\\']).next().unwrap_or_default();
        let Some(frame) = frames.get(OsStr::new(name)).copied() else {
            elsewhere += 1;
            continue;
        };
        // Boxes in fractions of the image size are also smaller than a pixel.
        if ![x, y].iter().all(|v| v.is_finite()) || !(1.0..1e6).contains(&width.min(height)) {
            empty += 1;
            continue;
        }
        // Without IDs people are numbered within their image.
        let key = id.filter(|_| has_ids).unwrap_or_else(|| format!("box {}", bodies.len()));
        let next = numbers.len() as i64 + 1;
        let id = *numbers.entry(key).or_insert(next);
        let region = Region { x, y, width, height };
        bodies.push(WholeBody { frame, id, region, visible: 1.0, counts });
    }
    bodies.sort_by_key(|body| (body.frame, body.id));
    if bodies.is_empty() {
        return Err(format!(
            "no box of a person of a pixel or more is in an image of the folder ({elsewhere} are in images \
             such as `{example}`, {empty} are smaller: boxes in fractions have to be multiplied by the size)"
        ));
    }
    let mut notes = Vec::new();
    if elsewhere > 0 {
        notes.push(format!(
            "{} left out: their images are not in the folder",
            counted(elsewhere, "annotation")
        ));
    }
    if empty > 0 {
        notes.push(format!(
            "{} left out that are smaller than a pixel",
            counted(empty, "annotation")
        ));
    }
    if !has_ids {
        notes.push(
            "the boxes have no IDs (track_id): HOTA, IDF1 and ID switches mean nothing".into(),
        );
    }
    Ok((bodies, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn images() -> [PathBuf; 2] {
        ["set/a1.jpg", "set/a2.jpg"].map(PathBuf::from)
    }

    /// Frames, IDs and boxes of a file.
    fn told(text: &str) -> Result<Vec<(u32, i64, [f64; 4])>, String> {
        let (bodies, _) = placed(person_boxes(text)?, &images())?;
        let told = bodies.iter().map(|WholeBody { frame, id, region, .. }| {
            (*frame, *id, [region.x, region.y, region.width, region.height])
        });
        Ok(told.collect())
    }

    const FOUND: [(u32, i64, [f64; 4]); 2] =
        [(1, 2, [5.0, 6.0, 20.0, 50.0]), (2, 1, [1.0, 2.0, 30.0, 80.0])];

    #[test]
    fn coco_is_read_with_ids_classes_and_images_in_any_order() {
        let text = r#"{"images": [{"id": 8, "file_name": "x/a2.jpg"}, {"id": 7, "file_name": "a1.jpg"}],
            "categories": [{"id": 1, "name": "Person"}, {"id": 2, "name": "car"}], "annotations": [
            {"image_id": 8, "category_id": 1, "bbox": [1, 2, 30, 80], "track_id": 40},
            {"image_id": 7, "category_id": 2, "bbox": [9, 9, 9, 9], "track_id": 41},
            {"image_id": 7, "category_id": 1, "bbox": [5, 6, 20, 50], "attributes": {"track_id": 42}}]}"#;
        assert_eq!(told(text), Ok(FOUND.to_vec()));
        let crowd = text.replace("\"track_id\": 40", "\"track_id\": 40, \"iscrowd\": 1");
        let people = person_boxes(&crowd).unwrap();
        assert_eq!([people[0].counts, people[1].counts], [false, true]);
        let other = told(&text.replace("Person", "bus")).unwrap_err();
        assert_eq!(other, "no class is `person`; there are: bus, car");
        assert!(
            told("{\"shapes\": []}").unwrap_err().contains("`images` with `id` and `file_name`")
        );
        assert!(told(&text.replace("\"id\": 7", "\"id\": 9")).unwrap_err().contains("image 7"));
    }

    #[test]
    fn a_csv_has_corners_or_sizes_or_a_quoted_box() {
        for text in [
            "filename,width,height,class,xmin,ymin,xmax,ymax,track_id\n\
             a2.jpg,640,480,person,1,2,31,82,p\na1.jpg,640,480,person,5,6,25,56,q\n\
             a1.jpg,640,480,dog,5,6,25,56,r\n",
            "Image;X;Y;W;H;Track_ID\na2;1;2;30;80;p\na1;5;6;20;50;q\n",
            "image_id,track,bbox\na2,p,\"[1.0, 2, 30, 80]\"\n\na1,q,\"5, 6, 20, 50\"\n",
        ] {
            assert_eq!(told(text), Ok(FOUND.to_vec()), "{text}");
        }
        assert!(told("1,2,3,4\n").unwrap_err().contains("`1,2,3,4`, names no image and box"));
        assert!(told("image,x,y,w,h\na1,1,2,x,4\n").unwrap_err().starts_with("line 2: "));
        assert!(told("image,x,y,w,h\na1,0.1,0.2,0.3,0.4\n").unwrap_err().contains("fractions"));
    }

    #[test]
    fn boxes_that_are_left_out_are_counted() {
        let text = "image,x,y,w,h\na1,1,2,30,80\nb,1,2,30,80\na1,1,2,0,80\na2,1,2,30,80\n";
        let (bodies, notes) = placed(person_boxes(text).unwrap(), &images()).unwrap();
        assert_eq!((bodies.len(), notes.len()), (2, 3), "{notes:?}");
        assert!(notes[0].starts_with("1 annotation left out"), "{notes:?}");
        assert_ne!(bodies[0].id, bodies[1].id, "without IDs no person is in two images");
    }
}
