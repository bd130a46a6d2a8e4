//! What a driver does against its word.

use canted_shaders::Specialisation;

use crate::{Gpu, GpuError};

/// Turns that a loop of `wanted` turns really takes on this device.
///
/// Some software drivers leave loops early and say nothing: Mesa's llvmpipe before version 23 after 65,535 turns of all
/// loops of an invocation together.
///
/// # Errors
/// A device that is lost or does not finish.
pub fn loop_iterations(gpu: &Gpu, wanted: u32) -> Result<u32, GpuError> {
    let kernel = gpu.kernel("check/loops", &Specialisation::none())?;
    let parameters = gpu.uniform("canary", &[wanted, 0, 0, 0])?;
    let counted = gpu.zeroed::<u32>("canary's turns", 1)?;
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &[("wanted", &parameters), ("counted", &counted)], kernel.groups(1))?;
    commands.run()?;
    Ok(gpu.read(&counted)?[0])
}
