//! Training data for faces: pictures with faces from FDDB, crops of faces from CBCL, and pictures
//! without people.

use std::fs;
use std::io::Read as _;
use std::path::Path;

use flate2::read::GzDecoder;
use tagalong_app::outcome::Failure;
use tagalong_config::{Example, FileLimit, read_text};
use tagalong_core::GreyImage;
use tagalong_geometry::Rect;

use super::photos::{Take, candidate, fingerprint, frame, photos, read};

/// Folders of the data.
pub const FOLDERS: [&str; 4] =
    ["faces/fddb", "faces/cbcl-train", "people/inria-64x128/neg", "negatives"];

/// Side of a face's window, in half widths of the face ...
const SIDE: f64 = 1.7;
/// ... and the distance of its middle below that of the ellipse. So the crops of CBCL show faces,
/// from the brows to the chin.
const BELOW: f64 = 0.2;
/// Length of a block of a tar archive, bytes.
const BLOCK: usize = 512;
/// Most unpacked bytes of the archive.
const MOST_BYTES: u64 = 200_000_000;

/// Passes all faces and pictures of a folder of data, or one in `share`, to `take`.
///
/// # Errors
/// Missing or unreadable files, and errors of `take`.
pub fn visit(data: &Path, share: u64, take: Take<'_>) -> Result<usize, Failure> {
    let mut count = fddb(data, share, take)?;
    count += cbcl(&data.join("faces/cbcl-train.tar.gz"), share, take)?;
    let both = [photos(data, false), photos(data, true)];
    let empty = both.into_iter().flatten().filter(|photo| !photo.is_person());
    // The remainder by 5 marks the held-out groups, so the share is taken from the quotient.
    for photo in empty.filter(|photo| photo.group / 5 % share == 0) {
        photo.visit(0, take)?;
        count += 1;
    }
    Ok(count)
}

/// Passes the pictures of FDDB, with the positions of the faces from its table.
pub fn fddb(data: &Path, share: u64, take: Take<'_>) -> Result<usize, Failure> {
    let table = data.join("faces/fddb.csv");
    let folder = data.join("faces/fddb");
    let text = read_text(&table, FileLimit::Table).map_err(|error| wrong_file(&table, &error))?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let columns = ["file", "major_r", "minor_r", "cx", "cy"]
        .map(|name| names.iter().position(|n| *n == name));
    let mut faces: Vec<(&str, Rect)> = Vec::new();
    for line in lines {
        let words: Vec<&str> = line.split(',').collect();
        let [file, major, minor, x, y] = columns.map(|at| at.and_then(|at| words.get(at)));
        let numbers =
            [major, minor, x, y].map(|word| word.and_then(|word| word.parse::<f64>().ok()));
        let (Some(file), [Some(major), Some(minor), Some(x), Some(y)]) = (file, numbers) else {
            return Err(wrong_file(&table, &format!("cannot read `{line}`")));
        };
        // The ellipse may lie on its side; the smaller radius is the half width.
        let half = major.min(minor);
        let side = SIDE * half;
        let below = BELOW * half;
        let window = Rect::new(x - 0.5 * side, y + below - 0.5 * side, side, side);
        faces.push((file, window));
    }
    let mut count = 0;
    for of_picture in faces.chunk_by(|a, b| a.0 == b.0) {
        let file = of_picture[0].0;
        let group = fingerprint(file);
        if !(group / 5).is_multiple_of(share) {
            continue;
        }
        let frame = frame(read(&folder.join(file))?);
        let example = Example { is_person: true, group };
        of_picture.iter().try_for_each(|(_, window)| take(&frame, &candidate(*window), example))?;
        count += 1;
    }
    Ok(count)
}

/// Returns the failure on a file of the faces.
fn wrong_file(file: &Path, why: &dyn std::fmt::Display) -> Failure {
    Failure::failed(format!("{}: {why}", file.display()))
}

/// Passes the crops of CBCL, of faces and of other objects.
fn cbcl(archive: &Path, share: u64, take: Take<'_>) -> Result<usize, Failure> {
    let file = fs::File::open(archive).map_err(|error| wrong_file(archive, &error))?;
    let mut bytes = Vec::new();
    // A damaged or hostile archive must not fill the memory.
    let unpacked = GzDecoder::new(file).take(MOST_BYTES).read_to_end(&mut bytes);
    unpacked.map_err(|error| wrong_file(archive, &error))?;
    let mut count = 0;
    for (name, content) in members(&bytes) {
        let group = fingerprint(name);
        if !name.ends_with(".png") || !(group / 5).is_multiple_of(share) {
            continue;
        }
        let image = image::load_from_memory(content)
            .map_err(|error| wrong_file(archive, &format!("{name}: {error}")))?
            .into_luma8();
        let width = image.width() as usize;
        let height = image.height() as usize;
        let grey = GreyImage::from_pixels(width, height, image.into_raw()).unwrap_or_default();
        let whole = Rect::new(0.0, 0.0, width as f64, height as f64);
        let example = Example { is_person: !name.contains("non-faces"), group };
        take(&frame(grey), &candidate(whole), example)?;
        count += 1;
    }
    Ok(count)
}

/// Returns the names and contents of the files of a tar archive.
fn members(mut archive: &[u8]) -> Vec<(&str, &[u8])> {
    let mut found = Vec::new();
    while let Some((header, rest)) = archive.split_at_checked(BLOCK) {
        let end = header[..100].iter().position(|byte| *byte == 0).unwrap_or(100);
        let name = std::str::from_utf8(&header[..end]).unwrap_or_default();
        let size = std::str::from_utf8(&header[124..136]).unwrap_or_default();
        let size = usize::from_str_radix(size.trim_matches(['\0', ' ']), 8);
        let (Ok(size), false) = (size, name.is_empty()) else { break };
        let Some(content) = rest.get(..size) else { break };
        found.push((name, content));
        archive = rest.get(size.div_ceil(BLOCK) * BLOCK..).unwrap_or_default();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn member(name: &str, content: &[u8]) -> Vec<u8> {
        let mut block = vec![0; BLOCK];
        block[..name.len()].copy_from_slice(name.as_bytes());
        block[124..136].copy_from_slice(format!("{:011o}\0", content.len()).as_bytes());
        block.extend(content);
        block.resize(BLOCK + content.len().div_ceil(BLOCK) * BLOCK, 0);
        block
    }

    #[test]
    fn an_archive_gives_its_files_and_a_torn_one_those_before_the_tear() {
        let long = vec![7; 700];
        let whole = [member("a/1.png", b"one"), member("b", &long), vec![0; 2 * BLOCK]].concat();
        assert_eq!(members(&whole), [("a/1.png", &b"one"[..]), ("b", &long[..])]);
        assert_eq!(members(&whole[..3 * BLOCK]).len(), 1);
        assert!(members(&[b'x'; 600]).is_empty() && members(&[]).is_empty());
    }
}
