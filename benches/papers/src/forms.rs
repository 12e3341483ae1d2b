//! The first table of each published system: the figures of its paper, the method as printed, the
//! method with its errors corrected, and ours, side by side; real rooms first.

use tagalong_eval::{Scores, Similarity, Tally};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Judge, Trial, TrialError};

use crate::draws::{over_draws, pooled};
use crate::real::{self, NOT_TRAINED_ON};
use crate::variant::{with_values, without_table};
use crate::{
    Cell, Experiment, Findings, Lab, ReproduceError, Row, Table, joint_particle, omni_appearance,
    rgbd_compressive, stereo,
};

/// Names of the forms, in the order of [`Forms::configs`].
const FORMS: [&str; 3] = ["as printed", "corrected", "ours"];
/// Figures of one draw whose mean is the headline, for each form.
type Headlines = Vec<Vec<f64>>;

/// The forms of a system, and how they are compared.
pub(crate) struct Forms {
    paper: &'static str,
    /// Shipped configs: as printed, corrected, and ours.
    configs: [&'static str; 3],
    /// Returns the configs for the simulated scenes.
    contenders: fn(&Lab, &[&str]) -> Result<Vec<Contender>, ReproduceError>,
    judge: Judge,
    /// False if no annotated real log has the sensor.
    has_real: bool,
    /// Name of the scene of the paper, and its draws.
    scene: &'static str,
    scenes: fn(&Lab) -> Result<Vec<Scene>, ReproduceError>,
    headline: Headline,
    /// Another reading of the printed form, beside it.
    otherwise: Option<Reading>,
    notes: &'static [&'static str],
}

/// A reading of the printed form that the text of the paper allows as well.
struct Reading {
    /// Difference in words.
    words: &'static str,
    /// Values, TOML, at dotted keys of the printed form.
    values: &'static [(&'static str, &'static str)],
}

/// The figure that a paper states of its system.
struct Headline {
    /// Title of the column.
    column: &'static str,
    published: f64,
    digits: usize,
    /// The largest value that it can have; the least is 0.
    most: f64,
    of: fn(Trial) -> Result<Headlines, TrialError>,
}

/// Results of one form on one simulated draw or one real log.
struct Form {
    tally: Tally,
    /// Errors of the matched people in the robot frame, m.
    errors_m: Vec<f64>,
    headline: Vec<f64>,
}

const ON_THE_FLOOR: Judge =
    Judge { similarity: Similarity::Metres, max_range_m: 6.0, coasting: false };
const ON_A_PAIR: &str = "Real logs have colour and depth images instead of a pair: there the \
    pipelines run without their `[stereo]` stage, with settings for the scatter of stereo.";
const VERIFIED: &str = "Trained on: `color-texture` and `body-net` of the last row on simulated \
    rooms, photographs and the logs `filinha` and `um`.";

const OF_P1: Forms = Forms {
    paper: "P1",
    configs: ["stereo-ekf-as-printed", "stereo-ekf", "stereo-verified"],
    contenders: shipped,
    judge: ON_THE_FLOOR,
    has_real: true,
    scene: "square-walk",
    scenes: stereo::walks,
    headline: Headline {
        column: "frame, ms",
        published: 70.0,
        digits: 0,
        most: f64::INFINITY,
        of: frame_ms,
    },
    otherwise: None,
    notes: &[
        ON_A_PAIR,
        VERIFIED,
        "The paper shows rides in pictures; its only figure is the time of a frame, on a Core2Duo of \
         2.6 GHz. Ours is processor time, the matching of the pair included.",
    ],
};

