//! Chosen settings, with their scores.

use std::collections::BTreeMap;

use crate::tuning::{
    Choice, Figures, Objective, Poll, Search, Weights, leave_one_out, mean, shown_value,
    weighted_mean,
};
use serde::Serialize;
use tagalong_app::outcome::Failure;
use tagalong_app::serialize::to_json;
use tagalong_report::{Cell, Row, Table};

use super::RoomsArgs;
use super::contest::{Contestant, Location};
use super::pairs::{Pair, by_log, differences, pairs};
use super::work::{Desk, Run};
use crate::plan::Annotated;

/// Data of the tables.
#[derive(Serialize)]
pub struct Report {
    objective: Objective,
    budget: u16,
    seed: u64,
    rooms: Vec<About>,
    pipelines: Vec<Fitted>,
    /// The named pipelines compared with the last of them.
    pairs: Vec<Pair>,
}

/// Room with its logs.
#[derive(Serialize)]
struct About {
    name: String,
    about: String,
    single_frames: bool,
    logs: Vec<String>,
}

/// Results of a pipeline.
#[derive(Default, Serialize)]
pub struct Fitted {
    pub name: String,
    /// Method of the search for settings.
    search: Search,
    /// Number of settings among which the rooms chose.
    settings: usize,
    /// Number of settings that contradict themselves, which were not tried.
    refused: usize,
    /// Logs that it cannot read.
    skipped: Vec<Skipped>,
    shipped: Values,
    chosen_with_all: Values,
    pub rooms: Vec<InRoom>,
    /// Means over the left-out rooms with the settings that each sample chose; the first sample is
    /// the one in the tables. A single one if the choice does not depend on a seed.
    by_sample: Vec<Figures>,
    /// Reason for an empty result.
    #[serde(skip_serializing_if = "Option::is_none")]
    too_few: Option<String>,
}

/// Values of settings, by key.
type Values = BTreeMap<String, toml::Value>;

/// Function that reads one of the figures.
type Read = fn(&Figures) -> f64;

#[derive(Serialize)]
struct Skipped {
    log: String,
    why: String,
}

/// Results of a pipeline in a room.
#[derive(Serialize)]
pub struct InRoom {
    pub room: String,
    /// True if its frames are not tracked over time: it affects neither the choice nor the means of
    /// the tracking figures.
    pub single_frames: bool,
    /// Settings that the other rooms chose.
    chosen_without: Values,
    /// Their score in this room.
    pub without: Figures,
    /// Score in this room of the settings that all rooms chose.
    with_all: Figures,
    /// Score in this room of the config's settings.
    shipped: Figures,
    /// The same scores, log by log.
    pub logs: Vec<InLog>,
}

/// Results of a pipeline on a log.
#[derive(Serialize)]
pub struct InLog {
    pub log: String,
    /// Figures with the settings that the other rooms chose.
    pub without: Figures,
    /// Figures with the settings of the config.
    pub shipped: Figures,
}

impl Report {
    /// Chooses the settings of all pipelines.
    ///
    /// # Errors
    /// A missing result.
    pub fn new(
        args: &RoomsArgs,
        locations: &[Location],
        contestants: &[Contestant],
        desk: &Desk<'_>,
    ) -> Result<Self, Failure> {
        let objective = args.objective;
        let rooms = locations.iter().map(|location| About {
            name: location.name.clone(),
            about: location.about.clone(),
            single_frames: location.single_frames,
            logs: location.logs.iter().map(described).collect(),
        });
        let fitted = contestants
            .iter()
            .enumerate()
            .map(|(at, contestant)| Scorer { locations, desk, at, contestant }.fitted(objective));
        let pipelines: Vec<Fitted> = fitted.collect::<Result<_, _>>()?;
        Ok(Self {
            objective,
            budget: args.budget,
            seed: args.seed,
            rooms: rooms.collect(),
            // Only the user knows which of them is the baseline.
            pairs: if args.configs.is_empty() { Vec::new() } else { pairs(&pipelines) },
            pipelines,
        })
    }

    /// Returns everything as JSON.
    pub fn json(&self) -> Result<String, Failure> {
        to_json("the report on the rooms", self)
    }

