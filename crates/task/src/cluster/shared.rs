use std::ops::Range;

use super::Cluster;
use drape_cloth::measure::Measures;
use drape_cloth::sim::{Backend, Column, Control, Observed, Own, Press, Snapshot};

/// Environments of which every process simulates its part and knows all.
pub(crate) struct Shared {
    cluster: Cluster,
    count: usize,
    /// Those simulated here.
    range: Range<usize>,
    /// None where there are fewer environments than processes.
    own: Option<Box<dyn Backend>>,
}

impl Shared {
    /// `count` environments at their start, which `open` makes so many of.
    pub fn open<E>(
        cluster: &Cluster,
        count: usize,
        open: impl FnOnce(usize) -> Result<Box<dyn Backend>, E>,
    ) -> Result<Box<dyn Backend>, E> {
        if cluster.size() == 1 {
            return open(count);
        }
        let range = cluster.share(count);
        let own = (!range.is_empty()).then(|| open(range.len())).transpose()?;
        Ok(Box::new(Self {
            cluster: cluster.clone(),
            count,
            range,
            own,
        }))
    }

    /// The number here of an environment that is simulated here, and those.
    fn place(&mut self, environment: usize) -> Option<(usize, &mut Box<dyn Backend>)> {
        let is_own = self.range.contains(&environment);
        let own = self.own.as_mut().filter(|_| is_own)?;
        Some((environment - self.range.start, own))
    }

    /// What `of` gives for each environment.
    fn all<T: serde::Serialize + serde::de::DeserializeOwned>(
        &self,
        of: impl FnOnce(&dyn Backend) -> Vec<T>,
    ) -> Vec<T> {
        let own = self.own.as_ref().map_or_else(Vec::new, |own| of(&**own));
        self.cluster.gather(own).into_iter().flatten().collect()
    }
}

impl Backend for Shared {
    fn count(&self) -> usize {
        self.count
    }

    fn load(&mut self, environment: usize, snapshot: &Snapshot) {
        if let Some((place, own)) = self.place(environment) {
            own.load(place, snapshot);
        }
    }

    fn reset(&mut self, environment: usize, own: &Own) {
        if let Some((place, backend)) = self.place(environment) {
            backend.reset(place, own);
        }
    }

    fn snapshot(&self, environment: usize) -> Snapshot {
        let is_own = self.range.contains(&environment);
        let own = self.own.as_ref().filter(|_| is_own);
        let own = own.map(|own| own.snapshot(environment - self.range.start));
        let found = self.cluster.gather(own);
        let mut found = found.into_iter().flatten();
        found.next().expect("one process has it")
    }

    fn step(&mut self, control: &Control, presses: &[Press]) {
        let own = presses
            .iter()
            .filter(|p| self.range.contains(&p.environment));
        let own = own.map(|press| Press {
            environment: press.environment - self.range.start,
            ..press.clone()
        });
        let presses: Vec<Press> = own.collect();
        if let Some(own) = &mut self.own {
            own.step(control, &presses);
        }
    }

    fn press(&mut self, vertices: &[Option<u32>]) -> Column<f64> {
        assert_eq!(vertices.len(), self.count, "one entry an environment");
        let range = self.range.clone();
        let own = self.own.as_mut().map(|own| own.press(&vertices[range]));
        let own = own.map_or_else(Vec::new, |places| places.host().to_vec());
        Column::on_host(self.cluster.gather(own).concat())
    }

    fn finite(&self) -> Vec<bool> {
        self.all(|own| own.finite())
    }

    fn observe(&self) -> Observed {
        let own = self.own.as_ref().map(|own| own.observe());
        let found = self.cluster.gather(own).into_iter();
        Observed::joined(found.flatten().collect())
    }

    fn measure(&self, environments: &[usize]) -> Vec<Measures> {
        let own = environments.iter().filter(|e| self.range.contains(e));
        let own: Vec<usize> = own.map(|e| e - self.range.start).collect();
        self.all(|backend| backend.measure(&own))
    }
}
