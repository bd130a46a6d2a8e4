use std::fmt;

use canted_obb::PrimId;

/// What is wrong with the records of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Flaw {
    /// A child word that is neither a leaf, nor a node, nor the word of an empty slot.
    Word {
        /// The word.
        word: u32,
    },
    /// A record that reaches past the end of its array.
    Outside {
        /// `line` for nodes, `block` for leaves.
        unit: &'static str,
        /// The last unit that it would take.
        at: usize,
        /// Units that there are.
        n_units: usize,
    },
    /// Two records that overlap, or one that is reached twice.
    Twice {
        /// `line` for nodes, `block` for leaves.
        unit: &'static str,
        /// The first unit that both take.
        at: usize,
    },
    /// Part of an array that belongs to no record.
    Unreached {
        /// `line` for nodes, `block` for leaves.
        unit: &'static str,
        /// The first such unit.
        at: usize,
    },
    /// A node with nothing below it.
    NoChildren {
        /// Its first line.
        line: usize,
    },
    /// More boxes around each triangle than any builder makes: to check them would take long.
    Nested {
        /// Triangles in all leaning boxes, added up.
        n_inside: u64,
        /// Most that are looked at.
        most: u64,
    },
    /// A primitive number out of range.
    Primitive {
        /// The number.
        primitive: PrimId,
        /// Triangles that there should be.
        n_triangles: usize,
    },
    /// A triangle that no leaf holds.
    Missing {
        /// The first such triangle.
        primitive: PrimId,
    },
    /// Two leaves hold different triangles under one number.
    Different {
        /// The number.
        primitive: PrimId,
    },
    /// A triangle with a vertex that is infinite or not a number.
    NotFinite {
        /// The triangle.
        primitive: PrimId,
    },
    /// An unused lane of a block that is not zero.
    Lane {
        /// The half-block that its leaf starts with.
        block: usize,
    },
    /// A row of a frame that is longer than one, or not finite.
    Row {
        /// First line of the node; `None` for the frame of the whole mesh.
        line: Option<usize>,
        /// Its length.
        length: f64,
    },
    /// A child's box that is not the one around the vertices below it.
    Box {
        /// First line of the node.
        line: usize,
        /// Slot of the child.
        slot: usize,
    },
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Word { word } => write!(f, "child word {word:#010x} names no kind of record"),
            Self::Outside { unit, at, n_units } => write!(f, "a record takes {unit} {at} of {n_units}"),
            Self::Twice { unit, at } => write!(f, "{unit} {at} belongs to two records or to one that is reached twice"),
            Self::Unreached { unit, at } => write!(f, "{unit} {at} belongs to no record"),
            Self::NoChildren { line } => write!(f, "the node at line {line} holds nothing"),
            Self::Nested { n_inside, most } => {
                write!(f, "leaning boxes hold triangles {n_inside} times, more than the {most} that are checked")
            }
            Self::Primitive { primitive, n_triangles } => {
                write!(f, "a leaf names triangle {primitive} of {n_triangles}")
            }
            Self::Missing { primitive } => write!(f, "triangle {primitive} is in no leaf"),
            Self::Different { primitive } => write!(f, "triangle {primitive} has different vertices in two leaves"),
            Self::NotFinite { primitive } => write!(f, "triangle {primitive} has a vertex that is not finite"),
            Self::Lane { block } => write!(f, "an unused lane of the leaf at block {block} is not zero"),
            Self::Row { line: Some(line), length } => {
                write!(f, "a row of the node at line {line} has length {length}, not 1")
            }
            Self::Row { line: None, length } => write!(f, "a row of the mesh's frame has length {length}, not 1"),
            Self::Box { line, slot } => {
                write!(f, "box {slot} of the node at line {line} is not that of the vertices below it")
            }
        }
    }
}

impl std::error::Error for Flaw {}
