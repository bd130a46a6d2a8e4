//! Each stage of the build on the device compared with the same stage on the CPU.
//!
//! Integers are equal bit for bit. Oriented boxes contain everything below them, exactly.

mod ploc;
mod setup;
mod stages;
mod top_level;
mod volumes;
mod wide;

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([
        ploc::tests(),
        stages::tests(),
        top_level::tests(),
        volumes::tests(),
        wide::tests(),
    ])
}
