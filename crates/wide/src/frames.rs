//! Frames in which subtrees' boxes are small.
