use super::bending::Bending;
use super::config::TwinConfig;
use super::contact::Contact;
use super::energy::Energies;
use super::frequency::{Bound, bound};
use super::law::Laws;
use super::membrane::Membranes;
use super::pack::{Field, WIDTH, at, zeros};
use crate::fabric::Lamina;
use crate::file::ValueError;
use crate::math::Isa;
use crate::sim::Pressed;
use fixedbitset::FixedBitSet;

/// Steps after which the bound on frequencies is refreshed and positions are checked: some
/// milliseconds, in which the cloth hardly turns.
const REFRESH_INTERVAL: usize = 256;

/// The finite-element digital twin of a lamina, in motion.
///
/// Explicit central differences: positions at whole steps, velocities at half steps. A twin
/// begins at rest, flat, in the lamina's own frame at z = 0.
pub struct Twin {
    pub(super) config: TwinConfig,
    pub(super) count: usize,
    /// Weight of each vertex, 0 in padding [N].
    pub(super) weight: Vec<f64>,
    /// Mass, for inertia [kg], 0 in padding.
    pub(super) mass: Vec<f64>,
    /// 1 / inertia [1/kg], 0 in padding.
    pub(super) inverse_mass: Vec<f64>,
    /// Area of fabric that a vertex stands for [m^2].
    pub(super) area: Vec<f64>,
    pub(super) membranes: Membranes,
    pub(super) bending: Bending,
    pub(super) contact: Contact,
    /// Velocity of each vertex that a clamp holds [m/s].
    pub(super) held: Vec<Option<[f64; 3]>>,
    /// What [`Twin::replay`] has done so far.
    pub(super) pressed: Pressed,
    pub(super) x: Field,
    pub(super) v: Field,
    pub(super) f: Field,
    pub(super) seconds: f64,
    /// Duration of the last step [s]; 0 when velocities are those of now.
    pub(super) last: f64,
    pub(super) isa: Isa,
    pub(super) peak: [f64; 2],
    pub(super) bound: Bound,
    pub(super) time_step: f64,
    pub(super) until_refresh: usize,
    /// What has come and gone since the start, but for gravity [J].
    pub(super) ledger: Energies,
    /// Potential of weight at the start [J].
    potential: f64,
}

impl Twin {
    /// A lamina at rest. Fails with the key of the value that is out of range.
    pub fn new(lamina: &Lamina, config: &TwinConfig) -> Result<Self, ValueError> {
        config.check()?;
        let own = &config.parameters;
        let laws = Laws::new(&lamina.material, config.shear_locking, own);
        let (name, expected) = (&lamina.material.name, "curves of finite slope");
        ValueError::unless(laws.are_finite(), "twin.material", name, expected)?;
        let count = lamina.vertex_count();
        let area = lamina.vertex_areas();
        let padded = |of: &dyn Fn(f64) -> f64| {
            let mut values: Vec<f64> = lamina.mass.iter().map(|m| of(m * own.areal_mass)).collect();
            values.resize(count.next_multiple_of(WIDTH), 0.0);
            values
        };
        let friction = lamina.material.friction();
        let friction = [0, 1].map(|k| friction[k] * own.friction[k]);
        let friction = config.friction.then_some(friction);
        let tack = (config.adhesion > 0.0)
            .then(|| area.iter().map(|a| 1e3 * config.adhesion * a).collect());
        let mut twin = Self {
            config: config.clone(),
            count,
            weight: padded(&|m| config.gravity * m),
            mass: padded(&|m| m * config.mass_scaling),
            inverse_mass: padded(&|m| 1.0 / (m * config.mass_scaling)),
            membranes: Membranes::new(lamina, laws),
            bending: Bending::new(lamina, config.bending_stiffness, own.bending),
            contact: Contact::new(count, friction, tack),
            area,
            held: vec![None; count],
            pressed: Pressed {
                touched: FixedBitSet::with_capacity(count),
                draped: FixedBitSet::with_capacity(count),
                ..Pressed::default()
            },
            x: zeros(count),
            v: zeros(count),
            f: zeros(count),
            seconds: 0.0,
            last: 0.0,
            isa: Isa::best(),
            peak: [0.0; 2],
            bound: Bound {
                frequency: f64::INFINITY,
                limit: [0.0; 2],
            },
            time_step: 0.0,
            until_refresh: 0,
            ledger: Energies::default(),
            potential: 0.0,
        };
        for (v, &[x, y]) in lamina.rest.iter().enumerate() {
            twin.x[0][v] = x;
            twin.x[1][v] = y;
        }
        twin.restart();
        Ok(twin)
    }

