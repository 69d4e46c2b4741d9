//! Parametric shapes, one file a family. Every parameter is in metres and is
//! documented where it is declared; what a scene file may say is what these
//! structs hold.

mod arcade;
mod atrium;
mod banner;
mod blinds;
mod block;
mod cables;
mod crevice;
mod curtain;
mod fence;
mod leaves;
mod pillar;
mod place;
mod plane;
mod polygons;
mod ridge;
mod rings;
mod room;
mod sheet;
mod shelf;
mod sphere;
mod table;

pub use arcade::Arcade;
pub use atrium::Atrium;
pub use banner::Banner;
pub use blinds::Blinds;
pub use block::Block;
pub use cables::Cables;
pub use crevice::Crevice;
pub use curtain::{Curtain, Folds};
pub use fence::SlattedFence;
pub use leaves::{Leaves, Outline};
pub use pillar::{Collar, Pillar};
pub use place::At;
pub use plane::Plane;
pub use polygons::Polygons;
pub use ridge::Ridge;
pub use room::{Room, Window};
pub use shelf::Shelf;
pub use sphere::Sphere;
pub use table::Table;

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
    /// Cloth hanging from a rod.
    Banner(Banner),
    /// Upright slats in a row.
    SlattedFence(SlattedFence),
    /// Level slats over each other, tilted.
    Blinds(Blinds),
    /// A board against a wall.
    Shelf(Shelf),
    /// A top on four thin legs.
    Table(Table),
    /// Opaque cards scattered in a box of air.
    Leaves(Leaves),
    /// A bundle of round tubes along catenaries.
    Cables(Cables),
    /// A round pillar.
    Pillar(Pillar),
    /// Two boxes with a narrow slot.
    Crevice(Crevice),
    /// A sphere on or over the floor.
    Sphere(Sphere),
    /// A roof on the floor.
    Ridge(Ridge),
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

impl Part {
    /// A part that stays when the occluder is taken away.
    pub(crate) fn named(name: &str, mesh: Mesh) -> Self {
        Part { name: name.to_owned(), mesh, ..Part::default() }
    }

    /// A part that is a thin occluder by its nature.
    pub(crate) fn occluder(name: &str, mesh: Mesh) -> Self {
        Part { occluder: true, ..Part::named(name, mesh) }
    }
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
            Shape::Curtain(s) => family("curtain", s.mesh())?.into(),
            Shape::Arcade(s) => s.mesh().into(),
            Shape::Atrium(s) => s.parts()?,
            Shape::Room(s) => s.mesh()?.into(),
            Shape::Polygons(s) => s.mesh().into(),
            Shape::Banner(s) => s.parts(),
            Shape::SlattedFence(s) => family("slatted-fence", s.mesh())?.into(),
            Shape::Blinds(s) => family("blinds", s.mesh())?.into(),
            Shape::Shelf(s) => family("shelf", s.parts())?,
            Shape::Table(s) => family("table", s.parts())?,
            Shape::Leaves(s) => family("leaves", s.mesh())?.into(),
            Shape::Cables(s) => family("cables", s.mesh())?.into(),
            Shape::Pillar(s) => family("pillar", s.mesh())?.into(),
            Shape::Crevice(s) => s.mesh().into(),
            Shape::Sphere(s) => s.mesh().into(),
            Shape::Ridge(s) => s.mesh().into(),
        })
    }
}

/// Puts the family's name before its complaint.
fn family<T>(name: &str, made: Result<T, String>) -> Result<T, String> {
    made.map_err(|e| format!("{name}: {e}"))
}
