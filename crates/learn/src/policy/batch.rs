use super::pixels::SEEN;
use burn::tensor::{Bool, Device, Int, Tensor, TensorData};
use drape_cloth::sim::{ALLOWED, DRAPED, Observation, Observations, STENCIL, TOUCHED};

/// Observations that a network is asked about.
pub enum Batch<'a> {
    /// Encoded on the host.
    Host(Vec<Observation<'a>>),
    /// Rows that are encoded on the network's device, and taken there if they are elsewhere.
    Device(Vec<(&'a Observations, usize)>),
}

impl Batch<'_> {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Host(rows) => rows.len(),
            Self::Device(rows) => rows.len(),
        }
    }
}

/// Observations as tensors on a device, one a row.
pub struct Images {
    /// [m] `[row, pixel]`
    distance: Tensor<2>,
    /// [`DRAPED`], [`TOUCHED`], [`ALLOWED`], [`STENCIL`] `[row, pixel]`
    marks: Tensor<2, Int>,
    /// `[row]`
    pub views: Vec<u16>,
}

impl Images {
    /// Some rows, of which there are some, on `device`.
    pub fn new(rows: &[(&Observations, usize)], device: &Device) -> Self {
        // Of each that rows are of, these and their numbers in the batch.
        let mut of_each: Vec<(&Observations, Vec<usize>, Vec<usize>)> = Vec::new();
        for (number, &(of, row)) in rows.iter().enumerate() {
            let is_same = |each: &(&Observations, _, _)| std::ptr::eq(each.0, of);
            let place = of_each.iter().position(is_same).unwrap_or_else(|| {
                of_each.push((of, Vec::new(), Vec::new()));
                of_each.len() - 1
            });
            of_each[place].1.push(row);
            of_each[place].2.push(number);
        }
        let parts = of_each
            .iter()
            .map(|(of, rows, _)| Self::of(of, rows, device));
        let all = Self::joined(parts.collect());
        let numbers = of_each.iter().flat_map(|(_, _, numbers)| numbers);
        let mut places = vec![0; rows.len()];
        for (place, &number) in numbers.enumerate() {
            places[number] = place;
        }
        all.select(&places)
    }

    /// Some rows of the same.
    fn of(seen: &Observations, rows: &[usize], device: &Device) -> Self {
        #[cfg(feature = "gpu")]
        if let Some((distance, marks)) = super::bridge::tensors(seen, device) {
            let all = Self {
                distance,
                marks,
                views: seen.views.to_vec(),
            };
            return all.select(rows);
        }
        let numbers = rows.iter().map(|&row| seen.row(row));
        let distance = numbers.clone().flat_map(|seen| seen.distance);
        let marks = numbers.clone().flat_map(|seen| seen.marks);
        let distance: Vec<f32> = distance.copied().collect();
        let marks: Vec<i32> = marks.map(|&mark| mark.into()).collect();
        let shape = [rows.len(), seen.pixel_count];
        Self {
            distance: Tensor::from_data(TensorData::new(distance, shape), device),
            marks: Tensor::from_data(TensorData::new(marks, shape), device),
            views: numbers.map(|seen| seen.view).collect(),
        }
    }

    fn joined(mut parts: Vec<Self>) -> Self {
        if parts.len() == 1 {
            return parts.remove(0);
        }
        let marks = parts.iter().map(|part| part.marks.clone()).collect();
        Self {
            views: parts.iter().flat_map(|part| part.views.clone()).collect(),
            marks: Tensor::cat(marks, 0),
            distance: Tensor::cat(parts.into_iter().map(|part| part.distance).collect(), 0),
        }
    }

    /// Some rows, in that order; not copied if they are all.
    fn select(self, rows: &[usize]) -> Self {
        if rows.iter().copied().eq(0..self.views.len()) {
            return self;
        }
        let numbers: Vec<i32> = rows.iter().map(|&row| row as i32).collect();
        let numbers = TensorData::new(numbers, [rows.len()]);
        let numbers = Tensor::<1, Int>::from_data(numbers, &self.distance.device());
        Self {
            distance: self.distance.select(0, numbers.clone()),
            marks: self.marks.select(0, numbers),
            views: rows.iter().map(|&row| self.views[row]).collect(),
        }
    }

    /// Actions not allowed `[row, pixel]`.
    pub fn invalid(&self) -> Tensor<2, Bool> {
        self.marks
            .clone()
            .bitwise_and_scalar(i32::from(ALLOWED))
            .equal_elem(0)
    }

    /// Draped, distance, touched, allowed, under the last press, each `[row, pixel]`; `scale` is 1 / m.
    pub fn planes(&self, scale: f32) -> [Tensor<2>; SEEN] {
        let plane = |bit: u8| {
            let marked = self.marks.clone().bitwise_and_scalar(i32::from(bit));
            marked.not_equal_elem(0).float()
        };
        let distance = self.distance.clone() * scale;
        [
            plane(DRAPED),
            distance,
            plane(TOUCHED),
            plane(ALLOWED),
            plane(STENCIL),
        ]
    }
}

#[cfg(test)]
mod tests;
