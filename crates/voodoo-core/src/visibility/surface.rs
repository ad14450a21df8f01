//! Places on the surface of a limb that face a camera, and what the camera shows there: the one walk over a limb's surface.

use crate::math::{Pose, Vec3};
use crate::observation::depth_view::{DepthView, Pixel};
use crate::shape::{FacingSection, TaperedEllipticCylinder};
use crate::visibility::ALONG_LIMB;
use crate::visibility::evidence::EXPLAINED;

/// What a camera says about a place on the model's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PatchVisibility {
    /// Outside the image, or no return.
    Unknown,
    /// Behind what is seen.
    Occluded,
    /// Seen where it is.
    Consistent,
    /// The camera sees past it.
    FreeSpace,
}

/// A place on a limb's surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePlace {
    /// Camera frame, meters.
    pub point: Vec3,
    /// What is seen in its pixel.
    pub pixel: Pixel,
}

impl SurfacePlace {
    /// What the camera says about it.
    #[inline]
    pub(crate) fn sight(&self) -> PatchVisibility {
        let surface = self.point.z;
        let (z, past) = match self.pixel {
            Pixel::Unknown => return PatchVisibility::Unknown,
            Pixel::Background(z) => (z, EXPLAINED),
            Pixel::Foreground(z) | Pixel::Other(z) => (z, 2.0 * EXPLAINED),
        };
        if z > surface + past {
            PatchVisibility::FreeSpace
        } else if z > surface - 2.0 * EXPLAINED {
            PatchVisibility::Consistent
        } else {
            PatchVisibility::Occluded
        }
    }

    /// Depth of what may be the body, if it is seen less than `tolerance` before or behind the place, meters.
    #[inline]
    pub(crate) fn depth_within(&self, tolerance: f64) -> Option<f64> {
        match self.pixel {
            Pixel::Foreground(z) if (z - self.point.z).abs() < tolerance => Some(z),
            _ => None,
        }
    }
}

/// What of a limb faces a camera, at one place along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceRow<'a> {
    /// Share of the limb's length, from its proximal end.
    pub t: f64,
    /// The section there.
    pub facing: FacingSection,
    camera_from_limb: &'a Pose,
}

impl SurfaceRow<'_> {
    /// Places across it, camera frame, meters; in shares of the radius from the middle, see [`FacingSection::point`].
    #[inline]
    pub(crate) fn points<const N: usize>(&self, across: [f64; N]) -> [Vec3; N] {
        across.map(|s| *self.camera_from_limb * self.facing.point(s))
    }

    /// The same with what a camera shows there.
    #[inline]
    pub(crate) fn places<const N: usize>(&self, view: &DepthView, across: [f64; N]) -> [SurfacePlace; N] {
        self.points(across).map(|point| SurfacePlace { point, pixel: view.at(point) })
    }
}

/// The rows at [`ALONG_LIMB`] of a limb; those along whose axis the camera looks are left out.
#[inline]
pub(crate) fn surface_rows<'a>(
    shape: &'a TaperedEllipticCylinder,
    camera_from_limb: &'a Pose,
) -> impl Iterator<Item = SurfaceRow<'a>> + 'a {
    ALONG_LIMB.into_iter().filter_map(move |t| {
        let facing = shape.section(t).facing(camera_from_limb)?;
        Some(SurfaceRow { t, facing, camera_from_limb })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_is_visible_past_consistent_or_hidden_by_what_its_pixel_shows() {
        let point = Vec3::new(0.0, 0.0, 2.0);
        let sight = |pixel| SurfacePlace { point, pixel }.sight();
        for (pixel, expected) in [
            (Pixel::Unknown, PatchVisibility::Unknown),
            (Pixel::Background(f64::INFINITY), PatchVisibility::FreeSpace),
            (Pixel::Background(2.05), PatchVisibility::FreeSpace),
            (Pixel::Background(2.03), PatchVisibility::Consistent),
            (Pixel::Foreground(2.09), PatchVisibility::FreeSpace),
            (Pixel::Other(2.05), PatchVisibility::Consistent),
            (Pixel::Foreground(1.95), PatchVisibility::Consistent),
            (Pixel::Other(1.9), PatchVisibility::Occluded),
            (Pixel::Background(1.9), PatchVisibility::Occluded),
        ] {
            assert_eq!(sight(pixel), expected, "{pixel:?}");
        }
        let observed = |pixel| SurfacePlace { point, pixel }.depth_within(0.04);
        assert_eq!(observed(Pixel::Foreground(2.03)), Some(2.03));
        assert!(observed(Pixel::Foreground(2.05)).is_none() && observed(Pixel::Other(2.0)).is_none());
    }
}
