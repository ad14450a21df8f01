//! Tests of the core's parts that its interface does not name; they are compiled with its unit tests.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

#[path = "../scene/mod.rs"]
mod scene;
mod status;
mod terms;
mod tree;
