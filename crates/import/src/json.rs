//! Annotations in JSON.

use std::path::Path;

use serde_json::{Map, Value};
use tagalong_app::outcome::Failure;
use tagalong_config::{FileLimit, read_text};
use tagalong_eval::Region;

/// Reads a file of JSON.
///
/// # Errors
/// A file that cannot be read, or is no JSON, with line and column.
pub fn document(path: &Path) -> Result<Value, Failure> {
    let shown = path.display();
    let text = read_text(path, FileLimit::Table)
        .map_err(|error| Failure::failed(format!("cannot read {shown}: {error}")))?;
    serde_json::from_str(&text).map_err(|error| {
        Failure::failed(format!("{shown}: {error}; is the file whole? fetch it anew"))
    })
}

/// Returns the members of an object.
///
/// # Errors
/// Another kind of value.
pub fn members<'a>(value: &'a Value, path: &Path) -> Result<&'a Map<String, Value>, Failure> {
    let wrong = || {
        let shown = path.display();
        Failure::failed(format!("{shown}: expected an object with one member for each image"))
    };
    value.as_object().ok_or_else(wrong)
}

/// Returns a finite number.
pub fn number(value: Option<&Value>) -> Option<f64> {
    value?.as_f64().filter(|number| number.is_finite())
}

/// Reads a list of left, top, width and height.
///
/// # Errors
/// Another value, or a rectangle without an area; the text tells why.
pub fn rectangle(value: Option<&Value>) -> Result<Region, String> {
    let wrong = || {
        let found = value.map_or("nothing".to_owned(), Value::to_string);
        format!("is {found}, expected [left, top, width, height] in pixels with an area")
    };
    let sides = value.and_then(Value::as_array).ok_or_else(wrong)?;
    let sides: Option<Vec<f64>> = sides.iter().map(|side| number(Some(side))).collect();
    match sides.as_deref() {
        Some(&[x, y, width, height]) if width > 0.0 && height > 0.0 => {
            Ok(Region { x, y, width, height })
        }
        _ => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn only_four_numbers_with_an_area_are_a_rectangle() {
        let region = Region { x: 1.0, y: 2.0, width: 3.0, height: 4.5 };
        assert_eq!(rectangle(Some(&json!([1, 2, 3, 4.5]))), Ok(region));
        for wrong in
            [json!([1, 2, 0, 4]), json!([1, 2, 3]), json!("1 2 3 4"), json!([1, 2, 3, null])]
        {
            assert!(rectangle(Some(&wrong)).unwrap_err().contains("left, top"), "{wrong}");
        }
        assert!(rectangle(None).unwrap_err().contains("is nothing"));
    }
}
