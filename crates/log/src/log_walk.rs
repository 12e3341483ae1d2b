//! Walk through a log of either container, told apart by its first bytes.

use std::io::Read;
use std::sync::Arc;

use crate::Limits;
use crate::bag_walk::{self, BagWalker};
use crate::mcap_walk::source::Source;
use crate::mcap_walk::{Channel, Counters, Message, NotMcap, Walker};

/// Reader of an MCAP file or of a ROS 1 bag, message by message.
pub enum LogWalker<R> {
    /// MCAP.
    Mcap(Box<Walker<R>>),
    /// ROS 1 bag.
    Bag(Box<BagWalker<R>>),
}

macro_rules! either {
    ($self:ident, $walker:ident => $call:expr) => {
        match $self {
            Self::Mcap($walker) => $call,
            Self::Bag($walker) => $call,
        }
    };
}

impl<R: Read> LogWalker<R> {
    /// Starts a walk.
    ///
    /// # Errors
    /// [`NotMcap`] if the file starts as neither container does.
    pub fn new(reader: R, limits: &Limits) -> Result<Self, NotMcap> {
        let mut source = Source::new(reader);
        let mut magic = [0; 13];
        let got = source.fill(&mut magic[..8]);
        // The magic of a bag is longer than that of MCAP, and no more may be read of the latter.
        let may_be_bag = magic[..got] == bag_walk::MAGIC[..8];
        if may_be_bag && source.fill(&mut magic[8..]) == 5 && magic[..] == *bag_walk::MAGIC {
            return Ok(Self::Bag(Box::new(BagWalker::new(source, limits))));
        }
        Walker::behind(source, &magic[..got], limits).map(|walker| Self::Mcap(Box::new(walker)))
    }

    /// Adds the channels of an earlier walk through the same file.
    #[must_use]
    pub fn knowing(self, channels: impl IntoIterator<Item = Arc<Channel>>) -> Self {
        match self {
            Self::Mcap(walker) => Self::Mcap(Box::new(walker.knowing(channels))),
            Self::Bag(walker) => Self::Bag(Box::new(walker.knowing(channels))),
        }
    }

    /// Returns the next message in the order of the file; `None` at the end, and from then on.
    #[expect(clippy::should_implement_trait, reason = "the message borrows the walker's buffer")]
    pub fn next(&mut self) -> Option<Message<'_>> {
        either!(self, walker => walker.next())
    }

    /// Goes on to the next message; returns false at the end.
    pub(crate) fn advance(&mut self) -> bool {
        either!(self, walker => walker.advance())
    }

    /// Returns the message that [`LogWalker::advance`] reached.
    pub(crate) fn message(&self) -> Option<Message<'_>> {
        either!(self, walker => walker.message())
    }

    /// Returns the channels found so far.
    pub fn channels(&self) -> Box<dyn Iterator<Item = &Arc<Channel>> + '_> {
        either!(self, walker => Box::new(walker.channels()))
    }

    /// Returns the numbers of records read, skipped and lost, by name.
    pub fn counters(&self) -> &Counters {
        either!(self, walker => walker.counters())
    }

    /// Returns true if some part of the file could not be used.
    pub fn data_lost(&self) -> bool {
        either!(self, walker => walker.data_lost())
    }

    /// Returns sentences about the damage, each with its offset in the file; only the first few.
    pub fn notes(&self) -> &[String] {
        either!(self, walker => walker.notes())
    }

    /// Returns the number of bytes of the file consumed so far.
    pub fn position(&self) -> u64 {
        either!(self, walker => walker.position())
    }

    /// Returns the reader, behind the buffered part of the file.
    pub(crate) fn into_reader(self) -> R {
        either!(self, walker => walker.into_reader())
    }
}
