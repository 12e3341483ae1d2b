use tagalong_config::Registry;

mod model;
mod standing;
mod world;

#[test]
fn it_keeps_the_promises_of_its_kind() {
    let mut registry = Registry::default();
    crate::ekf::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}
