use drape_cloth::fabric::{Curve, Family, Material};
use drape_cloth::sim::{Bending, BendingStiffness, PhysicsConfig};
use drape_task::env::{Scatter, Spread};

use crate::estimate::Estimate;
use crate::fabric::{bending_by_compression, rounded};
use crate::observed::FACTORS;

/// The fabric of a scene under the factors that states tell, and what the scene has to say itself, in sentences.
pub fn scaled(
    material: &Material,
    physics: &PhysicsConfig,
    estimate: &Estimate,
) -> (Material, Vec<String>) {
    let [friction, bending, shear, tension] = [0, 1, 2, 3].map(|k| estimate.at[k].exp());
    let (mut made, mut notes) = (material.clone(), Vec::new());
    let curve = |curve: &Curve, factor: f64| {
        let points = curve.points().iter();
        let points = points.map(|&[strain, stress]| [strain, rounded(factor * stress)]);
        Curve::new(points.collect())
    };
    for (family, yarn) in [
        (Family::Warp, &mut made.warp),
        (Family::Weft, &mut made.weft),
    ] {
        let key = ["warp", "weft"][family as usize];
        yarn.static_friction = rounded(friction * yarn.static_friction);
        yarn.dynamic_friction = rounded(friction * yarn.dynamic_friction);
        yarn.tension = curve(&yarn.tension, tension);
        if physics.bending_stiffness == BendingStiffness::Material {
            let stiffness = bending * material.bending_stiffness(family);
            let found = bending_by_compression(key, stiffness, &yarn.tension, material.thickness());
            match found {
                Ok(compression) => yarn.compression = compression,
                Err(error) => notes.push(format!("compression stays as it is: {error}")),
            }
        }
    }
    made.shear.positive = curve(&made.shear.positive, shear);
    made.shear.negative = curve(&made.shear.negative, shear);
    if let (BendingStiffness::NewtonMetre(stiffness), true) =
        (physics.bending_stiffness, physics.bending != Bending::Off)
    {
        notes.push(format!(
            "bending is the scene's: physics.bending_stiffness = {{ newton_metre = {} }}",
            rounded(bending * stiffness)
        ));
    }
    (made, notes)
}

/// How far each factor that the data tell may be off, as scatter; what they do not tell is left out.
pub fn posterior(estimate: &Estimate) -> Scatter {
    let told = (0..FACTORS.len()).filter(|&k| estimate.is_told[k]);
    let spread = |k| {
        (
            FACTORS[k],
            Spread::Deviation(rounded(estimate.deviation[k])),
        )
    };
    Scatter {
        spreads: told.map(spread).collect(),
        ..Scatter::default()
    }
}

/// The standard deviation that a factor's logarithm has by what varies; half where nothing is known, so that most are within
/// a factor of two.
pub fn prior(scatter: &Scatter) -> [f64; 4] {
    FACTORS.map(|quantity| match scatter.spreads.get(&quantity) {
        None => 0.5,
        Some(Spread::Deviation(deviation)) => deviation.max(1e-3),
        Some(Spread::Range([low, high])) => ((high / low).ln() / 12f64.sqrt()).max(1e-3),
    })
}
