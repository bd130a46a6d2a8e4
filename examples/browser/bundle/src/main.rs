//! `bundle PROGRAM.wasm FOLDER`: what the program wasm-bindgen does with `--target web --no-typescript`, in the version of the page.

#![forbid(unsafe_code)]

use std::{error::Error, path::PathBuf};

use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(program), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err("usage: bundle PROGRAM.wasm FOLDER".into());
    };
    let mut bindings = Bindgen::new();
    bindings.input_path(program).web(true)?.typescript(false);
    bindings.generate(folder)?;
    Ok(())
}
