//! OpenEXR of any program: several parts, any channel names, data windows anywhere.

use super::{
    channel::{Channel, Group, Numbers},
    read::{Alpha, Found, LayerChoice},
};
use crate::{
    claim,
    disk::DiskError,
    metrics::image::{Encoding, Image},
};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, Text};
use std::{collections::BTreeMap, io::Cursor, path::Path};

/// The ending of a grey layer's channel, as OpenEXR viewers expect it.
const GREY: &str = ".Y";

/// All channels of a file by name. Where it has several parts, the part's name and a
/// dot stand before the channel's.
struct Channels {
    /// What stands before the channels of the first part.
    first: String,
    all: BTreeMap<String, Channel>,
}

fn broken(path: &Path, e: &dyn std::fmt::Display) -> DiskError {
    DiskError::content(path, format!("not a readable OpenEXR image: {e}"))
}

/// Width and height of the first part, by the header alone.
pub(super) fn exr_size(path: &Path, bytes: &[u8]) -> Result<[usize; 2], DiskError> {
    let meta = claim::exr(path, bytes)?;
    let header = meta.headers.first().ok_or_else(|| DiskError::content(path, "the image has no part"))?;
    Ok([header.layer_size.0, header.layer_size.1])
}

/// Names of the channels of the first part.
pub(super) fn names(path: &Path, bytes: &[u8]) -> Result<Vec<String>, DiskError> {
    let first = claim::exr(path, bytes)?.headers.into_iter().next();
    let channels = first.map(|h| h.channels.list).unwrap_or_default();
    let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    Ok(names.iter().map(|name| called("", name, &names)).collect())
}

/// Whether one layer stands for the image, by the headers alone.
pub(super) fn has_main(path: &Path, bytes: &[u8]) -> Result<bool, DiskError> {
    let headers = claim::exr(path, bytes)?.headers;
    let mut channels = Channels { first: String::new(), all: BTreeMap::new() };
    for (i, header) in headers.iter().enumerate() {
        let prefix = prefix(headers.len(), i, header.own_attributes.layer_name.as_ref());
        let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
        for name in &names {
            let name = called(&prefix, name, &names);
            let numbers = Numbers::Float(Vec::new());
            channels.all.insert(name.clone(), Channel { name, size: [0, 0], origin: [0, 0], numbers });
        }
        if i == 0 {
            channels.first = prefix;
        }
    }
    Ok(channels.main(path).is_ok())
}

/// What stands before the names of a part's channels.
fn prefix(parts: usize, part: usize, name: Option<&Text>) -> String {
    let name = name.map_or_else(|| format!("part-{part}"), ToString::to_string);
    if parts > 1 { format!("{name}.") } else { String::new() }
}

/// What a channel of a part that has these is called here. Beside X or Z, Y is one of a vector, as of normals, and
/// no grey layer.
fn called(prefix: &str, name: &str, part: &[String]) -> String {
    let is_grey =
        |base: &&str| !part.iter().any(|n| n.strip_prefix(*base).is_some_and(|axis| axis == ".X" || axis == ".Z"));
    prefix.to_owned() + name.strip_suffix(GREY).filter(is_grey).unwrap_or(name)
}

/// Reads the layers asked for.
pub(super) fn decode(
    path: &Path,
    bytes: &[u8],
    choice: LayerChoice<'_>,
    encoding: Encoding,
) -> Result<Vec<Found>, DiskError> {
    let mut channels = Channels::read(path, bytes)?;
    let (all, wanted) = (choice == LayerChoice::All, channels.wanted(path, choice)?);
    let take = |names: Vec<String>| {
        // Where all layers are taken, alpha is one of them.
        let (alpha, others) =
            if all { (Alpha::None, Vec::new()) } else { (channels.alpha(&names), channels.beside(&names)) };
        Ok(Found { alpha, others, ..channels.take(path, &names, encoding)? })
    };
    wanted.into_iter().map(take).collect()
}

/// Reads the channels of the layers asked for as they are stored; without `choice` all
/// of the file together.
pub(super) fn stored(path: &Path, bytes: &[u8], choice: Option<LayerChoice<'_>>) -> Result<Vec<Group>, DiskError> {
    let mut channels = Channels::read(path, bytes)?;
    let Some(choice) = choice else {
        return Ok(vec![Group { layer: String::new(), channels: channels.all.into_values().collect() }]);
    };
    let wanted = channels.wanted(path, choice)?;
    let group = |names: Vec<String>| {
        let layer = title(&names);
        let called: &[&str] = if names.len() == 3 { &["R", "G", "B"] } else { &["Y"] };
        let taken = names.iter().filter_map(|name| channels.all.remove(name));
        let channels = taken.zip(called).map(|(c, name)| Channel { name: (*name).to_owned(), ..c }).collect();
        Group { layer, channels }
    };
    Ok(wanted.into_iter().map(group).collect())
}

/// The names of the three channels of a colour layer.
fn three(prefix: &str) -> Vec<String> {
    ["R", "G", "B"].map(|c| format!("{prefix}{c}")).to_vec()
}

/// What reports call a layer of these channels.
fn title(names: &[String]) -> String {
    match names {
        [one] => one.clone(),
        [red, ..] => red.strip_suffix('R').unwrap_or(red).to_owned() + "RGB",
        [] => String::new(),
    }
}

/// The name that a layer of these channels is asked for by.
fn asked_by(names: &[String]) -> &str {
    let first = names.first().map_or("", String::as_str);
    if names.len() == 3 { first.strip_suffix(".R").unwrap_or(first) } else { first }
}

