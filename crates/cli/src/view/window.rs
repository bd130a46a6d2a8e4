//! The window.
use anyhow::Result;
use super::options::Options;
pub(super) fn run(_: Options) -> Result<()> { Ok(()) }
