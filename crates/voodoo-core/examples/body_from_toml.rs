//! A body from TOML: a desk lamp of a foot and two arms with hinges between them.
//!
//!     cargo run --release -p voodoo-core --example body_from_toml

use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Joint, Limb, Site, TaperedEllipticCylinder};

const LAMP: &str = r#"
name = "lamp"

[[limbs]]
name = "foot"
shape = [0.05, 0.10, 0.10, 0.02, 0.02] # length, a0, b0, a1, b1 in meters

[[limbs]]
name = "arm"
shape = [0.40, 0.02, 0.02, 0.02, 0.02]
parent = "foot"

[[limbs]]
name = "head"
shape = [0.20, 0.03, 0.03, 0.08, 0.08]
parent = "arm"
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let table: toml::Table = LAMP.parse()?;
    let mut limbs: Vec<Limb> = Vec::new();
    for entry in table["limbs"].as_array().ok_or("limbs: expected an array of tables")? {
        let text = |key: &str| entry.get(key).and_then(toml::Value::as_str);
        let numbers = entry["shape"].as_array().ok_or("shape: expected an array of numbers")?;
        let numbers: Vec<f64> = numbers.iter().filter_map(toml::Value::as_float).collect();
        let [length, a0, b0, a1, b1] = numbers[..] else { return Err("shape: expected five numbers".into()) };
        let parent = match text("parent") {
            None => None,
            Some(name) => {
                let index =
                    limbs.iter().position(|limb| limb.name == name).ok_or("parent: expected an earlier limb")?;
                let end = Pose::from_translation(Vec3::Z * limbs[index].shape.length());
                Some((index, hinge(&format!("{name}_end"), end)))
            }
        };
        let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1)?;
        let name = text("name").ok_or("name: expected a string")?.to_owned();
        limbs.push(Limb { name, shape, parent, match_caps: [false; 2] });
    }
    let tip = Site { name: "tip".into(), limb: limbs.len() - 1, position: Vec3::Z * 0.2 };
    let body = Body::new(table["name"].as_str().unwrap_or("body"), limbs, vec![tip])?;
    let tip = body.site_position(&body.rest_pose(Pose::IDENTITY), 0);
    println!("{} has {} limbs; its tip is {:.2} m above its foot", body.name(), body.limbs().len(), tip.z);
    Ok(())
}

/// A hinge about x at the end of the parent and the start of the limb.
fn hinge(name: &str, parent_from_joint: Pose) -> Joint {
    Joint {
        name: name.into(),
        parent_from_joint,
        limb_from_joint: Pose::IDENTITY,
        semi_axes: [0.02, 0.0],
        weight: 1.0,
        limits: None,
        motion: 0.02,
    }
}
