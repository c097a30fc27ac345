use super::config::EnvConfig;
use drape_cloth::fabric::Lamina;

/// What the way from press to press costs, as a share of the score: a robot wants strokes, long and
/// without turning back. Measured on the flat blank, where presses that are a stencil's side or more
/// apart are of two strokes.
#[derive(Clone, Copy, Debug)]
pub struct Effort<'a> {
    lamina: &'a Lamina,
    config: &'a EnvConfig,
}

impl<'a> Effort<'a> {
    pub fn new(lamina: &'a Lamina, config: &'a EnvConfig) -> Self {
        Self { lamina, config }
    }

    /// Of a whole path.
    pub fn of_path(self, vertices: &[u32]) -> f64 {
        let ends = 1..=vertices.len();
        ends.map(|end| self.of_last(&vertices[end.saturating_sub(3)..end]))
            .sum()
    }

    /// Of the last of up to three presses, which those before it give a direction.
    pub fn of_last(self, vertices: &[u32]) -> f64 {
        let EnvConfig {
            stroke_cost,
            turn_cost,
            metre_cost,
            ..
        } = *self.config;
        let way = |pair: &[u32]| {
            let [from, to] = [pair[0], pair[1]].map(|v| self.lamina.rest[v as usize]);
            [to[0] - from[0], to[1] - from[1]]
        };
        let is_jump = |[x, y]: [f64; 2]| x.hypot(y) >= self.config.join_distance();
        let mut ways = vertices.windows(2).rev().map(way);
        let Some([x, y]) = ways.next() else {
            return stroke_cost;
        };
        let mut cost = metre_cost * x.hypot(y);
        if is_jump([x, y]) {
            cost += stroke_cost;
        } else if let Some(before) = ways.next()
            && !is_jump(before)
            && x * before[0] + y * before[1] < 0.0
        {
            cost += turn_cost;
        }
        cost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::fabric::{BlankConfig, Material};

    /// On a blank of 5 x 5 vertices 10 mm apart: a stroke of three, one turn back in it, a jump of
    /// 30 mm and a press.
    #[test]
    fn strokes_turns_and_metres_are_counted() {
        let blank = BlankConfig {
            size_mm: [40.0; 2],
            vertices: [5; 2],
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
        let path = [0, 1, 2, 1, 4];
        let cost = |stroke_cost, turn_cost, metre_cost| {
            let config = EnvConfig {
                stencil_mm: 20.0,
                stroke_cost,
                turn_cost,
                metre_cost,
                ..EnvConfig::default()
            };
            Effort::new(&lamina, &config).of_path(&path)
        };
        assert_eq!(cost(0.0, 0.0, 0.0), 0.0);
        assert_eq!(cost(1.0, 0.0, 0.0), 2.0);
        assert_eq!(cost(0.0, 1.0, 0.0), 1.0);
        assert!((cost(0.0, 0.0, 1.0) - 0.06).abs() < 1e-12);
    }
}
