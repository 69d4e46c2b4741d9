//! Numbers out of bytes. Every count and stride is held against the bytes that
//! are there before anything is allocated or read.

use super::{
    bytes::Buffers,
    document::{Accessor, Document, get, label},
};
use std::cell::Cell;

/// Most elements (vertices and indices) that one import may make. A small file
/// may place one mesh in a great many nodes, so the bytes alone are no bound.
const MOST_ELEMENTS: u64 = 1 << 26;

/// Most elements of a sparse accessor that has no bytes under it.
const MOST_UNBACKED: u64 = 1 << 20;

/// What is left of the elements that an import may make.
pub(super) struct Budget(Cell<u64>);

impl Budget {
    pub(super) fn new() -> Self {
        Budget(Cell::new(MOST_ELEMENTS))
    }

    pub(super) fn take(&self, count: u64) -> Result<(), String> {
        let left = self.0.get().checked_sub(count);
        self.0.set(left.ok_or_else(|| format!("it has more than {MOST_ELEMENTS} vertices and indices in all"))?);
        Ok(())
    }
}

/// A number in a buffer.
#[derive(Clone, Copy, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32, asker: &str) -> Result<Self, String> {
        Ok(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return Err(format!("{asker} has the unknown componentType {code}")),
        })
    }

    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The number at the beginning of `b`; zero where `b` is too short, which
    /// [`Elements`] rules out.
    fn float(self, b: &[u8], normalized: bool) -> f32 {
        // The signed ranges reach one further below zero than above; glTF cuts it off.
        let scaled = |v: f32, max: f32| if normalized { (v / max).max(-1.0) } else { v };
        match self {
            Component::I8 => scaled(f32::from(i8::from_le_bytes(first(b))), 127.0),
            Component::U8 => scaled(f32::from(u8::from_le_bytes(first(b))), 255.0),
            Component::I16 => scaled(f32::from(i16::from_le_bytes(first(b))), 32767.0),
            Component::U16 => scaled(f32::from(u16::from_le_bytes(first(b))), 65535.0),
            Component::U32 => u32::from_le_bytes(first(b)) as f32,
            Component::F32 => f32::from_le_bytes(first(b)),
        }
    }

    fn index(self, b: &[u8]) -> Option<u32> {
        match self {
            Component::U8 => Some(u8::from_le_bytes(first(b)).into()),
            Component::U16 => Some(u16::from_le_bytes(first(b)).into()),
            Component::U32 => Some(u32::from_le_bytes(first(b))),
            _ => None,
        }
    }
}

fn first<const N: usize>(b: &[u8]) -> [u8; N] {
    b.first_chunk().copied().unwrap_or([0; N])
}

/// Elements that are known to lie within their bytes.
struct Elements<'b> {
    bytes: &'b [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'b> Elements<'b> {
    /// Checks that `count` elements of `size` bytes, one every `stride`, lie in
    /// `bytes` from `offset` on.
    fn new(
        bytes: &'b [u8],
        offset: u64,
        stride: Option<u64>,
        size: usize,
        count: u64,
        asker: &str,
    ) -> Result<Self, String> {
        let stride = stride.unwrap_or(size as u64);
        if stride < size as u64 {
            return Err(format!("{asker} has a byteStride of {stride}, but its elements take {size} bytes"));
        }
        let end = count
            .checked_sub(1)
            .and_then(|n| n.checked_mul(stride))
            .and_then(|n| n.checked_add(size as u64))
            .and_then(|n| n.checked_add(offset));
        let fits = end.is_some_and(|e| e <= bytes.len() as u64);
        match (fits, usize::try_from(stride), usize::try_from(count), usize::try_from(offset)) {
            (true, Ok(stride), Ok(count), Ok(offset)) => {
                Ok(Elements { bytes: bytes.get(offset..).unwrap_or_default(), stride, size, count })
            }
            _ => Err(format!(
                "{asker} says {count} elements of {size} bytes, {stride} apart, from {offset} on, but its bufferView has only {} bytes",
                bytes.len()
            )),
        }
    }

    fn iter(&self) -> impl Iterator<Item = &'b [u8]> + '_ {
        (0..self.count).map(|i| self.bytes.get(i * self.stride..i * self.stride + self.size).unwrap_or_default())
    }
}

/// Reads the accessors of one file.
pub(super) struct Accessors<'a> {
    pub document: &'a Document,
    pub buffers: &'a Buffers<'a>,
    pub budget: &'a Budget,
}

