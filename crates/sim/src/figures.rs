//! Version of the output of the simulator for a scene and a seed.

/// Version of simulated figures: tables that were printed with another version are stale. It
/// increases with each change of images, paths or odometry, which the test below detects.
pub const FIGURES_VERSION: u32 = 1;

#[cfg(test)]
mod tests {
    use tagalong_math::fingerprint;

    use super::*;
    use crate::{Event, Scene, Simulation};

    const SCENE: &str = "
duration_s = 2.0
crowd = 1
[room]
clutter = 3
[camera]
width = 80
height = 60
[robot]
path = [[3.0, 3.0]]
[[people]]
path = [[4.0, 3.0], [5.0, 4.0]]
";

    /// Returns the fingerprint of all images and readings of the wheels.
    fn simulated() -> u64 {
        let scene = Scene::parse(SCENE).unwrap();
        let mut simulation = Simulation::new(&scene, 1);
        let mut bytes = Vec::new();
        while let Some(event) = simulation.next_event() {
            match event {
                Event::Shot(shot) => {
                    let depth = shot.images.depth.unwrap();
                    bytes.extend(depth.pixels().iter().flat_map(|m| m.to_le_bytes()));
                    bytes.extend_from_slice(shot.images.colour.unwrap().pixels().as_flattened());
                }
                other => bytes.extend_from_slice(format!("{other:?}").as_bytes()),
            }
        }
        fingerprint(bytes)
    }

    #[test]
    fn another_simulation_has_another_version() {
        assert_eq!(
            (FIGURES_VERSION, simulated()),
            (1, 17_699_169_820_901_213_870),
            "the simulator gives something else: count FIGURES_VERSION up and pin both here"
        );
    }
}
