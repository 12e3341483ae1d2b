//! Tests over the whole of Tagalong: the conformance suite over the catalog,
//! the shipped configs, and the messages that mistakes in a config get. There
//! is nothing here but `tests/`.
