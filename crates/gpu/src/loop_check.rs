//! Detection of drivers that end loops early.

use canted_shaders::Specialisation;

use crate::{Gpu, GpuError};

/// The number for [`LONG_LOOP`], which is counted once per device.
pub(crate) fn longest_loop(gpu: &Gpu) -> Result<u32, GpuError> {
    if let Some(&counted) = gpu.longest_loop.get() {
        return Ok(counted);
    }
    let counted = loop_iterations(gpu, LONG_LOOP)?;
    Ok(*gpu.longest_loop.get_or_init(|| counted))
}

/// Iterations requested to detect drivers that end loops early.
pub(crate) const LONG_LOOP: u32 = 100_000;

/// Number of iterations that a loop of `wanted` iterations actually runs on this device.
///
/// Some software drivers end loops early without an error: Mesa's llvmpipe before version 23 ends them after 65,535 iterations,
/// summed over all loops of an invocation.
///
/// # Errors
/// The device is lost or does not finish.
pub fn loop_iterations(gpu: &Gpu, wanted: u32) -> Result<u32, GpuError> {
    let kernel = gpu.kernel("check/loops", &Specialisation::none())?;
    let parameters = gpu.uniform("loop check", &[wanted, 0, 0, 0])?;
    let counted = gpu.zeroed::<u32>("loop iterations", 1)?;
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &[("wanted", &parameters), ("counted", &counted)], kernel.groups(1))?;
    commands.run()?;
    Ok(gpu.read(&counted)?[0])
}
