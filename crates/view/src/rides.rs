//! Folder of rides that `tagalong follow -o` wrote: a page for each ride, and a list of them with
//! the worst first.

use std::path::{Path, PathBuf};

use maud::{Markup, PreEscaped, html};
use serde::Deserialize;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, spare, write_file};
use tagalong_app::progress::Forecast;
use tagalong_app::remedies::Remedies;
use tagalong_math::counted;
use tagalong_report::document;

use crate::page::html::style;
use crate::recording::{RideFacts, read_json};
use crate::{PAGE, Page, ViewArgs};

/// File with the results of all rides of a folder.
const RESULTS: &str = "follow.json";
/// File with the list of the rides.
const INDEX: &str = "index.html";
/// Default size of the page of one of many rides, MB.
const RIDE_MB: u32 = 6;

/// Content of [`RESULTS`] that the list shows.
#[derive(Debug, Deserialize)]
struct Results {
    rides: Vec<Ride>,
}

/// Ride with its result.
#[derive(Clone, Debug, Default, Deserialize)]
struct Ride {
    /// Name of the scene.
    suite: String,
    /// Name of the pipeline.
    pipeline: String,
    /// Name of its folder; `None` in results of earlier versions.
    #[serde(default)]
    folder: Option<String>,
    #[serde(flatten)]
    facts: RideFacts,
}

/// Returns true for a folder of rides.
pub fn is_folder_of_rides(folder: &Path) -> bool {
    !folder.join("tracks.mcap").exists() && folder.join(RESULTS).is_file()
}

/// Returns the folder of a ride for the path of its log, and any other path unchanged.
pub fn run_of(path: &Path) -> PathBuf {
    let beside = path.with_extension("");
    let is_ride = path.is_file() && beside.join("tracks.mcap").is_file();
    if is_ride { beside } else { path.to_owned() }
}

/// Writes the page of each ride of a folder, and the list of all.
///
/// # Errors
/// Results that cannot be read, rides without a folder, or pages that exist.
pub fn view_rides(args: &ViewArgs, remedies: &Remedies) -> Outcome {
    let folder = &args.run;
    let index = args.output.clone().unwrap_or_else(|| folder.join(INDEX));
    if args.other.is_some() || args.log.is_some() || args.truth.is_some() {
        let shown = folder.display();
        return Err(Failure::usage(format!(
            "{shown} is a folder of rides, each with its log and its truth; name one of its folders \
             to use a second run, --log or --truth"
        )));
    }
    let Results { mut rides } = read_json(&folder.join(RESULTS))?;
    rides.sort_by(|a, b| worse_first(&a.facts, &b.facts));
    for ride in &rides {
        spare_page(&folder.join(ride.folder(folder)?).join(PAGE), args.overwrite)?;
    }
    spare(&index, args.overwrite)?;
    let forecast = Forecast::new(rides.len(), "rides");
    for ride in &rides {
        let run = folder.join(ride.folder(folder)?);
        let args = ViewArgs {
            run: run.clone(),
            max_mb: Some(args.max_mb.unwrap_or(RIDE_MB)),
            ..args.clone()
        };
        let page = Page::of(&args.recordings()?, &args, remedies)?;
        write_file(&run.join(PAGE), &page.text)?;
        forecast.advance();
    }
    // Links are relative, so that the folder can be moved; a list elsewhere names the whole path.
    let from = if args.output.is_some() { Some(folder.as_path()) } else { None };
    write_file(&index, list(folder, from, &rides))?;
    print(&format!(
        "{}: {}, the worst first, each with its page\nopen it in a browser; it needs no network\n",
        index.display(),
        counted(rides.len(), "ride")
    ))?;
    Ok(Ended::Well)
}

/// Refuses to replace the page of a ride, whose path does not depend on the name of the list.
fn spare_page(page: &Path, overwrite: bool) -> Result<(), Failure> {
    if page.exists() && !overwrite {
        let shown = page.display();
        return Err(Failure::usage(format!(
            "{shown} exists: --overwrite replaces the pages of the rides and their list"
        )));
    }
    Ok(())
}

/// Orders rides: those with a contact first, then those in which the robot never moved, then by the
/// least clearance, then by the share of the time in which the distance was kept.
fn worse_first(a: &RideFacts, b: &RideFacts) -> std::cmp::Ordering {
    fn room(ride: &RideFacts) -> f64 {
        ride.room_m().unwrap_or(f64::INFINITY)
    }

    fn share(ride: &RideFacts) -> f64 {
        ride.distance_share().unwrap_or(1.0)
    }

    b.touches()
        .cmp(&a.touches())
        .then(b.never_moved.is_some().cmp(&a.never_moved.is_some()))
        .then(room(a).total_cmp(&room(b)))
        .then(share(a).total_cmp(&share(b)))
}

