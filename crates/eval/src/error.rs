/// Reason why a sequence cannot be scored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// The same ID occurs twice in one frame.
    #[error(
        "sequence `{sequence}`, frame {frame} (1-based): {side} id {id} occurs twice; \
         an id must be unique within a frame, so renumber or drop one of them"
    )]
    DuplicateId {
        /// Name of the sequence.
        sequence: String,
        /// 1-based index of the frame.
        frame: usize,
        /// `truth` or `track`.
        side: &'static str,
        /// The ID.
        id: i64,
    },
    /// A region or position that the similarity compares is missing.
    #[error(
        "sequence `{sequence}`, frame {frame} (1-based): {side} id {id} has no {what}; \
         score with the other similarity or supply it"
    )]
    NoPlace {
        /// Name of the sequence.
        sequence: String,
        /// 1-based index of the frame.
        frame: usize,
        /// `truth` or `track`.
        side: &'static str,
        /// The ID.
        id: i64,
        /// `image region` or `floor position`.
        what: &'static str,
    },
    /// A region, position or score is not a number.
    #[error(
        "sequence `{sequence}`, frame {frame} (1-based): {side} id {id} has a number that is not \
         finite; repair or drop the row"
    )]
    NotFinite {
        /// Name of the sequence.
        sequence: String,
        /// 1-based index of the frame.
        frame: usize,
        /// `truth` or `track`.
        side: &'static str,
        /// The ID.
        id: i64,
    },
    /// The frames are not in chronological order.
    #[error(
        "sequence `{sequence}`, frame {frame} (1-based) is older than the one before; sort the \
         frames by stamp"
    )]
    OutOfOrder {
        /// Name of the sequence.
        sequence: String,
        /// 1-based index of the frame.
        frame: usize,
    },
}
