//! Samples points on the surface of a limb that face a camera, and classifies what the camera observes there.

use crate::math::{Pose, Vec3};
use crate::observation::depth_view::{DepthView, Pixel};
use crate::shape::{FacingSection, TaperedEllipticCylinder};
use crate::visibility::ALONG_LIMB;
use crate::visibility::EXPLAINED;

/// What a camera observes at a point on the model's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PatchVisibility {
    /// The point is outside the image, or the pixel has no return.
    Unknown,
    /// The point is behind the observed surface.
    Occluded,
    /// The point is observed at its depth.
    Consistent,
    /// The point violates free space: the camera observes a surface behind it.
    FreeSpace,
}

/// A point on a limb's surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePlace {
    /// Position, camera frame, meters.
    pub point: Vec3,
    /// Observation in its pixel.
    pub pixel: Pixel,
}

impl SurfacePlace {
    /// What a camera observes at a point.
    #[inline]
    pub(crate) fn observed(view: &DepthView, point: Vec3) -> Self {
        Self { point, pixel: view.at(point) }
    }

    /// Classifies the point by what the camera observes.
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

    /// Returns the depth of a possible body point observed within `tolerance` of the point's depth, meters.
    #[inline]
    pub(crate) fn depth_within(&self, tolerance: f64) -> Option<f64> {
        match self.pixel {
            Pixel::Foreground(z) if (z - self.point.z).abs() < tolerance => Some(z),
            _ => None,
        }
    }
}

/// Returns the sections at [`ALONG_LIMB`] of a limb, without those where the camera looks along the axis: the position along the
/// limb as a fraction of its length, the section, and points across it, camera frame, meters, for offsets `across` as fractions of
/// the radius from the middle; see [`FacingSection::point`].
#[inline]
pub(crate) fn surface_rows<const N: usize>(
    shape: &TaperedEllipticCylinder,
    camera_from_limb: &Pose,
    across: [f64; N],
) -> impl Iterator<Item = (f64, FacingSection, [Vec3; N])> {
    ALONG_LIMB.into_iter().filter_map(move |t| {
        let facing = shape.section(t).facing(camera_from_limb)?;
        Some((t, facing, across.map(|s| *camera_from_limb * facing.point(s))))
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
