use super::draping::Draping;
use super::task::{ImageShape, Observation, StepOutcome, Tasks};
use super::terrain::Terrain;
use drape_cloth::file::ValueError;
use serde::{Deserialize, Serialize};

/// Draping tasks on several scenes, stepped together and seen alike.
pub struct Family(Vec<Draping>);

impl Family {
    /// The tasks of all `members`, one after the other.
    ///
    /// # Errors
    /// If their images differ in size.
    ///
    /// # Panics
    /// If there is none.
    pub fn new(members: Vec<Draping>) -> Result<Self, ValueError> {
        let expected = members[0].shape();
        let size = |ImageShape { rows, columns }| format!("{rows} x {columns} pixels");
        for (k, member) in members.iter().enumerate() {
            let shape = member.shape();
            let found = format!("{} in member {k}", size(shape));
            ValueError::unless(shape == expected, "scenes", found, size(expected))?;
        }
        let mut family = Self(members);
        for (k, member) in family.0.iter_mut().enumerate() {
            member.set_scene_index(k as u16);
        }
        Ok(family)
    }

    /// The tasks of each scene.
    pub fn members(&self) -> &[Draping] {
        &self.0
    }

    /// The scene's tasks that task `index` is one of, and its number among them.
    pub fn place(&self, mut index: usize) -> (&Draping, usize) {
        for member in &self.0 {
            if index < member.count() {
                return (member, index);
            }
            index -= member.count();
        }
        panic!("there is no such task");
    }
}

/// What each member has saved.
#[derive(Serialize, Deserialize)]
struct Saved(Vec<Vec<u8>>);

impl Tasks for Family {
    fn shape(&self) -> ImageShape {
        self.0[0].shape()
    }

    fn count(&self) -> usize {
        self.0.iter().map(Draping::count).sum()
    }

    fn reward_scale(&self, index: usize) -> f32 {
        let (member, index) = self.place(index);
        member.reward_scale(index)
    }

    fn terrains(&self) -> Vec<&Terrain> {
        self.0.iter().flat_map(Draping::terrains).collect()
    }

    fn observation(&self, index: usize) -> &Observation {
        let (member, index) = self.place(index);
        member.observation(index)
    }

    fn last(&self, index: usize) -> &Observation {
        let (member, index) = self.place(index);
        member.last(index)
    }

    #[cfg(feature = "gpu")]
    fn sights(&self) -> Option<Vec<[super::look::Sight; 2]>> {
        let all = self.0.iter().map(Draping::sights);
        Some(all.collect::<Option<Vec<_>>>()?.concat())
    }

    fn step(&mut self, mut actions: &[u32]) -> Vec<StepOutcome> {
        assert_eq!(actions.len(), self.count(), "one action an environment");
        let mut outcomes = Vec::with_capacity(actions.len());
        for member in &mut self.0 {
            let (own, rest) = actions.split_at(member.count());
            outcomes.extend(member.step(own));
            actions = rest;
        }
        outcomes
    }

    fn save(&self) -> Vec<u8> {
        let saved = Saved(self.0.iter().map(Draping::save).collect());
        postcard::to_allocvec(&saved).expect("plain data is serialisable")
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        let Saved(saved) =
            postcard::from_bytes(bytes).map_err(|e| format!("not saved environments: {e}"))?;
        if saved.len() != self.0.len() {
            let (found, expected) = (saved.len(), self.0.len());
            return Err(format!("{found} scenes saved, expected {expected}"));
        }
        // All or nothing.
        let before: Vec<Vec<u8>> = self.0.iter().map(Draping::save).collect();
        for (k, saved) in saved.iter().enumerate() {
            if let Err(error) = self.0[k].load(saved) {
                for (member, before) in self.0.iter_mut().zip(&before) {
                    let restored = member.load(before);
                    restored.expect("tasks take back what they have saved");
                }
                return Err(error);
            }
        }
        Ok(())
    }
}
