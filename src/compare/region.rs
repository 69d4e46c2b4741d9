//! Which part of two images is compared: rectangles, a crop, and the weights they
//! and a mask come to.

use super::CompareError;
use std::{fmt, str::FromStr};

/// A rectangle of pixels.
///
/// ```
/// use aogauge::compare::Rect;
/// let rect: Rect = "10,20,300,40".parse()?;
/// assert_eq!((rect.x, rect.y, rect.width, rect.height), (10, 20, 300, 40));
/// assert!("10,20,0,40".parse::<Rect>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// Columns left of it.
    pub x: usize,
    /// Rows above it.
    pub y: usize,
    /// Columns, 1 or more.
    pub width: usize,
    /// Rows, 1 or more.
    pub height: usize,
}

impl FromStr for Rect {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is no rectangle: x,y,width,height in pixels, such as 10,20,300,40");
        let numbers: Vec<usize> =
            text.split(',').map(|n| n.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
        match numbers[..] {
            [x, y, width, height] if width > 0 && height > 0 => Ok(Rect { x, y, width, height }),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for Rect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},{}", self.x, self.y, self.width, self.height)
    }
}

impl Rect {
    /// All of an image.
    pub(super) fn whole([width, height]: [usize; 2]) -> Self {
        Rect { x: 0, y: 0, width, height }
    }

    fn check(&self, option: &'static str, [width, height]: [usize; 2]) -> Result<(), CompareError> {
        let inside =
            |from: usize, length: usize, whole: usize| from.checked_add(length).is_some_and(|end| end <= whole);
        if inside(self.x, self.width, width) && inside(self.y, self.height, height) {
            return Ok(());
        }
        Err(CompareError::Outside { option, rect: *self, size: [width, height] })
    }

    fn fill(&self, weights: &mut [f32], width: usize, value: f32) {
        for row in self.y..self.y + self.height {
            let from = row * width + self.x;
            weights[from..from + self.width].fill(value);
        }
    }
}

/// Rectangles of the whole image that are left out, that alone count, and that is
/// cut out of both images before anything else is computed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// Left out.
    pub ignore: Vec<Rect>,
    /// Nothing but these counts, where there are any.
    pub only: Vec<Rect>,
    /// The part of both images that is compared.
    pub crop: Option<Rect>,
}

/// What a mask's pixels weigh, 0 to 1, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// A weight a pixel.
    pub weights: Vec<f32>,
}

impl Region {
    /// Whether it is the whole image.
    pub fn is_whole(&self) -> bool {
        *self == Region::default()
    }

    /// Checks every rectangle against the size of an image.
    ///
    /// # Errors
    /// [`CompareError::Outside`] where one reaches beyond it.
    pub fn check(&self, size: [usize; 2]) -> Result<(), CompareError> {
        self.ignore.iter().try_for_each(|r| r.check("--ignore", size))?;
        self.only.iter().try_for_each(|r| r.check("--only", size))?;
        self.crop.iter().try_for_each(|r| r.check("--crop", size))
    }

    /// The weights of the whole image, before the crop: the product of the mask, 0
    /// within what is ignored, and 0 outside what alone counts. None where all are 1.
    ///
    /// # Errors
    /// Where a rectangle reaches beyond the image, or the mask has another size.
    pub fn weights(&self, size: [usize; 2], mask: Option<&Weights>) -> Result<Option<Vec<f32>>, CompareError> {
        self.check(size)?;
        let pixels = size[0] * size[1];
        if let Some(mask) = mask.filter(|m| m.size != size) {
            return Err(crate::metrics::image::ImageError::MaskSize { mask: mask.size, image: size }.into());
        }
        if mask.is_none() && self.ignore.is_empty() && self.only.is_empty() {
            return Ok(None);
        }
        let mut weights = vec![if self.only.is_empty() { 1.0 } else { 0.0 }; pixels];
        self.only.iter().for_each(|r| r.fill(&mut weights, size[0], 1.0));
        self.ignore.iter().for_each(|r| r.fill(&mut weights, size[0], 0.0));
        if let Some(mask) = mask {
            weights.iter_mut().zip(&mask.weights).for_each(|(w, m)| *w *= m);
        }
        Ok(Some(weights))
    }

    /// The part of a plane that the crop leaves; the crop must lie within it.
    pub fn cut<'a, T: Copy>(&self, size: [usize; 2], plane: &'a [T]) -> std::borrow::Cow<'a, [T]> {
        let Some(crop) = self.crop else {
            return plane.into();
        };
        let rows = plane.chunks_exact(size[0]).skip(crop.y).take(crop.height);
        rows.flat_map(|row| row[crop.x..crop.x + crop.width].iter().copied()).collect::<Vec<T>>().into()
    }

    /// The size after the crop.
    pub fn size(&self, whole: [usize; 2]) -> [usize; 2] {
        self.crop.map_or(whole, |c| [c.width, c.height])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_a_product() {
        let rect = |text: &str| text.parse::<Rect>().unwrap();
        let region = Region { ignore: vec![rect("1,0,1,1")], only: vec![rect("0,0,2,2"), rect("2,1,1,1")], crop: None };
        let mask = Weights { size: [3, 2], weights: vec![0.5, 1.0, 1.0, 1.0, 1.0, 0.25] };
        assert_eq!(region.weights([3, 2], Some(&mask)).unwrap().unwrap(), [0.5, 0.0, 0.0, 1.0, 1.0, 0.25]);
        assert_eq!(Region::default().weights([3, 2], None).unwrap(), None);
        let turned = Region::default().weights([2, 3], Some(&mask)).unwrap_err().to_string();
        assert!(turned.contains("the mask has 3 x 2 pixels, the images have 2 x 3"), "{turned}");
        let message = region.weights([2, 2], None).unwrap_err().to_string();
        assert!(message.contains("--only 2,1,1,1 reaches beyond the image of 2 x 2 pixels"), "{message}");
        let huge = Region { crop: Some(Rect { x: usize::MAX, y: 0, width: 2, height: 1 }), ..Region::default() };
        assert!(huge.check([2, 2]).is_err());
    }

    #[test]
    fn a_crop_is_cut_out_of_planes() {
        let region = Region { crop: Some("1,1,2,1".parse().unwrap()), ..Region::default() };
        assert_eq!(region.cut([3, 2], &[0, 1, 2, 3, 4, 5]).as_ref(), [4, 5]);
        assert_eq!(region.size([3, 2]), [2, 1]);
        for text in ["", "1,2,3", "1,2,3,4,5", "-1,0,1,1", "a,b,c,d", "0,0,1,0", "0,0,99999999999999999999,1"] {
            assert!(text.parse::<Rect>().is_err(), "{text}");
        }
    }
}
