//! Counts of a run.

use std::collections::BTreeMap;
use std::fmt;

use crate::inbox::Traffic;
use crate::wheels::CommandCounts;

/// Result of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Frames that the pipeline processed.
    pub frames: u64,
    /// Message counts by topic.
    pub traffic: BTreeMap<String, Traffic>,
    /// Skipped and lost inputs of the frame source, by name.
    pub counters: BTreeMap<&'static str, u64>,
    /// Commands sent to the wheels.
    pub told: CommandCounts,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} frames", self.frames)?;
        if let CommandCounts { commands, zeros } = self.told
            && commands > 0
        {
            writeln!(f, "{commands} commands, {zeros} of them zero")?;
        }
        for (topic, Traffic { received, dropped, malformed }) in &self.traffic {
            write!(f, "  {topic}: {received} received, {dropped} dropped unread")?;
            match malformed {
                0 => writeln!(f)?,
                _ => writeln!(f, ", {malformed} malformed")?,
            }
        }
        self.counters.iter().try_for_each(|(name, count)| writeln!(f, "  {name}: {count}"))
    }
}

impl Summary {
    /// Adds the counts of a later part of the run; those of topics are counted from its beginning.
    pub(crate) fn add(&mut self, later: Summary) {
        self.frames += later.frames;
        self.told.commands += later.told.commands;
        self.told.zeros += later.told.zeros;
        self.traffic = later.traffic;
        for (name, count) in later.counters {
            *self.counters.entry(name).or_default() += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_two_lives_add_up_and_those_of_topics_go_on() {
        let [few, many] = [10, 25].map(|received| {
            BTreeMap::from([("/odom".to_owned(), Traffic { received, ..Traffic::default() })])
        });
        let mut all = Summary {
            frames: 3,
            traffic: few,
            counters: BTreeMap::from([("unpaired", 1)]),
            told: CommandCounts { commands: 5, zeros: 5 },
        };
        all.add(Summary {
            frames: 4,
            traffic: many.clone(),
            counters: BTreeMap::from([("unpaired", 2), ("late", 1)]),
            told: CommandCounts { commands: 7, zeros: 6 },
        });
        let told = CommandCounts { commands: 12, zeros: 11 };
        let counters = BTreeMap::from([("unpaired", 3), ("late", 1)]);
        assert_eq!(all, Summary { frames: 7, traffic: many, counters, told });
    }
}
