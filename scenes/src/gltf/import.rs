//! From bytes to objects.

use super::{
    Imported,
    accessor::{Accessors, Budget},
    bytes::{Buffers, Files},
    container,
    document::{Document, Primitive, get, label},
    graph::{self, Placed},
    material::{Prepared, Wardrobe},
    names::{self, Emptied, Unique},
    punctual, views,
};
use crate::{Mesh, Object, mesh::has_area};
use glam::{DMat3, DMat4, Vec2, Vec3};
use std::path::Path;

/// Most primitives without triangles that are remembered.
const MOST_EMPTIED: usize = 4096;

/// Reads a whole file.
pub(super) fn read(bytes: &[u8], folder: Option<&Path>, scale: f32) -> Result<Imported, String> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(format!("it cannot be read at a scale of {scale}: give metres per unit, above 0"));
    }
    let container = container::open(bytes)?;
    let document = Document::parse(container.json)?;
    let files = Files::new(folder);
    let buffers = Buffers::load(&document, container.bin, &files)?;
    let budget = Budget::new();
    let mut reader = Reader {
        document: &document,
        accessors: Accessors { document: &document, buffers: &buffers, budget: &budget },
        wardrobe: Wardrobe::new(&document, &buffers, &files),
        unique: Unique::default(),
        out: Imported::default(),
    };
    graph::walk(&document, scale, |placed| reader.visit(placed, scale))?;
    let out = reader.out;
    if out.objects.is_empty() {
        return Err(format!("it has no triangles{}", out.emptied(|_| true)));
    }
    Ok(out)
}

struct Reader<'a> {
    document: &'a Document,
    accessors: Accessors<'a>,
    wardrobe: Wardrobe<'a>,
    unique: Unique,
    out: Imported,
}

