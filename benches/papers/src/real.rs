//! Annotated logs of real rooms as trials: the same frames for every verifier, with the depth of
//! the log.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry2, Isometry3, Point3};
use tagalong_core::Frame;
use tagalong_eval::formats::people::{self, Row as Annotated};
use tagalong_geometry::{HEAD_RADIUS_M, Rect};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_pipeline::Pipeline;
use tagalong_sim::Truth;
use tagalong_trials::{Contender, Moment, Run, Trial};

use crate::lab::{Lab, ReproduceError, read};
use crate::variant::parsed;

/// Logs in which no shipped verifier was trained, ...
pub(crate) const NOT_TRAINED_ON: [&str; 3] = ["corredor1-camera1", "lab2-camera1", "lab2-camera2"];
/// ... and those in which some were.
pub(crate) const TRAINED_ON: [&str; 2] = ["filinha", "um"];
/// Config of the detector for depth images of real rooms.
const DETECTS: &str = "depth-ekf";
/// Keys of a config for the verifiers and the track manager, which depends on them.
const OF_VERIFIERS: [&str; 2] = ["verifiers", "manager"];

/// Returns the detector of `depth-ekf` with the verifiers of another config, or without any.
///
/// # Errors
/// A config that cannot be read.
pub(crate) fn contender(
    lab: &Lab,
    name: &str,
    verifiers: Option<&str>,
) -> Result<Contender, ReproduceError> {
    let plain = lab.contender(DETECTS)?;
    let Some(of) = verifiers else { return Ok(Contender { name: name.into(), ..plain }) };
    let mut config = parsed(&plain)?;
    let mut with = parsed(&lab.contender(of)?)?;
    config.extend(OF_VERIFIERS.iter().filter_map(|key| with.remove_entry(*key)));
    Ok(Contender { name: name.into(), config: config.to_string(), ..plain })
}

/// Runs the contenders on an annotated log; returns `None` if there is no such log.
///
/// # Errors
/// A log or annotations that cannot be used, and a plugin that fails.
pub(crate) fn trial(
    lab: &Lab,
    log: &str,
    contenders: &[Contender],
) -> Result<Option<Trial>, ReproduceError> {
    fn run(of: &Contender) -> Run {
        Run { pipeline: of.name.clone(), reports: vec![], worked_ms: 0.0 }
    }

    let Some(folder) = lab.data.as_ref().map(|data| data.join("logs")) else { return Ok(None) };
    let Some(people) = people(&folder, log)? else { return Ok(None) };
    let path = folder.join(log);
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Depth);
    let path = path.with_extension("mcap");
    let source = FrameSource::open(&path, &InputSettings::default(), &Limits::default(), inputs);
    let mut source = source.map_err(|error| ReproduceError::of(log, error))?;
    let pipelines = contenders.iter().map(|contender| contender.pipeline(lab.registry, 1));
    let mut pipelines = pipelines.collect::<Result<Vec<Pipeline>, _>>()?;
    let mut runs: Vec<Run> = contenders.iter().map(run).collect();
    let mut moments = Vec::new();
    let mut camera = None;
    while let Some(item) = source.next_frame() {
        for (pipeline, run) in pipelines.iter_mut().zip(&mut runs) {
            run.reports
                .push(pipeline.step(&item.frame).map_err(|error| ReproduceError::of(log, error))?);
        }
        let known = people.get(&item.frame.index).map_or(&[][..], Vec::as_slice);
        moments.push(moment(&item.frame, known));
        camera = Some((*item.frame.camera).clone());
    }
    // An empty log has no camera, and is no trial.
    Ok(camera.map(|camera| Trial { seed: 0, camera, furniture: Vec::new(), moments, runs }))
}

/// Returns the annotated people of a log, by the number of the frame; `None` if there is no such log.
///
/// # Errors
/// Annotations that cannot be read.
pub(crate) fn people(
    folder: &Path,
    log: &str,
) -> Result<Option<BTreeMap<u64, Vec<Annotated>>>, ReproduceError> {
    let truth = folder.join(log).with_extension("people.csv");
    if !truth.exists() {
        return Ok(None);
    }
    let rows = people::parse(&read(&truth)?, &truth.display().to_string());
    let rows = rows.map_err(|error| ReproduceError::of(log, error))?;
    let mut people: BTreeMap<u64, Vec<Annotated>> = BTreeMap::new();
    rows.into_iter().for_each(|row| people.entry(u64::from(row.frame)).or_default().push(row));
    Ok(Some(people))
}

/// Returns the annotations of a frame. The poses of the robot are not used.
fn moment(frame: &Frame, known: &[Annotated]) -> Moment {
    let pose = &frame.camera.robot_from_camera;
    Moment {
        stamp: frame.stamp,
        truth: known.iter().filter_map(|row| annotated(row, pose)).collect(),
        odom_from_robot: Isometry2::identity(),
        world_from_robot: Isometry2::identity(),
    }
}

/// Converts an annotation; heads are annotated at their surface. `None` without a place.
pub(crate) fn annotated(row: &Annotated, robot_from_camera: &Isometry3<f64>) -> Option<Truth> {
    fn rect(r: &tagalong_eval::Region) -> Rect {
        Rect::new(r.x, r.y, r.width, r.height)
    }

    let surface = Point3::from(row.head_in_camera_m?);
    let ray = surface.coords.try_normalize(1e-6).unwrap_or_default();
    let head = robot_from_camera * (surface + ray * HEAD_RADIUS_M);
    Some(Truth {
        id: u16::try_from(row.id).unwrap_or(u16::MAX),
        head_in_robot: head,
        torso_in_robot: head,
        upper_body: row.upper_body.as_ref().map(rect),
        visible: row.visible_body.as_ref().map(rect),
        visible_fraction: row.visible,
        occluder: None,
        ignore: row.ignore,
        joints: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn a_head_is_annotated_at_its_surface_and_known_by_its_centre() {
        let row = Annotated {
            frame: 1,
            id: 3,
            upper_body: Some(tagalong_eval::Region::new(10.0, 20.0, 30.0, 40.0)),
            visible_body: None,
            head_in_camera_m: Some([0.0, 0.0, 2.0]),
            key: true,
            visible: 0.5,
            occluder: "0".into(),
            ignore: true,
            interpolated: 0,
            proposed: String::new(),
        };
        // The camera looks along the robot's X from 1 m above the floor.
        let forward = Vector3::new(0.0, -1.0, 0.0);
        let turn =
            nalgebra::Rotation3::from_basis_unchecked(&[forward, -Vector3::z(), Vector3::x()]);
        let turn = UnitQuaternion::from_rotation_matrix(&turn);
        let pose = Isometry3::from_parts(Translation3::new(0.1, 0.0, 1.0), turn);
        let found = annotated(&row, &pose).unwrap();
        let expected = Point3::new(2.1 + HEAD_RADIUS_M, 0.0, 1.0);
        assert!((found.head_in_robot - expected).norm() < 1e-9, "{}", found.head_in_robot);
        assert!(found.ignore && found.id == 3);
        assert_eq!(found.upper_body, Some(Rect::new(10.0, 20.0, 30.0, 40.0)));
    }
}
