//! The annotation of one log: film, people, and the file that is written after every change.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use nalgebra::Point2;
use serde::Serialize;
use tagalong_config::{FileLimit, read_text};
use tagalong_eval::Region;
use tagalong_eval::formats::people::{self, Row};

use crate::document::{Change, Document};
use crate::film::{Film, Place};
use crate::person::{Key, Person, tenths};

/// A person in a frame in the format of the page: frame, box, 1 for a key, 1 for ignored, the
/// visible fraction, the distance in m or null, and 1 for a proposed box that is not reviewed.
type PageRow = (u32, [f64; 4], u8, u8, f64, Option<f64>, u8);

/// Answer to a change, also used for the initial state.
#[derive(Debug, Serialize)]
pub struct Answer {
    /// Boxes of the people that changed; empty for a person that was removed.
    pub people: BTreeMap<i64, Option<Vec<PageRow>>>,
    /// True if there is a change to undo.
    pub undo: bool,
    /// True if there is a change to redo.
    pub redo: bool,
    /// Person of a new box.
    pub select: Option<i64>,
    /// True if everything is saved.
    pub saved: bool,
}

/// Constant content of the page.
#[derive(Debug, Serialize)]
pub struct About {
    /// Name of the log.
    pub log: String,
    /// The file that is written.
    pub file: String,
    /// Origin of the initial boxes, in words.
    pub origin: String,
    /// Numbers of the frames.
    pub frames: Vec<u32>,
    /// Times of the frames since the first, s.
    pub t: Vec<f64>,
    /// Width and height of the images, pixels.
    pub size: [usize; 2],
    /// True if positions come from depth.
    pub depth: bool,
}

/// Annotation of one log.
#[derive(Debug)]
pub struct Session {
    film: Arc<Film>,
    document: Document,
    output: PathBuf,
    /// Measured positions with the boxes in which they were measured.
    places: BTreeMap<(i64, u32), (Region, Option<Place>)>,
    /// Length and time of the file when this session last read or wrote it; `None` if there was
    /// none.
    known: Option<(u64, SystemTime)>,
    saved: bool,
}

impl Session {
    /// Starts with some people; `output` is written after the first change.
    pub fn new(film: Arc<Film>, people: BTreeMap<i64, Person>, output: PathBuf) -> Self {
        let known = stamp_of(&output);
        let saved = known.is_some();
        let document = Document::of(people);
        Self { film, document, output, places: BTreeMap::new(), known, saved }
    }

    /// Measures the positions of all people, frame by frame, so that later changes have little to
    /// measure.
    pub fn measure(&mut self, mut told: impl FnMut(f64, u32)) {
        let film = Arc::clone(&self.film);
        let count = film.shots().len().max(1) as f64;
        for (done, shot) in film.shots().iter().enumerate() {
            let number = shot.number;
            let people = self.document.people().iter();
            let here = people.filter_map(|(id, person)| Some((*id, person.at(number)?)));
            let (ids, regions): (Vec<i64>, Vec<Region>) = here
                .filter(|(_, key)| key.head_in_camera_m.is_none())
                .map(|(id, key)| (id, key.region))
                .unzip();
            let places = film.places(number, &regions);
            for ((id, region), place) in ids.into_iter().zip(regions).zip(places) {
                self.places.insert((id, number), (region, place));
            }
            told(done as f64 / count, number);
        }
    }

    /// Returns the constant content of the page.
    pub fn about(&self, log: &Path, origin: &str) -> About {
        let shots = self.film.shots();
        let size = shots.first().map_or([0, 0], |shot| [shot.camera.width, shot.camera.height]);
        About {
            log: log.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            file: self.output.display().to_string(),
            origin: origin.to_owned(),
            frames: shots.iter().map(|shot| shot.number).collect(),
            t: shots.iter().map(|shot| (shot.t_s * 1e3).round() * 1e-3).collect(),
            size,
            depth: self.film.has_depth(),
        }
    }

