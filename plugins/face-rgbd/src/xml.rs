//! XML files of OpenCV: reads and writes the layout of `opencv_traincascade`, and reads the older
//! one of `opencv_haartraining`.
//!
//! In the newer layout a node is `left right feature` and its threshold; positive numbers refer to
//! other nodes, the others, negated, to leaves, so 0 is leaf 0. In the older one all parts are
//! named elements.

use std::fmt::Write as _;

use roxmltree::{Document, Node as Element, ParsingOptions};
use tagalong_config::check_xml;

use crate::cascade::{Cascade, Feature, Next, Node, Part, Split, Stage, Tree};

/// Amount by which OpenCV lowers the threshold of a file.
const SLACK: f32 = 1e-5;

type XmlResult<T> = Result<T, String>;

impl Cascade {
    /// Parses a file of either layout.
    ///
    /// Text that is not XML, not a cascade, has unknown features, or is inconsistent; the
    /// message is one sentence.
    pub fn from_xml(text: &str) -> XmlResult<Self> {
        check_xml(text)?;
        let options =
            ParsingOptions { allow_dtd: false, nodes_limit: 2_000_000, ..Default::default() };
        let document = Document::parse_with_options(text, options).map_err(|e| e.to_string())?;
        let root = elements(document.root_element())
            .find(|e| child(*e, "stages").is_some())
            .ok_or("it has no `stages`")?;
        let cascade = match child(root, "size") {
            Some(size) => old(root, size)?,
            None => new(root)?,
        };
        cascade.check()?;
        Ok(cascade)
    }

    /// Formats a file in the newer layout.
    pub fn to_xml(&self) -> String {
        let mut out = String::from("<?xml version=\"1.0\"?>\n<opencv_storage>\n");
        // Writing to a string cannot fail.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        fn trees(stage: &Stage) -> usize {
            stage.trees.len()
        }

        let kind = if self.is_normalised() { "HAAR" } else { "LBP" };
        let most = self.stages.iter().map(trees).max().unwrap_or(0);
        let width = self.width;
        let height = self.height;
        writeln!(out, "<cascade type_id=\"opencv-cascade-classifier\">")?;
        writeln!(out, "<stageType>BOOST</stageType><featureType>{kind}</featureType>")?;
        writeln!(out, "<height>{height}</height><width>{width}</width>")?;
        writeln!(out, "<stageParams><maxWeakCount>{most}</maxWeakCount></stageParams>")?;
        let patterns = if self.is_normalised() { 0 } else { 256 };
        writeln!(out, "<featureParams><maxCatCount>{patterns}</maxCatCount></featureParams>")?;
        if let Some((slope, offset)) = self.calibration {
            writeln!(out, "<logOdds>{slope} {offset}</logOdds>")?;
        }
        writeln!(out, "<stageNum>{}</stageNum>\n<stages>", self.stages.len())?;
        for stage in &self.stages {
            writeln!(out, "<_><maxWeakCount>{}</maxWeakCount>", trees(stage))?;
            writeln!(out, "<stageThreshold>{:?}</stageThreshold>", stage.threshold + SLACK)?;
            writeln!(out, "<weakClassifiers>")?;
            stage.trees.iter().try_for_each(|tree| write_tree(tree, out))?;
            writeln!(out, "</weakClassifiers></_>")?;
        }
        writeln!(out, "</stages>\n<features>")?;
        self.features.iter().try_for_each(|feature| write_feature(feature, out))?;
        writeln!(out, "</features>\n</cascade>\n</opencv_storage>")
    }
}

fn write_tree(tree: &Tree, out: &mut String) -> std::fmt::Result {
    write!(out, "<_><internalNodes>")?;
    let mut leaves = Vec::new();
    for node in tree {
        for next in node.next {
            match next {
                Next::Node(to) => write!(out, "{to} ")?,
                Next::Leaf(value) => {
                    write!(out, "{} ", -(leaves.len() as i64))?;
                    leaves.push(value);
                }
            }
        }
        write!(out, "{} ", node.feature)?;
        match node.split {
            Split::Below(value) => write!(out, "{value:?} ")?,
            Split::Among(bits) => bits.iter().try_for_each(|b| write!(out, "{} ", *b as i32))?,
        }
    }
    write!(out, "</internalNodes><leafValues>")?;
    leaves.iter().try_for_each(|leaf| write!(out, "{leaf:?} "))?;
    writeln!(out, "</leafValues></_>")
}

