//! A segmented color image.

use std::sync::Arc;

use crate::body_view::BodyView;

/// A segmented color image.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Height and width.
    pub size: [usize; 2],
    /// Bin of each pixel's color, see [`crate::chroma::bins`].
    pub bins: Vec<u16>,
    /// 1 where the pixel has the color of skin.
    pub colored: Vec<u8>,
    /// 1 where such a pixel may belong to the body.
    pub skin: Vec<u8>,
    /// Depth measurements registered to the image.
    pub body: Option<Arc<BodyView>>,
}
