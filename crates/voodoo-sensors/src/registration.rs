//! Looks up surfaces among depth points registered to the image of a color camera.

use voodoo_core::Unexpected;

/// Depths within this of each other, meters, are of one surface: a limb is no deeper.
pub(crate) const ONE_SURFACE: f64 = 0.1;
/// Fewer points than this around a pixel are no surface, since one or two may be stray returns.
pub(crate) const FEWEST_POINTS: usize = 3;

/// Returns the depth of the nearest surface within `radius` of a pixel, meters; `None` with fewer than three points there.
/// `places` are the columns and rows of points registered to the image, and `depths` their depths, meters.
///
/// # Errors
/// [`Unexpected`] when the number of depths differs from that of the points.
pub fn nearest_surface(
    places: &[[f64; 2]],
    depths: &[f64],
    place: [f64; 2],
    radius: f64,
) -> Result<Option<f64>, Unexpected> {
    let found = format_args!("{} for {}", depths.len(), places.len());
    Unexpected::unless(depths.len() == places.len(), "depths", "as many depths as pixels", found)?;
    let is_near = |other: &[f64; 2]| {
        let (u, v) = (other[0] - place[0], other[1] - place[1]);
        u * u + v * v < radius * radius
    };
    let near = places.iter().zip(depths).filter(|(other, _)| is_near(other));
    let mut near: Vec<f64> = near.map(|(_, depth)| *depth).collect();
    if near.len() < FEWEST_POINTS {
        return Ok(None);
    }
    near.sort_unstable_by(f64::total_cmp);
    let fifth = near[(near.len() - 1) / 5];
    near.retain(|depth| (depth - fifth).abs() < ONE_SURFACE);
    Ok(near.get(near.len() / 2).copied())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_surface_around_a_place_is_the_nearest_fifths() {
        // A surface at 2 m in the left half, one at 3 m in the right half, a point a pixel, each a little off.
        let places: Vec<[f64; 2]> = (0..1600).map(|index| [f64::from(index % 40), f64::from(index / 40)]).collect();
        let depth = |place: &[f64; 2]| (if place[0] < 20.0 { 2.0 } else { 3.0 }) + 0.001 * ((7.0 * place[1]) % 5.0);
        let depths: Vec<f64> = places.iter().map(depth).collect();
        let found = |place: [f64; 2], radius: f64| nearest_surface(&places, &depths, place, radius).unwrap();
        assert!((found([20.0, 20.0], 8.0).unwrap() - 2.0).abs() < 0.005);
        assert!((found([32.0, 20.0], 8.0).unwrap() - 3.0).abs() < 0.005);
        assert_eq!(found([20.0, 20.0], 0.5), None, "one point is no surface");
        assert!(nearest_surface(&places, &depths[1..], [0.0; 2], 1.0).is_err());
    }
}
