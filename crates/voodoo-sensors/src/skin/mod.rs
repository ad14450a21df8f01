//! Skin color as a cue for head and hands (K06 III-A).
//!
//! Connected regions of skin color, as large as a face or an arm at the predicted range, are candidates for head and hands. Each
//! candidate belongs to the nearest predicted site within a gate, and becomes a ray of it that the objective may take or leave.
//! The colors are those of all skin tones first, and are then learned from the face.

pub mod colors;
pub mod cue;
pub mod depth;
mod regions;
