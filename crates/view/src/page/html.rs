//! HTML of the page, with its data, and with style and script inlined or in separate files.

use maud::{Markup, PreEscaped, html};
use tagalong_core::TrackId;
use tagalong_log::write::{TRACK_COLOURS, track_colour};
use tagalong_report::{BASE_STYLE, document};

use crate::page::data::PageData;

// Inlined, so that the page is one file.
const STYLE: &str = concat!(include_str!("page.css"), "\n");
const SCRIPT: &str = include_str!("page.js");
const LIVE_SCRIPT: &str = include_str!("live.js");

/// Keyboard shortcuts of the page, with their effects.
const KEYS: [(&str, &str); 8] = [
    ("Space", "play, pause"),
    ("← →", "one frame back, ahead; with Shift ten"),
    ("Home End", "first frame, last frame"),
    ("P N", "previous event, next event"),
    ("M", "next missed person, if there is truth"),
    ("D", "dropped candidates, on and off"),
    ("T", "trails, on and off"),
    ("Esc", "clear the clicked position"),
];

/// Texts above the page.
pub struct Heading {
    /// Name of the log.
    pub log: String,
    /// One line for each run.
    pub runs: Vec<String>,
    /// Further lines.
    pub notes: Vec<String>,
}

/// Returns the page of recorded runs as one self-contained text.
///
/// # Errors
/// Data that JSON cannot express.
pub fn html(heading: &Heading, data: &PageData) -> serde_json::Result<String> {
    let style = html! { style { (PreEscaped(style())) } };
    whole(heading, data, &style, &html! { script { (PreEscaped(SCRIPT)) } })
}

/// Returns the page of a live run; its server has to serve [`style`] as `page.css`, the
/// [`scripts`], and the answers to their requests.
///
/// # Errors
/// Data that JSON cannot express.
pub fn live_html(heading: &Heading, data: &PageData) -> serde_json::Result<String> {
    // Without an icon in the page, a browser would request one outside of the key.
    let style = html! { link rel="icon" href="data:,"; link rel="stylesheet" href="page.css"; };
    let names = scripts().map(|(name, _)| name);
    let scripts = html! { @for name in names { script src=(name) {} } };
    whole(heading, data, &style, &scripts)
}

