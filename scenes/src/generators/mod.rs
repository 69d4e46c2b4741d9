//! Parametric shapes, one file a family. Every parameter is in metres and is
//! documented where it is declared; what a scene file may say is what these
//! structs hold.

mod arcade;
mod block;
mod curtain;
mod plane;
mod polygons;
mod room;

pub use arcade::Arcade;
pub use block::Block;
pub use curtain::Curtain;
pub use plane::Plane;
pub use polygons::Polygons;
pub use room::{Room, Window};

use crate::Mesh;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A shape by its family and parameters.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A rectangle.
    Plane(Plane),
    /// A closed, axis-aligned box.
    Block(Block),
    /// A hanging sheet.
    Curtain(Curtain),
    /// A covered walk beside a courtyard.
    Arcade(Arcade),
    /// A room with one window.
    Room(Room),
    /// Triangles given one by one.
    Polygons(Polygons),
}

impl Shape {
    /// Makes the triangles.
    ///
    /// # Errors
    /// A sentence that names the parameters that do not go together.
    pub fn mesh(&self) -> Result<Mesh, String> {
        match self {
            Shape::Plane(s) => s.mesh(),
            Shape::Block(s) => s.mesh(),
            Shape::Curtain(s) => Ok(s.mesh()),
            Shape::Arcade(s) => Ok(s.mesh()),
            Shape::Room(s) => s.mesh(),
            Shape::Polygons(s) => Ok(s.mesh()),
        }
    }
}
