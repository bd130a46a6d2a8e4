//! The built-in scene, built into a BVH and traced on the GPU in a browser, and compared with the CPU.
//!
//! ```text
//! cargo xtask browser       builds the page into target/browser/page and says how to open it
//! ```

#![forbid(unsafe_code)]

#[cfg(target_family = "wasm")]
mod compare;
#[cfg(target_family = "wasm")]
mod page;
#[cfg(target_family = "wasm")]
mod view;

/// Any error, as the page shows it.
#[cfg(target_family = "wasm")]
type Failure = Box<dyn std::error::Error>;

#[cfg(target_family = "wasm")]
fn main() {
    wasm_bindgen_futures::spawn_local(page::run());
}

#[cfg(not(target_family = "wasm"))]
compile_error!("this program runs in browsers: cargo xtask browser");
