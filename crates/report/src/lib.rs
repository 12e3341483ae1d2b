//! Benchmark results as a self-contained web page, as JSON and as a table.
//!
//! A [`Benchmark`] holds one [`TaskResult`] per pipeline, log and seed. [`html`] renders it as a
//! page that needs no network and works without JavaScript, in light and dark mode and in print;
//! [`json`] and [`csv`] are for programs. [`Summary`] holds the means and their intervals,
//! [`compare`] lists the differences between two pipelines.
//!
//! ```
//! use tagalong_report::{Benchmark, TaskResult, html};
//!
//! let task = TaskResult { pipeline: "<ekf>".into(), log: "lab".into(), ..Default::default() };
//! let benchmark = Benchmark { version: "0.1.0".into(), tasks: vec![task], ..Benchmark::default() };
//! let page = html(&benchmark, None);
//! assert!(page.starts_with("<!DOCTYPE html>") && page.contains("&lt;ekf&gt;"));
//! ```
//!
//! # Why times are kept apart
//!
//! Everything in a [`Benchmark`] follows from configs, logs and seeds, so its files have the same
//! bytes on every machine and in every run. [`Timings`] do not, so they are a separate file, and
//! the page shows them only if the machine was otherwise idle.

mod chart;
mod compare;
mod figures;
mod files;
mod model;
mod page;
mod summary;
mod table;
mod view;

pub use compare::{Difference, SAME_EVENT_S, compare};
pub use files::{csv, figures, json};
pub use model::{
    Benchmark, Dropped, EventRow, MissedPerson, Moment, Outcome, StageTiming, TaskResult,
    TaskTiming, Timings, Trajectory, copies_note,
};
pub use page::{BASE_STYLE, document, html};
pub use summary::{Estimate, PairSummary, PipelineSummary, Summary};
pub use table::{Cell, Row, Table};