    /// Returns all people.
    pub fn everything(&mut self) -> Answer {
        let all = self.document.people().keys().copied().collect();
        self.answer(&all, None)
    }

    /// Makes a change and saves the file.
    ///
    /// # Errors
    /// A sentence for the user: an invalid change, or a file that cannot be written or that another
    /// program has changed.
    pub fn apply(&mut self, change: &Change) -> Result<Answer, String> {
        self.check_file()?;
        let change = self.resolved(change)?;
        let select = match &change {
            Change::Box { id, .. } => Some(id.unwrap_or_else(|| self.document.free_id())),
            Change::Number { to, .. } => Some(*to),
            _ => None,
        };
        let changed = self.document.apply(&change)?;
        if !changed.is_empty() {
            // The change stays on the page even if the disk is full: the next save has it.
            self.saved = false;
            self.save()?;
        }
        Ok(self.answer(&changed, select))
    }

    /// Checks the frame of a change, and turns a click on a head into a box.
    fn resolved(&self, change: &Change) -> Result<Change, String> {
        let frame = match change {
            Change::Undo | Change::Redo => return Ok(change.clone()),
            Change::Box { frame, .. }
            | Change::Head { frame, .. }
            | Change::Number { frame, .. }
            | Change::Delete { frame, .. }
            | Change::Pin { frame, .. }
            | Change::Unpin { frame, .. }
            | Change::Fill { frame, .. }
            | Change::Review { frame }
            | Change::Note { frame, .. } => *frame,
        };
        if self.film.shot(frame).is_none() {
            return Err(format!("the log has no frame {frame}"));
        }
        let Change::Head { id, at: [x, y], .. } = change else { return Ok(change.clone()) };
        if !(x.is_finite() && y.is_finite()) {
            return Err("a head is at a pixel of the image".into());
        }
        let like = id.and_then(|id| self.latest(id, frame));
        let region = self.film.upper_body(frame, Point2::new(*x, *y), like.as_ref());
        let region = region.ok_or_else(|| format!("the log has no frame {frame}"))?;
        let region = [region.x, region.y, region.width, region.height];
        Ok(Change::Box { frame, id: *id, region })
    }

    /// Returns the box of a person in a frame, or in the nearest earlier one.
    fn latest(&self, id: i64, frame: u32) -> Option<Region> {
        let person = self.document.people().get(&id)?;
        let before = person.frames().take_while(|at| *at <= frame).last();
        person.at(before.or_else(|| person.frames().next())?).map(|key| key.region)
    }

    fn answer(&mut self, changed: &BTreeSet<i64>, select: Option<i64>) -> Answer {
        let people = changed.iter().map(|id| (*id, self.page_rows(*id))).collect();
        let (undo, redo) = self.document.can();
        let select = select.filter(|id| self.document.people().contains_key(id));
        Answer { people, undo, redo, select, saved: self.saved }
    }

    fn page_rows(&mut self, id: i64) -> Option<Vec<PageRow>> {
        let person = self.document.people().get(&id)?.clone();
        let film = Arc::clone(&self.film);
        let numbers = person.frames().filter(|number| film.shot(*number).is_some());
        let rows = numbers.filter_map(|number| {
            let key = person.at(number)?;
            let Region { x, y, width, height } = tenths(key.region);
            let box_px = [x, y, width, height];
            let head = self.head(id, number, &key);
            let distance = head.map(|(head, _)| head.iter().map(|v| v * v).sum::<f64>().sqrt());
            let distance = distance.map(|m| (m * 100.0).round() / 100.0);
            let is_key = u8::from(person.key(number).is_some());
            let proposed = u8::from(!key.proposed.is_empty());
            Some((number, box_px, is_key, u8::from(key.ignore), key.visible, distance, proposed))
        });
        Some(rows.collect::<Vec<_>>())
    }

