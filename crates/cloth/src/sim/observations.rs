use std::ops::Range;
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[cfg(feature = "gpu")]
use super::gpu::Buffer;
use super::state::ALLOWED;

/// A number of a [`Column`].
pub trait Number: Copy + Send + Sync + 'static {
    /// As a GPU has it, in four bytes.
    fn of_device(bytes: [u8; 4]) -> Self;
}

impl Number for f32 {
    fn of_device(bytes: [u8; 4]) -> Self {
        Self::from_le_bytes(bytes)
    }
}

impl Number for f64 {
    fn of_device(bytes: [u8; 4]) -> Self {
        f32::from_le_bytes(bytes).into()
    }
}

impl Number for u8 {
    fn of_device(bytes: [u8; 4]) -> Self {
        bytes[0]
    }
}

/// Numbers of environments, `[environment, ...]`, on the device where they were found. Copies share
/// them.
#[derive(Clone, Debug)]
pub struct Column<T> {
    host: Arc<OnceLock<Vec<T>>>,
    #[cfg(feature = "gpu")]
    device: Option<Buffer>,
}

impl<T: Number> Column<T> {
    /// Numbers on the host.
    pub fn on_host(numbers: Vec<T>) -> Self {
        Self {
            host: Arc::new(OnceLock::from(numbers)),
            #[cfg(feature = "gpu")]
            device: None,
        }
    }

    /// Numbers on a GPU.
    #[cfg(feature = "gpu")]
    pub(super) fn on_device(buffer: Buffer) -> Self {
        Self {
            host: Arc::default(),
            device: Some(buffer),
        }
    }

    /// Where they are on a GPU, if they are.
    #[cfg(feature = "gpu")]
    pub fn device(&self) -> Option<&Buffer> {
        self.device.as_ref()
    }

    /// The numbers on the host, fetched when they are first asked for.
    pub fn host(&self) -> &[T] {
        self.host.get_or_init(|| {
            #[cfg(feature = "gpu")]
            if let Some(buffer) = &self.device {
                let bytes = buffer.read();
                let words = bytes.as_chunks().0.iter();
                return words.map(|&word| T::of_device(word)).collect();
            }
            unreachable!("numbers are somewhere")
        })
    }

    /// Pieces of some columns, one after the other, on the GPU if they are all there.
    fn gather(pieces: &[(&Self, Range<usize>)]) -> Self {
        #[cfg(feature = "gpu")]
        {
            let there = |(column, range): &(&Self, Range<usize>)| {
                Some((column.device.clone()?, range.clone()))
            };
            let there: Option<Vec<_>> = pieces.iter().map(there).collect();
            if let Some(pieces) = there.filter(|pieces| !pieces.is_empty()) {
                return Self::on_device(Buffer::gather(&pieces));
            }
        }
        let numbers = pieces
            .iter()
            .flat_map(|(column, range)| &column.host()[range.clone()]);
        Self::on_host(numbers.copied().collect())
    }

    fn joined(columns: &[&Self]) -> Self {
        let whole = columns.iter().map(|column| (*column, 0..column.len()));
        Self::gather(&whole.collect::<Vec<_>>())
    }

    fn len(&self) -> usize {
        #[cfg(feature = "gpu")]
        if let Some(buffer) = &self.device {
            return buffer.len();
        }
        self.host().len()
    }

    /// Some of them, in this order, on the host; of a GPU no more is fetched.
    fn pick(&self, places: &[u32]) -> Vec<T> {
        #[cfg(feature = "gpu")]
        if let (None, Some(buffer)) = (self.host.get(), &self.device) {
            return Self::on_device(buffer.pick(places)).host().to_vec();
        }
        let numbers = self.host();
        places.iter().map(|&at| numbers[at as usize]).collect()
    }
}

/// What is seen of environments and may be done there (paper, Sections 4.1.1 and 4.2.1), one a row.
#[derive(Clone, Debug)]
pub struct Observations {
    /// `[row]`: number of its view.
    pub views: Arc<[u16]>,
    /// Distance to the tool [m], 0 inside and where there is no vertex `[row, pixel]`.
    pub distance: Column<f32>,
    /// Bits [`TOUCHED`](super::TOUCHED), [`DRAPED`](super::DRAPED), [`STENCIL`](super::STENCIL) and [`ALLOWED`]
    /// `[row, pixel]`.
    pub marks: Column<u8>,
    /// Pixels of a row.
    pub pixel_count: usize,
}

/// A row of [`Observations`] on the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation<'a> {
    /// Number of its view.
    pub view: u16,
    /// Distance to the tool [m] `[pixel]`.
    pub distance: &'a [f32],
    /// See [`Observations::marks`] `[pixel]`.
    pub marks: &'a [u8],
}

impl Observations {
    /// Some on the host.
    ///
    /// # Panics
    /// If sizes do not fit.
    pub fn new(views: Vec<u16>, distance: Vec<f32>, marks: Vec<u8>) -> Self {
        let pixel_count = distance.len() / views.len().max(1);
        assert_eq!(
            [distance.len(), marks.len()],
            [views.len() * pixel_count; 2]
        );
        Self {
            views: views.into(),
            distance: Column::on_host(distance),
            marks: Column::on_host(marks),
            pixel_count,
        }
    }

