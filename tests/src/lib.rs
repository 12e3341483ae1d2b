//! Tests of the whole of Tagalong: the conformance suite over the catalog, the shipped configs on
//! real logs, and the messages for errors in a config.

pub mod people;
