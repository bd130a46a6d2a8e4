//! Pictures on a device: what its kernels read, packed from what the CPU's integrators read.

mod environment;
mod lights;
#[cfg(test)]
mod twins;
