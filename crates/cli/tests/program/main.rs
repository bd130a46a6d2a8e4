//! Tests of the program: arguments and files in; exit code, streams and files out.
//!
//! Not covered: the appearance of pictures, speed, the progress bar on a terminal.

mod cast;
mod command_line;
mod compare;
#[cfg(unix)]
mod denoise;
mod frames;
mod gpu;
#[cfg(unix)]
mod process;
mod render;
mod samples;
mod scene_file;
#[cfg(target_os = "linux")]
mod slurm;
mod stage;
mod stats;
mod support;
mod tiles;
mod view;
#[cfg(all(feature = "view", target_os = "linux"))]
mod window;
