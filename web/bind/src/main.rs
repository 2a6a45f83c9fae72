//! Makes a module for browsers from the compiler's output: `bind FILE.wasm FOLDER`.
//!
//! It replaces wasm-bindgen's own program for a page, in the version of the lock file, and builds in a fraction of the time.

use anyhow::Context;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [from, to] = words.as_slice() else { anyhow::bail!("expected FILE.wasm FOLDER") };
    let mut bindgen = Bindgen::new();
    bindgen.input_path(from).web(true)?.typescript(false);
    bindgen.generate(to).with_context(|| format!("cannot make a module of {from}"))
}
