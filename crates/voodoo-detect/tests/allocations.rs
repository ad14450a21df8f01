//! Heap allocations of frames with a detector: only frames in which it is evaluated may allocate.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

#[path = "../../voodoo-core/tests/counting/mod.rs"]
mod counting;
#[path = "../../voodoo-core/tests/people_allocations/mod.rs"]
mod people_allocations;
#[path = "../../voodoo-core/tests/scene/mod.rs"]
mod scene;

use people_allocations::TwoPersons;
use voodoo_detect::Detector;

/// Without the test harness, whose thread allocates beside the counted one.
fn main() {
    // A detector searches for others once in six such frames, and evaluates each of the two once in fifteen.
    let two = TwoPersons::new();
    let [allocating, all] = two.allocations(two.people().with_detector(Box::new(Detector::new())));
    assert!(allocating <= all / 6 + 2 * all / 15, "{allocating} of {all} frames of two persons");
}
