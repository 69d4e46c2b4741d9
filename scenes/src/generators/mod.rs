//! Parametric shapes, one file a family. Every parameter is in metres and is
//! documented where it is declared; what a scene file may say is what these
//! structs hold.

mod arcade;
mod atrium;
mod block;
mod curtain;
mod plane;
mod polygons;
mod room;

pub use arcade::Arcade;
pub use atrium::{Atrium, Span, Whole};
pub use block::Block;
pub use curtain::Curtain;
pub use plane::Plane;
pub use polygons::Polygons;
pub use room::{Room, Window};

use crate::{Material, Mesh};
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
    /// Arcades round an open courtyard, with curtains.
    Atrium(Atrium),
    /// A room with one window.
    Room(Room),
    /// Triangles given one by one.
    Polygons(Polygons),
}

/// A piece of a shape. Most shapes have one; an atrium has many.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Told apart within its shape; empty where there is only one.
    pub name: String,
    /// Whether the shape itself knows it for a thin occluder.
    pub occluder: bool,
    /// Its own material; the object's where there is none.
    pub material: Option<Material>,
    /// The triangles.
    pub mesh: Mesh,
}

impl From<Mesh> for Vec<Part> {
    fn from(mesh: Mesh) -> Self {
        vec![Part { mesh, ..Part::default() }]
    }
}

impl Shape {
    /// Makes the triangles.
    ///
    /// # Errors
    /// A sentence that names the parameters that do not go together.
    pub fn parts(&self) -> Result<Vec<Part>, String> {
        Ok(match self {
            Shape::Plane(s) => s.mesh()?.into(),
            Shape::Block(s) => s.mesh()?.into(),
            Shape::Curtain(s) => s.mesh().into(),
            Shape::Arcade(s) => s.mesh().into(),
            Shape::Atrium(s) => s.parts()?,
            Shape::Room(s) => s.mesh()?.into(),
            Shape::Polygons(s) => s.mesh().into(),
        })
    }
}
