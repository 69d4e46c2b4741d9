//! Pictures side by side, at most four in a row.

use super::super::gallery::Gallery;
use crate::disk::DiskError;
use serde::Serialize;

/// Pictures in a row: what a page of 832 pixels shows well.
const COLUMNS: usize = 4;

/// A picture in a page.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Picture {
    alt: String,
    /// Safe as the target of a link.
    link: String,
}

impl Picture {
    /// None where it was not drawn.
    pub(super) fn new(gallery: &Gallery, alt: &str, place: &str) -> Result<Option<Self>, DiskError> {
        Ok(gallery.link(place)?.map(|link| Picture { alt: alt.to_owned(), link }))
    }
}

/// A plot in a page, or why there is none.
#[derive(Debug, Serialize)]
pub(super) struct Plot {
    picture: Option<Picture>,
    why: Option<String>,
}

impl Plot {
    pub(super) fn new(gallery: &Gallery, alt: &str, place: &str) -> Result<Self, DiskError> {
        let picture = Picture::new(gallery, alt, place)?;
        Ok(Plot { picture, why: gallery.why(place).map(str::to_owned) })
    }
}

/// Pictures under one caption.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) caption: String,
    pub(super) pictures: Vec<Option<Picture>>,
}

/// What a page shows as one table: in each of its bands captions, and under them rows of
/// pictures.
#[derive(Debug, Serialize)]
pub(super) struct Grid {
    columns: usize,
    bands: Vec<Band>,
}

#[derive(Debug, Serialize)]
struct Band {
    captions: Vec<String>,
    rows: Vec<Vec<Option<Picture>>>,
}

impl Grid {
    /// None of no pictures.
    pub(super) fn new(columns: Vec<Column>) -> Option<Self> {
        let columns: Vec<Column> = columns.into_iter().filter(|c| c.pictures.iter().any(Option::is_some)).collect();
        // Five are three and two rather than four and one.
        let bands = columns.len().div_ceil(COLUMNS);
        let width = columns.len().checked_div(bands)?;
        let width = width + usize::from(width * bands < columns.len());
        let band = |columns: &[Column]| {
            let fill = width - columns.len();
            let mut captions: Vec<String> = columns.iter().map(|c| c.caption.clone()).collect();
            captions.extend(vec![String::new(); fill]);
            let deep = columns.iter().map(|c| c.pictures.len()).max().unwrap_or(0);
            let row = |i: usize| -> Vec<Option<Picture>> {
                let mut row: Vec<_> = columns.iter().map(|c| c.pictures.get(i).cloned().flatten()).collect();
                row.extend(vec![None; fill]);
                row
            };
            let rows = (0..deep).map(row).filter(|row| row.iter().any(Option::is_some)).collect();
            Band { captions, rows }
        };
        Some(Grid { columns: width, bands: columns.chunks(width).map(band).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_four_at_most() {
        let picture = Picture { alt: "a".into(), link: "l".into() };
        let column = |i: usize| Column {
            caption: i.to_string(),
            pictures: vec![Some(picture.clone()), (i > 0).then(|| picture.clone())],
        };
        for (n, expected) in [(1, vec![1]), (4, vec![4]), (5, vec![3, 2]), (9, vec![3, 3, 3]), (10, vec![4, 4, 2])] {
            let grid = Grid::new((0..n).map(column).collect()).unwrap();
            let real = |b: &Band| b.captions.iter().filter(|c| !c.is_empty()).count();
            assert_eq!(grid.bands.iter().map(real).collect::<Vec<_>>(), expected);
            assert!(grid.bands.iter().all(|b| b.captions.len() == grid.columns));
            assert!(grid.bands.iter().flat_map(|b| &b.rows).all(|r| r.len() == grid.columns));
            assert_eq!(grid.bands[0].rows.len(), if n == 1 { 1 } else { 2 });
        }
        assert!(Grid::new(vec![]).is_none());
        assert!(Grid::new(vec![Column { caption: "x".into(), pictures: vec![None] }]).is_none());
    }
}