    /// Changes the decay rate of every velocity [1/s], such as to settle.
    pub fn set_damping(&mut self, damping: f64) {
        self.config.damping = damping;
    }

    /// Position of every vertex [m].
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.vectors(&self.x)
    }

    /// Velocity of every vertex [m/s], half a step ago.
    pub fn velocities(&self) -> Vec<[f64; 3]> {
        self.vectors(&self.v)
    }

    fn vectors(&self, field: &Field) -> Vec<[f64; 3]> {
        (0..self.count).map(|v| at(field, v).into()).collect()
    }

    /// Position of a vertex [m].
    pub fn position(&self, vertex: u32) -> [f64; 3] {
        at(&self.x, vertex as usize).into()
    }

    /// Puts every vertex in its place [m]. The rest shape stays that of the lamina; energies
    /// count from here.
    ///
    /// # Panics
    /// If there is not one position a vertex.
    pub fn set_positions(&mut self, positions: &[[f64; 3]]) {
        assert_eq!(positions.len(), self.count, "one position a vertex");
        fill(&mut self.x, positions);
        self.restart();
    }

    /// Gives every vertex its velocity [m/s]; held vertices keep theirs.
    ///
    /// # Panics
    /// If there is not one velocity a vertex.
    pub fn set_velocities(&mut self, velocities: &[[f64; 3]]) {
        assert_eq!(velocities.len(), self.count, "one velocity a vertex");
        fill(&mut self.v, velocities);
        for (vertex, held) in self.held.iter().enumerate() {
            for (v, held) in self.v.iter_mut().zip(held.iter().flatten()) {
                v[vertex] = *held;
            }
        }
        self.restart();
    }

    /// Holds a vertex where it is.
    pub fn fix(&mut self, vertex: u32) {
        self.drive(vertex, [0.0; 3]);
    }

    /// Holds a vertex, moving it evenly [m/s].
    pub fn drive(&mut self, vertex: u32, velocity: [f64; 3]) {
        self.held[vertex as usize] = Some(velocity);
    }

    /// The force with which the cloth pulls at a vertex, weight included [N]: what
    /// whatever holds the vertex has to bear. Viscous stress and inertia are not counted.
    pub fn pull(&self, vertices: &[u32]) -> [f64; 3] {
        let mut f = self.elastic_field();
        for (f, weight) in f[2].iter_mut().zip(&self.weight) {
            *f -= weight;
        }
        f.map(|f| vertices.iter().map(|&v| f[v as usize]).sum())
    }

    pub(super) fn elastic_field(&self) -> Field {
        let mut f = zeros(self.count);
        self.membranes.add_elastic_forces(&self.x, &mut f);
        self.bending.add_forces(&self.x, &mut f);
        f
    }

    /// Kinetic energy over mass, as a speed: root mean square velocity by inertia [m/s].
    pub fn speed(&self) -> f64 {
        let sum: f64 = self.mass.iter().sum();
        (2.0 * self.kinetic() / sum).sqrt()
    }

    fn kinetic(&self) -> f64 {
        let square = |v: usize| self.v.iter().map(|axis| axis[v] * axis[v]).sum::<f64>();
        (0..self.count)
            .map(|v| 0.5 * self.mass[v] * square(v))
            .sum()
    }

    fn potential(&self, x: &Field) -> f64 {
        (0..self.count).map(|v| self.weight[v] * x[2][v]).sum()
    }

    /// The balance of energy, half a step ago.
    pub fn energies(&self) -> Energies {
        let mut back = self.x.clone();
        for (x, v) in back.iter_mut().zip(&self.v) {
            for (x, v) in x.iter_mut().zip(v) {
                *x -= self.last * v;
            }
        }
        let (now, then) = (self.membranes.energy(&self.x), self.membranes.energy(&back));
        let potential = 0.5 * (self.potential(&self.x) + self.potential(&back));
        Energies {
            kinetic: self.kinetic(),
            stretch: 0.5 * (now[0] + then[0]),
            shear: 0.5 * (now[1] + then[1]),
            bending: 0.5 * (self.bending.energy(&self.x) + self.bending.energy(&back)),
            gravity: self.potential - potential,
            ..self.ledger
        }
    }

    /// Takes the present as the start.
    fn restart(&mut self) {
        self.last = 0.0;
        self.contact.forget();
        self.potential = self.potential(&self.x);
        self.ledger = Energies {
            initial: self.kinetic()
                + self.membranes.energy(&self.x).iter().sum::<f64>()
                + self.bending.energy(&self.x),
            ..Energies::default()
        };
        // For the strains alone: every step begins with no forces.
        let pass = self.membranes.add_forces(&self.x, &mut self.f, None);
        self.peak = pass.peak;
        self.membranes.forget();
        self.refresh_bound();
    }

    /// The time step that is known to be stable, times `safety` [s], for the present strain.
    pub fn stable_time_step(&self) -> f64 {
        self.time_step
    }

    /// Bounds the frequencies anew, and with them the time step.
    pub(super) fn refresh_bound(&mut self) {
        let mass = &self.mass[..self.count];
        self.bound = bound(&self.membranes, &self.bending, &self.x, mass, self.peak);
        // Viscous forces come a step late (Abaqus Theory Guide, explicit dynamics).
        let xi = self.config.viscosity;
        let share = (1.0 + xi * xi).sqrt() - xi;
        self.time_step = self.config.safety * 2.0 / self.bound.frequency * share;
        self.until_refresh = REFRESH_INTERVAL;
    }
}