fn write_feature(feature: &Feature, out: &mut String) -> std::fmt::Result {
    fn text(p: &Part) -> String {
        format!("{} {} {} {}", p.x, p.y, p.width, p.height)
    }

    match feature {
        Feature::Binary(part) => writeln!(out, "<_><rect>{}</rect></_>", text(part)),
        Feature::Haar(parts) | Feature::Tilted(parts) => {
            write!(out, "<_><rects>")?;
            parts.iter().try_for_each(|(p, w)| write!(out, "<_>{} {w:?}</_>", text(p)))?;
            let tilted = i32::from(matches!(feature, Feature::Tilted(_)));
            writeln!(out, "</rects><tilted>{tilted}</tilted></_>")
        }
    }
}

/// Parses the layout of `opencv_traincascade`.
fn new(root: Element<'_, '_>) -> XmlResult<Cascade> {
    let features =
        elements(wanted(root, "features")?).map(feature).collect::<XmlResult<Vec<_>>>()?;
    let stages = elements(wanted(root, "stages")?);
    let stages = stages.map(|stage| new_stage(stage, &features)).collect::<XmlResult<Vec<_>>>()?;
    let calibration = match child(root, "logOdds") {
        Some(line) => match numbers::<f64>(line)?[..] {
            [slope, offset] if slope > 0.0 && slope.is_finite() && offset.is_finite() => {
                Some((slope, offset))
            }
            _ => return Err("its `logOdds` is no line".into()),
        },
        None => None,
    };
    let width = number(root, "width")?;
    let height = number(root, "height")?;
    Ok(Cascade { width, height, features, stages, calibration })
}

fn new_stage(stage: Element<'_, '_>, features: &[Feature]) -> XmlResult<Stage> {
    let threshold: f32 = number(stage, "stageThreshold")?;
    let trees = elements(wanted(stage, "weakClassifiers")?);
    let trees = trees.map(|tree| new_tree(tree, features)).collect::<XmlResult<_>>()?;
    Ok(Stage { threshold: threshold - SLACK, trees })
}

fn new_tree(tree: Element<'_, '_>, features: &[Feature]) -> XmlResult<Tree> {
    // Some files have NaN in leaves that no window of the training reached.
    let leaves: Vec<f32> = numbers(wanted(tree, "leafValues")?)?;
    let leaves: Vec<f32> = leaves.into_iter().map(|v| if v.is_nan() { 0.0 } else { v }).collect();
    let words = numbers::<f64>(wanted(tree, "internalNodes")?)?;
    let is_binary = matches!(features.first(), Some(Feature::Binary(_)));
    let length = if is_binary { 11 } else { 4 };
    if words.is_empty() || words.len() % length != 0 {
        return Err("the nodes of one of its trees are incomplete".into());
    }
    let mut tree = Vec::new();
    for words in words.chunks_exact(length) {
        let split = if is_binary {
            let mut bits = [0; 8];
            // OpenCV writes the bits as signed numbers.
            bits.iter_mut().zip(&words[3..]).for_each(|(bits, word)| *bits = *word as i32 as u32);
            Split::Among(bits)
        } else {
            Split::Below(words[3] as f32)
        };
        let next = [new_next(words[0], &leaves)?, new_next(words[1], &leaves)?];
        tree.push(Node { feature: words[2] as usize, split, next });
    }
    Ok(tree)
}

/// Returns what follows a node by its number: a node if it is positive, else a leaf.
fn new_next(word: f64, leaves: &[f32]) -> XmlResult<Next> {
    match word as i64 {
        to @ 1.. => Ok(Next::Node(to as usize)),
        leaf => leaves
            .get(leaf.unsigned_abs() as usize)
            .map(|value| Next::Leaf(*value))
            .ok_or_else(|| format!("one of its trees has no leaf {leaf}")),
    }
}