const OF_P2: Forms = Forms {
    paper: "P2",
    configs: ["rgbd-compressive-as-printed", "rgbd-compressive", "rgbd-ekf"],
    contenders: shipped,
    judge: rgbd_compressive::JUDGE,
    has_real: true,
    otherwise: None,
    scene: "static-high",
    scenes: rgbd_compressive::static_scenes,
    headline: Headline {
        column: "frames/s",
        published: 23.8,
        digits: 0,
        most: f64::INFINITY,
        of: frames_a_second,
    },
    notes: &[
        "Trained on: the detectors of faces and upper bodies on photographs alone. A threshold of \
         the last row was chosen while looking at real logs.",
        "The paper's curves of the miss rate are pictures (next table); frames a second are of \
         processor time, and its processor is an older one.",
    ],
};

const OF_P3: Forms = Forms {
    paper: "P3",
    configs: ["joint-particle-as-printed", "joint-particle-kde50", "stereo-particle"],
    contenders: joint_particle::on_a_pair,
    judge: ON_THE_FLOOR,
    has_real: true,
    scene: "crossing-parallel",
    scenes: joint_particle::crossings,
    headline: Headline {
        column: "success across, %",
        published: 97.1,
        digits: 0,
        most: 100.0,
        of: joint_particle::successes,
    },
    otherwise: Some(Reading {
        words: "one window for all scenes, no ConDensation",
        values: &joint_particle::OTHER_READING,
    }),
    notes: &[
        "Read otherwise: the paper prints neither the window in which it compares images nor its \
         filter. As printed has a window around the people of each scene and OpenCV's \
         ConDensation; read otherwise is the same, misprints included, with the whole image as the \
         window of all scenes of a frame, and resampling that reports what was weighed instead of \
         what it predicts.",
        ON_A_PAIR,
        VERIFIED,
        "Success as in the next table; published is method (c) with 50 particles, over 140 \
         crossings.",
    ],
};

const OF_P4: Forms = Forms {
    paper: "P4",
    configs: ["stereo-svm-ekf-as-printed", "stereo-svm-ekf", "stereo-verified"],
    headline: Headline {
        column: "walker, frame of the start, m",
        published: 0.125,
        digits: 3,
        most: f64::INFINITY,
        of: stereo::walker_errors_m,
    },
    notes: &[
        ON_A_PAIR,
        "Trained on: the verifier as printed on simulated rooms, `svm-patch`, `color-texture` and \
         `body-net` also on photographs and the logs `filinha` and `um`.",
        "The headline is the mean error of Fig. 11, of one walk in the paper, predicted places \
         and the drift of the wheels included; here the mean over walks.",
    ],
    ..OF_P1
};

const OF_P5: Forms = Forms {
    paper: "P5",
    configs: ["omni-appearance-as-printed", "omni-appearance", "omni-rich"],
    contenders: shipped,
    judge: ON_THE_FLOOR,
    has_real: false,
    scene: "omni-room",
    scenes: omni_appearance::rooms,
    headline: Headline {
        column: "error of all answers, m",
        published: 0.145,
        digits: 3,
        most: f64::INFINITY,
        of: omni_appearance::answers_m,
    },
    otherwise: None,
    notes: &[
        "No real log of a conical mirror is at hand, so the real columns are empty.",
        "The headline is section 6.2's, appearance model and Kalman filter in one room; here the \
         mean over rooms, in none of which the models were trained.",
    ],
};

/// Returns the shipped configs.
fn shipped(lab: &Lab, names: &[&str]) -> Result<Vec<Contender>, ReproduceError> {
    lab.contenders(names)
}

/// Returns the experiment that runs one of the functions below.
pub(crate) const fn experiment(run: fn(&Lab) -> Result<Findings, ReproduceError>) -> Experiment {
    Experiment { name: "forms", about: "published, as printed, corrected and ours", run }
}

/// Compares the forms of P1.
pub(crate) fn of_p1(lab: &Lab) -> Result<Findings, ReproduceError> {
    OF_P1.compare(lab)
}

/// Compares the forms of P2.
pub(crate) fn of_p2(lab: &Lab) -> Result<Findings, ReproduceError> {
    OF_P2.compare(lab)
}

