//! Where bytes come from: the GLB itself, data URIs and files beside it.

use super::document::{Document, get, label, quoted};
use base64::{Engine, engine::general_purpose::STANDARD};
use std::{
    borrow::Cow,
    cell::RefCell,
    collections::HashMap,
    path::{Path, PathBuf},
    rc::Rc,
};

/// The bytes a URI leads to. A file is read once, however often it is named.
pub(super) struct Files<'f> {
    folder: Option<&'f Path>,
    seen: RefCell<HashMap<String, Rc<Vec<u8>>>>,
}

impl<'f> Files<'f> {
    pub(super) fn new(folder: Option<&'f Path>) -> Self {
        Files { folder, seen: RefCell::default() }
    }

    /// Reads a URI; the message begins with `asker`.
    pub(super) fn read(&self, uri: &str, asker: &str) -> Result<Rc<Vec<u8>>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            return decode_data(data).map(Rc::new).map_err(|e| format!("{asker}: {e}"));
        }
        if let Some(bytes) = self.seen.borrow().get(uri) {
            return Ok(bytes.clone());
        }
        let path = relative(uri).map_err(|e| format!("{asker} names {}: {e}", quoted(uri)))?;
        let Some(folder) = self.folder else {
            return Err(format!("{asker} names the file {}, but there is no folder to look in", quoted(uri)));
        };
        let path = folder.join(path);
        // A pipe or device would never end.
        let bytes = std::fs::metadata(&path)
            .and_then(|m| if m.is_file() { std::fs::read(&path) } else { Err(std::io::ErrorKind::InvalidInput.into()) })
            .map_err(|e| format!("{asker} names {}, which cannot be read: {e}", quoted(uri)))?;
        let bytes = Rc::new(bytes);
        self.seen.borrow_mut().insert(uri.to_owned(), bytes.clone());
        Ok(bytes)
    }
}

fn decode_data(data: &str) -> Result<Vec<u8>, String> {
    let (kind, body) = data.split_once(',').ok_or("its data URI has no comma")?;
    if !kind.ends_with(";base64") {
        return Err("its data URI is not base64".into());
    }
    STANDARD.decode(body).map_err(|e| format!("its data URI is not base64: {e}"))
}

/// The path a relative URI means. A scene must not reach out of its folder, on
/// any system, so what is special anywhere is refused everywhere.
fn relative(uri: &str) -> Result<PathBuf, String> {
    let path = percent_decoded(uri)?;
    if path.contains(':') {
        return Err("only relative paths and data URIs are read".into());
    }
    if path.is_empty() || path.starts_with('/') || path.contains(['\\', '\0']) {
        return Err("only relative paths with forward slashes are read".into());
    }
    if path.split('/').any(|part| part == "..") {
        return Err("a path must not lead out of the folder by '..'".into());
    }
    Ok(path.into())
}

fn percent_decoded(uri: &str) -> Result<String, String> {
    let mut out = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        if byte == b'%' {
            let digits = after.get(..2).and_then(|d| std::str::from_utf8(d).ok());
            let value = digits.and_then(|d| u8::from_str_radix(d, 16).ok());
            out.push(value.ok_or("'%' must be followed by two hexadecimal digits")?);
            rest = after.get(2..).unwrap_or_default();
        } else {
            out.push(byte);
            rest = after;
        }
    }
    String::from_utf8(out).map_err(|_| "it is not UTF-8".into())
}

/// The buffers of a file, each as long as it says it is.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    list: Vec<(Loaded<'a>, usize)>,
}

enum Loaded<'a> {
    Inside(&'a [u8]),
    Outside(Rc<Vec<u8>>),
}

impl Loaded<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Loaded::Inside(b) => b,
            Loaded::Outside(b) => b,
        }
    }
}

impl<'a> Buffers<'a> {
    pub(super) fn load(document: &'a Document, bin: Option<&'a [u8]>, files: &Files<'_>) -> Result<Self, String> {
        let mut list = Vec::with_capacity(document.buffers.len());
        for (i, buffer) in document.buffers.iter().enumerate() {
            let asker = label("buffer", i, None);
            let loaded = match (&buffer.uri, bin) {
                (Some(uri), _) => Loaded::Outside(files.read(uri, &asker)?),
                (None, Some(bin)) if i == 0 => Loaded::Inside(bin),
                _ => return Err(format!("{asker} has no uri, and there is no GLB chunk for it")),
            };
            let there = loaded.bytes().len();
            let length = usize::try_from(buffer.byte_length)
                .ok()
                .filter(|&n| n <= there)
                .ok_or_else(|| format!("{asker} says {} bytes, but only {there} are there", buffer.byte_length))?;
            list.push((loaded, length));
        }
        Ok(Buffers { document, list })
    }

    /// The bytes of a buffer view, and its stride.
    pub(super) fn view(&self, index: usize, asker: &str) -> Result<(&[u8], Option<u64>), String> {
        let view = get(&self.document.buffer_views, index, "bufferView", asker)?;
        let this = label("bufferView", index, None);
        let (loaded, length) = get(&self.list, view.buffer, "buffer", &this)?;
        let start = usize::try_from(view.byte_offset).ok();
        let end = view.byte_offset.checked_add(view.byte_length).and_then(|e| usize::try_from(e).ok());
        let bytes = start.zip(end).filter(|&(_, e)| e <= *length).and_then(|(s, e)| loaded.bytes().get(s..e));
        let bytes = bytes.ok_or_else(|| {
            format!(
                "{this} takes {} bytes from {} on, but buffer {} has only {length}",
                view.byte_length, view.byte_offset, view.buffer
            )
        })?;
        Ok((bytes, view.byte_stride))
    }

    /// The bytes of an image.
    pub(super) fn image(&self, index: usize, files: &Files<'_>, asker: &str) -> Result<Cow<'_, [u8]>, String> {
        let image = get(&self.document.images, index, "image", asker)?;
        let this = label("image", index, None);
        match (&image.uri, image.buffer_view) {
            (Some(uri), None) => Ok(Cow::Owned(files.read(uri, &this)?.to_vec())),
            (None, Some(view)) => Ok(Cow::Borrowed(self.view(view, &this)?.0)),
            _ => Err(format!("{this} must have a uri or a bufferView, and not both")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_in_their_folder() {
        assert_eq!(relative("a%20b/c.bin").unwrap(), PathBuf::from("a b/c.bin"));
        for bad in [
            "",
            "/etc/passwd",
            "../x",
            "a/../../x",
            "a/%2e%2e/x",
            "C:/x",
            "file:x",
            "http://x",
            "a\\b",
            "%2fx",
            "%zz",
            "%",
        ] {
            assert!(relative(bad).is_err(), "{bad}");
        }
    }
}
