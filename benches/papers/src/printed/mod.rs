//! Plugins of the equations as the papers print them, misprints included. Each is registered beside
//! the plugins of the workspace, as one of a crate outside of it would be.
//!
//! A switch of a plugin corrects one misprint, so that the tables can tell what each of them costs.

mod arc_follow;
mod compressive;
mod depth_template;
mod dissimilarity;
mod ekf;
mod floor_kalman;
mod hungarian;
mod image_kalman;
mod joint_particle;
pub(crate) mod omni_appearance;
mod scene_likelihood;

use tagalong_config::Registry;

/// Registers the plugins of the printed equations.
pub fn register(registry: &mut Registry) {
    arc_follow::register(registry);
    compressive::register(registry);
    depth_template::register(registry);
    ekf::register(registry);
    floor_kalman::register(registry);
    hungarian::register(registry);
    image_kalman::register(registry);
    joint_particle::register(registry);
    omni_appearance::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The suite finds the two misprints by which a standing person walks, and nothing else.
    #[test]
    fn the_plugins_keep_the_promises_of_their_kinds_but_for_the_misprints() {
        let mut registry = Registry::default();
        register(&mut registry);
        let failures = tagalong_conformance::check_all(&registry);
        let found: Vec<(String, String)> =
            failures.iter().map(|f| (f.plugin.clone(), f.check.to_owned())).collect();
        let expected = ["ekf-as-printed", "image-kalman-as-printed"].map(|plugin| {
            (plugin.to_owned(), "a standing person stands still in the world".to_owned())
        });
        assert_eq!(found, expected, "{failures:#?}");
    }
}
