//! Tests of the filter against references, and of each setting by its effect.

mod flags;
mod reference;
pub(crate) mod rig;

#[test]
fn the_filter_conforms() {
    let mut registry = tagalong_config::Registry::default();
    crate::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}
