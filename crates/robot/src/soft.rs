//! What may be touched softly: cloth that stands off the tool.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::plan::Plan;
use super::workcell::Cell;

/// A press at which the arm pushes something soft aside.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Pushed {
    /// Of the path.
    pub point: usize,
    /// The part of the arm that is deepest in it.
    pub part: String,
    pub depth_mm: f64,
}

impl Cell {
    /// At which presses of a plan a part of the arm, other than the roller, is in something soft. `soft` gives places of it in
    /// the tool's frame [m] when a point of the path has been pressed.
    pub fn pushed<'a>(
        &self,
        plan: &Plan,
        soft: impl Fn(usize) -> &'a [Vector3<f64>] + Sync,
    ) -> Vec<Pushed> {
        let contacts: Vec<_> = plan.contacts().collect();
        let pushed = contacts.into_par_iter().filter_map(|(stroke, contact)| {
            let station = self.station(&plan.stations[stroke.station]);
            let tool = self.base * self.work_object(station);
            let places = soft(contact.point).iter();
            let places: Vec<_> = places
                .map(|p| (tool * nalgebra::Point3::from(*p)).coords)
                .collect();
            let (depth, part) = self
                .obstacles
                .deepest(&self.frames(&contact.joints), &places)?;
            Some(Pushed {
                point: contact.point,
                part: part.into(),
                depth_mm: 1e3 * depth,
            })
        });
        pushed.collect()
    }
}
