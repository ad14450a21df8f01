//! A picture, as skin was looked for in it.

use std::sync::Arc;

use crate::body_view::BodyView;

/// A picture, as skin was looked for in it.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Rows and columns.
    pub size: [usize; 2],
    /// Of each pixel's color, see [`crate::chroma::bins`].
    pub bins: Vec<u16>,
    /// 1 where it has skin's color.
    pub colored: Vec<u8>,
    /// 1 where that may be the body's.
    pub skin: Vec<u8>,
    /// What a depth camera saw.
    pub body: Option<Arc<BodyView>>,
}
