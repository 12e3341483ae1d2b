//! The first table of a published system: the figures of its paper, the method as printed, the
//! method with its errors corrected, and ours, side by side; real rooms first.

use tagalong_eval::{Similarity, Tally};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Judge, Trial, TrialError};

use crate::draws::{over_draws, pooled};
use crate::findings::{Experiment, Findings};
use crate::lab::{Lab, ReproduceError};
use crate::real::{self, NOT_TRAINED_ON};
use crate::variant::{with_values, without_table};

/// Names of the forms, in the order of [`Forms::configs`].
const FORMS: [&str; 3] = ["as printed", "corrected", "ours"];
/// Figures of one draw whose mean is the headline, for each form.
type Headlines = Vec<Vec<f64>>;

/// The forms of a system, and how they are compared.
pub(crate) struct Forms {
    pub(crate) paper: &'static str,
    /// Shipped configs: as printed, corrected, and ours.
    pub(crate) configs: [&'static str; 3],
    /// Returns the configs for the simulated scenes.
    pub(crate) contenders: fn(&Lab, &[&str]) -> Result<Vec<Contender>, ReproduceError>,
    pub(crate) judge: Judge,
    /// False if no annotated real log has the sensor.
    pub(crate) has_real: bool,
    /// Name of the scene of the paper, and its draws.
    pub(crate) scene: &'static str,
    pub(crate) scenes: fn(&Lab) -> Result<Vec<Scene>, ReproduceError>,
    pub(crate) headline: Headline,
    /// Another reading of the printed form, beside it.
    pub(crate) otherwise: Option<Reading>,
    pub(crate) notes: &'static [&'static str],
}

/// A reading of the printed form that the text of the paper allows as well.
pub(crate) struct Reading {
    /// Difference in words.
    pub(crate) words: &'static str,
    /// Values, TOML, at dotted keys of the printed form.
    pub(crate) values: &'static [(&'static str, &'static str)],
}

/// The figure that a paper states of its system.
pub(crate) struct Headline {
    /// Title of the column.
    pub(crate) column: &'static str,
    pub(crate) published: f64,
    pub(crate) digits: usize,
    /// True for a share of the draws, of which each has 100 or 0; another figure is a mean that is
    /// not below 0.
    pub(crate) is_share: bool,
    pub(crate) of: fn(Trial) -> Result<Headlines, TrialError>,
}

/// Results of one form on one simulated draw or one real log.
struct Form {
    tally: Tally,
    /// Errors of the matched people in the robot frame, m.
    errors_m: Vec<f64>,
    headline: Vec<f64>,
}

pub(crate) const ON_THE_FLOOR: Judge =
    Judge { similarity: Similarity::Metres, max_range_m: 6.0, coasting: false };
pub(crate) const ON_A_PAIR: &str = "Real logs have colour and depth images instead of a pair: \
    there the pipelines run without their `[stereo]` stage, with settings for the scatter of stereo.";
pub(crate) const VERIFIED: &str = "Trained on: `color-texture` and `body-net` of the last row on \
    simulated rooms, photographs and the logs `filinha` and `um`.";

/// Returns the shipped configs.
pub(crate) fn shipped(lab: &Lab, names: &[&str]) -> Result<Vec<Contender>, ReproduceError> {
    lab.contenders(names)
}

/// Returns the experiment that runs one of the functions below.
pub(crate) const fn experiment(run: fn(&Lab) -> Result<Findings, ReproduceError>) -> Experiment {
    Experiment { name: "forms", about: "published, as printed, corrected and ours", run }
}

impl Forms {
    /// Runs the forms on real logs and simulated scenes, and returns their table.
    pub(crate) fn compare(&self, lab: &Lab) -> Result<Findings, ReproduceError> {
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
    let [logs, draws]: [Vec<Tally>; 2] =
        [real, simulated].map(|of| of.iter().map(|forms| forms[at].tally.clone()).collect());
    // Three rooms bear no interval.
    let [mut idf1, mut hota] = [Cell::default(), Cell::default()];
    if !logs.is_empty() {
        let scores = Tally::combine(&logs).scores();
        idf1 = Cell::number(scores.idf1.unwrap_or(f64::NAN), 3);
        hota = Cell::number(scores.hota.unwrap_or(f64::NAN), 3);
    }
    let draws: Vec<&Tally> = draws.iter().collect();
    let errors: Vec<Vec<f64>> = simulated.iter().map(|forms| forms[at].errors_m.clone()).collect();
    let errors = Cell { deviation: None, ..over_draws(&errors, 3) };
    let figures = simulated.iter().map(|forms| &forms[at].headline);
    let figure = if headline.is_share {
        share_of_draws(figures, headline.digits)
    } else {
        let figures: Vec<Vec<f64>> = figures.cloned().collect();
        let figure = Cell { deviation: None, ..over_draws(&figures, headline.digits) };
        figure.within(0.0, f64::INFINITY)
    };
    vec![
        idf1,
        hota,
        pooled(&draws, 3, |scores| scores.idf1).within(0.0, 1.0),
        pooled(&draws, 3, |scores| scores.mota).within(f64::NEG_INFINITY, 1.0),
        errors.within(0.0, f64::INFINITY),
        figure,
    ]
}

/// Returns the share of draws with 100, and its Wilson interval, as in the other tables of successes:
/// a mean of draws that all succeed has none.
fn share_of_draws<'a>(draws: impl Iterator<Item = &'a Vec<f64>>, digits: usize) -> Cell {
    let values: Vec<f64> = draws.flatten().copied().collect();
    let successes = values.iter().filter(|value| **value > 0.0).count();
    Cell::share(successes as u64, values.len() as u64, digits)
}