/// Returns the style of [`live_html`].
pub fn style() -> String {
    let mut text = [BASE_STYLE, STYLE].concat();
    for id in 0..TRACK_COLOURS {
        text += &format!(".c{id} {{ --c: {}; }}\n", hex(track_colour(TrackId(id))));
    }
    text
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Returns the names and texts of the scripts of [`live_html`], in order.
pub fn scripts() -> [(&'static str, &'static str); 2] {
    [("page.js", SCRIPT), ("live.js", LIVE_SCRIPT)]
}

fn whole(
    heading: &Heading,
    data: &PageData,
    style: &Markup,
    scripts: &Markup,
) -> serde_json::Result<String> {
    let json = script_safe(&serde_json::to_string(data)?);
    let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
    let body = html! {
        (top(heading))
        main id="main" tabindex="-1" {
            noscript { p { "This page needs JavaScript, which is inside it." } }
            @if data.live { p id="alive" class="alive" role="status" { "Waiting for the first frame." } }
            (stage(&names))
            (time_line(&names))
            (answers(&names))
        }
        footer { p { "Made by Tagalong " (env!("CARGO_PKG_VERSION")) "." } }
        script type="application/json" id="data" { (PreEscaped(json)) }
        (scripts)
    };
    let title = format!("{} - Tagalong", heading.log);
    let page = document(&title, style, "Skip to the images", &body);
    Ok(page.into_string())
}

/// Escapes JSON so that no text in it can end the script element around it.
fn script_safe(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for letter in json.chars() {
        match letter {
            // Older versions of JavaScript treat the two separators as line ends.
            '<' | '>' | '&' | '\u{2028}' | '\u{2029}' => {
                out += &format!("\\u{:04x}", u32::from(letter));
            }
            _ => out.push(letter),
        }
    }
    out
}

fn top(heading: &Heading) -> Markup {
    html! {
        header class="top" {
            h1 { (heading.log) }
            ul class="facts" {
                @for line in heading.runs.iter().chain(&heading.notes) { li { (line) } }
            }
        }
    }
}

/// Renders the elements for the image and the plan of each run.
fn stage(names: &[&str]) -> Markup {
    let class = if names.len() > 1 { "runs two" } else { "runs" };
    html! {
        div class=(class) {
            @for (number, name) in names.iter().enumerate() {
                section class="run" aria-labelledby=(format!("name-{number}")) {
                    h2 id=(format!("name-{number}")) { (name) span class="now" id=(format!("now-{number}")) {} }
                    div class="views" {
                        figure class="picture" id=(format!("picture-{number}")) {
                            svg class="image" id=(format!("image-{number}")) role="img" aria-label=(format!("Image with the tracks of {name}")) {}
                            figcaption class="legend" { (image_marks()) }
                        }
                        figure class="above" {
                            svg class="plan" id=(format!("plan-{number}")) role="img" aria-label=(format!("Plan from above of {name}")) {}
                            figcaption class="legend" {
                                (plan_marks())
                                span class="zones" id=(format!("zones-{number}")) hidden { (zones()) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Renders a mark of a legend with its meaning.
fn mark(class: &str, text: &str) -> Markup {
    html! { span { span class=(format!("mark {class}")) {} (text) } }
}

/// Renders the legend of the boxes in the image; entries of a layer are shown with the layer.
fn image_marks() -> Markup {
    html! {
        (mark("box-seen", "seen"))
        (mark("box-guess", "predicted"))
        (mark("box-tentative", "not confirmed yet"))
        span { "distance from the robot's middle, ~ guessed" }
        span data-layer="target" { (mark("sign", "target")) }
        span data-layer="truth" { (mark("box-truth", "annotated")) }
        span data-layer="truth" { (mark("box-miss", "missed")) }
        span data-layer="dropped" { (mark("box-dropped", "dropped")) }
    }
}

/// Renders the legend of the marks in the plan.
fn plan_marks() -> Markup {
    html! {
        (mark("dot", "seen"))
        (mark("dot ring", "predicted"))
        (mark("dot ring unsure", "not confirmed yet"))
        span data-layer="target" { (mark("to-target", "target")) }
        (mark("robot-path", "robot and its path"))
        span data-layer="scan" { (mark("laser", "laser")) }
        span data-layer="truth" { (mark("spot", "annotated")) }
        span data-layer="truth" { (mark("spot missed", "missed")) }
        span data-layer="dropped" { (mark("crossed", "dropped")) }
    }
}

/// Renders the legend of the marks around a robot with a controller.
fn zones() -> Markup {
    html! {
        (mark("way", "path until it stops"))
        span data-zone="people" { (mark("stands", "a person who comes nearer stops it")) }
        span data-zone="things" { (mark("stands", "an obstacle that is nearer stops it")) }
        (mark("slower", "a person who comes nearer slows it at full speed"))
        (mark("things", "obstacle"))
        (mark("movers", "moves"))
    }
}

/// Renders the legend of the lines above the slider.
fn strip_legend() -> Markup {
    html! {
        p class="legend" {
            (mark("life", "track with ID, seen"))
            (mark("life weak", "predicted"))
            span id="legend-missed" class="group" { (mark("gap", "missed")) }
            span id="legend-drive" class="group" {
                "Robot: " (mark("drives", "drives")) (mark("slower", "slower")) (mark("stands", "stands"))
            }
        }
    }
}

/// Buttons of the time line: their IDs, symbols and names.
const BUTTONS: [[&str; 3]; 5] = [
    ["before", "|◂", "Previous event"],
    ["back", "◂", "One frame back"],
    ["play", "▶", "Play"],
    ["ahead", "▸", "One frame ahead"],
    ["next", "▸|", "Next event"],
];

/// Renders the controls, which always stay visible.
fn time_line(names: &[&str]) -> Markup {
    html! {
        section class="time" aria-label="Time line" {
            div class=(if names.len() > 1 { "strips two" } else { "strips" }) aria-hidden="true" {
                @for (number, name) in names.iter().enumerate() {
                    @if names.len() > 1 { span class="strip-name" { (name) } }
                    svg class="strip" id=(format!("strip-{number}")) {}
                }
            }
            input type="range" id="frame" min="0" max="0" value="0" step="1" aria-label="Frame";
            div class="controls" {
                @for [id, sign, name] in BUTTONS {
                    button type="button" id=(id) aria-label=(name) title=(name) { (sign) }
                }
                output id="clock" for="frame" {}
                label id="speed-label" { "Speed " select id="speed" {
                    option value="0.25" { "¼" } option value="0.5" { "½" }
                    option value="1" selected { "1" } option value="2" { "2" } option value="4" { "4" }
                } }
                fieldset class="layers" {
                    legend class="unseen" { "Show" }
                    label { input type="checkbox" id="show-dropped"; " dropped" }
                    label { input type="checkbox" id="show-trails" checked; " trails" }
                    label id="truth-label" { input type="checkbox" id="show-truth" checked; " truth" }
                }
                (strip_legend())
            }
        }
    }
}

/// Renders the sections below the time line.
fn answers(names: &[&str]) -> Markup {
    html! {
        div class="answers" {
            section id="why" aria-labelledby="h-why" {
                h2 id="h-why" { "Why was a person missed?" }
                p id="question" aria-live="polite" { "Click on the image where a person was missed." }
                p class="missed" id="missed" hidden { }
                (columns("why", names))
            }
            section id="drive" aria-labelledby="h-drive" {
                h2 id="h-drive" { "Target and command" }
                (columns("drive", names))
            }
            section id="people" aria-labelledby="h-people" {
                h2 id="h-people" { "People in this frame" }
                (columns("people", names))
            }
            section id="funnel" aria-labelledby="h-funnel" {
                h2 id="h-funnel" { "Dropped candidates in this frame (funnel)" }
                (columns("funnel", names))
            }
            section id="events" aria-labelledby="h-events" {
                h2 id="h-events" { "Events" }
                fieldset class="filters" id="kinds" { legend class="unseen" { "Kinds of events" } }
                ol class="events" id="event-list" tabindex="0" aria-label="Events" {}
            }
            section id="keys" aria-labelledby="h-keys" {
                h2 id="h-keys" { "Keys" }
                dl { @for (key, does) in KEYS { dt { kbd { (key) } } dd { (does) } } }
            }
        }
    }
}

/// Renders an element for each run, with its name if there are two.
fn columns(id: &str, names: &[&str]) -> Markup {
    html! {
        div class=(if names.len() > 1 { "columns two" } else { "columns" }) {
            @for (number, name) in names.iter().enumerate() {
                div {
                    @if names.len() > 1 { h3 { (name) } }
                    div id=(format!("{id}-{number}")) {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::data::{CandidateData, FrameData, RunData, TestData};

    const HOSTILE: &str = "</script><img src=x onerror=alert(1)>&\u{2028}\"'";

    fn hostile_page() -> String {
        let found = vec![CandidateData {
            by: HOSTILE.into(),
            test: Some(HOSTILE.into()),
            ..CandidateData::default()
        }];
        let frame = FrameData { found, ..FrameData::default() };
        let test = TestData { settings: vec![HOSTILE.into()], why: HOSTILE.into(), stage: 0 };
        let run = RunData {
            name: HOSTILE.into(),
            frames: vec![Some(frame)],
            tests: [(HOSTILE.to_owned(), test)].into(),
            ..RunData::default()
        };
        let data = PageData { t: vec![0.0], runs: vec![run], ..PageData::default() };
        let heading = Heading {
            log: HOSTILE.into(),
            runs: vec![HOSTILE.into()],
            notes: vec![HOSTILE.into()],
        };
        html(&heading, &data).unwrap()
    }

    #[test]
    fn hostile_names_stay_text() {
        let page = hostile_page();
        assert!(!page.contains("<img"), "a name became an element");
        assert_eq!(page.matches("</script>").count(), 2, "a name ended a script");
        assert!(!page.contains('\u{2028}') || page.contains("&lt;/script&gt;"));
    }

    #[test]
    fn the_data_survives_its_escapes() {
        let page = hostile_page();
        let start = page.find("id=\"data\">").unwrap() + "id=\"data\">".len();
        let end = start + page[start..].find("</script>").unwrap();
        let data: serde_json::Value = serde_json::from_str(&page[start..end]).unwrap();
        assert_eq!(data["runs"][0]["name"], HOSTILE);
        assert_eq!(data["runs"][0]["frames"][0]["found"][0]["test"], HOSTILE);
        assert_eq!(data["runs"][0]["tests"][HOSTILE]["why"], HOSTILE);
    }

    #[test]
    fn tracks_have_the_colours_of_pictures_and_logs() {
        assert!(SCRIPT.contains(&format!("const COLOURS = {TRACK_COLOURS};")));
        let page = hostile_page();
        for id in 0..TRACK_COLOURS {
            let colour = hex(track_colour(TrackId(id)));
            assert!(page.contains(&format!(".c{id} {{ --c: {colour}; }}")), "{id}");
            // Plans of a report have the same.
            assert!(BASE_STYLE.contains(&format!("--t{id}: {colour};")), "{id}");
        }
    }

    /// Causes of stops have the distance from the edge of the robot.
    #[test]
    fn distances_of_people_name_the_middle_of_the_robot() {
        assert!(hostile_page().contains("distance from the robot's middle, ~ guessed"));
        for words in ["from the middle of the robot", "\"From the robot's middle\", \"Speed\""] {
            assert!(SCRIPT.contains(words), "{words}");
        }
    }

    #[test]
    fn the_page_refers_to_no_other_file() {
        let page = hostile_page();
        for address in ["http:", "https:", "src=\"", "@import", "url("] {
            let text = page.replace("http://www.w3.org/2000/svg", "");
            assert!(!text.contains(address), "{address}");
        }
        assert!(!SCRIPT.contains("innerHTML"), "names must not be read as markup");
    }
}
