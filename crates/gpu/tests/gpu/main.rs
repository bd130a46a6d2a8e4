//! Tests of the device, of construction and of ray tracing. Skipped without an adapter.

mod again;
mod buffers;
mod build;
mod common;
mod device;
mod instanced;
mod kernels;
mod trace;