impl Ride {
    fn folder(&self, parent: &Path) -> Result<&str, Failure> {
        // Only a plain name, not a path out of the folder, because the results may come from
        // elsewhere.
        let name = self
            .folder
            .as_deref()
            .filter(|name| !name.is_empty() && *name != ".." && !name.contains(['/', '\\']));
        name.ok_or_else(|| {
            let shown = parent.join(RESULTS).display().to_string();
            Failure::usage(format!(
                "{shown} names no folder for the ride of {} with seed {}, because an earlier \
                 version made it; repeat it with `tagalong follow ... -o FOLDER --overwrite`",
                self.suite, self.facts.seed
            ))
        })
    }

    /// Returns the URL of its page.
    fn link(&self, from: Option<&Path>) -> String {
        let name = self.folder.as_deref().unwrap_or_default();
        let at = self.facts.nearest_s.map_or(String::new(), |at_s| format!("#t={at_s:.1}"));
        let path = from.map_or(PathBuf::from(name), |folder| folder.join(name)).join(PAGE);
        let encoded: String = path.to_string_lossy().chars().map(encoded).collect();
        format!("{encoded}{at}")
    }
}

/// Returns a character of a path, escaped for a URL.
fn encoded(letter: char) -> String {
    match letter {
        ' ' => "%20".into(),
        '%' => "%25".into(),
        '#' => "%23".into(),
        '?' => "%3F".into(),
        letter => letter.to_string(),
    }
}

fn list(folder: &Path, from: Option<&Path>, rides: &[Ride]) -> String {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let contacts = rides.iter().filter(|ride| ride.facts.touches()).count();
    let kept = rides.iter().filter(|ride| ride.facts.kept).count();
    let head = html! { style { (PreEscaped(style())) } };
    let body = html! {
        header class="top" {
            h1 { "Rides in " (name) }
            ul class="facts" {
                li { (counted(rides.len(), "ride")) }
                li { (kept) " kept the person" }
                li { (contacts) " with a contact" }
            }
        }
        main id="main" tabindex="-1" {
            p {
                "The worst ride is first: contacts, then rides in which the robot never moved, then the least "
                "room to a person or a thing while the robot moved, then the distance kept. A link opens the "
                "ride where the robot came nearest."
            }
            (table(rides, from))
            p class="soft" {
                "Distance kept: share of the time near the stand-off while the person was followed and "
                "walked slowly. Person kept: followed to the end or rightly given up, and no other person followed for long. "
                "Wrong person: time in which another person or an object was followed. In view: share of the time in "
                "which the camera saw the person."
            }
        }
        footer { p { "Made by Tagalong " (env!("CARGO_PKG_VERSION")) "." } }
        script { (PreEscaped(ROLES)) }
    };
    document(&format!("Rides in {name} - Tagalong"), &head, "Skip to the rides", &body)
        .into_string()
}

/// Script that sets the ARIA roles of the table, which are lost when a phone shows the cells of a
/// row below each other.
const ROLES: &str = r#""use strict";
const roles = { TABLE: "table", THEAD: "rowgroup", TBODY: "rowgroup", TR: "row", TD: "cell" };
for (const part of document.querySelectorAll("table, table *")) {
  const role = part.tagName === "TH" ? (part.scope === "row" ? "rowheader" : "columnheader") : roles[part.tagName];
  if (role) part.setAttribute("role", role);
}"#;

/// Names of the columns after the first one, which a phone shows beside each value.
const COLUMNS: [&str; 7] = [
    "Contact",
    "Room to people",
    "Room to things",
    "Distance kept",
    "Person kept",
    "Wrong person",
    "In view",
];

