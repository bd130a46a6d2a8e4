//! Tests of the program: arguments and files in; exit code, streams and files out.
//!
//! Not covered: the appearance of pictures, speed, the progress bar on a terminal.

mod cast;
mod checkpoint;
mod command_line;
mod compare;
#[cfg(unix)]
mod denoise;
mod devices;
mod environment;
mod first_picture;
mod frames;
mod gpu;
mod inputs;
#[cfg(unix)]
mod interrupted;
#[cfg(target_os = "linux")]
mod memory;
mod noise;
mod options;
mod outputs;
mod random;
mod render;
mod samples;
mod scene_file;
#[cfg(target_os = "linux")]
mod slurm;
mod stats;
mod support;
mod tree;
mod view;
#[cfg(all(feature = "view", target_os = "linux"))]
mod window;
