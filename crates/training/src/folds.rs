//! Models that one training of a verifier fits side by side: one of all data, and one for each real
//! room that has not seen this room. Each looks for its own mistakes.

use std::path::PathBuf;

use tagalong_app::outcome::Failure;
use tagalong_config::{Example, Trainer};
use tagalong_core::{Detection, Frame, Verifier};

use super::card::CandidateCounts;
use super::real_rooms::{self, is_of, room_names};
use super::session::{Session, write};

/// Margin below which a judgement is unsure: log-odds.
const UNSURE: f64 = 1.0;

/// A model in training.
pub struct Fold {
    /// The room that it may not see.
    without: Option<&'static str>,
    /// Path of the model.
    pub model: PathBuf,
    /// Counts of the candidates of each round.
    pub rounds: Vec<CandidateCounts>,
    /// Figures of the last fit.
    pub figures: toml::Table,
    trainer: Box<dyn Trainer>,
    /// The model of the last round.
    doubter: Option<Box<dyn Verifier>>,
}

impl Fold {
    fn new(session: &Session<'_>, without: Option<&'static str>) -> Result<Self, Failure> {
        let model = without.map_or_else(
            || session.model.clone(),
            |room| real_rooms::without(&session.model, room),
        );
        let (rounds, figures) = (Vec::new(), toml::Table::new());
        Ok(Self { without, model, rounds, figures, trainer: session.trainer()?, doubter: None })
    }

    fn see(
        &mut self,
        frame: &Frame,
        candidate: &Detection,
        example: Example,
    ) -> Result<(), Failure> {
        let Some(counts) = self.rounds.last_mut() else { return Ok(()) };
        counts.seen += 1;
        if let Some(verifier) = &mut self.doubter {
            let margin = verifier.log_odds(frame, candidate).map_err(Failure::failed)?;
            let right = if example.is_person { margin } else { -margin };
            counts.mistakes += u64::from(right < 0.0);
            // Only mistakes and unsure cases are added: the model is right about the rest.
            if right >= UNSURE {
                return Ok(());
            }
        }
        let count = if example.is_person { &mut counts.people } else { &mut counts.others };
        *count += 1;
        self.trainer.add(frame, candidate, example).map_err(Failure::failed)
    }

    fn fit(&mut self, session: &Session<'_>) -> Result<(), Failure> {
        session.bar.set_length(1000);
        let tell = &mut |part: f64| session.bar.set_position((1000.0 * part) as u64);
        let fitted = self.trainer.fit(tell).map_err(Failure::failed)?;
        // Written first: the verifier loads the model from its file.
        write(&self.model, &fitted.model)?;
        self.doubter = Some(session.verifier(&self.model)?);
        self.figures = fitted.figures;
        Ok(())
    }
}

/// All models of a training.
pub struct Folds(Vec<Fold>);

impl Folds {
    /// Begins with models that have seen nothing: that of all data first.
    ///
    /// # Errors
    /// A plugin that cannot be trained, or wrong settings: exit code 2.
    pub fn new(session: &Session<'_>) -> Result<Self, Failure> {
        let rooms = session.args.data.iter().flat_map(|_| room_names()).map(Some);
        let all = std::iter::once(None).chain(rooms);
        all.map(|without| Fold::new(session, without)).collect::<Result<_, _>>().map(Self)
    }

    /// Begins a round.
    pub fn next_round(&mut self) {
        self.0.iter_mut().for_each(|fold| fold.rounds.push(CandidateCounts::default()));
    }

    /// Shows a candidate to all models that may see it: all of them in the first round, after that
    /// each one that judges it wrongly or is unsure. `log` is that of a real room.
    ///
    /// # Errors
    /// A plugin that fails: exit code 1.
    pub fn see(
        &mut self,
        log: Option<&str>,
        frame: &Frame,
        candidate: &Detection,
        example: Example,
    ) -> Result<(), Failure> {
        let may_see = |fold: &Fold| match (fold.without, log) {
            (Some(room), Some(log)) => !is_of(log, room),
            _ => true,
        };
        let seeing = self.0.iter_mut().filter(|fold| may_see(fold));
        seeing.into_iter().try_for_each(|fold| fold.see(frame, candidate, example))
    }

    /// Fits and writes the models.
    ///
    /// # Errors
    /// A fit that fails, a model that cannot be written or that the plugin refuses.
    pub fn fit(&mut self, session: &Session<'_>, round: usize) -> Result<(), Failure> {
        let count = self.0.len();
        for (number, fold) in self.0.iter_mut().enumerate() {
            session.tell(round, &format!("fitting model {} of {count}", number + 1));
            fold.fit(session)?;
        }
        Ok(())
    }

    /// Returns the model of all data.
    pub fn of_all(&self) -> &Fold {
        &self.0[0]
    }
}
