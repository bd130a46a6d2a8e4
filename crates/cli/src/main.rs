//! The program `canted`; see the library.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    canted_cli::main()
}
