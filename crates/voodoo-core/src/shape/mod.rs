//! The shape of a limb: a tapered elliptic cylinder and its closest-point, bounding and ray queries.
