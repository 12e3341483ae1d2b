//! Tests over the whole of Tagalong: the conformance suite over the catalog,
//! the shipped configs on real logs, and the messages that mistakes in a config
//! get.

pub mod people;