/// Compares the forms of P3.
pub(crate) fn of_p3(lab: &Lab) -> Result<Findings, ReproduceError> {
    OF_P3.compare(lab)
}

/// Compares the forms of P4.
pub(crate) fn of_p4(lab: &Lab) -> Result<Findings, ReproduceError> {
    OF_P4.compare(lab)
}

/// Compares the forms of P5.
pub(crate) fn of_p5(lab: &Lab) -> Result<Findings, ReproduceError> {
    OF_P5.compare(lab)
}

impl Forms {
    fn compare(&self, lab: &Lab) -> Result<Findings, ReproduceError> {
        let real = if self.has_real { self.real_logs(lab)? } else { Vec::new() };
        let scenes = (self.scenes)(lab)?;
        let contenders = self.with_otherwise((self.contenders)(lab, &self.configs)?)?;
        let simulated = lab.trials(self.scene, &scenes, &contenders, |trial: Trial| {
            let mut forms = self.judged(&trial)?;
            let headlines = (self.headline.of)(trial)?;
            forms.iter_mut().zip(headlines).for_each(|(form, of)| form.headline = of);
            Ok(forms)
        })?;
        Ok(self.table(&real, &simulated).into())
    }

    /// Runs all forms on each real log that no model of theirs was trained on.
    fn real_logs(&self, lab: &Lab) -> Result<Vec<Vec<Form>>, ReproduceError> {
        let contenders = self.with_otherwise(lab.contenders(&self.configs)?)?;
        let contenders = contenders.iter().map(|contender| without_table(contender, "stereo"));
        let contenders = contenders.collect::<Result<Vec<_>, _>>()?;
        lab.progress.begin(NOT_TRAINED_ON.len(), "real logs");
        let mut logs = Vec::new();
        for log in NOT_TRAINED_ON {
            if let Some(trial) = real::trial(lab, log, &contenders)? {
                logs.push(self.judged(&trial)?);
            }
            lab.progress.step();
        }
        Ok(logs)
    }

    /// Returns the forms with the other reading of the first one, if there is one, after them.
    fn with_otherwise(
        &self,
        mut contenders: Vec<Contender>,
    ) -> Result<Vec<Contender>, ReproduceError> {
        if let (Some(Reading { words, values }), Some(printed)) =
            (&self.otherwise, contenders.first())
        {
            let other = with_values(printed, words, values)?;
            contenders.push(other);
        }
        Ok(contenders)
    }

    /// Returns the names of the rows, and the place of each among the forms.
    fn rows(&self) -> Vec<(String, usize)> {
        let mut rows = Vec::new();
        for (at, (form, config)) in FORMS.iter().zip(self.configs).enumerate() {
            rows.push((format!("{form}: {config}"), at));
            if let Some(Reading { words, .. }) = self.otherwise.as_ref().filter(|_| at == 0) {
                rows.push((format!("{form}, read otherwise: {words}"), FORMS.len()));
            }
        }
        rows
    }

    fn judged(&self, trial: &Trial) -> Result<Vec<Form>, TrialError> {
        trial
            .runs
            .iter()
            .map(|run| {
                let judged = self.judge.judge(trial, run)?;
                let errors_m = judged.errors_in_robot_m;
                Ok(Form { tally: judged.tally, errors_m, headline: Vec::new() })
            })
            .collect()
    }

    fn table(&self, real: &[Vec<Form>], simulated: &[Vec<Form>]) -> Table {
        let Headline { column, published, digits, .. } = self.headline;
        let columns = [
            "IDF1, real",
            "HOTA, real",
            "IDF1, simulated",
            "MOTA, simulated",
            "position error, simulated, m",
            column,
        ];
        let mut paper = vec![Cell::default(); columns.len() - 1];
        paper.push(Cell::number(published, digits));
        let ours = self
            .rows()
            .into_iter()
            .map(|(name, at)| Row::ours(name, cells(at, real, simulated, &self.headline)));
        Table {
            title: format!("{}: published, as printed, corrected and ours", self.paper),
            columns: columns.map(String::from).to_vec(),
            rows: std::iter::once(Row::published(self.paper, paper)).chain(ours).collect(),
            notes: self.notes(real.len(), simulated.len()),
        }
    }

