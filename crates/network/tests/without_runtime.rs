//! A build without the runtime: `cargo test -p tagalong-network --no-default-features`.
#![cfg(not(feature = "rten"))]

use std::path::Path;

use tagalong_network::{Choices, Limits, PersonNetwork};

fn refusal(file: &Path) -> String {
    let network = PersonNetwork::load(file, &Choices::default(), &Limits::default());
    network.err().expect("there is no runtime")
}

#[test]
fn a_network_is_refused_with_the_feature_that_it_needs() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models");
    let why = refusal(&models.join("yolox.onnx"));
    assert!(why.contains("`networks`") && why.contains("`rten`"), "{why}");
    // A file that is no network says so first: no other build would take it either.
    let damaged = refusal(&models.join("../make_models.py"));
    assert!(!damaged.contains("`networks`"), "{damaged}");
}
