//! Tables, pictures, curves and films, drawn on the CPU without display, driver or system font.
//!
//! A [`Drawing`] of meshes and marks seen by a [`Camera`] becomes an [`Image`]; images stand
//! beside each other, carry labels and what their colours mean, and follow each other in a film
//! ([`save_gif`]). A [`Table`] has rows as text, Markdown, CSV and JSON, a [`Chart`] draws curves, a [`HeatMap`] a table of tiles. Files are written
//! atomically: whoever looks sees the old file or the new one.
//!
//! The rasteriser knows opaque, diffusely lit triangles under an orthographic camera: no shadows,
//! textures, transparency or perspective. Colours are 8-bit sRGB and are averaged as such.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod camera;
mod chart;
mod color;
mod drawing;
mod film;
mod heat;
mod image;
mod legend;
mod table;
mod text;

pub use camera::Camera;
pub use chart::{Band, Chart, Level, Scale, Series};
pub use color::{BACKGROUND, CLOTH, Color, ColorMap, DRAPED, PATH, SERIES, TOOL, TOUCHED};
pub use drawing::{CLOTH_BIAS, Drawing, creased};
pub use film::save_gif;
pub use heat::{HeatMap, Tile};
pub use image::Image;
pub use table::{Format, Table, TableOf, replace_tables};