    /// Whether they are on a GPU.
    pub fn is_on_device(&self) -> bool {
        #[cfg(feature = "gpu")]
        return self.distance.device().is_some();
        #[cfg(not(feature = "gpu"))]
        false
    }

    /// A row on the host. All are fetched when one is first asked for.
    pub fn row(&self, row: usize) -> Observation<'_> {
        let pixels = row * self.pixel_count..(row + 1) * self.pixel_count;
        Observation {
            view: self.views[row],
            distance: &self.distance.host()[pixels.clone()],
            marks: &self.marks.host()[pixels],
        }
    }

    /// All rows on the host.
    pub fn rows(&self) -> impl Iterator<Item = Observation<'_>> {
        (0..self.views.len()).map(|row| self.row(row))
    }

    /// Whether actions are allowed, one a row; no more is fetched.
    pub fn allow(&self, actions: &[u32]) -> Vec<bool> {
        let places = actions.iter().enumerate();
        let places = places.map(|(row, action)| (row * self.pixel_count) as u32 + action);
        let inside = |action: &u32| (*action as usize) < self.pixel_count;
        match actions.iter().all(inside) {
            true => {
                let marks = self.marks.pick(&places.collect::<Vec<_>>());
                marks.into_iter().map(|mark| mark & ALLOWED != 0).collect()
            }
            false => actions.iter().map(inside).collect(),
        }
    }

    /// All rows of some, on the GPU if they are all there.
    ///
    /// # Panics
    /// If there is none.
    pub fn joined(mut all: Vec<Self>) -> Self {
        if all.len() == 1 {
            return all.remove(0);
        }
        Self {
            views: all.iter().flat_map(|one| one.views.to_vec()).collect(),
            distance: Column::joined(&all.iter().map(|one| &one.distance).collect::<Vec<_>>()),
            marks: Column::joined(&all.iter().map(|one| &one.marks).collect::<Vec<_>>()),
            pixel_count: all[0].pixel_count,
        }
    }

    /// Rows of several, on the host; no more is fetched.
    pub fn gather<'a>(rows: impl Iterator<Item = (&'a Self, usize)>) -> Self {
        let (mut views, mut distance, mut marks) = (Vec::new(), Vec::new(), Vec::new());
        for (of, row) in rows {
            let first = row * of.pixel_count;
            views.push(of.views[row]);
            distance.push((&of.distance, first..first + of.pixel_count));
            marks.push((&of.marks, first..first + of.pixel_count));
        }
        let (distance, marks) = (Column::gather(&distance), Column::gather(&marks));
        Self::new(views, distance.host().to_vec(), marks.host().to_vec())
    }
}

impl<'a> Observation<'a> {
    /// Whether an action is allowed.
    pub fn allows(self, action: u32) -> bool {
        let mark = self.marks.get(action as usize);
        mark.is_some_and(|mark| mark & ALLOWED != 0)
    }

    /// The allowed actions, ascending; there is one at least until all vertices are touched.
    pub fn allowed(self) -> impl Iterator<Item = u32> + Clone + use<'a> {
        let pixels = self.marks.iter().enumerate();
        let allowed = pixels.filter(|(_, mark)| **mark & ALLOWED != 0);
        allowed.map(|(pixel, _)| pixel as u32)
    }
}

impl PartialEq for Observations {
    fn eq(&self, other: &Self) -> bool {
        self.rows().eq(other.rows())
    }
}

impl Serialize for Observations {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (&*self.views, self.distance.host(), self.marks.host()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Observations {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (views, distance, marks) = Deserialize::deserialize(deserializer)?;
        let (views, distance, marks): (Vec<u16>, Vec<f32>, Vec<u8>) = (views, distance, marks);
        let (rows, pixels) = (views.len().max(1), distance.len());
        match marks.len() == pixels && pixels.is_multiple_of(rows) {
            true => Ok(Self::new(views, distance, marks)),
            false => Err(serde::de::Error::custom("images of unequal size")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Observations {
        Observations::new(vec![0, 3], vec![0.5, 0.0, 0.25, 1.0], vec![8, 1, 9, 0])
    }

    #[test]
    fn rows_are_seen_gathered_and_kept() {
        let all = two();
        let row = all.row(1);
        assert_eq!(
            (row.view, row.distance, row.marks),
            (3, &[0.25, 1.0][..], &[9, 0][..])
        );
        assert!(row.allows(0) && !row.allows(1) && !row.allows(2));
        assert!(row.allowed().eq([0]));
        let gathered = Observations::gather([(&all, 1), (&all, 0), (&all, 1)].into_iter());
        assert!(gathered.rows().eq([all.row(1), all.row(0), all.row(1)]));
        let bytes = postcard::to_allocvec(&all).unwrap();
        assert_eq!(postcard::from_bytes::<Observations>(&bytes).unwrap(), all);
    }

    #[test]
    fn what_is_not_allowed_is_told() {
        assert_eq!(two().allow(&[0, 0]), [true, true]);
        assert_eq!(two().allow(&[1, 0]), [false, true]);
        assert_eq!(two().allow(&[0, 2]), [true, false]);
    }

    #[test]
    fn damaged_images_are_refused() {
        let damaged = (vec![0u16, 1], vec![0f32; 3], vec![0u8; 3]);
        let bytes = postcard::to_allocvec(&damaged).unwrap();
        assert!(postcard::from_bytes::<Observations>(&bytes).is_err());
    }
}
