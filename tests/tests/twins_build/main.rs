//! Each stage of the build on the device compared with the same stage on the CPU.
//!
//! Integers are equal bit for bit. Oriented boxes contain everything below them, exactly.

mod compare;
mod models;
mod ploc;
mod repeated;
mod scan;
mod setup;
mod sort;
mod stages;
mod top_level;
mod volumes;
mod wide;
mod wide_check;

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([
        models::tests(),
        ploc::tests(),
        repeated::tests(),
        scan::tests(),
        sort::tests(),
        stages::tests(),
        top_level::tests(),
        volumes::tests(),
        wide::tests(),
        wide_check::tests(),
    ])
}
