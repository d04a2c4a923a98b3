//! Parameters chosen by cross-validation, and their candidates.
//!
//! Choices are made by a sweep: every parameter in turn takes each of its values, the best stays. Accuracy is that of inner folds
//! over the training subjects, so nothing is ever tuned on who is tested. Values were laid out by what they mean (factors of two or
//! three about equal weight), not by what did best on any set.

use super::alignment::Alignment;
use super::classifier::{ClassifierKind, Family};
use super::frames::{Mode, Weights};
use super::model::Recogniser;
use super::space::{Layout, PatternKind, Space, SpaceSettings};
use std::sync::Arc;

/// One parameter of the space and the values it may take.
#[derive(Clone, Debug, PartialEq)]
pub enum Sweep {
    /// How the gallery is laid out, with the number of dimensions.
    Layout(Vec<(Layout, usize)>),
    /// Coefficient of the RBF map; without effect on principal components.
    Gamma(Vec<f32>),
    /// Members per dimension of the thesis' grid, or centres of a codebook.
    Pattern(Vec<PatternKind>),
    /// [`SpaceSettings::residuals`]; without effect on the thesis' grid.
    Residuals(Vec<usize>),
    /// [`Weights::box_weight`].
    BoxWeight(Vec<f32>),
    /// [`Weights::relative_weight`].
    RelativeWeight(Vec<f32>),
    /// [`Weights::motion_weight`]; without effect where order does not count.
    MotionWeight(Vec<f32>),
}

impl Sweep {
    /// The settings with this parameter at each of its values, those left out that change nothing.
    pub fn variants(&self, base: &SpaceSettings) -> Vec<SpaceSettings> {
        let with = |change: &dyn Fn(&mut SpaceSettings)| {
            let mut settings = base.clone();
            change(&mut settings);
            settings
        };
        let weighted = |values: &[f32], set: fn(&mut Weights, f32)| {
            values.iter().map(|&value| with(&|s| set(&mut s.weights, value))).collect()
        };
        let all: Vec<SpaceSettings> = match self {
            Self::Layout(values) => values
                .iter()
                .map(|&(layout, dimensions)| {
                    with(&|s| {
                        s.layout = layout;
                        s.dimensions = dimensions;
                    })
                })
                .collect(),
            Self::Gamma(_) if base.layout == Layout::Pca => Vec::new(),
            Self::Gamma(values) => values.iter().map(|&gamma| with(&|s| s.gamma = gamma)).collect(),
            Self::Pattern(values) => values.iter().map(|kind| with(&|s| s.pattern = kind.clone())).collect(),
            Self::Residuals(_) if matches!(base.pattern, PatternKind::Thesis(_)) => Vec::new(),
            Self::Residuals(values) => {
                values.iter().map(|&residuals| with(&|s| s.residuals = residuals)).collect()
            }
            Self::MotionWeight(_) if base.mode == Mode::OrderFree => Vec::new(),
            Self::BoxWeight(values) => weighted(values, |w, value| w.box_weight = value),
            Self::RelativeWeight(values) => weighted(values, |w, value| w.relative_weight = value),
            Self::MotionWeight(values) => weighted(values, |w, value| w.motion_weight = value),
        };
        all.into_iter().filter(|settings| settings != base).collect()
    }
}

/// Candidates of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Where the sweeps start.
    pub space: SpaceSettings,
    /// Parameters of the space, in the order in which they are chosen.
    pub sweeps: Vec<Sweep>,
    /// Sharpness of the codebook's soft assignments to choose from, with every space.
    pub sharpness: Vec<f32>,
    /// Classifiers to choose from, with every space.
    pub classifiers: Vec<ClassifierKind>,
    /// Whether the training clips' mirrors train too (people are left- and right-handed).
    pub mirror: bool,
    /// Folds of the choice inside the training subjects.
    pub inner_folds: usize,
    /// What of the clips that are recognised is brought to the training clips', without their labels.
    pub align: Alignment,
    /// Rounds of learning from one's own surest answers for the clips that are recognised ([`super::self_training`]); 0 for none.
    pub self_training: usize,
    /// A space that is learned already, of a model's network: then only the classifier is trained, and nothing about spaces is chosen.
    pub features: Option<Box<Space>>,
    /// The auxiliary model that decides whether a clip is unknown ([`super::auxiliary_model`]).
    pub second: Option<Arc<Recogniser>>,
}