#[cfg(test)]
mod tests {
    use tagalong_config::Registry;
    use tagalong_eval::Clear;

    use super::*;
    use crate::joint_particle::OF_P3;
    use crate::lab::testing::lab;
    use crate::omni_appearance::OF_P5;
    use crate::rgbd_compressive::OF_P2;
    use crate::stereo::{OF_P1, OF_P4};
    use crate::variant::parsed;

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
        // Of four draws the forms succeed in none, three, all and one.
        let draws = [
            draw([(1, 0, &[0.0]), (1, 0, &[0.0]), (1, 0, &[100.0]), (1, 0, &[100.0])]),
            draw([(1, 0, &[0.0]), (1, 0, &[100.0]), (1, 0, &[100.0]), (1, 0, &[0.0])]),
            draw([(1, 0, &[0.0]), (1, 0, &[100.0]), (1, 0, &[100.0]), (1, 0, &[0.0])]),
            draw([(1, 0, &[0.0]), (1, 0, &[100.0]), (1, 0, &[100.0]), (1, 0, &[0.0])]),
        ];
        let table = OF_P3.table(&[], &draws);
        let headlines: Vec<_> = table.rows.iter().map(|row| row.cells[5].value.unwrap()).collect();
        assert_eq!(headlines, [97.1, 0.0, 25.0, 75.0, 100.0]);
        assert!(table.rows[2].name.starts_with("as printed, read otherwise: one window"));
        assert_eq!(
            OF_P4.with_otherwise((OF_P4.contenders)(&lab, &OF_P4.configs).unwrap()).unwrap().len(),
            3
        );
    }

    #[test]
    fn a_share_of_the_draws_has_the_interval_of_wilson() {
        fn headline(draws: &[&[f64]]) -> Cell {
            let draws: Vec<Vec<Form>> =
                draws.iter().map(|values| draw([(1, 0, *values)])).collect();
            cells(0, &[], &draws, &OF_P3.headline)[5].clone()
        }

        let most = headline(&[&[100.0], &[100.0], &[0.0], &[100.0], &[], &[100.0]]);
        assert_eq!(most, Cell::share(4, 5, 0), "a crossing that is no trial does not count");
        let all = headline(&[&[100.0][..]; 8]);
        let [lower, upper] = all.interval.expect("eight successes leave room for a failure");
        assert!((lower - 67.56).abs() < 0.01 && upper == 100.0, "{all:?}");
        assert_eq!(headline(&[&[0.0][..]; 8]).interval.map(|ends| ends[0]), Some(0.0));
    }

    #[test]
    fn scores_are_of_all_draws_and_the_headline_is_the_mean_over_draws() {
        let draws = [
            draw([(1, 1, &[1.0, 1.0]), (4, 0, &[2.0]), (4, 0, &[])]),
            draw([(3, 1, &[3.0]), (4, 4, &[2.0]), (4, 0, &[0.5])]),
        ];
        let table = OF_P4.table(&[], &draws);
        for (at, values, why) in [
            (0, [None; 4], "no log was read"),
            (3, [None, Some(0.5), Some(0.5), Some(1.0)], "MOTA of all draws"),
            (5, [Some(0.125), Some(2.0), Some(2.0), Some(0.5)], "means over draws"),
        ] {
            let column: Vec<_> = table.rows.iter().map(|row| row.cells[at].value).collect();
            assert_eq!(column, values, "{why}");
        }
        assert!(table.rows[0].published && table.notes[0].contains("no log was read"));
        let logs = [draw([(1, 0, &[]), (1, 0, &[]), (1, 0, &[])])];
        let with_logs = OF_P4.table(&logs, &draws);
        assert!(with_logs.notes[0].contains("lab2-camera1"), "{}", with_logs.notes[0]);
    }
}