    /// Returns the position of a person and its origin; it is measured if the file had none.
    fn head(&mut self, id: i64, number: u32, key: &Key) -> Option<([f64; 3], u8)> {
        if let Some(head) = key.head_in_camera_m {
            return Some((head, key.interpolated));
        }
        let cached = self.places.get(&(id, number)).filter(|(region, _)| *region == key.region);
        let place = match cached {
            Some((_, place)) => *place,
            None => {
                let place = self.film.places(number, &[key.region]).into_iter().next().flatten();
                self.places.insert((id, number), (key.region, place));
                place
            }
        };
        place.map(|place| (place.head_in_camera_m, if place.by_torso { 2 } else { 0 }))
    }

    /// Returns the rows of the file, ordered by frame and ID.
    fn rows(&mut self) -> Vec<Row> {
        let people = self.document.people().clone();
        let mut rows = Vec::new();
        for (id, person) in &people {
            let mut own: Vec<Row> =
                person.frames().filter_map(|number| self.row(*id, person, number)).collect();
            self.fill_places(person, &mut own);
            rows.extend(own);
        }
        rows.sort_by_key(|row| (row.frame, row.id));
        rows
    }

    fn row(&mut self, id: i64, person: &Person, number: u32) -> Option<Row> {
        let camera = Arc::clone(&self.film.shot(number)?.camera);
        let found = person.at(number)?;
        let is_key = person.key(number).is_some();
        let region = if is_key { found.region } else { tenths(found.region) };
        let region = clipped(region, camera.width, camera.height)?;
        let head = self.head(id, number, &found);
        // The file has 1 for boxes and positions that were not measured.
        let measured = head.map_or(1, |(_, origin)| origin);
        Some(Row {
            frame: number,
            id,
            upper_body: Some(region),
            visible_body: found.visible_body,
            head_in_camera_m: head.map(|(head, _)| head),
            visible: found.visible,
            occluder: found.occluder,
            ignore: found.ignore,
            interpolated: if is_key { measured } else { 1 },
            key: is_key,
            proposed: found.proposed,
        })
    }

    /// Fills in the positions of a person in frames where depth does not show the person, for
    /// example behind another one. The depth is interpolated between the measured positions,
    /// relative to the depth by the size of the box.
    fn fill_places(&self, person: &Person, rows: &mut [Row]) {
        let known: Vec<(u32, f64)> = rows
            .iter()
            // Positions that were filled in before do not count as measured.
            .filter(|row| row.interpolated != 1 || !row.key)
            .filter_map(|row| {
                let size = person.at(row.frame).map_or(0.0, |key| key.region.width);
                Some((row.frame, row.head_in_camera_m?[2] * size))
            })
            .collect();
        for row in rows.iter_mut().filter(|row| row.head_in_camera_m.is_none()) {
            let (Some(key), Some(product)) = (person.at(row.frame), at_frame(&known, row.frame))
            else {
                continue;
            };
            let depth_m = product / key.region.width.max(1.0);
            row.head_in_camera_m = self.film.head(row.frame, &key.region, depth_m);
            row.interpolated = 1;
        }
    }

    /// Refuses to replace a file that another program has written since.
    fn check_file(&self) -> Result<(), String> {
        if stamp_of(&self.output) == self.known {
            return Ok(());
        }
        let shown = self.output.display();
        Err(format!(
            "{shown} was changed by another program; copy your version of it, and start `tagalong \
             annotate` again to continue with it"
        ))
    }

    /// Writes the file atomically.
    ///
    /// # Errors
    /// A sentence that names the file.
    pub fn save(&mut self) -> Result<(), String> {
        self.check_file()?;
        let rows = self.rows();
        write_whole(&self.output, &rows)
            .map_err(|error| format!("cannot write {}: {error}", self.output.display()))?;
        self.known = stamp_of(&self.output);
        self.saved = true;
        Ok(())
    }
}