    /// Returns the tables for a terminal.
    pub fn text(&self) -> String {
        let tables: Vec<String> = self.tables().iter().map(Table::text).collect();
        tables.join("\n")
    }

    /// Returns the tables for a page.
    pub fn markdown(&self) -> String {
        let tables: Vec<String> = self.tables().iter().map(Table::markdown).collect();
        tables.join("\n")
    }

    fn tables(&self) -> Vec<Table> {
        let each = self.pipelines.iter().map(|fitted| fitted.table(self.seed));
        let beside = differences(&self.pairs).map(|table| [table, by_log(&self.pipelines)]);
        let beside = beside.into_iter().flatten();
        std::iter::once(self.summary()).chain(beside).chain(each).collect()
    }

    /// States among which settings the rooms chose.
    fn searched(&self) -> String {
        let mut by_grid: Vec<&str> = Vec::new();
        let mut by_sample: Vec<&str> = Vec::new();
        for fitted in &self.pipelines {
            match fitted.search {
                Search::Shipped => {}
                Search::Grid => by_grid.push(&fitted.name),
                Search::Sample { .. } => by_sample.push(&fitted.name),
            }
        }
        let Self { budget, seed, .. } = self;
        let sample = format!("a sample of at most {budget} (seed {seed}; its luck stands below)");
        if !by_grid.is_empty() && !by_sample.is_empty() {
            return format!(
                "all settings of {} (every setting of the grid was tried) and {sample} of those of {}",
                by_grid.join(", "),
                by_sample.join(", ")
            );
        }
        if !by_sample.is_empty() {
            return format!("{sample} of the settings of a pipeline");
        }
        if !by_grid.is_empty() {
            return "all settings (every setting of the grid was tried, so that no seed has a say)"
                .to_owned();
        }
        "the settings of the config alone".to_owned()
    }

    /// Returns the means over the rooms.
    fn summary(&self) -> Table {
        let rows = self.pipelines.iter().map(|fitted| {
            let rooms = Cell::number(fitted.rooms.len() as f64, 0);
            let cells = if fitted.rooms.is_empty() { Vec::new() } else { fitted.mean_cells() };
            Row::ours(&fitted.name, [vec![rooms], cells].concat())
        });
        let objective = match self.objective {
            Objective::Hota => "HOTA",
            Objective::HotaAndIdf1 => "HOTA and IDF1",
            Objective::Idf1 => "IDF1",
            Objective::Mota => "MOTA",
        };
        let rooms: Vec<String> = self.rooms.iter().map(About::words).collect();
        let mut notes = vec![
            "The means here weigh each room by its annotated people, each counted once per frame; \
             rooms alike: the mean in which all rooms have the same weight. Rooms of single frames \
             have no say in HOTA, AssA, IDF1, MOTA and inherited IDs, nor in what is chosen."
                .to_owned(),
            format!("Rooms: {}.", rooms.join("; ")),
            "w/o: in each room, with the settings that the other rooms chose, and with models \
             that have not seen it where the rooms name such; all: with those \
             that all rooms chose, this one among them, and the shipped models; gap: HOTA of all less that of w/o; as is: \
             with the settings of the config; inherited: IDs that another person had last, counted over \
             the logs of a room and added up in the means; false: false people in a frame; free, partly: recall of people within 5 m of the \
             camera of whom at least 90 % and 60 to 90 % shows; off: mean distance of a track from \
             its person. Another figure of a room is the mean over its logs; rooms.json has all of them."
                .to_owned(),
            format!(
                "Chosen by the mean of {objective} over rooms, weighed by people, among {}; those of \
                 the config take part only if they are among these.",
                self.searched()
            ),
            "Too few rooms for an interval: the next one may differ as much as these do.".to_owned(),
        ];
        let too_few = self.pipelines.iter().filter_map(|fitted| {
            fitted.too_few.as_ref().map(|why| format!("{}: {why}.", fitted.name))
        });
        notes.extend(too_few);
        let first = ["rooms"].into_iter().map(String::from);
        let last = ["rooms alike: HOTA w/o"].into_iter().map(String::from);
        let columns = first.chain(columns()).chain(last).collect();
        let title = "Chosen without the room that is scored, and with all: means over the rooms";
        Table { title: title.into(), columns, rows: rows.collect(), notes }
    }
}

