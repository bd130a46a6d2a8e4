//! The program as its users meet it: arguments and files in; exit code, streams and files out.
//!
//! Not covered: the look of pictures, speed, the progress bar on a terminal.

mod cast;
mod compare;
mod inputs;
mod options;
mod outputs;
mod random;
mod render;
mod stats;
mod support;
mod tree;
