use tagalong_app::outcome::Failure;
use tagalong_app::serialize::to_toml;
use tagalong_learn::{Example, isotonic, logistic};
use tagalong_pipeline::{Differences, LooksSettings};

use super::Followed;
use super::table::uncalibrated;

/// Number of steps of the calibration.
const STEPS: usize = 20;
/// Ridge penalty on the squared weights, as strong as one example.
const RIDGE: f64 = 1.0;
/// Minimum weight that is used as a divisor.
const LEAST: f64 = 1e-3;
/// Number of features: a weight and an offset for each of torso, legs, texture, embedding and
/// height, and a weight for the rivals.
const FEATURES: usize = 11;

/// Fits the settings of the target lock's probabilities to the true identities.
pub fn looks(results: &[Followed]) -> LooksSettings {
    fn known(weight: f64, offset: f64, usual: [f64; 2]) -> [f64; 2] {
        if weight == 0.0 && offset == 0.0 { usual } else { term(weight, offset) }
    }

    let sightings = results.iter().flat_map(|followed| &followed.ridden.likeness);
    let examples: Vec<Example<FEATURES>> = sightings
        .map(|(like, same)| Example {
            features: features(&like.differences),
            target: f64::from(u8::from(*same)),
            weight: 1.0,
        })
        .collect();
    let [
        torso,
        torso_0,
        legs,
        legs_0,
        texture,
        texture_0,
        vector,
        vector_0,
        height,
        height_0,
        rivals,
    ] = logistic(&examples, RIDGE);
    // Colours have no weight if a network describes people, and vice versa: such a term keeps its
    // default.
    let usual = LooksSettings::default();
    LooksSettings {
        torso: known(torso, torso_0, usual.torso),
        legs: known(legs, legs_0, usual.legs),
        texture: known(texture, texture_0, usual.texture),
        vector: known(vector, vector_0, usual.vector),
        height: term(height, height_0),
        rivals: rounded(rivals),
        // The old calibration does not apply to these weights, which the rides did not use.
        calibration: Vec::new(),
    }
}

/// Fits the calibration of the target lock's probabilities, with the weights that the rides used,
/// to the true identities.
pub fn calibration(results: &[Followed]) -> Vec<[f64; 2]> {
    let sightings = results.iter().flat_map(|followed| &followed.ridden.likeness);
    let stated: Vec<(f64, bool)> =
        sightings.map(|(like, same)| (uncalibrated(like), *same)).collect();
    isotonic(&stated, STEPS).into_iter().map(|pair| pair.map(rounded)).collect()
}

/// Returns the features of an example; an unknown difference has no weight and no offset.
fn features(differences: &Differences) -> [f64; FEATURES] {
    let Differences { torso, legs, texture, vector, .. } = *differences;
    let [torso, legs, texture, vector] = [torso, legs, texture, vector]
        .map(|difference| difference.map_or([0.0; 2], |difference| [-difference, 1.0]));
    let height = [-differences.height_m, 1.0];
    let rivals = differences.rivals.unwrap_or(0.0);
    let mut all = [rivals; FEATURES];
    all[..FEATURES - 1].copy_from_slice([torso, legs, texture, vector, height].as_flattened());
    all
}

/// Converts `offset - weight * difference` to `weight * (even - difference)`.
fn term(weight: f64, offset: f64) -> [f64; 2] {
    // Keeps the quotient finite if the fit finds no evidence.
    let weight = if weight.abs() < LEAST { LEAST } else { weight };
    [rounded(offset / weight), rounded(weight)]
}

fn rounded(value: f64) -> f64 {
    (1e3 * value).round() / 1e3
}

/// Returns the settings as TOML for a config.
pub fn toml(looks: &LooksSettings, calibration: &[[f64; 2]]) -> Result<String, Failure> {
    let body = to_toml("the settings [target.looks]", looks)?;
    Ok(format!(
        "\n# Fitted to these rides:\n[target.looks]\n{body}\n# The calibration that fits these rides \
         with the weights that they had:\n# calibration = {calibration:?}\n"
    ))
}

#[cfg(test)]
mod tests {
    use tagalong_core::TrackId;
    use tagalong_pipeline::Likeness;
    use tagalong_trials::Ridden;

    use super::*;

    fn followed(likeness: Vec<(Likeness, bool)>) -> Followed {
        let ridden = Ridden { likeness, ..Ridden::default() };
        let suite = "scene".into();
        let pipeline = "config".into();
        Followed { suite, pipeline, ridden, ..Followed::default() }
    }

    /// The odds that a track is the person depend on the upper body alone, and in every fourth
    /// example it is not visible.
    #[test]
    fn what_tells_people_apart_gets_the_weight() {
        let mut likeness = Vec::new();
        for k in 0..400_u32 {
            let torso = (k % 4 > 0).then_some(f64::from(k % 20) / 40.0);
            let odds = torso.map_or(0.0, |d| 10.0 * (0.25 - d));
            let differences = Differences {
                torso,
                legs: Some(f64::from(k % 7) / 10.0),
                texture: None,
                vector: None,
                height_m: 0.02 * f64::from(k % 3),
                rivals: None,
            };
            let people = (20.0 / (1.0 + (-odds).exp())).round() as usize;
            let like = Likeness { track: TrackId(1), probability: 0.5, log_odds: 0.0, differences };
            likeness.extend((0..20).map(|n| (like, n < people)));
        }
        let found = looks(&[followed(likeness)]);
        let [even, weight] = found.torso;
        assert!((even - 0.25).abs() < 0.03 && (weight - 10.0).abs() < 0.5, "{found:?}");
        assert!(found.legs[1].abs() < 0.3 && found.rivals == 0.0, "{found:?}");
        let usual = LooksSettings::default();
        assert_eq!((found.texture, found.vector), (usual.texture, usual.vector), "never visible");
        let text = toml(&found, &[[0.25, 0.5]]).unwrap();
        assert!(text.contains("# calibration = [[0.25, 0.5]]"), "{text}");
        let read: toml::Table = toml::from_str(&text).unwrap();
        assert!(read["target"]["looks"]["torso"].is_array(), "{text}");
    }

    /// Sightings with log-odds of 2 are the person in every other case, whatever was reported.
    #[test]
    fn the_calibration_is_of_the_log_odds() {
        let differences = Differences {
            torso: None,
            legs: None,
            texture: None,
            vector: None,
            height_m: 0.0,
            rivals: None,
        };
        let like = Likeness { track: TrackId(1), probability: 0.1, log_odds: 2.0, differences };
        let pairs = calibration(&[followed((0..10).map(|k| (like, k % 2 == 0)).collect())]);
        assert_eq!(pairs, [[0.881, 0.5]]);
    }
}
