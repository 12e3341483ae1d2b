//! Invented results, shaped like real ones. None of them was measured.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_eval::{Consistency, CurvePoint, Repair, Repaired, Scores};
use tagalong_report::{
    Benchmark, Dropped, EventRow, MissedPerson, Moment, Outcome, StageTiming, TaskResult,
    TaskTiming, Timings, Trajectory,
};

/// Picture of a person in a frame, 48 x 64 pixels: PNG in base64.
const PICTURE: &str = "iVBORw0KGgoAAAANSUhEUgAAADAAAABACAAAAAB5S6uaAAAA3UlEQVR42s3LYQqDMAyGYQ/Wk/SIQ0SKiIiIiMhu\
lWUppK3a0DGRvD+T76neP1YpBDsGhX23HuxFPQU2DLaiaHYNrK8U2FARsDYjPFgxWOMSED9odgbW5sRTYMFgiTqA\
6EMzjWDGYI5L9vGDZneAObPPAyaHqwcTBlNRNLsFmFAJMGknMGIwcuYc/2iWAnNdDph8/4ABg4ESwMAzjaDHoKcE\
0PNMI+gw6CgBdDzTCBwGjhKA45lG0GLQUgJoeaYRNBg0lAAanmkENQY1JYCaZ08BnwD8gMArJIAwUgg+zIHCZKlW\
pIkAAAAASUVORK5CYII=";

/// Generator of reproducible numbers between 0 and 1 that look random.
struct Wobble(u64);

impl Wobble {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn around(&mut self, middle: f64, spread: f64) -> f64 {
        middle + spread * (2.0 * self.next() - 1.0)
    }
}

/// Sixteen by twelve pixels of a gradient as JPEG.
const IMAGE: &str = "\
    /9j/4AAQSkZJRgABAQAAAQABAAD/2wBDABQODxIPDRQSEBIXFRQYHjIhHhwcHj0sLiQySUBMS0dARkVQWnNiUFVt\
    VkVGZIhlbXd7gYKBTmCNl4x9lnN+gXz/2wBDARUXFx4aHjshITt8U0ZTfHx8fHx8fHx8fHx8fHx8fHx8fHx8fHx8\
    fHx8fHx8fHx8fHx8fHx8fHx8fHx8fHx8fHz/wAARCAAMABADASIAAhEBAxEB/8QAFQABAQAAAAAAAAAAAAAAAAAA\
    AwX/xAAXEAEBAQEAAAAAAAAAAAAAAAACAAED/8QAFQEBAQAAAAAAAAAAAAAAAAAAAgP/xAAXEQADAQAAAAAAAAAA\
    AAAAAAAAAQID/9oADAMBAAIRAxEAPwCYeMx4zk5KTkKtkstGf//Z";

/// Returns results of invented pipelines on invented logs.
pub fn benchmark(pipelines: &[&str], logs: &[&str]) -> Benchmark {
    let mut tasks = Vec::new();
    for (p, pipeline) in pipelines.iter().enumerate() {
        for (l, log) in logs.iter().enumerate() {
            tasks.push(task(pipeline, log, 0.55 + 0.08 * p as f64, 97 * p as u64, l as u64));
        }
    }
    Benchmark {
        version: "0.0.0-sample".into(),
        moments: moments(&tasks),
        tasks,
        ..Benchmark::default()
    }
}

fn task(pipeline: &str, log: &str, level: f64, seed: u64, place: u64) -> TaskResult {
    let seed = seed + place;
    let mut wobble = Wobble(seed + 1);
    let level = wobble.around(level, 0.1).clamp(0.05, 0.97);
    let hash = format!("{:016x}{:016x}", seed.wrapping_mul(0x9E37_79B9_7F4A_7C15), seed);
    let truth = people(place);
    TaskResult {
        pipeline: pipeline.into(),
        log: log.into(),
        seed: 1,
        inputs: [("config", "c0ffee"), ("log", "10600d"), ("truth", "7274746")]
            .map(|(name, start)| (name.to_owned(), format!("{start}{hash}")))
            .into(),
        hash,
        frames: 412,
        duration_s: 27.4,
        image: Some(scores(&mut wobble, level)),
        metres: Some(scores(&mut wobble, level - 0.04)),
        lamr_curve: curve(level),
        repairs: repairs(level),
        nis: Consistency::of(&[1.4, 2.2, 3.0, 0.7, 2.9], 2, 0.95),
        funnel: [("boundary test", 183_204), ("size", 20_411), ("margin", 902), ("gate", 4_077)]
            .map(|(test, count)| Dropped { test: test.into(), count })
            .into(),
        tracks: tracks(&truth, &mut wobble),
        truth,
        events: events(&mut wobble),
        missed: missed(seed),
        deciding: [(
            "margin".to_owned(),
            vec!["[[verifiers]] config.least_margin = 0.2".to_owned()],
        )]
        .into(),
        reasons: [(
            "margin".to_owned(),
            "the test \"margin\" dropped the candidate; decided by \
             [[verifiers]] config.least_margin = 0.2: faces away"
                .to_owned(),
        )]
        .into(),
        causes: vec![MARGIN.to_owned(), TOO_FAR.to_owned()],
        ..TaskResult::default()
    }
}