fn table(rides: &[Ride], from: Option<&Path>) -> Markup {
    html! {
        section class="scroll" aria-label="Rides, the worst first" tabindex="0" {
            table class="cards" {
                thead {
                    tr {
                        th scope="col" { "Ride" }
                        @for name in COLUMNS { th scope="col" { (name) } }
                    }
                }
                tbody {
                    @for ride in rides {
                        tr {
                            th scope="row" {
                                a href=(ride.link(from)) { (ride.suite) ", " (ride.pipeline) ", seed " (ride.facts.seed) }
                            }
                            @for (name, (text, is_bad)) in COLUMNS.iter().zip(cells(&ride.facts)) {
                                td data-name=(name) class=[is_bad.then_some("bad")] { (text) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Returns whether the person was kept, and the reason if the robot never moved.
fn kept(ride: &RideFacts) -> String {
    let lost =
        ride.lost_to_the_end_s().map_or(String::new(), |at_s| format!(", lost at {at_s:.1} s"));
    let answer = match (ride.kept, lost.is_empty()) {
        (true, true) => "yes".to_owned(),
        (true, false) => format!("as far as possible{lost}"),
        (false, _) => format!("no{lost}"),
    };
    match &ride.never_moved {
        Some(why) => format!("{answer}; the robot never moved ({why})"),
        None => answer,
    }
}

/// Returns the text of each column, and whether it is bad.
fn cells(ride: &RideFacts) -> [(String, bool); 7] {
    fn metres(room: Option<f64>) -> (String, bool) {
        let text = room.map_or("-".into(), |room| format!("{room:.2} m"));
        (text, room.is_some_and(|room| room < 0.0))
    }

    let share = ride.distance_share();
    let in_view = if ride.time_s > 0.0 { ride.in_view_s / ride.time_s } else { 0.0 };
    [
        (if ride.touches() { "yes" } else { "no" }.into(), ride.touches()),
        metres(ride.clearance_people_m),
        metres(ride.clearance_things_m),
        (share.map_or("-".into(), |share| format!("{:.0} %", 100.0 * share)), false),
        (kept(ride), !ride.kept),
        (format!("{:.1} s", ride.wrong_s), false),
        (format!("{:.0} %", 100.0 * in_view), false),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ride(name: &str, people_m: f64, share: f64) -> Ride {
        let facts = RideFacts {
            clearance_people_m: Some(people_m),
            slow_s: 10.0,
            distance_kept_s: 10.0 * share,
            nearest_s: Some(2.5),
            ..RideFacts::default()
        };
        Ride { suite: name.into(), folder: Some(name.into()), facts, ..Ride::default() }
    }

    #[test]
    fn the_worst_ride_is_first() {
        let mut rides = [
            ride("far", 0.9, 0.1),
            ride("touch", -0.1, 1.0),
            ride("a", 0.4, 0.9),
            ride("b", 0.4, 0.2),
        ];
        rides.sort_by(|a, b| worse_first(&a.facts, &b.facts));
        let names: Vec<&str> = rides.iter().map(|ride| ride.suite.as_str()).collect();
        assert_eq!(names, ["touch", "b", "a", "far"]);
    }

    #[test]
    fn a_robot_that_never_moved_is_no_good_ride() {
        let mut stands = ride("stands", 0.9, 1.0);
        stands.facts.never_moved = Some("silent".into());
        let mut rides = [ride("near", 0.1, 0.1), stands, ride("touch", -0.1, 1.0)];
        rides.sort_by(|a, b| worse_first(&a.facts, &b.facts));
        let names: Vec<&str> = rides.iter().map(|ride| ride.suite.as_str()).collect();
        assert_eq!(names, ["touch", "stands", "near"]);
        let page = list(Path::new("rides"), None, &rides);
        assert!(page.contains("no; the robot never moved (silent)"), "{page}");
        let summary = rides[1].facts.summary();
        assert!(summary.contains("the robot never moved (silent)"), "{summary}");
        assert!(summary.contains("least room from the edge of the robot to people"), "{summary}");
    }

    #[test]
    fn the_time_on_another_person_is_said_where_there_is_one() {
        let mut facts = RideFacts::default();
        let never = "the lock was never on another person or a thing";
        assert!(facts.summary().ends_with(never), "{}", facts.summary());
        facts.wrong_s = 1.5;
        let times = "the lock was on another person or a thing for 1.5 s";
        assert!(facts.summary().ends_with(times), "{}", facts.summary());
    }

    #[test]
    fn a_ride_that_ends_without_the_person_says_so() {
        let mut facts = RideFacts { kept: true, ..RideFacts::default() };
        assert_eq!(kept(&facts), "yes");
        assert!(facts.summary().starts_with("the person was kept;"), "{}", facts.summary());
        facts.episodes = serde_json::from_str(
            r#"[{"lost_s":2.0,"found_s":3.0},{"lost_s":8.94,"found_s":null}]"#,
        )
        .unwrap();
        assert_eq!(kept(&facts), "as far as possible, lost at 8.9 s");
        assert!(!facts.summary().contains("was kept"), "{}", facts.summary());
        facts.kept = false;
        assert_eq!(kept(&facts), "no, lost at 8.9 s");
    }

    #[test]
    fn the_page_of_a_ride_is_replaced_on_request_alone() {
        let home = tempfile::tempdir().unwrap();
        let page = home.path().join(PAGE);
        assert!(spare_page(&page, false).is_ok());
        std::fs::write(&page, "").unwrap();
        let why = spare_page(&page, false).unwrap_err().message;
        assert!(why.contains("--overwrite") && !why.contains("-o,"), "{why}");
        assert!(spare_page(&page, true).is_ok());
    }

    #[test]
    fn names_stay_text_and_links_stay_in_the_folder() {
        let mut hostile = ride("<img src=x>", 0.5, 0.5);
        hostile.folder = Some("a b#c".into());
        let page = list(Path::new("rides"), None, &[hostile.clone()]);
        assert!(page.contains("<li>1 ride</li>"), "{page}");
        assert!(!page.contains("<img"), "a name became an element");
        assert!(page.contains("href=\"a%20b%23c/view.html#t=2.5\""), "{page}");
        for name in ["..", "a/b", ""] {
            hostile.folder = Some(name.into());
            assert!(hostile.folder(Path::new("rides")).is_err(), "{name}");
        }
    }
}
