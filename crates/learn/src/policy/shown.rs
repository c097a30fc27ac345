use burn::tensor::{Bool, Device, Int, Tensor, TensorData};
use drape_task::env::{ALLOWED, DRAPED, Observation, TOUCHED};

/// Observations on the device that computes the network, one a row.
#[derive(Clone, Debug)]
pub struct Shown {
    /// [m] `[row, pixel]`
    distance: Tensor<2>,
    /// [`DRAPED`], [`TOUCHED`], [`ALLOWED`] `[row, pixel]`
    marks: Tensor<2, Int>,
    /// `[row]`
    scenes: Vec<u16>,
}

impl Shown {
    /// Takes observations there.
    pub fn upload(observations: &[&Observation], device: &Device) -> Self {
        let rows = observations.len();
        let pixels = observations.first().map_or(0, |seen| seen.distance.len());
        let distance: Vec<f32> = (observations.iter())
            .flat_map(|seen| seen.distance.iter().copied())
            .collect();
        let marks: Vec<i32> = (observations.iter())
            .flat_map(|seen| seen.marks())
            .map(|mark| mark as i32)
            .collect();
        Self {
            distance: Tensor::from_data(TensorData::new(distance, [rows, pixels]), device),
            marks: Tensor::from_data(TensorData::new(marks, [rows, pixels]), device),
            scenes: observations.iter().map(|seen| seen.scene).collect(),
        }
    }

    /// What tasks show on a GPU, without a copy; none if that is not `device`.
    #[cfg(feature = "gpu")]
    pub fn of(sights: &[drape_task::env::Sight], device: &Device) -> Option<Self> {
        let all = sights.iter().map(|sight| {
            let there = super::device::of_burn(&sight.adapter);
            (there == *device).then(|| Self {
                distance: super::bridge::floats(sight, &sight.distance),
                marks: super::bridge::whole_numbers(sight, &sight.marks),
                scenes: vec![sight.scene; sight.shape[0]],
            })
        });
        Some(Self::cat(all.collect::<Option<Vec<_>>>()?))
    }

    /// All rows of all `parts`, of which there are some.
    pub fn cat(mut parts: Vec<Self>) -> Self {
        if parts.len() == 1 {
            return parts.swap_remove(0);
        }
        let marks = parts.iter().map(|part| part.marks.clone()).collect();
        let scenes = parts.iter().flat_map(|part| part.scenes.iter().copied());
        Self {
            scenes: scenes.collect(),
            marks: Tensor::cat(marks, 0),
            distance: Tensor::cat(parts.into_iter().map(|part| part.distance).collect(), 0),
        }
    }

    /// Some rows, in that order; not copied if they are all.
    pub fn select(&self, rows: &[usize]) -> Self {
        if rows.iter().copied().eq(0..self.scenes.len()) {
            return self.clone();
        }
        let numbers: Vec<i32> = rows.iter().map(|&row| row as i32).collect();
        let numbers = TensorData::new(numbers, [rows.len()]);
        let numbers = Tensor::<1, Int>::from_data(numbers, &self.distance.device());
        Self {
            distance: self.distance.clone().select(0, numbers.clone()),
            marks: self.marks.clone().select(0, numbers),
            scenes: rows.iter().map(|&row| self.scenes[row]).collect(),
        }
    }

    /// Which of the terrains the vertices of each row lie on.
    pub fn scenes(&self) -> &[u16] {
        &self.scenes
    }

    /// Where they are.
    pub fn device(&self) -> Device {
        self.distance.device()
    }

    /// Pixels of all rows.
    pub fn size(&self) -> usize {
        self.distance.dims().iter().product()
    }

    /// The same on the host.
    pub fn fetch(&self) -> Vec<Observation> {
        let [_, pixels] = self.distance.dims();
        let distance = self.distance.to_data().try_into_vec::<f32>();
        let marks = self.marks.to_data().convert::<i32>().try_into_vec::<i32>();
        let distance = distance.expect("distances are f32");
        let marks: Vec<u32> = (marks.expect("marks are i32").into_iter())
            .map(|mark| mark as u32)
            .collect();
        let rows = distance.chunks(pixels).zip(marks.chunks(pixels));
        let rows = rows.zip(&self.scenes);
        rows.map(|((distance, marks), &scene)| {
            Observation::of_marks(scene, distance.to_vec(), marks)
        })
        .collect()
    }

    /// Actions not allowed `[row, pixel]`.
    pub fn invalid(&self) -> Tensor<2, Bool> {
        self.marks
            .clone()
            .bitwise_and_scalar(ALLOWED as i32)
            .equal_elem(0)
    }

    /// Draped, distance, touched, allowed, each `[row, pixel]`; `scale` is 1 / m.
    pub fn planes(&self, scale: f32) -> [Tensor<2>; 4] {
        let plane = |bit: u32| {
            let marked = self.marks.clone().bitwise_and_scalar(bit as i32);
            marked.not_equal_elem(0).float()
        };
        let distance = self.distance.clone() * scale;
        [plane(DRAPED), distance, plane(TOUCHED), plane(ALLOWED)]
    }
}
