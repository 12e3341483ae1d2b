//! Verifier of P4 with as many samples as the paper had, and with all that there are.

use tagalong_config::{Example, Trainer};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Split;

use super::left_out::{DETECTS, LOWERED, judges_of, trainer, visit, without_verifiers};
use super::variants;
use super::verifier::share;
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

const PLUGIN: &str = "svm-patch";
/// Forms of the patches, with the settings of their training but the number of samples. The penalties
/// are those that cross-validation chose for the shipped models.
const FORMS: [(&str, &str); 2] = [
    (
        "20x20 grey values, as printed",
        "scaling = 'unit', grow = 0.0, gammas = [8.0], penalties = [30.0]",
    ),
    ("directions of gradients", "scaling = 'gradients', gammas = [2.0], penalties = [3.0]"),
];
/// Numbers of people and of others: those of the paper, and all.
const SIZES: [(&str, [usize; 2]); 2] = [("438 + 146 samples", [438, 146]), ("all samples", [0, 0])];
/// Random choices of the samples of the paper's size.
const CHOICES: u64 = 5;

/// Candidates that count, and of these rejected ones.
#[derive(Clone, Copy, Debug, Default)]
struct Judged {
    things: [u64; 2],
    people: [u64; 2],
}

/// Trains both forms with both numbers of samples, and counts what they reject in rooms of the test
/// split.
pub fn few_samples(lab: &Lab) -> Result<Findings, ReproduceError> {
    let detects = without_verifiers(&lab.contender(DETECTS)?)?;
    let seeds = lab.seeds(40);
    let mut trainers = Vec::new();
    for (_, form) in FORMS {
        for (_, size) in SIZES {
            trainers.push(trainers_of(lab, form, size)?);
        }
    }
    let lowered = variants::with(&detects, &LOWERED)?;
    let mut counts = [0u64; 2];
    visit(lab, Split::Train, 2 * seeds, &lowered, &mut |frame, candidate| {
        counts[usize::from(candidate.is_person)] += 1;
        let example = Example { is_person: candidate.is_person, group: candidate.group };
        for trainer in trainers.iter_mut().flatten() {
            trainer.add(frame, candidate.detection, example).map_err(ReproduceError::other)?;
        }
        Ok(())
    })?;
    lab.progress.begin(trainers.iter().flatten().count(), "models of few and of many samples");
    let mut judges = Vec::new();
    for trainers in trainers {
        judges.push(judges_of(lab, PLUGIN, "", trainers)?);
    }
    let mut judged = vec![Judged::default(); judges.len()];
    visit(lab, Split::Test, seeds, &detects, &mut |frame, candidate| {
        // Candidates that the detector drops itself never matter to a verifier.
        if !candidate.is_believed {
            return Ok(());
        }
        for (judges, judged) in judges.iter_mut().zip(&mut judged) {
            for judge in judges {
                let margin =
                    judge.log_odds(frame, candidate.detection).map_err(ReproduceError::other)?;
                judged.add(candidate.is_person, candidate.detection.score + margin < 0.0);
            }
        }
        Ok(())
    })?;
    Ok(table(&judged, counts, seeds).into())
}

/// Returns a trainer for each random choice of the samples: one where all are taken.
fn trainers_of(
    lab: &Lab,
    form: &str,
    [people, others]: [usize; 2],
) -> Result<Vec<Box<dyn Trainer>>, ReproduceError> {
    let settings = format!("training = {{ {form}, people = {people}, others = {others} }}");
    let choices = if people == 0 { 1 } else { CHOICES };
    (1..=choices).map(|seed| trainer(lab, PLUGIN, &settings, seed)).collect()
}

impl Judged {
    fn add(&mut self, is_person: bool, is_rejected: bool) {
        let of = if is_person { &mut self.people } else { &mut self.things };
        *of = [of[0] + 1, of[1] + u64::from(is_rejected)];
    }
}

fn table(judged: &[Judged], [others, people]: [u64; 2], seeds: u64) -> Table {
    let mut rows = vec![Row::published(
        "20x20 grey values, 438 + 146 samples",
        vec![Cell::number(100.0, 0), Cell::number(6.0, 0)],
    )];
    let forms = FORMS.iter().flat_map(|(form, _)| SIZES.iter().map(move |(size, _)| (form, size)));
    for ((form, size), judged) in forms.zip(judged) {
        let cells = vec![share(judged.things), share(judged.people)];
        rows.push(Row::ours(format!("{form}, {size}"), cells));
    }
    Table {
        title: "The verifier by the number of its samples (P4, section II-C)".into(),
        columns: ["false ones removed %", "people's rejected %"].map(String::from).to_vec(),
        rows,
        notes: vec![
            format!(
                "All samples: {people} proposals of people and {others} of others in simulated \
                 stereo scenes of {} draws of the split `train`; judged in {seeds} draws of `test`, \
                 in the sightings that the detector of `stereo-verified` believes",
                2 * seeds
            ),
            format!(
                "438 + 146: {CHOICES} random choices of people and others among these, all counted \
                 together (fewer where there are fewer). Wilson intervals take sightings as \
                 independent: they are too narrow."
            ),
            "Gamma 8 is the paper's and gamma 2 ours; the penalties, 30 and 3, are those that \
             cross-validation chose for the shipped models. The paper's samples are of its own \
             rooms and its figures of three sequences, counts lost."
                .into(),
        ],
    }
}

#[cfg(test)]
mod tests {
    use tagalong_config::Registry;

    use super::*;
    use crate::lab::testing::lab;

    #[test]
    fn each_form_has_a_row_of_few_samples_and_one_of_all() {
        let mut judged = [Judged::default(); 4];
        for (at, judged) in judged.iter_mut().enumerate() {
            (0..4).for_each(|count| judged.add(false, count <= at));
            (0..8).for_each(|count| judged.add(true, count < at));
        }
        let table = table(&judged, [30, 70], 2);
        let removed: Vec<_> = table.rows.iter().map(|row| row.cells[0].value.unwrap()).collect();
        let rejected: Vec<_> = table.rows.iter().map(|row| row.cells[1].value.unwrap()).collect();
        assert_eq!(removed, [100.0, 25.0, 50.0, 75.0, 100.0]);
        assert_eq!(rejected, [6.0, 0.0, 12.5, 25.0, 37.5]);
        assert!(table.rows[0].published);
        assert!(table.rows[1].name.ends_with("as printed, 438 + 146 samples"));
        assert_eq!(table.rows[4].name, "directions of gradients, all samples");
        assert!(table.notes[0].contains("70 proposals of people and 30 of others"));
    }

    #[test]
    fn few_samples_are_chosen_several_times() {
        let mut registry = Registry::default();
        crate::register(&mut registry);
        let lab = lab(&registry, true, None);
        for (_, form) in FORMS {
            assert_eq!(trainers_of(&lab, form, SIZES[0].1).unwrap().len(), CHOICES as usize);
            assert_eq!(trainers_of(&lab, form, SIZES[1].1).unwrap().len(), 1);
        }
    }
}