    fn notes(&self, logs: usize, draws: usize) -> Vec<String> {
        let right = match self.judge.similarity {
            Similarity::Iou => "right is a box with an IoU of 0.5",
            _ => "right is a report within half a metre on the floor",
        };
        let logs = match logs {
            0 => "Real: no log was read.".into(),
            _ => format!(
                "Real: {}, annotated by hand, rooms in which no model of these rows was trained; \
                 some settings of silhouettes and tracks were chosen while looking at them.",
                NOT_TRAINED_ON.join(", ")
            ),
        };
        let simulated = format!(
            "Simulated: {draws} draws of {}; people within 6 m, {right}; intervals are over draws.",
            self.scene
        );
        let own = self.notes.iter().map(|note| (*note).to_owned());
        [logs, simulated].into_iter().chain(own).collect()
    }
}

/// Returns the cells of one form.
fn cells(at: usize, real: &[Vec<Form>], simulated: &[Vec<Form>], headline: &Headline) -> Vec<Cell> {
    let tallies = |of: &[Vec<Form>]| of.iter().map(|forms| forms[at].tally.clone()).collect();
    let (logs, draws): (Vec<Tally>, Vec<Tally>) = (tallies(real), tallies(simulated));
    // Three rooms bear no interval.
    let real = |score: fn(&Scores) -> Option<f64>| {
        if logs.is_empty() {
            Cell::default()
        } else {
            Cell::number(score(&Tally::combine(&logs).scores()).unwrap_or(f64::NAN), 3)
        }
    };
    let draws: Vec<&Tally> = draws.iter().collect();
    let mean = |of: fn(&Form) -> &Vec<f64>, digits| {
        let values: Vec<Vec<f64>> = simulated.iter().map(|forms| of(&forms[at]).clone()).collect();
        Cell { deviation: None, ..over_draws(&values, digits) }
    };
    vec![
        real(|scores| scores.idf1),
        real(|scores| scores.hota),
        pooled(&draws, 3, |scores| scores.idf1).within(0.0, 1.0),
        pooled(&draws, 3, |scores| scores.mota).within(f64::NEG_INFINITY, 1.0),
        mean(|form| &form.errors_m, 3).within(0.0, f64::INFINITY),
        mean(|form| &form.headline, headline.digits).within(0.0, headline.most),
    ]
}

/// Returns the processor time of a frame, ms.
fn frame_ms(trial: Trial) -> Result<Headlines, TrialError> {
    Ok(trial.runs.iter().map(|run| vec![run.worked_ms / run.reports.len() as f64]).collect())
}

fn frames_a_second(trial: Trial) -> Result<Headlines, TrialError> {
    Ok(trial.runs.iter().map(|run| vec![1e3 * run.reports.len() as f64 / run.worked_ms]).collect())
}

#[cfg(test)]
mod tests {
    use tagalong_config::Registry;
    use tagalong_eval::Clear;

    use super::*;
    use crate::lab::testing::lab;
    use crate::variant::parsed;
    use crate::{SYSTEMS, system};

    const ALL: [&Forms; 5] = [&OF_P1, &OF_P2, &OF_P3, &OF_P4, &OF_P5];

    /// A draw with as many hits and false alarms for each form, and the errors of its headline.
    fn draw<const N: usize>(forms: [(u64, u64, &[f64]); N]) -> Vec<Form> {
        fn form((tp, fp, headline): (u64, u64, &[f64])) -> Form {
            Form {
                tally: Tally {
                    clear: Clear { tp, fp, ..Clear::default() },
                    truths: tp,
                    ..Tally::default()
                },
                errors_m: vec![0.1],
                headline: headline.to_vec(),
            }
        }

        forms.map(form).into()
    }

