//! Image arithmetic that several plugins share.
//!
//! Each fast kernel here has a slow, obvious twin in its tests.