fn feature(feature: Element<'_, '_>) -> XmlResult<Feature> {
    if let Some(rect) = child(feature, "rect") {
        return Ok(Feature::Binary(part(&numbers::<f64>(rect)?)?));
    }
    let parts = elements(wanted(feature, "rects")?)
        .map(|rect| {
            let words = numbers::<f64>(rect)?;
            let weight = words.get(4).ok_or("a rectangle has no weight")?;
            Ok((part(&words)?, *weight as f32))
        })
        .collect::<XmlResult<Vec<_>>>()?;
    let parts = parts.into_iter().filter(|(_, weight)| *weight != 0.0).collect();
    let tilted = child(feature, "tilted").and_then(|tilted| tilted.text());
    let is_tilted = tilted.is_some_and(|tilted| tilted.trim() == "1");
    Ok(if is_tilted { Feature::Tilted(parts) } else { Feature::Haar(parts) })
}

fn part(words: &[f64]) -> XmlResult<Part> {
    match words {
        [x, y, w, h, ..] if words.iter().take(4).all(|v| (0.0..1e4).contains(v)) => {
            let [x, y, width, height] = [*x, *y, *w, *h].map(|v| v as usize);
            Ok(Part { x, y, width, height })
        }
        _ => Err("one of its rectangles is broken".into()),
    }
}

/// Parses the layout of `opencv_haartraining`.
fn old(root: Element<'_, '_>, size: Element<'_, '_>) -> XmlResult<Cascade> {
    let [width, height] = numbers::<usize>(size)?[..] else {
        return Err("its `size` is not two numbers".into());
    };
    let mut features = Vec::new();
    let mut stages = Vec::new();
    for stage in elements(wanted(root, "stages")?) {
        let threshold: f32 = number(stage, "stage_threshold")?;
        let mut trees = Vec::new();
        for tree in elements(wanted(stage, "trees")?) {
            trees.push(old_tree(tree, &mut features)?);
        }
        stages.push(Stage { trees, threshold: threshold - SLACK });
    }
    Ok(Cascade { width, height, features, stages, calibration: None })
}

/// Reads a tree of the older format, whose nodes have features of their own.
fn old_tree(tree: Element<'_, '_>, features: &mut Vec<Feature>) -> XmlResult<Tree> {
    let mut nodes = Vec::new();
    for node in elements(tree) {
        features.push(feature(wanted(node, "feature")?)?);
        let split = Split::Below(number(node, "threshold")?);
        let next = [old_next(node, "left")?, old_next(node, "right")?];
        nodes.push(Node { feature: features.len() - 1, split, next });
    }
    Ok(nodes)
}

/// Returns what follows a node on one side.
fn old_next(node: Element<'_, '_>, side: &str) -> XmlResult<Next> {
    match child(node, &format!("{side}_node")) {
        Some(to) => Ok(Next::Node(parsed(to)?)),
        None => Ok(Next::Leaf(number(node, &format!("{side}_val"))?)),
    }
}

fn elements<'a, 'i>(of: Element<'a, 'i>) -> impl Iterator<Item = Element<'a, 'i>> {
    of.children().filter(Element::is_element)
}

fn child<'a, 'i>(of: Element<'a, 'i>, name: &str) -> Option<Element<'a, 'i>> {
    elements(of).find(|element| element.has_tag_name(name))
}

fn wanted<'a, 'i>(of: Element<'a, 'i>, name: &str) -> XmlResult<Element<'a, 'i>> {
    child(of, name).ok_or_else(|| format!("a part of it has no `{name}`"))
}

fn number<T: std::str::FromStr>(of: Element<'_, '_>, name: &str) -> XmlResult<T> {
    parsed(wanted(of, name)?)
}

fn parsed<T: std::str::FromStr>(element: Element<'_, '_>) -> XmlResult<T> {
    let text = element.text().unwrap_or_default().trim();
    text.parse().map_err(|_| format!("`{text}` is not a number"))
}

fn numbers<T: std::str::FromStr>(element: Element<'_, '_>) -> XmlResult<Vec<T>> {
    let words = element.text().unwrap_or_default().split_ascii_whitespace();
    // OpenCV writes `.Nan`.
    words
        .map(|word| word.strip_prefix('.').filter(|w| *w == "Nan").unwrap_or(word))
        .map(|word| word.parse().map_err(|_| format!("`{word}` is not a number")))
        .collect()
}