impl Experiment {
    /// One space as it is, with a linear SVC; only sharpness and the SVC's cost are chosen.
    pub fn codebook(space: SpaceSettings) -> Self {
        Self {
            space,
            sweeps: Vec::new(),
            sharpness: vec![1.0, 2.0, 4.0],
            classifiers: Family::Svc.tried(),
            mirror: true,
            inner_folds: 4,
            align: Alignment::None,
            self_training: 0,
            features: None,
            second: None,
        }
    }

    /// The default method with everything chosen: layout, gamma, weights, size of the codebook, sharpness, the SVC's cost.
    pub fn searched(mode: Mode) -> Self {
        let even = Weights { relative_weight: 1.0, box_weight: 3.0, motion_weight: 1.0 };
        Self {
            sweeps: vec![
                Sweep::BoxWeight(vec![1.0, 3.0, 6.0, 12.0]),
                Sweep::Residuals(vec![0, 32]),
                Sweep::MotionWeight(vec![0.5, 1.0, 2.0]),
                Sweep::Layout(vec![(Layout::Pca, 20), (Layout::Pca, 10), (Layout::Isomap(12), 6)]),
                Sweep::Gamma(vec![0.03, 0.1, 0.3, 1.0]),
                Sweep::RelativeWeight(vec![0.0, 0.5, 1.0, 2.0]),
                Sweep::Pattern(vec![PatternKind::Codebook(100), PatternKind::Codebook(200)]),
            ],
            ..Self::codebook(SpaceSettings { mode, weights: even, ..SpaceSettings::default() })
        }
    }

    /// The thesis' method: 0/1 grids of several sizes over an Isomap embedding, gamma of its RBF map, k nearest neighbours.
    pub fn thesis() -> Self {
        let grid = |bins: [usize; 3]| PatternKind::Thesis(bins.to_vec());
        Self {
            space: SpaceSettings { pattern: grid([9, 9, 9]), ..SpaceSettings::thesis() },
            sweeps: vec![
                Sweep::Gamma(vec![0.03, 0.1, 0.3, 1.0]),
                Sweep::Pattern(vec![grid([6, 6, 6]), grid([9, 9, 9]), grid([15, 9, 9])]),
            ],
            sharpness: vec![1.0],
            classifiers: vec![ClassifierKind::Knn(1), ClassifierKind::Knn(3)],
            mirror: false,
            inner_folds: 4,
            align: Alignment::None,
            self_training: 0,
            features: None,
            second: None,
        }
    }

    /// A classifier on what a network gives for every view: features that a model learned from thousands of clips serve
    /// where one's own are few or look otherwise.
    pub fn on_features(space: Space, family: Family) -> Self {
        Self {
            space: space.settings.clone(),
            sharpness: vec![1.0],
            classifiers: family.tried(),
            features: Some(Box::new(space)),
            ..Self::codebook(SpaceSettings::default())
        }
    }

    /// The same with another classifier, its parameter chosen from all that it tries.
    #[must_use]
    pub fn with_classifier(self, family: Family) -> Self {
        Self { classifiers: family.tried(), ..self }
    }

    /// How many spaces are tried. Which variants of a parameter change nothing hangs on what was chosen before, so that a search may try some more or fewer.
    pub fn spaces(&self) -> usize {
        1 + self.sweeps.iter().map(|sweep| sweep.variants(&self.space).len()).sum::<usize>()
    }

    /// The same with nothing chosen: the first of everything.
    #[must_use]
    pub fn fixed(mut self) -> Self {
        self.sweeps.clear();
        self.sharpness.truncate(1);
        self.classifiers.truncate(1);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_leave_out_what_changes_nothing() {
        let base = SpaceSettings::default();
        assert!(
            Sweep::Gamma(vec![0.1, 0.2]).variants(&base).is_empty(),
            "principal components have no gamma"
        );
        assert!(Sweep::MotionWeight(vec![1.0]).variants(&base).is_empty(), "order-free has no motion");
        let boxed = Sweep::BoxWeight(vec![base.weights.box_weight, 2.0]).variants(&base);
        assert_eq!(boxed.len(), 1);
        assert_eq!(boxed[0].weights.box_weight, 2.0);
        let isomap = SpaceSettings::thesis();
        assert_eq!(Sweep::Gamma(vec![0.03, isomap.gamma]).variants(&isomap).len(), 1);
    }
}
