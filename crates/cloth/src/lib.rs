//! Woven fabric on a curved tool.
//!
//! A [`tool`] is a signed distance; a [`fabric`] is a rest shape, its masses and a material law.
//! [`measure`] tells how well it lies there.
//! [`sim`] moves many of them at once by substep XPBD with a direct solve along every yarn;
//! [`twin`] is a slow finite-element model of the same case to hold it against; a [`scene`] lets
//! a blank fall on to a tool. A module uses only those above it in this list: [`file`],
//! [`math`], [`mesh`], [`tool`], [`fabric`], [`measure`], [`sim`], [`twin`], [`scene`].

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod fabric;
pub mod file;
pub mod math;
pub mod measure;
pub mod mesh;
pub mod scene;
pub mod sim;
pub mod tool;
pub mod twin;
