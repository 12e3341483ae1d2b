//! Tests of the filter against references, and of each setting by its effect.

mod flags;
mod reference;
pub(crate) mod rig;

#[test]
fn the_filter_conforms() {
    tagalong_conformance::assert_conforms(crate::register);
}
