//! Parts of a cascade of classifiers.

/// A rectangle of a window, in its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Left edge.
    pub x: usize,
    /// Upper edge.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Feature of a window in the question of a node.
#[derive(Clone, Debug, PartialEq)]
pub enum Feature {
    /// Two or three rectangles and their weights: the weighted sum of their grey values, divided by
    /// the contrast of the window (Viola and Jones 2001).
    Haar(Vec<(Part, f32)>),
    /// The same with rectangles turned by 45 degrees: from the upper corner at (x, y), `width`
    /// pixels down to the right and `height` down to the left (Lienhart and Maydt 2002).
    Tilted(Vec<(Part, f32)>),
    /// Comparison of eight neighbours with the block between them, all of the same size: a bit is
    /// set if the neighbour is at least as bright; from the upper left clockwise, highest bit
    /// first. The part is the upper left block.
    Binary(Part),
}

/// Question of a node: yes is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Split {
    /// True if the value of the feature is below this.
    Below(f32),
    /// True if the pattern of bits is one of these; one bit for each of 256.
    Among([u32; 8]),
}

/// Target of a node's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Another node of the tree.
    Node(usize),
    /// A leaf, with the value to add to the sum of the stage.
    Leaf(f32),
}

/// A node of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Index of the feature.
    pub feature: usize,
    /// Question about the feature.
    pub split: Split,
    /// Targets if yes, if no.
    pub next: [Next; 2],
}

/// A small decision tree; the first node is its root.
pub type Tree = Vec<Node>;

/// Trees with a sum that a window has to reach.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Least sum.
    pub threshold: f32,
    /// The trees.
    pub trees: Vec<Tree>,
}

/// Stages that a window has to pass, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Cascade {
    /// Columns of a window.
    pub width: usize,
    /// Rows of a window.
    pub height: usize,
    /// Features of the nodes.
    pub features: Vec<Feature>,
    /// The stages.
    pub stages: Vec<Stage>,
    /// Log-odds that a group of windows is a face, as a straight line in the logarithm of its
    /// strength: slope and offset. Files of OpenCV have none.
    pub calibration: Option<(f64, f64)>,
}

impl Cascade {
    /// Creates a cascade that accepts all windows, of `side` pixels.
    pub fn without_stages(side: usize) -> Self {
        let features = Vec::new();
        let stages = Vec::new();
        Self { width: side, height: side, features, stages, calibration: None }
    }

    /// Returns true if windows are normalised by their contrast.
    pub fn is_normalised(&self) -> bool {
        self.features.iter().any(|feature| !matches!(feature, Feature::Binary(_)))
    }

    /// Returns true if some features are tilted.
    pub fn is_tilted(&self) -> bool {
        self.features.iter().any(|feature| matches!(feature, Feature::Tilted(_)))
    }

    /// Returns the part of a window in which the contrast is measured: all but a border of a pixel.
    pub fn middle(&self) -> Part {
        Part { x: 1, y: 1, width: self.width - 2, height: self.height - 2 }
    }

    /// Whether a part, so many times as wide and high, lies in the window.
    fn holds_part(&self, part: &Part, times: usize) -> bool {
        let right = part.width.checked_mul(times).and_then(|w| w.checked_add(part.x));
        let bottom = part.height.checked_mul(times).and_then(|h| h.checked_add(part.y));
        right.is_some_and(|x| x <= self.width) && bottom.is_some_and(|y| y <= self.height)
    }

    /// Whether a turned part lies in the window.
    fn holds_tilted(&self, part: &Part) -> bool {
        let down = part.width.checked_add(part.height);
        let right = part.x.checked_add(part.width);
        let bottom = down.map(|down| down + part.y);
        let is_inside = right.is_some_and(|x| x <= self.width) && part.x >= part.height;
        is_inside && bottom.is_some_and(|y| y <= self.height)
    }

    /// Whether a feature can be computed in the window.
    fn holds_feature(&self, feature: &Feature) -> bool {
        match feature {
            Feature::Haar(parts) | Feature::Tilted(parts) => {
                let is_tilted = matches!(feature, Feature::Tilted(_));
                let mut each = parts.iter();
                (2..=3).contains(&parts.len())
                    && each.all(|(part, weight)| {
                        let is_held = if is_tilted {
                            self.holds_tilted(part)
                        } else {
                            self.holds_part(part, 1)
                        };
                        is_held && weight.is_finite()
                    })
            }
            Feature::Binary(part) => self.holds_part(part, 3),
        }
    }

    /// Checks that a cascade can be run: parts inside the window, known features, finite trees.
    ///
    /// # Errors
    /// The first fault, as one sentence.
    pub fn check(&self) -> Result<(), String> {
        if !(8..=256).contains(&self.width) || !(8..=256).contains(&self.height) {
            return Err(format!("its windows are {} x {} pixels", self.width, self.height));
        }
        if self.stages.is_empty() {
            return Err("it has no stages".into());
        }
        if let Some(bad) = self.features.iter().position(|feature| !self.holds_feature(feature)) {
            return Err(format!("its feature {bad} does not lie in the window"));
        }
        let trees = self.stages.iter().flat_map(|stage| &stage.trees);
        if trees.clone().any(Vec::is_empty) {
            return Err("one of its trees is empty".into());
        }
        match trees.flat_map(|tree| tree.iter().enumerate().map(move |n| (n, tree.len()))).find(
            |((at, node), nodes)| {
                !node.next.iter().all(|next| match next {
                    // A target behind its node cannot form a loop.
                    Next::Node(to) => to > at && to < nodes,
                    Next::Leaf(value) => value.is_finite(),
                }) || !self.is_asked(node)
            },
        ) {
            Some(_) => Err("one of its trees is broken".into()),
            None => Ok(()),
        }
    }

    /// Returns true if the question of a node is one for its kind of feature.
    fn is_asked(&self, node: &Node) -> bool {
        match (self.features.get(node.feature), node.split) {
            (Some(Feature::Haar(_) | Feature::Tilted(_)), Split::Below(value)) => value.is_finite(),
            (Some(Feature::Binary(_)), Split::Among(_)) => true,
            _ => false,
        }
    }
}
