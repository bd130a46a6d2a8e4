use std::fmt;

use canted_obb::PrimId;

/// Why records are not those of a BVH.
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
        /// `line` of nodes, or what leaves are made of.
        unit: &'static str,
        /// The last unit that it would take.
        at: usize,
        /// Units that there are.
        n_units: usize,
    },
    /// Two records that overlap, or one that is reached twice.
    Twice {
        /// `line` of nodes, or what leaves are made of.
        unit: &'static str,
        /// The first unit that both take.
        at: usize,
    },
    /// A unit of an array that belongs to no record.
    Unreached {
        /// `line` of nodes, or what leaves are made of.
        unit: &'static str,
        /// The first such unit.
        at: usize,
    },
    /// A node without children.
    NoChildren {
        /// Its first line.
        line: usize,
    },
    /// More oriented boxes around each primitive than any builder makes: checking them would take too long.
    Nested {
        /// Sum over all oriented boxes of the primitives inside.
        n_inside: u64,
        /// Most that are checked.
        most: u64,
    },
    /// A primitive id out of range.
    Primitive {
        /// The id.
        primitive: PrimId,
        /// Number of primitives.
        n_primitives: usize,
    },
    /// A primitive that no leaf holds.
    Missing {
        /// The first such primitive.
        primitive: PrimId,
    },
    /// Two leaves hold different triangles with one id.
    Different {
        /// The id.
        primitive: PrimId,
    },
    /// A triangle with a vertex that is infinite or NaN, or a primitive whose bounds are empty or not finite.
    NotFinite {
        /// The primitive.
        primitive: PrimId,
    },
    /// An unused lane of a block that is not zero.
    Lane {
        /// The half-block that its leaf starts with.
        block: usize,
    },
    /// A row of a frame that is longer than 1, or not finite.
    Row {
        /// First line of the node; `None` for the frame of the mesh.
        line: Option<usize>,
        /// Its length.
        length: f64,
    },
    /// A child's box that is not the one around the primitives below it.
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
            Self::Word { word } => write!(f, "child word {word:#010x} is no valid reference"),
            Self::Outside { unit, at, n_units } => write!(f, "a record takes {unit} {at} of {n_units}"),
            Self::Twice { unit, at } => write!(f, "{unit} {at} belongs to two records or to one that is reached twice"),
            Self::Unreached { unit, at } => write!(f, "{unit} {at} belongs to no record"),
            Self::NoChildren { line } => write!(f, "the node at line {line} has no children"),
            Self::Nested { n_inside, most } => {
                write!(f, "oriented boxes hold primitives {n_inside} times, more than the {most} that are checked")
            }
            Self::Primitive { primitive, n_primitives } => {
                write!(f, "a leaf names primitive {primitive} of {n_primitives}")
            }
            Self::Missing { primitive } => write!(f, "primitive {primitive} is in no leaf"),
            Self::Different { primitive } => write!(f, "triangle {primitive} has different vertices in two leaves"),
            Self::NotFinite { primitive } => write!(f, "primitive {primitive} is not finite"),
            Self::Lane { block } => write!(f, "an unused lane of the leaf at block {block} is not zero"),
            Self::Row { line: Some(line), length } => {
                write!(f, "a row of the node at line {line} has length {length}, not 1")
            }
            Self::Row { line: None, length } => write!(f, "a row of the mesh frame has length {length}, not 1"),
            Self::Box { line, slot } => {
                write!(f, "box {slot} of the node at line {line} is not that of the primitives below it")
            }
        }
    }
}

impl std::error::Error for Flaw {}