/// Returns the name of a log, and the frames in which people are not scored.
fn described(log: &Annotated) -> String {
    let frames: Vec<String> = log.unjudged.iter().map(ToString::to_string).collect();
    match &frames[..] {
        [] => log.name.clone(),
        all => format!("{} without judging frames {}", log.name, all.join(" and ")),
    }
}

impl About {
    fn words(&self) -> String {
        let logs = self.logs.join(", ");
        let about = if self.about.is_empty() { String::new() } else { format!("{}: ", self.about) };
        format!("{} ({about}{logs})", labelled(&self.name, self.single_frames))
    }
}

/// Returns the name of a room in tables.
fn labelled(room: &str, single_frames: bool) -> String {
    if single_frames { format!("{room}, single frames") } else { room.to_owned() }
}

/// Access to the results of one pipeline.
struct Scorer<'a> {
    locations: &'a [Location],
    desk: &'a Desk<'a>,
    at: usize,
    contestant: &'a Contestant,
}

impl Scorer<'_> {
    fn fitted(&self, objective: Objective) -> Result<Fitted, Failure> {
        let mut skipped = Vec::new();
        let mut rooms: Vec<(&Location, Vec<usize>)> = Vec::new();
        let mut number = 0..;
        for location in self.locations {
            let mut readable = Vec::new();
            for (log, at) in location.logs.iter().zip(&mut number) {
                match self.desk.skip(self.at, at) {
                    Some(why) => {
                        skipped.push(Skipped { log: log.name.clone(), why: why.to_owned() });
                    }
                    None => readable.push(at),
                }
            }
            if !readable.is_empty() {
                rooms.push((location, readable));
            }
        }
        // With a single room there is no other one that could choose the settings.
        let choosing = rooms.iter().filter(|(location, _)| !location.single_frames).count();
        let too_few = (choosing < 2).then(|| {
            let beside = if choosing < rooms.len() { " beside those of single frames" } else { "" };
            format!("can read logs of {choosing} room{beside}, and two are needed")
        });
        if too_few.is_some() {
            rooms.clear();
        }
        let unseen = self.table(true, &rooms)?;
        let seen = self.table(false, &rooms)?;
        // A model that was trained with a room would make any setting look good there.
        let has_say = rooms.iter().map(|(location, _)| !location.single_frames).collect();
        let poll = Poll { weights: Weights::People, has_say };
        let singles: Vec<bool> = rooms.iter().map(|(location, _)| location.single_frames).collect();
        let samples = &self.contestant.samples;
        let mut choices = Vec::new();
        let mut by_sample = Vec::new();
        for sample in samples {
            let choice = chosen_in(sample, &unseen, objective, &poll);
            let mut figures = Vec::new();
            for (room, at) in choice.without.iter().enumerate() {
                figures.push((singles[room], &unseen[*at][room]));
            }
            by_sample.push(mean_over_rooms(&figures, Weights::People));
            choices.push(choice);
        }
        let Choice { without, with_all } = choices.swap_remove(0);
        let mut in_rooms = Vec::new();
        for (at, (location, logs)) in rooms.iter().enumerate() {
            in_rooms.push(InRoom {
                room: location.name.clone(),
                single_frames: location.single_frames,
                chosen_without: self.values(without[at]),
                without: unseen[without[at]][at],
                with_all: seen[with_all][at],
                shipped: self.room(self.contestant.shipped, false, logs)?,
                logs: self.by_log(without[at], logs)?,
            });
        }
        Ok(Fitted {
            name: self.contestant.name(),
            search: self.contestant.search,
            settings: samples[0].len(),
            refused: self.contestant.refused,
            skipped,
            shipped: self.values(self.contestant.shipped),
            chosen_with_all: self.values(with_all),
            rooms: in_rooms,
            by_sample,
            too_few,
        })
    }

    /// Returns the figures with each candidate in each room.
    fn table(
        &self,
        unseen: bool,
        rooms: &[(&Location, Vec<usize>)],
    ) -> Result<Vec<Vec<Figures>>, Failure> {
        (0..self.contestant.candidates)
            .map(|at| rooms.iter().map(|(_, logs)| self.room(at, unseen, logs)).collect())
            .collect()
    }

    fn room(&self, setting: usize, unseen: bool, logs: &[usize]) -> Result<Figures, Failure> {
        let figures: Vec<Figures> =
            logs.iter().map(|log| self.log(setting, unseen, *log)).collect::<Result<_, _>>()?;
        Ok(mean(&figures))
    }

    fn by_log(&self, chosen: usize, logs: &[usize]) -> Result<Vec<InLog>, Failure> {
        let names: Vec<&str> = self
            .locations
            .iter()
            .flat_map(|location| location.logs.iter().map(|log| log.name.as_str()))
            .collect();
        let logs = logs.iter().map(|log| {
            let without = self.log(chosen, true, *log)?;
            let shipped = self.log(self.contestant.shipped, false, *log)?;
            Ok(InLog { log: names[*log].to_owned(), without, shipped })
        });
        logs.collect()
    }

    fn log(&self, setting: usize, unseen: bool, log: usize) -> Result<Figures, Failure> {
        let run = Run { contestant: self.at, setting, log, unseen };
        let result = self.desk.result(run);
        let result = result
            .ok_or_else(|| Failure::failed("a result went missing; run the command again"))?;
        Ok(result.figures)
    }

    fn values(&self, setting: usize) -> Values {
        let keys = self.contestant.config.tune.iter().map(|tunable| tunable.key.clone());
        keys.zip(self.contestant.settings[setting].values.iter().cloned()).collect()
    }
}

