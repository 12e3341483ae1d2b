//! List of all plugin crates.
//!
//! No code runs before `main`: a program owns the [`Registry`] that [`registry`] returns, or passes
//! its own to [`register`]. A plugin that is not listed here is unknown to the `tagalong` command,
//! and `cargo xtask tidy` fails on a plugin folder that is not listed. `cargo xtask new-plugin`
//! inserts its line in sorted order.
//!
//! ```
//! use tagalong_config::Kind;
//!
//! let registry = tagalong_catalog::registry();
//! assert_eq!(registry.find("ekf")?.kind, Kind::Filter);
//! assert!(registry.find("ekff").is_err(), "the error names `ekf`");
//! # Ok::<(), tagalong_config::ConfigError>(())
//! ```

use tagalong_config::Registry;

/// Registers every plugin of the workspace.
pub fn register(registry: &mut Registry) {
    tagalong_associators::register(registry);
    tagalong_body_net::register(registry);
    tagalong_color_texture::register(registry);
    tagalong_compressive::register(registry);
    tagalong_controllers::register(registry);
    tagalong_correlation::register(registry);
    tagalong_depth_net::register(registry);
    tagalong_depth_template::register(registry);
    tagalong_face_rgbd::register(registry);
    tagalong_filters::register(registry);
    tagalong_hog_upper_body::register(registry);
    tagalong_joint_particle::register(registry);
    tagalong_laser_legs::register(registry);
    tagalong_omni_appearance::register(registry);
    tagalong_onnx::register(registry);
    tagalong_recorded_detections::register(registry);
    tagalong_svm_patch::register(registry);
    tagalong_track_managers::register(registry);
}

/// Returns a registry with every plugin of the workspace.
pub fn registry() -> Registry {
    let mut registry = Registry::default();
    register(&mut registry);
    registry
}
