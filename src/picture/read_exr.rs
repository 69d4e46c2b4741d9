//! OpenEXR of any program: several parts, any channel names, data windows anywhere.

use super::read::{Alpha, Found, LayerChoice};
use crate::{
    claim,
    disk::DiskError,
    metrics::image::{Encoding, Image},
};
use exr::prelude::{ReadChannels, ReadLayers};
use std::{collections::BTreeMap, io::Cursor, path::Path};

/// The ending of a grey layer's channel, as OpenEXR viewers expect it.
const GREY: &str = ".Y";

/// A channel with the shape of its part.
struct Channel {
    size: [usize; 2],
    origin: [i32; 2],
    values: Vec<f32>,
}

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
    Ok(channels.iter().map(|c| c.name.to_string()).map(|n| n.strip_suffix(GREY).unwrap_or(&n).to_owned()).collect())
}

/// Reads the layers asked for.
pub(super) fn decode(
    path: &Path,
    bytes: &[u8],
    choice: LayerChoice<'_>,
    encoding: Encoding,
) -> Result<Vec<Found>, DiskError> {
    claim::exr(path, bytes)?;
    let mut channels = Channels::read(path, bytes)?;
    let wanted = match choice {
        LayerChoice::Main => vec![channels.main(path)?],
        LayerChoice::Named(name) => vec![channels.named(path, name)?],
        LayerChoice::All => channels.layers(),
    };
    let all = choice == LayerChoice::All;
    let take = |names: Vec<String>| {
        // Where all layers are taken, alpha is one of them.
        let alpha = if all { Alpha::None } else { channels.alpha(&names) };
        Ok(Found { alpha, ..channels.take(path, &names, encoding)? })
    };
    wanted.into_iter().map(take).collect()
}

/// The names of the three channels of a colour layer.
fn three(prefix: &str) -> Vec<String> {
    ["R", "G", "B"].map(|c| format!("{prefix}{c}")).to_vec()
}

impl Channels {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self, DiskError> {
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
            let name = part.attributes.layer_name.as_ref().map_or_else(|| format!("part-{i}"), ToString::to_string);
            let prefix = if parts > 1 { format!("{name}.") } else { String::new() };
            let at = part.attributes.layer_position;
            for channel in part.channel_data.list {
                let name = channel.name.to_string();
                let name = prefix.clone() + name.strip_suffix(GREY).unwrap_or(&name);
                let channel = Channel {
                    size: [part.size.0, part.size.1],
                    origin: [at.0, at.1],
                    values: channel.sample_data.values_as_f32().collect(),
                };
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

    fn names(&self) -> String {
        self.all.keys().cloned().collect::<Vec<_>>().join(", ")
    }

    fn main(&self, path: &Path) -> Result<Vec<String>, DiskError> {
        let colors = three(&self.first);
        if self.has(&colors) {
            return Ok(colors);
        }
        let one = ["Y", "mean"].map(|n| vec![self.first.clone() + n]);
        match one.into_iter().find(|n| self.has(n)) {
            Some(one) => Ok(one),
            None if self.all.len() == 1 => Ok(self.all.keys().cloned().collect()),
            None => Err(DiskError::content(path, format!("several layers, name one of them: {}", self.names()))),
        }
    }

    fn named(&self, path: &Path, name: &str) -> Result<Vec<String>, DiskError> {
        let prefix = if name.is_empty() { String::new() } else { format!("{name}.") };
        [three(&prefix), vec![name.to_owned()]]
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

    /// Of the channel `A` beside a layer of colours, or beside `Y`.
    fn alpha(&self, names: &[String]) -> Alpha {
        let prefix = names.first().and_then(|n| n.strip_suffix(if names.len() == 3 { 'R' } else { 'Y' }));
        let alpha = prefix.filter(|p| p.is_empty() || p.ends_with('.')).and_then(|p| self.all.get(&format!("{p}A")));
        alpha.map_or(Alpha::None, |a| Alpha::of(a.values.iter().map(|&v| v == 1.0)))
    }

    fn take(&mut self, path: &Path, names: &[String], encoding: Encoding) -> Result<Found, DiskError> {
        let layer = match names {
            [one] => one.clone(),
            [red, ..] => red.strip_suffix('R').unwrap_or(red).to_owned() + "RGB",
            [] => String::new(),
        };
        let channels: Vec<Channel> = names.iter().filter_map(|name| self.all.remove(name)).collect();
        let (size, origin) = channels.first().map_or(([0, 0], [0, 0]), |c| (c.size, c.origin));
        let planes = channels.into_iter().map(|c| c.values).collect();
        let image = Image::new(size, planes, encoding)
            .map_err(|e| DiskError::content(path, format!("layer '{layer}': {e}")))?;
        Ok(Found { image, layer, origin, alpha: Alpha::None })
    }
}