fn repairs(level: f64) -> Vec<Repaired> {
    let gains = [0.05, 0.0, 0.01, 0.21, 0.11, 0.04, 0.02];
    let rows = Repair::ALL.into_iter().zip(gains);
    rows.map(|(repair, gain)| Repaired {
        repair,
        hota: Some(level + gain),
        mota: Some(level + (gain - 0.1)),
        idf1: Some(level + gain),
    })
    .collect()
}

fn scores(wobble: &mut Wobble, level: f64) -> Scores {
    let truths = 800;
    let tp = (level * truths as f64) as u64;
    let fp = (40.0 * wobble.next()) as u64;
    let idsw = (6.0 * wobble.next()) as u64;
    Scores {
        hota: Some(level),
        det_a: Some(level + 0.03),
        ass_a: Some(level - 0.03),
        loc_a: Some(0.82),
        mota: Some(level - 0.1),
        motp: Some(0.8),
        idf1: Some(level + 0.02),
        lamr: Some(1.0 - level),
        fp_per_frame: Some(fp as f64 / 412.0),
        ospa: Some(0.6 - 0.4 * level),
        position_error_mean_m: Some(wobble.around(0.12, 0.05)),
        time_to_confirm_mean_s: Some(wobble.around(0.5, 0.3)),
        wrong_person_s: 2.0 * wobble.next(),
        idsw,
        fp,
        tp,
        fn_: truths - tp,
        frag: idsw + 3,
        mt: 3,
        pt: 1,
        ml: 1,
        truth_ids: 5,
        never_confirmed: u64::from(level < 0.6),
        truths,
        frames: 412,
        ..Scores::default()
    }
}

fn curve(level: f64) -> Vec<CurvePoint> {
    (0..120)
        .map(|i| {
            let part = f64::from(i) / 119.0;
            let miss_rate = 1.0 - level * (1.0 - (-4.0 * part).exp());
            CurvePoint { score: 1.0 - part, fppi: 1.6 * part.powi(3), miss_rate, precision: 0.9 }
        })
        .collect()
}

fn people(seed: u64) -> Vec<Trajectory> {
    let phase = seed as f64;
    let people = [(1, 2.0), (2, 4.0)].map(|(id, from)| {
        let points = (0..270).map(|i| {
            let t_s = 0.1 * f64::from(i);
            let turn = 0.12 * t_s + phase;
            [t_s, from + 0.12 * t_s + 1.2 * turn.sin(), (from - 3.0) + 1.6 * turn.cos()]
        });
        Trajectory { id, points: points.collect() }
    });
    people.to_vec()
}

fn tracks(truth: &[Trajectory], wobble: &mut Wobble) -> Vec<Trajectory> {
    let mut tracks = Vec::new();
    for person in truth {
        for (part, points) in person.points.chunks(140).enumerate() {
            let noisy = points
                .iter()
                .skip(8)
                .map(|&[t_s, x, y]| [t_s, wobble.around(x, 0.06), wobble.around(y, 0.06)]);
            tracks.push(Trajectory { id: 10 * person.id + part as i64, points: noisy.collect() });
        }
    }
    tracks
}

/// Sentences that say why people are missed.
const MARGIN: &str = "No track began here: the test \"margin\" dropped the candidate.";
pub const TOO_FAR: &str = "No track began here: the surface there is 6.2 m away.";

