use fixedbitset::FixedBitSet;

use super::state::{ALLOWED, DRAPED, Pressed, TOUCHED};
use crate::fabric::Lamina;
use crate::math::bits;

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
}

impl View {
    /// An image in which some pixels, ascending, show a vertex each.
    pub fn new(
        pixel_count: usize,
        seen: impl Iterator<Item = (u32, u32)>,
        vertex_count: usize,
    ) -> Self {
        let (pixels, vertices): (Vec<u32>, Vec<u32>) = seen.unzip();
        Self {
            pixel_count,
            region: bits::set(vertex_count, vertices.iter().map(|&v| v as usize)),
            pixels,
            vertices,
        }
    }

    /// Marks an image by the rules of the task (paper, Section 4.2.1): a press is allowed on untouched
    /// vertices next to those that were pressed last or, if there are none, on all untouched ones. Gives
    /// how many these are.
    pub fn mark(&self, lamina: &Lamina, pressed: &Pressed, marks: &mut [u8]) -> usize {
        let near = pressed.stencil.iter().flat_map(|&v| lamina.neighbors(v));
        let near = bits::set(lamina.vertex_count(), near.map(|v| v as usize));
        let (mut untouched, mut beside) = (0, false);
        for (&pixel, &vertex) in self.pixels.iter().zip(&self.vertices) {
            let (mark, vertex) = (&mut marks[pixel as usize], vertex as usize);
            *mark = match pressed.draped.contains(vertex) {
                true => DRAPED,
                false => 0,
            };
            if pressed.touched.contains(vertex) {
                *mark |= TOUCHED;
                continue;
            }
            untouched += 1;
            if near.contains(vertex) {
                *mark |= ALLOWED;
                beside = true;
            }
        }
        if !beside {
            // The stroke is at its end: any untouched vertex of the region may begin a new one.
            for &pixel in &self.pixels {
                let mark = &mut marks[pixel as usize];
                if *mark & TOUCHED == 0 {
                    *mark |= ALLOWED;
                }
            }
        }
        untouched
    }
}