/// Returns the choice among the settings of a sample. `figures` has those of all settings.
fn chosen_in(
    sample: &[usize],
    figures: &[Vec<Figures>],
    objective: Objective,
    poll: &Poll,
) -> Choice {
    let of_sample: Vec<Vec<Figures>> = sample.iter().map(|at| figures[*at].clone()).collect();
    let Choice { without, with_all } = leave_one_out(&of_sample, objective, poll);
    Choice {
        without: without.into_iter().map(|at| sample[at]).collect(),
        with_all: sample[with_all],
    }
}

/// Returns the minimum and the maximum of a figure.
fn ends(figures: &[Figures], read: Read) -> [f64; 2] {
    let values = figures.iter().map(read);
    [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
}

/// Returns the mean of figures over rooms; those of tracking are taken over rooms that are not
/// single frames.
fn over_rooms(rooms: &[InRoom], read: fn(&InRoom) -> &Figures, weights: Weights) -> Figures {
    let all: Vec<(bool, &Figures)> =
        rooms.iter().map(|room| (room.single_frames, read(room))).collect();
    mean_over_rooms(&all, weights)
}

/// Returns the mean of the figures of rooms, each with true if it has single frames.
fn mean_over_rooms(rooms: &[(bool, &Figures)], weights: Weights) -> Figures {
    let tracked = rooms.iter().filter(|(single_frames, _)| !single_frames);
    let tracked = weighted_mean(tracked.map(|(_, figures)| *figures), weights);
    let Figures { hota, ass_a, idf1, inherited, mota, .. } = tracked;
    let all = weighted_mean(rooms.iter().map(|(_, figures)| *figures), weights);
    Figures { hota, ass_a, idf1, inherited, mota, ..all }
}

impl Fitted {
    /// Returns the means over the rooms.
    fn mean(&self, name: &str, weights: Weights) -> InRoom {
        InRoom {
            room: name.to_owned(),
            single_frames: false,
            chosen_without: Values::new(),
            without: over_rooms(&self.rooms, |room| &room.without, weights),
            with_all: over_rooms(&self.rooms, |room| &room.with_all, weights),
            shipped: over_rooms(&self.rooms, |room| &room.shipped, weights),
            logs: Vec::new(),
        }
    }

    /// Returns the two means, first the one that weights rooms by their people.
    fn means(&self) -> [InRoom; 2] {
        [self.mean("mean", Weights::People), self.mean("mean, rooms alike", Weights::Equal)]
    }

    /// Returns the cells of the mean, and the HOTA of the mean with equal weights.
    fn mean_cells(&self) -> Vec<Cell> {
        let [mean, alike] = self.means();
        [cells(&mean), vec![Cell::number(alike.without.hota, 3)]].concat()
    }

    fn table(&self, seed: u64) -> Table {
        let means = if self.rooms.is_empty() { Vec::new() } else { Vec::from(self.means()) };
        let rows = self.rooms.iter().chain(&means);
        Table {
            title: self.name.clone(),
            columns: columns().collect(),
            rows: rows
                .map(|room| Row::ours(labelled(&room.room, room.single_frames), cells(room)))
                .collect(),
            notes: self.notes(seed),
        }
    }

    fn notes(&self, seed: u64) -> Vec<String> {
        let tried = self.search.words(self.settings, seed);
        let mut notes = vec![match self.refused {
            0 => format!("Tried: {tried}."),
            refused => {
                format!("Tried: {tried}; {refused} contradict themselves and were left out.")
            }
        }];
        notes.extend(self.spread(seed));
        notes.extend(self.too_few.as_ref().map(|why| format!("No figures: it {why}.")));
        let mut chosen: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for InRoom { room, chosen_without, .. } in &self.rooms {
            chosen.entry(self.changes(chosen_without)).or_default().push(room);
        }
        if !self.rooms.is_empty() {
            notes.push(format!("With all: {}.", self.changes(&self.chosen_with_all)));
        }
        let without = chosen
            .iter()
            .map(|(values, rooms)| format!("Without {}: {values}.", rooms.join(", without ")));
        notes.extend(without);
        notes.extend(self.skipped.iter().map(|s| format!("Not read: {}: {}.", s.log, s.why)));
        notes
    }

    /// States how far apart the samples of several seeds are, if there are several.
    fn spread(&self, seed: u64) -> Option<String> {
        if self.by_sample.len() < 2 || self.rooms.is_empty() {
            return None;
        }
        let last = seed + self.by_sample.len() as u64 - 1;
        let figures: [(&str, Read); 3] =
            [("HOTA", |f| f.hota), ("IDF1", |f| f.idf1), ("MOTA", |f| f.mota)];
        let words = figures.map(|(title, read)| {
            let [least, most] = ends(&self.by_sample, read);
            format!("{title} {least:.3} to {most:.3}")
        });
        Some(format!(
            "Spread of the mean w/o over samples (seeds {seed} to {last}): {}. Smaller differences \
             to another pipeline say nothing.",
            words.join(", ")
        ))
    }

    /// Formats the values that differ from those of the config.
    fn changes(&self, values: &Values) -> String {
        let changed = values.iter().filter(|(key, value)| self.shipped.get(*key) != Some(*value));
        let words: Vec<String> =
            changed.map(|(key, value)| format!("`{key}` = {}", shown_value(value))).collect();
        if words.is_empty() { "as shipped".to_owned() } else { words.join(", ") }
    }
}

/// Returns the columns of all tables.
fn columns() -> impl Iterator<Item = String> {
    [
        "HOTA w/o",
        "all",
        "gap",
        "as is",
        "AssA w/o",
        "as is",
        "IDF1 w/o",
        "as is",
        "inherited w/o",
        "as is",
        "MOTA w/o",
        "as is",
        "false w/o",
        "as is",
        "recall w/o",
        "as is",
        "free w/o",
        "partly w/o",
        "off m w/o",
    ]
    .into_iter()
    .map(String::from)
}

fn cells(room: &InRoom) -> Vec<Cell> {
    let InRoom { without, with_all, shipped, .. } = room;
    let first = [without.hota, with_all.hota, with_all.hota - without.hota, shipped.hota];
    let mut cells: Vec<Cell> = first.map(|figure| Cell::number(figure, 3)).into();
    let both = [without, shipped];
    for (digits, figures) in [
        (3, both.map(|f| f.ass_a)),
        (3, both.map(|f| f.idf1)),
        (0, both.map(|f| f.inherited as f64)),
        (3, both.map(|f| f.mota)),
        (3, both.map(|f| f.false_a_frame)),
        (3, both.map(|f| f.recall)),
    ] {
        cells.extend(figures.map(|figure| Cell::number(figure, digits)));
    }
    let last = [without.recall_free, without.recall_partly_hidden, without.position_error_m];
    cells.extend(last.map(|f| f.map_or_else(Cell::default, |f| Cell::number(f, 3))));
    cells
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;

    /// Returns the results in a room in which all figures of a pipeline are the same.
    pub fn room(name: &str, single_frames: bool, people: u64, figure: f64) -> InRoom {
        let figures = Figures {
            hota: figure,
            ass_a: figure,
            idf1: figure,
            mota: figure,
            false_a_frame: figure,
            recall: figure,
            people,
            ..Figures::default()
        };
        InRoom {
            room: name.into(),
            single_frames,
            chosen_without: Values::new(),
            without: figures,
            with_all: figures,
            shipped: figures,
            logs: Vec::new(),
        }
    }

    /// Returns the results of a pipeline in these rooms.
    pub fn fitted(name: &str, rooms: Vec<InRoom>) -> Fitted {
        Fitted { name: name.into(), settings: 1, rooms, ..Fitted::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::testing::{fitted, room};
    use super::*;

    fn three_rooms() -> Fitted {
        let rooms =
            vec![room("A", false, 75, 0.8), room("B", false, 25, 0.4), room("D", true, 100, 0.2)];
        fitted("pipeline", rooms)
    }

    #[test]
    fn means_weigh_rooms_by_people_and_track_nothing_over_single_frames() {
        let [by_people, alike] = three_rooms().means();
        for (mean, expected) in [(by_people, [0.7, 0.7, 0.45]), (alike, [0.6, 0.6, 1.4 / 3.0])] {
            let found = [mean.without.hota, mean.without.mota, mean.without.recall];
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-12, "{found:?} instead of {expected:?}");
        }
    }

    #[test]
    fn a_sample_chooses_among_its_own_settings() {
        let figures: Vec<Vec<Figures>> = [0.1, 0.5, 0.9, 0.7]
            .map(|hota| vec![Figures { hota, people: 1, ..Figures::default() }; 2])
            .to_vec();
        let poll = Poll::of_equals(2);
        for (sample, best) in [(&[0, 1][..], 1), (&[3, 1], 3), (&[0, 1, 2, 3], 2)] {
            let choice = chosen_in(sample, &figures, Objective::Hota, &poll);
            assert_eq!(choice, Choice { without: vec![best; 2], with_all: best }, "{sample:?}");
        }
    }

    #[test]
    fn the_spread_over_samples_is_told_and_a_whole_grid_has_none() {
        let by_sample = [0.61, 0.58, 0.6].map(|hota| Figures { hota, ..Figures::default() });
        let search = Search::Sample { of: 243 };
        let sampled = Fitted { search, by_sample: by_sample.to_vec(), ..three_rooms() };
        let notes = sampled.notes(4).join(" ");
        assert!(
            notes.contains("a sample of 1 of the 243 settings of the grid (seed 4)"),
            "{notes}"
        );
        assert!(notes.contains("(seeds 4 to 6): HOTA 0.580 to 0.610, IDF1 0.000"), "{notes}");
        let whole = Fitted { search: Search::Grid, ..three_rooms() };
        let notes = whole.notes(4).join(" ");
        assert!(notes.contains("every setting of the grid, 1 in all"), "{notes}");
        assert!(!notes.contains("seeds"), "{notes}");
    }

    #[test]
    fn the_table_has_the_row_of_single_frames_and_both_means() {
        let table = three_rooms().table(1);
        let names: Vec<&str> = table.rows.iter().map(|row| row.name.as_str()).collect();
        assert_eq!(names, ["A", "B", "D, single frames", "mean", "mean, rooms alike"]);
        let last = three_rooms().mean_cells().pop().and_then(|cell| cell.value).unwrap();
        assert!((last - 0.6).abs() < 1e-12, "{last}");
    }
}
