//! Renderers against closed forms, oracles and each other. What runs on the GPU needs a
//! Vulkan, Metal or DirectX 12 adapter; a software one will do.
//!
//! One program of several files: each program costs a link of the whole library.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod estimators;
mod gpu;
mod gpu_query;
mod gpu_raster;
mod library;
mod needles;
mod occluders;
mod oracles;
mod screen_space;
mod smoothing;