    #[test]
    fn the_forms_of_each_paper_are_its_first_table() {
        for name in SYSTEMS.iter().map(|system| system.name).filter(|name| *name != "laser") {
            assert_eq!(system(name).unwrap().experiments[0].name, "forms", "{name}");
        }
    }

    #[test]
    fn every_form_is_a_shipped_config_and_sees_pairs_where_the_paper_does() {
        fn sees_pairs(contender: &Contender) -> bool {
            parsed(contender).unwrap().contains_key("stereo")
        }

        let registry = Registry::default();
        let lab = lab(&registry, true, None);
        for forms in ALL {
            let simulated = (forms.contenders)(&lab, &forms.configs).unwrap();
            let of_pairs = ["P1", "P3", "P4"].contains(&forms.paper);
            assert!(simulated.iter().all(|form| sees_pairs(form) == of_pairs), "{}", forms.paper);
            for contender in lab.contenders(&forms.configs).unwrap() {
                assert!(!sees_pairs(&without_table(&contender, "stereo").unwrap()));
            }
        }
    }

    #[test]
    fn another_reading_stands_below_the_printed_form() {
        let registry = Registry::default();
        let lab = lab(&registry, true, None);
        let forms =
            OF_P3.with_otherwise((OF_P3.contenders)(&lab, &OF_P3.configs).unwrap()).unwrap();
        assert_eq!(forms.len(), 4);
        let printed = parsed(&forms[0]).unwrap();
        let other = parsed(&forms[3]).unwrap();
        assert_eq!(other["filter"]["config"]["condensation"].as_bool(), Some(false));
        assert_eq!(other["detectors"][0]["config"]["whole_image"].as_bool(), Some(true));
        assert_ne!(printed["filter"], other["filter"], "the printed form stays");
        let draw = draw([(1, 0, &[0.0]), (1, 0, &[88.0]), (1, 0, &[100.0]), (1, 0, &[29.0])]);
        let table = OF_P3.table(&[], &[draw]);
        let headlines: Vec<_> = table.rows.iter().map(|row| row.cells[5].value.unwrap()).collect();
        assert_eq!(headlines, [97.1, 0.0, 29.0, 88.0, 100.0]);
        let draws = [0.0, 100.0, 100.0].map(|kept| self::draw([(1, 0, &[kept])]));
        let cells = cells(0, &[], &draws, &OF_P3.headline);
        assert_eq!(cells[5].interval, Some([0.0, 100.0]), "a share is no more than all");
        assert!(table.rows[2].name.starts_with("as printed, read otherwise: one window"));
        assert_eq!(
            OF_P4.with_otherwise((OF_P4.contenders)(&lab, &OF_P4.configs).unwrap()).unwrap().len(),
            3
        );
    }

    #[test]
    fn scores_are_of_all_draws_and_the_headline_is_the_mean_over_draws() {
        let draws = [
            draw([(1, 1, &[1.0, 1.0]), (4, 0, &[2.0]), (4, 0, &[])]),
            draw([(3, 1, &[3.0]), (4, 4, &[2.0]), (4, 0, &[0.5])]),
        ];
        let table = OF_P4.table(&[], &draws);
        let column =
            |at: usize| table.rows.iter().map(|row| row.cells[at].value).collect::<Vec<_>>();
        assert_eq!(column(0), [None; 4], "no log was read");
        assert_eq!(column(3), [None, Some(0.5), Some(0.5), Some(1.0)]);
        assert_eq!(column(5), [Some(0.125), Some(2.0), Some(2.0), Some(0.5)]);
        assert!(table.rows[0].published && table.notes[0].contains("no log was read"));
        let logs = [draw([(1, 0, &[]), (1, 0, &[]), (1, 0, &[])])];
        let with_logs = OF_P4.table(&logs, &draws);
        assert!(with_logs.notes[0].contains("lab2-camera1"), "{}", with_logs.notes[0]);
    }
}
