//! The subcommands that answer a question.

mod check;
mod config;
mod eval;
mod inspect;
mod list;

pub use check::check;
pub use config::config;
pub use eval::{EvalArgs, eval};
pub use inspect::inspect;
pub use list::list;
