//! What of a frame is one person's where several are tracked.

use super::background::Backgrounds;

/// Mark of a pixel that no person's surface explains.
pub(crate) const NO_OWNER: u16 = u16::MAX;

/// A frame as one of several persons sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OwnershipMask<'a> {
    /// Image after image, who explains each pixel: the number of a person, or [`NO_OWNER`].
    pub owners: &'a [Vec<u16>],
    /// Cloud after cloud, the same of each point.
    pub cloud_owners: &'a [Vec<u16>],
    /// The number of the person.
    pub own: u16,
    /// The still scene, as it was learned where nobody was.
    pub scene: &'a Backgrounds,
}

impl<'a> OwnershipMask<'a> {
    /// The owners of an image's pixels.
    pub(crate) fn owners(&self, image: usize) -> &'a [u16] {
        self.owners.get(image).map_or(&[], Vec::as_slice)
    }

    /// Whether a pixel with this owner shows another person.
    pub(crate) fn is_others(&self, owner: u16) -> bool {
        owner != NO_OWNER && owner != self.own
    }
}