/// Returns the value of a frame, interpolated between known frames, or that of the nearest one.
fn at_frame(known: &[(u32, f64)], frame: u32) -> Option<f64> {
    let after = known.partition_point(|(other, _)| *other < frame);
    let before = after.checked_sub(1).and_then(|at| known.get(at));
    match (before, known.get(after)) {
        (Some((first, a)), Some((last, b))) => {
            let share = f64::from(frame - first) / f64::from((last - first).max(1));
            Some(a + (b - a) * share)
        }
        (one, other) => one.or(other).map(|(_, value)| *value),
    }
}

/// Returns the part of a box inside the image, in tenths of a pixel where it is cut; `None` if
/// there is none.
fn clipped(region: Region, columns: usize, rows: usize) -> Option<Region> {
    let right = (region.x + region.width).min(columns as f64);
    let bottom = (region.y + region.height).min(rows as f64);
    let x = region.x.max(0.0);
    let y = region.y.max(0.0);
    let inside = tenths(Region { x, y, width: right - x, height: bottom - y });
    let is_whole = inside == tenths(region);
    let is_seen = inside.width >= 1.0 && inside.height >= 1.0;
    is_seen.then_some(if is_whole { region } else { inside })
}

fn stamp_of(path: &Path) -> Option<(u64, SystemTime)> {
    let about = fs::metadata(path).ok()?;
    Some((about.len(), about.modified().ok()?))
}

/// Writes to a temporary file beside the file first, so that a kill at any time leaves the old or
/// the new file.
fn write_whole(path: &Path, rows: &[Row]) -> io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    let partial = PathBuf::from(name);
    let mut out = BufWriter::new(File::create(&partial)?);
    people::write(&mut out, rows)?;
    out.flush()?;
    out.get_ref().sync_all()?;
    fs::rename(&partial, path)
}

/// Reads the people of a file that is continued.
///
/// # Errors
/// A sentence that names the file: a line that cannot be read, a frame that the log does not have,
/// or a person twice in a frame.
pub fn read_people(path: &Path, film: &Film) -> Result<BTreeMap<i64, Person>, String> {
    let name = path.display().to_string();
    let text = read_text(path, FileLimit::Table)
        .map_err(|error| format!("cannot read {name}: {error}"))?;
    let rows = people::parse(&text, &name).map_err(|error| error.to_string())?;
    let mut keys: BTreeMap<i64, BTreeMap<u32, Key>> = BTreeMap::new();
    let mut shown: BTreeMap<i64, BTreeSet<u32>> = BTreeMap::new();
    for row in rows {
        let id = row.id;
        let frame = row.frame;
        if film.shot(frame).is_none() {
            return Err(format!("{name}: frame {frame} is not in the log; is it of another one?"));
        }
        if !shown.entry(id).or_default().insert(frame) {
            return Err(format!("{name}: person {id} is in frame {frame} twice; remove one row"));
        }
        let is_key = row.key;
        let Some(key) = key_of(row, film) else { continue };
        if is_key {
            keys.entry(id).or_default().insert(frame, key);
        }
    }
    Ok(keys
        .into_iter()
        .map(|(id, keys)| (id, Person::of(keys, shown.get(&id).unwrap_or(&BTreeSet::new()))))
        .collect())
}

/// Returns the key of a row; `None` for a position behind the camera.
fn key_of(row: Row, film: &Film) -> Option<Key> {
    let camera = &film.shot(row.frame)?.camera;
    let region = match &row.upper_body {
        Some(region) => squared(region, camera.width as f64, camera.height as f64),
        None => film.region_of(row.frame, row.head_in_camera_m?)?,
    };
    Some(Key {
        region,
        visible: row.visible,
        ignore: row.ignore,
        occluder: row.occluder,
        visible_body: row.visible_body,
        head_in_camera_m: row.head_in_camera_m,
        interpolated: row.interpolated,
        proposed: row.proposed,
    })
}

