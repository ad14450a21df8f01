//! Writes every docstring of `python/voodoo/_core.pyi` into a file of its own, for `stub!` in lib.rs: so `help()` and editors tell
//! the same, and it is written once.

use std::error::Error;
use std::path::PathBuf;
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    let stub = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../../python/voodoo/_core.pyi");
    println!("cargo::rerun-if-changed={}", stub.display());
    let folder = PathBuf::from(env::var("OUT_DIR")?);
    let text = fs::read_to_string(&stub).map_err(|error| format!("{}: {error}", stub.display()))?;
    for (name, doc) in docstrings(&text) {
        fs::write(folder.join(name), doc)?;
    }
    Ok(())
}

/// Names and docstrings of classes, of their members ("Class.member") and of functions, as `inspect.cleandoc` has them.
fn docstrings(text: &str) -> Vec<(String, String)> {
    let (mut class, mut name, mut found) = (String::new(), String::new(), Vec::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let code = line.trim_start();
        let indent = line.len() - code.len();
        let word =
            |rest: &str| rest.split(|sign: char| !sign.is_alphanumeric() && sign != '_').next().map(str::to_owned);
        if let Some(word) = code.strip_prefix("class ").and_then(word) {
            (class, name) = (word.clone(), word);
        } else if let Some(word) = code.strip_prefix("def ").and_then(word) {
            name = if indent > 0 { format!("{class}.{word}") } else { word };
        } else if let Some(first) = code.strip_prefix("\"\"\"") {
            let mut doc = first.to_owned();
            while !doc.ends_with("\"\"\"") {
                let Some(line) = lines.next() else { break };
                doc.push('\n');
                doc.push_str(line.get(indent..).unwrap_or_default());
            }
            found.push((name.clone(), doc.trim_end_matches('"').trim_end().to_owned()));
        }
    }
    found.retain(|(name, _)| !name.is_empty());
    found
}
