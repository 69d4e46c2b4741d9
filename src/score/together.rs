//! What is found of the images of a method, reconciled: one renderer makes all of them in one way, so that what its
//! numbers mean is one thing, which all of its images together tell better than each of them.

use super::reading::Reader;
use crate::{
    disk::DiskError,
    intake::{self, Finding, Held, Reference},
    record::Shows,
    run::CaseImages,
};
use std::collections::BTreeMap;

/// What is found of the images of one case.
#[derive(Default)]
pub(super) struct Looked {
    /// What they are held against.
    pub reference: Reference,
    /// Width and height of the view.
    pub size: [usize; 2],
    /// Of each image.
    pub findings: Vec<Vec<Finding>>,
    /// What explains the numbers of all of them, and of the method's other cases where one thing explains these.
    pub shared: Option<Finding>,
}

/// The images of the self-check, as what they are held against tells of them.
#[derive(Default)]
pub(super) struct Checked {
    /// What is doubtful.
    pub doubts: Vec<String>,
    /// Images of openness or ratios, by which.
    pub images: Vec<(Vec<f32>, Shows)>,
    pub reference: Reference,
    pub width: usize,
    /// Whether something was found of what their numbers mean.
    pub has_meaning: bool,
}

impl Checked {
    /// Those that show the same as others, where something is wrong with their numbers.
    fn held(&self, shows: Shows) -> impl Iterator<Item = Held<'_>> {
        let own = self.images.iter().filter(move |(_, s)| *s == shows && self.has_meaning).take(MOST);
        own.map(|(image, _)| Held { image, reference: &self.reference.openness, width: self.width })
    }
}

/// Looks at all images, and reconciles what is found of what their numbers mean, method by method.
///
/// # Errors
/// Where references cannot be read.
pub(super) fn look(reader: &Reader<'_>, cases: &[CaseImages], checked: &Checked) -> Result<Vec<Looked>, DiskError> {
    let mut all = cases.iter().map(|case| reader.look(case)).collect::<Result<Vec<_>, _>>()?;
    let mut methods: BTreeMap<(&str, bool), Vec<usize>> = BTreeMap::new();
    for (i, case) in cases.iter().enumerate().filter(|(_, c)| c.shows() != Shows::Frame) {
        methods.entry((&case.case.estimator, case.shows() == Shows::Ratio)).or_default().push(i);
    }
    for members in methods.values() {
        let held = |of: &[usize]| of.iter().flat_map(|&i| sound(&cases[i], &all[i])).collect::<Vec<_>>();
        let is_told = |i: &usize| all[*i].findings.iter().flatten().any(Finding::is_meaning);
        if !members.iter().any(is_told) {
            continue;
        }
        let check: Vec<Held<'_>> = checked.held(cases[members[0]].shows()).collect();
        let own = held(members);
        let shared = intake::meaning_of(&[own.clone(), check].concat()).or_else(|| intake::meaning_of(&own));
        let alone = |i: &usize| shared.clone().or_else(|| intake::meaning_of(&held(&[*i])));
        let told: Vec<Option<Finding>> = members.iter().map(alone).collect();
        for (&i, shared) in members.iter().zip(told) {
            if let Some(shared) = &shared {
                intake::agree(&mut all[i].findings, shared);
            }
            all[i].shared = shared;
        }
    }
    Ok(all)
}

/// So many images of a case tell what is done to all of them.
const MOST: usize = 8;

/// Images of a case of which nothing is wrong but what their numbers mean.
fn sound<'a>(case: &'a CaseImages, looked: &'a Looked) -> impl Iterator<Item = Held<'a>> {
    let images = case.images.as_deref().unwrap_or_default().iter().zip(&looked.findings);
    let own = images.filter(|(_, found)| found.iter().all(|f| f.is_meaning() || f.is_doubt())).take(MOST);
    own.map(|(image, _)| Held { image, reference: &looked.reference.openness, width: looked.size[0] })
}
