//! The tree of nodes: checked to be one, then walked.

use super::document::{Document, Node, get, label};
use glam::{DMat4, DQuat, DVec3, DVec4};
use std::sync::Arc;

/// Deepest nesting of nodes. Deeper ones are mistakes, and would let a small
/// file stand for a great deal of work.
const DEEPEST: usize = 128;

/// A node of the scene with its place in the world.
pub(super) struct Placed<'a> {
    pub index: usize,
    pub node: &'a Node,
    /// From the node to the world, metres.
    pub world: DMat4,
    /// Its name and those of the nodes above it.
    pub names: Vec<Arc<str>>,
}

impl Placed<'_> {
    pub(super) fn label(&self) -> String {
        label("node", self.index, self.node.name.as_deref())
    }
}

/// Calls `visit` for every node of the scene, parents first and in file order.
pub(super) fn walk(
    document: &Document,
    scale: f32,
    mut visit: impl FnMut(&Placed<'_>) -> Result<(), String>,
) -> Result<(), String> {
    let nodes = &document.nodes;
    let parents = parents(nodes)?;
    let mut stack: Vec<(usize, DMat4, Vec<Arc<str>>, usize)> = Vec::new();
    let root = if scale == 1.0 { DMat4::IDENTITY } else { DMat4::from_scale(DVec3::splat(scale.into())) };
    for &i in roots(document, &parents)?.iter().rev() {
        stack.push((i, root, Vec::new(), 1));
    }
    while let Some((index, above, mut names, depth)) = stack.pop() {
        let node = get(nodes, index, "node", "the scene")?;
        let this = label("node", index, node.name.as_deref());
        if depth > DEEPEST {
            return Err(format!("{this} is nested more than {DEEPEST} deep"));
        }
        let local = transform(node).map_err(|e| format!("{this}: {e}"))?;
        // Not even the sign of a zero changes where nothing is above.
        let world = if above == DMat4::IDENTITY { local } else { above * local };
        if !world.is_finite() {
            return Err(format!("{this}: its transform is too large"));
        }
        if let Some(name) = &node.name {
            names.push(name.as_str().into());
        }
        for &child in node.children.iter().rev() {
            stack.push((child, world, names.clone(), depth + 1));
        }
        visit(&Placed { index, node, world, names })?;
    }
    Ok(())
}

/// The parent of every node; two parents or a cycle are an error, also outside
/// the scene that is read.
fn parents(nodes: &[Node]) -> Result<Vec<Option<usize>>, String> {
    let name = |i: usize| label("node", i, nodes.get(i).and_then(|n| n.name.as_deref()));
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            get(nodes, child, "child node", &name(i))?;
            if let Some(other) = parents[child].replace(i) {
                return Err(format!("{} is a child of {} and of {}", name(child), name(other), name(i)));
            }
        }
    }
    // With one parent each at most, what no parentless node reaches runs in a circle.
    let mut reached = vec![false; nodes.len()];
    let mut stack: Vec<usize> = (0..nodes.len()).filter(|&i| parents[i].is_none()).collect();
    while let Some(i) = stack.pop() {
        reached[i] = true;
        stack.extend(&nodes[i].children);
    }
    match reached.iter().position(|r| !r) {
        Some(i) => Err(format!("{} is its own ancestor: nodes must not run in a circle", name(i))),
        None => Ok(parents),
    }
}

/// The nodes a walk begins at.
fn roots(document: &Document, parents: &[Option<usize>]) -> Result<Vec<usize>, String> {
    let scene = match document.scene {
        Some(index) => Some(get(&document.scenes, index, "scene", "the file")?),
        None => document.scenes.first(),
    };
    let Some(scene) = scene else {
        return Ok((0..parents.len()).filter(|&i| parents[i].is_none()).collect());
    };
    let mut seen = vec![false; parents.len()];
    for &root in &scene.nodes {
        let name = label("node", root, get(&document.nodes, root, "node", "the scene")?.name.as_deref());
        if parents[root].is_some() {
            return Err(format!("{name} is a root of the scene and also a child of another node"));
        }
        if std::mem::replace(&mut seen[root], true) {
            return Err(format!("{name} is listed twice as a root of the scene"));
        }
    }
    Ok(scene.nodes.clone())
}

/// A node's own transform.
fn transform(node: &Node) -> Result<DMat4, String> {
    let trs = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
    if let Some(m) = node.matrix {
        if trs {
            return Err("it has a matrix and also a translation, rotation or scale".into());
        }
        let matrix = DMat4::from_cols_array(&m.map(f64::from));
        let affine = (matrix.row(3) - DVec4::W).abs().max_element() < 1e-6;
        // A comparison with NaN is false, so this also refuses what is not finite.
        return if affine && matrix.is_finite() {
            Ok(matrix)
        } else {
            Err("its matrix must be finite and end in the row 0 0 0 1".into())
        };
    }
    if !trs {
        return Ok(DMat4::IDENTITY);
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]).map(f64::from));
    let length = rotation.length();
    if !length.is_finite() || length < 1e-6 {
        return Err("its rotation is no quaternion of length 1".into());
    }
    let vector = |v: Option<[f32; 3]>, default: f32| DVec3::from_array(v.unwrap_or([default; 3]).map(f64::from));
    let (scale, translation) = (vector(node.scale, 1.0), vector(node.translation, 0.0));
    if !scale.is_finite() || !translation.is_finite() {
        return Err("its translation and scale must be finite".into());
    }
    Ok(DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation))
}