/// Frame of the moment of each log.
const MOMENT: u64 = 61;

/// Returns people missed around the moment, by one test or another.
fn missed(seed: u64) -> Vec<MissedPerson> {
    let test = ["margin", "size"][seed as usize % 2].to_owned();
    let missed = (0..4).zip(MOMENT..).map(|(i, frame)| MissedPerson {
        frame,
        person: 1,
        test: (i != 2).then(|| test.clone()),
        box_px: (i != 2).then_some([200.0, 90.0, 70.0, 70.0]),
        other_cause: (i == 2).then(|| "too far".to_owned()),
        cause: Some(usize::from(i == 2)),
    });
    missed.collect()
}

/// Returns one moment for each log.
fn moments(tasks: &[TaskResult]) -> Vec<Moment> {
    fn track(task: &TaskResult) -> (String, Vec<(i64, [f64; 4])>) {
        (task.pipeline.clone(), vec![(12, [390.0, 100.0, 62.0, 60.0])])
    }

    let logs: BTreeSet<&str> = tasks.iter().map(|task| task.log.as_str()).collect();
    let moments = logs.into_iter().map(|log| Moment {
        log: log.to_owned(),
        frame: MOMENT,
        t_s: 4.0,
        size: [640, 480],
        image_jpeg_base64: IMAGE.into(),
        people: vec![(1, [210.0, 85.0, 64.0, 64.0]), (2, [392.0, 98.0, 60.0, 60.0])],
        tracks: tasks.iter().filter(|task| task.log == log).map(track).collect(),
    });
    moments.collect()
}

fn events(wobble: &mut Wobble) -> Vec<EventRow> {
    let told = [
        ("found", "Person 1 is found as track 10."),
        ("miss", "Person 1 is lost; the last track was 10."),
        ("switch", "Person 1 goes on as track 11 instead of 10."),
        ("false-track", "Track 12 is where nobody is."),
        ("wrong-person", "Track 11, which began with person 1, is on person 2."),
    ];
    let events = told.into_iter().enumerate().map(|(i, (kind, text))| {
        let t_s = wobble.around(4.0 + 5.0 * i as f64, 2.0);
        EventRow {
            frame: (15.0 * t_s) as u64 + 1,
            t_s,
            kind: kind.into(),
            track: Some(10 + i as i64),
            person: (kind != "false-track").then_some(1),
            text: text.into(),
            picture_png_base64: Some(PICTURE.into()),
        }
    });
    events.collect()
}

/// Replaces the result of one task by another outcome, so that the page has a task to report.
pub fn spoil(benchmark: &mut Benchmark, outcome: Outcome) {
    if let Some(task) = benchmark.tasks.last_mut() {
        let pipeline = task.pipeline.clone();
        let log = task.log.clone();
        let hash = task.hash.clone();
        *task = TaskResult { pipeline, log, hash, seed: 1, outcome, ..TaskResult::default() };
    }
}

/// Returns invented times for all tasks.
pub fn timings(benchmark: &Benchmark) -> Timings {
    let mut wobble = Wobble(7);
    let mut tasks = BTreeMap::new();
    let first = benchmark.tasks.first().map_or("", |t| t.pipeline.as_str());
    for task in &benchmark.tasks {
        let slow = if task.pipeline == first {
            1.0
        } else {
            2.6 + 0.9 * task.pipeline.len() as f64 / 10.0
        };
        let stages = ["detect", "verify", "associate", "filter"].map(|stage| {
            let p50_ms = wobble.around(1.1, 0.8) * slow;
            let p95_ms = 1.8 * p50_ms;
            let p99_ms = 2.1 * p50_ms;
            let max_ms = 2.9 * p50_ms;
            StageTiming { stage: stage.into(), p50_ms, p95_ms, p99_ms, max_ms }
        });
        let frame_ms_p50 = stages.iter().map(|s| s.p50_ms).sum();
        let timing = TaskTiming {
            frame_ms_p50,
            frame_ms_p95: 1.7 * frame_ms_p50,
            frame_ms_p99: 2.0 * frame_ms_p50,
            frame_ms_max: 2.8 * frame_ms_p50,
            stages: stages.into(),
        };
        tasks.insert(task.hash.clone(), timing);
    }
    Timings { exclusive: true, machine: "an invented machine".into(), tasks }
}
