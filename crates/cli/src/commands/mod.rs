//! Subcommands that answer a question.

mod alter;
mod blur;
mod check;
mod config;
mod copies;
mod eval;
mod export;
mod inspect;
mod install;
mod list;
mod model;
mod networks;
mod shell;

pub use alter::{AlterArgs, alter};
pub use blur::{BlurArgs, blur};
pub use check::check;
pub use config::{config, schema};
pub use eval::{EvalArgs, SimilarityChoice, eval, eval_json};
pub use inspect::inspect;
pub use list::list;
pub use model::{ModelArgs, model};
pub(crate) use networks::is_known_network;
pub use shell::{completions, man};
