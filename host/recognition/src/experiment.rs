//! Parameters chosen by cross-validation, and their candidates. Each parameter in turn takes each of its values and the
//! best is kept, by the accuracy of inner folds over the training subjects. Values are factors of two or three around
//! equal weight, not tuned to any set.

use super::alignment::Alignment;
use super::classifier::{ClassifierKind, Family};
use super::frames::{Mode, Weights};
use super::model::Recogniser;
use super::space::{Layout, PatternKind, Space, SpaceSettings};
use std::sync::Arc;

/// A parameter of the space with its candidate values.
#[derive(Clone, Debug, PartialEq)]
pub enum Sweep {
    /// Layout of the gallery with its dimensions.
    Layout(Vec<(Layout, usize)>),
    /// Coefficient of the RBF map; no effect on principal components.
    Gamma(Vec<f32>),
    /// Members per dimension of the thesis' grid, or codebook size.
    Pattern(Vec<PatternKind>),
    /// [`SpaceSettings::residuals`]; no effect on the thesis' grid.
    Residuals(Vec<usize>),
    BoxWeight(Vec<f32>),
    RelativeWeight(Vec<f32>),
    /// [`Weights::motion_weight`]; no effect without order.
    MotionWeight(Vec<f32>),
}

impl Sweep {
    /// Settings with each value of the parameter, without those of no effect.
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
    /// Start of the sweeps.
    pub space: SpaceSettings,
    /// Sweeps in the order of choice.
    pub sweeps: Vec<Sweep>,
    /// Candidate sharpness values of soft assignments.
    pub sharpness: Vec<f32>,
    /// Candidate classifiers for every space.
    pub classifiers: Vec<ClassifierKind>,
    /// Also train on mirrored clips (left- and right-handed people).
    pub mirror: bool,
    /// Folds inside the training subjects.
    pub inner_folds: usize,
    /// Unsupervised alignment of recognised clips to the training clips.
    pub align: Alignment,
    /// Rounds of [`super::self_training`] on the recognised clips; 0 for none.
    pub self_training: usize,
    /// Pretrained space of a network: only the classifier is trained.
    pub features: Option<Box<Space>>,
    /// The auxiliary model that decides whether a clip is unknown ([`super::auxiliary_model`]).
    pub second: Option<Arc<Recogniser>>,
}

impl Experiment {
    /// One fixed space with a linear SVC; chooses sharpness and cost.
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

    /// Default method with a full search: layout, gamma, weights, codebook size, sharpness, cost.
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

    /// The thesis' method: 0/1 grids over an Isomap embedding, gamma of its RBF map, k nearest neighbours.
    pub fn thesis() -> Self {
        let grid = |bins: [usize; 3]| PatternKind::Thesis(bins.to_vec());
        Self {
            sweeps: vec![
                Sweep::Gamma(vec![0.03, 0.1, 0.3, 1.0]),
                Sweep::Pattern(vec![grid([6, 6, 6]), grid([9, 9, 9]), grid([15, 9, 9])]),
            ],
            sharpness: vec![1.0],
            classifiers: vec![ClassifierKind::Knn(1), ClassifierKind::Knn(3)],
            mirror: false,
            ..Self::codebook(SpaceSettings { pattern: grid([9, 9, 9]), ..SpaceSettings::thesis() })
        }
    }

    /// Classifier on a network's features, for few or unusual clips.
    pub fn on_features(space: Space, family: Family) -> Self {
        Self {
            space: space.settings.clone(),
            sharpness: vec![1.0],
            classifiers: family.tried(),
            features: Some(Box::new(space)),
            ..Self::codebook(SpaceSettings::default())
        }
    }

    /// Another classifier with all its candidate parameters.
    #[must_use]
    pub fn with_classifier(self, family: Family) -> Self {
        Self { classifiers: family.tried(), ..self }
    }

    /// Approximate number of spaces tried; it depends on earlier choices.
    pub fn spaces(&self) -> usize {
        1 + self.sweeps.iter().map(|sweep| sweep.variants(&self.space).len()).sum::<usize>()
    }

    /// Fixed settings: the first of each.
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