impl Channels {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self, DiskError> {
        claim::exr(path, bytes)?;
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(|e| broken(path, &e))?;
        let parts = image.layer_data.len();
        let mut channels = Channels { first: String::new(), all: BTreeMap::new() };
        for (i, part) in image.layer_data.into_iter().enumerate() {
            let prefix = prefix(parts, i, part.attributes.layer_name.as_ref());
            let at = part.attributes.layer_position;
            let names: Vec<String> = part.channel_data.list.iter().map(|c| c.name.to_string()).collect();
            for channel in part.channel_data.list {
                let name = called(&prefix, &channel.name.to_string(), &names);
                let numbers = match channel.sample_data {
                    FlatSamples::F16(v) => Numbers::Float(v.into_iter().map(exr::prelude::f16::to_f32).collect()),
                    FlatSamples::F32(v) => Numbers::Float(v),
                    FlatSamples::U32(v) => Numbers::Unsigned(v),
                };
                let (size, origin) = ([part.size.0, part.size.1], [at.0, at.1]);
                let channel = Channel { name: name.clone(), size, origin, numbers };
                if channels.all.insert(name.clone(), channel).is_some() {
                    return Err(DiskError::content(path, format!("there are two layers '{name}'")));
                }
            }
            if i == 0 {
                channels.first = prefix;
            }
        }
        Ok(channels)
    }

    fn has(&self, wanted: &[String]) -> bool {
        wanted.iter().all(|w| self.all.contains_key(w))
    }

    fn wanted(&self, path: &Path, choice: LayerChoice<'_>) -> Result<Vec<Vec<String>>, DiskError> {
        Ok(match choice {
            LayerChoice::Main => vec![self.main(path)?],
            LayerChoice::Named(name) => vec![self.named(path, name)?],
            LayerChoice::All => self.layers(),
        })
    }

    /// The names that layers can be asked for by.
    fn names(&self) -> String {
        self.layers().iter().map(|names| asked_by(names)).collect::<Vec<_>>().join(", ")
    }

    fn main(&self, path: &Path) -> Result<Vec<String>, DiskError> {
        let colors = three(&self.first);
        if self.has(&colors) {
            return Ok(colors);
        }
        // With X and Z, Y is one of the three of CIE XYZ.
        let is_xyz = self.has(&["X", "Y", "Z"].map(|n| self.first.clone() + n));
        let one = ["Y", "mean"].map(|n| vec![self.first.clone() + n]);
        if let Some(one) = one.into_iter().find(|n| self.has(n) && !(is_xyz && n[0].ends_with('Y'))) {
            return Ok(one);
        }
        let mut layers = self.layers();
        let alphas: Vec<String> = layers.iter().filter_map(|names| self.alpha_of(names)).collect();
        layers.retain(|names| names.len() > 1 || !alphas.contains(&names[0]));
        match layers.pop() {
            Some(only) if layers.is_empty() => Ok(only),
            _ => Err(DiskError::content(path, format!("several layers, name one of them: {}", self.names()))),
        }
    }

    fn named(&self, path: &Path, name: &str) -> Result<Vec<String>, DiskError> {
        let prefix = if name.is_empty() { String::new() } else { format!("{name}.") };
        let grey = name.strip_suffix(GREY).unwrap_or(name);
        [three(&prefix), vec![name.to_owned()], vec![grey.to_owned()]]
            .into_iter()
            .find(|wanted| self.has(wanted))
            .ok_or_else(|| DiskError::content(path, format!("no layer '{name}'; there are: {}", self.names())))
    }

    /// Every layer; the channels of a colour layer are one.
    fn layers(&self) -> Vec<Vec<String>> {
        let colors_of = |name: &str| name.strip_suffix(['R', 'G', 'B']).map(three).filter(|c| self.has(c));
        let mut layers = Vec::new();
        for name in self.all.keys() {
            match colors_of(name) {
                Some(colors) if name.ends_with('R') => layers.push(colors),
                Some(_) => {}
                None => layers.push(vec![name.clone()]),
            }
        }
        layers
    }

    /// The channel `A` beside a layer of colours, or beside `Y`.
    fn alpha_of(&self, names: &[String]) -> Option<String> {
        let prefix = names.first()?.strip_suffix(if names.len() == 3 { 'R' } else { 'Y' })?;
        let alpha = format!("{prefix}A");
        ((prefix.is_empty() || prefix.ends_with('.')) && self.all.contains_key(&alpha)).then_some(alpha)
    }

    fn alpha(&self, names: &[String]) -> Alpha {
        let alpha = self.alpha_of(names).and_then(|name| self.all.get(&name));
        alpha.map_or(Alpha::None, |a| if a.numbers.are_one() { Alpha::One } else { Alpha::Varied })
    }

    /// The channels that are not taken with these; not an alpha of 1 everywhere, which
    /// says nothing.
    fn beside(&self, names: &[String]) -> Vec<String> {
        let solid = self.alpha_of(names).filter(|_| self.alpha(names) == Alpha::One);
        self.all.keys().filter(|name| !names.contains(name) && Some(*name) != solid.as_ref()).cloned().collect()
    }

    fn take(&mut self, path: &Path, names: &[String], encoding: Encoding) -> Result<Found, DiskError> {
        let layer = title(names);
        let channels: Vec<Channel> = names.iter().filter_map(|name| self.all.remove(name)).collect();
        let (size, origin) = channels.first().map_or(([0, 0], [0, 0]), |c| (c.size, c.origin));
        let planes = channels.into_iter().map(|c| c.numbers.into_floats()).collect();
        let image = Image::new(size, planes, encoding)
            .map_err(|e| DiskError::content(path, format!("layer '{layer}': {e}")))?;
        Ok(Found { image, layer, origin, alpha: Alpha::None, others: Vec::new() })
    }
}
