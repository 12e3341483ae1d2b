//! Prints the embeddings that a re-identification network computes for boxes of an image, as JSON:
//!
//! ```sh
//! cargo run --example vectors -- NETWORK.onnx IMAGE.ppm CONVENTION X,Y,WIDTH,HEIGHT ...
//! ```
//!
//! The image is a binary PPM (P6) without comments. `CONVENTION` is `osnet`, `omz`, or `auto`.
//! `tests/clients/check_networks.sh` compares the embeddings with those of onnxruntime.
#![allow(clippy::print_stdout, reason = "a program of a command line")]

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

use tagalong_core::RgbImage;
use tagalong_geometry::Rect;
use tagalong_network::{Convention, EmbeddingNetwork, Limits};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [network, image, convention, boxes @ ..] = &arguments[..] else {
        return Err("expected NETWORK.onnx IMAGE.ppm CONVENTION and boxes".into());
    };
    let convention = match convention.as_str() {
        "auto" => None,
        "osnet" => Some(Convention::OsNet),
        "omz" => Some(Convention::Omz),
        other => return Err(format!("`{other}` is neither `osnet`, `omz` nor `auto`").into()),
    };
    let bytes = fs::read(image).map_err(|error| format!("{image}: {error}"))?;
    let picture = picture(&bytes).ok_or_else(|| format!("{image} is no binary PPM of 8 bits"))?;
    let mut network = EmbeddingNetwork::load(Path::new(network), convention, &Limits::default())?;
    let mut vectors = Vec::new();
    for text in boxes {
        let person = rect(text).ok_or_else(|| format!("`{text}` is no box X,Y,WIDTH,HEIGHT"))?;
        let vector = network.embed(&picture, &person)?;
        vectors.push(vector.ok_or_else(|| format!("the box {text} has no vector in time"))?);
    }
    let convention = network.convention().name();
    println!("{}", serde_json::json!({ "convention": convention, "vectors": vectors }));
    Ok(())
}

fn rect(text: &str) -> Option<Rect> {
    let numbers: Vec<f64> = text.split(',').filter_map(|number| number.parse().ok()).collect();
    let [x, y, width, height] = numbers[..] else { return None };
    Some(Rect::new(x, y, width, height))
}

/// Reads a binary PPM of 8 bits without comments.
fn picture(bytes: &[u8]) -> Option<RgbImage> {
    let mut rest = bytes.strip_prefix(b"P6")?;
    let mut header = [0_usize; 3];
    for number in &mut header {
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let (_, from) = rest.split_at(start);
        let end = from.iter().position(u8::is_ascii_whitespace)?;
        *number = std::str::from_utf8(&from[..end]).ok()?.parse().ok()?;
        rest = &from[end..];
    }
    let [width, height, 255] = header else { return None };
    // One space ends the header.
    let (pixels, _) = rest.get(1..)?.as_chunks::<3>();
    RgbImage::from_pixels(width, height, pixels.to_vec())
}