impl Accessors<'_> {
    /// Vectors of `N` numbers, as positions and texture coordinates are.
    pub(super) fn floats<const N: usize>(&self, index: usize, asker: &str) -> Result<Vec<[f32; N]>, String> {
        let accessor = get(&self.document.accessors, index, "accessor", asker)?;
        let this = label("accessor", index, None);
        let component = Component::of(accessor.component_type, &this)?;
        expect_shape(accessor, N, &this)?;
        if component == Component::U32 {
            return Err(format!("{this} holds 32-bit integers, which {asker} cannot use as coordinates"));
        }
        let read = |b: &[u8]| {
            let size = component.size();
            std::array::from_fn(|k| component.float(b.get(k * size..).unwrap_or_default(), accessor.normalized))
        };
        self.read(accessor, component.size() * N, [0.0; N], read, &this)
    }

    /// Vertex indices.
    pub(super) fn indices(&self, index: usize, asker: &str) -> Result<Vec<u32>, String> {
        let accessor = get(&self.document.accessors, index, "accessor", asker)?;
        let this = label("accessor", index, None);
        let component = Component::of(accessor.component_type, &this)?;
        expect_shape(accessor, 1, &this)?;
        if component.index(&[]).is_none() {
            return Err(format!("{this} holds no unsigned integers, which {asker} needs for its indices"));
        }
        self.read(accessor, component.size(), 0, |b| component.index(b).unwrap_or_default(), &this)
    }

    fn read<T: Copy>(
        &self,
        accessor: &Accessor,
        size: usize,
        zero: T,
        read: impl Fn(&[u8]) -> T,
        this: &str,
    ) -> Result<Vec<T>, String> {
        if accessor.count == 0 {
            return Err(format!("{this} has no elements"));
        }
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let (bytes, stride) = self.buffers.view(view, this)?;
                let elements = Elements::new(bytes, accessor.byte_offset, stride, size, accessor.count, this)?;
                self.budget.take(accessor.count)?;
                elements.iter().map(&read).collect()
            }
            None if accessor.sparse.is_none() => {
                return Err(format!("{this} has neither a bufferView nor sparse values"));
            }
            None if accessor.count > MOST_UNBACKED => {
                return Err(format!(
                    "{this} says {} elements without a bufferView: at most {MOST_UNBACKED} are read",
                    accessor.count
                ));
            }
            None => {
                self.budget.take(accessor.count)?;
                vec![zero; accessor.count as usize]
            }
        };
        self.overlay(accessor, size, read, &mut values, this)?;
        Ok(values)
    }

    /// Puts the sparse values in their places.
    fn overlay<T>(
        &self,
        accessor: &Accessor,
        size: usize,
        read: impl Fn(&[u8]) -> T,
        values: &mut [T],
        this: &str,
    ) -> Result<(), String> {
        let Some(sparse) = &accessor.sparse else {
            return Ok(());
        };
        let this = format!("the sparse part of {this}");
        let component = Component::of(sparse.indices.component_type, &this)?;
        if component.index(&[]).is_none() {
            return Err(format!("{this} holds no unsigned integers for its indices"));
        }
        let (bytes, _) = self.buffers.view(sparse.indices.buffer_view, &this)?;
        let places = Elements::new(bytes, sparse.indices.byte_offset, None, component.size(), sparse.count, &this)?;
        let (bytes, _) = self.buffers.view(sparse.values.buffer_view, &this)?;
        let news = Elements::new(bytes, sparse.values.byte_offset, None, size, sparse.count, &this)?;
        self.budget.take(sparse.count)?;
        let there = values.len();
        for (place, new) in places.iter().zip(news.iter()) {
            let place = component.index(place).unwrap_or_default();
            let slot = values.get_mut(place as usize);
            *slot.ok_or_else(|| format!("{this} names element {place}, but there are only {there}"))? = read(new);
        }
        Ok(())
    }
}

fn expect_shape(accessor: &Accessor, n: usize, this: &str) -> Result<(), String> {
    let wanted = match n {
        1 => "SCALAR",
        2 => "VEC2",
        _ => "VEC3",
    };
    if accessor.shape != wanted {
        return Err(format!("{this} is of type {}, but must be {wanted}", super::document::quoted(&accessor.shape)));
    }
    Ok(())
}
