//! Removal of remedies that would change nothing, because the config already has these settings.

use tagalong_app::remedies::number;
use toml::{Table, Value};

/// Words that introduce a setting, and are removed with it.
const LEADS: &[&str] = &["; else", "; until then", BY_EVIDENCE, ", or", "; or", "else", "or"];

/// Words before the setting of a track manager.
pub const BY_EVIDENCE: &str = "; where they are things, believe tracks by evidence:";

/// Removes the lines of a remedy whose settings a resolved config already has, or the plugin of a
/// section does not know. Returns `None` if nothing is left.
pub fn differing(remedy: &str, resolved: &Table) -> Option<String> {
    let (mut kept, mut section, mut pending): (Vec<&str>, &str, Option<&str>) = (vec![], "", None);
    for line in remedy.lines() {
        let (named, setting) = split(line);
        if let Some(name) = named {
            section = name;
            if setting.is_empty() {
                pending = Some(line);
                continue;
            }
        }
        if is_vain(section, setting, resolved) {
            continue;
        }
        kept.extend(pending.take());
        kept.push(line);
    }
    let mut text = kept.join("\n");
    let had_settings = remedy.lines().any(|line| split(line).0.is_some());
    let has_settings = kept.iter().any(|line| split(line).0.is_some());
    if had_settings && !has_settings {
        let lead = LEADS.iter().find_map(|lead| text.strip_suffix(lead));
        text = lead.unwrap_or(&text).trim_end_matches([':', ' ', '\n']).to_owned();
    }
    (!text.is_empty()).then_some(text)
}

/// Splits `[section] key = value` into the name of the section, if there is one, and the rest.
fn split(line: &str) -> (Option<&str>, &str) {
    let inner = line.strip_prefix('[').filter(|inner| !inner.starts_with('['));
    match inner.and_then(|inner| inner.split_once(']')) {
        Some((name, rest)) => (Some(name), rest.trim()),
        None => (None, line),
    }
}

/// Returns true if a setting already has its value, or does not exist.
fn is_vain(section: &str, setting: &str, resolved: &Table) -> bool {
    let Some((key, value)) = setting.split_once(" = ").filter(|_| !section.is_empty()) else {
        return false;
    };
    let mut inner = Some(resolved);
    for part in section.split('.') {
        inner = inner.and_then(|table| table.get(part)).and_then(Value::as_table);
    }
    let is_of_plugin = section.ends_with(".config");
    let Some(now) = inner.and_then(|table| table.get(key)) else {
        return is_of_plugin && inner.is_some();
    };
    let literal = value.split('#').next().unwrap_or(value).trim();
    let parsed: Option<Value> =
        toml::from_str::<Table>(&format!("v = {literal}")).ok().and_then(|mut t| t.remove("v"));
    parsed.is_some_and(|value| is_equal(&value, now, digits(literal)))
}

/// Returns the number of digits behind the point.
fn digits(literal: &str) -> i32 {
    literal.split_once('.').map_or(0, |(_, digits)| digits.len() as i32)
}

/// Compares numbers to the printed digits, and other values exactly.
fn is_equal(value: &Value, now: &Value, digits: i32) -> bool {
    match (number(value), number(now)) {
        (Some(a), Some(b)) => (a - b).abs() <= 0.5 * 10f64.powi(-digits) * (1.0 - 1e-6),
        _ => value == now,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved() -> Table {
        toml::from_str(
            "[associator.config]\ngate_m = 1.7\n[manager.config]\nconfirm_hits = 2\n\
             [input]\ndepth_offset_px = [3, -2]\n[input.camera]\nheight_m = 1.091\n",
        )
        .unwrap()
    }

    #[test]
    fn a_remedy_that_is_in_place_is_not_told() {
        let remedy = "record 5 images a second or more; else\n[associator.config] gate_m = 1.7\n\
                      [manager.config] confirm_hits = 2";
        let left = differing(remedy, &resolved()).unwrap();
        assert_eq!(left, "record 5 images a second or more");
        let left = differing(&remedy.replace("gate_m = 1.7", "gate_m = 1.9"), &resolved()).unwrap();
        assert_eq!(
            left,
            "record 5 images a second or more; else\n[associator.config] gate_m = 1.9"
        );
        assert_eq!(differing("[input] depth_offset_px = [3, -2]", &resolved()), None);
        assert!(differing("[input] depth_offset_px = [4, -2]", &resolved()).is_some());
    }

    #[test]
    fn the_words_before_a_setting_go_with_it() {
        let resolved: Table = toml::from_str("[manager]\nplugin = 'manage-sprt'\n").unwrap();
        let remedy =
            format!("look at the pictures{BY_EVIDENCE}\n[manager] plugin = \"manage-sprt\"");
        assert_eq!(differing(&remedy, &resolved).unwrap(), "look at the pictures");
        assert_eq!(differing(&remedy, &Table::new()), Some(remedy));
    }

    #[test]
    fn settings_below_a_section_are_looked_at_one_by_one() {
        let remedy = "give the pose:\n[input.camera]\nheight_m = 1.09\npitch_down_deg = 2.0";
        let left = differing(remedy, &resolved()).unwrap();
        assert_eq!(left, "give the pose:\n[input.camera]\npitch_down_deg = 2.0");
        let left = differing("give the pose:\n[input.camera]\nheight_m = 1.09", &resolved());
        assert_eq!(left.unwrap(), "give the pose");
    }

    #[test]
    fn settings_that_the_plugin_lacks_are_not_told_and_unknown_inputs_are() {
        assert_eq!(differing("[manager.config] no_such = 3", &resolved()), None);
        let topic = "[input] depth_topic = \"...\"";
        assert_eq!(differing(topic, &resolved()).unwrap(), topic);
        assert_eq!(differing("look at the pictures", &resolved()).unwrap(), "look at the pictures");
    }
}
