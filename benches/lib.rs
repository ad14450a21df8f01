//! Nothing but the package of the benches.