fn fill(field: &mut Field, vectors: &[[f64; 3]]) {
    for (v, vector) in vectors.iter().enumerate() {
        for (axis, x) in field.iter_mut().zip(vector) {
            axis[v] = *x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::{BlankConfig, Material};
    use crate::tool::{Hemisphere, Shape, Source, Tool, ToolConfig};

    /// A fall on to a dome has the same bits on every instruction set.
    #[test]
    fn bits_do_not_depend_on_the_instruction_set() {
        let blank = BlankConfig {
            size_mm: [80.0, 80.0],
            vertices: [21, 21],
            yarn_angle_deg: 10.0,
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
        let tool = Tool::new(&ToolConfig {
            source: Source::Shape(Shape::Hemisphere(Hemisphere::default())),
            ..ToolConfig::default()
        })
        .unwrap();
        let ends: Vec<_> = Isa::available()
            .into_iter()
            .map(|isa| {
                let mut twin = Twin::new(&lamina, &TwinConfig::default()).unwrap();
                twin.isa = isa;
                let at: Vec<[f64; 3]> = (lamina.rest.iter())
                    .map(|[x, y]| [*x, *y, 0.0752])
                    .collect();
                twin.set_positions(&at);
                twin.advance(Some(&tool), 0.02).unwrap();
                (twin.positions(), twin.energies())
            })
            .collect();
        assert!(ends.iter().all(|end| *end == ends[0]));
        assert!(ends[0].1.friction > 0.0);
    }

    #[test]
    fn infinite_moduli_are_refused() {
        let mut material = Material::interglas_92125();
        material.warp.tension = crate::fabric::Curve::line(f64::INFINITY);
        let lamina = Lamina::new(&BlankConfig::default(), material).unwrap();
        let error = Twin::new(&lamina, &TwinConfig::default()).err().unwrap();
        assert_eq!(
            error.to_string(),
            "`twin.material` is Interglas 92125, expected curves of finite slope"
        );
    }
}
