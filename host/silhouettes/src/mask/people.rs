//! People in a cleaned mask: stacked nearby regions (split by a belt or low contrast) are one person.

use ndarray::ArrayView2;

use super::{
    BoundingBox, Mask,
    regions::{Connectivity, Region, regions},
    subject::SubjectSettings,
};

/// Fragments of one person, or of several that occlude each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    pub fragments: Vec<Region>,
    pub area: usize,
    pub bounds: BoundingBox,
}

impl Person {
    /// Mean of pixel centres as (row, column).
    #[must_use]
    pub fn centroid(&self) -> (f64, f64) {
        let mut mean = (0.0, 0.0);
        for fragment in &self.fragments {
            let share = fragment.area as f64 / self.area as f64;
            let (row, column) = fragment.centroid();
            mean = (mean.0 + share * row, mean.1 + share * column);
        }
        mean
    }

    #[must_use]
    pub fn mask(&self, size: (usize, usize)) -> Mask {
        let mut mask = Mask::from_elem(size, false);
        self.fragments.iter().for_each(|fragment| fragment.paint(&mut mask, true));
        mask
    }
}

/// Groups of fragments of a person's size, unordered. Quadratic in fragments.
#[must_use]
pub fn people(mask: ArrayView2<'_, bool>, settings: &SubjectSettings) -> Vec<Person> {
    let mut people: Vec<Person> = Vec::new();
    for region in regions(mask, true, Connectivity::Eight) {
        if region.area < settings.smallest_fragment_px {
            continue;
        }
        let mut whole = Person { area: region.area, bounds: region.bounds, fragments: vec![region] };
        // A fragment may join several groups, whose box may reach further ones.
        while let Some(at) = people.iter().position(|other| one_person(other.bounds, whole.bounds, settings))
        {
            let other = people.swap_remove(at);
            whole.area += other.area;
            whole.bounds = whole.bounds.union(other.bounds);
            whole.fragments.extend(other.fragments);
        }
        people.push(whole);
    }
    people.retain(|person| person.area >= settings.smallest_person_px);
    people
}

/// Near each other and stacked: at least half of the narrower is over or under the wider.
fn one_person(a: BoundingBox, b: BoundingBox, settings: &SubjectSettings) -> bool {
    let shared = a.right.min(b.right).saturating_sub(a.left.max(b.left));
    2 * shared >= a.width().min(b.width()) && a.gap(b) <= settings.widest_break_px
}
