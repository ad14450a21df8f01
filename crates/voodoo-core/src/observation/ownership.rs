//! Which pixels and points of a frame belong to which person, where several are tracked.

use super::background::Backgrounds;

/// Marks a pixel that no person's surface explains.
pub(crate) const NO_OWNER: u16 = u16::MAX;

/// A frame from the perspective of one of several persons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OwnershipMask<'a> {
    /// The owner of each pixel, image after image, and then of each point, cloud after cloud: the index of a person, or
    /// [`NO_OWNER`].
    pub owners: &'a [Vec<u16>],
    /// Index of this person.
    pub own: u16,
    /// Number of times that others were given pixels and points; 0 if nobody else was.
    pub others: usize,
    /// The static scene, learned where no person was.
    pub scene: &'a Backgrounds,
}

impl<'a> OwnershipMask<'a> {
    /// The owners of the pixels of an image, or of the points of a cloud, which are numbered after the images.
    pub(crate) fn owners(&self, source: usize) -> &'a [u16] {
        self.owners.get(source).map_or(&[], Vec::as_slice)
    }

    /// Whether this owner is another person.
    pub(crate) fn is_others(&self, owner: u16) -> bool {
        owner != NO_OWNER && owner != self.own
    }
}