/// Returns the complete square of a box that the file has cut off at the image border.
fn squared(region: &Region, columns: f64, rows: f64) -> Region {
    let Region { mut x, mut y, mut width, mut height } = *region;
    let side = width.max(height);
    let is_left = x <= 0.0;
    if width < side && (is_left || x + width >= columns) {
        x -= if is_left { side - width } else { 0.0 };
        width = side;
    }
    let is_top = y <= 0.0;
    if height < side && (is_top || y + height >= rows) {
        y -= if is_top { side - height } else { 0.0 };
        height = side;
    }
    let whole = Region { x, y, width, height };
    if whole == *region { whole } else { tenths(whole) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::Scope;
    use crate::film::tests::film;

    fn session(output: &Path) -> Session {
        Session::new(Arc::new(film(12)), BTreeMap::new(), output.to_owned())
    }

    fn head(frame: u32, id: Option<i64>, x: f64) -> Change {
        Change::Head { frame, id, at: [x, 90.0] }
    }

    #[test]
    fn every_change_is_in_the_file_at_once_and_the_file_can_be_continued() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("walk.people.csv");
        let mut first = session(&path);
        assert!(!path.exists(), "nothing to save yet");
        let answer = first.apply(&head(1, None, 150.0)).unwrap();
        assert_eq!((answer.select, answer.saved, answer.undo), (Some(1), true, true));
        first.apply(&head(9, Some(1), 170.0)).unwrap();
        first.apply(&Change::Delete { frame: 4, id: 1, scope: Scope::Frame }).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let rows = people::parse(&text, "walk").unwrap();
        assert_eq!(rows.iter().map(|row| row.frame).collect::<Vec<_>>(), [1, 2, 3, 5, 6, 7, 8, 9]);
        assert!(rows.iter().all(|row| row.head_in_camera_m.is_some()), "depth fills the place in");
        let keys: Vec<_> = rows.iter().map(|row| (row.key, row.interpolated)).collect();
        assert_eq!((keys[0], keys[1]), ((true, 0), (false, 1)));
        // Another process continues where this one was killed.
        let people = read_people(&path, &film(12)).unwrap();
        let mut second = Session::new(Arc::new(film(12)), people, path.clone());
        second.apply(&Change::Note { frame: 9, id: 1, ignore: Some(true), visible: None }).unwrap();
        second
            .apply(&Change::Note { frame: 9, id: 1, ignore: Some(false), visible: None })
            .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        assert!(!home.path().join("walk.people.csv.partial").exists());
    }

    #[test]
    fn a_person_whom_depth_does_not_show_is_placed_between_the_frames_around() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("hidden.people.csv");
        let mut session = session(&path);
        session.apply(&head(1, None, 160.0)).unwrap();
        let aside = [20.0, 73.0, 59.0, 59.0];
        // Before the wall, whose depth is not that of a person of this size.
        session.apply(&Change::Box { frame: 3, id: Some(1), region: aside }).unwrap();
        session.apply(&head(5, Some(1), 160.0)).unwrap();
        let first = fs::read_to_string(&path).expect("the file is there");
        let rows = people::parse(&first, "hidden").expect("the file is valid");
        let [x, _, z] = rows[2].head_in_camera_m.unwrap();
        assert!((z - 2.5).abs() < 0.05 && x < -0.9, "{:?}", rows[2]);
        assert_eq!((rows[2].key, rows[2].interpolated), (true, 1));
        let mut again =
            Session::new(Arc::new(film(12)), read_people(&path, &film(12)).unwrap(), path.clone());
        again.save().unwrap();
        let second = fs::read_to_string(&path).expect("the file is there");
        assert_eq!(people::parse(&second, "hidden").expect("the file is valid"), rows);
    }

    #[test]
    fn a_file_that_another_program_changed_is_not_replaced() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("walk.people.csv");
        let mut session = session(&path);
        session.apply(&head(1, None, 150.0)).unwrap();
        fs::write(&path, "frame,id,ub_x,ub_y,ub_w,ub_h\n").unwrap();
        let error = session.apply(&head(2, None, 150.0)).unwrap_err();
        assert!(error.contains("another program"), "{error}");
        assert!(session.save().is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "frame,id,ub_x,ub_y,ub_w,ub_h\n");
    }

    #[test]
    fn an_old_file_keeps_every_cell_that_is_not_touched() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("old.people.csv");
        let old = "frame,id,ub_x,ub_y,ub_w,ub_h,vis_x,vis_y,vis_w,vis_h,head_x,head_y,head_z,visible,\
                   occluder,ignore,interpolated\n3,7,10,20,50,50,1,2,3,4,0.5,-0.3,2.5,0.75,border,1,2\n\
                   6,7,20,20,50,50,1,2,3,4,0.6,-0.3,2.5,0.5,2,0,1\n";
        fs::write(&path, old).unwrap();
        let people = read_people(&path, &film(12)).unwrap();
        let mut session = Session::new(Arc::new(film(12)), people, path.clone());
        session.apply(&head(1, None, 150.0)).unwrap();
        let new = fs::read_to_string(&path).unwrap();
        let wanted: Vec<String> = old.lines().skip(1).map(|line| format!("{line},1,")).collect();
        assert_eq!(new.lines().skip(2).collect::<Vec<_>>(), wanted, "{new}");
    }

    #[test]
    fn boxes_that_the_border_cuts_come_back_whole_and_are_written_cut() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("cut.people.csv");
        let mut session = session(&path);
        let whole = [[-20.3, 50.0], [290.0, 50.0], [100.0, -20.0], [100.0, 200.0], [100.0, 50.0]];
        for (frame, [x, y]) in (1..).step_by(2).zip(whole) {
            let region = [x, y, 60.0, 60.0];
            session.apply(&Change::Box { frame, id: Some(1), region }).unwrap();
        }
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.lines().any(|line| line.starts_with("1,1,0,50,39.7,60,")), "{text}");
        let people = read_people(&path, &film(12)).unwrap();
        for (frame, [x, y]) in (1..).step_by(2).zip(whole) {
            let Region { x: left, y: top, width, height } = people[&1].at(frame).unwrap().region;
            assert_eq!([left, top, width, height], [x, y, 60.0, 60.0]);
        }
        let mut again = Session::new(Arc::new(film(12)), people, path.clone());
        again.save().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    fn places_without_boxes_get_boxes() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("places.people.csv");
        fs::write(&path, "frame,id,head_x,head_y,head_z\n3,7,0,-0.2,2.5\n").unwrap();
        let people = read_people(&path, &film(12)).unwrap();
        let region = people[&7].at(3).unwrap().region;
        assert!((region.width - 59.3).abs() < 1.0, "{region:?}");
    }

    #[test]
    fn files_that_do_not_fit_are_refused_with_the_reason() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a.people.csv");
        for (rows, cause) in [
            ("99,1,1,1,9,9\n", "frame 99 is not in the log"),
            ("2,1,1,1,9,9\n2,1,1,1,9,9\n", "person 1 is in frame 2 twice"),
            ("2,1,x,1,9,9\n", "line 2: `ub_x` is `x`"),
        ] {
            fs::write(&path, format!("frame,id,ub_x,ub_y,ub_w,ub_h\n{rows}")).unwrap();
            let error = read_people(&path, &film(12)).unwrap_err();
            assert!(error.contains(cause) && error.contains("a.people.csv"), "{error}");
        }
    }

    #[test]
    fn a_change_in_a_frame_that_is_not_there_is_refused() {
        let home = tempfile::tempdir().unwrap();
        let mut session = session(&home.path().join("a.people.csv"));
        for wrong in [head(0, None, 1.0), head(13, None, 1.0), head(1, None, f64::NAN)] {
            assert!(session.apply(&wrong).is_err(), "{wrong:?}");
        }
    }
}
