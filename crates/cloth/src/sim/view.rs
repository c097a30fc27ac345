use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::state::{ALLOWED, DRAPED, Pressed, STENCIL, TOUCHED};
use crate::fabric::Lamina;
use crate::math::bits;

/// Where a press is allowed, and when nothing is left to be pressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mask {
    /// On untouched vertices next to the last press or, if there are none, on all untouched ones, until there are none
    /// (paper, Section 4.2.1): strokes without jumps.
    #[default]
    Stroke,
    /// On all untouched vertices, until each of these is beside one that has been touched: presses about a stencil apart, in
    /// any order.
    Free,
}

/// What is seen of a blank, as an image, and measured: the vertices of a region.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Pixels of the image.
    pub pixel_count: usize,
    /// Pixels that show a vertex, ascending.
    pub pixels: Vec<u32>,
    /// The vertex that each of them shows.
    pub vertices: Vec<u32>,
    /// These vertices, one bit a vertex of the blank.
    pub region: FixedBitSet,
    pub mask: Mask,
}

impl View {
    /// An image in which some pixels, ascending, show a vertex each.
    pub fn new(
        pixel_count: usize,
        seen: impl Iterator<Item = (u32, u32)>,
        vertex_count: usize,
        mask: Mask,
    ) -> Self {
        let (pixels, vertices): (Vec<u32>, Vec<u32>) = seen.unzip();
        Self {
            pixel_count,
            region: bits::set(vertex_count, vertices.iter().map(|&v| v as usize)),
            pixels,
            vertices,
            mask,
        }
    }

    /// Marks an image by the rules of the task, see [`Mask`]. Gives how many vertices are left to be pressed.
    pub fn mark(&self, lamina: &Lamina, pressed: &Pressed, marks: &mut [u8]) -> usize {
        let last = match self.mask {
            Mask::Stroke => &pressed.stencil[..],
            Mask::Free => &[],
        };
        let near = last.iter().flat_map(|&v| lamina.neighbors(v));
        let near = bits::set(lamina.vertex_count(), near.map(|v| v as usize));
        let is_beside = |vertex: u32| {
            let mut beside = lamina.neighbors(vertex);
            self.mask == Mask::Free && beside.any(|v| pressed.touched.contains(v as usize))
        };
        let (mut left, mut beside) = (0, false);
        for (&pixel, &vertex) in self.pixels.iter().zip(&self.vertices) {
            let mark = &mut marks[pixel as usize];
            let is_last = pressed.stencil.binary_search(&vertex).is_ok();
            let v = vertex as usize;
            let bit = |is_set, bit| if is_set { bit } else { 0 };
            *mark = bit(pressed.draped.contains(v), DRAPED) | bit(is_last, STENCIL);
            if pressed.touched.contains(v) {
                *mark |= TOUCHED;
                continue;
            }
            left += usize::from(!is_beside(vertex));
            if near.contains(v) {
                *mark |= ALLOWED;
                beside = true;
            }
        }
        if !beside {
            // No stroke is to be gone on with: any untouched vertex of the region may begin a new one.
            for &pixel in &self.pixels {
                let mark = &mut marks[pixel as usize];
                if *mark & TOUCHED == 0 {
                    *mark |= ALLOWED;
                }
            }
        }
        left
    }
}