impl Reader<'_> {
    fn visit(&mut self, placed: &Placed<'_>, scale: f32) -> Result<(), String> {
        if let Some(index) = placed.node.camera {
            let def = get(&self.document.cameras, index, "camera", &placed.label())?;
            let camera = punctual::camera(def, index, placed, scale)?;
            views::read(def, index, &camera, &mut self.out)?;
            self.out.cameras.push(camera);
        }
        if let Some(light) = &placed.node.extensions.light {
            let lights = self.document.extensions.lights.as_ref().map_or(&[][..], |l| &l.lights);
            let def = get(lights, light.light, "light", &placed.label())?;
            self.out.lights.push(punctual::light(def, light.light, placed, scale)?);
        }
        match placed.node.mesh {
            Some(index) => self.mesh(placed, index),
            None => Ok(()),
        }
    }

    fn mesh(&mut self, placed: &Placed<'_>, index: usize) -> Result<(), String> {
        let def = get(&self.document.meshes, index, "mesh", &placed.label())?;
        let this = label("mesh", index, def.name.as_deref());
        let occluder = names::marked(placed.node.extras.as_ref()) || names::marked(def.extras.as_ref());
        for (k, primitive) in def.primitives.iter().enumerate() {
            // Points and lines are no surface.
            if primitive.mode < 4 {
                self.empty(placed, [def.name.as_deref(), None], &this, 0);
                continue;
            }
            let this = if def.primitives.len() > 1 { format!("{this}, primitive {k}") } else { this.clone() };
            let worn = self.wardrobe.get(primitive.material, &this)?;
            let mesh = self.primitive(primitive, &worn, &this)?;
            let triangles = mesh.triangles.len();
            let Some(mesh) = self.place(mesh, &worn, placed).map_err(|e| format!("{}, {this}: {e}", placed.label()))?
            else {
                self.empty(placed, [def.name.as_deref(), worn.material.name.as_deref()], &this, triangles);
                continue;
            };
            let mut name = placed.node.name.clone().or(def.name.clone()).unwrap_or(format!("node{}", placed.index));
            if def.primitives.len() > 1 {
                name = format!("{name}.{}", worn.material.name.as_deref().map_or_else(|| k.to_string(), str::to_owned));
            }
            let name = self.unique.name(&name);
            let also = def.name.as_deref().into_iter().chain(worn.material.name.as_deref()).chain([name.as_str()]);
            self.out.names.push(placed.names.iter().cloned().chain(also.map(Into::into)).collect());
            self.out.objects.push(Object { name, occluder, material: worn.material.clone(), mesh });
        }
        Ok(())
    }

    /// Remembers a primitive that becomes no object; `also` are its mesh's and
    /// its material's name.
    fn empty(&mut self, placed: &Placed<'_>, also: [Option<&str>; 2], label: &str, triangles: usize) {
        // A small file may place such a thing a great many times.
        if self.out.emptied.len() == MOST_EMPTIED {
            return;
        }
        let names = placed.names.iter().cloned().chain(also.into_iter().flatten().map(Into::into));
        // What has no name at all is still told of.
        let names = names.chain(std::iter::once(label.into())).collect();
        self.out.emptied.push(Emptied { label: label.to_owned(), triangles, names });
    }

    /// The triangles of a primitive, where its mesh has them.
    fn primitive(&self, primitive: &Primitive, worn: &Prepared, this: &str) -> Result<Mesh, String> {
        let attribute = |name: &str| {
            let index = primitive.attributes.get(name);
            index.copied().ok_or_else(|| format!("{this} has no attribute {name}"))
        };
        let positions: Vec<Vec3> =
            self.accessors.floats(attribute("POSITION")?, this)?.into_iter().map(Vec3::from_array).collect();
        let indices = match primitive.indices {
            Some(index) => self.accessors.indices(index, this)?,
            None => {
                self.accessors.budget.take(positions.len() as u64)?;
                (0..positions.len() as u32).collect()
            }
        };
        let mesh = Mesh {
            triangles: triangles(&indices, primitive.mode).map_err(|e| format!("{this}: {e}"))?,
            uvs: match &worn.coordinates {
                None => Vec::new(),
                Some(c) => {
                    let uvs = self.accessors.floats(attribute(&c.attribute)?, this)?.into_iter().map(Vec2::from_array);
                    uvs.map(|uv| c.map.map_or(uv, |m| m.transform_point2(uv))).collect()
                }
            },
            positions,
        };
        if let Some(i) = mesh.uvs.iter().position(|uv| !uv.is_finite()) {
            return Err(format!("{this}: texture coordinate {i} is not a finite number"));
        }
        mesh.validate().map_err(|e| format!("{this}: {e}"))?;
        Ok(mesh)
    }

    /// The mesh in the world, without what has no area and what is cut out; None
    /// where nothing is left.
    fn place(&mut self, mut mesh: Mesh, worn: &Prepared, placed: &Placed<'_>) -> Result<Option<Mesh>, String> {
        // Not even the sign of a zero changes where nothing is to be moved.
        if placed.world != DMat4::IDENTITY {
            for p in &mut mesh.positions {
                *p = placed.world.transform_point3(p.as_dvec3()).as_vec3();
            }
            if DMat3::from_mat4(placed.world).determinant() < 0.0 {
                mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            }
        }
        if let Some(p) = mesh.positions.iter().find(|p| !p.is_finite()) {
            return Err(format!("its transform moves a vertex to {p}"));
        }
        let before = mesh.triangles.len();
        mesh.triangles.retain(|t| has_area(t.map(|i| mesh.positions[i as usize])));
        self.out.degenerate += before - mesh.triangles.len();
        if let Some(mask) = &worn.mask {
            mesh = mask.cut(&mesh, self.accessors.budget)?;
        }
        Ok((!mesh.triangles.is_empty()).then_some(mesh))
    }
}

/// Triangles of a list, a strip or a fan.
fn triangles(indices: &[u32], mode: u32) -> Result<Vec<[u32; 3]>, String> {
    if mode > 6 {
        return Err(format!("its mode is {mode}, which glTF does not know"));
    }
    let n = indices.len();
    if n < 3 || (mode == 4 && !n.is_multiple_of(3)) {
        return Err(format!("{n} indices do not make whole triangles"));
    }
    Ok(match mode {
        4 => indices.as_chunks::<3>().0.to_vec(),
        // Every second triangle of a strip is turned round.
        5 => (indices.windows(3).enumerate())
            .filter_map(|(i, w)| {
                <[u32; 3]>::try_from(w).ok().map(|[a, b, c]| if i % 2 == 0 { [a, b, c] } else { [a, c, b] })
            })
            .collect(),
        _ => indices[1..]
            .windows(2)
            .filter_map(|w| <[u32; 2]>::try_from(w).ok().map(|[b, c]| [b, c, indices[0]]))
            .collect(),
    })
}
